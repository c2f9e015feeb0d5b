"""How links look: colours of forces and laws, widths, dashes, and the keys that explain them; one for all pictures."""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.colors import LinearSegmentedColormap, ListedColormap
from matplotlib.lines import Line2D

from latinpc.laws import Law

from .units import scaled

COMPRESSION = LinearSegmentedColormap.from_list("compression", ["#fdbb84", "#fc8d59", "#d7301f", "#67000d"])
TENSION = LinearSegmentedColormap.from_list("tension", ["#9ecae1", "#4a98c9", "#1764ab", "#08306b"])
SLACK_COLOUR = "#c800a1"
GHOST_COLOUR = (0.75, 0.75, 0.75, 0.8)  # what is drawn behind
IDLE_COLOUR = "#c0c0c0"  # links without force
NO_FORCE = 1e-6  # of the largest force
LAW_COLOURS = ("#555555", "#1764ab", "#d7301f", "#1b9e77", "#7b3294", "#7b3294", "#7b3294")  # by number of `Law`
TABLE_COLOUR = "#b8860b"  # laws of tables, and of the user's
MANY_LINKS = 4000  # beyond, dashes and the undeformed shape only blur the picture
DASHES = (0, (2.0, 1.6))
TOUCHING = (Law.CONTACT, Law.FRICTION)


class Scale:
    """Colours of forces: warm in compression, cool in tension, equally strong for forces of equal size.

    Parameters
    ----------
    *forces : array
        In N, compression negative: all that the pictures on this scale show.
    """

    def __init__(self, *forces):
        whole = np.concatenate([np.ravel(array) for array in forces])
        self.low, self.high = min(whole.min(initial=0.0), 0.0), max(whole.max(initial=0.0), 0.0)
        self.largest = max(-self.low, self.high)
        self.divisor, self.unit = scaled(self.largest, "N")

    def none(self, forces):
        """Return which forces are none but for rounding, (m,) of bool."""
        return np.abs(np.asarray(forces, dtype=float)) <= NO_FORCE * self.largest

    def colours(self, forces):
        """Return the colours (m, 4) of forces (m,), grey where there is none."""
        return np.where(self.none(forces)[:, None], matplotlib.colors.to_rgba(IDLE_COLOUR), self._warm(forces))

    def _warm(self, forces):
        forces = np.asarray(forces, dtype=float)
        share = np.abs(forces) / max(self.largest, 1e-300)
        return np.where((forces < 0.0)[:, None], COMPRESSION(share), TENSION(share))

    def map(self):
        """Return a colour map from the lowest force to the highest."""
        return ListedColormap(self._warm(np.linspace(self.low, self.high, 512)))

    @property
    def label(self):
        """What the colour bar says."""
        return f"Force ({self.unit}), compression negative" if self.low < 0.0 else f"Tension ({self.unit})"


def thinness(count):
    """Return the width of a cable in points, of a picture of that many links; bars are twice as wide."""
    return float(np.clip(45.0 / np.sqrt(count), 0.28, 1.3))


def widths_of(law):
    """Return the widths of links (points) by their laws: bars are thick, cables thin."""
    thin = thinness(len(law))
    return np.where(law == Law.BAR, 2.0 * thin, thin)


def force_look(law, tensions, loose, scale):
    """Return colours, widths and line styles of links by the forces that they bear.

    Contacts are as wide as their force, so that chains of force stand out; slack links have a colour of their own.

    Parameters
    ----------
    law : (m,) array of int
    tensions : (m,) array
        In N.
    loose : (m,) array of bool
        Slack links.
    scale : Scale

    Returns
    -------
    colours : (m, 4) array
    widths : (m,) array
        In points.
    styles : list
    """
    thin = thinness(len(law))
    colours = scale.colours(tensions)
    colours[loose] = matplotlib.colors.to_rgba(SLACK_COLOUR)
    widths = widths_of(law)
    widths[loose] = 1.25 * thin
    touch = np.isin(law, TOUCHING)
    push = np.where(loose, 0.0, np.maximum(-tensions, 0.0))[touch]  # dashes of rounding's width would have no end
    widths[touch] = 6.0 * thin * push / max(scale.largest, 1e-300)
    dashed = len(tensions) <= MANY_LINKS
    wide = widths > 0.0  # dashes are as long as lines are wide: PDF and SVG know none of no length
    return colours, widths, [DASHES if dashed and free else (0, None) for free in loose & wide]


def force_keys(law, loose, idle=0, film=False, discs=None):
    """Return the keys of a legend: the kinds of links in grey, and how many are slack or bear nothing.

    The legend of a film is the same in all frames: that of slack links is there anyway. `discs` are the contacts that
    are drawn as discs.
    """
    keys = []
    if (law == Law.BAR).any():
        keys.append(Line2D([], [], color="#555555", linewidth=2.6, label="bar"))
    for kind in (Law.CABLE, Law.COMPRESSION_ONLY, Law.INEXTENSIBLE):
        chosen = law == kind
        if chosen.any():
            name = kind.noun
            keys.append(Line2D([], [], color="#555555", linewidth=1.1, label=name))
            share = 100.0 * loose[chosen].mean()
            if not share and not film:
                continue
            text = f"slack {name.removeprefix('inextensible ')} ({share:.3g} %)"
            keys.append(Line2D([], [], color=SLACK_COLOUR, linewidth=1.6, linestyle=DASHES, label=text))
    if idle:
        keys.append(Line2D([], [], color=IDLE_COLOUR, linewidth=2.6, label=f"no force ({idle:,})"))
    touch = np.isin(law, TOUCHING)
    if touch.any():
        text = f"contact, wide as its force\n({100.0 * loose[touch].mean():.3g} % are open)"
        round_ones = discs is not None and discs[touch].all()
        style = {"marker": "o", "markersize": 7, "linestyle": "none"} if round_ones else {"linewidth": 3.0}
        keys.append(Line2D([], [], color="#555555", label=text, **style))
    return keys


def law_name(law):
    """Return what a link of a law, a number, is called."""
    return Law(law).noun if law < len(Law) else "law of a table or of the user's"


def law_colours(law):
    """Return a colour (m,) for each link by its law."""
    palette = np.array([*LAW_COLOURS, TABLE_COLOUR])
    return palette[np.minimum(law, len(LAW_COLOURS))]


def law_keys(law):
    """Return the keys of a legend that names the laws of links by their colours."""
    kinds, keys = np.minimum(law, len(LAW_COLOURS)), []
    for number in np.unique(kinds):
        colour = [*LAW_COLOURS, TABLE_COLOUR][number]
        label = f"{law_name(number)} ({np.count_nonzero(kinds == number):,})"
        keys.append(Line2D([], [], color=colour, linewidth=2.6 if number == Law.BAR else 1.4, label=label))
    return keys
