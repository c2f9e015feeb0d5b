"""Shocks: inextensible cables and rigid contacts in motion, against hand computations and LCPs."""

import json
from dataclasses import replace

import numpy as np
import oracle
import pytest
from lcp import step
from motions import EXACT, NEWTON, counts, floating, heavy, message, motion, one_mass
from random_motions import step_errors
from support import STATES, grid, logged

import latinpc
from latinpc.bench.extremes.drawn import draw
from latinpc.bench.extremes.rating import judge
from latinpc.runs.motion import move
from latinpc.scenes import Law, Scene, make

G = 9.81


def column(masses, gaps, velocity, held=False, stiffness=0.0):
    """Balls above each other in one dimension, rigid contacts between neighbours; the lowest one is a table if held."""
    n = len(masses)
    fixed = np.zeros((n, 1), bool)
    fixed[0] = held
    return Scene(
        name="column",
        nodes=np.arange(float(n))[:, None],
        links=np.column_stack([np.arange(n - 1), np.arange(1, n)]),
        law=np.full(n - 1, Law.CONTACT),
        stiffness=np.full(n - 1, stiffness),
        initial_elongation=np.broadcast_to(gaps, n - 1),
        fixed=fixed,
        mass=masses,
        velocity=np.where(fixed, 0.0, np.reshape(velocity, (-1, 1))),
    )


def hanging_chain(links=8, mass=1.0, slack=0.02, law=Law.INEXTENSIBLE, parts=2):
    """Masses on cables between two supports at one height, in the plane, all cables a little slack: they fall."""
    n = links + 1
    x = np.linspace(0.0, 1.0, n)
    nodes = np.column_stack([x, -0.8 * x * (1 - x)])
    fixed = np.zeros((n, 2), bool)
    fixed[[0, -1]] = True
    load = np.zeros((n, 2))
    load[1:-1, 1] = -G * mass
    return Scene(
        name="hanging chain",
        nodes=nodes,
        links=np.column_stack([np.arange(links), np.arange(1, n)]),
        law=np.full(links, law),
        stiffness=np.full(links, 0.0 if law == Law.INEXTENSIBLE else 1e6),
        initial_elongation=np.full(links, -slack),
        fixed=fixed,
        load=load,
        mass=np.full(n, mass),
        subdomain=np.arange(links) * parts // links,
    )


# ---- by hand ------------------------------------------------------------------------------


def test_a_ball_falls_on_a_table_and_stays():
    """Free fall, then the contact takes what would go beyond the gap, and in the next step the rest of the velocity."""
    gap, h, m = 0.02, 1e-3, 3.0
    scene = replace(column([0.0, m], gap, [0.0, 0.0], held=True), load=np.array([[0.0], [-m * G]]))
    u = v = 0.0
    with motion(scene, h, **EXACT) as it:
        for _ in range(100):
            it.step()
            free = v - h * G
            new = max(free, -(u + gap) / h)
            impulse = m * (new - free)
            u, v = u + h * new, new
            assert it.u[1, 0] == pytest.approx(u, abs=1e-12)
            assert it.v[1, 0] == pytest.approx(v, abs=1e-10)
            assert h * it.tensions[0] == pytest.approx(-impulse, abs=1e-10)
    assert v == 0.0


def test_a_slack_inextensible_cable_stops_a_mass():
    """The mirror image: the cable becomes taut at its length and takes the velocity away."""
    scene = replace(one_mass(velocity=2.0), law=np.array([Law.INEXTENSIBLE]), initial_elongation=np.array([-0.05]))
    scene = replace(scene, stiffness=np.zeros(1))
    with motion(scene, 1e-2, **EXACT) as it:
        speeds = [it.step().v[1, 0] for _ in range(6)]
        assert np.allclose(speeds, [2.0, 2.0, 1.0, 0.0, 0.0, 0.0], atol=1e-10)


@pytest.mark.parametrize("masses", [(1.0, 1.0), (1.0, 30.0), (1e-3, 1e3)])
def test_two_balls_meet_inelastically(masses):
    """Momentum is kept, the common velocity is that of the centre, and the energy of the relative motion is lost."""
    a, b = masses
    with motion(column(masses, 0.01, [3.0, -1.0]), 1e-3, **EXACT) as it:
        before = it.energy
        it.step(10)
        assert np.allclose(it.v[:, 0], (3 * a - b) / (a + b), rtol=1e-9)
        assert before - it.energy == pytest.approx(0.5 * a * b / (a + b) * 16.0, rel=1e-7)


def test_a_ball_pushes_a_row():
    """Newton's cradle without restitution: after many shocks all move together."""
    n = 6
    with motion(column(np.ones(n), 0.01, np.r_[1.0, np.zeros(n - 1)]), 2e-3, **EXACT) as it:
        energies = [it.step().energy for _ in range(120)]
        assert np.allclose(it.v, 1 / n, atol=1e-8)
        assert (np.diff(energies) <= 1e-12).all()


def test_a_block_slides_and_stops():
    """Coulomb friction: deceleration mu g until it stands still, and it stays."""
    mu, h, v0 = 0.3, 1e-3, 1.0
    scene = Scene(
        name="block", nodes=[[0.0, 0.0], [0.0, 0.0]], links=[[0, 1], [0, 1]], law=[Law.FRICTION, Law.TANGENT],
        stiffness=[0.0, 0.0], direction=[[0.0, 1.0], [1.0, 0.0]], friction=[mu, 0.0],
        fixed=[[True, True], [False, False]], load=[[0.0, 0.0], [0.0, -2.0 * G]], mass=[0.0, 2.0],
        velocity=[[0.0, 0.0], [v0, 0.0]],
    )  # fmt: skip
    with motion(scene, h, **EXACT) as it:
        for k in range(1, 401):
            it.step()
            assert it.v[1, 0] == pytest.approx(max(v0 - k * h * mu * G, 0.0), abs=1e-9)
            normal, tangent = it.tensions
            assert abs(tangent) <= mu * abs(normal) * (1 + 1e-9)
        assert it.v[1, 0] == pytest.approx(0.0, abs=1e-12)


def test_a_chain_settles_to_the_catenary():
    """Thrown about, a chain of inextensible links comes to rest in the tensions of the closed form."""
    scene = make("chain", links=16)
    rng = np.random.default_rng(0)
    thrown = np.where(scene.fixed, 0.0, rng.normal(scale=0.05, size=scene.nodes.shape))
    scene = replace(scene, mass=np.full(len(scene.nodes), 1.0 / 9.81 / 16), velocity=thrown)
    with motion(scene, 0.1, snes_stol=1e-9, snes_max_it=5000) as it:
        it.step(60)
        closed = np.array(scene.metadata["tensions"])
        found = it.tensions[scene.law == Law.INEXTENSIBLE]
        assert np.abs(found - closed).max() < 1e-3 * closed.max()
        assert np.abs(it.v).max() < 1e-4


# ---- complementarity ------------------------------------------------------------------------------


@pytest.mark.parametrize("bars", [True, False])
def test_a_step_is_the_complementarity_problem_16(bars):
    """Inextensible cables, with bars (16), (17) or alone: K_b is singular, the Delassus operator decides."""
    scene = heavy(floating(grid(modules=2, subdomains=4)), mass=20.0, speed=1.0)
    law = np.where(scene.law == Law.CABLE, Law.INEXTENSIBLE, scene.law)
    law = law if bars else np.full(len(law), Law.INEXTENSIBLE)
    scene = replace(scene, law=law, initial_elongation=np.where(law == Law.BAR, scene.initial_elongation, 0.0))
    scene = replace(scene, stiffness=np.where(law == Law.BAR, scene.stiffness, 0.0))
    h, rigid = 1e-3, law == Law.INEXTENSIBLE
    known = step(scene, h)
    assert 0 < np.count_nonzero(known.impulse) < len(known.impulse)
    b, _ = oracle.kinematics(replace(scene, law=np.zeros_like(law), stiffness=np.ones(len(law))))
    with motion(scene, h, **EXACT) as it:
        it.step()
        assert np.abs(it.v.ravel() - known.velocity).max() < 1e-8 * np.abs(known.velocity).max()
        rate = -(b @ it.v.ravel())[rigid]  # the impulses may not be unique where W is singular, the velocities are
        assert np.abs(rate - known.rate).max() < 1e-8 * np.abs(known.rate).max()
        assert it.tensions[rigid].min() >= 0.0
        assert abs(it.tensions[rigid] @ rate) < 1e-8 * np.abs(it.tensions).sum() * np.abs(rate).max()


# ---- invariants ------------------------------------------------------------------------------


def test_nothing_penetrates():
    """The gaps of links hold at the end of each step, of any length."""
    for h in (4e-3, 1e-3):
        with motion(hanging_chain(), h, snes_stol=1e-10, snes_max_it=5000) as it:
            b, e_d = oracle.kinematics(replace(it.scene, law=np.zeros(8, int), stiffness=np.ones(8)))
            strains = []
            while it.ts.getTime() < 0.6:
                it.step()
                strains.append((b @ it.u.ravel() + e_d + it.scene.initial_elongation).max())
            assert max(strains) < 1e-12
            assert max(strains) > -1e-12  # some link is taut


def test_energy_never_grows_through_shocks_and_momentum_is_kept():
    """Inelastic shocks dissipate; free structures keep their momentum to rounding whatever the stop."""
    scene = heavy(floating(grid(modules=4, subdomains=4)), mass=20.0, speed=1.0)
    law = np.where(scene.law == Law.CABLE, Law.INEXTENSIBLE, scene.law)
    scene = replace(scene, law=law, initial_elongation=np.where(law == Law.BAR, 0.0, -1e-4))
    scene = replace(scene, stiffness=np.where(law == Law.BAR, scene.stiffness, 0.0))
    with motion(scene, 1e-3, snes_stol=1e-8, snes_max_it=5000) as it:
        momentum = (scene.mass[:, None] * it.v).sum(axis=0)
        energies = [it.energy] + [it.step().energy for _ in range(10)]
        assert (np.diff(energies) <= 1e-6 * energies[0]).all()
        assert energies[-1] < 0.9 * energies[0]
        after = (scene.mass[:, None] * it.v).sum(axis=0)
        assert np.abs(after - momentum).max() < 1e-11 * np.abs(scene.mass[:, None] * it.v).sum()


def test_shocks_build_nothing_again():
    """Links that close and open change no operator; Newton's method has its own."""
    with logged(), motion(hanging_chain(), 2e-3, snes_latin_newton="never") as it:
        it.step()
        built = counts()
        active = set()
        for _ in range(200):
            it.step()
            active.add(np.count_nonzero(it.tensions))
        assert counts() == built
        assert len(active) > 2


RANKS = """
import json, sys
import petsc4py; petsc4py.init(sys.argv)
from mpi4py import MPI
from petsc4py import PETSc
sys.path.insert(0, {tests!r})
from test_shocks import hanging_chain, motion
with motion(hanging_chain(links=12, parts=4), 2e-3, comm=PETSc.COMM_WORLD, snes_stol=1e-10, snes_max_it=5000) as it:
    found = [[it.step().iterations, it.u.tolist(), it.tensions.tolist()] for _ in range(60)]
if MPI.COMM_WORLD.rank == 0:
    print(json.dumps(found[-1]))
"""


def test_the_number_of_ranks_does_not_matter(mpirun):
    """One, two and four ranks go through the same shocks."""
    from conftest import ROOT

    found = [json.loads(mpirun(ranks, RANKS.format(tests=str(ROOT / "tests"))).stdout) for ranks in (1, 2, 4)]
    for other in found[1:]:
        for a, b in zip(found[0][1:], other[1:]):
            assert np.abs(np.array(a) - np.array(b)).max() < 1e-6 * np.abs(a).max()


def test_integrators_that_cannot_say_so():
    """Newton's method and PETSc's own integrators need a stiffness."""
    scene = column([0.0, 1.0], 0.01, [0.0, 0.0], held=True)
    with motion(scene, 1e-3, **NEWTON) as it:
        assert "rigid law contact" in message(it.step)
    with motion(scene, 1e-3, **(NEWTON | {"ts_type": "alpha2"})) as it:
        assert "-ts_type latin" in message(it.step)


@pytest.mark.parametrize("dim", [1, 2, 3])
@pytest.mark.parametrize(("law", "away"), [(Law.CABLE, -1.0), (Law.COMPRESSION_ONLY, 1.0)])
@pytest.mark.parametrize("speed", [1.0, 100.0])
def test_a_mass_on_a_slack_link_flies_as_far_as_it_does(dim, law, away, speed):
    """Each step is strictly convex, however far from the structure: displacements are those of implicit Euler."""
    h, m, force = 0.1, 1e-4, 1e-3
    along = np.eye(dim)[0] * away
    scene = Scene(
        name="flight", nodes=np.outer([0.0, 1.0], np.eye(dim)[0]), links=[[0, 1]], law=[law], stiffness=[1.0],
        fixed=[[True] * dim, [False] * dim], load=np.outer([0.0, force], along), mass=[0.0, m],
        velocity=np.outer([0.0, speed], along),
    )  # fmt: skip
    with motion(scene, h) as it:
        u, v = 0.0, speed
        for _ in range(15):
            it.step()
            v += h * force / m
            u += h * v
            assert it.u[1] == pytest.approx(u * along, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize(("seed", "number", "steps"), [
    (71129, 382, 15), (71129, 956, 15), (90417733, 700, 15),  # rigid links hold what stops
    (590213847, 168, 15), (99, 283, 15),  # self-stresses of rigid links, whose rounding hides all other forces
    # stiffnesses far apart: Newton's method has no step to confirm
    (818283, 939, 15), (90417733, 555, 15), (118350926, 225, 15),
    (77123, 201, 60), (5550001, 81, 60),  # the latter to numbers whose squares are none
])  # fmt: skip
def test_a_motion_comes_to_rest(seed, number, steps):
    """What is left of its velocity is rounding of the forces: no step is refused, and all are right."""
    assert judge(replace(draw(seed, number, "motion"), steps=steps), {})["verdict"] == "right"


@pytest.mark.parametrize("light", [1e-4, 1e-8, 1e-9])
def test_what_moves_is_not_at_rest_for_light_nodes(light):
    """Rounding moves a light ball between heavy ones far, by itself: it still goes as fast as they do."""
    with motion(column([1.0, light, 1.0], 0.0, [1.0, 0.0, 0.0]), 1e-3) as it:
        for _ in range(3):
            it.step()
            assert it.ts.getSNES().getConvergedReason() > 0
            assert np.allclose(it.v[:, 0], 1.0 / (2.0 + light), rtol=3e-4)


def grains(**options):
    """Return a packing of unit masses that random velocities shake."""
    scene = make("packing", **options)
    velocity = np.where(scene.fixed, 0.0, np.random.default_rng(0).normal(0.0, 0.1, scene.nodes.shape))
    return replace(scene, mass=np.ones(len(scene.nodes)), velocity=velocity)


@pytest.mark.parametrize(
    ("h", "side", "friction"), [(1e-2, 20, 0.3), (1e-1, 20, 0.3), pytest.param(1e-2, 32, 0.6, marks=pytest.mark.slow)]
)
def test_grains_with_friction_settle(h, side, friction):
    """Discs, some of whose contacts are open: where the iteration stalls the interior-point method finds the step."""
    scene = grains(law="friction", side=side, friction=friction)
    with motion(scene, h) as it:
        for _ in range(8):
            u, v = it.u, it.v
            it.step()
            assert it.iterations < 600
            assert max(step_errors(scene, h, u, v, it.u, it.v, it.tensions).values()) < 1e-5


@pytest.mark.parametrize(("law", "most"), [("contact", 200), ("friction", 200)])
def test_steps_of_grains_at_rest_take_few_stages(law, most):
    """A step starts from the tensions of the one before it, whichever method has found them. Some grains slide on."""
    scene, stages = grains(law=law, side=20), []
    with motion(scene, 0.01) as it:
        for _ in range(30):
            u, v = it.u, it.v
            it.step()
            stages.append(it.iterations)
            assert max(step_errors(scene, 0.01, u, v, it.u, it.v, it.tensions).values()) < 1e-5
    assert max(stages) < 400
    assert np.median(stages[-5:]) < most


@pytest.mark.parametrize(
    ("options", "h"),
    [
        ({"law": "contact", "side": 28}, 0.01),
        ({"law": "elastic", "side": 20}, 0.1),
        ({"law": "elastic", "side": 8, "dim": 3}, 0.1),
        ({"law": "contact", "side": 8, "dim": 3}, 0.1),
    ],
)
def test_chains_of_contacts_in_motion(options, h):
    """Where contacts open and close in chains the interior-point method finds the step; it took thousands of stages."""
    scene, stages = grains(**options), []
    with motion(scene, h) as it:
        for _ in range(20):
            u, v = it.u, it.v
            it.step()
            stages.append(it.iterations)
            assert max(step_errors(scene, h, u, v, it.u, it.v, it.tensions).values()) < 1e-3
    assert np.median(stages) < 200


def test_light_balls_move_beside_heavy_grains_at_rest():
    """Rounding of great tensions at rest is no proof of what moves beside them: a row of balls, tied to each other."""
    packing, row = make("packing", law="contact", side=20), np.arange(6)
    n = len(packing.nodes)
    speed = 1e-5 * np.random.default_rng(1).normal(size=(6, 2))
    ties = np.tile(np.column_stack([row[:-1], row[1:]]), (2, 1))
    along = np.tile([1.0, 0.0], (10, 1))
    scene = replace(
        packing,
        nodes=np.vstack([packing.nodes, np.column_stack([row, 0 * row - 50.0])]),
        links=np.vstack([packing.links, n + ties]),
        law=np.append(packing.law, np.repeat([Law.INEXTENSIBLE, Law.CONTACT], 5)),
        stiffness=np.append(1e3 * packing.stiffness, np.zeros(10)),
        initial_elongation=np.append(packing.initial_elongation, np.zeros(10)),
        direction=np.vstack([packing.directions, along]),
        fixed=np.vstack([packing.fixed, np.zeros((6, 2), bool)]),
        prescribed=np.vstack([packing.prescribed, np.zeros((6, 2))]),
        load=np.vstack([1e3 * packing.load, np.zeros((6, 2))]),
        subdomain=np.zeros(len(packing.links) + 10, int),
        mass=np.append(np.ones(n), np.full(6, 1e-6)),
        velocity=np.vstack([np.zeros((n, 2)), speed]),
    )
    with motion(scene, 0.01) as it:
        for _ in range(4):
            it.step()
            assert np.allclose(it.v[n:, 0], speed[:, 0].mean(), rtol=0, atol=1e-3 * np.abs(speed).max())


def test_grains_with_friction_come_to_rest():
    """Displacements of a step at rest are rounding, no part of which is an error: such steps were refused."""
    scene = make("packing", law="friction", side=6)
    velocity = np.random.default_rng(0).normal(scale=0.1, size=scene.nodes.shape)
    scene = replace(scene, mass=np.ones(len(scene.nodes)), velocity=np.where(scene.fixed, 0.0, velocity))
    with motion(scene, 0.01) as it:
        energy = it.energy
        for _ in range(10):
            it.step()
            assert it.energy <= energy + 1e-8
            energy = it.energy
        assert np.median(np.abs(it.v)) < 1e-9


@pytest.mark.parametrize("h", [1e-2, 1.0])
def test_elastic_grains_at_rest_stay(h):
    """Links without tension slacken and tauten by rounding, and Newton's method followed: the step was refused."""
    packing = make("packing", law="elastic", side=6, seed=2)
    mass = np.where(packing.fixed.all(axis=1), 0.0, 1.0)
    still = move(replace(packing, mass=mass), 6, h, from_equilibrium=True, every=1)
    assert still.converged
    assert max(np.abs(frame.velocities).max() for frame in still.frames) < 1e-9 * h * np.abs(packing.load).max()
    first, last = (still.frames[k].tensions for k in (0, -1))
    assert np.abs(last - first).max() < 1e-9 * np.abs(first).max()


def grains_at_rest(side=8, balls=0, load=1.0):
    """Grains with friction, pressed together, and a row of light balls, tied to each other, beside them."""
    packing = make("packing", law="friction", side=side)
    n, row = len(packing.nodes), np.arange(balls)
    ties = n + np.tile(np.column_stack([row[:-1], row[1:]]), (2, 1)) if balls else np.zeros((0, 2), int)
    none, m = np.zeros((balls, 2)), len(ties)
    return replace(
        packing,
        nodes=np.vstack([packing.nodes, np.column_stack([row, 0 * row - 50.0])]),
        links=np.vstack([packing.links, ties]),
        law=np.append(packing.law, np.repeat([Law.INEXTENSIBLE, Law.CONTACT], m // 2)),
        stiffness=np.append(packing.stiffness, np.zeros(m)),
        initial_elongation=np.append(packing.initial_elongation, np.zeros(m)),
        direction=np.vstack([packing.directions, np.tile([1.0, 0.0], (m, 1))]),
        friction=np.append(packing.friction, np.zeros(m)),
        fixed=np.vstack([packing.fixed, none.astype(bool)]),
        prescribed=np.vstack([packing.prescribed, none]),
        load=np.vstack([load * packing.load, none]),
        subdomain=None,
        mass=np.append(np.where(packing.fixed.all(axis=1), 0.0, 1.0), np.full(balls, 1e-6)),
    )


def test_grains_with_friction_at_rest_cost_few_stages():
    """A step begins where nothing moves, as long as the same acts. Each had begun elsewhere, and taken a hundred."""
    scene, stages = grains_at_rest(), []
    with motion(scene, 0.01) as it:
        for _ in range(40):
            u, v = it.u, it.v
            it.step()
            stages.append(it.iterations)
            assert max(step_errors(scene, 0.01, u, v, it.u, it.v, it.tensions).values()) < 1e-5
        assert np.median(np.abs(it.v)) < 1e-9  # some grains go on without friction
    assert np.median(stages[-15:]) < 20


def test_light_balls_start_beside_grains_at_rest():
    """Pulled for one step, the row flies on as one body: rounding of great tensions beside it must not hide that."""
    scene, pull = grains_at_rest(balls=6, load=1e3), 1e-9 * np.arange(1.0, 7.0)
    with motion(scene, 0.01) as it:
        it.step(30)
        assert np.abs(it.v).max() < 1e-10
        load = scene.load.copy()
        load[-6:, 0] = pull
        for acts in (load, scene.load, scene.load):
            it.structure.set_load(acts)
            it.step()
            assert it.v[-6:, 0] == pytest.approx(0.01 * pull.mean() / 1e-6, rel=2e-3)


@pytest.mark.parametrize("name", STATES)
def test_grains_at_rest_go_on_from_a_file_to_the_bit(tmp_path, name):
    scene = grains_at_rest(side=6)
    with motion(scene, 0.01) as first, motion(scene, 0.01) as second:
        first.step(20)
        latinpc.save_state(first.ts, tmp_path / name)
        latinpc.load_state(second.ts, tmp_path / name)
        for acts in (scene.load, scene.load, 0.9 * scene.load, 0.9 * scene.load):
            for it in (first, second):
                it.structure.set_load(acts)
                it.step(2)
            assert first.iterations == second.iterations
            assert np.array_equal(first.tensions, second.tensions) and np.array_equal(first.v, second.v)


def test_light_balls_start_beside_elastic_grains_at_rest():
    """Balls of 1 mg on soft springs, pulled by 1 nN: implicit Euler written out, beside grains that bear kN."""
    packing, row, h, k, m, pull = make("packing", law="elastic", side=6, seed=2), np.arange(4), 0.01, 1e-2, 1e-6, 1e-9
    n, held = len(packing.nodes), np.repeat(row[:, None] == 0, 2, axis=1)
    springs = np.tile(np.column_stack([row[:-1], row[1:]]), (2, 1))
    scene = replace(
        packing,
        nodes=np.vstack([packing.nodes, np.column_stack([row, 0 * row - 50.0])]),
        links=np.vstack([packing.links, n + springs]),
        law=np.append(packing.law, np.full(6, Law.BAR)),
        stiffness=np.append(packing.stiffness, np.full(6, k)),
        initial_elongation=np.append(packing.initial_elongation, np.zeros(6)),
        direction=np.vstack([packing.directions, np.repeat(np.eye(2), 3, axis=0)]),
        fixed=np.vstack([packing.fixed, held]),
        prescribed=np.vstack([packing.prescribed, np.zeros((4, 2))]),
        load=np.vstack([packing.load, np.zeros((4, 2))]),
        subdomain=None,
        mass=np.append(np.where(packing.fixed.all(axis=1), 0.0, 1e3), np.where(held[:, 0], 0.0, m)),
    )
    with pytest.warns(latinpc.LatinWarning, match="free in some direction"):
        start = packing.solve().displacements
    stiffness = k * (2.0 * np.eye(3) - np.eye(3, k=1) - np.eye(3, k=-1))
    stiffness[-1, -1] = k
    u = v = np.zeros(3)
    with motion(scene, h, displacement=np.vstack([start, np.zeros((4, 2))])) as it:
        it.step(2)
        load = scene.load.copy()
        load[-1, 0] = pull
        it.structure.set_load(load)
        for _ in range(6):
            v = np.linalg.solve(m * np.eye(3) + h**2 * stiffness, m * v + h * (load[n + 1 :, 0] - stiffness @ u))
            u = u + h * v
            it.step()
            assert it.v[n + 1 :, 0] == pytest.approx(v, rel=1e-6)
