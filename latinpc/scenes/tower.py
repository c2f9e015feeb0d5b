"""A tower of tensegrity prisms."""

from __future__ import annotations

import numpy as np

from .prestress import held, positive
from .scene import Law, Scene

RADIUS, HEIGHT = 1.0, 1.5  # of a prism (m)
STRUTS, CABLES = 1.0e6, 1.0e5  # EA (N)


def tower(
    stages: int = 4,
    struts: int = 3,
    prestress: float = 1000.0,
    load: float = 20.0,
    wind: float = 50.0,
    torque: float = 0.0,
) -> Scene:
    """Tower of tensegrity prisms, simplexes of three struts, one on the other; large displacements.

    The polygons of a prism are turned against each other by the angle of its self-stress, to the left and to the right
    in turn; the lowest one is held. Each prism can turn a little without any link changing its length, but for its
    prestress. Wind slackens cables on the side that it presses.

    Parameters
    ----------
    stages : int
        Prisms.
    struts : int
        Struts of each prism, 3 or more.
    prestress : float
        Tension of the cables between the polygons (N).
    load : float
        Downward force on each node (N).
    wind : float
        Force along x on each node (N).
    torque : float
        Moment about the axis on the uppermost polygon (Nm).

    Returns
    -------
    Scene
    """
    if stages < 1 or struts < 3:
        raise ValueError(f"a tower has at least one prism of three struts, not {stages} of {struts}")
    positive(prestress=prestress)
    n, pitch, half = struts, 2.0 * np.pi / struts, np.sin(np.pi / struts)
    angle = pitch * np.arange(n) + (np.pi / 2.0 + np.pi / n) * (np.arange(stages + 1) % 2)[:, None]
    nodes = np.stack([np.cos(angle), np.sin(angle)], axis=2).reshape(-1, 2) * RADIUS
    nodes = np.column_stack([nodes, HEIGHT * np.repeat(np.arange(stages + 1), n)])
    number = np.arange(n * (stages + 1)).reshape(-1, n)
    hand = np.where(np.arange(stages) % 2, -1, 1)[:, None]
    beside = np.take_along_axis(number[1:], (np.arange(n) - hand) % n, axis=1)
    pairs = ((number[1:], np.roll(number[1:], -1, axis=1)), (number[:-1], beside), (number[:-1], number[1:]))
    links = np.concatenate([np.stack(pair, axis=2).reshape(-1, 2) for pair in pairs])  # polygons, cables, struts
    length = np.linalg.norm(nodes[links[:, 1]] - nodes[links[:, 0]], axis=1).reshape(3, stages, n)
    density = np.full((3, stages, n), prestress / length[1, 0, 0])  # tension over length, in balance in each prism
    density[0] *= np.where(np.arange(stages) < stages - 1, 2.0, 1.0)[:, None] / (2.0 * half)
    density[2] *= -1.0
    force = np.tile([wind, 0.0, -load], (len(nodes), 1))
    force[-n:] += torque / (n * RADIUS**2) * np.cross([0.0, 0.0, 1.0], nodes[-n:])
    names = ("stages", "struts", "prestress", "load", "wind", "torque")
    metadata = dict(zip(names, (int(stages), int(struts), *map(float, (prestress, load, wind, torque)))))
    kinds = [2 * stages * n, stages * n]
    return held(
        "tower", nodes, links, np.repeat([Law.CABLE, Law.BAR], kinds), (density * length).ravel(),
        np.repeat([CABLES, STRUTS], kinds), nodes[:, 2] == 0.0, force, metadata,
    )  # fmt: skip
