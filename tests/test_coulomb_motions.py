"""Grains with friction in motion: balance with inertia, gaps, cones, and friction against the slip."""

from dataclasses import replace

import numpy as np
import pytest
from motions import Motion
from petsc4py import PETSc

from latinpc.bench.extremes.conditions import missed
from latinpc.laws import Law
from latinpc.scenes import make

pytestmark = pytest.mark.skipif(np.finfo(PETSc.RealType).eps > 1e-10, reason="the tolerances are of double precision")


def shaken(shake=0.1, length=0.01, **options):
    """Make a packing of grains of unit mass, with random velocities, and its motion."""
    scene = make("packing", law="friction", **options)
    velocity = np.where(scene.fixed, 0.0, np.random.default_rng(0).normal(0.0, shake, scene.nodes.shape))
    return Motion(replace(scene, mass=np.ones(len(scene.nodes)), velocity=velocity), length)


def stretched(scene, u):
    """Return the elongations of links by displacements u."""
    return ((u[scene.links[:, 1]] - u[scene.links[:, 0]]) * scene.directions).sum(axis=1)


def step_missed(motion):
    """Make a step; return by how much it misses its conditions, relative to the largest forces and displacements.

    They are those of a structure at rest whose gaps are those at its start, under loads less inertia.
    """
    scene, u, v, start = motion.scene, motion.u.copy(), motion.v.copy(), motion.ts.getTime()
    motion.step()
    h = motion.ts.getTime() - start
    flight = h * np.abs(v + h * scene.load / scene.mass[:, None])[~scene.fixed].max()
    gaps = scene.initial_elongation + stretched(scene, u)
    gaps[(scene.law == Law.TANGENT) | (gaps <= 1e-4 * flight)] = 0.0
    inertia = scene.mass[:, None] * (motion.v - v) / h
    begun = replace(
        scene, load=scene.load - inertia, initial_elongation=gaps, mass=None, velocity=None, subdomain=None
    )  # fmt: skip
    return missed(begun, motion.u - u, motion.tensions)


@pytest.mark.parametrize(
    ("steps", "options"),
    [
        (10, {"side": 24, "friction": 0.6}),
        (8, {"side": 8, "dim": 3, "friction": 0.9}),
        (6, {"side": 24, "friction": 0.001}),
    ],
    ids=["discs", "spheres", "little friction"],
)
def test_each_step_is_found(steps, options):
    """With much friction the path to a step may turn back; contacts with little force and friction slip as well."""
    motion = shaken(**options)
    assert max(step_missed(motion) for _ in range(steps)) < 1e-4


def test_large_packings():
    """In motions the interior-point method has no limit of size. The iteration alone takes 4,000 stages here."""
    motion = shaken(side=86, length=0.3, shake=0.0)
    assert len(motion.scene.links) > 40_000
    assert step_missed(motion) < 1e-4
    assert motion.iterations < 400
