"""Eigenvalues: none of the lowest is missing, and none is taken for zero that is not; what is taut in the stiffness."""

import json

import numpy as np
import pytest
from petsc4py import PETSc

import latinpc
from latinpc.results.modes import tangent

pytest.importorskip("slepc4py")
pytestmark = pytest.mark.filterwarnings("ignore::latinpc.LatinWarning")


def grid(cells, inside):
    """A cube of bars along edges and diagonals of faces, with all of its faces held, or its base."""
    nodes = np.stack(np.meshgrid(*[np.arange(cells + 1.0)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    apart = np.linalg.norm(nodes[:, None] - nodes, axis=2)
    held = ((nodes == 0.0) | (nodes == cells)).any(axis=1) if inside else nodes[:, 2] == 0.0
    links = np.column_stack(np.nonzero(np.triu((apart > 0.0) & (apart < 1.5))))
    fixed = np.repeat(held[:, None], 3, axis=1)
    load = np.where(nodes[:, 2:] == cells, [0.0, 0.0, -1.0], 0.0)
    return {"nodes": nodes, "links": links, "law": "bar", "EA": 1e4, "fixed": fixed, "load": load, "mass": 1.0}


@pytest.mark.parametrize("copies", [1, 5])
def test_repeated_frequencies_are_all_there(copies):
    """Three directions of a cube, and copies of it beside each other: each value three or fifteen times."""
    cube = grid(4, inside=True)
    many = {key: np.concatenate([cube[key]] * copies) for key in ("nodes", "fixed")}
    many["nodes"] = many["nodes"] + np.repeat(np.arange(copies), len(cube["nodes"]))[:, None] * [9.0, 0.0, 0.0]
    many["links"] = np.vstack([cube["links"] + copy * len(cube["nodes"]) for copy in range(copies)])
    s = latinpc.Structure(**cube | many | {"load": 0.0})
    exact = np.linalg.eigvalsh(tangent(s, s.prescribed).convert("dense").getDenseArray())
    for number in (1, 2, 4, 7, 20):
        found = latinpc.modes(s, number)
        assert found.complete and np.allclose(found.values, exact[:number], rtol=1e-10)


@pytest.mark.parametrize("ranks", [2, 3])
def test_repeated_frequencies_on_ranks(mpirun, ranks):
    """Their factor counts the pivots of all ranks."""
    found = json.loads(mpirun(ranks, __file__).stdout)
    assert np.allclose(found["values"], latinpc.modes(latinpc.Structure(**grid(4, inside=True)), 5).values)
    assert found["complete"] and found["values"][2] == pytest.approx(found["values"][0], rel=1e-9)


def test_modes_that_slepc_does_not_find_again_are_counted(monkeypatch):
    """The result does not count as complete, and its notice says how many are missing."""
    from latinpc.results import eigen

    once = iter([eigen.solved])
    monkeypatch.setattr(eigen, "solved", lambda eps, wanted: next(once, lambda *_: [])(eps, wanted))
    with pytest.warns(latinpc.LatinWarning, match="2 modes are missing between these: lower -modes_eps_tol"):
        found = latinpc.modes(latinpc.Structure(**grid(4, inside=True)), 2)
    assert not found.complete


@pytest.mark.parametrize("lost", [False, True])
def test_a_light_stiff_node_hides_no_repeated_frequency(lost, monkeypatch):
    """Strings alike beside a value 1e12 times as large; those within its rounding, not counted, are noted."""
    from latinpc.results import eigen

    if lost:
        counts = iter([lambda *_: -1])
        monkeypatch.setattr(eigen, "below", lambda *given, count=eigen.below: next(counts, count)(*given))
    nodes = np.array([[x, 3.0 * k, 0.0] for k in range(20) for x in range(4)] + [[-1e-3, -1, 0], [0, -1, 0]])
    links = np.array([[4 * k + i, 4 * k + i + 1] for k in range(20) for i in range(3)] + [[80, 81]])
    fixed = np.repeat(np.append(np.tile([1, 0, 0, 1], 20), [1, 0])[:, None], 3, axis=1)
    fixed[-1] = [0, 1, 1]
    s = latinpc.Structure(
        nodes, links, "bar", np.append(np.full(60, 1e6), 2e12), prestress=np.append(np.full(60, 1e3), 0.0), fixed=fixed,
        mass=np.append(np.full(81, 2.0), 1e-3), geometry="large",
    )  # fmt: skip
    exact = np.repeat([500.0, 1500.0], 40)
    for number in (60,) if lost else (30, 39, 41, 60):
        found = latinpc.modes(s, number)
        assert found.complete != lost and ("they are alike to rounding" in str(found.notices)) == lost
        assert lost or np.allclose(found.values, exact[:number])


def test_unstable_modes_are_the_lowest_ones():
    """A strut whose head is free beside slow springs: its value is the lowest, though far from zero; at any target."""
    s = latinpc.Structure(
        [[0, 0], [1, 0], [5, 0], [6, 0]], [[0, 1], [2, 3]], "bar", [1e6, 100.0], prestress=[-4000.0, 50.0],
        fixed=[[1, 1], [0, 0], [1, 1], [0, 0]], mass=[0.0, 1.0, 0.0, 10.0], geometry="large",
    )  # fmt: skip
    for number in (1, 2, 3, 4):
        found = latinpc.modes(s, number)
        assert np.allclose(found.values, [-4000.0, 5.0, 10.0, 1e6][:number]) and found.complete
        assert found.notices == ["the state is not stable: 1 mode has a negative stiffness"]
    assert np.allclose(latinpc.modes(s, 2, options={"modes_eps_target": 6.0}).values, [5.0, 10.0])
    s.set_mass([0.0, 0.0, 0.0, 10.0])  # then its head has no value
    found = latinpc.modes(s, 2)
    assert np.allclose(found.values, [5.0, 10.0]) and found.complete and "not stable" in found.notices[0]


@pytest.mark.parametrize("mass", [1.0, 0.0])
def test_values_next_to_zero_are_apart_beside_one_far_below(mass):
    """A strut that buckles with -4e7, and springs of 1 to 150 N/m in threes; a strut without mass has no value."""
    stiffness = np.append(np.repeat([1.0, 2.0, 150.0], 3), 1e10)
    nodes = np.array([[0.0, 0.0], [1.0, 0.0], *([x, 5.0] for k in range(10) for x in (3.0 * k, 3.0 * k + 1.0))])
    fixed = np.ones(nodes.shape, bool)
    fixed[1], fixed[3::2, 0] = False, False
    s = latinpc.Structure(
        nodes, np.arange(22).reshape(11, 2), "bar", np.append(1e10, stiffness), geometry="large", fixed=fixed,
        prestress=np.append(-4e7, np.zeros(10)), mass=np.where(np.arange(22) == 1, mass, 1.0),
    )  # fmt: skip
    exact = np.sort([*stiffness, *([-4e7, 1e10] if mass else [])])
    for number in (2, 5, 8):
        found = latinpc.modes(s, number)
        assert found.complete and np.allclose(found.values, exact[:number], rtol=1e-9)


@pytest.mark.parametrize("seed", range(12))
def test_lowest_values_beside_dense_matrices(seed):
    """Three copies of random bars, stable, unstable or loose: repeated values, far below zero and next to it."""
    rng = np.random.default_rng(seed)
    count, dim = int(rng.integers(4, 9)), int(rng.integers(1, 4))
    nodes, fixed = rng.normal(size=(count, dim)), rng.random((count, dim)) < rng.choice([0.0, 0.2, 0.5])
    links = np.array([(a, b) for a in range(count) for b in range(a + 1, count)])
    strain, mass = rng.choice([-0.1, 0.0, 0.1]) * rng.random(len(links)), rng.uniform(1.0, 2.0, count)
    s = latinpc.Structure(
        np.vstack([nodes + copy * np.eye(dim)[0] * 9.0 for copy in range(3)]),
        np.vstack([links + copy * count for copy in range(3)]), "bar",
        np.tile(10.0 ** rng.uniform(2.0, 6.0, len(links)), 3),
        initial_elongation=np.tile(strain, 3), fixed=np.tile(fixed, (3, 1)), mass=np.tile(mass, 3), geometry="large",
    )  # fmt: skip
    root = np.sqrt(np.repeat(s.mass[:, None], dim, axis=1)[~s.fixed])
    K = tangent(s, s.prescribed).convert("dense").getDenseArray()
    exact = np.linalg.eigvalsh(K / root / root[:, None])
    for number in (1, 4, 11):
        found = latinpc.modes(s, number)
        assert found.complete and len(found) == min(number, len(exact))
        assert np.allclose(found.values, exact[:number], rtol=1e-8, atol=1e-13 * abs(exact).max())


@pytest.mark.parametrize("options", [{"modes_eps_target": 12.0}, {"modes_st_shift": 12.0}])
def test_options_of_slepc_do_not_make_a_state_unstable(options):
    """Its negative values are counted below zero, wherever SLEPc shifts."""
    s = latinpc.Structure([[0.0], [1.0], [2.0]], [[0, 1], [0, 2]], "bar", [10.0, 20.0], fixed=[[1], [0], [0]], mass=1.0)
    found = latinpc.modes(s, 2, options=options)
    assert np.allclose(found.values, [10.0, 20.0]) and not found.notices
    found = latinpc.modes(s, 1, options={"modes_st_type": "shift", "modes_eps_largest_real": True})
    assert not found.complete and "options of SLEPc ask for others than the lowest ones" in found.notices[0]


def test_soft_modes_beside_light_stiff_nodes_are_no_mechanisms():
    """A pontoon on moorings beside a node of a steel bar; the same of an unstable strut, and of factors."""
    fixed = [[1], [0], [1], [0]]
    for stiffness in (1e7, 1e10):
        s = latinpc.Structure([[0.0], [10.0], [0.0], [1.0]], [[0, 1], [2, 3]], "bar", [40.0, stiffness], fixed=fixed,
                              mass=[0.0, 2e4, 0.0, 0.01])  # fmt: skip
        found = latinpc.modes(s, 1)
        assert found.values[0] == pytest.approx(40.0 / 2e4) and not found.notices
    s = latinpc.Structure(
        [[0, 0], [1, 0], [5, 0], [6, 0], [5.2, 1]], [[0, 1], [2, 3], [2, 4], [3, 4]], "bar", [1e9, 1e3, 1e3, 1e3],
        prestress=[1e-4, 0.0, 0.0, 0.0], fixed=[[1, 1], [0, 0], [1, 1], [1, 1], [0, 0]],
        load=[[0, 0]] * 4 + [[0, -1.0]], geometry="large",
    )  # fmt: skip
    assert latinpc.modes(s, 1, buckling=True).factors[0] == pytest.approx(426.82, rel=1e-4)


def test_repeated_factors_are_all_there():
    """A column on a square base buckles both ways at once."""
    s = latinpc.Structure(**grid(3, inside=False), geometry="large")
    several = latinpc.modes(s, 6, buckling=True).factors
    assert several[1] == pytest.approx(several[0], rel=1e-9) and several[2] > 1.01 * several[0]
    for number in (1, 2, 3):
        found = latinpc.modes(s, number, buckling=True)
        assert found.complete and np.allclose(found.factors, several[:number])


def test_links_that_are_neither_taut_nor_slack_are_named():
    """Cables without tension at their natural length: the stiffness has them, and the count of slack ones has not."""
    nodes, links = [[0, 0], [1, 0], [2, 0], [1, 1], [1, -1]], [[0, 1], [1, 2], [1, 3], [1, 4]]
    cables = latinpc.Structure(
        nodes, links, ["cable", "cable", "bar", "cable"], 1e3, initial_elongation=[0.0, 0.0, 0.0, -1e-3],
        fixed=[[1, 1], [0, 0], [1, 1], [1, 1], [1, 1]], mass=1.0,
    )  # fmt: skip
    for state in (cables, cables.solve()):
        found = latinpc.modes(state, 2)
        assert found.slack.tolist() == [False, False, False, True]
        assert "links 0, 1 bear nothing and are neither taut nor slack: the stiffness is that of taut" in str(found)
        assert np.allclose(found.values, [1e3, 2e3])
    cables.set_initial_elongation([1e-4, 1e-4, 0.0, -1e-3])
    assert not latinpc.modes(cables, 2).notices


if __name__ == "__main__":
    cube = latinpc.modes(latinpc.Structure(**grid(4, inside=True)), 5)
    if PETSc.COMM_WORLD.rank == 0:
        print(json.dumps({"values": cube.values.tolist(), "complete": cube.complete}))
