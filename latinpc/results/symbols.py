"""Shapes of supports and loads, as numbers: triangles and lines beside the nodes, in two or three dimensions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

HEIGHT = 0.028  # of a support, in sizes of the structure, and at most
HEIGHT_OF_LINK = 0.3  # this part of the middle length of a link
ARROW, ARROW_OF_LINK = 0.11, 1.5  # the same of the longest arrow
CROWD = 60  # arrows: of more each is shorter, in proportion to the root of their number
MANY_SYMBOLS = 2000  # nodes, beyond which symbols would hide the structure


@dataclass
class Symbol:
    """Symbols of one kind.

    Parameters
    ----------
    label : str
        For the legend.
    triangles : (k, 3, d) array
    lines : (l, 2, d) array
    filled : bool
        Whether the triangles are dark.
    nodes : (n,) array of int
    """

    label: str
    triangles: np.ndarray
    lines: np.ndarray
    filled: bool
    nodes: np.ndarray


def lengths_of(nodes, links):
    """Return the size of a structure and the middle length of its links, those of no length left out (m)."""
    span = float(np.linalg.norm(np.ptp(nodes, axis=0))) or 1.0
    lengths = np.linalg.norm(nodes[links[:, 1]] - nodes[links[:, 0]], axis=1)
    lengths = lengths[lengths > 1e-9 * span]
    return span, float(np.median(lengths)) if len(lengths) else span


def supports(fixed, nodes, links, shape=None):
    """Return the symbols of the supports: pins, and a roller for each direction of nodes that are held in some.

    A pin is a dark triangle (in three dimensions a pyramid), below its node or away from the links there. A roller is a
    light one over a plate: it holds its node across the plate.

    Parameters
    ----------
    fixed : (n, dim) array of bool
    nodes : (n, d) array
        d is 2 or 3; one dimension is drawn in two.
    links : (m, 2) array of int
    shape : (n, d) array, optional
        Where the nodes are drawn.

    Returns
    -------
    list of Symbol
        Pins and rollers, without those that there are none of. Empty where more than `MANY_SYMBOLS` nodes are held.
    """
    if np.count_nonzero(fixed.any(axis=1)) > MANY_SYMBOLS:
        return []
    shape = nodes if shape is None else shape
    span, link = lengths_of(nodes, links)
    height = min(HEIGHT * span, HEIGHT_OF_LINK * link)
    outward = _outward(nodes, links)
    pins = np.flatnonzero(fixed.all(axis=1))
    held, axes = np.nonzero(fixed & ~fixed.all(axis=1)[:, None])
    found = []
    if len(pins):
        found.append(Symbol("pin", *_stands(shape[pins], _below(outward[pins]), height, False), True, pins))
    if len(held):
        along = np.zeros((len(held), nodes.shape[1]))
        side = outward[held, axes]
        along[np.arange(len(held)), axes] = np.where(side > 1e-9, 1.0, -1.0)
        found.append(Symbol("roller", *_stands(shape[held], along, height, True), False, held))
    return found


def arrows(vectors, nodes, links, shape=None, largest=None):
    """Return arrows for forces on nodes, with lengths in proportion.

    They end at the nodes where the structure lies ahead of most of them, else they start there.

    Parameters
    ----------
    vectors : (n, d) array
    nodes : (n, d) array
    links : (m, 2) array of int
    shape : (n, d) array, optional
        Where the nodes are drawn.
    largest : float, optional
        Length of the longest vector on this scale; that of these when not given.

    Returns
    -------
    lines : (l, 2, d) array
        Shafts and strokes of the heads.
    acting : (k,) array of int
        Nodes with a force.
    """
    shape = nodes if shape is None else shape
    size = np.linalg.norm(vectors, axis=1)
    largest = size.max(initial=0.0) if largest is None else largest
    acting = np.flatnonzero(size > 1e-9 * largest)
    if not len(acting):
        return np.zeros((0, 2, nodes.shape[1])), acting
    span, link = lengths_of(nodes, links)
    length = min(ARROW * span, ARROW_OF_LINK * link) * min(1.0, (CROWD / len(acting)) ** 0.5)
    force = vectors[acting] * (length / largest)
    ahead = np.einsum("ij,ij->i", force, -_outward(nodes, links)[acting])
    tips = shape[acting] if ahead.sum() >= -1e-9 * np.abs(ahead).sum() else shape[acting] + force
    head = np.minimum(0.3 * length, 0.6 * size[acting] * length / largest)[:, None]
    unit = force / np.linalg.norm(force, axis=1)[:, None]
    strokes = [tips - head * unit + 0.32 * head * side for side in _across(unit)]
    return np.concatenate([np.stack([start, tips], axis=1) for start in (tips - force, *strokes)]), acting


def _outward(nodes, links):
    """Return the mean direction away from the links of each node, (n, d)."""
    lines = nodes[links[:, 1]] - nodes[links[:, 0]]
    unit = lines / np.maximum(np.linalg.norm(lines, axis=1), 1e-300)[:, None]
    outward = np.zeros(nodes.shape)
    np.add.at(outward, links[:, 0], -unit)
    np.add.at(outward, links[:, 1], unit)
    return outward


def _below(outward):
    """Return where pins stand, unit vectors along an axis: below their node unless the structure is there."""
    along = np.zeros(outward.shape)
    axis = np.where(outward[:, -1] <= 1e-6, outward.shape[1] - 1, np.abs(outward).argmax(axis=1))
    rows = np.arange(len(outward))
    along[rows, axis] = np.where(outward[rows, axis] > 1e-6, 1.0, -1.0)
    return along


def _across(unit):
    """Return unit vectors at right angles to others, to both sides: two in the plane, four in space."""
    if unit.shape[1] == 2:
        side = np.column_stack([-unit[:, 1], unit[:, 0]])
        return [side, -side]
    other = np.zeros(unit.shape)
    other[np.arange(len(unit)), np.abs(unit).argmin(axis=1)] = 1.0
    first = np.cross(unit, other)
    first /= np.linalg.norm(first, axis=1)[:, None]
    second = np.cross(unit, first)
    return [first, -first, second, -second]


def _stands(points, along, height, rolls):
    """Return the triangles and lines of supports that stand from their points along unit vectors."""
    foot = 0.72 if rolls else 1.0
    base, plate = points + foot * height * along, points + height * along
    sides = _across(along)
    if points.shape[1] == 2:
        left, right = (base + 0.55 * foot * height * side for side in sides)
        ends = [plate + 0.75 * height * side for side in sides]
        return np.stack([points, left, right], axis=1), np.stack(ends, axis=1)
    one, _, two, _ = sides
    ring = [one + two, one - two, -one - two, two - one]
    corners = [base + 0.45 * foot * height * way for way in ring]
    faces = [np.stack([points, corners[i], corners[(i + 1) % 4]], axis=1) for i in range(4)]
    faces += [
        np.stack([corners[0], corners[1], corners[2]], axis=1),
        np.stack([corners[0], corners[2], corners[3]], axis=1),
    ]
    rim = [plate + 0.6 * height * way for way in ring]
    edges = [np.stack([rim[i], rim[(i + 1) % 4]], axis=1) for i in range(4)]
    return np.concatenate(faces), np.concatenate(edges) if rolls else np.zeros((0, 2, 3))
