"""SNES latin ended by Newton's method: the same solution to more digits, with the operators that are there."""

from dataclasses import replace

import numpy as np
import oracle
import pytest
from petsc4py import PETSc
from support import chain, far, grid, irregular, latin, lattice, network, on_rails, settled, solve, unbalance

import latinpc
from latinpc.scenes import Law

POLISH = {"polish": True, "stol": 1e-9, "max_it": 1000}


def bars():
    """Make a structure where no link becomes slack."""
    return grid("truss")


@pytest.mark.parametrize("variant", ["none", "macro", "corner"])
@pytest.mark.parametrize("make", [grid, irregular, network, lattice, bars, chain])
def test_ends_where_newton_ends(make, variant):
    """The estimate of the error is safe: below the tolerance, the displacements are as near to Newton's."""
    scene = make()
    result = solve(scene, variant=variant, **POLISH)
    assert result.reason > 0
    assert far(result.u, oracle.newton(scene)) < 1e-8
    assert unbalance(scene, result.u) < 1e-6


@pytest.mark.parametrize("change", [settled, on_rails])
def test_prescribed_displacements(change):
    """Supports that move, and nodes held in some directions only."""
    scene = change(irregular())
    result = solve(scene, **POLISH)
    assert result.reason > 0
    assert far(result.u, oracle.newton(scene)) < 1e-8


def test_fewer_linear_stages_on_irregular_partitions():
    """A cheap search direction on a partition that cuts through modules, to 1e-10; the stages of CG are counted."""
    scene = irregular(modules=16, parts=16)
    plain, polished = (solve(scene, stol=1e-10, max_it=2000, polish=on, direction="diagonal") for on in (False, True))
    assert polished.reason > 0
    assert polished.iterations < 0.9 * plain.iterations


def test_linear_structures_take_one_solve():
    """Without a link that can become slack one Newton step reaches the tolerance."""
    with latin(bars(), **POLISH) as run:
        run.snes.setFromOptions()
        run.snes.solve(None, run.links.create_vec())
        assert run.snes.getConvergedReason() > 0
        stages = run.snes.getLinearSolveIterations()
        assert 0 < stages < 25
        assert run.snes.getIterationNumber() == stages + len(latinpc.history(run.snes)["indicator"])


def test_a_cable_at_its_threshold():
    """A cable that is neither taut nor slack: zero strain in the solution, both tangents are right."""
    scene = chain(law=Law.BAR)
    u = oracle.newton(scene)
    b, e_d = oracle.kinematics(scene)
    strain = b @ np.where(scene.fixed, 0.0, u).ravel() + e_d
    law, prestrain, load = scene.law.copy(), scene.prestrain.copy(), scene.load.copy()
    law[7], prestrain[7] = Law.CABLE, -strain[7]
    tension = scene.stiffness[7] * (strain[7] + scene.prestrain[7])
    load[scene.links[7]] += np.array([[-tension], [tension]]) * np.array([[-1.0], [1.0]]) * [[-1.0], [-1.0]]
    degenerate = replace(scene, law=law, prestrain=prestrain, load=load)
    result = solve(degenerate, **POLISH)
    assert result.reason > 0
    assert far(result.u, oracle.newton(degenerate)) < 1e-8


def test_extra_load_of_one_solve():
    """F(x) = b reaches Newton's method too."""
    scene = network()
    extra = np.where(scene.fixed, 0.0, np.random.default_rng(0).normal(size=scene.nodes.shape))
    with latin(scene, **POLISH) as run:
        u, b = run.links.create_vec(), run.links.create_vec()
        run.links.set_displacements(extra, b)
        run.snes.solve(b, u)
        assert far(run.links.displacements(u), oracle.newton(replace(scene, load=scene.load + extra))) < 1e-8


@pytest.mark.parametrize("stop", ["residual", "reference"])
def test_other_stops(stop):
    """The nodal unbalance, or the error against a reference."""
    scene = irregular()
    reference = oracle.newton(scene)
    tolerance = {"residual": {"rtol": 1e-9}, "reference": {"stol": 1e-9}}[stop]
    result = solve(scene, _reference=reference, polish=True, stop=stop, max_it=1000, **tolerance)
    assert result.reason > 0
    assert far(result.u, reference) < 1e-7


def test_iteration_goes_on_where_newton_fails():
    """A polish that may take no step leaves the work to the iteration, and the solution is the same."""
    scene = irregular()
    result = solve(scene, polish_snes_max_it=1, polish_ksp_rtol=0.9, **POLISH)
    assert result.reason > 0
    assert far(result.u, oracle.newton(scene)) < 1e-7


def test_another_preconditioner():
    """Options reach the inner objects: a direct solver in place of ours, then a matrix is assembled."""
    scene = irregular()
    result = solve(scene, polish_ksp_type="preonly", polish_pc_type="cholesky", **POLISH)
    assert result.reason > 0
    assert far(result.u, oracle.newton(scene)) < 1e-8


def test_new_load_and_new_prestrain():
    """The same object again, after a new load and after a new prestrain: nothing is built again."""
    scene = irregular()
    with latin(scene, **POLISH) as run:
        u = run.links.create_vec()
        run.snes.solve(None, u)
        for now in (replace(scene, load=0.5 * scene.load), replace(scene, prestrain=0.8 * scene.prestrain)):
            run.links.set_load(now.load)
            run.links.set_prestrain(now.prestrain)
            run.snes.solve(None, u)
            assert run.snes.getConvergedReason() > 0
            assert far(run.links.displacements(u), oracle.newton(now)) < 1e-8


def test_misuse():
    """A start that means nothing is refused with the name of the option."""
    with pytest.raises(PETSc.Error) as caught:
        solve(grid(), polish=True, polish_start=0.0)
    assert "-snes_latin_polish_start" in latinpc.error_message(caught.value)


PROGRAM = """
import sys
import numpy as np
import petsc4py
petsc4py.init(sys.argv)
import latinpc
from latinpc.scenes import make
scene = make("tensegrity-grid", modules=8)
links = latinpc.Links.from_scene(scene)
snes = links.create_snes()
snes.setFromOptions()
u = links.create_vec()
snes.solve(None, u)
assert snes.getConvergedReason() > 0
found = links.displacements(u)
if links.comm.rank == 0:
    np.save(sys.argv[1], found)
"""


def test_two_ranks(mpirun, tmp_path):
    """The number of ranks changes nothing but rounding."""
    found = []
    for ranks in (1, 2):
        path = tmp_path / f"u{ranks}.npy"
        mpirun(ranks, PROGRAM, path, "-snes_latin_polish", "-snes_stol", "1e-11")
        found.append(np.load(path))
    assert far(found[0], found[1]) < 1e-9
