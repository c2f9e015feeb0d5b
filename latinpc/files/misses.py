"""Ends of lines that miss another node or another line by a little: why a drawing may be a mechanism."""

from __future__ import annotations

import numpy as np

from .selection import AXES

LOOKED = 300  # nodes, those with the fewest links first
SHOWN = 3
NEAR = 1e-2  # of the shortest link at the node


def near_misses(scene):
    """Return sentences on why a structure is a mechanism; not collective.

    It is flat and free across its plane, or nodes are near others, or near lines within their length.

    Parameters
    ----------
    scene : Scene
        Read from a file, whose options the sentences name.
    """
    ends, lengths, found, named = scene.links, scene.lengths, _across(scene), set()
    degree = np.bincount(ends.ravel(), minlength=len(scene.nodes))
    near = np.full(len(scene.nodes), np.inf)
    for column in ends.T:
        np.minimum.at(near, column, NEAR * lengths)
    for node in np.argsort(degree, kind="stable")[:LOOKED]:
        if len(found) == SHOWN:
            break
        other, line = _other_node(scene, node, near[node]), None
        line = _other_line(scene, node, near[node]) if other is None else None
        if other is not None and frozenset((node, other)) not in named:
            named.add(frozenset((node, other)))
            distance = np.linalg.norm(scene.nodes[node] - scene.nodes[other])
            found.append(
                f"node {scene.node_name(node)} is {distance:.3g} m from node {scene.node_name(other)}: if they are one,"
                f" give --merge {1.5 * distance:.1g}"
            )
        elif line is not None:
            found.append(
                f"node {scene.node_name(node)} lies on the line {scene.link_name(line)}, which it does not join: split"
                " the line there"
            )
    return found


def _across(scene):
    """Return a sentence on a structure in 3D that lies in a plane across an axis, with nodes that are free along it."""
    extent = np.ptp(scene.nodes, axis=0)
    for axis in np.flatnonzero(extent <= 1e-12 * extent.max()) if scene.dim == 3 else ():
        free = ~scene.fixed[:, axis]
        if free.any():
            loads = f" has loads along {AXES[axis]}, but" if scene.load[free, axis].any() else ""
            return [
                f"the structure{loads} lies in a plane of constant {AXES[axis]}: for forces within the plane give"
                f" --support all:{AXES[axis]}"
            ]
    return []


def _other_node(scene, node, near):
    """Return the nearest node within a distance that no link joins to this one, or None."""
    distance = np.linalg.norm(scene.nodes - scene.nodes[node], axis=1)
    distance[scene.links[(scene.links == node).any(axis=1)].ravel()] = np.inf
    other = int(distance.argmin())
    return other if 0.0 < distance[other] <= near else None


def _other_line(scene, node, near):
    """Return the nearest line within a distance, its foot between its ends, or None."""
    start = scene.nodes[scene.links[:, 0]]
    span = scene.nodes[scene.links[:, 1]] - start
    away = scene.nodes[node] - start
    share = (away * span).sum(axis=1) / (span**2).sum(axis=1)
    distance = np.linalg.norm(away - share[:, None] * span, axis=1)
    distance[(scene.links == node).any(axis=1) | (share <= 0.0) | (share >= 1.0)] = np.inf
    line = int(distance.argmin())
    return line if distance[line] <= near else None
