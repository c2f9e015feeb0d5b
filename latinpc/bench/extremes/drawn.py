"""Structures drawn at random: their families, each made from a seed and a number.

A topology (a skeleton whose nodes hang on earlier ones, a grid, clusters, a chain, a star), laws mixed, supports that
settle or not, prestress or slack at rest, loads down to 1e-9 of what the stiffnesses bear, stiffness ratios up to 1e9;
some next to their collapse load, some with rigid links, contacts with friction, or in motion.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from latinpc.laws import Law
from latinpc.scenes import Scene

from . import cables, turning

STEPS = 15  #: of a motion
SHARES = {"statics": 0.7, "collapse": 0.1, "rigid": 0.1, "friction": 0.05, "motion": 0.05}
LARGE = {"large": turning.structure, "cables": cables.structure}  #: of large displacements, drawn where asked for
FAMILIES = (*SHARES, *LARGE)
SOFT = (Law.CABLE, Law.COMPRESSION_ONLY)
STIFF = (Law.INEXTENSIBLE, Law.CONTACT)


@dataclass(frozen=True)
class Drawn:
    """A structure and where it comes from."""

    family: str  #: one of `FAMILIES`
    topology: str
    scene: Scene
    steps: int = 0


def draw(seed, number, family=None):
    """Make a structure.

    Parameters
    ----------
    seed, number : int
        The same ones make the same structure.
    family : str, optional
        One of `FAMILIES`; drawn by `SHARES` if left out.

    Returns
    -------
    Drawn
    """
    rng = np.random.default_rng([seed, number])
    if family in LARGE:
        return Drawn(family, *LARGE[family](rng))
    drawn = rng.choice(list(SHARES), p=list(SHARES.values()))
    family = family or str(drawn)
    topology = str(rng.choice(list(TOPOLOGIES)))
    dim = int(rng.integers(1, 4))
    nodes, links, fixed = TOPOLOGIES[topology](rng, dim)
    scene = _structure(rng, nodes, links, fixed, family)
    if family == "collapse":
        scene = _near_collapse(rng, scene)
    if family == "friction":
        scene = _rubbing(rng, scene)
    if family == "motion":
        scene = _moving(rng, scene)
    return Drawn(family, topology, scene, STEPS if family == "motion" else 0)


# ---- topologies: nodes, links, nodes that are held -------------------------------------------
def _skeleton(rng, dim):
    count = dim + int(rng.integers(1, 16))
    nodes = _shaken(rng, count, dim)
    links = [(int(a), i) for i in range(dim, count) for a in rng.choice(i, dim, replace=False)]
    return nodes, _extended(rng, links, count), np.arange(count) < dim


def _grid(rng, dim):
    size = rng.integers(2, {1: 12, 2: 6, 3: 4}[dim], dim)
    points = np.stack(np.meshgrid(*[np.arange(n) for n in size], indexing="ij"), axis=-1).reshape(-1, dim)
    reach = np.abs(points[:, None] - points[None]).max(axis=2) == 1
    pairs = np.argwhere(np.triu(reach))
    straight = np.abs(points[pairs[:, 0]] - points[pairs[:, 1]]).sum(axis=1) == 1
    pairs = pairs[straight | (rng.random(len(pairs)) < rng.choice([0.4, 1.0]))]
    held = points[:, 0] == 0
    return points + rng.uniform(-0.2, 0.2, points.shape), [tuple(map(int, pair)) for pair in pairs], held


def _clusters(rng, dim):
    groups, each = int(rng.integers(2, 5)), dim + int(rng.integers(1, 4))
    count = groups * each
    group = np.repeat(np.arange(groups), each)
    nodes = 4.0 * _shaken(rng, groups, dim)[group] + rng.uniform(-1, 1, (count, dim))
    links = [(a, b) for a in range(count) for b in range(a) if group[a] == group[b] and rng.random() < 0.8]
    for g in range(1, groups):
        for _ in range(int(rng.integers(dim, 3 * dim + 3))):
            links.append((int(rng.choice(each) + each * (g - 1)), int(rng.choice(each) + each * g)))
    return nodes, links, np.arange(count) < dim


def _chain(rng, dim):
    count, reach = int(rng.integers(3, 25)), int(rng.integers(1, dim + 2))
    nodes = np.zeros((count, dim))
    nodes[:, 0] = np.arange(count)
    if dim > 1:
        nodes[:, 1:] = rng.normal(0, rng.choice([0.05, 0.5]), (count, dim - 1))
    links = [(i - j, i) for i in range(count) for j in range(1, reach + 1) if i >= j]
    held = np.zeros(count, bool)
    held[: dim if rng.random() < 0.5 else 1] = True
    held[-1] = rng.random() < 0.5
    return nodes, links, held


def _star(rng, dim):
    count = dim + int(rng.integers(1, 12))
    nodes = np.vstack([np.zeros(dim), rng.normal(0, 1, (count, dim))])
    return nodes, [(0, i) for i in range(1, count + 1)], np.arange(count + 1) > 0


TOPOLOGIES = {"skeleton": _skeleton, "grid": _grid, "clusters": _clusters, "chain": _chain, "star": _star}


def _shaken(rng, count, dim):
    """Points that are not too close to each other: on a grid that is shaken."""
    side = int(np.ceil(count ** (1 / dim)))
    grid = np.stack(np.meshgrid(*[np.arange(side)] * dim, indexing="ij"), axis=-1).reshape(-1, dim)
    return rng.permutation(grid)[:count] + rng.uniform(-0.3, 0.3, (count, dim))


def _extended(rng, links, count):
    return links + [
        tuple(map(int, rng.choice(count, 2, replace=False))) for _ in range(int(rng.integers(0, 2 * count)))
    ]


# ---- what makes a structure of nodes and links -----------------------------------------------
def _structure(rng, nodes, links, fixed, family):
    (count, dim), links = nodes.shape, np.array(links)
    held = np.repeat(fixed[:, None], dim, axis=1) | (rng.random((count, dim)) < rng.choice([0.0, 0.1]))
    size = np.linalg.norm(nodes[links[:, 1]] - nodes[links[:, 0]], axis=1)
    law = np.where(rng.random(len(links)) < rng.choice([0.0, 0.3, 0.6, 1.0]), rng.choice(SOFT, len(links)), Law.BAR)
    if family == "rigid":
        law = np.where(rng.random(len(links)) < rng.choice([0.2, 0.5, 1.0]), rng.choice(STIFF, len(links)), law)
    decades = rng.choice([1.0, rng.uniform(1, 9)], p=[0.7, 0.3])
    stiffness = 10.0 ** rng.uniform(-decades / 2, decades / 2, len(links)) / size
    strain = rng.choice([0.0, 0.02, 1e-4]) * rng.normal(0, 1, len(links))
    if rng.random() < 0.3:  # slack at rest
        strain = np.where(np.isin(law, (Law.CABLE, Law.INEXTENSIBLE)), -np.abs(strain), np.abs(strain))
    load = rng.normal(0, 0.05, (count, dim)) * (rng.random((count, 1)) < rng.choice([0.2, 1.0]))
    load *= 10.0 ** rng.choice([0.0, rng.uniform(-9, 0.3)])
    return Scene(
        name="drawn",
        nodes=nodes,
        links=links,
        law=law,
        stiffness=np.where(np.isin(law, STIFF), 0.0, stiffness),
        initial_elongation=strain * size,
        fixed=held,
        prescribed=np.where(held, rng.normal(0, 0.01, (count, dim)), 0.0) if rng.random() < 0.2 else None,
        load=np.where(held, 0.0, load),
        subdomain=_partition(rng, nodes[links].mean(axis=1)),
    )


def _partition(rng, middle):
    """Half of the structures leave it to the solver; the others are cut by place."""
    if rng.random() < 0.5:
        return None
    seeds = middle[rng.choice(len(middle), min(int(rng.integers(2, 7)), len(middle)), replace=False)]
    return np.unique(np.linalg.norm(middle[:, None] - seeds, axis=2).argmin(axis=1), return_inverse=True)[1]


def _near_collapse(rng, scene):
    """Load a structure next to its collapse load, found by linear programming; leave it as it is without one."""
    from scipy.optimize import linprog

    n, m = scene.fixed.size, len(scene.links)
    b = np.zeros((m, len(scene.nodes), scene.dim))
    b[np.arange(m), scene.links[:, 1]] += scene.directions
    b[np.arange(m), scene.links[:, 0]] -= scene.directions
    free = ~scene.fixed.ravel()
    if not scene.load.any():
        return scene
    load = scene.load.ravel()[free] / np.abs(scene.load).max()
    bounds = [{Law.CABLE: (0, None), Law.COMPRESSION_ONLY: (None, 0)}.get(law, (None, None)) for law in scene.law]
    # forces without load that links may have at rest must not make the collapse load grow without bounds
    offset = rng.normal(0, 1, np.count_nonzero(free)) * 0.3
    found = linprog(
        np.append(np.zeros(m), -1.0),
        A_eq=np.column_stack([b.reshape(m, n)[:, free].T, -load]),
        b_eq=offset,
        bounds=[*bounds, (None, None)],
        method="highs",
    )
    if found.status != 0:
        return scene
    factor = found.x[-1] + rng.choice([-1, 1]) * abs(found.x[-1]) * 10.0 ** rng.uniform(-6, -1)
    near = np.zeros(n)
    near[free] = (factor * load + offset) * np.abs(scene.load).max()
    return replace(scene, load=near.reshape(scene.load.shape))


def _rubbing(rng, scene):
    """Contacts with friction between some nodes, in frames of their own."""
    if scene.dim == 1 or (~scene.fixed).sum() == 0:
        return scene
    count, dim = scene.nodes.shape
    links, law, gap, frame, friction = [], [], [], [], []
    for _ in range(int(rng.integers(1, 6))):
        a, b = rng.choice(count, 2, replace=False)
        normal = scene.nodes[b] - scene.nodes[a]
        axes = np.linalg.qr(np.column_stack([normal, rng.normal(size=(dim, dim - 1))]))[0].T
        axes[0] *= np.sign(axes[0] @ normal)
        links += [(a, b)] * dim
        law += [Law.FRICTION] + [Law.TANGENT] * (dim - 1)
        gap += [abs(rng.normal(0, 0.01)) * (rng.random() < 0.5)] + [0.0] * (dim - 1)
        frame.append(axes)
        friction += [rng.uniform(0, 1)] + [0.0] * (dim - 1)
    more = len(links)
    part = None if scene.subdomain is None else np.append(scene.subdomain, np.zeros(more, int))
    return replace(
        scene,
        links=np.vstack([scene.links, links]),
        law=np.append(scene.law, law),
        stiffness=np.append(scene.stiffness, np.zeros(more)),
        initial_elongation=np.append(scene.initial_elongation, gap),
        direction=np.vstack([np.zeros((len(scene.links), dim)), *frame]),
        friction=np.append(np.zeros(len(scene.links)), friction),
        subdomain=part,
    )


def _moving(rng, scene):
    """Masses, velocities and a time step; some contacts and inextensible cables among the links."""
    count = len(scene.nodes)
    stiff = rng.random(len(scene.links)) < rng.choice([0.0, 0.3])
    law = np.where(stiff, rng.choice(STIFF, len(stiff)), scene.law)
    velocity = rng.normal(0, 0.05 * 10.0 ** rng.uniform(-1, 1), scene.nodes.shape)
    return replace(
        scene,
        law=law,
        stiffness=np.where(stiff, 0.0, scene.stiffness),
        prescribed=None,
        mass=10.0 ** rng.uniform(-1, 1, count),
        velocity=np.where(scene.fixed, 0.0, velocity),
        time_step=float(10.0 ** rng.uniform(-1.5, 0.5)),
    )
