"""What must not matter: units, origin, orientation, numbering; and what must always hold."""

from dataclasses import replace

import numpy as np
import oracle
import pytest
from support import (
    PLAIN,
    VARIANTS,
    cut,
    far,
    grid,
    irregular,
    network,
    settled,
    solve,
    unbalance,
    with_partition,
)

from latinpc.scenes import make

LENGTH, FORCE = 1e3, 1e-3
TOGETHER = {"stol": 1e-9, "max_it": 3000}
LINK_DATA = ("law", "stiffness", "initial_elongation")
NODE_DATA = ("fixed", "prescribed", "load")


def rounded(scene):
    """Coordinates on a fine grid, so that moving the origin far away does not round them off."""
    return replace(scene, nodes=np.round(scene.nodes * 2.0**20) / 2.0**20)


SCENES = {
    "grid": grid,
    "irregular": irregular,
    "network": lambda: settled(rounded(network()), size=3e-5),
    "lattice": lambda: settled(cut(make("lattice", nx=10, ny=6, partition="metis"), 7), size=3e-5),
}


def same(scene, other, back=lambda u: u, tolerance=1e-10, **options):
    """Same iterates, same counts to convergence, same displacements, once `back` has undone the change."""
    for k in (1, 5):
        iterates = [solve(s, max_it=k, stol=0, **options, **PLAIN).u for s in (scene, other)]
        assert far(back(iterates[1]), iterates[0]) < tolerance
    ends = [solve(s, **options, **TOGETHER) for s in (scene, other)]
    assert ends[0].reason == ends[1].reason > 0
    assert ends[0].iterations == ends[1].iterations
    sizes = ("strong_interfaces", "weak_interfaces", "strong_macro_dofs", "weak_dofs", "state_size")
    assert [ends[0].statistics[name] for name in sizes] == [ends[1].statistics[name] for name in sizes]
    assert far(back(ends[1].u), ends[0].u) < max(tolerance, 1e-8)


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("name", SCENES)
def test_units(name, variant):
    """Lengths times 1e3 and forces times 1e-3: displacements times 1e3, iteration counts the same."""
    scene = SCENES[name]()
    other = replace(
        scene,
        nodes=scene.nodes * LENGTH,
        stiffness=scene.stiffness * FORCE / LENGTH,
        load=scene.load * FORCE,
        initial_elongation=scene.initial_elongation * LENGTH,
        prescribed=scene.prescribed * LENGTH,
    )
    same(scene, other, lambda u: u / LENGTH, variant=variant)


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("name", SCENES)
def test_origin(name, variant):
    """A million lengths away nothing changes."""
    scene = SCENES[name]()
    same(scene, replace(scene, nodes=scene.nodes + 2.0**20), variant=variant)


@pytest.mark.parametrize("name", SCENES)
def test_rotation(name):
    """With a scalar direction turned structures make turned iterates; supports must be held in all directions."""
    scene = SCENES[name]()
    turn = np.linalg.qr(np.random.default_rng(5).normal(size=(scene.dim, scene.dim)))[0]
    turned = {key: getattr(scene, key) @ turn.T for key in ("nodes", "load", "prescribed")}
    assert (scene.fixed.all(axis=1) == scene.fixed.any(axis=1)).all()
    for variant in VARIANTS:
        same(scene, replace(scene, **turned), lambda u: u @ turn, variant=variant, direction="scalar")


@pytest.mark.parametrize("name", SCENES)
def test_rotation_of_the_diagonal_direction(name):
    """The diagonal direction knows the axes: other iterates, about as many, to the same displacement."""
    scene = SCENES[name]()
    turn = np.linalg.qr(np.random.default_rng(5).normal(size=(scene.dim, scene.dim)))[0]
    turned = {key: getattr(scene, key) @ turn.T for key in ("nodes", "load", "prescribed")}
    one, other = solve(scene, **TOGETHER), solve(replace(scene, **turned), **TOGETHER)
    assert other.iterations <= 1.25 * one.iterations + 2
    assert far(other.u @ turn, one.u) < 1e-6


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("name", SCENES)
def test_numbering_of_nodes(name, variant):
    """Shuffled nodes give shuffled displacements."""
    scene = SCENES[name]()
    order = np.random.default_rng(1).permutation(len(scene.nodes))
    number = np.argsort(order)
    data = {key: getattr(scene, key)[order] for key in ("nodes", *NODE_DATA)}
    same(scene, replace(scene, links=number[scene.links], **data), lambda u: u[number], variant=variant)


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("name", SCENES)
def test_numbering_and_orientation_of_links(name, variant):
    """Shuffled links, half of them turned round, are the same structure."""
    scene, rng = SCENES[name](), np.random.default_rng(2)
    order = rng.permutation(len(scene.links))
    links = scene.links[order]
    links = np.where(rng.random(len(links))[:, None] < 0.5, links, links[:, ::-1])
    data = {key: getattr(scene, key)[order] for key in (*LINK_DATA, "subdomain")}
    same(scene, replace(scene, links=links, **data), variant=variant)


@pytest.mark.parametrize("variant", VARIANTS)
def test_numbering_of_subdomains(variant):
    """On the regular grid it is of no account which block is the first."""
    scene = grid()
    order = np.random.default_rng(3).permutation(9)
    same(scene, replace(scene, subdomain=order[scene.subdomain]), variant=variant)


def test_results_follow_the_callers_numbering():
    """Tensions, too, come back in the order in which the links were given."""
    scene, rng = network(), np.random.default_rng(4)
    order = rng.permutation(len(scene.links))
    data = {key: getattr(scene, key)[order] for key in ("links", *LINK_DATA, "subdomain")}
    one, other = solve(scene, stol=1e-10), solve(replace(scene, **data), stol=1e-10)
    assert other.tensions == pytest.approx(one.tensions[order], rel=1e-6, abs=1e-6 * abs(one.tensions).max())


@pytest.mark.parametrize("parts", [1, 2, 9, 40])
def test_partition_does_not_change_the_answer(parts):
    """However the links are shared out, the displacement is the structure's: copies of nodes share, none is lost."""
    scene = grid()
    reference = oracle.newton(scene)
    for seed in range(2):
        partition = cut(scene, parts, seed) if parts > 1 else with_partition(scene, np.zeros(len(scene.links), int))
        for variant in VARIANTS:
            result = solve(partition, variant=variant, **TOGETHER)
            assert result.reason > 0
            assert far(result.u, reference) < 1e-6


@pytest.mark.parametrize("name", SCENES)
def test_superposition_of_a_truss(name):
    """Bars only: the displacement under two loads is the sum of the two, at every iteration."""
    scene = SCENES[name]()
    bars = replace(scene, law=np.zeros_like(scene.law))
    rng, zero = np.random.default_rng(6), np.zeros_like(scene.initial_elongation)
    loads = [np.where(scene.fixed, 0.0, rng.normal(size=scene.nodes.shape)) for _ in range(2)]
    still = {"prescribed": np.zeros_like(scene.nodes), "initial_elongation": zero}
    cases = [replace(bars, load=load, **still) for load in (*loads, loads[0] + loads[1])]
    for k in (1, 4):
        first, second, both = (solve(case, max_it=k, stol=0, **PLAIN).u for case in cases)
        assert far(first + second, both) < 1e-9


@pytest.mark.parametrize("name", SCENES)
def test_supports_carry_the_loads(name):
    """What the supports hold is what the loads push: forces and moments of the whole structure balance."""
    scene = SCENES[name]()
    result = solve(scene, stol=1e-11, max_it=3000)
    b, _ = oracle.kinematics(scene)
    force = (b.T @ result.tensions).reshape(scene.nodes.shape)
    largest = (abs(b).T @ abs(result.tensions)).max()
    assert abs(force.sum(axis=0)).max() < 1e-9 * largest
    reactions = np.where(scene.fixed, force - scene.load, 0.0)
    assert abs(reactions.sum(axis=0) + scene.load.sum(axis=0)).max() < 1e-6 * largest
    assert unbalance(scene, result.u) < 1e-8


@pytest.mark.parametrize("name", SCENES)
def test_maxwell_betti(name):
    """The work of one load on the displacements of another is the same the other way round."""
    scene = SCENES[name]()
    still = {"prescribed": np.zeros_like(scene.nodes), "initial_elongation": np.zeros_like(scene.initial_elongation)}
    bars = replace(scene, law=np.zeros_like(scene.law), **still)
    rng = np.random.default_rng(8)
    loads = [np.where(scene.fixed, 0.0, rng.normal(size=scene.nodes.shape)) for _ in range(2)]
    moved = [solve(replace(bars, load=load), stol=1e-12, max_it=2000).u for load in loads]
    works = np.sum(loads[0] * moved[1]), np.sum(loads[1] * moved[0])
    assert works[0] == pytest.approx(works[1], rel=1e-6, abs=1e-8 * abs(np.sum(loads[0] * moved[0])))
