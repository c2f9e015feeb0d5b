"""SNES latin as PETSc users know a SNES: reasons, tolerances, monitors, views, second solves, other types."""

import re
from dataclasses import replace

import numpy as np
import oracle
import pytest
from conftest import ROOT
from petsc4py import PETSc
from support import PLAIN, VARIANTS, far, grid, irregular, latin, lattice, network, settled, solve, unbalance

import latinpc
from latinpc.runs.options import default_options
from latinpc.scenes import Law, Scene

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
    result = solve(scene, max_it=7, stol=1e-12, **PLAIN)
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
    for text in ("local solver", "coarse solver", "cholmod", "mumps", "type: anderson", "AlartDureisseix2008"):
        assert text in out
    for event in ("LatinSetUp", "LatinLinear", "LatinCoarse", "LatinLocal", "LatinInterface", "LatinMacro"):
        assert event in out
    assert "There are no unused options" in out


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


# ---- second solves ---------------------------------------------------------------------------
@pytest.mark.parametrize("make", [grid, irregular])
def test_other_loads_and_initial_elongations_need_no_new_set_up(make):
    """New load, new initial_elongation, and back: each answer right, the operators the same objects throughout."""
    scene = make()
    cases = [
        scene,
        replace(scene, load=0.5 * scene.load),
        replace(scene, initial_elongation=1.3 * scene.initial_elongation),
        scene,
    ]
    with latin(scene, stol=1e-10, max_it=2000) as run:
        run.snes.setUp()
        u, solvers = run.structure.create_vec(), [latinpc.local_ksp(run.snes), latinpc.coarse_ksp(run.snes)]
        states = [ksp.getOperators()[0].stateGet() for ksp in solvers]
        for case in cases:
            run.structure.set_load(case.load)
            run.structure.set_initial_elongation(case.initial_elongation)
            run.snes.solve(None, u)
            assert run.snes.getConvergedReason() > 0
            assert far(run.structure.displacements(u), oracle.newton(case)) < 1e-7
        assert solvers == [latinpc.local_ksp(run.snes), latinpc.coarse_ksp(run.snes)]
        assert states == [ksp.getOperators()[0].stateGet() for ksp in solvers]


@pytest.mark.parametrize("variant", ["macro", "corner"])
@pytest.mark.parametrize("make", [grid, irregular, network, lattice])
def test_a_solution_is_its_own_initial_guess(make, variant):
    """From the solution one linear stage, which changes nothing; from near it fewer than from the prestressed state."""
    scene = make()
    exact = oracle.newton(scene)
    with latin(scene, variant=variant) as run:
        u, counts = run.structure.create_vec(), []
        for guess in (0.0 * exact, 1.001 * exact, exact):
            run.structure.set_displacements(guess, u)
            run.snes.solve(None, u)
            assert run.snes.getConvergedReason() > 0
            counts.append(run.snes.getIterationNumber())
        assert counts[2] == 1
        assert counts[1] < counts[0]
        assert latinpc.history(run.snes)["indicator"][0] < 1e-9
        assert far(run.structure.displacements(u), exact) < 1e-9


def test_a_guess_that_is_far_off_does_not_matter():
    """It costs iterations, and the solution is the same; zero is the prestressed state, whatever was solved before."""
    with latin(grid(), stol=1e-8) as run:
        u = run.structure.create_vec()
        run.snes.solve(None, u)
        first, count = u.copy(), run.snes.getIterationNumber()
        u.scale(1e3)
        run.snes.solve(None, u)
        assert run.snes.getConvergedReason() > 0
        assert (u - first).norm() <= 1e-6 * first.norm()
        u.zeroEntries()
        run.snes.solve(None, u)
        assert run.snes.getIterationNumber() == count
        assert np.array_equal(u, first)


def test_a_guess_with_settled_supports_more_load_and_the_residual_stop():
    """The guess is of the free displacements, loads are those of the solve, and rtol is relative to its residual."""
    scene = settled(network())
    extra = np.where(scene.fixed, 0.0, np.random.default_rng(0).normal(size=scene.nodes.shape))
    with latin(scene, stop="residual", rtol=1e-6, atol=1e-7) as run:
        u, b, r = (run.structure.create_vec() for _ in range(3))
        run.structure.set_displacements(extra, b)
        run.structure.set_displacements(0.9 * oracle.newton(replace(scene, load=scene.load + extra)), u)
        run.structure.residual(u, r)
        before = (r - b).norm()
        run.snes.solve(b, u)
        assert run.snes.getConvergedReason() == REASON.CONVERGED_FNORM_RELATIVE
        run.structure.residual(u, r)
        assert (r - b).norm() <= 1e-6 * before
        run.snes.setTolerances(atol=2 * run.snes.getFunctionNorm())
        run.snes.solve(b, u)
        assert run.snes.getConvergedReason() == REASON.CONVERGED_FNORM_ABS
        assert run.snes.getIterationNumber() == 0


def test_as_a_nonlinear_preconditioner():
    """-npc_snes_type latin: each goes on from the current displacements, and improves them."""
    scene = grid()
    structure = latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF)
    options = {"snes_type": "ngmres", "npc_snes_type": "latin", "npc_snes_max_it": 3, "snes_rtol": 1e-8}
    with default_options(options | {"snes_max_it": 60, "snes_npc_side": "right"}):
        snes = structure.create_snes()
        snes.setType("ngmres")
        snes.setFromOptions()
    norms = []
    snes.setMonitor(lambda _, iteration, norm: norms.append(norm))
    u = structure.create_vec()
    snes.solve(None, u)
    assert snes.getConvergedReason() > 0
    assert norms[-1] <= 1e-8 * norms[0]
    assert snes.getNPC().getType() == "latin"
    assert far(structure.displacements(u), oracle.newton(scene)) < 1e-6


def test_a_prefix_reaches_all_inner_solvers():
    """setOptionsPrefix() before or after options were read: outer, Newton, local and coarse solvers, digits."""
    structure = latinpc.Structure.from_scene(grid(), comm=PETSc.COMM_SELF)
    inner = {"outer_snes_type": "ngmres", "stop": "error", "newton_ksp_type": "minres"}
    for late in (False, True):
        snes = PETSc.SNES().create(PETSc.COMM_SELF)
        if late:
            snes.setType("latin")
            snes.setFromOptions()
        snes.setOptionsPrefix("a_")
        structure.attach(snes)
        latins = {f"a_snes_latin_{key}": value for key, value in inner.items()}
        ksps = {"a_snes_latin_local_ksp_type": "gmres", "a_snes_latin_coarse_ksp_type": "fgmres"}
        with default_options({"a_snes_type": "latin", "a_snes_stol": 1e-9} | latins | ksps):
            snes.setFromOptions()
            snes.solve(None, structure.create_vec())
        assert snes.getConvergedReason() > 0
        assert snes.getLinearSolveIterations() > 0
        assert latinpc.outer_snes(snes).getType() == "ngmres"
        assert latinpc.local_ksp(snes).getType() == "gmres"
        assert latinpc.coarse_ksp(snes).getType() == "fgmres"
        with default_options({"a_latin_digits_ksp_max_it": 1}), pytest.raises(PETSc.Error, match="ksp_monitor"):
            latinpc.digits(snes)


def test_a_type_of_the_inner_snes_set_in_code():
    """As by the option, defaults included, and it stays when the structure is set up anew."""
    by_option = solve(grid(), **PLAIN)
    with latin(grid()) as run:
        outer = latinpc.outer_snes(run.snes)
        outer.setType("nrichardson")
        for load in (1.0, 2.0):
            run.structure.set_load(load * grid().load)
            u = run.structure.create_vec()
            run.snes.solve(None, u)
            assert latinpc.outer_snes(run.snes) == outer and outer.getType() == "nrichardson"
            if load == 1.0:
                assert run.snes.getIterationNumber() == by_option.iterations
                assert np.array_equal(run.structure.displacements(u), by_option.u)
            with default_options({"snes_latin_variant": "macro"}):  # all is built anew
                run.snes.setFromOptions()


def test_setters_do_what_options_do():
    """Stop, error and Newton's method in code give the bits that the options give."""
    scene = irregular()
    for options, setters in (
        ({"stop": "energy", "error": 1e-5}, [("stop", "energy"), ("error", 1e-5)]),
        ({"stop": "residual"}, [("stop", "residual")]),
        ({"newton": "never", "stop": "error"}, [("newton", "never"), ("stop", "error")]),
    ):
        by_option = solve(scene, **options)
        with latin(scene, **({"stol": 1e-9} if "stol" in options else {})) as run:
            for name, *values in setters:
                getattr(latinpc, f"set_{name}")(run.snes, *values)
            u = run.structure.create_vec()
            run.snes.solve(None, u)
            assert run.snes.getIterationNumber() == by_option.iterations
            assert np.array_equal(run.structure.displacements(u), by_option.u)


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


def test_warm_start_uses_the_state_of_the_last_solve():
    """By option a solve goes on from the state of the one before: after a small change of load it is shorter."""
    scene = grid()
    with latin(scene, stol=1e-8, warm_start="last") as run:
        u = run.structure.create_vec()
        run.snes.solve(None, u)
        cold = run.snes.getIterationNumber()
        run.snes.solve(None, u)
        assert run.snes.getIterationNumber() <= 2
        run.structure.set_load(1.001 * scene.load)
        run.snes.solve(None, u)
        assert run.snes.getIterationNumber() < cold
        assert far(run.structure.displacements(u), oracle.newton(replace(scene, load=1.001 * scene.load))) < 1e-6


def test_right_hand_side_is_more_load():
    """F(x) = b: the vector of a solve is added to the loads of the structure, for that solve only."""
    scene = settled(network())
    extra = np.where(scene.fixed, 0.0, np.random.default_rng(0).normal(size=scene.nodes.shape))
    with latin(scene, stol=1e-10, max_it=2000) as run:
        u, b = run.structure.create_vec(), run.structure.create_vec()
        run.structure.set_displacements(extra, b)
        for rhs, load in ((b, scene.load + extra), (None, scene.load), (2 * b, scene.load + 2 * extra)):
            run.snes.solve(rhs, u)
            assert run.snes.getConvergedReason() > 0
            assert far(run.structure.displacements(u), oracle.newton(replace(scene, load=load))) < 1e-7


def test_options_read_again_rebuild():
    """Another variant or direction after a solve is what the next solve uses."""
    scene = grid()
    with latin(scene, max_it=4, stol=0, **PLAIN) as run:
        u = run.structure.create_vec()
        run.snes.solve(None, u)
        for options in (
            {"variant": "macro"},
            {"variant": "published"},
            {"direction": "scalar"},
            {"direction": "scalar", "direction_value": 1e6},
        ):
            with default_options({f"snes_latin_{key}": value for key, value in options.items()}):
                run.snes.setFromOptions()
                u.zeroEntries()
                run.snes.solve(None, u)
            assert far(run.structure.displacements(u), solve(scene, max_it=4, stol=0, **options, **PLAIN).u) < 1e-9
            latinpc.set_variant(run.snes, "corner")
            latinpc.set_direction(run.snes, "schur")


def test_reset_builds_anew():
    """After SNESReset() the same object solves again, to the same bits."""
    with latin(irregular()) as run:
        u, v = run.structure.create_vec(), run.structure.create_vec()
        run.snes.solve(None, u)
        run.snes.reset()
        run.structure.attach(run.snes)
        run.snes.solve(None, v)
        assert (u - v).norm() == 0.0


def test_two_solvers_share_a_structure():
    """Two solvers of different variants on one structure do not disturb each other."""
    structure = latinpc.Structure.from_scene(grid(), comm=PETSc.COMM_SELF)
    solvers, found = {"macro": structure.create_snes(), "none": structure.create_snes()}, {}
    for variant, snes in solvers.items():
        with default_options({"snes_latin_variant": variant, "snes_stol": 1e-9}):
            snes.setFromOptions()
            snes.setUp()
    for variant in ("macro", "none", "macro"):
        found[variant] = structure.create_vec()
        solvers[variant].solve(None, found[variant])
    assert [latinpc.statistics(snes)["weak_dofs"] for snes in solvers.values()] == [24, 0]
    assert (found["macro"] - found["none"]).norm() < 1e-6 * found["none"].norm()


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
