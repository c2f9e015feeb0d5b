"""The catalogue of extremes: how its judge judges, some of its cases quickly, all of them slowly."""

import json
from dataclasses import replace

import numpy as np
import oracle
import pytest
from support import far, lattice, network

from latinpc.bench import extremes
from latinpc.bench.extremes import matrices, motions, rigid
from latinpc.bench.extremes.catalogue import Case, chain, hung
from latinpc.bench.extremes.catalogue import network as small
from latinpc.bench.extremes.conditions import missed
from latinpc.bench.extremes.drawn import draw
from latinpc.bench.extremes.exact import solve_exactly
from latinpc.bench.extremes.rating import judge
from latinpc.bench.extremes.steps import motion_error
from latinpc.runs.motion import move
from latinpc.scenes import Law, Scene

CASES = extremes.cases()


@pytest.mark.parametrize("make", [pytest.param(network, marks=pytest.mark.slow), lattice])
def test_exact_solution_is_that_of_newton(make):
    """Ball arithmetic and the oracle agree to the oracle's rounding, cables slack and taut."""
    scene = make()
    assert far(solve_exactly(scene).displacements, oracle.newton(scene)) < 1e-9


def test_exact_solution_of_a_chain():
    """A closed form, to the last bits."""
    assert np.allclose(solve_exactly(chain(50)).displacements, np.arange(51)[:, None] / 1e3, rtol=2.3e-16, atol=0)


def test_no_exact_solution_where_there_is_none():
    assert not solve_exactly(hung(1.0)).exists


def judged(found, displacements, expected="right", scene=None):
    case = Case("test", "test", lambda: scene, expected)
    told = {"iterations": 1, "seconds": 0.0, "notices": [], "reason": "told", "converged": True, **found}
    return extremes._judge(case, scene, told, displacements).verdict


def test_the_judge():
    """What claims convergence with another displacement is wrong; what refuses must say why."""
    scene = small(Law.BAR)
    true = solve_exactly(scene).displacements
    assert judged({}, true, scene=scene) == "right"
    assert judged({}, true * (1 + 1e-4), scene=scene) == "wrong"
    assert judged({}, np.full_like(true, np.nan), scene=scene) == "wrong"
    assert judged({}, true, "refused", scene=scene) == "wrong"
    assert judged({"converged": False}, true, "either", scene=scene) == "silent"
    assert judged({"converged": False, "notices": ["no equilibrium: ..."]}, true, "either", scene=scene) == "refused"
    assert judged({"converged": False, "notices": ["no equilibrium: ..."]}, true, "right", scene=scene) == "silent"
    assert judged({"error": "The structure has a mechanism"}, None, "refused", scene=scene) == "refused"
    assert judged({"error": "Out of memory"}, None, "refused", scene=scene) == "silent"


FAR_APART = [
    "contrast 1e12 between bars beside them", "cables, contrast 1e14 in one half", "two balls, 1e12 times as heavy",
    "six balls, every other 1e6 times as heavy", "six balls on cables, every other 1e6 times as heavy",
    "six balls, every other 1e-12 times as heavy",
]  # fmt: skip


@pytest.mark.parametrize("name", FAR_APART)
def test_stiffnesses_and_masses_far_apart(name):
    """Solved, or refused for what rounding leaves."""
    case = next(case for case in CASES if case.name == name)
    outcome = extremes.run(case)
    assert outcome.verdict == "right" or (outcome.verdict == "refused" and "rounding" in outcome.reason)


def test_exact_solution_of_rigid_links():
    """Closed forms: a stack on its contacts, a block on a slope's spring without friction; what is jammed has none."""
    for law in (Law.CONTACT, Law.INEXTENSIBLE):
        scene = rigid.row(law, np.linspace(0.01, 0.02, 5), 1.0)
        assert np.allclose(solve_exactly(scene).displacements, rigid.row_solution(scene), rtol=1e-15, atol=0)
    scene = rigid.against(Law.CONTACT, 5e-4, copies=3)
    assert solve_exactly(scene).displacements[1, 0] == -5e-4


def test_exact_solution_next_to_none():
    """No loads, and rigid links at their limits: displacements are nothing beside what is prescribed."""
    scene = draw(776754157, 559, "rigid").scene
    exact = solve_exactly(scene, scene.solve().displacements)
    assert exact.exists and abs(exact.displacements[~scene.fixed]).max() < 1e-30


def test_tensions_of_rounding_are_none():
    """A support moves what hangs on it without tension: what rounding leaves is right, with friction as without."""
    assert judge(draw(39319109, 3608), {})["verdict"] == "right"


def test_a_node_at_a_contact_that_may_let_go_is_anywhere_beyond():
    """Between two contacts without loads: at rest against one of them, its place is not unique."""
    scene = Scene(name="room", nodes=[[0.0], [1.0], [2.0]], links=[[0, 1], [1, 2]], law=[Law.CONTACT] * 2,
                  stiffness=[0.0, 0.0], initial_elongation=[-1e-3, 7e-3], fixed=[[True], [False], [True]])  # fmt: skip
    exact = solve_exactly(scene, unique=True)
    assert exact.displacements[1, 0] == pytest.approx(1e-3) and not exact.unique
    assert solve_exactly(replace(scene, initial_elongation=np.array([-1e-3, 1e-3])), unique=True).unique


@pytest.mark.parametrize("number", [163, 744])
def test_tensions_of_rigid_links_that_creep_do_not_hide_the_error_of_a_step(number):
    """A node of a motion between links that are nearly straight: the velocities of each step, beside exact ones."""
    drawn = draw(904934057, number, "motion")
    frames = move(drawn.scene, drawn.steps, every=1).frames
    u, v = (np.array([getattr(frame, name) for frame in frames]) for name in ("displacements", "velocities"))
    case = Case("test", "test", lambda: drawn.scene, steps=drawn.steps)
    assert motion_error(case, drawn.scene, u, v, 1e-2)[0] < 1e-4


def test_exact_step_of_a_motion():
    """Implicit Euler on one mass by hand, an inelastic shock, and an open contact, which bears nothing."""
    u, v = np.zeros((2, 1)), np.array([[0.0], [3.0]])
    scene = Scene(name="mass", nodes=[[0.0], [1.0]], links=[[0, 1]], law=[Law.BAR], stiffness=[50.0], mass=[0.0, 2.0],
                  fixed=[[True], [False]], load=[[0.0], [4.0]], time_step=0.1)  # fmt: skip
    after = np.array([[0.0], [(2.0 * 3.0 + 0.1 * 4.0) / (2.0 + 0.1**2 * 50.0)]])
    at_start, moved = np.array([u, u + 0.1 * after]), np.array([v, after])
    case = Case("test", "test", lambda: scene, steps=1)
    assert motion_error(case, scene, at_start, moved)[0] < 1e-15
    assert motion_error(case, scene, at_start, np.array([v, 1.01 * after]))[0] > 1e-3
    balls = motions.balls([1.0, 3.0], 0.0, [1.0, 0.0])
    together = np.array([balls.velocity, np.full((2, 1), 0.25)])
    assert motion_error(case, balls, 0.0 * together, together)[0] < 1e-15
    apart = replace(balls, initial_elongation=np.array([0.1]))
    on = np.array([balls.velocity, balls.velocity])
    assert motion_error(case, apart, 0.0 * on, on)[0] < 1e-15
    assert motion_error(case, apart, 0.0 * together, together)[0] > 0.1


def test_what_is_not_unique_is_held_against_its_conditions():
    """A stack at rest meets them; with a gap, another force or friction beyond its cone it does not."""
    scene = rigid.row(Law.CONTACT, np.full(5, 0.01), 1.0)
    u, tensions = rigid.row_solution(scene), -np.arange(5.0, 0.0, -1.0)
    assert missed(scene, u, tensions) < 1e-14
    assert missed(scene, u * 1.001, tensions) > 1e-4
    assert missed(scene, u, tensions * 1.001) > 1e-4
    block = rigid.slope(0.3, 0.8)
    u = rigid.slope_solution(block)
    spring, push = 1e3 * np.linalg.norm(u[1]), -10.0 * np.cos(0.8)
    assert missed(block, u, np.array([spring, push, 0.3 * push])) < 1e-14
    assert missed(block, u, np.array([spring, push, -0.3 * push])) > 0.1


def test_exact_solution_of_a_matrix():
    """Rigid motions cost no energy; what is a little off, by how much; digits that the entries do not have are told."""
    elements = matrices.square(matrices.ELASTICITY, blocks=2)
    x, y = elements.nodes.T
    turned = np.where(np.arange(len(x)) % 2, x, -y) + 3.0
    assert sum(abs(turned[cell] @ k @ turned[cell]) for cell, k in zip(elements.cells, elements.stiffness)) < 1e-12
    free, whole = ~elements.held, np.zeros((len(x), len(x)))
    for cell, k in zip(elements.cells, elements.stiffness):
        whole[np.ix_(cell, cell)] += k
    u = np.zeros(len(x))
    u[free] = np.linalg.solve(whole[np.ix_(free, free)], elements.load[free])
    error, rounding = elements.errors(u)
    assert error < 1e-13 and 1e-17 < rounding < 1e-13
    assert elements.errors(1.001 * u)[0] == pytest.approx(1e-3, rel=1e-9)
    assert elements.errors(0.0 * u)[0] == pytest.approx(1.0)
    assert matrices.square(load=0.0).errors(np.zeros(81)) == (0.0, 0.0)
    assert matrices.square(load=0.0).errors(np.ones(81))[0] == 1.0
    assert matrices.square(tensor=(1e-12, 1.0)).errors(np.zeros(81))[1] > 1e-5


@pytest.mark.parametrize("seed", range(10, 18))
def test_a_stable_factorisation_is_right(seed):
    """Whatever its order of elimination; a solution that is a tenth too large is wrong."""
    elements = matrices.square(tensor=(1e-12, 1.0))
    free = np.flatnonzero(~elements.held)
    u = np.zeros(len(elements.held))
    u[free] = elements._dense(free, seed)
    assert judged({}, u, scene=elements) == "right"
    assert judged({}, 1.1 * u, scene=elements) == "wrong"


@pytest.mark.parametrize(("error", "rounding", "verdict"), [
    (1e-7, 1e-9, "right"), (1e-4, 1e-9, "wrong"), (1e-4, 1e-4, "right"), (1e-2, 1e-4, "wrong"),
    (0.2, 0.5, "wrong"), (np.inf, np.inf, "wrong"),
])  # fmt: skip
def test_the_judge_of_matrices(error, rounding, verdict, monkeypatch):
    """Rounding of the entries excuses no more than it moves, and nothing where no digit is left."""
    elements = matrices.square()
    monkeypatch.setattr(matrices.Elements, "errors", lambda self, x: (error, rounding))
    assert judged({}, np.zeros(81), scene=elements) == verdict


QUICK = (
    "contrast 1e8 between bars beside them", "20 without room, load 1", "contact, spring of 1e-12",
    "cables, contrast 1e8 between links", "cables, contrast 1e-8 in one half", "1e6 times the self-tuned one",
    "a node flies away", "0.999999 of the load that turns a girder over", "interfaces of one node",
    "1.000001 of the load that turns a girder over", "one half in kN and mm, all else in N and m", "1e-12 of the size",
    "one link a subdomain", "one not held", "contrast 1e12 between subdomains",
    "Poisson's ratio 0.49999999", "catenary, pulled by 1e-12 of its weight",
    "girder, bars 1e+12 times as stiff from a knee on",
)  # fmt: skip


LOST = (  # in rounding
    "contact, spring of 1e-12", "catenary, pulled by 1e-12 of its weight",
    "girder, bars 1e+12 times as stiff from a knee on",
)  # fmt: skip


@pytest.mark.parametrize("case", [case for case in CASES if case.name in QUICK], ids=lambda case: case.name)
def test_some_cases(case):
    """A right answer, or a refusal that names its cause where one is expected."""
    outcome = extremes.run(case)
    refused = case.expected == "refused" or case.name in LOST
    assert outcome.verdict == ("refused" if refused else "right"), outcome


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_the_whole_catalogue():
    """No wrong answer, no hang, no crash; 95 % of the cases that have a solution reach the accuracy."""
    document = extremes.run_all(CASES)
    told = json.dumps([case for case in document["cases"] if case["verdict"] in extremes.BAD], indent=1)
    assert not any(document["counts"][verdict] for verdict in ("wrong", "hang", "crash")), told
    assert document["converged"] >= 0.95, told
