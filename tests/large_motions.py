"""Motions of links that turn: how tests make them, and the scheme written out."""

from contextlib import contextmanager

import numpy as np
from petsc4py import PETSc
from scipy.optimize import root
from turning import net

import latinpc

G = 9.81
NEWTON = {"snes_type": "newtonls", "ksp_type": "preonly", "pc_type": "lu", "snes_linesearch_type": "basic"}
NEWTON |= {"snes_rtol": 1e-13, "snes_stol": 1e-14, "snes_atol": 1e-10}


class Motion:
    """A TS on a structure; `u`, `v` and the energy are those after each step."""

    def __init__(self, structure, h, u=None, v=None):
        self.structure = latinpc.Structure(**structure, geometry="large")
        self.fixed, self.mass = np.asarray(structure["fixed"], bool), np.asarray(structure["mass"])[:, None]
        self.nodes = np.asarray(structure["nodes"], float)
        self.vec_u, self.vec_v = self.structure.create_vec(), self.structure.create_vec()
        for given_, vec in ((u, self.vec_u), (v, self.vec_v)):
            if given_ is not None:
                self.structure.set_displacements(given_, vec)
        self.ts = self.structure.create_ts(self.vec_u, self.vec_v)
        self.ts.setTimeStep(h)
        self.ts.setMaxSteps(10**6)

    def step(self, n=1):
        for _ in range(n):
            self.ts.step()
        return self

    @property
    def u(self):
        return self.structure.displacements(self.vec_u)

    @property
    def v(self):
        return np.where(self.fixed, 0.0, self.structure.displacements(self.vec_v))

    @property
    def energy(self):
        return self.structure.energy(self.vec_u) + self.structure.kinetic_energy(self.vec_v)

    @property
    def momenta(self):
        """Linear and angular momentum."""
        p, x = self.mass * self.v, self.nodes + self.u
        turn = np.cross(x, p) if x.shape[1] == 3 else x[:, 0] * p[:, 1] - x[:, 1] * p[:, 0]
        return np.append(p.sum(axis=0), turn.sum(axis=0))


@contextmanager
def motion(structure, h, u=None, v=None, **options):
    """Give a Motion with these options of the solver of its steps."""
    database, prefix = PETSc.Options(), "turning_motion_"
    it = Motion(structure, h, u, v)
    it.ts.setOptionsPrefix(prefix)
    for key, value in options.items():
        database[prefix + key] = value
    try:
        it.ts.setFromOptions()
        yield it
    finally:
        it.ts.destroy()
        for key in options:
            database.delValue(prefix + key)


def pendulum(angle=1.0, stiffness=1e5):
    """A mass of 1 kg on a bar of 1 m."""
    nodes = [[0.0, 0.0], [np.sin(angle), -np.cos(angle)]]
    structure = {"nodes": nodes, "links": [[0, 1]], "law": "bar", "stiffness": stiffness, "mass": [0.0, 1.0]}
    return structure | {"fixed": [[True, True], [False, False]], "load": [[0.0, 0.0], [0.0, -G]]}


def free(nodes, links, law, stiffness, mass):
    """A structure that nothing holds or loads."""
    nodes = np.asarray(nodes, float)
    structure = {"nodes": nodes, "links": links, "law": law, "stiffness": stiffness, "mass": mass}
    return structure | {"fixed": np.zeros(nodes.shape, bool), "load": np.zeros(nodes.shape)}


def wheel(count=12, stiffness=1e5):
    """A hub, a rim and spokes."""
    angle = 2.0 * np.pi * np.arange(count) / count
    nodes = np.concatenate([[[0.0, 0.0]], np.column_stack([np.cos(angle), np.sin(angle)])])
    rim = [(k + 1, (k + 1) % count + 1) for k in range(count)]
    return free(nodes, [(0, k + 1) for k in range(count)] + rim, "bar", stiffness, np.ones(count + 1))


def shaken(speed=5.0, mass=5.0, cells=6, rise=1.0, load=-200.0):
    """A saddle of cables, and random velocities: some slacken."""
    structure = net(cells, rise, [0.0, 0.0, load])
    v = np.random.default_rng(0).normal(size=structure["nodes"].shape) * speed
    return structure | {"mass": np.full(len(v), mass)}, np.where(structure["fixed"], 0.0, v)


def mean_forces(structure, r0, r1):
    """The force of each link of a bar or a cable in a step, written out: W(x1) - W(x0) over R1 - R0, along r0 + r1."""
    nodes, links, k = structure["nodes"], np.asarray(structure["links"]), np.asarray(structure["stiffness"])
    cable = np.broadcast_to(np.asarray(structure["law"]) == "cable", len(links))
    drawn = np.linalg.norm(nodes[links[:, 1]] - nodes[links[:, 0]], axis=1)
    natural = drawn - np.asarray(structure["prestress"]) / k
    R0, R1 = np.linalg.norm(r0, axis=1), np.linalg.norm(r1, axis=1)
    x0, x1 = R0 - natural, R1 - natural
    lower = np.where(cable, 0.0, -np.inf)
    y0, y1 = np.maximum(x0, lower), np.maximum(x1, lower)
    near = np.abs(x1 - x0) < 1e-9
    tension = np.where(near, k * y0, 0.5 * k * (y1**2 - y0**2) / np.where(near, 1.0, x1 - x0))
    return (tension / (R0 + R1))[:, None] * (r0 + r1)


def written_out(structure, u, v, h, steps, start=None):
    """The same steps by scipy, the first from the change `start` of the displacements."""
    links, free_ = np.asarray(structure["links"]), ~np.asarray(structure["fixed"], bool)
    span = structure["nodes"][links[:, 1]] - structure["nodes"][links[:, 0]]
    mass = np.repeat(structure["mass"][:, None], u.shape[1], axis=1)

    def left(change, u, v):
        d = np.zeros(u.shape)
        d[free_] = change
        f = mean_forces(
            structure, span + u[links[:, 1]] - u[links[:, 0]], span + (u + d)[links[:, 1]] - (u + d)[links[:, 0]]
        )
        r = mass * 2.0 / h * (d / h - v) - structure["load"]
        np.add.at(r, links[:, 0], -f)
        np.add.at(r, links[:, 1], f)
        return r[free_]

    for _ in range(steps):
        d = np.zeros(u.shape)
        d[free_] = root(left, h * v[free_] if start is None else start[free_], (u, v), tol=1e-13).x
        start = None
        u, v = u + d, 2.0 * d / h - v
    return u, v


def tangle(seed, massless):
    """A few nodes, joined at random by bars and cables, some of which are without mass; and velocities."""
    rng = np.random.default_rng(seed)
    dim, n = 2 + seed % 2, int(rng.integers(4, 10))
    nodes = rng.permutation(np.stack(np.meshgrid(*[np.arange(3)] * dim), axis=-1).reshape(-1, dim))[:n]
    nodes = nodes + rng.uniform(-0.3, 0.3, (n, dim))
    links = np.array([(a, i) for i in range(1, n) for a in rng.choice(i, min(i, dim), replace=False)])
    law = rng.choice(["bar", "cable"], len(links))
    structure = free(nodes, links, list(law), 10.0 ** rng.uniform(0, 2, len(links)), 10.0 ** rng.uniform(-1, 1, n))
    structure["prestress"] = np.where(law == "bar", rng.normal(0, 0.1, len(links)), 0.1)
    structure["fixed"][0] = True
    structure["load"] = np.where(structure["fixed"], 0.0, rng.normal(0, 1, (n, dim)))
    structure["mass"] *= np.append(rng.random(n - 1) >= massless, True)
    heavy = (structure["mass"] > 0.0)[:, None] & ~structure["fixed"]
    return structure, np.where(heavy, rng.normal(0, 1, (n, dim)), 0.0)
