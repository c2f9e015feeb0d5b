"""A triangulated cantilever in 2D: a frame of bars braced by crossed, prestressed cables."""

from __future__ import annotations

import numpy as np

from latinpc.results.units import counted

from .network import Balance
from .scene import Law, Scene, blocks_or_metis

CELL = 1.0  # side of a cell (m)
EA_BAR = 6.5e7  # axial stiffness of bars (N)
EA_CABLE = 1.0e7  # axial stiffness of cables (N)
MAX_CABLE_TENSION = 1000.0  # greatest self-stress of a cable (N)
BLOCK = 4  # cells along a side of a subdomain, by default


def lattice(
    nx: int = 32,
    ny: int = 16,
    subdomains: int | None = None,
    partition: str | None = None,
    slack: float = 0.09,
    load: float | None = None,
    seed: int = 0,
) -> Scene:
    """Cantilever of nx x ny square cells, clamped at x = 0, pulled down at its free end.

    Horizontal and vertical bars; two crossed cables in each cell. A cell's self-stress stretches both of
    its cables and compresses its four edges; its size varies at random from cell to cell, so that the
    cables do not slacken all at once.

    Parameters
    ----------
    nx : int
        Cells along the span.
    ny : int
        Cells along the height.
    subdomains : int, optional
        Number of subdomains. By default blocks of 4 x 4 cells.
    partition : {'regular', 'metis'}, optional
        Equal blocks (default if they fit), or METIS: the solver then makes the partition.
    slack : float
        Share of slack cables, 0 to 0.3. It sets the load from the tensions of the linear structure, and is met within
        a few per cent of the cables.
    load : float, optional
        Downward force on each node of the free end (N). Overrides `slack`.
    seed : int
        Seed of the random numbers.

    Returns
    -------
    Scene
    """
    if nx < 1 or ny < 1:
        raise ValueError(f"nx and ny must be at least 1, not {nx} and {ny}")
    partition = blocks_or_metis(partition, fit=subdomains is not None or nx % BLOCK == ny % BLOCK == 0)
    if not 0.0 <= slack <= 0.3:
        raise ValueError(f"slack must lie between 0 and 0.3, not {slack}: give load, the force per node")
    parts = None
    if partition == "regular":
        block = _block_size(nx, ny, subdomains)
        subdomains = (nx // block) * (ny // block)
        parts = _blocks(nx, ny, block)
    nodes, links, bars = _cells(nx, ny)
    is_cable = np.arange(len(links)) >= bars
    tension = _self_stress(nx, ny, seed)
    x = nodes[:, 0] / CELL
    direction = nodes[links[:, 1]] - nodes[links[:, 0]]
    length = np.linalg.norm(direction, axis=1)
    stiffness = np.where(is_cable, EA_CABLE, EA_BAR) / length
    fixed = np.repeat((x == 0)[:, None], 2, axis=1)
    force = np.zeros_like(nodes)
    force[x == nx, 1] = -1.0
    if load is None:
        balance = Balance(direction / length[:, None], links, fixed)
        load = balance.load_for_slack(force, stiffness, tension, is_cable, slack)
    return Scene(
        name="lattice",
        nodes=nodes,
        links=links,
        law=np.where(is_cable, Law.CABLE, Law.BAR),
        stiffness=stiffness,
        initial_elongation=tension / stiffness,
        fixed=fixed,
        load=load * force,
        subdomain=parts,
        metadata={
            "nx": int(nx),
            "ny": int(ny),
            "seed": int(seed),
            "partition": partition,
            "subdomains": subdomains,
            "slack_target": float(slack),
            "load_per_node": float(load),
        },
    )


def _cells(nx, ny):
    """Nodes, links, and how many of the links are bars: these come first, along x, then along y."""
    y, x = (axis.ravel() for axis in np.meshgrid(np.arange(ny + 1), np.arange(nx + 1), indexing="ij"))
    number = np.arange(len(x)).reshape(ny + 1, nx + 1)
    corners = [number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]]  # counter-clockwise
    along_x = np.stack([number[:, :-1], number[:, 1:]], axis=2).reshape(-1, 2)
    along_y = np.stack([number[:-1], number[1:]], axis=2).reshape(-1, 2)
    crossed = np.stack([corners[0], corners[2], corners[1], corners[3]], axis=2).reshape(-1, 2)
    return np.column_stack([x, y]) * CELL, np.vstack([along_x, along_y, crossed]), len(along_x) + len(along_y)


def _self_stress(nx, ny, seed):
    """Tensions of all links (N) in self-stress: random from cell to cell."""
    cable = MAX_CABLE_TENSION * np.random.default_rng(seed).uniform(0.1, 1.0, (ny, nx))
    tension_x, tension_y = np.zeros((ny + 1, nx)), np.zeros((ny, nx + 1))
    for shift in (0, 1):  # an edge bears the self-stress of the cells on its two sides
        tension_x[shift : ny + shift] -= cable / np.sqrt(2.0)
        tension_y[:, shift : nx + shift] -= cable / np.sqrt(2.0)
    return np.concatenate([tension_x.ravel(), tension_y.ravel(), np.repeat(cable.ravel(), 2)])


def _block_size(nx, ny, subdomains):
    """Cells along a side of a square block."""
    counts = {(nx // size) * (ny // size): size for size in range(1, min(nx, ny) + 1) if nx % size == ny % size == 0}
    if subdomains is None and (nx % BLOCK or ny % BLOCK):
        raise ValueError(
            f"{nx} x {ny} cells do not make blocks of {BLOCK} x {BLOCK}: give subdomains, "
            f"one of {', '.join(map(str, counts))}, or partition metis"
        )
    if subdomains is not None and subdomains not in counts:
        raise ValueError(
            f"{counted(subdomains, 'subdomain')} cannot be equal square blocks of {nx} x {ny} cells: "
            f"choose from {', '.join(map(str, counts))}, or partition metis"
        )
    return BLOCK if subdomains is None else counts[subdomains]


def _blocks(nx, ny, block):
    """Subdomain of each link; an edge on a boundary goes to the block after it, so that no link is shared."""
    across, up = nx // block, ny // block

    def part(i, j):
        return np.minimum(j // block, up - 1) * across + np.minimum(i // block, across - 1)

    def each(rows, columns):
        return part(np.arange(columns)[None, :], np.arange(rows)[:, None])

    return np.concatenate([each(ny + 1, nx).ravel(), each(ny, nx + 1).ravel(), np.repeat(each(ny, nx), 2)])
