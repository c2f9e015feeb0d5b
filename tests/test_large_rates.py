"""The judge of large displacements: its equations, its verdicts, and the rates of some random structures."""

import json
import sys
from collections import Counter

import numpy as np
import pytest
import turning
from conftest import ROOT
from petsc4py import PETSc
from test_cli import latinpc as command

sys.path.insert(0, str(ROOT / "benchmarks"))

import large
import opensees

from latinpc.bench.extremes import drawn, rates, rating
from latinpc.bench.extremes import turning as judging
from latinpc.bench.extremes.corotational import Corotational
from latinpc.scenes import Scene, make

pytestmark = pytest.mark.skipif(np.finfo(PETSc.RealType).eps > 1e-10, reason="the rates are those of double precision")


def truss(load):
    return Scene(name="truss", **turning.von_mises(load), geometry="large")


# ---- equations -----------------------------------------------------------------------------------
@pytest.mark.parametrize("number", range(6))
def test_the_tangent_is_the_derivative_of_the_unbalance(number):
    scene = drawn.draw(2, number, "large").scene
    equations, rng = Corotational(scene), np.random.default_rng(number)
    u = np.where(scene.fixed, 0.0, 0.01 * rng.normal(size=scene.nodes.shape)).astype(np.longdouble)
    v = np.where(scene.fixed, 0.0, rng.normal(size=scene.nodes.shape)).astype(np.longdouble)
    h = np.longdouble(1e-9)
    found = -(equations.unbalance(u + h * v) - equations.unbalance(u - h * v)) / (2 * h)
    exact = equations.tangent(u) @ v.ravel()[equations.free].astype(float)
    assert np.abs(found - exact).max() < 1e-6 * np.abs(exact).max()


@pytest.mark.parametrize("part", [0.3, 0.99])
def test_paths_lead_to_the_closed_form(part):
    limit = turning.von_mises_limit()
    path = Corotational(truss(part * limit)).follow()
    assert path.factor == 1.0
    assert -path.displacements[2, 1] == pytest.approx(turning.von_mises_deflection(part * limit), rel=1e-12)


def test_paths_end_at_a_limit_point():
    path = Corotational(truss(2.0 * turning.von_mises_limit())).follow()
    assert not path.follows
    assert 0.5 - 2e-5 < path.factor <= 0.5


# ---- verdicts ------------------------------------------------------------------------------------
def test_verdicts():
    """Unbalance, instability, equilibria beyond the snap and where none is left; refusals need the cause."""
    limit = turning.von_mises_limit()
    scene = truss(0.5 * limit)
    u = Corotational(scene).follow().displacements
    assert judging.judge(scene, u)["verdict"] == "right"
    assert judging.judge(scene, u * (1 + 1e-6))["why"] == "unbalanced forces"
    assert judging.judge(scene, np.full_like(u, np.nan))["verdict"] == "wrong"
    for start in (-0.65, -0.35):  # beyond the snap, on the way there
        v = np.zeros((3, 2), np.longdouble)
        v[2, 1] = start
        v = Corotational(scene).newton(v)
        assert judging.judge(scene, v.astype(float))["verdict"] == "wrong"
    beyond = truss(1.1 * limit)
    v = np.zeros((3, 2), np.longdouble)
    v[2, 1] = -0.65
    v = Corotational(beyond).newton(v).astype(float)
    assert judging.judge(beyond, v)["why"].startswith("the path of equilibria ends at 0.909")
    assert judging.judge(beyond, v)["verdict"] == "wrong"
    assert judging.refused(beyond, "DIVERGED_MAX_IT") == "unsolved"
    assert judging.refused(scene, "no stable equilibrium follows that of 0.9 of the loads") == "unsolved"


def test_a_refusal_is_right_beyond_the_limit_point():
    """As the solver says it."""
    one = drawn.Drawn("large", "truss", truss(1.1 * turning.von_mises_limit()))
    outcome = rating.judge(one, {})
    assert outcome["verdict"] == "refused", outcome


def test_a_structure_comes_to_rest_beyond_its_limit_point():
    """At the inverted equilibrium, far away; the path from there is its own."""
    load = 1.1 * turning.von_mises_limit()
    equations = Corotational(truss(load))
    u, moved = equations.beyond(equations.follow())
    assert turning.von_mises_force(-u[2, 1]) == pytest.approx(load, rel=1e-9)
    assert -u[2, 1] > 2 * turning.HEIGHT
    assert moved > 0.2


def test_a_bridge_whose_nodes_click_between_slack_cables():
    """Neighbouring cables are slack in turn: equilibria next to each other, which have not snapped through."""
    one = drawn.draw(7391, 106, "large")
    outcome = rating.judge(one, {})
    assert outcome["verdict"] in ("right", "elsewhere", "refused"), outcome


def test_a_bridge_one_of_whose_nodes_would_go_the_other_way():
    """In one increment from a fifth of the loads on, to another stable equilibrium, of more energy."""
    outcome = rating.judge(drawn.draw(77345621, 15, "large"), {})
    assert outcome["verdict"] == "right", outcome


def test_the_family():
    """The same numbers make the same structure; deflections reach a fifth of the size, 30 % of the cables slacken."""
    seen, deflections, slack = set(), [], []
    for number in range(16):
        one = drawn.draw(4, number, "large")
        assert one.scene.geometry == "large"
        if number < 3:
            assert (drawn.draw(4, number, "large").scene.load == one.scene.load).all()
        equations = Corotational(one.scene)
        path = equations.follow()
        tension = equations.state(path.displacements.astype(np.longdouble))[2]
        seen.add(one.topology)
        deflections.append(np.linalg.norm(path.displacements, axis=1).max() / equations.size)
        slack.append(np.mean(tension[one.scene.law == 1] == 0.0))
    assert seen == set(judging.SCENES)
    assert min(deflections) < 0.01 < 0.1 < max(deflections) <= 0.2 + 1e-9
    assert max(slack) <= 0.3 and np.mean(np.array(slack) > 0.02) > 0.15
    assert rating.judge(one, {})["verdict"] == "right"


# ---- the rates -----------------------------------------------------------------------------------
def test_rates_of_twenty(tmp_path):
    """None is wrong; nearly all that have an equilibrium are found."""
    file = tmp_path / "rates.json"
    result = command("extremes", "--random", "20", "--seed", "5", "--family", "large", "--json", file, timeout=300)
    counts = Counter(one["verdict"] for one in json.loads(file.read_text())["outcomes"])
    assert not set(counts) & set(rates.BAD), result.stdout
    assert counts["right"] == 20 - counts["refused"]


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_rates_of_three_hundred(seed):
    document = rates.run(300, seed, family="large")
    counts = Counter(one["verdict"] for one in document["outcomes"])
    assert not set(counts) & set(rates.BAD), rates.layout(document)[1]
    assert counts["right"] >= 0.98 * (300 - counts["refused"])


# ---- OpenSees ------------------------------------------------------------------------------------
def test_the_page_on_opensees_has_the_measured_rates():
    """The table is that of the results; SNES latin finds what there is to find."""
    rows = json.loads((ROOT / "benchmarks" / "results" / "opensees.json").read_text())["rows"]
    assert "\n".join(opensees.table(rows)) in (ROOT / "benchmarks" / "opensees.md").read_text()
    assert {len(row) for row in rows.values()} == {opensees.COUNT}
    assert all(verdict == "right" for _, verdict, _ in rows["SNES latin"])


def test_opensees_agrees_with_the_judge():
    """Where it is installed: displacements of a saddle with slack cables."""
    pytest.importorskip("openseespy")
    scene = make("saddle", side=6)
    found = {each["way"]: each for each in opensees.by_opensees(sys.executable, scene)}
    u = np.array(found["Newton, 100 increments"]["u"])
    assert judging.judge(scene, u)["verdict"] == "right"


# ---- side by side ---------------------------------------------------------------------------------
@pytest.mark.parametrize(("modules", "most"), [(6, 65), (9, 80), (12, 80)])
def test_a_grid_that_is_nearly_a_mechanism(modules, most):
    """A third of the cables slacken: a stable equilibrium where whole steps of Newton's method fail."""
    scene = large.scene("grid", modules)
    row, u, s = large.solve(scene, "latin")
    equations = Corotational(scene)
    found = s.displacements(u).astype(np.longdouble)
    assert row["converged"] and 0.25 < row["slack"] < 0.4
    assert row["factorisations"] <= most
    assert np.linalg.norm(equations.unbalance(found)) < 1e-2 * np.linalg.norm(scene.load)
    np.linalg.cholesky(equations.tangent(found))  # no error: positive definite
    better = equations.newton(found)
    assert np.linalg.norm(better - found) < 1e-4 * np.linalg.norm(better)


def test_what_lies_between_two_known_equilibria_is_found_soon():
    """Masts, towers and bridges whose increments were too large: 48 set-ups, from the nearest equilibrium alone 66."""
    factorisations = 0
    for number in (12, 49, 76, 103, 137):
        row, _, _ = large.solve(drawn.draw(60481937, number, "large").scene, "latin")
        assert row["converged"]
        factorisations += row["factorisations"]
    assert factorisations <= 70


def test_a_method_that_takes_too_long_is_ended(tmp_path):
    rows = large.measure("saddle", 12, tmp_path, limit=1e-2)
    assert [row["why"] for row in rows] == 3 * ["more than 0.01 s"]
    assert all("more than" in line for line in large.table(rows)[2:])


def test_the_benchmark_solves_one_problem_three_times(tmp_path):
    """Each method in a process of its own; Newton's method factors more often."""
    rows = {row["method"]: row for row in large.measure("saddle", 12, tmp_path)}
    assert set(rows) == set(large.METHODS)
    assert all(row["converged"] and row["difference"] < 1e-3 for row in rows.values())
    assert rows["latin"]["factorisations"] < rows["newton-mumps"]["factorisations"]
    assert len(large.table(list(rows.values()))) == 5
