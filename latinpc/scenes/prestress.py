"""Links under prestress, and what scenes that it holds have in common."""

from __future__ import annotations

import numpy as np

from .scene import Scene


def taut(nodes, links, tension, EA):
    """Return stiffnesses and initial elongations of links that have tensions as drawn.

    Parameters
    ----------
    nodes : (n, dim) array
        In m.
    links : (m, 2) array of int
    tension : (m,) array
        In N, compression negative.
    EA : (m,) array, or float
        Axial stiffness (N), of the length without tension.

    Returns
    -------
    stiffness, initial_elongation : (m,) array
        In N/m and m.
    """
    length = np.linalg.norm(nodes[links[:, 1]] - nodes[links[:, 0]], axis=1)
    stiffness = (EA + tension) / length
    return stiffness, tension / stiffness


def held(name, nodes, links, law, tension, EA, fixed, load, metadata):
    """Make a scene that its prestress holds, of large displacements.

    Parameters
    ----------
    name : str
    nodes, links, law, tension, EA
        As for `taut`, with a law per link.
    fixed : (n,) array of bool
        Nodes that are held in all directions.
    load : (n, dim) array
        In N; that of fixed nodes is dropped.
    metadata : dict

    Returns
    -------
    Scene
    """
    stiffness, initial_elongation = taut(nodes, links, tension, EA)
    fixed = np.repeat(fixed[:, None], nodes.shape[1], axis=1)
    return Scene(
        name=name,
        nodes=nodes,
        links=links,
        law=law,
        stiffness=stiffness,
        initial_elongation=initial_elongation,
        fixed=fixed,
        load=np.where(fixed, 0.0, load),
        metadata=metadata,
        geometry="large",
    )


def positive(**values):
    """Refuse values that are not positive and finite, by name."""
    for name, value in values.items():
        if not 0.0 < value < np.inf:
            raise ValueError(f"{name} must be positive, not {value}")


def squares(side):
    """Return the nodes (i, j) of a square net and its cables along and across, both ways of counting from 0.

    Returns
    -------
    grid : ((side + 1)^2, 2) array of int
        Node i (side + 1) + j lies at (i, j).
    cables : (2 side (side + 1), 2) array of int
        Those along i first.
    """
    if side < 2:
        raise ValueError(f"side must be at least 2 meshes, not {side}")
    number = np.arange((side + 1) ** 2).reshape(side + 1, side + 1)
    along = np.column_stack([number[:-1].ravel(), number[1:].ravel()])
    across = np.column_stack([number[:, :-1].ravel(), number[:, 1:].ravel()])
    return np.argwhere(number >= 0), np.concatenate([along, across])
