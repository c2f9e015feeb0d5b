"""Contacts with friction beside elastic links, where the iteration diverges and Newton's method takes over."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from petsc4py import PETSc
from random_motions import with_links
from random_structures import Draw
from scipy.optimize import linprog
from support import far, solve

import latinpc
from latinpc.bench.extremes import drawn, rubbing
from latinpc.bench.extremes.conditions import missed
from latinpc.bench.peers.qp import kinematics
from latinpc.scenes import Law, Scene, make

pytestmark = pytest.mark.skipif(np.finfo(PETSc.RealType).eps > 1e-10, reason="the tolerances are of double precision")

DIVERGES = (295, 613, 752)  #: of seed 5: open, sticking and slipping contacts, plane and in space


def rubs(number):
    """Make a random structure with friction that the iteration alone does not solve."""
    return drawn.draw(5, number, "friction").scene


def rested(friction, push, dim=2, sideways=0.0, units=1.0):
    """Make a block on a floor that a slack cable holds along it, and a weight 10 presses on it."""
    held = np.zeros((3, dim), bool)
    held[[0, 2]] = True
    load = np.zeros((3, dim))
    load[1, :2], load[1, 2:] = (push, -10.0), sideways
    normal, along = np.eye(dim)[1], np.delete(np.eye(dim), 1, axis=0)
    nodes = np.zeros((3, dim))
    nodes[0, 1], nodes[2, 0] = -1.0, -2.0
    bars = {"links": [[2, 1]], "law": [Law.CABLE], "stiffness": [1e3 * units], "initial_elongation": [-0.5]}
    contact = [Law.FRICTION] + [Law.TANGENT] * (dim - 1)
    return Scene(
        name="rested", nodes=nodes, links=bars["links"] + [[0, 1]] * dim, law=bars["law"] + contact,
        stiffness=bars["stiffness"] + [0.0] * dim, initial_elongation=bars["initial_elongation"] + [0.0] * dim,
        direction=np.vstack([np.zeros(dim), normal, along]), friction=[0.0, friction] + [0.0] * (dim - 1),
        fixed=held, load=units * load,
    )  # fmt: skip


@pytest.mark.parametrize("number", DIVERGES)
def test_coulombs_law_is_met_where_the_iteration_diverges(number):
    """Balance, gaps and cones; the displacements are those of an equilibrium in 200 digits."""
    scene = rubs(number)
    alone = solve(scene, newton="never", stop="auto", max_it=2000)
    assert alone.reason < 0
    found = solve(scene, stop="auto")
    assert found.reason > 0
    assert missed(scene, found.u, found.tensions) < 1e-5
    exact = rubbing.near(scene, found.u, found.tensions)
    assert far(found.u, exact.displacements) < 1e-4
    assert far(found.tensions, exact.tensions) < 1e-4


@pytest.mark.parametrize("units", [1e-8, 1.0, 1e8])
@pytest.mark.parametrize("push", [2.9, 3.1, 50.0])
def test_a_block_slides_until_its_cable_is_taut(push, units):
    """It sticks below mu N; above, the cable bears what friction does not, half a metre further on."""
    scene = rested(0.3, push, units=units)
    found = solve(scene, stop="auto")
    assert found.reason > 0
    moved = 0.0 if push < 3.0 else 0.5 + (push - 3.0) / 1e3
    assert found.u[1] == pytest.approx([moved, 0.0], rel=1e-4, abs=1e-6)
    assert found.tensions / units == pytest.approx([max(push - 3.0, 0.0), -10.0, min(push, 3.0)], rel=1e-4, abs=1e-4)


def test_units_of_force_change_nothing():
    """Stiffnesses and loads a million times as large: the same displacements."""
    scene = rubs(393)
    times = replace(scene, stiffness=1e6 * scene.stiffness, load=1e6 * scene.load)
    one, other = (solve(one, stop="auto") for one in (scene, times))
    assert far(other.u, one.u) < 1e-4
    assert far(other.tensions / 1e6, one.tensions) < 1e-4


@pytest.mark.parametrize("dim", [2, 3])
def test_grains_move_as_far_as_their_gaps(dim):
    """Displacements of rigid grains are proportional to their gaps, which may be far larger than the structure."""
    scene = make("packing", side=7 - dim, dim=dim, law="friction")
    near = solve(scene, error=1e-6)
    assert near.reason > 0
    for power in (6, 12):
        result = solve(replace(scene, initial_elongation=10.0**power * scene.initial_elongation), error=1e-6)
        assert result.reason > 0
        assert far(result.u, 10.0**power * near.u) < 1e-5


def test_what_no_friction_holds_is_refused():
    """A load up, away from the floor: no equilibrium, whatever the friction."""
    scene = rested(0.9, 0.0)
    up = replace(scene, load=-scene.load)
    assert rubbing.solve_rubbing(up).exists == "no"
    assert solve(up, stop="auto", max_it=2000).reason < 0


def bearing(scene, more):
    """The most of `more` that an arch bears beside its loads, by limit analysis: forces that Coulomb's law admits."""
    law, (B, _) = scene.law, kinematics(scene)
    normal, links = np.flatnonzero(law == Law.FRICTION), len(law)
    cone = np.zeros((2 * len(normal), links + 1))
    for row, link in enumerate(np.repeat(normal, 2)):
        cone[row, link], cone[row, link + 1] = scene.friction[link], (-1) ** row
    balance = np.column_stack([B.T.toarray(), -more[~scene.fixed]]) / np.abs(scene.load).max()
    bounds = [(None, 0.0 if kind == Law.FRICTION else None) for kind in law] + [(0.0, None)]
    load = scene.load[~scene.fixed] / np.abs(scene.load).max()
    found = linprog(-np.eye(links + 1)[-1], cone, np.zeros(len(cone)), balance, load, bounds, method="highs")
    assert found.status == 0
    return found.x[-1]


@pytest.mark.parametrize(("thickness", "way"), [(0.2, "push"), (0.12, "push"), (0.2, "crown")])
def test_a_collapse_is_none_of_rounding(thickness, way):
    """An arch bears 0.995 of its limit. Beyond it blocks move without end: that is no matter of digits."""
    scene = make("arch", thickness=thickness)
    more = make("arch", thickness=thickness, **{way: 1.0}).load - scene.load
    limit = bearing(scene, more)
    arch = latinpc.Structure.from_scene(replace(scene, load=scene.load + 0.995 * limit * more))
    assert arch.solve().converged
    for part in (1.01, 1.05, 1.1):
        arch.set_load(scene.load + part * limit * more)
        with pytest.warns(latinpc.ConvergenceWarning):
            beyond = arch.solve()
        assert beyond.report["reason"] in ("DIVERGED_DTOL", "DIVERGED_MAX_IT")
        assert beyond.notices and not any("rounding" in text or "stiffness" in text for text in beyond.notices)


@pytest.mark.parametrize(("friction", "thickness", "part"), [(0.6, 0.12, 0.99), (0.5, 0.12, 0.999), (0.4, 0.2, 0.999)])
def test_an_arch_next_to_its_limit_stands(friction, thickness, part):
    """Newton's method for bounds of the friction had ended far away, or for bounds too low to hold the arch."""
    scene = make("arch", thickness=thickness, friction=friction)
    more = make("arch", thickness=thickness, friction=friction, crown=1.0).load - scene.load
    loaded = replace(scene, load=scene.load + part * bearing(scene, more) * more)
    found = latinpc.Structure.from_scene(loaded).solve()
    assert found.converged
    assert missed(loaded, found.displacements, found.tensions) < 1e-6


@pytest.mark.parametrize(
    ("friction", "thickness", "way", "part"),
    [(0.6, 0.2, "push", 1.001), (0.7, 0.12, "push", 1.01), (0.7, 0.2, "crown", 1.01), (0.7, 0.2, "crown", 3.0)],
)
def test_a_collapse_ends_before_all_stages(friction, thickness, way, part):
    """No forces in the cones of the contacts bear the loads: a proof, which names what moves."""
    scene = make("arch", thickness=thickness, friction=friction)
    more = make("arch", thickness=thickness, friction=friction, **{way: 1.0}).load - scene.load
    beyond = latinpc.Structure.from_scene(replace(scene, load=scene.load + part * bearing(scene, more) * more))
    with pytest.warns(latinpc.ConvergenceWarning):
        found = beyond.solve()
    assert found.report["reason"] == "DIVERGED_DTOL"
    assert found.report["iterations"] < 3000
    assert found.notices[0].startswith("no equilibrium: neither links nor friction hold node")


def disks(seed, units=1.0, turned=0.0):
    """Make two or three disks between walls, in balance as drawn if at all, and a load that pushes the last one."""
    rng = np.random.default_rng(seed)
    count, (a, b), friction = int(rng.integers(2, 4)), rng.uniform(0.2, 1.2, 2), round(rng.uniform(0.1, 0.8), 2)
    left, right = np.array((np.sin(a), np.cos(a))), np.array((-np.sin(b), np.cos(b)))
    angle = rng.uniform(0.1, 0.9)
    at = 2.0 * np.array(
        [(0.0, 0.0), (np.cos(angle), np.sin(angle)), (np.cos(angle + np.pi / 3), np.sin(angle + np.pi / 3))]
    )
    joints = [(0, 1, at[1]), (0, 2, at[2]), (1, 2, at[2] - at[1])][: 2 * count - 3]
    nodes = list(at[:count])
    for disk, normal in ((0, left), (1, right), (0, np.array((0.0, 1.0))) if rng.random() < 0.5 else (1, left)):
        joints.append((len(nodes), disk, normal))
        nodes.append(at[disk] - normal)
    turn = np.array([(np.cos(turned), np.sin(turned)), (-np.sin(turned), np.cos(turned))])
    frames = np.array([d / np.linalg.norm(d) for *_, n in joints for d in (n, np.array((-n[1], n[0])))])
    law = np.array([Law.FRICTION, Law.TANGENT] * len(joints))
    held, load, more = np.ones((len(nodes), 2), bool), np.zeros((len(nodes), 2)), np.zeros((len(nodes), 2))
    held[:count], load[:count, 1], more[count - 1, 0] = False, -10.0 * units, rng.choice([-1.0, 1.0]) * units
    scene = Scene(
        name="disks", nodes=np.array(nodes) @ turn, links=np.repeat([joint[:2] for joint in joints], 2, axis=0),
        law=law, stiffness=np.zeros(len(law)), direction=frames @ turn,
        friction=np.where(law == Law.FRICTION, friction, 0.0), fixed=held, load=load @ turn,
    )  # fmt: skip
    return scene, more @ turn


@pytest.mark.parametrize("units", [1.0, 1e-6])
@pytest.mark.parametrize("seed", [1, 3, 6, 10])
def test_grains_stand_up_to_their_limit_and_fall_beyond(seed, units):
    """Forces in the cones are a solution where gaps are closed, and their absence is a proof."""
    scene, more = disks(seed, units, turned=0.3)
    limit = bearing(scene, more)
    for part in (0.9, 0.99):
        loaded = replace(scene, load=scene.load + part * limit * more)
        found = latinpc.Structure.from_scene(loaded).solve()
        assert found.converged
        assert missed(loaded, found.displacements, found.tensions) < 1e-4
    with pytest.warns(latinpc.ConvergenceWarning):
        found = latinpc.Structure.from_scene(replace(scene, load=scene.load + 1.01 * limit * more)).solve()
    assert found.report["reason"] == "DIVERGED_DTOL"
    assert found.notices[0].startswith("no equilibrium: neither links nor friction hold node")


def pulled(friction, pull, weight=10.0):
    """Make a grain on a floor, in space, that is pulled along it."""
    return Scene(
        name="pulled", nodes=[[0, 0, 0], [0, 0, -1]], links=[[1, 0]] * 3, law=[Law.FRICTION, Law.TANGENT, Law.TANGENT],
        stiffness=[0.0] * 3, direction=[[0, 0, 1], [1, 0, 0], [0, 1, 0]], friction=[friction, 0.0, 0.0],
        fixed=[[False] * 3, [True] * 3], load=[[pull, 0, -weight], [0, 0, 0]],
    )  # fmt: skip


@pytest.mark.parametrize("units", [1.0, 1e-6])
def test_a_grain_in_space_falls_where_no_friction_holds_it(units):
    """The edges around its cone bear twice as much in their directions: more than that is a proof."""
    scene = pulled(0.3, 6.1 * units, 10.0 * units)
    with pytest.warns(latinpc.ConvergenceWarning):
        found = latinpc.Structure.from_scene(scene).solve()
    assert found.report["reason"] == "DIVERGED_DTOL"
    assert found.notices == ["no equilibrium: neither links nor friction hold node 0"]


@pytest.mark.parametrize("seed", [150, 2171])
def test_displacements_larger_than_the_structure_are_no_collapse_unless_they_grow(seed):
    """Soft links at large loads. The iteration alone finds the same."""
    random = np.random.default_rng(seed)
    nodes, extra = random.integers(2, 8), random.integers(0, 8)
    slack = random.choice([0.0, 0.3, 1.0])
    scene = Draw(nodes=int(nodes), extra=int(extra), parts=1, slack=float(slack), seed=seed).scene()
    for _ in range(random.integers(1, 4)):
        gap, friction = 0.01 * random.integers(3), 0.1 * random.integers(1, 9)
        scene = with_links(scene, random, [Law.FRICTION, Law.TANGENT], gap, friction)
    found = solve(scene, error=1e-6)
    assert np.abs(found.u).max() > np.ptp(scene.nodes, axis=0).max()
    assert found.reason > 0
    assert missed(scene, found.u, found.tensions) < 1e-5
    alone = solve(scene, error=1e-6, newton="never")
    assert np.linalg.norm(found.u - alone.u) < 1e-5 * np.linalg.norm(alone.u)


@pytest.mark.parametrize("friction", [0.4, 0.6, 0.7])
def test_the_error_of_a_refusal_is_no_less_than_the_unbalanced_forces(friction):
    """Estimates compare iterates: those that creep, or have left for far away, differ little."""
    for part in (0.05, 0.07, 0.15, 0.3):
        arch = latinpc.Structure.from_scene(make("arch", thickness=0.12, friction=friction, push=part))
        with pytest.warns(latinpc.ConvergenceWarning):
            found = arch.solve()
        load = np.linalg.norm(arch.load[~arch.fixed])
        assert found.report["tension_error"] >= 0.3 * min(1.0, found.report["residual_norm"] / load)


RANKS = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
import numpy as np
import petsc4py
petsc4py.init(sys.argv)
import latinpc
from test_friction import rubs
for number in (371, 393):
    structure = latinpc.Structure.from_scene(rubs(number))
    snes = structure.create_snes()
    snes.setFromOptions()
    u = structure.create_vec()
    snes.solve(None, u)
    assert snes.getConvergedReason() > 0
    found = structure.displacements(u)
    if structure.comm.rank == 0:
        np.save(sys.argv[1] + "-" + str(number) + ".npy", found)
"""


def test_ranks_do_not_matter(mpirun, tmp_path):
    """Two and four ranks find what one does."""
    for ranks in (1, 2, 4):
        mpirun(ranks, RANKS, tmp_path / f"u{ranks}")
    for number in (371, 393):
        one, two, four = (np.load(tmp_path / f"u{ranks}-{number}.npy") for ranks in (1, 2, 4))
        assert far(two, one) < 1e-4
        assert far(four, one) < 1e-4
