"""Draw structures: supports, loads and numbers as they are given; forces in the links on the deformed shape.

Compression has warm colours and tension cool ones, on one scale. Bars are thick, cables thin, and slack cables and
compression-only links have a colour of their own.
"""

from __future__ import annotations

from numbers import Real

import matplotlib
import numpy as np
from matplotlib.lines import Line2D

from latinpc.laws import Law

from .drawing import (
    SUPPORT_COLOUR,
    axes_for,
    draw_arrows,
    draw_discs,
    draw_links,
    draw_symbols,
    force_bar,
    label_axes,
    load_keys,
    new_figure,
    plane_points,
    save,
    stamp,
    symbol_keys,
)
from .look import (
    GHOST_COLOUR,
    MANY_LINKS,
    TOUCHING,
    Scale,
    force_keys,
    force_look,
    law_colours,
    law_keys,
    thinness,
    widths_of,
)
from .mechanics import slack
from .symbols import MANY_SYMBOLS, arrows, supports
from .units import counted, number, scaled

NUMBERED = 60  # nodes, up to which numbers are readable
ROUNDING = 1e-12  # of the structure: displacements that are none
DISC = 1.6  # diameter of the disc of a contact between nodes at one place, over its width as a line
VISIBLE = 0.08  # of the structure: how large displacements are drawn
MAIN_2D, MAIN_3D = (0.07, 0.08, 0.66, 0.80), (0.0, 0.0, 0.80, 0.91)  # rectangles of a figure


def round_factor(value):
    """Return the largest of 1, 2, 5, 10, .. (and their fractions) that is not above `value`."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(digit for digit in (1, 2, 5) if digit * power <= value * (1 + 1e-12)))


def amplification_of(nodes, largest, asked=None, geometry="linear"):
    """Return the factor that is asked for, or a round one.

    That makes the largest displacement (m) visible beside the structure; 1 for rounding, and 1 or more where links
    turn: what is drawn smaller is no equilibrium.
    """
    if asked is not None:
        if not isinstance(asked, Real) or not np.isfinite(asked):
            raise ValueError(f"the amplification of displacements is a finite number, not {asked!r}")
        return float(asked)
    span = np.ptp(nodes, axis=0).max()
    factor = round_factor(VISIBLE * span / largest) if largest > ROUNDING * span else 1.0
    return max(factor, 1.0) if geometry == "large" else factor


def drawn_links(scene):
    """Return which links are lines to draw: those that act along the line between their nodes, or at one place."""
    if scene.direction is None:
        return np.ones(len(scene.links), bool)
    line = scene.nodes[scene.links[:, 1]] - scene.nodes[scene.links[:, 0]]
    along = np.abs(np.einsum("ij,ij->i", line, scene.directions))
    return (scene.law != Law.TANGENT) & (along >= 0.5 * np.linalg.norm(line, axis=1))


def at_one_place(scene, links):
    """Return which of the links are contacts between nodes at one place: lines of no length."""
    line = scene.nodes[scene.links[links, 1]] - scene.nodes[scene.links[links, 0]]
    return np.isin(scene.law[links], TOUCHING) & ~line.any(axis=1)


def draw_forces(axes, segments, look, loose, discs):
    """Draw links with the look of `force_look`; of those in `discs` a disc in the middle."""
    colours, widths, styles = look
    order = np.argsort(loose, kind="stable")  # slack links last: on top where depth does not decide
    draw_links(axes, segments[order], colours[order], widths[order], [styles[link] for link in order])
    if discs.any():
        draw_discs(axes, segments[discs].mean(axis=1), colours[discs], DISC * widths[discs])


def draw_structure(scene, displacements, tensions, subdomain=None, path="structure.png", **how):
    """Draw a `structure_figure` into a ``.png``, ``.pdf`` or ``.svg`` file, replaced only once it is complete."""
    save(structure_figure(scene, displacements, tensions, subdomain, **how), path)


def structure_figure(
    scene, displacements, tensions, subdomain=None, *, amplification=None, figure=None, load=None, numbers=False,
    word="", reason="", geometry="linear",
):  # fmt: skip
    """Draw the deformed structure with the forces in its links, its supports, its loads, and its subdomains.

    Parameters
    ----------
    scene : Scene or Structure
    displacements : (n, dim) array
        In m.
    tensions : (m,) array
        In N, compression negative.
    subdomain : (m,) array of int, optional
        Subdomain of each link, drawn in a corner.
    amplification : float, optional
        Of the displacements; by default a round number that makes them visible.
    figure : matplotlib.figure.Figure, optional
        To draw into; a new one when not given.
    load : (n, dim) array, optional
        In N, that of the scene when not given.
    numbers : bool
        Write the numbers of nodes and links.
    word, reason : str
        A stamp across the picture, such as "NOT CONVERGED", and why.
    geometry : str
        That of the solve: with ``"large"`` displacements are drawn as they are, or larger.

    Returns
    -------
    matplotlib.figure.Figure
    """
    tensions = np.asarray(tensions, dtype=float)
    seen = drawn_links(scene)  # what acts across the line between its nodes is no line to draw
    loose = slack(scene, tensions)[seen]
    nodes, moved = plane_points(scene.nodes), in_plane(displacements)
    largest = np.linalg.norm(moved, axis=1).max(initial=0.0)
    amplification = amplification_of(nodes, largest, amplification, geometry)
    shape = nodes + amplification * moved
    sketch = Sketch(scene, shape, seen, load, figure, [nodes])
    scale = Scale(tensions[seen])
    if len(sketch.ends) <= MANY_LINKS:
        sketch.lines(nodes, GHOST_COLOUR, 0.5, zorder=1)
    discs = at_one_place(scene, np.flatnonzero(seen))
    draw_forces(sketch.axes, shape[sketch.ends], force_look(sketch.law, tensions[seen], loose, scale), loose, discs)
    sketch.symbols()
    if numbers:
        sketch.numbers()
    force_bar(sketch.figure, [0.86, 0.53, 0.014, 0.34], scale)
    idle = np.count_nonzero(scale.none(tensions[seen]) & ~loose & ~np.isin(sketch.law, TOUCHING))
    sketch.legend(force_keys(sketch.law, loose, idle, discs=discs), 0.50)
    if subdomain is not None and np.max(subdomain) > 0:
        _draw_subdomains(sketch.figure, nodes[sketch.ends], np.asarray(subdomain)[seen])
    divisor, unit = scaled(largest, "m")
    moves = f"largest displacement {largest / divisor:.3g} {unit}"
    sketch.title(moves + (f", drawn × {number(amplification)}" if largest > 0 else ""))
    if word:
        stamp(sketch.figure, word, reason)
    return sketch.figure


def plan_figure(scene, *, numbers=None, figure=None):
    """Draw a structure as it is given: links coloured by their laws, supports, loads, numbers of nodes and links.

    Parameters
    ----------
    scene : Scene or Structure
    numbers : bool, optional
        Write the numbers; by default where they are few enough to be read.
    figure : matplotlib.figure.Figure, optional
        To draw into; a new one when not given.

    Returns
    -------
    matplotlib.figure.Figure
    """
    nodes = plane_points(scene.nodes)
    sketch = Sketch(scene, nodes, drawn_links(scene), None, figure, [])
    sketch.lines(nodes, law_colours(sketch.law), widths_of(sketch.law))
    sketch.symbols()
    if numbers or (numbers is None and len(nodes) <= NUMBERED):
        sketch.numbers()
    sketch.legend(law_keys(sketch.law), 0.90)
    sketch.title(counted(len(nodes), "node"))
    return sketch.figure


class Sketch:
    """A figure of one structure: axes around all that is drawn, its symbols, numbers, legend and title.

    Parameters
    ----------
    scene : Scene or Structure
    shape : (n, 2 or 3) array
        Where the nodes are drawn.
    seen : (m,) array of bool
        Links that are drawn.
    load : (n, dim) array or None
        In N.
    figure : matplotlib.figure.Figure or None
    beside : list of (n, 2 or 3) array
        Other places that the axes must show.
    """

    def __init__(self, scene, shape, seen, load, figure, beside):
        if figure is not None and not hasattr(figure, "add_axes"):
            raise TypeError(f"figure must be of matplotlib, not {figure!r:.40}; plot().savefig(path) writes a picture")
        self.scene, self.shape = scene, shape
        self.law, self.ends, self._seen = scene.law[seen], scene.links[seen], np.flatnonzero(seen)
        self._count = len(seen)
        nodes = plane_points(scene.nodes)
        self.load = in_plane(scene.load if load is None else load)
        self._supports = supports(scene.fixed, nodes, self.ends, shape)
        self._arrows, self._loaded = arrows(self.load, nodes, self.ends, shape)
        if np.count_nonzero(np.any(self.load, axis=1)) > MANY_SYMBOLS:
            self._arrows = self._arrows[:0]
        extent = [shape, *beside, *(one.triangles.reshape(-1, shape.shape[1]) for one in self._supports)]
        extent.append(self._arrows.reshape(-1, shape.shape[1]))
        self.figure = new_figure(12.0, 7.2) if figure is None else figure
        rectangle = MAIN_3D if shape.shape[1] == 3 else MAIN_2D
        self.axes = axes_for(self.figure, rectangle, np.vstack(extent))
        label_axes(self.figure, self.axes)

    def lines(self, points, colours, widths, zorder=2):
        """Draw the links between other places of the nodes."""
        draw_links(self.axes, points[self.ends], colours, widths, zorder=zorder)

    def symbols(self):
        """Draw supports and loads."""
        draw_symbols(self.axes, self._supports)
        draw_arrows(self.axes, self._arrows)

    def numbers(self):
        """Write the numbers of nodes and links."""
        style = {"fontsize": 7, "ha": "center", "va": "center", "zorder": 8, "clip_on": False, "parse_math": False}
        box = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.8}
        links = self._seen if self.scene.links_named else []  # names of two nodes are too long
        for link, place in zip(links, self.shape[self.ends].mean(axis=1)):
            self.axes.text(*place, self.scene.link_name(link), color="#1764ab", bbox=box, **style)
        box = {"boxstyle": "circle,pad=0.2", "facecolor": "white", "edgecolor": "#333333", "linewidth": 0.5}
        for node, place in enumerate(self.shape):
            self.axes.text(*place, self.scene.node_name(node), color="black", bbox=box, **style | {"fontsize": 6})
        self._numbered = True

    def legend(self, keys, top):
        """Add the legend, with supports and loads."""
        keys = [*keys, *symbol_keys(self._supports)]
        held = np.count_nonzero(self.scene.fixed.any(axis=1))
        if held and not self._supports:
            keys.append(Line2D([], [], linestyle="none", label=f"{held:,} supported nodes\n(not drawn)"))
        largest = np.linalg.norm(self.load, axis=1).max(initial=0.0)
        keys += load_keys(len(self._loaded), largest, len(self._arrows) > 0)
        if getattr(self, "_numbered", False):
            keys.append(Line2D([], [], color="#1764ab", marker="$7$", markersize=6, linestyle="none", label="link"))
            marker = {"marker": "o", "markersize": 7, "markerfacecolor": "white", "markeredgecolor": SUPPORT_COLOUR}
            keys.append(Line2D([], [], linestyle="none", label="node", **marker))
        self.figure.legend(handles=keys, loc="upper left", bbox_to_anchor=(0.80, top), fontsize=9, frameon=False)

    def title(self, text):
        """Write the name of the structure, and what is drawn."""
        self.figure.text(0.02, 0.955, self.scene.name, fontsize=14, weight="bold", parse_math=False)
        count = len(self.ends)
        links = counted(count, "link") if count == self._count else f"{count:,} of {self._count:,} links drawn"
        self.figure.text(0.98, 0.958, f"{links} · {text}", fontsize=10, ha="right")


def in_plane(vectors):
    """Return vectors as `plane_points` returns points."""
    return plane_points(np.asarray(vectors, dtype=float))


def _draw_subdomains(figure, segments, subdomain):
    """Draw the links coloured by subdomain, small, seen as the structure is."""
    palette = matplotlib.colormaps["tab20"].colors
    colours = np.array([palette[(7 * number) % 20] for number in range(subdomain.max() + 1)])[subdomain]
    points = segments.reshape(-1, segments.shape[2])
    axes = axes_for(figure, [0.79, 0.035, 0.205, 0.20], points, elevation=40.0, fill=0.95, gaps=())
    axes.set_axis_off()
    axes.patch.set_alpha(0.0)
    draw_links(axes, segments, colours, 0.7 * thinness(len(segments)))
    figure.text(0.8925, 0.02, counted(len(np.unique(subdomain)), "subdomain"), fontsize=9, ha="center")
