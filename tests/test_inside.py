"""Latin solvers inside others: SNES latin as a nonlinear preconditioner and in composites, PC, KSP latin in fields."""

from dataclasses import replace

import numpy as np
import oracle
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from petsc4py import PETSc
from random_structures import draws
from support import ALL_VARIANTS, VARIANTS, far, grid, irregular, latin, lattice, network, settled
from test_properties import ALIKE, EXAMPLES

import latinpc
from latinpc.options import default_options
from latinpc.runs.solve import solve as run_solve

REASON = PETSc.SNES.ConvergedReason
SCENES = {"grid": grid, "irregular": irregular, "network": lambda: settled(network()), "lattice": lattice}
DIRECT = {"ksp_type": "preonly", "pc_type": "cholesky", "pc_factor_mat_solver_type": "mumps"}
MATRIX_FREE = {"pc_type": "none", "snes_rtol": 1e-6}  # differences leave no more digits
NPC = {"npc_snes_type": "latin", "npc_snes_max_it": 3}
OUTER = [
    ("right", "ngmres", {}), ("right", "anderson", {}), ("right", "newtonls", DIRECT), ("right", "qn", {}),
    ("left", "ngmres", {}), ("left", "anderson", {}), ("left", "nrichardson", {}),
    ("left", "ncg", {}), ("left", "newtonls", MATRIX_FREE),
]  # fmt: skip


def outer(scene, kind, b=None, guess=None, max_it=60, stol=0.0, **options):
    """Solve by another SNES than latin, 1e-8 of the first residual; returns the SNES, displacements, and norms seen."""
    structure, norms = latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF), []
    with default_options({"snes_rtol": 1e-8, "snes_max_it": max_it, "snes_stol": stol} | options):
        snes = structure.create_snes()
        snes.setType(kind)
        snes.setFromOptions()
        snes.setMonitor(lambda *args: norms.append(args[2]))
        u, load = structure.create_vec(), None
        if guess is not None:
            structure.set_displacements(guess, u)
        if b is not None:
            load = structure.create_vec()
            structure.set_displacements(b, load)
        snes.solve(load, u)
    return snes, structure.displacements(u), norms


def stages(scene, count, guess, b=None, **options):
    """Do so many iterations of SNES latin from a guess, as a nonlinear preconditioner does."""
    structure = latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF)
    with default_options({f"snes_latin_{key}": value for key, value in options.items()}):
        snes = structure.create_snes()
        snes.setFromOptions()
    snes.setTolerances(rtol=0.0, atol=0.0, stol=0.0, max_it=count)
    u = structure.create_vec()
    structure.set_displacements(guess, u)
    snes.solve(None, u)
    return snes, structure.displacements(u)


def energy(scene, u):
    """Norm of displacements in the energy of links that are all taut."""
    b, _ = oracle.kinematics(scene)
    return np.sqrt(scene.stiffness @ (b @ np.where(scene.fixed, 0.0, u).ravel()) ** 2)


# ---- what a few iterations are worth -------------------------------------------------------------
@pytest.mark.parametrize("acceleration", ["anderson", "nrichardson"])
@pytest.mark.parametrize("variant", [*VARIANTS, "primal"])
@pytest.mark.parametrize("name", SCENES)
def test_each_iteration_improves_the_guess(name, variant, acceleration):
    """Scattered errors, displacements too large, those of half the load: after one, two, three, five iterations."""
    scene = SCENES[name]()
    exact, half = oracle.newton(scene), oracle.newton(replace(scene, load=0.5 * scene.load))
    scattered = np.random.default_rng(0).normal(size=exact.shape) * 1e-2 * np.abs(exact).max()
    for error in (scattered, 0.3 * exact, half - exact):
        guess, errors = np.where(scene.fixed, exact, exact + error), []
        for count in (1, 2, 3, 5):
            snes, u = stages(scene, count, guess, variant=variant, outer_snes_type=acceleration)
            assert snes.getConvergedReason() == REASON.DIVERGED_MAX_IT and snes.getIterationNumber() == count
            errors.append(energy(scene, u - exact))
        assert max(errors) < energy(scene, guess - exact)
        assert errors[-1] < 0.9 * errors[0]


@settings(max_examples=EXAMPLES, derandomize=True, **ALIKE)
@given(draws(), st.sampled_from([1, 2, 3, 5]), st.floats(-4.0, 1.0))
def test_a_few_iterations_improve_any_guess(draw, count, power):
    """Random structures, errors of 1e-4 to 10 times the displacements: the plain iteration takes energy out."""
    scene = draw.scene()
    exact = oracle.newton(scene)
    size = 10.0**power * max(np.abs(exact).max(), 1e-3 * 10.0**draw.length)
    error = np.where(scene.fixed, 0.0, size * np.random.default_rng(draw.seed).normal(size=exact.shape))
    snes, u = stages(scene, count, exact + error, outer_snes_type="nrichardson")
    assert snes.getConvergedReason() in (REASON.DIVERGED_MAX_IT, REASON.CONVERGED_SNORM_RELATIVE)
    assert energy(scene, u - exact) <= energy(scene, error) + 1e-9 * energy(scene, exact)


@pytest.mark.parametrize("variant", [*ALL_VARIANTS, "primal"])
@pytest.mark.parametrize("name", SCENES)
def test_at_the_solution_it_stays(name, variant):
    """As far as rounding of the guess lets it; Newton's method does not run."""
    scene = SCENES[name]()
    exact = oracle.newton(scene)
    snes, u = stages(scene, 3, exact, variant=variant)
    assert snes.getLinearSolveIterations() == 0 and snes.getIterationNumber() <= 3
    assert far(u, exact) < 1e-9


@settings(max_examples=EXAMPLES // 2, derandomize=True, **ALIKE)
@given(draws(slack=0.3), st.sampled_from([*VARIANTS, "primal"]), st.sampled_from(["scalar", "schur"]))
def test_any_solution_is_a_fixed_point(draw, variant, direction):
    """Whatever interfaces a variant leaves out: forces of the guess go through those that are there."""
    scene = draw.scene()
    exact = oracle.newton(scene)
    _, u = stages(scene, 2, exact, variant=variant, direction=direction)
    assert energy(scene, u - exact) <= 1e-7 * energy(scene, exact)


def test_lost_digits_are_no_matter_of_a_few_iterations():
    """A free node of slack cables, its load hidden by rounding: three iterations end as such, not as a failure."""
    scene = grid()
    node = len(scene.nodes)
    nodes = np.vstack([scene.nodes, [3.0, 3.0, 5.0]])
    near = np.argsort(np.linalg.norm(scene.nodes - nodes[-1], axis=1))[:3]
    structure = latinpc.Structure(
        nodes, np.vstack([scene.links, [[other, node] for other in near]]), np.append(scene.law, [1] * 3),
        np.append(scene.stiffness, [1e7] * 3), np.append(scene.initial_elongation, [-0.1] * 3),
        fixed=np.vstack([scene.fixed, [0, 0, 0]]), load=np.vstack([scene.load, [0, 0, -1e-12]]),
        subdomain=np.append(scene.subdomain, [0] * 3), comm=PETSc.COMM_SELF)  # fmt: skip
    snes, u = structure.create_snes(), structure.create_vec()
    snes.setTolerances(rtol=0.0, atol=0.0, stol=0.0, max_it=3)
    snes.solve(None, u)
    assert snes.getConvergedReason() == REASON.DIVERGED_MAX_IT
    assert latinpc.unsupported_nodes(snes)[1] == [node]


# ---- as a nonlinear preconditioner -----------------------------------------------------------------
@pytest.mark.parametrize(("side", "kind", "more"), OUTER)
@pytest.mark.parametrize("name", SCENES)
def test_nonlinear_preconditioner(name, side, kind, more):
    """The solution, in fewer outer iterations than without, where the outer method gets there at all."""
    scene = SCENES[name]()
    exact = oracle.newton(scene)
    snes, u, norms = outer(scene, kind, snes_npc_side=side, **NPC, **more)
    assert snes.getConvergedReason() == REASON.CONVERGED_FNORM_RELATIVE and far(u, exact) < 1e-5
    assert snes.getNPC().getType() == "latin" and norms[-1] <= more.get("snes_rtol", 1e-8) * norms[0]
    assert snes.getNPC().getConvergedReason() in (REASON.DIVERGED_MAX_IT, REASON.CONVERGED_SNORM_RELATIVE)
    if more != MATRIX_FREE:  # Newton's method for another function
        alone, u, _ = outer(scene, kind, **more)
        assert alone.getConvergedReason() < 0 or far(u, exact) > 1e-5 or snes.its < alone.its


@pytest.mark.parametrize("name", SCENES)
def test_more_inner_iterations_leave_fewer_outer_ones(name):
    scene = SCENES[name]()
    counts = [outer(scene, "newtonls", **{**NPC, **DIRECT, "npc_snes_max_it": count})[0].its for count in (1, 3, 10)]
    assert counts == sorted(counts, reverse=True) and counts[2] <= 2


@pytest.mark.parametrize("schedule", ["none", "always", "initialonly", "finalonly", "initialfinalonly"])
@pytest.mark.parametrize("kind", ["ngmres", "newtonls"])
def test_norm_schedules(kind, schedule):
    """What the preconditioner computes of its function changes nothing of the outer iteration."""
    scene = grid()
    expected = outer(scene, kind, **NPC, **DIRECT)
    found = outer(scene, kind, npc_snes_norm_schedule=schedule, **NPC, **DIRECT)
    assert found[0].getConvergedReason() == expected[0].getConvergedReason() > 0
    assert found[2] == pytest.approx(expected[2], rel=1e-6, abs=1e-9 * expected[2][0])


def test_more_load_and_a_guess():
    """SNESSolve(b, x) of the outer method: the preconditioner has the same b, and goes on from x."""
    scene = grid()
    b = np.where(scene.fixed, 0.0, np.random.default_rng(1).normal(size=scene.nodes.shape))
    exact = oracle.newton(replace(scene, load=scene.load + b))
    snes, u, norms = outer(scene, "newtonls", b=b, guess=1.001 * exact, **NPC, **DIRECT)
    assert snes.getConvergedReason() > 0 and far(u, exact) < 1e-6
    far_off = outer(scene, "newtonls", b=b, **NPC, **DIRECT)
    assert norms[0] < far_off[2][0] and snes.its <= far_off[0].its
    snes, u, _ = outer(scene, "ngmres", b=b, guess=exact, max_it=3, **NPC)
    assert far(u, exact) < 1e-9


def test_a_report_names_the_preconditioner():
    report = run_solve(grid(), {"snes_type": "ngmres", "npc_snes_type": "latin"}).report
    assert report["solver"] == "ngmres, npc latin"


@pytest.mark.parametrize("most", [1, 2, 3, 4, 5])
def test_few_iterations_keep_a_good_guess(most):
    """No linear stage is left for a proof: that is no rounding, after which a solve starts again from rest."""
    scene = grid()
    solution = oracle.newton(scene)
    with latin(scene, max_it=most) as run:
        u = run.structure.create_vec()
        run.structure.set_displacements(solution, u)
        run.snes.solve(None, u)
        assert run.snes.getConvergedReason() > 0 or run.snes.getConvergedReason() == REASON.DIVERGED_MAX_IT
        assert far(run.structure.displacements(u), solution) < 1e-6


# ---- in a composite --------------------------------------------------------------------------------
@pytest.mark.parametrize(("kind", "solvers", "most"), [
    ("multiplicative", "latin", 20), ("multiplicative", "latin,newtonls", 4), ("multiplicative", "newtonls,latin", 4),
    ("additive", "latin", 20), ("additive", "latin,newtonls", 13),
    ("additiveoptimal", "latin", 15), ("additiveoptimal", "latin,newtonls", 5),
])  # fmt: skip
@pytest.mark.parametrize("name", SCENES)
def test_composite(name, kind, solvers, most):
    """Three iterations each time, alone or with a step of Newton's method."""
    scene = SCENES[name]()
    options = {"snes_composite_type": kind, "snes_composite_sneses": solvers}
    for i, one in enumerate(solvers.split(",")):
        chosen = {"snes_max_it": 3} if one == "latin" else {**DIRECT, "snes_linesearch_type": "basic"}
        options |= {f"sub_{i}_{key}": value for key, value in chosen.items()}
    if kind == "additive" and "," in solvers:
        options["snes_composite_damping"] = "0.5,0.5"
    snes, u, norms = outer(scene, "composite", **options)
    assert snes.getConvergedReason() == REASON.CONVERGED_FNORM_RELATIVE and far(u, oracle.newton(scene)) < 1e-6
    assert snes.its <= most and norms[-1] <= 1e-8 * norms[0]


@pytest.mark.parametrize("words", [
    "-snes_type ngmres -npc_snes_type latin -npc_snes_max_it 3",
    "-snes_type composite -snes_composite_type multiplicative -snes_composite_sneses latin,newtonls "
    "-sub_0_snes_max_it 3 -sub_1_pc_type cholesky -sub_1_pc_factor_mat_solver_type mumps",
])  # fmt: skip
def test_any_number_of_ranks(ranks_for, words):
    found = [ranks_for(n, "inside_program", "structure", *words.split(), "-snes_rtol", 1e-8) for n in (1, 2, 4)]
    counts = [one["iterations"] for one in found]
    assert all(one["reason"] > 0 and not one["unused"] for one in found)
    assert max(counts) - min(counts) <= 1
    u = [np.array(one["u"]) for one in found]
    assert far(u[1], u[0]) < 1e-6 and far(u[2], u[0]) < 1e-6


# ---- PC and KSP latin inside other preconditioners ---------------------------------------------------
SPLIT = "-ksp_type fgmres -pc_type fieldsplit -pc_fieldsplit_block_size 2"


@pytest.mark.parametrize(("words", "most"), [
    (SPLIT + "".join(f" -fieldsplit_{i}_ksp_type preonly -fieldsplit_{i}_pc_type latin" for i in range(2)), 14),
    (SPLIT + "".join(f" -fieldsplit_{i}_ksp_type latin -fieldsplit_{i}_pc_type none" for i in range(2)), 13),
    ("-ksp_type fgmres -pc_type ksp -ksp_ksp_type latin -ksp_pc_type none -ksp_ksp_rtol 1e-2", 5),
    ("-ksp_type cg -pc_type composite -pc_composite_pcs latin,jacobi", 18),
])  # fmt: skip
def test_inside_preconditioners(ranks_for, words, most):
    """The components of a MATIS each by PC or KSP latin; KSP latin as a preconditioner; PC latin beside another."""
    found = ranks_for(4, "inside_program", "fields", *words.split())
    assert found["reason"] > 0 and found["iterations"] <= most and found["residual"] < 1e-7 and not found["unused"]
