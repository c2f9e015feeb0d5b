"""Ends of lines that miss another node or another line by a little: why a drawing may be a mechanism."""

from __future__ import annotations

import numpy as np

LOOKED = 300  # nodes, those with the fewest links first
SHOWN = 3
NEAR = 1e-2  # of the shortest link at the node


def near_misses(scene):
    """Return sentences on nodes that are near others, or near lines within their length; not collective.

    Parameters
    ----------
    scene : Scene
        Read from a file, whose options the sentences name.
    """
    ends, lengths, found, named = scene.links, scene.lengths, [], set()
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
