"""A mast on a pin, held by guys."""

from __future__ import annotations

import numpy as np

from .prestress import held, positive
from .scene import Law, Scene

PANEL, RADIUS = 1.0, 0.5  # height of a panel, distance of the legs from the axis (m)
REACH = 0.7  # of the anchors from the mast, over the height of the guys
MAST, GUYS = 4.0e7, 1.0e6  # EA (N)
PIECES = 4  # links of a guy
WEIGHT = 2.0  # of the guys, on each of their nodes (N)


def mast(
    levels: int = 3,
    panels: int = 5,
    prestress: float = 2000.0,
    load: float = 100.0,
    wind: float = 50.0,
    direction: float = 0.0,
) -> Scene:
    """Lattice mast on a pin, held by guys in three directions at several levels; large displacements.

    Legs and braces of a triangular cross-section are bars; each guy is a chain of cables that weigh little. But for the
    prestress of the guys the mast turns about its axis. Wind slackens the guys behind it, which then hang on their
    weight.

    Parameters
    ----------
    levels : int
        Levels of guys.
    panels : int
        Panels of the mast below each level, 1 m high.
    prestress : float
        Tension of each guy (N).
    load : float
        Downward force on each node of the mast (N).
    wind : float
        Horizontal force on each node of the mast (N).
    direction : float
        Direction of the wind, from the first guys (degrees).

    Returns
    -------
    Scene
    """
    if levels < 1 or panels < 1:
        raise ValueError(f"a mast has at least one level and one panel, not {levels} and {panels}")
    positive(prestress=prestress)
    count = levels * panels
    nodes, legs, rings, braces = _lattice(count)
    tops = 1 + 3 * (panels * np.arange(1, levels + 1)[:, None] - 1) + np.arange(3)
    pull = REACH / np.hypot(REACH, 1.0) * prestress, prestress / np.hypot(REACH, 1.0)  # of a guy, outwards and down
    push = pull[1] * (levels - np.arange(count) // panels)  # of each leg, downwards
    out = np.where(np.arange(1, count + 1) % panels, 0.0, pull[0])  # of each corner of a ring
    out[0] += push[0] * RADIUS / PANEL  # the legs of the foot spread
    slope = np.where(np.arange(count), 1.0, np.hypot(RADIUS, PANEL) / PANEL)
    guys, more, anchors = _guys(nodes, tops)
    links = np.concatenate([legs.reshape(-1, 2), rings.reshape(-1, 2), braces, guys])
    bars = len(links) - len(guys)
    tension = [-np.repeat(push * slope, 3), np.repeat(out / np.sqrt(3.0), 3), np.zeros(len(braces))]
    mass = len(nodes)
    nodes = np.concatenate([nodes, more])
    turn = np.radians(direction)
    force = np.tile([0.0, 0.0, -WEIGHT], (len(nodes), 1))
    force[:mass] = [wind * np.cos(turn), wind * np.sin(turn), -load]
    fixed = np.zeros(len(nodes), bool)
    fixed[0] = fixed[anchors] = True
    names = ("levels", "panels", "prestress", "load", "wind", "direction")
    metadata = dict(zip(names, (int(levels), int(panels), *map(float, (prestress, load, wind, direction)))))
    return held(
        "mast", nodes, links, np.repeat([Law.BAR, Law.CABLE], [bars, len(guys)]),
        np.concatenate([*tension, np.full(len(guys), prestress)]), np.repeat([MAST, GUYS], [bars, len(guys)]),
        fixed, force, metadata,
    )  # fmt: skip


def _lattice(count):
    """Return the nodes of the mast, the pin first, its legs and rings (count, 3, 2) from below, and its braces."""
    angle = 2.0 * np.pi / 3.0 * np.arange(3)
    corner = RADIUS * np.column_stack([np.cos(angle), np.sin(angle)])
    height = PANEL * np.arange(1, count + 1)
    nodes = np.column_stack([np.tile(corner, (count, 1)), np.repeat(height, 3)])
    number = 1 + np.arange(3 * count).reshape(count, 3)
    legs = np.stack([np.concatenate([np.zeros((1, 3), int), number[:-1]]), number], axis=2)
    rings = np.stack([number, np.roll(number, -1, axis=1)], axis=2)
    turn = np.where(np.arange(count - 1) % 2, 1, 2)[:, None]  # to and fro
    upper = np.take_along_axis(number[1:], (np.arange(3) + turn) % 3, axis=1)
    braces = np.stack([number[:-1], upper], axis=2).reshape(-1, 2)
    return np.concatenate([np.zeros((1, 3)), nodes]), legs, rings, braces


def _guys(nodes, tops):
    """Return the links of the guys from their tops, their nodes, and the numbers of their anchors."""
    top = nodes[tops.ravel()]
    anchor = top * (1.0 + REACH * top[:, 2:] / RADIUS) * [1.0, 1.0, 0.0]
    part = np.arange(1, PIECES + 1)[:, None] / PIECES
    more = top[:, None] + part * (anchor - top)[:, None]
    number = len(nodes) + np.arange(len(top) * PIECES).reshape(-1, PIECES)
    chain = np.concatenate([tops.reshape(-1, 1), number], axis=1)
    return np.stack([chain[:, :-1], chain[:, 1:]], axis=2).reshape(-1, 2), more.reshape(-1, 3), number[:, -1]
