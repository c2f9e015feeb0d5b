"""Random structures of cables as they are built: their generators, what their judge adds, and the rates of some."""

import json
from collections import Counter

import numpy as np
import pytest
from petsc4py import PETSc
from test_cli import latinpc as command

from latinpc.bench.extremes import cables, drawn, rates
from latinpc.bench.extremes import turning as judging
from latinpc.bench.extremes.assembly import Assembly
from latinpc.bench.extremes.corotational import Corotational
from latinpc.scenes import Law, Scene

pytestmark = pytest.mark.skipif(np.finfo(PETSc.RealType).eps > 1e-10, reason="the rates are those of double precision")


# ---- generators ----------------------------------------------------------------------------------
@pytest.mark.parametrize("kind", cables.KINDS)
def test_generators(kind):
    """The same numbers make the same structure; nodes are apart, each has links."""
    for number in range(8):
        one, two = (cables.KINDS[kind](np.random.default_rng([3, number])) for _ in range(2))
        for name in ("nodes", "links", "stiffness", "initial_elongation", "fixed", "load"):
            assert (getattr(one, name) == getattr(two, name)).all()
        assert (np.linalg.norm(one.nodes[one.links[:, 1]] - one.nodes[one.links[:, 0]], axis=1) > 1e-3).all()
        assert set(np.flatnonzero(~one.fixed.all(axis=1))) <= set(one.links.ravel())
        assert np.count_nonzero(one.law == Law.CABLE) >= 2 and len(one.nodes) <= 100


@pytest.mark.parametrize(
    "kind", ["suspension", "footbridge", "ropeway", "wheel", "girder", "tent", "facade", "chimney"]
)
def test_tensions_as_drawn_balance_the_weights(kind, monkeypatch):
    monkeypatch.setattr(Assembly, "_live", lambda self, nodes, held: 0.0)
    for number in range(4):
        scene = cables.KINDS[kind](np.random.default_rng([4, number]))
        left = Corotational(scene).unbalance(np.zeros(scene.nodes.shape, np.longdouble))
        assert np.abs(left).max() < 1e-12 * np.abs(scene.prestress).max()


def test_the_form_of_a_chain_is_that_of_its_weights():
    """A parabola: equal weights at equal distances, with one horizontal force."""
    a = Assembly(np.random.default_rng(0))
    nodes = [a.node(x, 0.0, held=abs(x) == 1.0, weight=0.1) for x in np.linspace(-1.0, 1.0, 9)]
    a.chain(nodes, a.cable, 2.0)
    a.form()
    x, z = np.array(a.places).T
    assert x == pytest.approx(np.linspace(-1.0, 1.0, 9), abs=1e-14)
    assert z == pytest.approx(0.1 / (2 * 2.0 * 0.25) * (x**2 - 1.0), abs=1e-14)


def test_the_family():
    """The same numbers make the same structure; many kinds appear, some move far, some cables slacken."""
    seen, deflections, slack = set(), [], []
    for number in range(8):
        one = drawn.draw(4, number, "cables")
        seen.add(one.topology)
        if number < 3:
            assert (drawn.draw(4, number, "cables").scene.load == one.scene.load).all()
        equations = Corotational(one.scene)
        path = equations.follow()
        tension = equations.state(path.displacements.astype(np.longdouble))[2]
        deflections.append(np.linalg.norm(path.displacements, axis=1).max() / equations.size)
        slack.append(np.mean(tension[one.scene.law == Law.CABLE] == 0.0))
    assert len(seen) > 6
    assert max(deflections) > 0.05
    assert np.mean(np.array(slack) > 0.02) > 0.15


# ---- the judge -----------------------------------------------------------------------------------
def rope(load, prestress):
    """Two cables in a row between supports, a third one, slack, to a node that nothing else holds."""
    return Scene(
        name="rope", nodes=[[0, 0], [1, 0], [2, 0], [1, -1]], links=[[0, 1], [1, 2], [1, 3]], law="cable",
        stiffness=1e3, initial_elongation=[prestress, prestress, -0.1],
        fixed=np.repeat([[True], [False], [True], [False]], 2, axis=1), load=[[0, 0], [0, load], [0, 0], [0, 0]],
        geometry="large",
    )  # fmt: skip


@pytest.mark.parametrize("prestress", [0.01, 0.0])
def test_a_node_between_slack_cables_stays_and_does_not_count(prestress):
    """Against the closed form of the node that bears; the judge finds a wrong answer."""
    scene = rope(-5.0, prestress)
    path = Corotational(scene).follow()
    assert path.factor == 1.0 and path.first == (0.0 if prestress else 1.0)
    sag = -path.displacements[1, 1]
    length = np.hypot(1.0, sag)
    assert 2e3 * (length - 1.0 + prestress) * sag / length == pytest.approx(5.0, rel=1e-12)
    assert judging.judge(scene, path.displacements)["verdict"] == "right"
    wrong = path.displacements.copy()
    wrong[1, 1] *= 1 + 1e-6
    assert judging.judge(scene, wrong)["why"] == "unbalanced forces"


def test_a_mechanism_without_loads_is_nowhere_at_rest():
    assert Corotational(rope(-5.0, 0.0)).rest(np.zeros((4, 2)), 0.0) is None


# ---- the rates -----------------------------------------------------------------------------------
def test_rates_of_twenty(tmp_path):
    """None is wrong; all that have an equilibrium on the path are found."""
    file = tmp_path / "rates.json"
    result = command("extremes", "--random", "20", "--seed", "5", "--family", "cables", "--json", file, timeout=300)
    counts = Counter(one["verdict"] for one in json.loads(file.read_text())["outcomes"])
    assert not set(counts) & set(rates.BAD), result.stdout
    assert counts["right"] == 20 - counts["refused"] - counts["rounding"]


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_rates_of_a_hundred(seed):
    document = rates.run(100, seed, family="cables")
    counts = Counter(one["verdict"] for one in document["outcomes"])
    assert not set(counts) & set(rates.BAD), rates.layout(document)[1]
    assert counts["right"] >= 0.95 * (100 - counts["refused"] - counts["rounding"])
