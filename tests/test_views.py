"""What solvers tell of themselves and hand out."""

import re

import numpy as np
import pytest
from petsc4py import PETSc
from test_newton import contrast

import latinpc
from latinpc.options import default_options
from latinpc.scenes import make


def shown(solver, folder):
    """What a solver prints when it is viewed."""
    viewer = PETSc.Viewer().createASCII(str(folder / "view"), comm=PETSc.COMM_SELF)
    solver.view(viewer)
    viewer.destroy()
    return (folder / "view").read_text()


@pytest.fixture
def weights():
    """A chain that hangs and swings."""
    nodes = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0]])
    held = np.array([[1, 1], [0, 0], [0, 0], [1, 1]], bool)
    load = np.array([[0.0, 0.0], [1.0, -1.0], [0.5, -2.0], [0.0, 0.0]])
    links = np.array([[0, 1], [1, 2], [2, 3], [0, 2], [1, 3]])
    nodes[1, 1] = nodes[2, 1] = -0.5
    return latinpc.Structure(
        nodes, links, law=latinpc.Law.BAR, stiffness=100.0, fixed=held, load=load, mass=2.0, comm=PETSc.COMM_SELF
    )


def test_motions_tell_their_scheme_and_what_is_between_two_steps(weights, tmp_path):
    ts = weights.create_ts()
    u, v = ts.getSolution2()
    ts.setTimeStep(1e-2)
    ts.setMaxSteps(3)
    ts.setExactFinalTime(PETSc.TS.ExactFinalTime.STEPOVER)
    ts.solve(u)
    assert "implicit Euler in velocities and impulses" in shown(ts, tmp_path)
    assert "5 links" in shown(ts, tmp_path)
    between = u.duplicate()
    ts.interpolate(ts.getTime() - 4e-3, between)
    assert v.norm() > 0
    assert np.allclose(between.array, u.array - 4e-3 * v.array, rtol=1e-12, atol=1e-15)


def test_the_inner_iteration_can_be_had_before_the_solve():
    structure = latinpc.Structure.from_scene(make("truss-grid", modules=4, subdomains=4), comm=PETSc.COMM_SELF)
    snes = structure.create_snes()
    outer = latinpc.outer_snes(snes)
    assert outer.getType() == "anderson" and outer.getOptionsPrefix().endswith("snes_latin_outer_")
    outer.setType("nrichardson")
    snes.solve(None, structure.create_vec())
    assert latinpc.outer_snes(snes).handle == outer.handle
    assert outer.getType() == "nrichardson" and snes.reason > 0


def test_a_shell_shows_what_is_in_it(tmp_path):
    structure = latinpc.Structure.from_scene(make("truss-grid", modules=4, subdomains=4), comm=PETSc.COMM_SELF)
    matrix, u = structure.dm.createMat(), structure.create_vec()
    structure.jacobian(u, matrix)
    pc = PETSc.PC().create(PETSc.COMM_SELF)
    pc.setType("shell")
    pc.setOperators(matrix)
    latinpc.pcshell_set_latin(pc)
    pc.setUp()
    assert "variant corner" in shown(pc, tmp_path)


def test_what_a_decomposition_costs_is_predicted_and_measured(tmp_path):
    scene = make("network", nodes=600)
    costs = {}
    for count in (0, 1, 4):
        structure = latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF)
        with default_options({"snes_type": "latin", "snes_latin_precision": "double", "snes_latin_subdomains": count}):
            snes = structure.create_snes()
            snes.setFromOptions()
        snes.setUp()
        before = latinpc.cost(snes)
        assert before["linear_stages"] == 0 and before["stage_seconds"] == 0 < before["setup_seconds"]
        snes.solve(None, structure.create_vec())
        costs[count] = cost = latinpc.cost(snes)
        view = shown(snes, tmp_path)
        assert cost["linear_stages"] >= len(latinpc.history(snes)["indicator"]) > 0 and 0 < cost["stage_seconds"] < 1
        assert f"number of subdomains: {cost['choice']}" in view
        assert f"a linear stage reads their factors, {cost['factor_bytes'] / 1e6:.3g} MB, twice" in view
        assert f"measured: set-up {cost['setup_seconds']:.3g} s, {cost['linear_stages']} linear stages" in view
    assert costs[0]["choice"] == "automatic, one factor is cheapest" and costs[1]["choice"] == "set by the user"
    assert (
        costs[0]["factor_bytes"] == costs[1]["factor_bytes"] > costs[4]["factor_bytes"]
    )  # of four, interfaces are apart
    # a Cholesky factor of n rows has between n and n (n + 1) / 2 entries, and takes their squares by columns
    n, entries = 3 * len(scene.nodes), costs[1]["factor_bytes"] / 8
    assert n < entries < n * n and entries**2 / n / 4 < costs[1]["factor_operations"] < n**3


def test_costs_of_other_local_solvers_are_measured_alone(tmp_path):
    structure = latinpc.Structure.from_scene(make("truss-grid", modules=4, subdomains=4), comm=PETSc.COMM_SELF)
    with default_options({"snes_type": "latin", "snes_latin_local_pc_factor_mat_solver_type": "petsc"}):
        snes = structure.create_snes()
        snes.setFromOptions()
        snes.solve(None, structure.create_vec())
    cost = latinpc.cost(snes)
    assert cost["choice"] == "given" and cost["factor_bytes"] == cost["factor_operations"] == 0 < cost["setup_seconds"]
    assert "predicted" not in shown(snes, tmp_path)


SHOWN = {
    "stop": ("energy", "estimated error below 0.0001 in the energy norm"),
    "warm_start": ("extrapolate", "warm start: extrapolate"),
    "newton": ("never", "Newton's method: never"),
    "modes_local": (0.5, "local low-energy fields below 0.5"),
}


def test_views_tell_what_options_have_changed(tmp_path):
    structure = latinpc.Structure.from_scene(make("truss-grid", modules=4, partition="metis"), comm=PETSc.COMM_SELF)
    snes = structure.create_snes()
    snes.setUp()
    before = shown(snes, tmp_path)
    with default_options({f"snes_latin_{name}": value for name, (value, _) in SHOWN.items()}):
        snes.setFromOptions()
    snes.solve(None, structure.create_vec())
    after = shown(snes, tmp_path)
    for name, (_, text) in SHOWN.items():
        assert text in after and text not in before, name


def test_a_view_makes_no_room_for_another_solve(tmp_path):
    """Newton's method has ended the solve, and the past of the iteration is gone: a view leaves it so."""
    structure = latinpc.Structure.from_scene(
        make("tensegrity-grid", modules=10, partition="metis"), comm=PETSc.COMM_SELF
    )
    snes = structure.create_snes()
    with default_options({"snes_latin_subdomains": 2}):
        snes.setFromOptions()
    snes.solve(None, structure.create_vec())
    iteration, newton = shown(snes, tmp_path).split("fixed-point solver:")[1].split("Newton's method by")
    assert "last solve" in newton
    assert "Number of stored past updates: 10" in iteration
    assert "has not been set up" in shown(latinpc.outer_snes(snes), tmp_path)


def test_one_subdomain_has_no_coarse_problem():
    structure = latinpc.Structure.from_scene(make("network", nodes=100), comm=PETSc.COMM_SELF)
    snes = structure.create_snes()
    snes.setUp()
    assert latinpc.statistics(snes)["subdomains"] == 1
    assert latinpc.coarse_ksp(snes) is None


@pytest.mark.parametrize(
    ("scene", "options", "told"),
    [
        (
            lambda: make("network", nodes=1500),
            {"stop": "error"},
            "Newton's method by the operators of the iteration, last solve",
        ),
        (lambda: contrast(1e6), {}, "Newton's method by operators of the tangent stiffness, last solve"),
    ],
)
def test_newtons_method_behind_the_iteration_is_shown(scene, options, told, tmp_path):
    """How many steps and linear stages it took in the last solve, and its solver."""
    structure = latinpc.Structure.from_scene(scene(), comm=PETSc.COMM_SELF)
    snes = structure.create_snes()
    snes.setTolerances(stol=1e-8)
    with default_options({f"snes_latin_{key}": value for key, value in {"subdomains": 8, **options}.items()}):
        snes.setFromOptions()
    told += r" [1-9]\d* steps and [1-9]\d* linear stages:\n.*type: newtonls"
    assert not re.search(told, shown(snes, tmp_path), re.DOTALL)
    snes.solve(None, structure.create_vec())
    assert snes.reason > 0
    assert re.search(told, shown(snes, tmp_path), re.DOTALL)
