"""Laws of links that turn: tables, compression only, cables that cannot stretch; closed forms, and what is refused."""

import json
import sys

import numpy as np
import pytest
import turning
from petsc4py import PETSc
from scipy.optimize import brentq, root
from turning import hanging, net, solve, von_mises

import latinpc

RIGID = {"law": "inextensible", "stiffness": 0.0}


def slack_net(rise=1.0, load=(5.0, 2.0, -300.0), slack=0.03, cells=8):
    """A net of cables, 0.5 to 1.5 times `slack` longer than drawn, without law and stiffness; and its lengths."""
    made = net(cells, rise, list(load))
    length = np.linalg.norm(np.diff(made["nodes"][made["links"]], axis=1)[:, 0], axis=1)
    more = slack * length * np.random.default_rng(0).uniform(0.5, 1.5, len(length))
    return {k: made[k] for k in ("nodes", "links", "fixed", "load")} | {"initial_elongation": -more}, length


def check(structure, result, digits=1e-8):
    """Lengths, signs, complementarity, and balance of the free nodes."""
    nodes, links = np.asarray(structure["nodes"], float), np.asarray(structure["links"])
    drawn = np.linalg.norm(nodes[links[:, 1]] - nodes[links[:, 0]], axis=1)
    moved = nodes + result.displacements
    r = moved[links[:, 1]] - moved[links[:, 0]]
    size, t = np.linalg.norm(r, axis=1), result.tensions
    gap = drawn - structure.get("initial_elongation", 0.0) - size
    assert gap.min() > -digits * drawn.max()
    assert t.min() >= 0.0
    assert np.abs(gap * t).max() < digits * drawn.max() * t.max()
    left = np.array(structure["load"], float)
    np.add.at(left, links[:, 0], (t / size)[:, None] * r)
    np.add.at(left, links[:, 1], -(t / size)[:, None] * r)
    assert np.abs(left[~np.asarray(structure["fixed"], bool)]).max() < digits * t.max()


# ---- cables that cannot stretch ---------------------------------------------------------------------
@pytest.mark.parametrize("links", [2, 5, 20, 60])
def test_hanging_chain(links):
    """Of equal links under equal weights: each link is along the force that it bears."""
    structure, exact = turning.catenary(links, EA=np.inf)
    result = solve(structure | RIGID, error=1e-10)
    assert result.converged
    assert np.linalg.norm(result.displacements - exact) < 1e-9 * np.linalg.norm(exact)


@pytest.mark.parametrize("seed", range(5))
def test_any_hanging_chain(seed):
    """Random lengths and weights, supports of different height: the first angle and the thrust by scipy."""
    rng = np.random.default_rng(seed)
    links = 8
    length, weight = rng.uniform(0.5, 1.5, links), rng.uniform(1.0, 10.0, links - 1)
    end = np.array([0.8 * length.sum() * np.cos(0.3 * seed), -0.8 * length.sum() * np.sin(0.3 * seed)])

    def angles(unknown):
        return np.arctan(np.append(0.0, np.cumsum(weight)) / np.exp(unknown[1]) + np.tan(unknown[0]))

    def miss(unknown):
        return [length @ np.cos(angles(unknown)) - end[0], length @ np.sin(angles(unknown)) - end[1]]

    found = root(miss, [-1.0, np.log(weight.sum())], tol=1e-13)
    assert found.success
    angle, thrust = angles(found.x), np.exp(found.x[1])
    exact = np.concatenate(
        [[[0.0, 0.0]], np.cumsum(length[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]), axis=0)]
    )
    nodes = np.linspace([0.0, 0.0], end, links + 1)
    structure = hanging(nodes, [[k, k + 1] for k in range(links)], length, [0, links], -weight) | RIGID
    result = solve(structure, error=1e-10)
    assert result.converged
    assert np.abs(nodes + result.displacements - exact).max() < 1e-8
    check(structure, result)
    assert result.tensions * np.cos(angle) == pytest.approx(thrust, rel=1e-7)


def test_pendulum_at_rest():
    """Drawn level: it comes to rest along the force, from anywhere."""
    structure = {"nodes": [[0.0, 0.0], [1.0, 0.0]], "links": [[0, 1]], "fixed": [[True, True], [False, False]]}
    structure |= {"load": [[0.0, 0.0], [3.0, -4.0]]} | RIGID
    result = solve(structure, error=1e-11)
    assert result.converged
    assert result.displacements[1] == pytest.approx([-0.4, -0.8], abs=1e-10)
    assert result.tensions[0] == pytest.approx(5.0, rel=1e-10)


def test_a_weight_on_two_cables():
    """Where the circles around the supports meet."""
    a, b, apart, weight = 2.0, 1.5, 2.5, 7.0
    x = (a**2 - b**2 + apart**2) / (2.0 * apart)
    z = -np.sqrt(a**2 - x**2)
    nodes = np.array([[0.0, 0.0], [apart, 0.0], [1.0, -0.1]])
    structure = hanging(nodes, [[0, 2], [1, 2]], [a, b], [0, 1], [-weight]) | RIGID
    result = solve(structure, error=1e-11)
    assert result.converged
    assert nodes[2] + result.displacements[2] == pytest.approx([x, z], abs=1e-10)
    tensions = np.linalg.solve([[x / a, (x - apart) / b], [z / a, z / b]], [0.0, -weight])
    assert result.tensions == pytest.approx(tensions, rel=1e-10)


def test_one_of_two_cables_is_slack():
    """The weight hangs below one support, on the shorter cable alone."""
    nodes = np.array([[0.0, 0.0], [1.0, 0.0], [0.3, -0.5]])
    result = solve(hanging(nodes, [[0, 2], [1, 2]], [1.0, 3.0], [0, 1], [-2.0]) | RIGID, error=1e-10)
    assert result.converged
    assert nodes[2] + result.displacements[2] == pytest.approx([0.0, -1.0], abs=1e-9)
    assert result.tensions == pytest.approx([2.0, 0.0], abs=1e-9)


@pytest.mark.parametrize("shape", [(1.0, -300.0, 0.03), (0.0, -300.0, 0.03), (2.0, -50.0, 0.01)])
def test_nets_are_the_limit_of_stiff_cables(shape):
    """The difference falls as one over the stiffness; many cables are slack."""
    rise, load, slack = shape
    structure, length = slack_net(rise, (5.0, 2.0, load), slack)
    result = solve(structure | RIGID, error=1e-8)
    assert result.converged
    assert 0 < np.count_nonzero(result.tensions == 0.0) < len(length)
    check(structure, result, 1e-6)
    far = []
    for EA in (1e5, 1e6, 1e7):
        stiff = solve(structure | {"law": "cable", "stiffness": EA / length}, error=1e-8).displacements
        far.append(np.linalg.norm(stiff - result.displacements) / np.linalg.norm(result.displacements))
    assert far[2] < 0.2 * far[1] < 0.1 * far[0]


def test_a_mast_between_guys():
    """Bars and cables that cannot stretch: the guy to windward keeps its length, the other one is slack."""
    structure = {"nodes": [[0.0, 0.0], [0.0, 3.0], [-2.0, 0.0], [2.0, 0.0]], "links": [[0, 1], [1, 2], [1, 3]]}
    structure |= {"law": ["bar", "inextensible", "inextensible"], "stiffness": [1e5, 0.0, 0.0]}
    structure |= {"fixed": np.arange(4)[:, None] != [1, 1], "load": [[0.0, 0.0], [10.0, -5.0], [0.0, 0.0], [0.0, 0.0]]}
    result = solve(structure, error=1e-10)
    assert result.converged
    x, y = result.displacements[1] + [0.0, 3.0]
    assert np.hypot(x + 2.0, y) == pytest.approx(np.sqrt(13.0), rel=1e-10)
    assert result.tensions[0] == pytest.approx(1e5 * (np.hypot(x, y) - 3.0), rel=1e-5)
    assert result.tensions[2] == 0.0


@pytest.mark.parametrize("variant", ["primal", "macro", "corner", "none", "published", "auto"])
def test_variants_change_nothing(variant):
    """Nor do the subdomains."""
    structure, _ = slack_net()
    exact = solve(structure | RIGID, error=1e-9).displacements
    result = solve(structure | RIGID, error=1e-7, variant=variant, subdomains=4)
    assert result.converged
    assert np.linalg.norm(result.displacements - exact) < 1e-6 * np.linalg.norm(exact)


@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_ranks_change_nothing(mpirun, ranks):
    """The same displacements and tensions on any number of ranks."""
    found = json.loads(mpirun(ranks, __file__).stdout)
    structure, _ = slack_net()
    exact = solve(structure | RIGID, error=1e-9)
    assert found["reason"] > 0
    assert found["norm"] == pytest.approx(np.linalg.norm(exact.displacements), rel=1e-7)
    assert found["tension"] == pytest.approx(exact.tensions.max(), rel=1e-6)


@pytest.mark.parametrize("options", [{"newton": "never", "error": 1e-5}, {"stol": 1e-9}, {"stop": "residual"}])
def test_other_stops(options):
    """The iteration alone, its indicator, the unbalance."""
    structure, exact = turning.catenary(5, EA=np.inf)
    result = solve(structure | RIGID, **options)
    assert result.converged
    assert np.linalg.norm(result.displacements - exact) < 1e-4 * np.linalg.norm(exact)


def test_the_next_load_starts_from_the_last_tensions():
    """One solver for a series of loads; tensions are those of its last solve."""
    structure, exact = turning.catenary(10, EA=np.inf)
    s = latinpc.Structure(**structure | RIGID, geometry="large")
    snes, u = s.create_snes(), s.create_vec()
    snes.setTolerances(stol=1e-10)
    for scale in (1.0, 3.0, 3.0):
        s.set_load(scale * structure["load"])
        snes.solve(None, u)
        assert snes.getConvergedReason() > 0
        assert np.abs(s.displacements(u) - exact).max() < 1e-7  # a chain of links has the same shape under any weight
    assert latinpc.tensions(snes)[0] > 300.0


def test_cables_between_supports_bear_nothing():
    """As long as drawn, along the rim of a net: any tension there is balanced by supports."""
    structure, length = slack_net(cells=4)
    exact = solve(structure | RIGID, error=1e-9)
    rim = np.flatnonzero(structure["fixed"][:, 0])
    links = np.concatenate([structure["links"], np.column_stack([rim[:-1], rim[1:]])])
    longer = np.append(structure["initial_elongation"], np.zeros(len(rim) - 1))
    result = solve(structure | RIGID | {"links": links, "initial_elongation": longer}, error=1e-9)
    assert result.converged
    assert np.abs(result.tensions[len(length) :]).max() < 1e-9 * exact.tensions.max()
    assert result.tensions[: len(length)] == pytest.approx(exact.tensions, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("weight", [0.0, *(2.0 * (1.0 + 1e-13 * np.arange(20)))])
def test_a_node_that_one_cable_holds(weight):
    """It hangs below the net, or anywhere near enough. On its way it may meet the node that it hangs from."""
    structure, length = slack_net(cells=4)
    loose, free = len(structure["nodes"]), np.flatnonzero(~structure["fixed"][:, 0])[0]
    more = {"nodes": structure["nodes"][free] + [0.0, 0.0, 1.0], "links": [free, loose], "fixed": [False] * 3}
    more |= {"load": [0.0, 0.0, -weight], "initial_elongation": 0.0}
    made = {key: np.concatenate([structure[key], [value]]) for key, value in more.items()}
    result = solve(made | RIGID, error=1e-9)
    assert result.converged
    r = (made["nodes"] + result.displacements)[loose] - (made["nodes"] + result.displacements)[free]
    assert np.linalg.norm(r) < 1.0 + 1e-8
    assert result.tensions[-1] == pytest.approx(weight, rel=1e-7, abs=1e-9)
    if weight:
        assert r == pytest.approx([0.0, 0.0, -1.0], abs=1e-7)


def test_what_has_no_equilibrium():
    """A part that nothing holds is named; cables as long as drawn on a saddle leave no room, whatever they bear."""
    structure, _ = slack_net(cells=4)
    n = len(structure["nodes"])
    more = {"nodes": [[0.0, 0.0, 9.0], [1.0, 0.0, 9.0]], "links": [[n, n + 1]], "fixed": [[False] * 3] * 2}
    more |= {"load": [[0.0, 0.0, -1.0]] * 2, "initial_elongation": [0.0]}
    with pytest.raises(PETSc.Error) as error:
        solve({key: np.concatenate([structure[key], value]) for key, value in more.items()} | RIGID)
    assert f"Nodes that move (counted from 0): {n}, {n + 1}." in latinpc.error_message(error.value)
    uneven = np.random.default_rng(0).uniform(0.5, 1.5, (n, 1)) * structure["load"]
    for load, converges in ((structure["load"], True), (uneven, False)):  # of equal weights parabolas are the shape
        result = solve(structure | RIGID | {"initial_elongation": 0.0, "load": load})
        assert result.converged == converges
    assert result.reason == PETSc.SNES.ConvergedReason.DIVERGED_DTOL


def test_prescribed_displacements_pull_a_chain():
    """A support that moves: changes are seen by the next solve."""
    nodes = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])
    structure = hanging(nodes, [[0, 1], [1, 2]], [1.2, 1.2], [0, 2], [-1.0]) | RIGID
    s = latinpc.Structure(**structure, geometry="large")
    snes, u = s.create_snes(), s.create_vec()
    snes.setTolerances(stol=1e-11)
    for moved in (0.0, 0.2):
        s.set_prescribed([[0.0, 0.0], [0.0, 0.0], [moved, 0.0]])
        snes.solve(None, u)
        half = 1.0 + 0.5 * moved
        assert (nodes + s.displacements(u))[1] == pytest.approx([half, -np.sqrt(1.44 - half**2)], abs=1e-8)


def test_a_chain_that_is_too_short():
    """Of free nodes it ends without convergence; between prescribed ones it is named."""
    structure, _ = turning.catenary(5, EA=np.inf)
    result = solve(structure | RIGID | {"initial_elongation": 0.05})
    assert result.reason == PETSc.SNES.ConvergedReason.DIVERGED_DTOL
    held = {"nodes": [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], "links": [[0, 1], [1, 2]]}
    held |= {"fixed": [[True] * 2, [True] * 2, [False] * 2], "load": [[0.0, 0.0], [0.0, 0.0], [0.0, 1.0]]} | RIGID
    with pytest.raises(PETSc.Error) as error:
        solve(held | {"prescribed": [[0.0, 0.0], [0.6, 0.9], [0.0, 0.0]]})
    assert "they miss its gap by 0.83575" in latinpc.error_message(error.value)


# ---- contacts, and other links that keep their direction ------------------------------------------------
def on_a_floor(law, stiffness, count=10, floor=0.8, cable=1e4):
    """A chain of cables under weights of 10 N, and a floor below it, whose normal is up whatever the chain does."""
    x = np.linspace(0.0, 4.0, count + 1)
    nodes = np.concatenate([np.column_stack([x, 0.0 * x]), np.column_stack([x[1:-1] + 0.3, 0.0 * x[1:-1] - floor])])
    links = [[k, k + 1] for k in range(count)] + [[count + k, k] for k in range(1, count)]
    structure = hanging(nodes, links, 1.0, [0, *range(count, 2 * count)], -10.0)
    structure["initial_elongation"] = np.append(np.full(count, 4.0 / count - 0.45), np.full(count - 1, floor))
    structure["law"] = ["cable" if cable else "inextensible"] * count + [law] * (count - 1)
    structure["stiffness"] = np.append(np.full(count, cable), np.full(count - 1, stiffness))
    return structure | {"direction": np.array([[0.0, 0.0]] * count + [[0.0, 1.0]] * (count - 1))}


def grain():
    """A grain with friction on a support."""
    structure = {"nodes": [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]], "links": [[0, 1]] * 3, "direction": np.eye(3)[[2, 0, 1]]}
    structure |= {"fixed": [[True] * 3, [False] * 3], "load": [[0.0] * 3, [0.0, 0.0, -1.0]], "initial_elongation": 0.0}
    return structure | {"friction": 0.5}


@pytest.mark.parametrize("cable", [1e4, 0.0])
@pytest.mark.parametrize("variant", ["auto", "macro", "corner", "none"])
def test_a_chain_lies_on_a_floor(cable, variant):
    """Gaps, signs, complementarity, balance; the middle bears its weight. Cables that stretch, and do not."""
    structure, count = on_a_floor("contact", 0.0, cable=cable), 10
    result = solve(structure, error=1e-10, variant=variant, subdomains=3)
    assert result.converged
    moved, t = structure["nodes"] + result.displacements, result.tensions
    gap = moved[1:count, 1] + 0.8
    assert gap.min() > -1e-9 and t[count:].max() <= 0.0
    assert np.abs(gap * t[count:]).max() < 1e-8
    assert np.count_nonzero(t[count:]) == 3
    assert t[count + 4] == pytest.approx(-10.0, rel=1e-8)
    r = np.diff(moved[: count + 1], axis=0)
    force = t[:count, None] * r / np.linalg.norm(r, axis=1)[:, None]
    left = np.diff(force, axis=0) + structure["load"][1:count]
    left[:, 1] -= t[count:]
    assert np.abs(left).max() < 1e-7
    length = 0.45 + (t[:count] / cable if cable else 0.0)
    assert np.linalg.norm(r, axis=1) == pytest.approx(length, rel=1e-8)


@pytest.mark.parametrize("newton", [1.0, 1e3])
@pytest.mark.parametrize("longer", [0.01, 0.05, 0.3])
@pytest.mark.parametrize("floor", ["contact", "compression_only"])
def test_a_net_lies_on_the_floor_with_all_its_cables_slack(longer, newton, floor):
    """Of elastic and inextensible cables: the floor alone bears the loads, each node sinks by its gap and its give."""
    rng, soft = np.random.default_rng(0), 10.0 * newton if floor == "compression_only" else 0.0
    above, gap = net(10, 0.0, [0.0, 0.0, -0.01 * newton]), 0.3 * longer
    free = np.flatnonzero(~above["fixed"][:, 0])
    count, cables = len(free), len(above["links"])
    below = above["nodes"][free] - [0.3, 0.0, 1.0]
    elastic = rng.random(cables) < 0.4
    structure = {
        "nodes": np.concatenate([above["nodes"], below]),
        "links": np.concatenate([above["links"], np.column_stack([len(above["nodes"]) + np.arange(count), free])]),
        "law": [*np.where(elastic, "cable", "inextensible"), *[floor] * count],
        "stiffness": np.append(np.where(elastic, 5e3 * newton, 0.0), np.full(count, soft)),
        "initial_elongation": np.append(-longer * rng.uniform(1.0, 2.0, cables), np.full(count, gap)),
        "fixed": np.concatenate([above["fixed"], np.ones((count, 3), bool)]),
        "load": np.concatenate([above["load"], np.zeros((count, 3))]),
        "direction": np.repeat([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]], [cables, count], axis=0),
    }
    result = solve(structure)
    assert result.converged
    assert result.displacements[free, 2] == pytest.approx(-gap - (1e-3 if soft else 0.0), abs=1e-4)


def test_springs_bear_what_slack_cables_that_do_not_stretch_leave():
    """Each node sinks by its weight over its spring, and few linear stages show it."""
    above = net(10, 0.0, [0.0, 0.0, -1.0])
    free = np.flatnonzero(~above["fixed"][:, 0])
    count, cables = len(free), len(above["links"])
    structure = {
        "nodes": np.concatenate([above["nodes"], above["nodes"][free] - [0.3, 0.0, 1.0]]),
        "links": np.concatenate([above["links"], np.column_stack([len(above["nodes"]) + np.arange(count), free])]),
        "law": ["inextensible"] * cables + ["bar"] * count,
        "stiffness": np.repeat([0.0, 1e3], [cables, count]),
        "initial_elongation": np.repeat([-0.05, 0.0], [cables, count]),
        "fixed": np.concatenate([above["fixed"], np.ones((count, 3), bool)]),
        "load": np.concatenate([above["load"], np.zeros((count, 3))]),
        "direction": np.repeat([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]], [cables, count], axis=0),
    }
    result = latinpc.Structure(**structure, geometry="large").solve()
    assert result.converged and result.iterations < 200
    assert result.displacements[free, 2] == pytest.approx(-1e-3, rel=1e-3)


@pytest.mark.parametrize("EA", [1e4, np.inf])
@pytest.mark.parametrize("law", ["contact", "compression_only"])
@pytest.mark.parametrize("below", [2.0, 100.0])
def test_a_floor_that_nothing_touches_changes_nothing(EA, law, below):
    """Whatever it is made of, and however far it is below the chain."""
    chain, exact = turning.catenary(20, EA=EA)
    held = chain["fixed"][:, 0]
    free, stiffness = np.flatnonzero(~held), np.full(20, 0.0 if np.isinf(EA) else chain["stiffness"])
    structure = {
        "nodes": np.concatenate([chain["nodes"], chain["nodes"][free]]),
        "links": np.concatenate([chain["links"], np.column_stack([21 + np.arange(19), free])]),
        "law": ["inextensible" if np.isinf(EA) else "cable"] * 20 + [law] * 19,
        "stiffness": np.append(stiffness, np.full(19, 0.0 if law == "contact" else 1e3)),
        "initial_elongation": np.append(np.full(20, chain["initial_elongation"]), np.full(19, below)),
        "fixed": np.concatenate([chain["fixed"], np.ones((19, 2), bool)]),
        "load": np.concatenate([chain["load"], np.zeros((19, 2))]),
        "direction": np.repeat([[0.0, 0.0], [0.0, 1.0]], [20, 19], axis=0),
    }
    result = solve(structure, error=1e-8)
    assert result.converged
    assert result.displacements[:21] == pytest.approx(exact, abs=1e-7)
    assert not result.tensions[20:].any()


def test_a_stiff_floor_is_the_limit():
    """The difference falls as one over the stiffness."""
    exact, far = solve(on_a_floor("contact", 0.0), error=1e-10).displacements, []
    for stiffness in (1e4, 1e5, 1e6):
        result = solve(on_a_floor("compression_only", stiffness), error=1e-10)
        assert result.converged
        far.append(np.linalg.norm(result.displacements - exact))
    assert far[1] == pytest.approx(0.1 * far[0], rel=0.05) and far[2] == pytest.approx(0.1 * far[1], rel=0.05)


def test_a_spring_keeps_its_direction():
    """A mass on a bar that turns, and a spring along x to the ground: angles by scipy."""
    nodes = np.array([[0.0, 0.0], [0.0, -1.0], [5.0, 1.0]])
    structure = {"nodes": nodes, "links": [[0, 1], [2, 1]], "law": "bar", "stiffness": [1e3, 20.0]}
    structure |= {"direction": [[0.0, 0.0], [1.0, 0.0]], "fixed": [[True, True], [False, False], [True, True]]}
    structure["load"] = [[0.0, 0.0], [30.0, -10.0], [0.0, 0.0]]
    result = solve(structure, error=1e-12)

    def left(x):
        size = np.linalg.norm(x)
        return 1e3 * (size - 1.0) / size * x + [20.0 * x[0] - 30.0, 10.0]

    assert result.converged
    assert (nodes + result.displacements)[1] == pytest.approx(root(left, [0.8, -0.6], tol=1e-14).x, abs=1e-10)


# ---- other laws -----------------------------------------------------------------------------------------
def test_a_table_of_two_slopes_holds_a_weight():
    """A cable that yields: slack, elastic, and soft from the yield force on."""
    law = latinpc.register_table([-1.0, 0.0, 0.01, 1.0], [0.0, 0.0, 100.0, 199.0], "yielding cable")
    nodes = np.array([[-1.0, 0.0], [1.0, 0.0], [0.0, -0.2]])
    structure = hanging(nodes, [[0, 2], [1, 2]], [1.0, 1.0], [0, 1], [-90.0]) | {"law": law, "stiffness": 1e4}
    result = solve(structure, error=1e-11)

    def unbalance(z):
        size = np.hypot(1.0, z)
        x = size - 1.0
        return 2.0 * (1e4 * x if x < 0.01 else 100.0 + 100.0 * (x - 0.01)) * z / size - 90.0

    z = brentq(unbalance, 0.01, 3.0, xtol=1e-15)
    assert result.converged
    assert np.hypot(1.0, z) - 1.0 > 0.02  # beyond yield
    assert result.displacements[2] == pytest.approx([0.0, 0.2 - z], abs=1e-9)


def test_a_table_may_be_a_cable():
    """Two segments, and the same displacements as the law."""
    structure = net(10, 2.0, [0.0, 0.0, -500.0])
    stiffness = structure["stiffness"].mean()
    law = latinpc.register_table([-1.0, 0.0, 1.0], [0.0, 0.0, stiffness], "cable of a table")
    prestress = {"initial_elongation": structure.pop("prestress") / stiffness}
    plain = solve(structure | prestress | {"stiffness": stiffness}, error=1e-9)
    table = solve(structure | prestress | {"stiffness": stiffness, "law": law}, error=1e-9)
    assert plain.converged and table.converged
    assert np.count_nonzero(plain.tensions <= 0.0) > 0
    assert np.linalg.norm(table.displacements - plain.displacements) < 1e-8 * np.linalg.norm(plain.displacements)


@pytest.mark.parametrize("apart", [0.0, 1e-6, 0.3])
def test_a_node_on_a_floor_at_its_own_place(apart):
    """A contact whose nodes are drawn at one place: no length for coordinates to be rounded by."""
    structure = {"nodes": [[0.0, 0.0], [1.0, 0.0], [1.0, -apart]], "links": [[0, 1], [2, 1]], "law": ["bar", "contact"]}
    structure |= {
        "stiffness": [10.0, 0.0],
        "direction": [[0.0, 0.0], [0.0, 1.0]],
        "load": [[0, 0], [1.0, -50.0], [0, 0]],
    }
    result = solve(structure | {"fixed": [[True, True], [False, False], [True, True]]}, error=1e-10)
    assert result.converged
    assert result.displacements[1] == pytest.approx([0.1, 0.0], abs=1e-9)
    assert result.tensions == pytest.approx([1.0, -50.0], rel=1e-9)


@pytest.mark.parametrize("part", [0.5, 0.95])
def test_links_in_compression_only_lean_on_each_other(part):
    """The von Mises truss before its limit point."""
    load = part * turning.von_mises_limit()
    result = solve(von_mises(load) | {"law": "compression_only"}, error=1e-11)
    assert result.converged
    assert -result.displacements[2, 1] == pytest.approx(turning.von_mises_deflection(load), rel=1e-9)


def test_what_is_refused():
    """Friction; small angles take elastic laws; a reference does not show multipliers."""
    structure, _ = slack_net(cells=4)
    for law, geometry in (("friction", "large"), ("inextensible", "prestress")):
        laws = [law, "tangent", "tangent"] if law == "friction" else law
        made = grain() if law == "friction" else structure
        with pytest.raises(PETSc.Error) as error:
            latinpc.Structure(**made | RIGID | {"law": laws}, geometry=geometry)
        assert f"Geometry {geometry} does not take links of the law {law}" in latinpc.error_message(error.value)
    with pytest.raises(PETSc.Error) as error:
        solve(structure | RIGID, reference=np.zeros(structure["nodes"].shape), stop="reference")
    assert "take the stop error" in latinpc.error_message(error.value)


if __name__ == "__main__":
    structure, _ = slack_net()
    result = solve(structure | RIGID, error=1e-9, subdomains=4)
    if PETSc.COMM_WORLD.rank == 0:
        size = {"norm": np.linalg.norm(result.displacements), "tension": result.tensions.max()}
        print(json.dumps({"reason": int(result.reason), **size}))
    sys.exit(0)
