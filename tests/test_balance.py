"""What the default stop promises: displacements, and forces that balance beside the loads, not beside stiffnesses."""

from dataclasses import replace

import numpy as np
import oracle
import pytest
from petsc4py import PETSc
from support import far, grid, irregular, latin, lattice, network, solve

import latinpc
from latinpc.scenes import make

RNG = np.random.default_rng(16)


def left(scene, result):
    """Unbalanced forces over the loads, from displacements and tensions; l2 norms on the free components."""
    span = scene.nodes[scene.links[:, 1]] - scene.nodes[scene.links[:, 0]]
    pull = result.tensions[:, None] * span / np.linalg.norm(span, axis=1)[:, None]
    forces = np.zeros_like(scene.nodes)
    np.add.at(forces, scene.links[:, 1], pull)
    np.add.at(forces, scene.links[:, 0], -pull)
    return np.linalg.norm((forces - scene.load)[~scene.fixed]) / np.linalg.norm(scene.load[~scene.fixed])


@pytest.mark.parametrize("force", 10.0 ** np.arange(3, -7, -1))
def test_a_node_between_slack_cables_is_where_it_is_held(force):
    """However small the load beside k e0: it moves until a cable is taut, and is then pulled by force / k more."""
    stiffness = 1e6
    found = latinpc.Structure(
        nodes=[[0.0], [1.0], [-1.6]], links=[[0, 1], [0, 2]], law="cable", stiffness=stiffness,
        initial_elongation=[0.001, -0.003], fixed=[[0], [1], [1]], load=[[force], [0.0], [0.0]],
        comm=PETSc.COMM_SELF,
    )  # fmt: skip
    snes, u = found.create_snes(), found.create_vec()
    snes.setFromOptions()
    snes.solve(None, u)
    assert snes.getConvergedReason() > 0
    assert found.displacements(u)[0, 0] == pytest.approx(0.003 + force / stiffness, rel=3e-4)
    assert latinpc.tensions(snes).max() == pytest.approx(force, rel=1e-2)


@pytest.mark.parametrize("make_scene", [grid, irregular, network, lattice])
@pytest.mark.parametrize("smaller", [1.0, 1e-2, 1e-4, 1e-6])
def test_forces_balance_beside_small_loads(make_scene, smaller):
    """Loads far below the self-stress: displacements and balance as of ordinary ones."""
    scene = make_scene()
    scene = replace(scene, load=scene.load * smaller * np.where(scene.fixed, 1.0, RNG.uniform(0.5, 1.5)))
    result = solve(scene)
    assert result.reason > 0
    assert far(result.u, oracle.newton(scene)) < 1e-3
    assert left(scene, result) <= 1e-2 * (1 + 1e-6)


@pytest.mark.parametrize("balance", [1e-1, 1e-3, 1e-5])
def test_balance_is_what_was_asked_for(balance):
    scene = make("tensegrity-grid", modules=20, partition="metis")
    result = solve(scene, balance=balance)
    assert result.reason > 0
    assert left(scene, result) <= balance
    loose = solve(scene, balance=1e30, error=0.1, tension_error=1e30)
    assert left(scene, loose) > 1e-2  # which the default would not have left


def test_a_stop_of_ones_own_is_not_compared_with_loads():
    """A step tolerance that is given, or the stop on the indicator, decides alone."""
    scene = make("tensegrity-grid", modules=12, partition="metis")
    for own in ({"stol": 1e-2}, {"stop": "indicator", "stol": 1e-2}):
        assert left(scene, solve(scene, **own)) > 1e-2


@pytest.mark.parametrize(
    ("scene", "options", "stop"),
    [
        (grid, {}, "error"),
        (lambda: grid("truss"), {}, "indicator"),  # nothing to iterate on
        (lambda: make("net", side=8), {}, "error"),  # rigid
        (grid, {"stol": 1e-5}, "indicator"),
        (grid, {"stop": "energy"}, "energy"),
        (grid, {"stol": 1e-3, "error": 1e-3}, "error"),
    ],
)
def test_what_auto_stands_for(scene, options, stop, tmp_path):
    with latin(scene(), **options) as run:
        run.snes.solve(None, run.structure.create_vec())
        viewer = PETSc.Viewer().createASCII(str(tmp_path / "view"), comm=PETSc.COMM_SELF)
        run.snes.view(viewer)
        viewer.destroy()
    shown = (tmp_path / "view").read_text()
    chosen = "" if {"stop", "error"} & set(options) else ", chosen by auto"
    assert f"stop on the {stop}{chosen}\n" in shown
    assert ("unbalanced forces below 0.01 of the loads" in shown) == ("stol" not in options or "error" in options)


def test_a_rigid_link_between_supports_must_admit_them():
    """A contact whose nodes are both prescribed is checked before the first stage, and named with the cure."""
    how = {
        "nodes": [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]], "links": [[0, 1], [1, 2]], "law": ["bar", "contact"],
        "stiffness": [1.0, 0.0], "fixed": [[1, 1], [0, 1], [1, 1]], "comm": PETSc.COMM_SELF,
    }  # fmt: skip
    assert solve_of(how) > 0
    held = {**how, "fixed": [[1, 1], [1, 1], [1, 1]], "prescribed": [[0, 0], [0.1, 0], [0, 0]]}
    held |= {"nodes": [*how["nodes"], [3.0, 0.0]], "links": [*how["links"], [2, 3]], "law": [*how["law"], "bar"]}
    held |= {"stiffness": [1.0, 0.0, 1.0]}
    held["fixed"], held["prescribed"] = [*held["fixed"], [0, 1]], [*held["prescribed"], [0, 0]]
    with pytest.raises(PETSc.Error) as caught:
        solve_of(held)
    message = latinpc.error_message(caught.value)
    assert "Link 1 (contact)" in message
    assert "miss its gap by 0.1" in message
    assert "not kinematically admissible" in message
    away = [[0, 0], [-0.1, 0], [0, 0], [0, 0]]
    assert solve_of({**held, "prescribed": away}) > 0


def solve_of(how):
    """Solve a structure and return the reason."""
    structure = latinpc.Structure(**how)
    snes = structure.create_snes()
    snes.setFromOptions()
    snes.solve(None, structure.create_vec())
    return snes.getConvergedReason()


def test_a_choice_from_python_and_one_that_is_none():
    scene = make("tensegrity-grid", modules=12, partition="metis")
    with latin(scene) as run:
        latinpc.set_balance(run.snes, 1e-4)
        u = run.structure.create_vec()
        run.snes.solve(None, u)
        load = np.linalg.norm(scene.load[~scene.fixed])
        assert run.snes.getFunctionNorm() <= 1e-4 * load
        with pytest.raises(PETSc.Error) as caught:
            latinpc.set_balance(run.snes, 0.0)
        assert "for example 1e-2" in latinpc.error_message(caught.value)


def most(scene, tensions):
    """The largest unbalanced force on a node (N), from tensions."""
    pull, forces = tensions[:, None] * scene.directions, np.zeros_like(scene.nodes)
    np.add.at(forces, scene.links[:, 1], pull)
    np.add.at(forces, scene.links[:, 0], -pull)
    return np.linalg.norm(np.where(scene.fixed, 0.0, forces - scene.load), axis=1).max()


@pytest.mark.parametrize("name", ["grid", "metis", "network", "lattice", "saddle"])
@pytest.mark.parametrize("digits", [1, 4, 7])
def test_no_node_is_left_with_a_larger_force(name, digits):
    """In N, whatever the loads are, with small and large displacements; beyond what a loose stop leaves."""
    scene = {
        "grid": grid, "network": network, "lattice": lattice, "saddle": lambda: make("saddle"),
        "metis": lambda: make("tensegrity-grid", modules=20, partition="metis"),
    }[name]()  # fmt: skip
    loose = {"snes_latin_error": 0.1, "snes_latin_tension_error": 1e30, "snes_latin_balance": 1e30}
    force = max(scene.solve(options=loose).largest_unbalance, 1e-3 * abs(scene.load).max()) * 10.0**-digits
    result = scene.solve(options=loose, largest_unbalance=force)
    assert result.converged and result.largest_unbalance <= force
    if name != "saddle":
        assert most(scene, result.tensions) <= force * (1 + 1e-6)


def test_a_force_below_rounding_is_as_far_as_rounding_lets_it():
    """The number of digits that forces have ends it, not a count of steps."""
    for scene in (grid(), network(), make("saddle")):
        result = scene.solve(largest_unbalance=1e-25, error=1e-8)
        bears = abs(result.tensions).max()
        assert result.converged == (result.report["reason"] != "DIVERGED_INNER")
        assert result.largest_unbalance <= 1e-9 * bears and result.iterations < 500


def test_rigid_links_balance_to_a_force():
    result = make("net", side=6).solve(largest_unbalance=1e-6)
    assert result.converged and result.largest_unbalance <= 1e-6


def test_cases_side_by_side_are_left_with_no_larger_force():
    from test_cases import random_cases

    scene = grid()
    cases = random_cases(scene, 8)
    found = latinpc.solve_cases(scene, cases, {"snes_latin_largest_unbalance": 1e-6})
    assert found.converged and all(case["together"] for case in found.report["cases"])
    for case, tensions in zip(cases, found.tensions):
        assert most(case.applied(scene), tensions) <= 1e-6


def test_a_preset_gives_way_to_a_force():
    result = grid().solve(preset="fast", largest_unbalance=1e-3)
    assert result.converged and result.largest_unbalance <= 1e-3
    assert grid().solve(preset="fast").largest_unbalance > 1e-3
