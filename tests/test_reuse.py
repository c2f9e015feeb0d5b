"""What a second solve on the same object builds again: nothing, unless the structure itself has changed."""

from dataclasses import replace

import numpy as np
import oracle
import pytest
from conftest import ROOT
from petsc4py import PETSc
from support import far, grid, irregular, latin, logged, settled

from latinpc.scenes import make

EVENTS = ("LatinSetUp", "LatinSubdomains", "LatinInterface", "LatinMacro", "MatCholFctrNum", "MatCholFctrSym")
WARM = {"cold": {}, "warm": {"warm_start": "last"}, "extrapolated": {"warm_start": "extrapolate"}}


def counts():
    """How often each event of a set-up has happened; LatinMacro and its like happen in no other place."""
    return [PETSc.Log.Event(name).getPerfInfo()["count"] for name in EVENTS]


@pytest.fixture(autouse=True)
def log():
    with logged():
        yield


@pytest.mark.parametrize(
    ("scene", "stop"),
    [
        (grid, {"stol": 1e-9}),
        (irregular, {"stol": 1e-9}),
        (lambda: make("tensegrity-grid", modules=20), {"stop": "error", "error": 1e-8}),
        (lambda: replace(make("network", nodes=1200), subdomain=None), {"stop": "error", "error": 1e-8}),
    ],
)
def test_new_loads_and_initial_elongations_build_nothing(scene, stop):
    """A second solve, another load, another initial_elongation, an increment: no set-up, no factorisation.

    Small structures prove an error with operators of their tangent stiffness, which are another one's at other loads.
    """
    scene = scene()
    with latin(scene, max_it=1000, **stop) as run:
        before = counts()
        u = run.structure.create_vec()
        run.snes.solve(None, u)
        built = counts()
        assert all(b > a for a, b in zip(before, built))
        for load, initial_elongation in ((1, 1), (0.5, 1), (0.6, 1), (0.6, 0.8)):
            run.structure.set_load(load * scene.load)
            run.structure.set_initial_elongation(initial_elongation * scene.initial_elongation)
            run.snes.solve(None, u)
            assert run.snes.getConvergedReason() > 0
            assert counts() == built


def ramp(scene, how, steps=8):
    """Iterations of each step of a load that grows, and the last displacements."""
    with latin(scene, stol=1e-6, max_it=1000, **WARM[how]) as run:
        u, iterations = run.structure.create_vec(), []
        for step in range(steps):
            run.structure.set_load((0.5 + 0.5 * step / (steps - 1)) * scene.load)
            if how == "cold":
                u.zeroEntries()
            run.snes.solve(None, u)
            assert run.snes.getConvergedReason() > 0
            iterations.append(run.snes.getIterationNumber())
        return iterations, run.structure.displacements(u)


@pytest.mark.parametrize("make", [grid, irregular])
def test_a_warm_start_saves_iterations(make):
    """Each way to start ends in the same place, and the nearer start takes fewer iterations."""
    scene = make()
    found = {how: ramp(scene, how) for how in WARM}
    exact = oracle.newton(scene)
    for how, (iterations, u) in found.items():
        assert far(u, exact) < 1e-4, how
        assert len(iterations) == 8
    cold, warm, extrapolated = (sum(found[how][0][2:]) for how in ("cold", "warm", "extrapolated"))
    assert warm < cold
    assert extrapolated <= warm


@pytest.mark.parametrize("how", WARM)
@pytest.mark.parametrize("variant", ["none", "macro", "corner", "published", "primal"])
def test_settlements_build_nothing_and_are_those_of_a_new_structure(variant, how):
    """Displacements prescribed after a solve, twice, and back to none; each as a new structure has them."""
    scene = irregular()
    moves = [settled(scene, 1e-3, seed=1), settled(scene, 2e-3, seed=2), scene]
    with latin(scene, variant=variant, stol=1e-10, max_it=3000, newton="never", **WARM[how]) as run:
        u = run.structure.create_vec()
        run.snes.solve(None, u)
        built = counts()
        for moved in moves:
            run.structure.set_prescribed(moved.prescribed)
            assert (run.structure.prescribed == moved.prescribed).all()
            run.snes.solve(None, u)
            assert run.snes.getConvergedReason() > 0
            assert counts() == built
            assert far(run.structure.displacements(u), oracle.newton(moved)) < 1e-6


@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_settlements_on_several_ranks_and_by_newton(ranks, mpirun):
    script = """
import sys
sys.path.insert(0, "TESTS")
import oracle
from petsc4py import PETSc
from support import chain, default_options, far, irregular, settled
import latinpc

for scene in (irregular(), chain()):
    for kind in ("latin", "newtonls"):
        with default_options({"snes_type": kind, "pc_type": "redundant", "snes_latin_error": 1e-8, "snes_rtol": 1e-12}):
            structure = latinpc.Structure.from_scene(scene)
            snes, u = structure.create_snes(), structure.create_vec()
            snes.setFromOptions()
            snes.solve(None, u)
            moved = settled(scene, 1e-4, seed=3)
            structure.set_prescribed(moved.prescribed)
            snes.solve(None, u)
            assert snes.getConvergedReason() > 0
            assert far(structure.displacements(u), oracle.newton(moved)) < 1e-6, kind
"""
    mpirun(ranks, script.replace("TESTS", str(ROOT / "tests")))


def test_wrong_settlements_are_refused():
    scene = grid()
    with latin(scene) as run:
        with pytest.raises(ValueError, match="prescribed displacement in a direction that is not fixed"):
            run.structure.set_prescribed(np.full(scene.nodes.shape, 1e-3))
        with pytest.raises(ValueError, match="prescribed that is not finite"):
            run.structure.set_prescribed(np.where(scene.fixed, np.nan, 0.0))
