"""A truss girder that hangs from a few inextensible cables, equation (15)."""

from __future__ import annotations

import numpy as np

from .scene import Law, Scene

CELL = 1.0  # side of a cell (m)
EA = 6.5e7  # axial stiffness of the bars (N)
SLACK = 1.0e-3  # mean length by which a cable is too long (m)
BLOCK = 4  # cells along a side of a subdomain


def hung_truss(nx: int = 32, ny: int = 4, cables: int = 7, load: float = 2.0e4, seed: int = 0) -> Scene:
    """Girder of nx x ny braced cells, clamped at both ends, hung from a few cables that are a little too long.

    The girder alone is held: the stiffness matrix of its bars is regular, and the problem is the minimum of a
    quadratic energy under a few inequalities. Under load it sags until some of the cables are taut.

    Parameters
    ----------
    nx : int
        Cells along the span.
    ny : int
        Cells along the height.
    cables : int
        Number of inextensible cables.
    load : float
        Downward force on each node of the top (N).
    seed : int
        Seed of the random numbers.

    Returns
    -------
    Scene
    """
    if nx < 2 or ny < 1:
        raise ValueError(f"a girder has at least 2 x 1 cells, not {nx} x {ny}")
    if not 0 <= cables < nx:
        raise ValueError(f"cables must lie between 0 and {nx - 1}, not {cables}")
    y, x = (axis.ravel() for axis in np.meshgrid(np.arange(ny + 1), np.arange(nx + 1), indexing="ij"))
    number = np.arange(len(x)).reshape(ny + 1, nx + 1)
    bars = np.vstack(
        [
            np.stack(pair, axis=2).reshape(-1, 2)
            for pair in (
                (number[:, :-1], number[:, 1:]),
                (number[:-1], number[1:]),
                (number[:-1, :-1], number[1:, 1:]),
                (number[:-1, 1:], number[1:, :-1]),
            )
        ]
    )
    hung = number[-1, np.rint(nx * np.arange(1, cables + 1) / (cables + 1)).astype(int)]
    nodes = np.vstack([np.column_stack([x, y]), np.column_stack([x[hung], y[hung] + 2.0 * ny])]) * CELL
    hangers = np.column_stack([hung, len(x) + np.arange(cables)])
    links = np.vstack([bars, hangers])
    length = np.linalg.norm(nodes[links[:, 1]] - nodes[links[:, 0]], axis=1)
    rigid = np.arange(len(links)) >= len(bars)
    fixed = np.zeros(nodes.shape, bool)
    fixed[: len(x)][(x == 0) | (x == nx)] = True
    fixed[len(x) :] = True
    force = np.zeros(nodes.shape)
    force[number[-1], 1] = -load
    force[fixed] = 0.0
    too_long = np.random.default_rng(seed).uniform(0.0, 2.0 * SLACK, cables)
    low = nodes[links].min(axis=1) / CELL
    across = max(1, nx // BLOCK)
    part = np.minimum((low[:, 0] / nx * across).astype(int), across - 1)
    return Scene(
        name="hung-truss",
        nodes=nodes,
        links=links,
        law=np.where(rigid, Law.INEXTENSIBLE, Law.BAR),
        stiffness=np.where(rigid, 0.0, EA / length),
        initial_elongation=np.concatenate([np.zeros(len(bars)), -too_long]),
        fixed=fixed,
        load=force,
        subdomain=part,
        metadata={"nx": int(nx), "ny": int(ny), "cables": int(cables), "load_per_node": float(load), "seed": int(seed)},
    )
