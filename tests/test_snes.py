"""SNES latin as PETSc users know a SNES: reasons, tolerances, monitors, views, other types."""

import re
from dataclasses import replace

import numpy as np
import oracle
import pytest
from conftest import ROOT
from petsc4py import PETSc
from support import PLAIN, VARIANTS, far, grid, irregular, latin, lattice, network, solve, unbalance

import latinpc
from latinpc import _latin
from latinpc.options import default_options
from latinpc.scenes import Law, Scene, make

REASON = PETSc.SNES.ConvergedReason


def hung(force):
    """A node under two cables."""
    return Scene(
        name="hung",
        nodes=[[-1.0, 1.0], [1.0, 1.0], [0.0, 0.0]],
        links=[[0, 2], [1, 2]],
        law=[1, 1],
        stiffness=[1e3, 1e3],
        initial_elongation=[1e-3, 1e-3],
        fixed=[[1, 1], [1, 1], [0, 0]],
        load=[[0, 0], [0, 0], [0, force]],
        subdomain=[0, 1],
    )


# ---- reasons ---------------------------------------------------------------------------------
@pytest.mark.parametrize("stop", ["indicator", "reference"])
def test_stop_on_the_step(stop):
    """-snes_stol bounds the indicator, or the error against a reference; the reason is that of a small step."""
    scene = grid()
    result = solve(scene, _reference=oracle.newton(scene), stop=stop, stol=1e-4)
    assert result.reason == REASON.CONVERGED_SNORM_RELATIVE
    watched = result.history.indicator if stop == "indicator" else result.history.error_l2
    assert watched[-1] <= 1e-4 < watched[-2]
    assert len(watched) == result.iterations


def residual_norms(scene, **options):
    """Norms of the unbalance before and after a solve, and the reason."""
    with latin(scene, stop="residual", **options) as run:
        u, r = run.structure.create_vec(), run.structure.create_vec()
        run.structure.residual(u, r)
        before = r.norm()
        run.snes.solve(None, u)
        run.structure.residual(u, r)
        return before, r.norm(), run.snes.getConvergedReason(), run.snes.getFunctionNorm()


@pytest.mark.parametrize("make", [grid, network])
def test_stop_on_the_residual(make):
    """-snes_rtol and -snes_atol bound the true unbalance of the nodes, and each has its own reason."""
    before, after, reason, told = residual_norms(make(), rtol=1e-5, atol=1e-50)
    assert reason == REASON.CONVERGED_FNORM_RELATIVE
    assert told == pytest.approx(after, rel=1e-6)
    assert after <= 1e-5 * before
    before, after, reason, told = residual_norms(make(), rtol=1e-50, atol=1e-4 * before)
    assert reason == REASON.CONVERGED_FNORM_ABS
    assert after <= 1e-4 * before


def test_too_few_iterations_keep_the_last_iterate():
    """-snes_max_it ends with its reason, not with an exception, and the vector holds the last iterate."""
    scene = grid()
    result = solve(scene, max_it=7, stol=1e-12, variant="corner", **PLAIN)
    assert result.reason == REASON.DIVERGED_MAX_IT
    assert result.iterations == 7
    assert far(result.u, oracle.latin_history(scene, 7).iterates[-1]) < 1e-10


@pytest.mark.parametrize("force", [0.1, 1.0, 3.0, 5.0, 10.0, 100.0, 1e4])
@pytest.mark.parametrize("variant", VARIANTS)
def test_structure_without_equilibrium_never_converges(variant, force):
    """Pushed up, a node under two cables flies away: divergence or too many iterations, never success."""
    for options in ({}, PLAIN):
        for stol in (1e-3, 1e-5):
            result = solve(hung(force), variant=variant, stol=stol, max_it=700, **options)
            assert result.reason in (REASON.DIVERGED_DTOL, REASON.DIVERGED_MAX_IT)
    down = solve(hung(-force), variant=variant, stol=1e-9)
    assert down.reason > 0
    assert unbalance(hung(-force), down.u) < 1e-7


def test_divergence_tolerance():
    """-snes_divergence_tolerance ends what grows by that factor, with its own reason."""
    result = solve(hung(5.0), divergence_tolerance=10.0, max_it=1000, stol=1e-9)
    assert result.reason == REASON.DIVERGED_DTOL
    assert result.iterations < 1000


@pytest.mark.parametrize("stop", ["indicator", "residual"])
@pytest.mark.parametrize("make", [grid, irregular, lattice])
def test_unloaded_structure_is_at_rest(make, stop):
    """A self-stress in balance moves nothing; the solver finds zero and says that it has converged."""
    scene = make(load=0.0)
    result = solve(scene, stop=stop, max_it=300)
    assert result.reason > 0
    assert abs(result.u).max() < 1e-12
    assert result.tensions == pytest.approx(scene.stiffness * scene.initial_elongation, rel=1e-8, abs=1e-8)


# ---- what it prints --------------------------------------------------------------------------
PROGRAM = """
import sys
import petsc4py
petsc4py.init(sys.argv)
import latinpc
from latinpc.scenes import make

structure = latinpc.Structure.from_scene(make("tensegrity-grid", modules=6, subdomains=9))
snes = structure.create_snes()
snes.setFromOptions()
u = structure.create_vec()
snes.solve(None, u)
"""


def test_what_it_prints(mpirun):
    """Monitors, reason, view and citation by PETSc's options; every option given is used."""
    words = "-snes_latin_monitor -snes_monitor -snes_converged_reason -snes_view -citations -options_left -log_view"
    more = ["-snes_latin_variant", "macro", "-snes_latin_direction", "scalar", "-snes_stol", "1e-3"]
    out = mpirun(1, PROGRAM, *words.split(), *more).stdout
    ours = [line for line in out.splitlines() if "LATIN indicator" in line]
    assert [int(line.split()[0]) for line in ours] == list(range(1, len(ours) + 1))
    indicators = [float(line.split()[-1]) for line in ours]
    assert indicators[-1] <= 1e-3 < indicators[-2]
    assert sum("SNES Function norm" in line for line in out.splitlines()) == len(ours) + 1  # that of the start
    assert f"CONVERGED_SNORM_RELATIVE iterations {len(ours)}" in out
    for text in (
        "variant macro",
        "search direction: scalar",
        "subdomains: 9",
        "12 strong, 8 weak",
        "type: nrichardson",
    ):
        assert (text in out) == (text != "type: nrichardson")
    for text in ("local solver", "coarse solver", "cholmod", "mumps", "SNES of type anderson", "AlartDureisseix2008"):
        assert text in out
    for event in ("LatinSetUp", "LatinLinear", "LatinCoarse", "LatinLocal", "LatinInterface", "LatinMacro"):
        assert event in out
    assert "There are no unused options" in out


def test_defaults_of_the_manual_page_are_those_of_help(mpirun):
    """Each option of the page that has a default has the same one in -help."""
    page = (ROOT / "latinpc" / "src" / "snes" / "sneslatin.c").read_text()
    told = dict(re.findall(r"^[+.-] (-snes_\w+) <([^>]+)>", page[page.index("/*MC") :], re.MULTILINE))
    shown = mpirun(1, PROGRAM, "-help").stdout
    assert len(told) > 10
    for name, default in told.items():
        found = re.search(rf"{name}:? <(?:now )?([^ :>]+)", shown)
        assert found, name
        assert found[1].lower().rstrip(".") == default.lower(), name


def test_monitor_shows_what_is_computed(mpirun):
    """With the residual stop the residual of each iteration stands beside the indicator."""
    out = mpirun(1, PROGRAM, "-snes_latin_monitor", "-snes_latin_stop", "residual", "-snes_rtol", "1e-2").stdout
    lines = [line.split() for line in out.splitlines() if "LATIN indicator" in line]
    assert lines
    residuals = [float(line[line.index("residual") + 1]) for line in lines]
    assert residuals[-1] < residuals[0]


def test_history_and_monitors_have_the_norm_of_the_function():
    """PETSc's history and monitors get the unbalance of the displacements of each iteration, the start included."""
    with latin(grid(), stol=1e-3) as run:
        r, seen = run.structure.create_vec(), []

        def monitor(snes, iteration, norm):
            run.structure.residual(snes.getSolution(), r)
            seen.append((iteration, norm, r.norm(), snes.getFunctionNorm()))

        run.snes.setConvergenceHistory()
        run.snes.setMonitor(monitor)
        u = run.structure.create_vec()
        run.snes.solve(None, u)
        iterations, *norms = zip(*seen)
        assert list(iterations) == list(range(run.snes.getIterationNumber() + 1))
        assert norms[0] == pytest.approx(norms[1]) and norms[0] == pytest.approx(norms[2])
        assert run.snes.getConvergenceHistory()[0] == pytest.approx(norms[0])
        run.structure.residual(u, r)
        assert run.snes.getFunctionNorm() == pytest.approx(r.norm())


@pytest.mark.parametrize("name", ["net", "packing"])
def test_a_monitor_changes_nothing(name):
    """Nets and grains of rigid links, which Newton's method finishes from their last tensions: the same to the bit."""
    scene, ends = make(name, side=6), []
    for watched in (False, True):
        with latin(scene) as run:
            if watched:
                run.snes.setMonitor(lambda snes, iteration, norm: None)
            u = run.structure.create_vec()
            run.snes.solve(None, u)
            ends.append((run.snes.getIterationNumber(), run.snes.getLinearSolveIterations(), u.array.tolist()))
    assert ends[0][1] > 0
    assert ends[0] == ends[1]


def test_without_a_monitor_the_last_norm_is_that_of_the_function():
    with latin(grid(), stol=1e-3) as run:
        u, r = run.structure.create_vec(), run.structure.create_vec()
        run.snes.solve(None, u)
        run.structure.residual(u, r)
        assert run.snes.getFunctionNorm() == pytest.approx(r.norm())


def test_a_convergence_test_of_the_users_decides():
    """It gets the iteration, the norms of the solution, of its change and of the function, and a current solution."""
    with latin(grid(), stol=1e-14) as run:
        r, u, seen = run.structure.create_vec(), run.structure.create_vec(), []

        def test(snes, iteration, norms):
            now = snes.getSolution().copy()
            run.structure.residual(now, r)
            step = (now - seen[-1][2]).norm() if seen else 0.0
            seen.append((iteration, norms, now))
            assert norms == pytest.approx((now.norm(), step, r.norm()))
            return REASON.CONVERGED_FNORM_ABS if iteration == 5 else REASON.CONVERGED_ITERATING

        run.snes.setConvergenceTest(test)
        run.snes.solve(None, u)
        assert [iteration for iteration, *_ in seen] == list(range(6))
        assert run.snes.getConvergedReason() == REASON.CONVERGED_FNORM_ABS
        assert run.snes.getIterationNumber() == 5
        assert (u - seen[-1][2]).norm() == 0.0


def test_petscs_test_that_never_ends_a_solve():
    """-snes_convergence_test skip: all iterations are made."""
    with default_options({"snes_convergence_test": "skip"}), latin(grid(), stol=1e-2, max_it=40) as run:
        run.snes.solve(None, run.structure.create_vec())
        assert run.snes.getIterationNumber() == 40


# ---- the same object, other solvers ----------------------------------------------------------
NEWTON = {"snes_type": "newtonls", "snes_rtol": 1e-12, "snes_linesearch_type": "none"}
LINEAR = {
    "cholesky": {"ksp_type": "preonly", "pc_type": "cholesky"},
    "cg and jacobi": {"ksp_type": "cg", "pc_type": "jacobi", "ksp_rtol": 1e-12},
    "cg and latin": {"ksp_type": "cg", "pc_type": "latin", "ksp_rtol": 1e-12},
}


@pytest.mark.parametrize("linear", LINEAR)
@pytest.mark.parametrize("make", [grid, irregular, lattice])
def test_newton_solves_the_same_object(make, linear):
    """-snes_type newtonls with any preconditioner ends where latin does."""
    scene = make()
    structure = latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF)
    with default_options({**NEWTON, **LINEAR[linear]}):
        snes = structure.create_snes()
        snes.setFromOptions()
        assert snes.getType() == "newtonls"
        u = structure.create_vec()
        snes.solve(None, u)
    assert snes.getConvergedReason() > 0
    assert far(structure.displacements(u), solve(scene, stol=1e-10, max_it=2000).u) < 1e-7


def test_the_type_may_change_on_one_object():
    """The same SNES solves by latin, by Newton, and by latin again."""
    with latin(grid(), stol=1e-10) as run:
        found = []
        for kind in ("latin", "newtonls", "latin"):
            run.snes.setType(kind)
            run.snes.setFromOptions()  # a type brings tolerances of its own
            run.snes.getKSP().setType("preonly")
            run.snes.getKSP().getPC().setType("cholesky")
            u = run.structure.create_vec()
            run.snes.solve(None, u)
            assert run.snes.getConvergedReason() > 0
            found.append(u)
        assert all((u - found[0]).norm() < 1e-6 * found[0].norm() for u in found)


@pytest.mark.parametrize("pc", ["latin", "bddc"])
def test_matis(pc):
    """-dm_mat_type is: the unassembled matrix serves PETSc's own BDDC as well as ours."""
    scene = grid("truss")
    structure = latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF)
    with default_options(
        {"dm_mat_type": "is", "snes_type": "ksponly", "ksp_type": "cg", "pc_type": pc, "ksp_rtol": 1e-12}
    ):
        structure.dm.setFromOptions()
        snes = structure.create_snes()
        snes.setFromOptions()
        u = structure.create_vec()
        snes.solve(None, u)
    assert snes.getJacobian()[1].getType() == "is"
    assert snes.getConvergedReason() > 0
    assert far(structure.displacements(u), oracle.newton(scene)) < 1e-8


def test_bounds_are_refused():
    """Unilateral behaviour is in the laws of links; bounds on displacements are not taken in silence."""
    with latin(lattice()) as run:
        low, high = run.structure.create_vec(), run.structure.create_vec()
        high.set(1.0)
        run.snes.setVariableBounds(low, high)
        with pytest.raises(PETSc.Error) as caught:
            run.snes.solve(None, run.structure.create_vec())
        assert "does not take bounds" in latinpc.error_message(caught.value)


CHOICES = ("stop", "warm_start", "newton", "variant", "modes", "direction", "precision", "partitioner")


@pytest.mark.parametrize("choice", CHOICES)
def test_choices_that_do_not_exist_are_refused(choice):
    """As a C program may give them, by their number."""
    more = [0.0] if choice in ("modes", "direction") else []
    with latin(lattice()) as run:
        for number in (-1, 100):
            with pytest.raises(latinpc.LatinError, match=f"There is no choice {number}: take one of Latin"):
                getattr(_latin, f"set_{choice}")(run.snes, number, *more)


def test_stop_on_a_reference_needs_one():
    """The message says what is missing and how to give it."""
    with pytest.raises(PETSc.Error) as caught:
        solve(lattice(), stop="reference")
    assert "SNESLatinSetReference" in latinpc.error_message(caught.value)


def test_laws_matter():
    """The cables of the tests do go slack: taken for bars the structure would move otherwise."""
    scene = grid()
    bars = solve(replace(scene, law=np.full_like(scene.law, Law.BAR)), stol=1e-9).u
    assert far(bars, solve(scene, stol=1e-9).u) > 0.01
