"""Nodes whose displacements a solve does not determine, as the links there are slack or yield."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from latinpc.geometry import extent
from latinpc.laws import RIGID, Law

from .mechanics import keeps_direction, stretches, tensions_at

if TYPE_CHECKING:
    from latinpc.structure import Structure

    from .result import Result

__all__ = ["loose"]

MARGIN = 1e-2  # of the largest displacement: who may move less is held
ROUNDED = 64 * np.finfo(float).eps  # of the structure: displacements below the rounding of coordinates
NAMED = 5
FORCELESS = 1e-8  # of the largest tension: rounding
SINGULAR = 1e-12  # least eigenvalue of the sum of n n^t: links at less than a millionth of a radian count as one


def loose(result: Result) -> list[str]:
    """Return a sentence on nodes that can move by themselves without a change of any tension; of parts collective.

    A link holds a node if its tension changes within `MARGIN` of its elongation, a rigid one also if it bears. A node
    is named if no link holds it in some direction while all others stay where they are; nodes that can move only
    together are not found. With large displacements a taut link that turns holds in all directions, but a single bar
    without force, as a strut between slack cables, along itself only.
    """
    structure, over = result.structure, result.structure.over_ranks
    if structure.geometry == "prestress" or not result.converged:
        return []
    if over.largest(structure.law.max(initial=0)) == Law.BAR:
        return []
    large = structure.geometry == "large"
    most = over.largest(np.abs(result.displacements).max(initial=0.0))
    margin = max(MARGIN * most, ROUNDED * extent(structure).max(initial=0.0))
    elongation = stretches(structure, result.displacements)
    if large:
        holds = ~result.slack | (np.abs(elongation + structure.initial_elongation) <= margin)
    else:
        holds = _holds(structure, elongation, margin) | (np.isin(structure.law, RIGID) & ~result.slack)
    nodes = np.flatnonzero(_touched(structure, ~holds) & ~structure.fixed[: over.own].all(axis=1))
    force = np.abs(result.tensions)
    bears = force > FORCELESS * over.largest(force.max(initial=0.0))
    turns = large & holds & ~keeps_direction(structure)
    ends = np.bincount(structure.links[turns & ~bears].ravel(), minlength=len(structure.nodes))
    free = nodes[_free(structure, holds, turns & bears, nodes) & (over.collect(ends.astype(float))[nodes] <= 1.0)]
    free = over.node_numbers(free, NAMED + 1)
    if not (large or most) or not len(free):
        return []
    named = structure.some_nodes(free[:NAMED], len(free) > NAMED)
    return [
        f"{idle_links(structure)} leave {named} free in some direction: displacements there are one"
        " solution of many, with the same tensions"
    ]


def idle_links(structure: Structure) -> str:
    """Return what links are called that do not hold nodes, by the laws of all; of parts collective."""
    over, touching = structure.over_ranks, np.isin(structure.law, (Law.CONTACT, Law.FRICTION, Law.TANGENT))
    if over.largest((structure.law >= len(Law)).any()):
        return "links that are slack or yield"
    return "slack links" if over.largest((~touching & (structure.law != Law.BAR)).any()) else "open contacts"


def _touched(structure, chosen):
    """Return which nodes have chosen links."""
    at = np.zeros(len(structure.nodes))
    at[structure.links[chosen]] = 1.0
    return structure.over_ranks.collect(at) > 0.0


def _holds(structure, elongation, margin):
    """Return of each link whether its tension changes within a margin of its elongation (m)."""
    law, strain = structure.law, elongation + structure.initial_elongation
    holds = tensions_at(structure, elongation + margin) != tensions_at(structure, elongation - margin)
    rigid = np.isin(law, RIGID)
    reached = np.where(law == Law.INEXTENSIBLE, strain, -strain) >= -margin
    return np.where(rigid, reached | np.isin(law, (Law.FRICTION, Law.TANGENT)), holds)


def _free(structure, holds, across, nodes):
    """Return of nodes whether the links that hold, some also `across`, leave a direction in which they can move."""
    dim, over = structure.nodes.shape[1], structure.over_ranks
    asked = np.zeros(len(structure.nodes[: over.own]), bool)
    asked[nodes] = True
    here = np.flatnonzero(over.spread(asked))
    place = np.full(len(structure.nodes), -1)
    place[here] = np.arange(len(here))
    whole = np.zeros((len(structure.nodes), dim, dim))
    whole[here] = _held(structure, holds, across, place, len(here))
    held = over.collect(whole)[nodes]
    fixed = structure.fixed[nodes]
    held[fixed] = 0.0
    held.swapaxes(1, 2)[fixed] = 0.0
    held[:, range(dim), range(dim)] += fixed
    return np.linalg.eigvalsh(held)[:, 0] < SINGULAR if len(nodes) else np.zeros(0, bool)


def _held(structure, holds, across, place, count):
    """Return the sums of n n^t, or of 1 where they hold across, of links that hold at nodes with a place from 0 on."""
    dim, normals = structure.nodes.shape[1], structure.directions[holds]
    along = normals[:, :, None] * normals[:, None, :]
    along[across[holds]] = np.eye(dim)
    held = np.zeros((count, dim, dim))
    for end in structure.links[holds].T:
        here, at = place[end] >= 0, place[end]
        for i in range(dim):
            for j in range(dim):
                held[:, i, j] += np.bincount(at[here], along[here, i, j], count)
    return held
