"""A saddle of cables between clamped ends."""

from __future__ import annotations

import numpy as np

from .prestress import held, positive, squares
from .scene import Law, Scene

MESH = 1.0  # side of a mesh in plan (m)
EA = 1.0e6  # of the cables (N)


def saddle(
    side: int = 10, height: float = 0.1, prestress: float = 1000.0, load: float = 500.0, wind: float = 0.0
) -> Scene:
    """Square net of prestressed cables on a saddle, clamped at its rim; large displacements.

    Cables along x sag the other way than those along y: z = 2 height L ((x/L)^2 - (y/L)^2) from the middle of the side
    L. Tension over length is the same in all of them, with which the nodes are in balance as drawn. Loads downwards
    slacken those that arch. A flat net (height 0) is a mechanism but for its prestress.

    Parameters
    ----------
    side : int
        Meshes along a side.
    height : float
        Height of the high points of the rim over the low ones, over the side.
    prestress : float
        Tension of a cable that lies level (N).
    load : float
        Downward force on each node (N); 300 to 500 N slacken 10 % of the cables, more stretches them again.
    wind : float
        Force along x on each node (N).

    Returns
    -------
    Scene
    """
    positive(prestress=prestress)
    grid, cables = squares(side)
    rim = ((grid == 0) | (grid == side)).any(axis=1)
    cables = cables[~rim[cables].all(axis=1)]  # none along the rim
    used, cables = np.unique(cables, return_inverse=True)
    cables, grid, rim = cables.reshape(-1, 2), grid[used], rim[used]
    place = grid / side - 0.5
    z = 2.0 * height * side * (place[:, 0] ** 2 - place[:, 1] ** 2)
    nodes = MESH * np.column_stack([grid, z])
    length = np.linalg.norm(nodes[cables[:, 1]] - nodes[cables[:, 0]], axis=1)
    metadata = {"side": int(side), "height": float(height), "prestress": float(prestress), "load": float(load)}
    metadata |= {"wind": float(wind)}
    force = np.tile([wind, 0.0, -load], (len(nodes), 1))
    law = np.full(len(cables), Law.CABLE)
    return held("saddle", nodes, cables, law, prestress / MESH * length, EA, rim, force, metadata)
