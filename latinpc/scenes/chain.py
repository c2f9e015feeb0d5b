"""A hanging chain, and Gaudi's arch, the same upside down."""

from __future__ import annotations

import numpy as np

from .scene import Law, Scene

SPAN = 1.0  # m
WEIGHT = 1.0  # of the whole chain (N)


def chain(links: int = 64, length: float = 1.5, upside_down: bool = False, pull: float = 0.0) -> Scene:
    """Chain of equal links between two hooks at one height, or the arch that its mirror image makes.

    The nodes lie where they hang under their weight, so that the solution is known: no displacement, and the
    tensions of the catenary. Links are inextensible (3), in the arch they carry compression only. A bar across each
    link has the stiffness that the tension gives it (tension over length), without which the links alone would be a
    mechanism: the stiffness matrix of the bars K_b is singular.

    Parameters
    ----------
    links : int
        Number of links.
    length : float
        Length of the chain over the span, more than 1.
    upside_down : bool
        Turn the chain into an arch.
    pull : float
        Sideways force on the middle node, over the weight of the chain.

    Returns
    -------
    Scene
        Its metadata hold the tensions of the links (N).
    """
    if links < 2:
        raise ValueError(f"a chain has at least 2 links, not {links}")
    if not length > 1.0:
        raise ValueError(f"length must be more than the span, that is more than 1, not {length}")
    piece, weight = length * SPAN / links, WEIGHT / links
    vertical = weight * (np.arange(links) - (links - 1) / 2)  # of the tension of each link
    low, high = 0.0, 1e3 * WEIGHT
    for _ in range(200):  # horizontal tension at which the links span the hooks
        horizontal = (low + high) / 2
        reach = np.sum(piece * horizontal / np.hypot(horizontal, vertical))
        low, high = (horizontal, high) if reach < SPAN else (low, horizontal)
    tension = np.hypot(horizontal, vertical)
    step = piece * np.column_stack([np.full(links, horizontal), vertical]) / tension[:, None]
    sign = -1.0 if upside_down else 1.0
    nodes = np.vstack([np.zeros((1, 2)), np.cumsum(step, axis=0)]) * [1.0, sign]
    pairs = np.column_stack([np.arange(links), np.arange(1, links + 1)])
    along = nodes[1:] - nodes[:-1]
    fixed = np.zeros(nodes.shape, bool)
    fixed[[0, -1]] = True
    load = np.where(fixed, 0.0, [0.0, -weight])
    load[links // 2, 0] += pull * WEIGHT
    return Scene(
        name="chain",
        nodes=nodes,
        links=np.repeat(pairs, 2, axis=0),
        law=np.tile([Law.CONTACT if upside_down else Law.INEXTENSIBLE, Law.BAR], links),
        stiffness=np.column_stack([np.zeros(links), tension / piece]).ravel(),
        fixed=fixed,
        load=load,
        direction=np.stack([along, along[:, ::-1] * [-1.0, 1.0]], axis=1).reshape(-1, 2),
        metadata={
            "links": int(links),
            "length": float(length),
            "upside_down": bool(upside_down),
            "pull": float(pull),
            "horizontal_tension": float(horizontal),
            "tensions": (sign * tension).tolist(),
        },
    )
