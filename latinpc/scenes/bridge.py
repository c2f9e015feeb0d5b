"""A footbridge of tensegrity: struts that float between prestressed cables."""

from __future__ import annotations

import numpy as np

from .prestress import held, positive
from .scene import Law, Scene

PANEL, WIDTH, GAP = 1.0, 1.5, 0.4  # length of a panel, width of the deck, height of the least struts (m)
STRUTS, CABLES = 2.0e7, 2.0e6  # EA (N)


def bridge(
    panels: int = 12,
    height: float = 0.05,
    prestress: float = 20000.0,
    load: float = 100.0,
    crowd: float = 4000.0,
    wind: float = 0.0,
) -> Scene:
    """Footbridge between two abutments: two cables sag, one arches, struts hold them apart; large displacements.

    At each cross-section two struts, crosswise, push the cable in the middle up and those at the sides down, and a
    cable ties the two sides. The shapes are parabolas, in balance as drawn. But for its prestress each cross-section
    moves freely: a load on a half of the span is the heavy one, and slackens the ties under it.

    Parameters
    ----------
    panels : int
        Panels along the span, 1 m long.
    height : float
        Rise of the middle cable and sag of those at the sides, over the span.
    prestress : float
        Horizontal part of the tension of each cable at the sides (N).
    load : float
        Downward force on each node (N).
    crowd : float
        Downward force on each node of the deck in the first half of the span (N).
    wind : float
        Force across the bridge on each node (N).

    Returns
    -------
    Scene
    """
    if panels < 2:
        raise ValueError(f"a bridge has at least 2 panels, not {panels}")
    positive(prestress=prestress, height=height)
    place = np.arange(panels + 1) / panels
    curve = 4.0 * height * panels * PANEL * place * (1.0 - place)
    x, side = place * panels * PANEL, np.full(panels + 1, WIDTH / 2.0)
    lines = [(x, 0.0 * side, GAP + curve), (x, side, -curve), (x, -side, -curve)]  # the middle, the two sides
    nodes = np.concatenate([np.column_stack(line) for line in lines])
    number = np.arange(len(nodes)).reshape(3, -1)
    along = np.stack([number[:, :-1], number[:, 1:]], axis=2)
    inner = number[:, 1:-1]
    across = np.stack([np.stack([inner[a], inner[b]], axis=1) for a, b in ((0, 1), (0, 2), (1, 2))])
    links = np.concatenate([along.reshape(-1, 2), across.reshape(-1, 2)])
    flat = prestress / PANEL * np.array([2.0, 1.0, 1.0])  # force densities of the cables along
    turn = 8.0 * height * PANEL / panels  # second difference of the curve
    strut = -flat[1] * turn / (GAP + 2.0 * curve[1:-1])  # lifts the middle, pushes the sides down and apart
    density = np.concatenate([np.repeat(flat, panels), strut, strut, -0.5 * strut])
    length = np.linalg.norm(nodes[links[:, 1]] - nodes[links[:, 0]], axis=1)
    kinds = [3 * panels, 2 * (panels - 1), panels - 1]
    force = np.tile([0.0, wind, -load], (len(nodes), 1))
    force[number[1:, place <= 0.5], 2] -= crowd
    names = ("panels", "height", "prestress", "load", "crowd", "wind")
    metadata = dict(zip(names, (int(panels), *map(float, (height, prestress, load, crowd, wind)))))
    fixed = np.zeros(len(nodes), bool)
    fixed[number[:, [0, -1]]] = True
    return held(
        "bridge", nodes, links, np.repeat([Law.CABLE, Law.BAR, Law.CABLE], kinds), density * length,
        np.repeat([CABLES, STRUTS, CABLES], kinds), fixed, force, metadata,
    )  # fmt: skip
