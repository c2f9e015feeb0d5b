"""Motions whose supports move from step to step: they push and pull rigid links, and turn links."""

import json
import sys
from dataclasses import replace

import large_motions
import numpy as np
import pytest
from large_motions import G, pendulum
from motions import EXACT, message, motion, one_mass
from petsc4py import PETSc
from scipy.integrate import solve_ivp
from support import STATES
from test_shocks import column

import latinpc
from latinpc.scenes import Law, Scene

H, MASS = 2e-3, 3.0


def table(step):
    """The height of a table after a step: it shakes by 1.5 g, and throws what lies on it."""
    return 0.03 * np.sin(np.sqrt(1.5 * G / 0.03) * step * H)


def shaken(it, first, last):
    """Heights, velocities and tensions of a ball on the table, as it makes some steps."""
    found = []
    for step in range(first, last):
        it.structure.set_prescribed([[table(step + 1)], [0.0]])
        it.step()
        found.append([it.u[1, 0], it.v[1, 0], it.tensions[0]])
    return np.array(found)


def ball():
    """A ball that lies on a table."""
    scene = column([0.0, MASS], 0.0, [0.0, 0.0], held=True)
    scene.load[1] = -MASS * G
    return scene


def by_hand(steps):
    """The same: a ball flies, but not below the table where that is at the end of a step."""
    u = v = 0.0
    found = []
    for step in range(steps):
        free = v - H * G
        new = max(free, (table(step + 1) - u) / H)
        found.append([u + H * new, new, -MASS * (new - free) / H])
        u, v = u + H * new, new
    return np.array(found)


def test_a_table_throws_a_ball():
    """And catches it; the ball had been left behind by a table that rose through it."""
    with motion(ball(), H, **EXACT) as it:
        found, expected = shaken(it, 0, 150), by_hand(150)
    assert np.abs(found - expected).max() < 1e-6 * np.abs(expected).max()
    flies = found[:, 2] == 0.0
    assert 20 < flies.sum() < 130 and np.diff(flies).sum() == 2


def test_a_rope_lifts_a_mass():
    """That cannot stretch."""
    scene = replace(one_mass(mass=MASS, load=MASS * G), law=np.array([Law.INEXTENSIBLE]), stiffness=np.zeros(1))
    with motion(scene, 1e-2, **EXACT) as it:
        for step in range(20):
            it.structure.set_prescribed([[-0.5e-2 * (step + 1)], [0.0]])
            it.step()
            assert it.u[1, 0] == pytest.approx(-0.5e-2 * (step + 1), abs=1e-9)
        assert it.tensions[0] == pytest.approx(MASS * G, rel=1e-9)


def test_supports_that_tear_a_rope_are_told():
    """A cable that cannot stretch, between two supports: it may slacken, and become taut, and no more."""
    scene = Scene(
        name="rope", nodes=[[0.0], [1.0], [2.0]], links=[[0, 1], [1, 2]], law=[Law.INEXTENSIBLE, Law.BAR],
        stiffness=[0.0, 10.0], fixed=[[True], [True], [False]], mass=[0.0, 0.0, 1.0],
    )  # fmt: skip
    with motion(scene, H, **EXACT) as it:
        for place in (0.0, -0.1, 0.0):
            it.structure.set_prescribed([[0.0], [place], [0.0]])
            it.step(2)
        it.structure.set_prescribed([[0.0], [0.01], [0.0]])
        assert "The gaps of the rigid link 0 are incompatible: look at the supports that move" in message(it.step)


@pytest.mark.parametrize("law", [Law.CONTACT, Law.INEXTENSIBLE, Law.FRICTION])
def test_supports_that_jam_a_row_are_told(law):
    """A row of masses between two walls, one of which moves: no motion of the masses follows, and none is claimed."""
    n, parts = 6, 2 if law == Law.FRICTION else 1
    ends = np.column_stack([np.arange(n - 1), np.arange(1, n)])
    fixed = np.zeros((n, 2), bool)
    fixed[[0, -1]] = True
    scene = Scene(
        name="row", nodes=np.outer(np.arange(n), [1.0, 0.0]), links=np.repeat(ends, parts, axis=0),
        law=[law, Law.TANGENT][:parts] * (n - 1), stiffness=np.zeros(parts * (n - 1)), fixed=fixed, mass=np.ones(n),
        direction=np.tile(np.eye(2)[:parts], (n - 1, 1)), friction=np.full(parts * (n - 1), 0.3 * (parts - 1)),
    )  # fmt: skip
    way = -1.0 if law == Law.INEXTENSIBLE else 1.0
    with motion(scene, 1e-2) as it:
        it.structure.set_prescribed(np.outer(np.eye(n)[0], [0.01 * way, 0.0]))
        said = message(it.step)
        assert "Step 1, from 0. to 0.01, has not converged: DIVERGED" in said
        assert (
            f"gaps of the rigid links {', '.join(map(str, range(0, parts * (n - 1), parts)))} are incompatible" in said
        )
        assert it.iterations < 2500  # those of the interior-point method, and of a search for the gaps
        assert latinpc.jammed_links(it.ts.getSNES()) == (n - 1, list(range(0, parts * (n - 1), parts)))


@pytest.mark.parametrize("masses", [1, 2])
@pytest.mark.parametrize("friction", [0.1, 0.19, 0.21, 0.6])
def test_walls_that_close_push_masses_out_or_wedge_them(friction, masses):
    """Their normals rise by 0.2: masses slip out if friction is below tan 0.2, else no motion obeys the laws."""
    c, s = np.cos(0.2), np.sin(0.2)
    walls, count = [masses, masses + 1], 4 * masses
    scene = Scene(
        name="wedge", nodes=[*([0.0, float(i)] for i in range(masses)), [-c, -s], [c, -s]],
        links=[[wall, i] for i in range(masses) for wall in np.repeat(walls, 2)],
        law=[Law.FRICTION, Law.TANGENT] * (count // 2), stiffness=np.zeros(count),
        fixed=np.repeat(np.arange(masses + 2) >= masses, 2).reshape(-1, 2),
        direction=np.tile([[c, s], [-s, c], [-c, s], [s, c]], (masses, 1)),
        friction=np.tile([friction, 0.0], count // 2), mass=np.array([MASS] * masses + [0.0] * 2),
    )  # fmt: skip
    with motion(scene, 1e-2) as it:
        it.structure.set_prescribed([[0.0, 0.0]] * masses + [[1e-3, 0.0], [-1e-3, 0.0]])
        if friction < np.tan(0.2):
            it.step()
            assert it.u[:masses] == pytest.approx(np.array([[0.0, 1e-3 / np.tan(0.2)]] * masses), abs=1e-7)
            return
        said = message(it.step)
        assert "the step may have no solution, as where supports that move wedge nodes between contacts" in said
        assert "that -snes_max_it allows were not enough" not in said


def test_a_belt_drags_a_block():
    """Friction takes it along: it speeds up by mu g, until it has the velocity of the belt."""
    mu, speed, h = 0.3, 1.0, 1e-2
    scene = Scene(
        name="belt", nodes=[[0.0, 0.0], [0.0, 1.0]], links=[[0, 1], [0, 1]], law=[Law.FRICTION, Law.TANGENT],
        stiffness=[0.0, 0.0], initial_elongation=[0.0, 0.0], direction=[[0.0, 1.0], [1.0, 0.0]], friction=[mu, 0.0],
        fixed=[[True, True], [False, False]], load=[[0.0, 0.0], [0.0, -MASS * G]], mass=[0.0, MASS],
    )  # fmt: skip
    with motion(scene, h, **EXACT) as it:
        for step in range(1, 51):
            it.structure.set_prescribed([[speed * h * step, 0.0], [0.0, 0.0]])
            it.step()
            assert it.v[1] == pytest.approx([min(mu * G * h * step, speed), 0.0], abs=1e-7)


@pytest.mark.parametrize("name", STATES)
def test_a_motion_goes_on_from_a_file(tmp_path, name):
    """With supports where they were, whatever the structure is made with."""
    with motion(ball(), H, **EXACT) as first, motion(ball(), H, **EXACT) as second:
        shaken(first, 0, 12)
        latinpc.save_state(first.ts, tmp_path / name)
        latinpc.load_state(second.ts, tmp_path / name)
        assert np.array_equal(first.tensions, second.tensions)
        assert np.array_equal(shaken(first, 12, 60), shaken(second, 12, 60))


@pytest.mark.parametrize("ranks", [1, 2])
def test_the_number_of_ranks_does_not_matter(mpirun, ranks):
    """Two balls above each other on a table that rises."""
    found = np.array(json.loads(mpirun(ranks, __file__).stdout))
    assert found == pytest.approx([0.2, 0.2], abs=1e-8)


def test_a_pendulum_whose_pivot_moves():
    """Of second order with displacements prescribed for the end of each step, beside an integrator of high order."""
    k, (x, y) = 1e3, np.array(pendulum()["nodes"][1])

    def pivot(t):
        return np.array([0.2 * np.sin(5.0 * t), 0.1 * np.sin(3.0 * t)])

    def rate(t, s):
        r = np.array([x, y]) + s[:2] - pivot(t)
        size = np.hypot(*r)
        return [*s[2:], *(-k * (size - 1.0) * r / size - np.array([0.0, G]))]

    exact = solve_ivp(rate, (0.0, 1.0), np.zeros(4), rtol=1e-11, atol=1e-12).y[:2, -1]
    missed = []
    for steps in (100, 200):
        with large_motions.motion(pendulum(stiffness=k), 1.0 / steps) as it:
            for i in range(steps):
                it.structure.set_prescribed([pivot((i + 1) / steps), [0.0, 0.0]])
                it.step()
            missed.append(np.abs(it.u[1] - exact).max())
    assert missed[1] < 5e-3
    assert missed[0] / missed[1] == pytest.approx(4.0, rel=0.1)


def test_an_event_in_the_first_step():
    """The step is made again, from where the supports were."""

    def heights(threshold):
        structure = latinpc.Structure(
            [[0.0], [1.0]], [[0, 1]], "bar", 1e4, fixed=[[1], [0]], mass=[0, 1.0], comm=PETSc.COMM_SELF
        )
        u, v = structure.create_vec(), structure.create_vec()
        structure.set_displacements([[0.0], [1.0]], v)
        ts = structure.create_ts(u, v)
        ts.setTimeStep(1e-3)
        ts.setMaxTime(5e-3)
        ts.setExactFinalTime(PETSc.TS.ExactFinalTime.MATCHSTEP)
        ts.setPreStep(lambda ts: structure.set_prescribed([[ts.getTime() + ts.getTimeStep()], [0.0]]))
        times = []
        ts.setEventHandler(
            [0], [False], lambda ts, t, u, f: f.__setitem__(0, structure.displacements(u)[1, 0] - threshold),
            lambda ts, events, t, u, forward: times.append(t),
        )  # fmt: skip
        ts.setEventTolerances(1e-9)
        ts.setFromOptions()
        ts.solve(u)
        return structure.displacements(u), times

    end, times = heights(1e-4)
    assert times == [pytest.approx(1e-4, rel=1e-2)]
    assert end == pytest.approx(heights(10.0)[0], rel=1e-3)  # of steps that are not divided
    assert np.isclose(end[0, 0], 5e-3)


def job():
    """On ranks."""
    scene = column([0.0, 1.0, 2.0], 0.0, [0.0, 0.0, 0.0], held=True)
    with motion(scene, 1e-2, comm=PETSc.COMM_WORLD, **EXACT) as it:
        for i in range(20):
            it.structure.set_prescribed([[0.01 * (i + 1)], [0.0], [0.0]])
            it.step()
        heights = it.u[1:, 0].tolist()
    if PETSc.COMM_WORLD.getRank() == 0:
        print(json.dumps(heights))


if __name__ == "__main__":
    sys.exit(job())
