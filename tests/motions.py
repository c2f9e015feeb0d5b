"""Motions that several tests make: a TS over a scene, implicit Euler written out, what a set-up builds."""

from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import oracle
import pytest
from petsc4py import PETSc

import latinpc
from latinpc.options import default_options
from latinpc.scenes import Law, Scene

EXACT = {"snes_stol": 1e-12, "snes_max_it": 3000}
NEWTON = {"snes_type": "newtonls", "ksp_type": "preonly", "pc_type": "cholesky", "snes_linesearch_type": "none"}
NEWTON |= {"snes_rtol": 1e-13, "snes_stol": 1e-14, "snes_atol": 1e-9}


class Motion:
    """A TS on a scene; `u` and `v` are arrays in the scene's numbering after each step."""

    def __init__(self, scene, h, comm=PETSc.COMM_SELF, displacement=None):
        self.scene, self.structure = scene, latinpc.Structure.from_scene(scene, comm=comm)
        self.vec_u, self.vec_v = self.structure.create_vec(), self.structure.create_vec()
        if displacement is not None:
            self.structure.set_displacements(displacement, self.vec_u)
        if scene.velocity is not None:
            self.structure.set_displacements(scene.velocity, self.vec_v)
        self.ts = self.structure.create_ts(self.vec_u, self.vec_v)
        self.ts.setTimeStep(h)
        self.ts.setMaxSteps(10**6)
        self.ts.setFromOptions()

    def step(self, n=1):
        """Make some steps."""
        for _ in range(n):
            self.ts.step()
        return self

    @property
    def u(self):
        return self.structure.displacements(self.vec_u)

    @property
    def v(self):
        """Velocities; zero where displacements are prescribed."""
        return np.where(self.scene.fixed, 0.0, self.structure.displacements(self.vec_v))

    @property
    def iterations(self):
        return self.ts.getSNES().getIterationNumber()

    @property
    def tensions(self):
        return latinpc.step_tensions(self.ts)

    @property
    def energy(self):
        return self.structure.energy(self.vec_u) + self.structure.kinetic_energy(self.vec_v)


@contextmanager
def motion(scene, h, displacement=None, comm=PETSc.COMM_SELF, **options):
    """Give a Motion with these options: ``motion(scene, 1e-3, snes_stol=1e-8)``."""
    with default_options(options):
        it = Motion(scene, h, comm, displacement)
        try:
            yield it
        finally:
            it.ts.destroy()


def heavy(scene, mass=2.0, seed=0, speed=1.0, load=None):
    """Make a scene with masses and random velocities at the start."""
    rng = np.random.default_rng(seed)
    velocity = np.where(scene.fixed, 0.0, rng.normal(scale=speed, size=scene.nodes.shape))
    load = scene.load if load is None else np.broadcast_to(load, scene.load.shape)
    masses = mass * rng.uniform(0.5, 1.5, len(scene.nodes))
    return replace(scene, mass=masses, velocity=velocity, load=np.where(scene.fixed, 0.0, load))


def floating(scene):
    """Make the scene without supports and without loads."""
    free = np.zeros_like(scene.fixed)
    return replace(scene, fixed=free, prescribed=np.zeros(free.shape), load=np.zeros(free.shape))


def one_mass(stiffness=100.0, mass=2.0, law=Law.BAR, initial_elongation=0.0, load=0.0, velocity=0.0):
    """One mass on one link in one dimension."""
    return Scene(
        name="oscillator", nodes=[[0.0], [1.0]], links=[[0, 1]], law=[law], stiffness=[stiffness],
        initial_elongation=[initial_elongation], fixed=[[True], [False]], load=[[0.0], [load]], mass=[0.0, mass],
        velocity=[[0.0], [velocity]],
    )  # fmt: skip


def euler(scene, u, v, h, steps):
    """Make the same steps by Newton's method on dense matrices, in displacements: an independent reference."""
    b, e_d = oracle.kinematics(scene)  # displacements without the prescribed ones, whose elongations are e_d
    b, free = b.toarray(), ~scene.fixed.ravel()
    m = np.repeat(scene.mass, scene.dim)
    u, v, f = u.ravel().copy(), v.ravel().copy(), scene.load.ravel()
    low = np.where(scene.law == Law.COMPRESSION_ONLY, -np.inf, 0.0)
    high = np.where(scene.law == Law.CABLE, np.inf, 0.0)
    low[scene.law == Law.BAR], high[scene.law == Law.BAR] = -np.inf, np.inf
    for _ in range(steps):
        ahead, new = u + h * v, u + h * v
        for _ in range(100):
            x = b @ new + e_d + scene.initial_elongation
            taut = (x > low) & (x < high)
            r = m / h**2 * (new - ahead) + b.T @ (scene.stiffness * taut * x) - f
            K = np.diag(m / h**2) + b.T @ ((scene.stiffness * taut)[:, None] * b)
            change = np.zeros_like(u)
            change[free] = np.linalg.solve(K[np.ix_(free, free)], -r[free])
            new = new + change
            if np.abs(change).max() <= 1e-14 * max(np.abs(new).max(), 1e-300):
                break
        v = np.where(free, (new - u) / h, 0.0)
        u = new
    return u.reshape(scene.nodes.shape) + scene.prescribed, v.reshape(scene.nodes.shape)


EVENTS = ("LatinSetUp", "LatinSubdomains", "LatinInterface", "LatinMacro", "MatCholFctrNum", "MatCholFctrSym")


def counts():
    """How often each event of a set-up has happened."""
    return [PETSc.Log.Event(name).getPerfInfo()["count"] for name in EVENTS]


def message(call, *arguments):
    with pytest.raises((PETSc.Error, ValueError)) as caught:
        call(*arguments)
    return latinpc.error_message(caught.value)
