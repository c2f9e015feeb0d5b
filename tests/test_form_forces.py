"""Forms of given forces: closed forms, force densities as a second way, what no form bears, ranks, misuse."""

import json
import sys

import numpy as np
import petsc4py
import pytest

if __name__ == "__main__":  # a program on ranks, with its options
    petsc4py.init(sys.argv)

from petsc4py import PETSc

import latinpc
from latinpc.laws import Law
from latinpc.scenes import make

NONE = np.nan


def mast(foot=0.5, head=9.0, off=0.0):
    """Four guys to a head that a strut from `foot` holds, drawn `off` the axis."""
    nodes = np.array([[3.0, 0.0, 0.0], [0.0, 3.0, 0.0], [-3.0, 0.0, 0.0], [0.0, -3.0, 0.0], [0.0, 0.0, foot]])
    nodes = np.vstack([nodes, [off, 0.5 * off, head + off]])
    fixed = np.repeat(np.arange(6)[:, None] < 5, 3, axis=1)
    return {"nodes": nodes, "links": [[k, 5] for k in range(5)], "fixed": fixed}


def net(cells=8, rise=3.0, seed=0):
    """A net that hangs on its corners alone, two of which are high, and which links are its edges."""
    side = np.arange((cells + 1) ** 2)
    i, j = side // (cells + 1), side % (cells + 1)
    links = [(a, a + 1) for a in side if j[a] < cells] + [(a, a + cells + 1) for a in side if i[a] < cells]
    links = np.array(links)
    edges = ((i[links] % cells == 0).all(axis=1) & (np.diff(i[links]) == 0)[:, 0]) | (
        (j[links] % cells == 0).all(axis=1) & (np.diff(j[links]) == 0)[:, 0]
    )
    corners = (i % cells == 0) & (j % cells == 0)
    nodes = np.column_stack([i, j, rise * (corners & (i == j))]).astype(float)
    load = np.where(corners[:, None], 0.0, np.random.default_rng(seed).normal(size=nodes.shape) * 10.0)
    return {"nodes": nodes, "links": links, "fixed": np.repeat(corners[:, None], 3, axis=1), "load": load}, edges


def bisect(function, low, high):
    """Return where a decreasing or increasing function is zero."""
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if (function(middle) > 0.0) == (function(low) > 0.0) else (low, middle)
    return 0.5 * (low + high)


# ---- the mathematics -----------------------------------------------------------------------------------------
@pytest.mark.parametrize("EA", [None, 1e3, 1e7])
def test_two_cables_of_one_force(EA):
    """Hang a weight W by cables of force F: they rise by asin(W / 2F), however stiff they are."""
    given = {"nodes": [[-3, 0], [3, 0], [0.5, -1]], "links": [[0, 2], [1, 2]], "fixed": [[1, 1], [1, 1], [0, 0]]}
    form = latinpc.form_find(**given, force=80.0, load=[[0, 0], [0, 0], [0, -100.0]], EA=EA, error=1e-11)
    assert np.allclose(form.nodes[2], [0.0, -3.0 * np.tan(np.arcsin(100.0 / 160.0))], rtol=0.0, atol=1e-8)
    assert np.array_equal(form.tensions, [80.0, 80.0]) and form.unbalance < 1e-11


@pytest.mark.parametrize("off", [0.0, 0.3, -0.5])
def test_guys_of_a_force_beside_a_strut_of_a_length(off):
    """The strut shortens under 4 F sin a. Constant forces would let the mast fall; cut to length, guys hold it."""
    EA, length, F = 1e5, 8.5, 500.0
    given = mast(off=off) | {"law": ["cable"] * 4 + ["bar"], "EA": EA}
    form = latinpc.form_find(**given, force=[F] * 4 + [NONE], natural_length=length)
    height = bisect(lambda h: 4.0 * F * h / np.hypot(3.0, h) + EA * ((h - 0.5) / length - 1.0), 5.0, 9.5)
    assert np.allclose(form.nodes[5], [0.0, 0.0, height], rtol=0.0, atol=1e-7)
    assert np.array_equal(form.tensions[:4], [F] * 4) and form.natural_lengths[4] == length
    at_rest = form.structure.solve(error=1e-9)
    assert at_rest.converged and abs(at_rest.displacements).max() < 1e-7


def test_a_strut_of_a_force():
    """It lifts a net of force densities; the law of the strut is a bar."""
    given, _ = net()
    strut = len(given["nodes"])
    middle = (strut - 1) // 2
    given = {
        "nodes": np.vstack([given["nodes"], [4.0, 4.0, -3.0]]),
        "links": np.vstack([given["links"], [middle, strut]]),
        "fixed": np.vstack([given["fixed"], [True] * 3]),
    }
    q = np.append(np.full(len(given["links"]) - 1, 1e3), NONE)
    flat = latinpc.form_find(**given, density=np.append(q[:-1], -1e-6))
    form = latinpc.form_find(**given, density=q, force=np.append(np.full(len(q) - 1, NONE), -800.0), EA=1e6)
    assert form.nodes[middle, 2] > flat.nodes[middle, 2] + 0.1
    assert form.law[-1] == Law.BAR and form.tensions[-1] == -800.0 and form.unbalance < 1e-8
    assert np.allclose(form.densities[:-1], 1e3)


@pytest.mark.parametrize("seed", range(6))
def test_a_form_of_forces_is_that_of_its_force_densities(seed):
    """The linear system of Schek with the densities that were found has the same nodes."""
    rng = np.random.default_rng(seed)
    given, edges = net(seed=seed)
    q = 1000.0 * 2.0 ** rng.uniform(-1.0, 1.0, len(edges))
    force = np.where(edges, 1.5e4 * 2.0 ** rng.uniform(0.0, 1.0), NONE)
    form = latinpc.form_find(**given, density=np.where(edges, NONE, q), force=force, EA=[1e5, 1e7][seed % 2])
    assert np.allclose(form.tensions[edges], force[edges], rtol=1e-15)
    assert np.allclose(form.densities[~edges], q[~edges], rtol=1e-12)
    again = latinpc.form_find(**given, density=form.densities)
    assert np.allclose(again.nodes, form.nodes, rtol=0.0, atol=1e-6)


@pytest.mark.parametrize(
    ("name", "size"), [("mast", {}), ("bridge", {}), ("tower", {"stages": 4}), ("saddle", {"side": 10})]
)
@pytest.mark.parametrize("share", [0.3, 1.0])
def test_forces_of_a_structure_give_its_lengths(name, size, share):
    """Of what its cables bear under load, from the structure as drawn: natural lengths and displacements come back."""
    scene = make(name, **size)
    natural = scene.lengths - scene.initial_elongation
    known = latinpc.Structure.from_scene(scene)
    known.set_geometry("large")
    known = known.solve(error=1e-10)
    chosen = (scene.law == Law.CABLE) & (known.tensions > 0.0)
    chosen &= np.random.default_rng(5).random(len(chosen)) < share
    form = latinpc.form_find(
        scene.nodes, scene.links, scene.fixed, force=np.where(chosen, known.tensions, NONE), natural_length=natural,
        EA=scene.stiffness * natural, load=scene.load, law=scene.law, error=1e-9,
    )  # fmt: skip
    assert chosen.sum() > 3 and form.unbalance < 1e-9
    size = np.ptp(scene.nodes, axis=0).max()
    # constant forces hold nodes softly: an unbalance of 1e-9 moves them by much more
    assert np.allclose(form.nodes, scene.nodes + known.displacements, rtol=0.0, atol=1e-4 * size)
    assert np.allclose(form.natural_lengths, natural, rtol=5e-4)


def test_forces_precede_lengths_and_lengths_precede_densities():
    """A link has the first of the three that is given."""
    given = mast() | {"law": ["cable"] * 4 + ["bar"], "EA": 1e5}
    exact = latinpc.form_find(**given, force=[500.0] * 4 + [NONE], natural_length=[NONE] * 4 + [8.5])
    start = exact.densities * [2.0, 2.0, 2.0, 2.0, 1.0]
    form = latinpc.form_find(**given, force=[500.0] * 4 + [NONE], natural_length=8.5, density=start)
    assert np.allclose(form.nodes, exact.nodes, rtol=0.0, atol=1e-7)
    assert form.natural_lengths[4] == 8.5 and (form.natural_lengths[:4] != 8.5).all()


def test_no_force_is_no_force():
    """All nan: the form of natural lengths."""
    given = mast() | {"law": ["cable"] * 4 + ["bar"], "EA": 1e5, "natural_length": [9.3] * 4 + [8.5]}
    assert np.array_equal(latinpc.form_find(**given, force=NONE).nodes, latinpc.form_find(**given).nodes)


# ---- what no form bears --------------------------------------------------------------------------------------
def test_forces_that_nothing_balances_are_refused_by_name():
    """Equal guys against wind; cables that cannot lift a weight; one that outpulls two others."""
    given = mast() | {"law": ["cable"] * 4 + ["bar"], "EA": 1e6, "natural_length": 8.5}
    wind = np.where(np.arange(6)[:, None] == 5, [2000.0, 0.0, 0.0], 0.0)
    with pytest.raises(
        latinpc.SolveError, match=r"no stable form bears these forces.* link [0-4] bears .* (less|more) than its 500 N"
    ):
        latinpc.form_find(**given, force=[500.0] * 4 + [NONE], load=wind)
    given = {"nodes": [[-3, 0], [3, 0], [0, -1]], "links": [[0, 2], [1, 2]], "fixed": [[1, 1], [1, 1], [0, 0]]}
    with pytest.raises(latinpc.SolveError, match="no stable form bears these forces"):
        latinpc.form_find(**given, force=80.0, load=[[0, 0], [0, 0], [0, -200.0]])
    given = {"nodes": [[0, 0], [4, 0], [0, 3], [1, 1]], "links": [[0, 3], [1, 3], [2, 3]]}
    given |= {"fixed": [[1, 1]] * 3 + [[0, 0]]}
    assert latinpc.form_find(**given, force=1.0).unbalance < 1e-8  # the point of Fermat
    with pytest.raises((latinpc.SolveError, ValueError), match=r"no stable form bears|no length in the form"):
        latinpc.form_find(**given, force=[3.0, 1.0, 1.0])


def test_misuse_is_named():
    """Each link needs something, and something that it can bear."""
    given = mast()
    for wrong, said in (
        ({"force": [5.0] * 4 + [NONE]}, r"link 4 \(nan\) needs a nonzero force"),
        ({"force": [5.0] * 4 + [0.0]}, r"link 4 \(0.\) needs a nonzero force"),
        ({"force": [5.0] * 4 + [np.inf]}, r"link 4 \(inf\) needs a nonzero force"),
        ({"force": [5.0] * 4 + [NONE], "density": NONE}, r"link 4 \(nan\) has no density and no force"),
        ({"force": [5.0] * 4 + [NONE], "density": -2.0}, r"link 4 \(-2.\) has a force density that is not positive"),
        ({"force": [-5.0] * 5, "law": "cable"}, "have a force or a force density that their law cannot bear"),
        ({"force": [5.0] * 4 + [-90.0], "EA": 80.0}, "link 4 bears -90 N, and its EA is 80 N: no natural length"),
        ({"force": [5.0] * 4 + [NONE], "natural_length": 3.0}, "natural lengths need the axial stiffness"),
        ({"force": [1.0, 2.0]}, r"force must have the shape \(5,\)"),
    ):
        with pytest.raises(ValueError, match=said):
            latinpc.form_find(**given, **wrong)


# ---- ranks ---------------------------------------------------------------------------------------------------
def ranked():
    given, edges = net()
    return given | {"density": np.where(edges, NONE, 1e3), "force": np.where(edges, 2e4, NONE), "EA": 1e6}


@pytest.mark.parametrize("ranks", [2, pytest.param(4, marks=pytest.mark.slow)])
def test_ranks_change_nothing(mpirun, ranks):
    found = json.loads(mpirun(ranks, __file__).stdout.splitlines()[-1])
    assert np.allclose(found, latinpc.form_find(**ranked()).nodes, rtol=0.0, atol=1e-6)


if __name__ == "__main__":
    nodes = latinpc.form_find(**ranked()).nodes.tolist()
    if PETSc.COMM_WORLD.rank == 0:
        print(json.dumps(nodes), flush=True)
