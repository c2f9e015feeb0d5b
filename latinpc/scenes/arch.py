"""An arch of blocks: stiff frames that touch at the corners of their joints, with friction."""

from __future__ import annotations

import numpy as np

from .scene import Law, Scene

RADIUS = 5.0  # of the middle line (m)
WEIGHT = 1.0e4  # of the whole arch (N)
STIFFNESS = 1.0e8  # of the bars of a block (N/m)


def arch(
    blocks: int = 15,
    thickness: float = 0.2,
    friction: float = 0.6,
    push: float = 0.0,
    crown: float = 0.0,
) -> Scene:
    """Half a circle of blocks without mortar, on two fixed abutments, under its weight.

    A block is a frame of six bars; neighbours touch at the two corners of their joint, by contacts with Coulomb
    friction whose normals are along the middle line. Where the line of thrust leaves the thickness, joints open at
    one corner; at a thickness below 0.107 of the radius a hinge too many opens and no equilibrium is left
    [J. Heyman 1969], and the iteration does not converge.

    Parameters
    ----------
    blocks : int
        Number of blocks.
    thickness : float
        Thickness over the radius.
    friction : float
        Coefficient of friction.
    push : float
        Sideways force on all nodes, over the weight.
    crown : float
        Downward force on the middle of the arch, over the weight.

    Returns
    -------
    Scene
    """
    if blocks < 3:
        raise ValueError(f"an arch has at least 3 blocks, not {blocks}")
    if not 0.0 < thickness < 1.0:
        raise ValueError(f"thickness must lie between 0 and 1, not {thickness}")
    angle = np.pi * (1.0 - np.arange(blocks + 1) / blocks)  # of the joints, from the left abutment
    out = np.column_stack([np.cos(angle), np.sin(angle)])
    corner = RADIUS * (1.0 + 0.5 * thickness * np.array([-1.0, 1.0]))[:, None, None] * out  # inner, outer
    # nodes: of each block its left joint (inner, outer), its right joint; then the two abutments
    left, right = (np.moveaxis(corner[:, part], 0, 1) for part in (slice(None, -1), slice(1, None)))
    nodes = np.vstack([np.concatenate([left, right], axis=1).reshape(-1, 2), corner[:, 0], corner[:, -1]])
    first = 4 * np.arange(blocks)[:, None, None]
    bars = (first + np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])).reshape(-1, 2)
    n = 4 * blocks
    before = np.concatenate([[[n, n + 1]], 4 * np.arange(blocks)[:, None] + [2, 3]])
    after = np.concatenate([4 * np.arange(blocks)[:, None] + [0, 1], [[n + 2, n + 3]]])
    joints = np.stack([before, after], axis=2).reshape(-1, 2)
    normal = np.repeat(np.column_stack([out[:, 1], -out[:, 0]]), 2, axis=0)
    frames = np.stack([normal, np.repeat(out, 2, axis=0)], axis=1).reshape(-1, 2)
    fixed = np.zeros(nodes.shape, bool)
    fixed[n:] = True
    load = np.where(fixed, 0.0, np.array([push, -1.0]) * WEIGHT / n)
    top = np.argsort(-nodes[:n, 1], kind="stable")[:2]
    load[top, 1] -= 0.5 * crown * WEIGHT
    return Scene(
        name="arch",
        nodes=nodes,
        links=np.vstack([bars, np.repeat(joints, 2, axis=0)]),
        law=np.concatenate([np.full(len(bars), Law.BAR), np.tile([Law.FRICTION, Law.TANGENT], len(joints))]),
        stiffness=np.concatenate([np.full(len(bars), STIFFNESS), np.zeros(2 * len(joints))]),
        fixed=fixed,
        load=load,
        direction=np.vstack([np.zeros((len(bars), 2)), frames]),
        friction=np.full(len(bars) + 2 * len(joints), friction),
        metadata={
            "blocks": int(blocks),
            "thickness": float(thickness),
            "friction": float(friction),
            "push": float(push),
            "crown": float(crown),
        },
    )
