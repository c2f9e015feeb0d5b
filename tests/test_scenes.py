"""The scenes: sizes of the article, balance, stability, slack, and clear refusals."""

import json
import time

import numpy as np
import oracle
import pytest
import scipy.sparse as sp

from latinpc.scenes import SCENES, Law, Scene, make

SMALL = {
    "tensegrity-grid": {"modules": 8},
    "truss-grid": {"modules": 8},
    "network": {"nodes": 150},
    "lattice": {"nx": 12, "ny": 8},
    "hung-truss": {"nx": 8, "ny": 2, "cables": 3},
    "chain": {"links": 12},
    "net": {"side": 6},
    "arch": {"blocks": 7},
    "packing": {"side": 8},
    "saddle": {"side": 5},
    "hypar": {"side": 4},
    "mast": {"levels": 2, "panels": 2},
    "tower": {"stages": 2},
    "bridge": {"panels": 6},
    "impact-grid": {"modules": 8, "subdomains": 4},
    "impact-tower": {"levels": 6},
    "bouncing-chain": {"links": 8},
}
PRESTRESSED = ("tensegrity-grid", "truss-grid", "network", "lattice")
HELD = ("saddle", "hypar", "mast", "tower", "bridge")  # by their prestress; more in test_held_scenes.py
MOVING = ("impact-grid", "impact-tower", "bouncing-chain")  # more in test_moving_scenes.py


def stiffness(scene, active=None):
    """B^t k B on the free dofs, dense."""
    b, _ = oracle.kinematics(scene)
    b = b[:, np.flatnonzero(~scene.fixed.ravel())]
    k = np.where(scene.stiffness > 0, scene.stiffness, scene.stiffness.max() or 1.0)  # rigid links as stiff as any
    k = k if active is None else k * active
    return (b.T @ sp.diags(k) @ b).toarray()


def slack(scene, displacement):
    """Share of the cables without tension."""
    b, e_d = oracle.kinematics(scene)
    tension = oracle.tension(scene, b @ displacement.ravel() + e_d)
    return np.mean(tension[scene.law == Law.CABLE] == 0.0)


@pytest.mark.parametrize("name", SCENES)
def test_deterministic_and_fit_for_json(name):
    one, two = make(name, **SMALL[name]), make(name, **SMALL[name])
    for array in ("nodes", "links", "law", "stiffness", "initial_elongation", "fixed", "load"):
        np.testing.assert_array_equal(getattr(one, array), getattr(two, array))
    assert json.loads(json.dumps(one.metadata)) == one.metadata
    assert f"{len(one.nodes)} nodes" in repr(one)


@pytest.mark.parametrize("name", PRESTRESSED)
def test_self_stress_is_balanced_and_cables_start_taut(name):
    scene = make(name, **SMALL[name])
    b, _ = oracle.kinematics(scene)
    self_stress = scene.stiffness * scene.initial_elongation
    unbalance = (b.T @ self_stress)[~scene.fixed.ravel()]
    assert np.abs(unbalance).max() < 1e-9 * np.abs(self_stress).max()
    assert np.all(self_stress[scene.law == Law.CABLE] > 0.0)
    assert np.isclose(self_stress.max(), 1000.0) or name == "lattice"


@pytest.mark.parametrize("name", sorted(set(SCENES) - set(MOVING) - set(HELD)))
def test_no_global_mechanism(name):
    scene = make(name, **SMALL[name])
    values = np.linalg.eigvalsh(stiffness(scene))
    assert values[0] > 1e-9 * values[-1]


@pytest.mark.parametrize(
    ("modules", "dofs", "links"), [(12, 1443, 2304), (24, 5475, 9216), (32, 9603, 16384), (48, 21315, 36864)]
)
def test_grid_has_the_sizes_of_table_3(modules, dofs, links):
    scene = make("tensegrity-grid", modules=modules)
    assert (scene.nodes.size, len(scene.links), scene.n_subdomains) == (dofs, links, (modules // 4) ** 2)
    np.testing.assert_array_equal(scene.law[:16], [Law.CABLE] * 12 + [Law.BAR] * 4)
    pairs = np.sort(scene.links, axis=1)
    inner = 2 * modules * (modules - 1)  # lower edges shared by two modules carry two coincident cables
    assert len(np.unique(pairs, axis=0)) == links - inner


@pytest.mark.parametrize("modules", [12, 24, 48])
def test_grid_has_nine_percent_of_slack_cables(modules):
    scene = make("tensegrity-grid", modules=modules)
    assert slack(scene, oracle.newton(scene)) == pytest.approx(0.09, abs=0.005)


@pytest.mark.parametrize("wanted", [0.05, 0.12, 0.21])
def test_grid_slack_follows_the_option(wanted):
    scene = make("tensegrity-grid", modules=14, subdomains=4, slack=wanted)
    assert slack(scene, oracle.newton(scene)) == pytest.approx(wanted, abs=0.012)


def test_grid_options():
    truss = make("truss-grid", modules=8, module="modified", load=3.0, partition="metis")
    assert np.all(truss.law == Law.BAR)
    assert truss.subdomain is None
    assert len(truss.links) == 22 * 64
    assert np.ptp(truss.load[~truss.fixed[:, 2]], axis=0).max() == 0.0
    assert truss.load.min() == -3.0
    assert truss.metadata["load_per_node"] == 3.0
    assert set(truss.nodes[truss.fixed[:, 0], 0]) == {0.0, 8.0}


@pytest.mark.parametrize(("module", "mechanisms"), [("initial", 3), ("modified", 0)])
def test_internal_mechanisms_of_a_module(module, mechanisms):
    scene = make("truss-grid", modules=1, subdomains=1, module=module)
    scene.fixed[:] = False
    values = np.linalg.eigvalsh(stiffness(scene))
    assert np.count_nonzero(values < 1e-9 * values[-1]) == 6 + mechanisms


def test_large_grid_takes_seconds():
    start = time.perf_counter()
    scene = make("tensegrity-grid", modules=400)
    assert len(scene.links) == 16 * 400**2
    assert time.perf_counter() - start < 10.0


@pytest.mark.parametrize("seed", range(20))
def test_networks_are_stable_and_slacken(seed):
    scene = make("network", seed=seed)
    assert np.linalg.matrix_rank(stiffness(scene), hermitian=True) == np.count_nonzero(~scene.fixed)
    displacement = oracle.newton(scene)
    assert 0.05 <= slack(scene, displacement) <= 0.15
    b, _ = oracle.kinematics(scene)
    taut = (scene.law == Law.BAR) | (oracle.tension(scene, b @ displacement.ravel()) != 0.0)
    values = np.linalg.eigvalsh(stiffness(scene, taut))
    assert values[0] > 1e-6 * values[-1]  # the slack state is stable too: the solution is unique


def test_networks_differ_by_seed_and_may_have_two_supports():
    one, two = make("network", seed=1, nodes=200), make("network", seed=2, nodes=200, supports=2)
    assert not np.array_equal(one.nodes, two.nodes)
    assert np.ptp(two.nodes[two.fixed[:, 2], 2]) > 1.0 > np.ptp(one.nodes[one.fixed[:, 2], 2])


def test_lattice_slackens():
    scene = make("lattice")
    assert scene.n_subdomains == 32
    assert 0.05 <= slack(scene, oracle.newton(scene)) <= 0.15
    assert make("lattice", nx=7, ny=5, partition="metis").subdomain is None
    assert make("lattice", nx=8, ny=8, subdomains=16).n_subdomains == 16


@pytest.mark.parametrize(
    ("name", "options"),
    [("tensegrity-grid", {"modules": 10}), ("lattice", {"nx": 7, "ny": 8}), ("impact-grid", {"modules": 9})],
)
def test_any_size_needs_no_partition(name, options):
    """Where the default blocks do not fit the solver makes a partition, as for structures of files."""
    assert make(name, **options).subdomain is None
    assert make("tensegrity-grid", modules=10, subdomains=25).n_subdomains == 25


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("grid", {}, "choose from tensegrity-grid"),
        ("network", {"modules": 3}, "no option 'modules'"),
        ("tensegrity-grid", {"modules": 0}, "at least 1"),
        ("tensegrity-grid", {"modules": 12, "subdomains": 5}, "choose from 1, 4, 9, 16, 36, 144"),
        ("tensegrity-grid", {"modules": 10, "partition": "regular"}, "not a multiple of 4"),
        ("tensegrity-grid", {"slack": 0.5}, "slack must lie"),
        ("tensegrity-grid", {"module": "third"}, "'initial' or 'modified'"),
        ("tensegrity-grid", {"partition": "scotch"}, "'regular' or 'metis'"),
        ("network", {"nodes": 2}, "at least 24"),
        ("network", {"supports": 3}, "supports must be"),
        ("network", {"slack": 0.9}, "slack must lie"),
        ("lattice", {"nx": 7, "partition": "regular"}, "or partition metis"),
        ("lattice", {"nx": 8, "ny": 8, "subdomains": 5}, "choose from"),
        ("lattice", {"nx": 0}, "at least 1"),
        ("net", {"subdomains": -1}, "-1 subdomains cannot be squares"),
        ("packing", {"subdomains": 0}, "0 subdomains cannot be boxes"),
    ],
)
def test_refusals_name_the_cure(name, options, message):
    with pytest.raises(ValueError, match=message):
        make(name, **options)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"links": [[0, 2]]}, "node that does not exist"),
        ({"links": [[1, 1]]}, "joins a node to itself"),
        ({"links": [[0.5, 1]]}, "links must be integers"),
        ({"nodes": [[0.0, 0.0], [0.0, 0.0]]}, "at one place"),
        ({"nodes": [[0.0, 0.0], [np.nan, 0.0]]}, "node 1 .* not finite"),
        ({"nodes": [0.0, 1.0]}, "nodes must be"),
        ({"stiffness": [0.0]}, "needs a positive stiffness"),
        ({"stiffness": [-1.0]}, "needs a positive stiffness"),
        ({"stiffness": [np.nan]}, "needs a positive stiffness"),
        ({"stiffness": [1.0, 1.0]}, "must have the shape"),
        ({"law": [7]}, r"unknown law \(0 bar"),
        ({"law": "cabel"}, "unknown law 'cabel': do you mean 'cable'. choose from bar, cable, "),
        ({"prescribed": [[1.0, 0.0], [0.0, 0.0]]}, "not fixed"),
        ({"subdomain": [1]}, "2 subdomains for 1 links"),
        ({"subdomain": [-1]}, "negative subdomain"),
        ({"velocity": [[1.0, 0.0], [0.0, np.nan]]}, "node 1 .* velocity that is not finite"),
        ({"velocity": [[1.0, 0.0], [0.0, 0.0]], "fixed": [[1, 1], [0, 0]]}, "node 0 .* velocity in a direction"),
        ({"time_step": -1.0}, "a positive time"),
        ({"area": [0.0]}, "area that is not positive"),
        ({"strength": [1.0]}, "give area"),
    ],
)
def test_scene_refuses(change, message):
    arrays = {"nodes": [[0.0, 0.0], [1.0, 0.0]], "links": [[0, 1]], "law": [0], "stiffness": [1.0]}
    assert Scene(name="two nodes", **arrays).dim == 2
    with pytest.raises(ValueError, match=message):
        Scene(name="two nodes", **(arrays | change))


@pytest.mark.parametrize(("given", "said"), [
    ({"side": "3"}, "scene 'net': side must be a whole number, not '3'"),
    ({"side": None}, "side must be a whole number, not None"),
    ({"current": "strong"}, "current must be a number, not 'strong'"),
    ({"law": 3}, "law must be a text, not 3"),
])  # fmt: skip
def test_values_of_another_kind_are_refused(given, said):
    with pytest.raises(ValueError, match=said):
        make("net", **given)
    assert make("net", side=2, subdomains=None, current=1).load.any()
