"""A hypar of cables between four points, with edge cables."""

from __future__ import annotations

import numpy as np

from .network import Balance
from .prestress import held, positive, squares
from .scene import Law, Scene

MESH = 1.0  # side of a mesh in plan (m)
EA = 1.0e6  # of the cables of the net (N)


def hypar(
    side: int = 8,
    height: float = 0.3,
    sag: float = 0.1,
    prestress: float = 1000.0,
    load: float = 50.0,
    wind: float = 0.0,
) -> Scene:
    """Net of prestressed cables between two high and two low points, with edge cables; large displacements.

    Tension over length is the same in all cables of the net, and in all edge cables so much more that these sag by
    the given part of the side: with these force densities the nodes are in balance as drawn [H.-J. Schek 1974].

    Parameters
    ----------
    side : int
        Meshes along a side.
    height : float
        Height of the high points over the low ones, over the side.
    sag : float
        Sag of the edge cables in plan, over the side.
    prestress : float
        Tension of a cable of the net, for the length of a mesh (N).
    load : float
        Downward force on each node (N).
    wind : float
        Force along x on each node (N).

    Returns
    -------
    Scene
    """
    positive(prestress=prestress, sag=sag)
    grid, cables = squares(side)
    at_end = (grid == 0) | (grid == side)
    edge = (at_end[cables[:, 0]] & at_end[cables[:, 1]]).any(axis=1)
    corner = at_end.all(axis=1)
    more = side / (8.0 * sag)  # a parabola whose chords turn by as much as a cable of the net pulls
    density = prestress / MESH * np.where(edge, more, 1.0)
    u, v = grid.T / side
    nodes = MESH * np.column_stack([grid, height * side * np.where(corner, u + v - 2.0 * u * v, 0.5)])
    _settle(nodes, cables, density, corner)
    length = np.linalg.norm(nodes[cables[:, 1]] - nodes[cables[:, 0]], axis=1)
    metadata = {"side": int(side), "height": float(height), "sag": float(sag), "prestress": float(prestress)}
    metadata |= {"load": float(load), "wind": float(wind)}
    force = np.tile([wind, 0.0, -load], (len(nodes), 1))
    law, stiff = np.full(len(cables), Law.CABLE), EA * np.where(edge, more, 1.0)
    return held("hypar", nodes, cables, law, density * length, stiff, corner, force, metadata)


def _settle(nodes, cables, density, fixed):
    """Move the nodes that are not fixed to where cables of these force densities balance."""
    balance = Balance(np.ones((len(cables), 1)), cables, fixed[:, None])
    for axis in range(nodes.shape[1]):
        pull = balance.forces(density * balance.elongations(nodes[:, [axis]]))
        nodes[:, [axis]] -= balance.displacements(pull, density, rtol=1e-14)
