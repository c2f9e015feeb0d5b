"""Draw a motion that no link resists: what moves in red, the rest faint; a small part fills the picture."""

from __future__ import annotations

import numpy as np
from matplotlib.lines import Line2D

from latinpc.geometry import Geometry
from latinpc.numbering import Numbering

from .drawing import STAMP_COLOUR, axes_for, draw_links, plane_points, stamp
from .limit import moving
from .look import DASHES, GHOST_COLOUR, SLACK_COLOUR, thinness, widths_of
from .pictures import NUMBERED, VISIBLE, Sketch, drawn_links
from .units import counted

MOVES = 0.05  # of the largest displacement: less is not seen
SMALL = 0.4  # of the structure: a part that is smaller fills the picture,
ROOM = 0.1  # with the links around it: of the part, how far from it they begin
NAMED = 8


def motion_figure(
    scene, motion, *, loose=None, numbers=None, figure=None, load=None, word="MECHANISM", reason=None
):  # fmt: skip
    """Draw a motion (`latinpc.results.mechanism.free_motion`), with a stamp.

    Parameters
    ----------
    scene : Scene or Structure
    motion : (n, dim) array
    loose : (m,) array of bool, optional
        Slack links, which follow the motion.
    numbers : bool, optional
        Write the numbers; by default where they are few enough to be read.
    figure : matplotlib.figure.Figure, optional
        To draw into; a new one when not given.
    load : (n, dim) array, optional
        In N, that of the scene when not given.
    word, reason : str
        The stamp, and why; by default with the nodes that move.

    Returns
    -------
    matplotlib.figure.Figure
    """
    nodes, moved = plane_points(scene.nodes), plane_points(np.asarray(motion, dtype=float))
    size = np.linalg.norm(moved, axis=1)
    moves = size[scene.links].max(axis=1) > MOVES * size.max()
    ends = np.union1d(scene.links[moves], np.flatnonzero(size > MOVES * size.max()))
    low, high = nodes[ends].min(axis=0), nodes[ends].max(axis=0)
    whole = np.ptp(nodes, axis=0).max()
    extent = (high - low).max() or whole
    shape = nodes + 1.5 * VISIBLE * extent * moved / size.max()
    near, chosen = np.ones(len(nodes), bool), np.ones(len(scene.links), bool)
    if extent < SMALL * whole:
        near = ((nodes >= low - ROOM * extent) & (nodes <= high + ROOM * extent)).all(axis=1)
        chosen = near[scene.links].any(axis=1)
        near[scene.links[chosen]] = True
    part = scene if near.all() else _Part(scene, near, chosen)
    force = scene.load if load is None else load
    sketch = _draw(part, shape[near], moves[chosen], None if loose is None else loose[chosen], force[near], figure)
    if numbers or (numbers is None and max(len(part.nodes), len(part.links)) <= NUMBERED):
        sketch.numbers()
    sketch.legend(_keys(sketch.loose), 0.90)
    if part is not scene:
        _draw_whole(sketch.figure, nodes[scene.links], moves)
    sketch.title(counted(len(part.nodes), "node"))
    if reason is None:
        far = moving(motion)
        named = scene.node_names(sorted(far[:NAMED]), len(far) > NAMED)
        reason = f"no link resists the motion drawn, of any size; nodes that move: {named}"
    stamp(sketch.figure, word, reason)
    return sketch.figure


def _draw(scene, shape, moves, loose, load, figure):
    """Draw all as given, faint, and what moves where it goes; return the sketch, with the slack links of that."""
    seen = drawn_links(scene)
    sketch = Sketch(scene, plane_points(scene.nodes), seen, load, figure, [shape])
    widths, moves = widths_of(sketch.law), moves[seen]
    sketch.lines(plane_points(scene.nodes), GHOST_COLOUR, widths)
    sketch.loose = (np.zeros(len(seen), bool) if loose is None else loose)[seen][moves]
    colours = np.where(sketch.loose, SLACK_COLOUR, STAMP_COLOUR)
    styles = [DASHES if one else (0, None) for one in sketch.loose]
    draw_links(sketch.axes, shape[sketch.ends[moves]], colours, widths[moves], styles, zorder=3)
    sketch.symbols()
    return sketch


def _keys(loose):
    """Return the keys of the legend."""
    keys = [Line2D([], [], color=GHOST_COLOUR, linewidth=2.0, label="as given")]
    if not loose.all():
        keys.append(Line2D([], [], color=STAMP_COLOUR, linewidth=2.0, label="motion that no link resists"))
    if loose.any():
        style = {"color": SLACK_COLOUR, "linewidth": 1.6, "linestyle": DASHES}
        keys.append(Line2D([], [], label="motion of slack links", **style))
    return keys


def _draw_whole(figure, segments, moves):
    """Draw the whole structure in a corner, what moves in red."""
    points = segments.reshape(-1, segments.shape[2])
    axes = axes_for(figure, [0.79, 0.035, 0.205, 0.20], points, fill=0.95, gaps=())
    axes.set_axis_off()
    axes.patch.set_alpha(0.0)
    draw_links(axes, segments, GHOST_COLOUR, 0.7 * thinness(len(segments)))
    draw_links(axes, segments[moves], STAMP_COLOUR, 1.5, zorder=3)
    figure.text(0.8925, 0.02, "where that is", fontsize=9, ha="center")


class _Part(Geometry):
    """Some nodes and links of a structure, under the names that they have there."""

    def __init__(self, scene, near, chosen):
        self.name, self.nodes, self.fixed = scene.name, scene.nodes[near], scene.fixed[near]
        self.links, self.law = (np.cumsum(near) - 1)[scene.links[chosen]], scene.law[chosen]
        self.direction = None if scene.direction is None else scene.direction[chosen]
        nodes = np.array([scene.node_name(node) for node in np.flatnonzero(near)])
        links = np.array([scene.link_name(link) for link in np.flatnonzero(chosen)])
        self.numbering = Numbering(nodes, links if scene.links_named else None)
