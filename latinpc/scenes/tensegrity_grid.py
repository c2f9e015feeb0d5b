"""The article's double-layer grid of square modules (section 6, Figures 6 and 7).

The article gives neither stiffnesses nor loads; those below reproduce its Table 3 exactly and the
behaviour of its Tables 4 to 7 closely.
"""

from __future__ import annotations

import math

import numpy as np

from latinpc.arrays import block
from latinpc.results.units import counted

from .scene import Law, Scene, blocks_or_metis

SIDE = 1.0  # side of a module (m)
HEIGHT = 0.5  # distance between the two layers (m)
EA_BAR = 6.5e7  # axial stiffness of bars (N)
EA_CABLE = 1.0e7  # axial stiffness of cables (N)
MAX_CABLE_TENSION = 1000.0  # self-stress of the most tensioned cable (N)
BLOCK = 4  # modules along a side of a subdomain, by default

# Vertices of a module: lower corners 0..3, upper nodes 4..7 (4 + i above edge i, i + 1), counter-clockwise.
_CABLES = (
    [(i, (i + 1) % 4) for i in range(4)] + [(4 + i, 4 + (i + 1) % 4) for i in range(4)] + [(i, 4 + i) for i in range(4)]
)
_BARS = [(i, 4 + (i + 1) % 4) for i in range(4)]
_BRACES = [(i, 4 + (i + 3) % 4) for i in range(4)] + [(0, 2), (1, 3)]

# Load per node (N) for 9 % of slack cables, by number of modules along a side, found by bisection.
_LOAD_9_PERCENT = {12: 18.53, 16: 10.23, 20: 6.61, 24: 4.58, 32: 2.58, 40: 1.67, 48: 1.17}

# For other sizes and shares: load times modules^2 (N), nearly the same for all sizes. Found by bisection with a
# semismooth Newton solve of the 24 x 24 grid; the same loads give 12 x 12 modules within 0.6 % of the cables of the
# wanted share (1.6 % where the curve is steep, from 0.02 to 0.04) and 32 x 32 or 48 x 48 within 0.7 %. A quarter
# of the cables is about the most that this load can slacken: 0.3 takes eight times as much.
_SLACK = (0.0, 0.002, 0.005, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 0.09, 0.1, 0.12, 0.15, 0.18, 0.21, 0.25)
_LOAD_TIMES_MODULES_SQUARED = (
    (300.0, 1099.0, 1578.0, 1811.0, 1940.0, 1970.0, 2016.0, 2072.0, 2154.0, 2273.0, 2434.0)
    + (2650.0, 2878.0, 3172.0, 3691.0, 4399.0, 5068.0, 6604.0)
)  # fmt: skip


def tensegrity_grid(
    modules: int = 48,
    subdomains: int | None = None,
    partition: str | None = None,
    module: str = "initial",
    slack: float = 0.09,
    load: float | None = None,
) -> Scene:
    """Square grid of tensegrity modules: 12 cables and 4 bars each (Figure 7, left).

    Two coincident cables lie on every lower edge shared by two modules, as the article counts links.
    The lower nodes at x = 0 and at the opposite side are clamped; every free node carries the same
    downward force.

    Parameters
    ----------
    modules : int
        Modules along a side of the grid.
    subdomains : int, optional
        Number of subdomains; by default blocks of 4 x 4 modules.
    partition : {'regular', 'metis'}, optional
        Equal blocks (default if they fit), or METIS: the solver then makes the partition.
    module : {'initial', 'modified'}
        Module of the article. The modified one (Figure 7, right) has no internal mechanism: it adds the second
        bracing set and both diagonals of the lower square as bars.
    slack : float
        Share of slack cables, 0 to 0.25. It sets the load, and is met within about 0.5 % of the cables (1.5 % from
        0.02 to 0.04) for 12 modules and more of the initial kind. The modified module receives the same load, and
        slackens less.
    load : float, optional
        Downward force on each free node (N). Overrides `slack`.

    Returns
    -------
    Scene
    """
    return _grid("tensegrity-grid", modules, subdomains, partition, module, slack, load)


def truss_grid(
    modules: int = 48,
    subdomains: int | None = None,
    partition: str | None = None,
    module: str = "initial",
    slack: float = 0.09,
    load: float | None = None,
) -> Scene:
    """Make the grid of `tensegrity_grid` with bars in place of the cables: a linear problem.

    Parameters and result are those of `tensegrity_grid`; `slack` only sets the load.
    """
    return _grid("truss-grid", modules, subdomains, partition, module, slack, load)


def load_for_slack(modules: int, slack: float) -> float:
    """Downward force per free node (N) that slackens about that share of the cables."""
    if not 0.0 <= slack <= _SLACK[-1]:
        raise ValueError(f"slack must lie between 0 and {_SLACK[-1]}, not {slack}: give load, the force per node")
    if slack == 0.09 and modules in _LOAD_9_PERCENT:
        return _LOAD_9_PERCENT[modules]
    return float(np.interp(slack, _SLACK, _LOAD_TIMES_MODULES_SQUARED)) / modules**2


def _grid(name, modules, subdomains, partition, module, slack, load):
    arrays, metadata = grid_part(name, modules, subdomains, partition, module, slack, load)
    return Scene(name=name, **arrays, metadata=metadata)


def grid_part(
    name, modules=48, subdomains=None, partition=None, module="initial", slack=0.09, load=None, *, rank=0, ranks=1
):  # fmt: skip
    """Make the arrays of a scene, or a rank's part of them, whose links have the numbers of all nodes.

    Parameters
    ----------
    name : {'tensegrity-grid', 'truss-grid'}
    modules, subdomains, partition, module, slack, load
        As of `tensegrity_grid`.
    rank, ranks : int
        Which part: nodes in blocks of consecutive numbers, links in blocks of subdomains, or of modules.

    Returns
    -------
    arrays : dict
        As `Scene` and `latinpc.LocalStructure` take them; no array is longer than the part.
    metadata : dict
    """
    if modules < 1:
        raise ValueError(f"modules must be at least 1, not {modules}")
    if module not in ("initial", "modified"):
        raise ValueError(f"module must be 'initial' or 'modified', not {module!r}")
    partition = blocks_or_metis(partition, fit=subdomains is not None or modules % BLOCK == 0)
    load = load_for_slack(modules, slack) if load is None else float(load)
    side = _blocks_a_side(modules, subdomains) if partition == "regular" else None
    cells, parts = _cells(modules, side, rank, ranks)
    nodes = _nodes(modules, np.arange(*block(node_count(modules), rank, ranks)))
    pattern = np.array(_CABLES + _BARS + (_BRACES if module == "modified" else []))
    is_cable = np.arange(len(pattern)) < len(_CABLES)
    x = _nodes(modules, _corners(modules, np.array([0]))[0])
    length = np.linalg.norm(x[pattern[:, 1]] - x[pattern[:, 0]], axis=1)
    stiffness = np.where(is_cable, EA_CABLE, EA_BAR) / length
    initial_elongation = np.zeros(len(pattern))
    initial_elongation[:16] = self_stress(x, pattern[:16], np.arange(16)) / stiffness[:16]
    law = np.where(is_cable & (name == "tensegrity-grid"), Law.CABLE, Law.BAR)
    clamped = (nodes[:, 2] == 0.0) & ((nodes[:, 0] == 0.0) | (nodes[:, 0] == modules * SIDE))
    force = np.zeros_like(nodes)
    force[~clamped, 2] = -load
    arrays = {
        "nodes": nodes,
        "links": _corners(modules, cells)[:, pattern].reshape(-1, 2),
        "law": np.tile(law, len(cells)),
        "stiffness": np.tile(stiffness, len(cells)),
        "initial_elongation": np.tile(initial_elongation, len(cells)),
        "fixed": np.repeat(clamped[:, None], 3, axis=1),
        "load": force,
        "subdomain": None if side is None else np.repeat(parts, len(pattern)),
    }
    metadata = {
        "modules": int(modules),
        "module": module,
        "partition": partition,
        "subdomains": subdomains if side is None else side**2,
        "slack_target": float(slack),
        "load_per_node": load,
    }
    return arrays, metadata


def node_count(size):
    """Return the number of nodes of a grid of size x size modules."""
    return (size + 1) ** 2 + 2 * size * (size + 1)


def _nodes(size, number):
    """Coordinates of nodes by their numbers.

    Lower nodes come first, then the upper nodes above the edges along x, then above those along y; x fastest.
    """
    x = np.empty((len(number), 3))
    above_x, above_y = (size + 1) ** 2, (size + 1) ** 2 + size * (size + 1)
    layers = (0, above_x, size + 1, 0.0, 0.0, 0.0), (above_x, above_y, size, 0.5, 0.0, HEIGHT / SIDE)
    for first, last, row, right, up, z in (*layers, (above_y, node_count(size), size + 1, 0.0, 0.5, HEIGHT / SIDE)):
        here = (number >= first) & (number < last)
        j, i = np.divmod(number[here] - first, row)
        x[here] = np.column_stack([i + right, j + up, np.full(len(i), z)])
    return x * SIDE


def _corners(size, cells):
    """Return the eight nodes of modules by their numbers (x fastest)."""
    j, i = np.divmod(cells, size)
    along_x = (size + 1) ** 2
    along_y = along_x + size * (size + 1)

    def lower(a, b):
        return b * (size + 1) + a

    def above_x(b):
        return along_x + b * size + i

    def above_y(a):
        return along_y + j * (size + 1) + a

    return np.column_stack(
        [lower(i, j), lower(i + 1, j), lower(i + 1, j + 1), lower(i, j + 1)]
        + [above_x(j), above_y(i + 1), above_x(j + 1), above_y(i)]
    )


def _cells(size, side, rank, ranks):
    """Modules of a rank, ascending, and their subdomains, side x side square blocks; None without these."""
    if side is None:
        return np.arange(*block(size * size, rank, ranks)), None
    width = size // side
    parts = np.arange(*block(side * side, rank, ranks))
    across = np.arange(width)
    j = (parts // side * width)[:, None, None] + across[None, :, None]
    i = (parts % side * width)[:, None, None] + across[None, None, :]
    cells, of_cell = (j * size + i).ravel(), np.repeat(parts, width * width)
    order = np.argsort(cells)
    return cells[order], of_cell[order]


def self_stress(nodes, links, kinds):
    """Tensions (N) of a module that balance each other, one for each kind of link; link 0 is a cable."""
    along = nodes[links[:, 1]] - nodes[links[:, 0]]
    along /= np.linalg.norm(along, axis=1)[:, None]
    balance = np.zeros((*nodes.shape, kinds.max() + 1))
    for (a, b), direction, kind in zip(links, along, kinds):
        balance[a, :, kind] -= direction
        balance[b, :, kind] += direction
    tension = np.linalg.svd(balance.reshape(nodes.size, -1))[2][-1]
    tension = tension[kinds] * np.sign(tension[0])
    return tension * MAX_CABLE_TENSION / tension.max()


def _blocks_a_side(modules, subdomains):
    """Return how many square blocks of modules lie along a side."""
    if subdomains is None:
        if modules % BLOCK:
            raise ValueError(
                f"{modules} modules a side are not a multiple of {BLOCK}: give subdomains, the square of a number "
                f"that divides {modules}, or partition metis"
            )
        subdomains = (modules // BLOCK) ** 2
    side = math.isqrt(max(int(subdomains), 0))
    if side == 0 or side**2 != subdomains or modules % side:
        fit = [k * k for k in range(1, modules + 1) if modules % k == 0]
        raise ValueError(
            f"{counted(subdomains, 'subdomain')} cannot be equal square blocks of {modules} x {modules} modules: "
            f"choose from {', '.join(map(str, fit))}, or partition metis"
        )
    return side
