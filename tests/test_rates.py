"""Random structures and their judge: equilibria in 200 digits, verdicts, families, and the rates of some hundred."""

import json
from dataclasses import replace

import numpy as np
import oracle
import pytest
from petsc4py import PETSc
from support import far, lattice
from test_cli import latinpc, said

from latinpc.bench.extremes import drawn, rates, rating, rubbing
from latinpc.bench.extremes.catalogue import hung
from latinpc.bench.extremes.conditions import missed
from latinpc.bench.extremes.exact import solve_exactly
from latinpc.scenes import Law, Scene

pytestmark = pytest.mark.skipif(np.finfo(PETSc.RealType).eps > 1e-10, reason="the rates are those of double precision")


def hanging(law, load, **changes):
    """One node on a vertical and a slanting link."""
    given = {"nodes": [[0.0, 1.0], [1.0, 1.0], [0.0, 0.0]], "links": [[0, 2], [1, 2]], "law": [law, law]}
    given |= {"stiffness": [2.0, 3.0], "fixed": [[True, True], [True, True], [False, False]]}
    return Scene(name="hanging", load=[[0, 0], [0, 0], load], **(given | changes))


# ---- equilibria in 200 digits ----------------------------------------------------------------
@pytest.mark.parametrize("seed", range(12))
def test_equilibria_balance_and_are_those_of_newton(seed):
    """Forces balance to the last digits, and a dense Newton in double precision agrees."""
    scene = drawn.draw(5, seed, "statics").scene
    exact = solve_exactly(scene, unique=True)
    if not exact.exists:
        assert exact.displacements is None
        return
    forces = np.zeros(scene.nodes.shape)
    for end, sign in ((0, -1.0), (1, 1.0)):
        np.add.at(forces, scene.links[:, end], sign * exact.tensions[:, None] * scene.directions)
    size = np.abs(exact.tensions).max() + np.abs(scene.load).max() + 1e-20
    assert np.abs(np.where(scene.fixed, 0.0, forces - scene.load)).max() <= 1e-13 * size
    wrong = np.where(
        scene.law == Law.CABLE, -exact.tensions, np.where(scene.law == Law.COMPRESSION_ONLY, exact.tensions, 0)
    )
    assert (wrong <= 0.0).all()


def test_a_guess_changes_nothing():
    scene = lattice(3, 3, subdomains=1)
    assert far(solve_exactly(scene, guess=np.ones(scene.nodes.shape)).displacements, oracle.newton(scene)) < 1e-12


def test_what_cannot_be_in_equilibrium():
    """Cables pull a node into the angle between them: not out of it by one part in a million, nor up."""
    assert not solve_exactly(hung(1.0)).exists
    assert solve_exactly(hanging(Law.CABLE, [0.0, -1.0])).exists
    assert solve_exactly(hanging(Law.CABLE, [-1e-9, -1e-3])).exists
    assert not solve_exactly(hanging(Law.CABLE, [1e-9, -1e-3])).exists
    assert not solve_exactly(hanging(Law.CABLE, [0.0, 1e-12])).exists


def test_what_is_unique():
    """Displacements of a node that a slack cable leaves room are not; those of a taut one are, and of a stop."""
    assert solve_exactly(hanging(Law.BAR, [0.0, -1.0]), unique=True).unique
    assert not solve_exactly(hanging(Law.CABLE, [0.0, 0.0], initial_elongation=[-0.1, -0.1]), unique=True).unique
    assert solve_exactly(hanging(Law.INEXTENSIBLE, [1.0, -3.0], stiffness=[0.0, 0.0]), unique=True).unique


def test_rigid_links_and_jams():
    """A gap is met to the last digit; gaps that no displacement meets are no equilibrium."""
    line = {"nodes": [[0.0], [2.0], [1.0]], "links": [[0, 2], [2, 1]], "fixed": [[1], [1], [0]], "load": [[0.0]] * 3}
    stop = Scene(name="stop", law=[Law.BAR, Law.CONTACT], stiffness=[1.0, 0.0], initial_elongation=[-1.0, 0.25], **line)
    exact = solve_exactly(stop, unique=True)
    assert exact.displacements[2, 0] == 0.25
    assert np.allclose(exact.tensions, [-0.75, -0.75], rtol=1e-15, atol=0)
    jam = replace(stop, law=[Law.CONTACT, Law.CONTACT], initial_elongation=np.array([-1e-9, 0.0]))
    assert not solve_exactly(jam).exists


# ---- equilibria with friction ----------------------------------------------------------------
def leaning(friction, load, dim=2, gap=0.0, stiffness=1.0):
    """One node on a slack cable along x, and on a contact whose normal is y."""
    nodes, held = np.zeros((3, dim)), np.zeros((3, dim), bool)
    nodes[0, 1], nodes[2, 0], held[[0, 2]] = -1.0, -1.0, True
    axes = np.roll(np.eye(dim), -1, axis=0)
    return Scene(
        name="leaning", nodes=nodes, links=[[2, 1]] + [[0, 1]] * dim, fixed=held, stiffness=[stiffness] + [0.0] * dim,
        law=[Law.CABLE, Law.FRICTION] + [Law.TANGENT] * (dim - 1), load=np.vstack([np.zeros(dim), load, np.zeros(dim)]),
        initial_elongation=[-0.1, gap] + [0.0] * (dim - 1), direction=np.vstack([np.zeros(dim), axes]),
        friction=[0.0, friction] + [0.0] * (dim - 1),
    )  # fmt: skip


def test_friction_bears_what_its_cone_holds():
    """The cable is slack backwards, where the cone decides, to one part in a million; forwards it ends the slip."""
    for load, exists in (([-0.3 * (1 - 1e-6), -1.0], "yes"), ([-0.3 * (1 + 1e-6), -1.0], "no"), ([0.0, 1.0], "no")):
        assert rubbing.solve_rubbing(leaning(0.3, load)).exists == exists
    found = rubbing.solve_rubbing(leaning(0.3, [0.8, -1.0]))
    assert found.displacements[1] == pytest.approx([0.6, 0.0], rel=1e-14, abs=1e-30)
    assert found.tensions == pytest.approx([0.5, -1.0, 0.3], rel=1e-14)


def test_friction_in_space_opposes_the_slip():
    """Across the cable nothing but friction holds the node; with a bar there it slips at an angle."""
    assert rubbing.solve_rubbing(leaning(0.3, [0.1, -1.0, 0.2], dim=3)).exists == "yes"
    assert rubbing.solve_rubbing(leaning(0.3, [0.1, -1.0, 0.4], dim=3)).exists == "no"
    held = leaning(0.3, [0.5, -1.0, 0.6], dim=3)
    bars = replace(
        held, links=np.vstack([[[2, 1]], held.links]), law=np.append(Law.BAR, held.law),
        stiffness=np.append(1.0, held.stiffness), initial_elongation=np.append(0.0, held.initial_elongation),
        direction=np.vstack([[0, 0, 1.0], held.direction]), friction=np.append(0.0, held.friction),
    )  # fmt: skip
    found = rubbing.solve_rubbing(bars)
    slip, rub = found.displacements[1][[0, 2]], found.tensions[-2:]
    assert np.linalg.norm(rub) == pytest.approx(0.3, rel=1e-14)
    assert np.sort(np.abs(rub)) == pytest.approx(0.3 * np.sort(np.abs(slip)) / np.linalg.norm(slip), rel=1e-14)
    assert missed(bars, found.displacements, found.tensions) < 1e-15


def test_gaps_that_nothing_meets():
    """Two contacts against each other with less than no room."""
    line = {"nodes": [[0.0, 0.0], [2.0, 0.0], [1.0, 0.0]], "fixed": [[1, 1], [1, 1], [0, 0]], "load": np.zeros((3, 2))}
    pair = [Law.FRICTION, Law.TANGENT]
    jam = Scene(name="jam", links=[[0, 2]] * 2 + [[2, 1]] * 2 + [[0, 2]], law=pair + pair + [Law.BAR], **line,
                stiffness=[0, 0, 0, 0, 1.0], initial_elongation=[1e-9, 0.0, -1.1e-9, 0.0, 0.0],
                friction=[0.2, 0, 0.2, 0, 0], direction=[[1, 0], [0, 1], [1, 0], [0, 1], [0, 1]])  # fmt: skip
    assert rubbing.impossible(jam)
    assert not rubbing.impossible(replace(jam, initial_elongation=np.array([1.1e-9, 0.0, -1e-9, 0.0, 0.0])))


@pytest.mark.parametrize("number", [31, 102, 295, 371, 393, 1])
def test_random_equilibria_with_friction(number):
    """What is called one meets all conditions; moved data keep it, unless it is one of rounding."""
    scene = drawn.draw(5, number, "friction").scene
    found = rubbing.solve_rubbing(scene)
    assert found.exists == {1: "no", 102: "rounding"}.get(number, "yes")
    if found.exists == "yes":
        assert missed(scene, found.displacements, found.tensions) < 1e-14
        again = rubbing.near(scene, found.displacements * (1 + 1e-9), found.tensions * (1 - 1e-9))
        assert far(again.displacements, found.displacements) < 1e-6


# ---- the judge -------------------------------------------------------------------------------
def verdict(scene, u, tensions):
    return rating._judge_statics(drawn.Drawn("statics", "test", scene), u, tensions)["verdict"]


def test_verdicts():
    """Displacements and tensions wrong by more than three times what was asked are wrong; so is what does not exist."""
    scene = hanging(Law.BAR, [0.3, -1.0])
    exact = solve_exactly(scene)
    u, tensions = exact.displacements, exact.tensions
    assert verdict(scene, u, tensions) == "right"
    assert verdict(scene, u * (1 + 2.9e-4), tensions) == "right"
    assert verdict(scene, u * (1 + 3.1e-4), tensions) == "wrong"
    assert verdict(scene, u, tensions * (1 + 3.1e-4)) == "wrong"
    assert verdict(scene, np.full_like(u, np.nan), tensions) == "wrong"
    none = hanging(Law.CABLE, [1e-9, -1e-3])
    assert verdict(none, u, tensions) == "wrong"
    assert rating._refused(drawn.Drawn("statics", "test", none), "no equilibrium") == "refused"
    assert rating._refused(drawn.Drawn("statics", "test", scene), "DIVERGED_MAX_IT") == "unsolved"
    assert rating._refused(drawn.Drawn("statics", "test", scene), "DIVERGED_DTOL; no equilibrium: ...") == "wrong"


def test_verdicts_on_friction():
    """Conditions that are met, or an equilibrium nearby, are right; a refusal is right where there is none."""
    scene = leaning(0.3, [0.8, -1.0])
    found = rubbing.solve_rubbing(scene)
    u, tensions = found.displacements, found.tensions
    assert verdict(scene, u, tensions) == "right"
    assert verdict(scene, u, tensions * (1 + 2e-4)) == "right"
    assert verdict(scene, u - np.array([[0, 0], [0, 0.01], [0, 0]]), tensions) == "wrong"
    assert verdict(scene, u, tensions * [1.0, 1.0, -1.0]) == "wrong"
    none = leaning(0.3, [-0.4, -1.0])
    assert verdict(none, u, tensions) == "wrong"
    assert rating._refused(drawn.Drawn("friction", "test", none), "no equilibrium") == "refused"
    assert rating._refused(drawn.Drawn("friction", "test", scene), "no equilibrium") == "wrong"
    assert rating._refused(drawn.Drawn("friction", "test", scene), "DIVERGED_MAX_IT") == "unsolved"
    assert {"unknown", "rounding"}.isdisjoint(rates.SOLVABLE)


def test_where_displacements_are_not_unique_tensions_count():
    scene = hanging(Law.CABLE, [0.0, -1.0])
    exact = solve_exactly(scene, unique=True)
    assert not exact.unique
    assert verdict(scene, exact.displacements + np.array([[0, 0], [0, 0], [-0.1, 0]]), exact.tensions) == "right"
    assert verdict(scene, exact.displacements, exact.tensions * 1.01) == "wrong"


@pytest.mark.parametrize("family", drawn.SHARES)
def test_families(family):
    """The same numbers make the same structure, of links between nodes apart, in all topologies."""
    seen = set()
    for number in range(40):
        one, two = (drawn.draw(3, number, family) for _ in range(2))
        seen.add(one.topology)
        assert (one.scene.nodes == two.scene.nodes).all()
        assert (one.scene.load == two.scene.load).all()
        assert one.family == family
    assert seen == set(drawn.TOPOLOGIES)


# ---- the rates -------------------------------------------------------------------------------
def test_rates_of_a_hundred(tmp_path):
    """None is wrong, hangs or crashes; nearly all that have an equilibrium are solved."""
    file = tmp_path / "rates.json"
    result = latinpc("extremes", "--random", "100", "--seed", "17", "--json", file, timeout=300)
    outcomes = json.loads(file.read_text())["outcomes"]
    assert len(outcomes) == 100
    assert not [one for one in outcomes if one["verdict"] in rates.BAD], result.stdout
    solvable = [one for one in outcomes if one["verdict"] in rates.SOLVABLE]
    assert np.mean([one["verdict"] == "right" for one in solvable]) > 0.98


def test_mistakes_are_named():
    for given, words in ((["--family", "x"], "choose from statics"), (["--group", "x"], "have a --family")):
        assert words in said(latinpc("extremes", "--random", "3", *given, code=2))[0]


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_rates(seed):
    """3,000 structures a seed."""
    document = rates.run(3000, seed)
    _, table = rates.layout(document)
    assert not [one for one in document["outcomes"] if one["verdict"] in rates.BAD], table
