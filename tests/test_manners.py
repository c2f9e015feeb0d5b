"""What an experienced user of PETSc meets: errors of all ranks, presets on several ranks, logged operations."""

import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT
from petsc4py import PETSc
from support import irregular, logged, solve

import latinpc
from latinpc.bench.extremes.drawn import draw
from latinpc.options import default_options
from latinpc.runs.motion import move
from latinpc.scenes import Scene, make

EVENTS = ("Direction", "Spectral", "Macro", "Linear", "Condense", "Estimate", "Coarse", "Local")
COMMAND = Path(sys.executable).parent / "latinpc"


def test_an_error_of_all_ranks_is_petscs_own_and_ends_at_once(mpirun, compile_c):
    """PETSc's traceback on the first rank; the others sleep in its handler, and none is taken for lost."""
    words = ("-dll_append", latinpc.get_library(), "-pc_type", "latin")
    result = mpirun(3, compile_c("plain_ksp.c"), *words, check=False)
    assert result.returncode
    assert "[0]PETSC ERROR: #1 Latin" in result.stderr
    assert "main()" in result.stderr
    assert "an error of one rank" not in result.stderr


@pytest.mark.parametrize("preset", sorted(path.name for path in (ROOT / "options").glob("*.opts")))
def test_presets_run_on_two_ranks(mpirun, preset):
    """No package of theirs is for one rank alone."""
    words = ("solve", "tensegrity-grid", "--modules", 8, "-options_file", ROOT / "options" / preset)
    result = mpirun(2, COMMAND, *words, check=False)
    assert result.returncode == 0, result.stdout + result.stderr
    assert "converged in" in result.stdout


def test_operations_of_all_events_are_logged():
    """Of those that calculate; a partition, lists of nodes and their exchange take none."""
    with logged():
        before = {name: PETSc.Log.Event("Latin" + name).getPerfInfo()["flops"] for name in EVENTS}
        found = solve(irregular(), variant="corner", modes_local=1e-2, stop="error", error=1e-4, newton="never")
        assert found.reason > 0
        after = {name: PETSc.Log.Event("Latin" + name).getPerfInfo()["flops"] for name in EVENTS}
    assert [name for name in EVENTS if not after[name] > before[name]] == []


# ---- what PETSc takes and does not look at -------------------------------------------------------
def held_chain(kernel):
    """KSP with PC latin on the matrix of springs in a row, both ends of which are held, with a null space."""
    n = 9
    map_ = PETSc.LGMap().create(np.arange(n, dtype=PETSc.IntType), comm=PETSc.COMM_SELF)
    a = PETSc.Mat().createIS([n, n], lgmapr=map_, lgmapc=map_, comm=PETSc.COMM_SELF)
    local = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    if kernel == "right":
        local[0, 0] = local[-1, -1] = 1.0
    k = PETSc.Mat().createDense([n, n], array=local, comm=PETSc.COMM_SELF)
    a.setISLocalMat(k.convert("aij"))
    a.assemble()
    if kernel == "vector":
        wrong = a.createVecRight()
        wrong.setArray(np.arange(n) + 1.0)
        wrong.normalize()
        a.setNullSpace(PETSc.NullSpace().create(vectors=[wrong], comm=PETSc.COMM_SELF))
    else:
        a.setNullSpace(PETSc.NullSpace().create(constant=True, comm=PETSc.COMM_SELF))
    ksp = PETSc.KSP().create(PETSc.COMM_SELF)
    ksp.setOperators(a)
    ksp.getPC().setType("latin")
    return ksp


def test_a_null_space_that_is_none_is_refused():
    held_chain("right").setUp()
    for kernel, said in (("constant", "The constant vector"), ("vector", "A vector")):
        with pytest.raises(PETSc.Error) as caught:
            held_chain(kernel).setUp()
        text = latinpc.error_message(caught.value)
        assert text.startswith(f"{said} of the null space of the matrix") and "MatSetNearNullSpace()" in text


def test_quasi_newton_takes_bars_alone():
    """There is no state to iterate on: one linear stage solves."""
    result = make("truss-grid", modules=4).solve(options={"snes_latin_outer_snes_type": "qn"})
    assert result.converged and result.largest_unbalance < 1e-6 * np.abs(result.structure.load).max()
    cables = make("tensegrity-grid", modules=4, subdomains=4)
    assert cables.solve(options={"snes_latin_outer_snes_type": "qn"}).converged


@pytest.mark.filterwarnings("ignore::latinpc.LatinWarning", "ignore::latinpc.ConvergenceWarning")
def test_the_local_solver_that_fails_is_named():
    """One iteration is not enough: the KSP of the SNES itself, which had been named, is not used."""
    once = {"snes_latin_local_ksp_type": "cg", "snes_latin_local_pc_type": "none", "snes_latin_local_ksp_max_it": 1}
    found = make("network", nodes=100).solve(options=once)
    assert "DIVERGED_LINEAR_SOLVE (of a subdomain, -snes_latin_local_)" in found.reason


@pytest.mark.parametrize(("family", "number"), [("statics", 36), ("statics", 133), ("statics", 134)])
def test_an_inner_solver_that_takes_no_step_hands_over(family, number):
    """Its line search finds nothing shorter: Newton's method goes on, as after a stall; it had been given up."""
    drawn = draw(11, number, family).scene
    found = drawn.solve(options={"snes_latin_outer_snes_type": "ncg"})
    assert found.converged
    assert np.linalg.norm(found.tensions - drawn.solve().tensions) <= 3e-4 * np.linalg.norm(found.tensions)


@pytest.mark.parametrize(
    "inner, kind",
    [("outer", kind) for kind in ("aspin", "vinewtonrsls", "vinewtonssls", "nasm", "patch", "ngs", "ms", "latin")]
    + [
        ("outer", "ksponly"),
        ("outer", "ksptransposeonly"),
        *(("newton", kind) for kind in ("aspin", "qn", "anderson")),
    ],
)
def test_inner_solvers_that_iterate_something_else_are_refused(inner, kind):
    """Some had ended in a segmentation fault of PETSc, ksponly in a claim with 14 % of the loads out of balance."""
    grid, option = make("tensegrity-grid", modules=3), f"snes_latin_{inner}_snes_type"
    with pytest.raises(latinpc.SolveError, match=rf"^-{option} {kind} .*: take (anderson|newtonls)"):
        grid.solve(options={option: kind, "snes_latin_error": 1e-9})


@pytest.mark.parametrize(
    "inner, kind",
    [("outer", kind) for kind in ("anderson", "ngmres", "qn", "ncg", "nrichardson", "newtonls", "newtontr", "fas")]
    + [("newton", kind) for kind in ("newtonls", "newtontr", "newtontrdc")],
)
def test_inner_solvers_that_iterate_find_the_solution(inner, kind):
    grid = make("tensegrity-grid", modules=4, subdomains=4)
    alike = {f"snes_latin_{inner}_snes_type": kind, "snes_latin_error": 1e-6}
    found, truth = grid.solve(options=alike), grid.solve(error=1e-9)
    assert found.converged and np.linalg.norm(found.tensions - truth.tensions) < 1e-5 * np.linalg.norm(truth.tensions)


@pytest.mark.parametrize("kind", ["basic", "dsp", "glee"])
def test_steps_are_not_chosen_by_errors_that_nobody_estimates(kind):
    with pytest.raises(PETSc.Error) as caught:
        move(make("impact-grid", modules=3), 2, 1e-3, options={"ts_adapt_type": kind})
    assert f"-ts_adapt_type {kind} needs an error estimate of steps" in str(caught.value)


def test_a_growing_energy_is_told():
    """The generalised alpha method of steps longer than the periods of a net; TS latin keeps its energy."""
    saddle = make("saddle")
    late = move(saddle, 100, 1e-2, mass=10.0, options={"ts_type": "alpha2", "snes_type": "newtonls"})
    assert any(re.match("the energy has grown from 91.7 J to .* by itself", text) for text in late.notices)
    for options in ({}, {"ts_type": "alpha2", "snes_type": "newtonls", "ts_dt": 1e-4}):
        assert move(saddle, 20, 1e-2, mass=10.0, options=options).notices == []


def test_a_motion_at_rest_has_no_energy_to_grow():
    """A chain in balance: rounding of 1e-22 J had grown."""
    scene = make("chain")
    still = move(replace(scene, mass=np.full(len(scene.nodes), 20.0)), 50, 2e-3)
    assert not still.notices


def test_velocities_of_nodes_without_mass_are_told():
    given = {"name": "thrown", "nodes": [[0.0], [1.0], [2.0], [3.0]], "links": [[0, 1], [1, 2], [2, 3]], "law": "bar"}
    given |= {"stiffness": 100.0, "fixed": [[1], [0], [0], [0]], "velocity": [[0.0], [3.0], [0.0], [1.0]]}
    told = "the initial velocity of node 1 moves nothing, as it has no mass: give it one"
    assert move(Scene(**given, mass=[0.0, 0.0, 1.0, 1.0]), 2, 1e-2).notices == [told]
    assert (
        "nodes 1, 3 moves nothing, as they have" in move(Scene(**given, mass=[0.0, 0.0, 1.0, 0.0]), 2, 1e-2).notices[0]
    )
    assert move(Scene(**given, mass=[0.0, 1.0, 0.0, 1.0]), 2, 1e-2).notices == []


def test_massless_nodes_out_of_balance_are_told():
    scene = make("saddle")
    mass = np.full(len(scene.nodes), 10.0)
    mass[scene.links[90]] = 0.0
    loaded = replace(scene, mass=mass, load=scene.load + [0.0, 0.0, -50.0])
    (text,) = move(loaded, 1, 1e-3).notices
    assert text.startswith("nodes without mass start out of balance, by up to ")
    assert move(replace(scene, mass=mass, load=0.0 * scene.load), 1, 1e-3).notices == []


def test_steps_that_fail_name_massless_nodes_that_no_link_holds():
    """Masses that two cables pull against a strut; once they slacken, the knot between them may be anywhere."""
    nodes = [[0.0, 0.0], [1.0, 0.0], [0.2, 0.5], [0.2, -0.5], [-0.8, 0.5], [-0.8, -0.5]]
    pull = 25.0 / 0.8 * np.hypot(0.8, 0.5)
    structure = latinpc.Structure(
        nodes, [[0, 1], [1, 2], [1, 3], [2, 4], [3, 5]], ["compression_only", "cable", "cable", "bar", "bar"],
        [1e4, 1e3, 1e3, 1e3, 1e3], prestress=[-50.0, pull, pull, 0.0, 0.0], geometry="large",
        fixed=[[1, 1], [0, 0], [0, 1], [0, 1], [1, 1], [1, 1]],
    )  # fmt: skip
    knot = replace(Scene.from_structure(structure), mass=[0.0, 0.0, 1.0, 1.0, 0.0, 0.0])
    told = []
    for speed in (5.0, 10.0, 20.0, 40.0, 80.0, 160.0):  # rounding has a say in which of them fail: about every second
        thrown = replace(knot, velocity=[[speed * (node in (2, 3)), 0.0] for node in range(6)])
        for h in (5e-4, 1e-3, 2e-3):
            told += move(thrown, 40, h).notices
            assert move(replace(thrown, mass=[0.0, 1e-3, 1.0, 1.0, 0.0, 0.0]), 40, h).notices == []
    assert told
    why = "As it begins, links bear next to nothing at node 1, without mass: a small mass there helps."
    assert all(why in text for text in told), told


@pytest.mark.parametrize("geometry", ["linear", "large"])
def test_an_update_is_called_before_each_iteration(geometry):
    """With the solution of the iteration, whose function norm falls."""
    linear = make("tensegrity-grid", modules=6, subdomains=9)
    scene = linear if geometry == "linear" else make("saddle", wind=50.0)
    structure = latinpc.Structure.from_scene(scene)
    snes, u, calls = structure.create_snes(), structure.create_vec(), []
    latinpc.set_newton(snes, "never")
    snes.setTolerances(max_it=4)
    snes.setUpdate(lambda snes, it: calls.append((it, snes.getSolution().norm())))
    snes.solve(None, u)
    assert [it for it, _ in calls] == list(range(snes.getIterationNumber()))
    assert len(calls) > 2 and calls[0][1] == 0.0 and len({size for _, size in calls}) == len(calls)


def test_tolerances_that_stop_nothing_are_told():
    scene = make("tensegrity-grid", modules=4, subdomains=4)
    text = "no solve stops at -snes_rtol and -snes_atol without -snes_latin_stop residual: take -snes_latin_error"
    tolerances = {"snes_rtol": 1e-3, "snes_atol": 1e-3}
    assert text in scene.solve(options=tolerances).notices
    for other in ({"snes_latin_stop": "residual"}, {"snes_type": "newtonls", "pc_type": "lu"}):
        assert text not in scene.solve(options=tolerances | other).notices
    for stop, instead in {
        "error": "-snes_latin_error",
        "energy": "-snes_latin_error",
        "residual": "-snes_rtol",
    }.items():
        text = f"no solve stops at -snes_stol with -snes_latin_stop {stop}: take {instead}"
        assert text in scene.solve(options={"snes_stol": 1e-3, "snes_latin_stop": stop}).notices
    text = "no solve stops at -snes_stol beside -snes_latin_error: leave out one of them"
    assert text in scene.solve(options={"snes_stol": 1e-3, "snes_latin_error": 1e-3}).notices
    for stop in ("auto", "indicator"):
        assert scene.solve(options={"snes_stol": 1e-3, "snes_latin_stop": stop}).notices == []


@pytest.mark.filterwarnings("ignore:not converged")
@pytest.mark.parametrize("more", [{}, {"snes_latin_newton": "never"}, {"snes_latin_geometry": "large"}])
def test_most_evaluations_of_a_function_are_most_linear_stages(more):
    """They had been without effect."""
    scene = make("saddle", wind=50.0)
    found = [scene.solve(options=more | {name: 3}) for name in ("snes_max_funcs", "snes_max_it")]
    assert [one.report["reason"] for one in found] == ["DIVERGED_FUNCTION_COUNT", "DIVERGED_MAX_IT"]
    assert found[0].iterations == found[1].iterations < scene.solve(options=more).iterations


def test_lags_of_a_jacobian_that_is_none_are_told():
    """PETSc reads them for every type of SNES, so that they are not among those that nobody has read."""
    scene = make("tensegrity-grid", modules=4, subdomains=4)
    lags = {"snes_lag_jacobian": 5, "snes_lag_preconditioner_persists": True}
    told = [text for text in scene.solve(options=lags).notices if "no Jacobian" in text]
    assert len(told) == 1 and "-snes_lag_jacobian and -snes_lag_preconditioner_persists without effect" in told[0]
    assert told[0].endswith("-snes_latin_newton_snes_lag_jacobian")
    for other in ({"snes_latin_newton_snes_lag_jacobian": 2}, lags | {"snes_type": "newtonls", "pc_type": "lu"}):
        assert not any("no Jacobian" in text for text in scene.solve(options=other).notices)


@pytest.mark.filterwarnings("ignore:not converged")
def test_newtons_method_preconditioned_from_the_left_tells_its_cure():
    """PETSc gives it differences for a Jacobian, and a matrix of zeros to precondition with."""
    scene = make("tensegrity-grid", modules=4, subdomains=4)
    left = {"snes_type": "newtonls", "npc_snes_type": "latin", "npc_snes_max_it": 3, "snes_npc_side": "left"}
    failed, cured = scene.solve(options=left), scene.solve(options=left | {"pc_type": "none"})
    (text,) = [text for text in failed.notices if "-snes_npc_side left" in text]
    assert not failed.converged and text.endswith("take -pc_type none")
    assert cured.converged and not any("-snes_npc_side" in text for text in cured.notices)


def test_a_deprecated_option_ends_with_its_solve():
    """PETSc puts the new name of an option in the place of the old one: neither is there for the next solve."""
    database = PETSc.Options()
    before = database.getAll()
    with default_options({"name_of_old": 7}):
        database.delValue("name_of_old")
        database.setValue("name_of_new", 7)
        database.setValue("given_by_a_callback", 8)
    assert database.getAll() == before | {"given_by_a_callback": "8"}
    database.delValue("given_by_a_callback")
