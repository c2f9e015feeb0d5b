"""Structures whose links turn, closed forms, and Newton's method in numpy. `job` runs on ranks."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from petsc4py import PETSc

import latinpc

HEIGHT, STIFFNESS = 0.3, 1e4  # of the von Mises truss, of span 2


# ---- structures -----------------------------------------------------------------------------------
def net(cells, rise, load, tension=1000.0, EA=1e6):
    """Cables between the points of a grid of unit meshes on a saddle, the rim clamped, without cables along it."""
    i, j = np.meshgrid(np.arange(cells + 1), np.arange(cells + 1), indexing="ij")
    z = rise * ((i / cells - 0.5) ** 2 - (j / cells - 0.5) ** 2)
    number = np.arange((cells + 1) ** 2).reshape(cells + 1, cells + 1)
    along = np.column_stack([number[:-1, 1:-1].ravel(), number[1:, 1:-1].ravel()])
    across = np.column_stack([number[1:-1, :-1].ravel(), number[1:-1, 1:].ravel()])
    links = np.concatenate([along, across])
    used, links = np.unique(links, return_inverse=True)
    links = links.reshape(-1, 2)
    nodes = np.column_stack([i.ravel(), j.ravel(), z.ravel()]).astype(float)[used]
    rim = ((nodes[:, :2] == 0) | (nodes[:, :2] == cells)).any(axis=1)
    fixed = np.repeat(rim[:, None], 3, axis=1)
    length = np.linalg.norm(nodes[links[:, 1]] - nodes[links[:, 0]], axis=1)
    stiffness = EA / (length / (1.0 + tension / EA))
    structure = {"nodes": nodes, "links": links, "law": "cable", "stiffness": stiffness, "prestress": tension}
    return structure | {"fixed": fixed, "load": np.where(fixed, 0.0, load)}


def random_net(seed):
    """A warped net with tensions and stiffnesses that differ by ten, some cables without tension, and random loads."""
    rng = np.random.default_rng(seed)
    structure = net(7, 1.5, [0.0, 0.0, 0.0])
    free = ~structure["fixed"]
    structure["nodes"] = structure["nodes"] + np.where(free, rng.uniform(-0.2, 0.2, free.shape), 0.0)
    links = len(structure["links"])
    tension = 1000.0 * 10.0 ** rng.uniform(-0.5, 0.5, links)
    tension[rng.random(links) < 0.05] = 0.0
    structure["stiffness"] = 1e5 * 10.0 ** rng.uniform(-0.5, 0.5, links)
    return structure | {"prestress": tension, "load": np.where(free, rng.normal(size=free.shape) * 150.0, 0.0)}


def von_mises(load):
    """Two bars that lean on each other, loaded down."""
    return {
        "nodes": [[-1.0, 0.0], [1.0, 0.0], [0.0, HEIGHT]],
        "links": [[0, 2], [1, 2]],
        "law": "bar",
        "stiffness": STIFFNESS,
        "fixed": [[True, True], [True, True], [False, False]],
        "load": [[0.0, 0.0], [0.0, 0.0], [0.0, -load]],
    }


def beside(one, other):
    """Two structures as one, in space: the nodes of the second one, 5 m lower, come after those of the first."""
    parts = []
    for s in (one, other):
        nodes = np.asarray(s["nodes"], float)
        more, count = np.zeros((len(nodes), 3 - nodes.shape[1])), len(s["links"])
        part = {"nodes": np.column_stack([nodes, more]), "links": np.asarray(s["links"])}
        part |= {"fixed": np.column_stack([s["fixed"], more == 0]), "load": np.column_stack([s["load"], more])}
        parts.append(part | {key: np.broadcast_to(s.get(key, 0.0), count) for key in ("law", "stiffness", "prestress")})
    parts[1]["nodes"] -= [0.0, 0.0, 5.0]
    parts[1]["links"] = parts[1]["links"] + len(parts[0]["nodes"])
    return {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}


def von_mises_force(deflection):
    """Return the load in equilibrium with a deflection."""
    z = HEIGHT - deflection
    length = np.hypot(1.0, z)
    return 2.0 * STIFFNESS * (np.hypot(1.0, HEIGHT) - length) * z / length


def von_mises_limit():
    """Return the load of the limit point: where z^2 = l^(2/3) - 1, with l the drawn length."""
    return von_mises_force(HEIGHT - np.sqrt(np.hypot(1.0, HEIGHT) ** (2.0 / 3.0) - 1.0))


def von_mises_deflection(load):
    """Return the deflection before the limit point, by bisection."""
    low, high = 0.0, HEIGHT - np.sqrt(np.hypot(1.0, HEIGHT) ** (2.0 / 3.0) - 1.0)
    for _ in range(100):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if von_mises_force(middle) < load else (low, middle)
    return low


def simplex(moment, tension=1000.0):
    """Three struts and nine cables, twisted by 150 degrees; a moment turns the upper triangle."""
    angle = np.arange(3) * 2.0 * np.pi / 3.0
    lower = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(3)])
    angle += np.deg2rad(150.0)
    nodes = np.concatenate([lower, np.column_stack([np.cos(angle), np.sin(angle), np.ones(3)])])
    links = [(i, (i + 1) % 3) for i in range(3)] + [(3 + i, 3 + (i + 1) % 3) for i in range(3)]
    links = np.array(links + [(i, 3 + (i - 1) % 3) for i in range(3)] + [(i, 3 + i) for i in range(3)])
    span = nodes[links[:, 1]] - nodes[links[:, 0]]
    balance = np.zeros((6, 3, 12))
    for m, (a, b) in enumerate(links):
        balance[a, :, m] -= span[m]
        balance[b, :, m] += span[m]
    stress = np.linalg.svd(balance.reshape(18, 12))[2][-1]
    stress *= np.sign(stress[0]) * np.linalg.norm(span, axis=1)
    fixed = np.repeat([[True], [False]], 3, axis=0).repeat(3, axis=1)
    load = np.zeros((6, 3))
    load[3:] = moment / 3.0 * np.cross([0.0, 0.0, 1.0], nodes[3:])
    structure = {"nodes": nodes, "links": links, "law": ["cable"] * 9 + ["bar"] * 3, "stiffness": 1e5}
    return structure | {"prestress": stress * tension / stress[:9].max(), "fixed": fixed, "load": load}


def column(bars, load):
    """Bars of 1 m above each other, hinged, between springs of 100 N/m; the top moves down alone."""
    height = np.arange(bars + 1.0)
    nodes = np.concatenate(
        [np.column_stack([0.0 * height, height]), np.column_stack([0.0 * height + 1.0, height])[1:-1]]
    )
    links = [[k, k + 1] for k in range(bars)] + [[k, bars + k] for k in range(1, bars)]
    fixed, loads = np.zeros(nodes.shape, bool), np.zeros(nodes.shape)
    fixed[0] = fixed[bars + 1 :] = fixed[bars, 0] = True
    loads[bars, 1] = -load
    structure = {"nodes": nodes, "links": links, "law": "bar", "stiffness": [1e6] * bars + [100.0] * (bars - 1)}
    return structure | {"fixed": fixed, "load": loads}


def hanging(nodes, links, length, fixed, weight):
    """Links of these natural lengths in the plane, nodes that are fixed, and forces along z on the others."""
    nodes, links = np.asarray(nodes, float), np.asarray(links)
    drawn = np.linalg.norm(nodes[links[:, 1]] - nodes[links[:, 0]], axis=1)
    held = np.isin(np.arange(len(nodes)), fixed)
    load = np.zeros(nodes.shape)
    load[~held, -1] = weight
    structure = {"nodes": nodes, "links": links, "initial_elongation": drawn - length, "load": load}
    return structure | {"fixed": np.repeat(held[:, None], nodes.shape[1], axis=1)}


def catenary(links=20, span=10.0, EA=1e4, weight=20.0):
    """Return a cable drawn taut along a straight line, under weights at its nodes, and its exact displacements."""
    nodes = np.column_stack([np.linspace(0.0, span, links + 1), np.zeros(links + 1)])
    natural = 1.05 * span / links
    fixed = np.zeros((links + 1, 2), bool)
    fixed[[0, -1]] = True
    load = np.where(fixed, 0.0, [0.0, -weight])
    shape = lambda v: _catenary(links, natural, EA, weight, *v)  # noqa: E731
    v = np.array([weight * links, 0.5 * weight * (links - 1)])
    for _ in range(100):
        miss = shape(v)[-1] - [span, 0.0]
        J = np.column_stack([(shape(v + d)[-1] - shape(v - d)[-1]) / 2e-3 for d in 1e-3 * np.eye(2)])
        v = v - np.linalg.solve(J, miss)
    structure = {"nodes": nodes, "links": np.column_stack([np.arange(links), np.arange(1, links + 1)]), "law": "cable"}
    structure |= {"stiffness": EA / natural, "initial_elongation": span / links - natural, "fixed": fixed, "load": load}
    return structure, shape(v) - nodes


def _catenary(links, natural, EA, weight, across, up):
    """Return the nodes from the force at the first one: each link is along the force that it bears."""
    force = np.column_stack([np.full(links, across), -up + weight * np.arange(links)])
    tension = np.linalg.norm(force, axis=1)
    steps = force / tension[:, None] * (natural * (1.0 + tension / EA))[:, None]
    return np.concatenate([[[0.0, 0.0]], np.cumsum(steps, axis=0)])


# ---- Newton's method in numpy -----------------------------------------------------------------------
def newton(structure, increments=20):
    """Return the displacements by increments of the loads, dense, with steps along which the unbalance falls."""
    nodes, links = np.asarray(structure["nodes"], float), np.asarray(structure["links"])
    count, dim = nodes.shape
    cable = np.broadcast_to(np.asarray(structure["law"]) == "cable", len(links))
    k = np.broadcast_to(np.asarray(structure["stiffness"], float), len(links))
    span = nodes[links[:, 1]] - nodes[links[:, 0]]
    natural = np.linalg.norm(span, axis=1) - np.asarray(structure["prestress"]) / k
    free = ~np.asarray(structure["fixed"], bool).ravel()
    load = np.asarray(structure["load"], float)

    def state(u, part):
        r = span + u[links[:, 1]] - u[links[:, 0]]
        size = np.linalg.norm(r, axis=1)
        tension, tangent = k * (size - natural), k.copy()
        tension[cable & (size <= natural)] = tangent[cable & (size <= natural)] = 0.0
        n = r / size[:, None]
        left = part * load.copy()
        np.add.at(left, links[:, 0], tension[:, None] * n)
        np.add.at(left, links[:, 1], -tension[:, None] * n)
        K = np.zeros((count, dim, count, dim))
        for m, (a, b) in enumerate(links):
            nn = np.outer(n[m], n[m])
            block = tangent[m] * nn + tension[m] / size[m] * (np.eye(dim) - nn)
            for p, q, sign in ((a, a, 1), (b, b, 1), (a, b, -1), (b, a, -1)):
                K[p, :, q] += sign * block
        return left.ravel()[free], K.reshape(count * dim, -1)[np.ix_(free, free)]

    u = np.zeros((count, dim))
    for part in np.linspace(1.0 / increments, 1.0, increments):
        moved = np.inf
        for _ in range(200):
            left, K = state(u, part)
            step = np.zeros(count * dim)
            step[free] = np.linalg.solve(K, left)
            step = step.reshape(u.shape)
            length = 1.0
            slope = left @ step.ravel()[free]
            while length > 1e-4 and state(u + length * step, part)[0] @ step.ravel()[free] < -0.5 * slope:
                length *= 0.5
            u = u + length * step
            before, moved = moved, np.linalg.norm(step)
            if moved <= 1e-14 * max(np.linalg.norm(u), 1e-3) or before / 2 < moved < 1e-10:  # rounding is left
                break
    return u


# ---- solves -------------------------------------------------------------------------------------------
def solve(structure, geometry="large", error=None, guess=None, reference=None, **options):
    """Solve by SNES latin, with its options, and return what was found."""
    s = latinpc.Structure(**structure, geometry=geometry)
    database, prefix = PETSc.Options(), "turning_"
    given = {"snes_latin_error": error} if error else {}
    own = ("stol", "max_it")
    given |= {f"snes_{k}" if k in own else f"snes_latin_{k}": v for k, v in options.items()}
    for key, value in given.items():
        database[prefix + key] = value
    snes = s.create_snes()
    snes.setOptionsPrefix(prefix)
    try:
        snes.setFromOptions()
    finally:
        for key in given:
            database.delValue(prefix + key)
    u = s.create_vec()
    if guess is not None:
        s.set_displacements(guess, u)
    if reference is not None:
        v = s.create_vec()
        s.set_displacements(reference, v)
        latinpc.set_reference(snes, v)
    snes.solve(None, u)
    return SimpleNamespace(
        reason=snes.getConvergedReason(),
        converged=snes.getConvergedReason() > 0,
        iterations=snes.getIterationNumber(),
        displacements=s.displacements(u),
        tensions=latinpc.tensions(snes),
        subdomain=latinpc.subdomain_of_links(snes),
        renewals=latinpc.path(snes)["renewals"] if geometry == "large" else 0,
        borne=latinpc.path(snes)["borne"] if geometry == "large" else 1.0,
    )


def scaled(structure, force, length):
    """Return the structure in other units: all forces and all lengths times as much."""
    units = {"nodes": length, "stiffness": force / length, "load": force, "prestress": force}
    units["initial_elongation"] = length
    return structure | {key: np.asarray(structure[key], float) * by for key, by in units.items() if key in structure}


def hidden(part):
    """Return a net and a von Mises truss under that part of its limit load."""
    return beside(net(10, 2.0, [0.0, 0.0, -500.0]), von_mises(part * von_mises_limit()))


def job(variant):
    """Solve a net on any number of ranks, or with a truss that snaps through beside it (`jobs.py`)."""
    if variant == "snaps":
        result = solve(hidden(20.0), error=1e-9, subdomains=5)
        return {"reason": int(result.reason), "borne": result.borne, "last": float(result.displacements[-1, 1])}
    result = solve(net(10, 2.0, [0.0, 0.0, -500.0]), error=1e-9, variant=variant, subdomains=5)
    size = {"largest": abs(result.displacements).max(), "norm": np.linalg.norm(result.displacements)}
    return {"reason": int(result.reason), **size}


def struts(load):
    """Keywords: a node between two struts of 100 N, 1 m long, loaded across; two cables, slack as drawn, hold it."""
    return {
        "nodes": [[-1.0, 0.0], [0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, -1.0]],
        "links": [[0, 1], [1, 2], [3, 1], [4, 1]],
        "law": ["bar", "bar", "cable", "cable"],
        "stiffness": [1e5, 1e5, 1e4, 1e4],
        "initial_elongation": [-1e-3, -1e-3, -1e-2, -1e-2],
        "fixed": [[1, 1], [0, 0], [1, 1], [1, 1], [1, 1]],
        "load": [[0.0, 0.0], [0.0, load], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]],
    }
