"""Dense packings of discs or spheres under confinement: rigid or elastic contacts, with or without friction."""

from __future__ import annotations

import itertools
import math

import numpy as np

from latinpc.results.units import counted

from .scene import Law, Scene, blocks_or_metis

GRAIN = 1.0  # diameter (m)
PRESSURE = 1000.0  # force on each grain of the top layer (N)
STIFFNESS = 1.0e7  # of an elastic contact (N/m)
BLOCK = {2: 16, 3: 6}  # grains along a side of a subdomain, by default
LAWS = ("contact", "friction", "elastic")


def packing(
    side: int = 32,
    dim: int = 2,
    law: str = "contact",
    disorder: float = 1e-3,
    friction: float = 0.3,
    subdomains: int | None = None,
    partition: str = "regular",
    seed: int = 0,
) -> Scene:
    """Grains of slightly different size on a dense lattice, in a box, pressed from above.

    The contact network is given: neighbours on the triangular lattice (discs) or on the face-centred cubic one
    (spheres). Grains are a little smaller than their places, by random amounts, so that contacts have gaps e0. Under
    pressure some close and the others stay open: chains of force, as in the model of J.-N. Roux (Phys. Rev. E 61,
    2000). Displacements are of the size of the gaps, small beside the grains. Grains do not turn: friction acts
    on their centres.

    Parameters
    ----------
    side : int
        Grains along a side.
    dim : {2, 3}
        Dimension, 2 for discs, 3 for spheres.
    law : {'contact', 'friction', 'elastic'}
        Law of the contacts. Rigid, rigid with Coulomb friction, or elastic.
    disorder : float
        Mean gap over the diameter. With 0 all contacts touch, nothing moves, and the tensions are not unique.
    friction : float
        Coefficient of friction. For the law 'friction'.
    subdomains : int, optional
        Number of subdomains; by default blocks of 16 grains a side in the plane, 6 in space.
    partition : {'regular', 'metis'}
        Equal blocks or METIS. With 'metis' the scene has no partition: the solver makes one.
    seed : int
        Seed of the random numbers.

    Returns
    -------
    Scene
    """
    if dim not in (2, 3):
        raise ValueError(f"dim must be 2 (discs) or 3 (spheres), not {dim}")
    if law not in LAWS:
        raise ValueError(f"law must be one of {', '.join(LAWS)}, not {law!r}")
    if side < 3:
        raise ValueError(f"side must be at least 3 grains, not {side}")
    partition = blocks_or_metis(partition)
    if not 0.0 <= disorder <= 0.1:
        raise ValueError(f"disorder must lie between 0 and 0.1, not {disorder}: gaps are small beside grains")
    nodes, pairs, walls, top, frames = _grains(side, dim)
    gap = np.random.default_rng(seed).uniform(0.0, 2.0 * disorder * GRAIN, len(pairs))
    load = np.zeros_like(nodes)
    load[top, -1] = -PRESSURE
    parts = None
    if partition == "regular":
        parts = _blocks(nodes[pairs[:, 0]], side, dim, subdomains)
        subdomains = int(parts.max()) + 1
    rows = dim if law == "friction" else 1
    frames = frames[:, :rows]
    elastic = law == "elastic"
    laws = {
        "contact": [Law.CONTACT],
        "elastic": [Law.COMPRESSION_ONLY],
        "friction": [Law.FRICTION] + [Law.TANGENT] * (dim - 1),
    }
    return Scene(
        name="packing",
        nodes=nodes,
        links=np.repeat(pairs, rows, axis=0),
        law=np.tile(laws[law], len(pairs)),
        stiffness=np.full(len(pairs) * rows, STIFFNESS if elastic else 0.0),
        initial_elongation=(gap[:, None] * np.eye(1, rows)).ravel(),
        fixed=np.repeat(walls[:, None], dim, axis=1),
        load=load,
        subdomain=None if parts is None else np.repeat(parts, rows),
        direction=frames.reshape(-1, dim),
        friction=np.full(len(pairs) * rows, friction) if rows > 1 else None,
        metadata={
            "side": int(side),
            "dim": int(dim),
            "law": law,
            "disorder": float(disorder),
            "friction": float(friction) if rows > 1 else None,
            "contacts": len(pairs),
            "seed": int(seed),
            "partition": partition,
            "subdomains": subdomains,
        },
    )


def _grains(side, dim):
    """Return the grains and the contacts.

    Returns
    -------
    nodes : (n, dim) array
        Centres (m).
    pairs : (m, 2) array of int
        Grains of each contact.
    walls, top : (n,) array of bool
        Grains of the box, which are held, and grains under pressure.
    frames : (m, dim, dim) array
        Normal and tangential unit vectors of each contact, as rows.
    """
    place, nodes, steps = _discs(side) if dim == 2 else _spheres(side)
    pairs, kind = _neighbours(place, steps)
    walls = (place.min(axis=0) == place).any(axis=1) | (place.max(axis=0) == place)[:, : dim - 1].any(axis=1)
    top = (place[:, -1] == place[:, -1].max()) & ~walls
    inner = ~walls[pairs].all(axis=1)  # two grains of a wall do not press each other
    pairs, kind = pairs[inner], kind[inner]
    used, pairs = np.unique(pairs, return_inverse=True)
    frames = np.array([_frame(step) for step in steps])[kind]
    return nodes[used], pairs.reshape(-1, 2), walls[used], top[used], frames


def _exact(value):
    """Round to a few binary digits, so that coordinates add up exactly and equal subdomains are equal to the bit."""
    return round(value * 2**20) / 2**20


def _discs(side):
    """Integer places (column, row), coordinates and the three steps to neighbours of the triangular lattice."""
    row, column = (axis.ravel() for axis in np.meshgrid(np.arange(side), np.arange(side), indexing="ij"))
    height = _exact(math.sqrt(3.0) / 2.0)
    nodes = np.column_stack([column + 0.5 * (row % 2), height * row]) * GRAIN
    return np.column_stack([column, row]), nodes, np.array([[1.0, 0.0], [0.5, height], [-0.5, height]])


def _spheres(side):
    """Do the same for the face-centred cubic lattice: places with an even sum, in units of 1 / sqrt(2) diameters."""
    half = _exact(math.sqrt(0.5))
    place = np.array([p for p in itertools.product(range(side), repeat=3) if sum(p) % 2 == 0])
    steps = np.array([[1, 1, 0], [1, -1, 0], [1, 0, 1], [1, 0, -1], [0, 1, 1], [0, 1, -1]], dtype=float)
    return place, place * half * GRAIN, steps * half


def _neighbours(place, steps):
    """Return the pairs of grains that a step joins, and which step."""
    dim = place.shape[1]
    size = place.max(axis=0) + 3
    number = np.full(size, -1)
    number[tuple((place + 1).T)] = np.arange(len(place))
    pairs, kinds = [], []
    for kind, step in enumerate(steps):
        if dim == 3:
            there = place + np.rint(step * math.sqrt(2.0)).astype(int)
        else:  # rows are shifted by half a grain in turn
            up = int(step[1] > 0)
            there = place + np.column_stack(
                [place[:, 1] % 2 * up + (0 if up else 1) - (1 if step[0] < 0 else 0), np.full(len(place), up)]
            )
        other = number[tuple((there + 1).T)]
        joined = np.flatnonzero(other >= 0)
        pairs.append(np.column_stack([joined, other[joined]]))
        kinds.append(np.full(len(joined), kind))
    pairs, kinds = np.concatenate(pairs), np.concatenate(kinds)
    order = np.lexsort((kinds, pairs[:, 0]))
    return pairs[order], kinds[order]


def _frame(step):
    """Return the normal and the tangential unit vectors of a contact, as rows."""
    normal = step / np.linalg.norm(step)
    if len(normal) == 2:
        return np.array([normal, [-normal[1], normal[0]]])
    first = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    first /= np.linalg.norm(first)
    return np.array([normal, first, np.cross(normal, first)])


def _blocks(where, side, dim, subdomains):
    """Return the box of grains that each contact is in; boxes without contact have no number."""
    count = max(1, side // BLOCK[dim]) if subdomains is None else round(max(subdomains, 0) ** (1.0 / dim))
    if subdomains is not None and (count < 1 or count**dim != subdomains):
        raise ValueError(f"{counted(subdomains, 'subdomain')} cannot be boxes: choose k**{dim}, or partition metis")
    low, high = where.min(axis=0), where.max(axis=0)
    box = np.minimum(((where - low) / (high - low) * count).astype(int), count - 1)
    return np.unique(np.ravel_multi_index(tuple(box.T), (count,) * dim), return_inverse=True)[1]
