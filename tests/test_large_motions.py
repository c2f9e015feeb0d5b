"""Motions of links that turn: energy and momenta stay, closed forms, the scheme written out, ranks, refusals."""

import json
import sys
from contextlib import contextmanager

import numpy as np
import pytest
import turning
from conftest import run
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from petsc4py import PETSc
from scipy.optimize import root
from scipy.special import ellipk
from support import STATES
from test_checkpoints import launch, result
from test_properties import EXAMPLES
from turning import net

import latinpc

G = 9.81
NEWTON = {"snes_type": "newtonls", "ksp_type": "preonly", "pc_type": "lu", "snes_linesearch_type": "basic"}
NEWTON |= {"snes_rtol": 1e-13, "snes_stol": 1e-14, "snes_atol": 1e-10}


class Motion:
    """A TS on a structure; `u`, `v` and the energy are those after each step."""

    def __init__(self, structure, h, u=None, v=None):
        self.structure = latinpc.Structure(**structure, geometry="large")
        self.fixed, self.mass = np.asarray(structure["fixed"], bool), np.asarray(structure["mass"])[:, None]
        self.nodes = np.asarray(structure["nodes"], float)
        self.vec_u, self.vec_v = self.structure.create_vec(), self.structure.create_vec()
        for given_, vec in ((u, self.vec_u), (v, self.vec_v)):
            if given_ is not None:
                self.structure.set_displacements(given_, vec)
        self.ts = self.structure.create_ts(self.vec_u, self.vec_v)
        self.ts.setTimeStep(h)
        self.ts.setMaxSteps(10**6)

    def step(self, n=1):
        for _ in range(n):
            self.ts.step()
        return self

    @property
    def u(self):
        return self.structure.displacements(self.vec_u)

    @property
    def v(self):
        return np.where(self.fixed, 0.0, self.structure.displacements(self.vec_v))

    @property
    def energy(self):
        return self.structure.energy(self.vec_u) + self.structure.kinetic_energy(self.vec_v)

    @property
    def momenta(self):
        """Linear and angular momentum."""
        p, x = self.mass * self.v, self.nodes + self.u
        turn = np.cross(x, p) if x.shape[1] == 3 else x[:, 0] * p[:, 1] - x[:, 1] * p[:, 0]
        return np.append(p.sum(axis=0), turn.sum(axis=0))


@contextmanager
def motion(structure, h, u=None, v=None, **options):
    """Give a Motion with these options of the solver of its steps."""
    database, prefix = PETSc.Options(), "turning_motion_"
    it = Motion(structure, h, u, v)
    it.ts.setOptionsPrefix(prefix)
    for key, value in options.items():
        database[prefix + key] = value
    try:
        it.ts.setFromOptions()
        yield it
    finally:
        it.ts.destroy()
        for key in options:
            database.delValue(prefix + key)


def pendulum(angle=1.0, stiffness=1e5):
    """A mass of 1 kg on a bar of 1 m."""
    nodes = [[0.0, 0.0], [np.sin(angle), -np.cos(angle)]]
    structure = {"nodes": nodes, "links": [[0, 1]], "law": "bar", "stiffness": stiffness, "mass": [0.0, 1.0]}
    return structure | {"fixed": [[True, True], [False, False]], "load": [[0.0, 0.0], [0.0, -G]]}


def free(nodes, links, law, stiffness, mass):
    """A structure that nothing holds or loads."""
    nodes = np.asarray(nodes, float)
    structure = {"nodes": nodes, "links": links, "law": law, "stiffness": stiffness, "mass": mass}
    return structure | {"fixed": np.zeros(nodes.shape, bool), "load": np.zeros(nodes.shape)}


def wheel(count=12, stiffness=1e5):
    """A hub, a rim and spokes."""
    angle = 2.0 * np.pi * np.arange(count) / count
    nodes = np.concatenate([[[0.0, 0.0]], np.column_stack([np.cos(angle), np.sin(angle)])])
    rim = [(k + 1, (k + 1) % count + 1) for k in range(count)]
    return free(nodes, [(0, k + 1) for k in range(count)] + rim, "bar", stiffness, np.ones(count + 1))


def shaken(speed=5.0, mass=5.0, cells=6, rise=1.0, load=-200.0):
    """A saddle of cables, and random velocities: some slacken."""
    structure = net(cells, rise, [0.0, 0.0, load])
    v = np.random.default_rng(0).normal(size=structure["nodes"].shape) * speed
    return structure | {"mass": np.full(len(v), mass)}, np.where(structure["fixed"], 0.0, v)


def mean_forces(structure, r0, r1):
    """The force of each link of a bar or a cable in a step, written out: W(x1) - W(x0) over R1 - R0, along r0 + r1."""
    nodes, links, k = structure["nodes"], np.asarray(structure["links"]), np.asarray(structure["stiffness"])
    cable = np.broadcast_to(np.asarray(structure["law"]) == "cable", len(links))
    drawn = np.linalg.norm(nodes[links[:, 1]] - nodes[links[:, 0]], axis=1)
    natural = drawn - np.asarray(structure["prestress"]) / k
    R0, R1 = np.linalg.norm(r0, axis=1), np.linalg.norm(r1, axis=1)
    x0, x1 = R0 - natural, R1 - natural
    lower = np.where(cable, 0.0, -np.inf)
    y0, y1 = np.maximum(x0, lower), np.maximum(x1, lower)
    near = np.abs(x1 - x0) < 1e-9
    tension = np.where(near, k * y0, 0.5 * k * (y1**2 - y0**2) / np.where(near, 1.0, x1 - x0))
    return (tension / (R0 + R1))[:, None] * (r0 + r1)


def written_out(structure, u, v, h, steps):
    """The same steps by scipy."""
    links, free_ = np.asarray(structure["links"]), ~np.asarray(structure["fixed"], bool)
    span = structure["nodes"][links[:, 1]] - structure["nodes"][links[:, 0]]
    mass = np.repeat(structure["mass"][:, None], u.shape[1], axis=1)

    def left(change, u, v):
        d = np.zeros(u.shape)
        d[free_] = change
        f = mean_forces(
            structure, span + u[links[:, 1]] - u[links[:, 0]], span + (u + d)[links[:, 1]] - (u + d)[links[:, 0]]
        )
        r = mass * 2.0 / h * (d / h - v) - structure["load"]
        np.add.at(r, links[:, 0], -f)
        np.add.at(r, links[:, 1], f)
        return r[free_]

    for _ in range(steps):
        d = np.zeros(u.shape)
        d[free_] = root(left, h * v[free_], (u, v), tol=1e-13).x
        u, v = u + d, 2.0 * d / h - v
    return u, v


# ---- closed forms -----------------------------------------------------------------------------------
def test_a_pendulum_swings_for_ever():
    """Energy stays over many swings; the period is that of the elliptic integral, of second order in the step."""
    exact, missed = 4.0 * np.sqrt(1.0 / G) * ellipk(np.sin(0.5) ** 2), []
    for h in (0.02, 0.01):
        with motion(pendulum(stiffness=1e6), h) as it:
            start, x = it.energy, []
            for _ in range(round(10.0 / h)):
                it.step()
                x.append(it.nodes[1, 0] + it.u[1, 0])
                assert abs(it.energy - start) < 1e-5
        x = np.array(x)
        down = np.flatnonzero((x[:-1] > 0.0) & (x[1:] <= 0.0))
        assert len(down) > 3
        missed.append(abs(np.diff(down + x[down] / (x[down] - x[down + 1])).mean() * h - exact))
    assert missed[1] < 1e-3 * exact
    assert missed[0] / missed[1] == pytest.approx(4.0, rel=0.2)


def test_a_link_spins_and_flies():
    """Without forces from outside: energy, momentum and angular momentum stay, many turns on."""
    structure = free([[0.0, 0.0], [1.0, 0.0]], [[0, 1]], "bar", 1e6, [1.0, 2.0])
    with motion(structure, 0.02, v=[[0.3, -2.0], [0.3, 4.0]], snes_latin_error=1e-10) as it:
        energy, momenta = it.energy, it.momenta
        it.step(300)
        assert it.energy == pytest.approx(energy, rel=1e-7)
        assert it.momenta == pytest.approx(momenta, abs=1e-6 * abs(momenta).max())
        assert np.linalg.norm(np.diff(it.nodes + it.u, axis=0)) == pytest.approx(1.0, abs=1e-3)


def test_a_slack_cable_catches_a_mass():
    """It falls freely, and sinks as far as its energy says; what the cable has taken it gives back."""
    k, length, h = 2e3, 1.0, 5e-4
    structure = pendulum() | {"nodes": np.array([[0.0, 0.0], [0.0, -0.3]]), "law": "cable", "stiffness": k}
    structure["initial_elongation"] = 0.3 - length
    with motion(structure, h) as it:
        start, heights, tensions = it.energy, [], []
        for _ in range(1900):
            it.step()
            heights.append(it.u[1, 1] - 0.3)
            tensions.append(latinpc.step_tensions(it.ts)[0])
            assert abs(it.energy - start) < 1e-7
    stretch = (G + np.sqrt(G**2 + 2.0 * k * G * (length - 0.3))) / k  # 1/2 k s^2 = G (l - 0.3 + s)
    assert min(heights) == pytest.approx(-length - stretch, abs=1e-4)
    falling = round(np.sqrt(2.0 * (length - 0.3) / G) / h) - 2
    t = h * np.arange(1, falling + 1)
    assert heights[:falling] == pytest.approx(-0.3 - 0.5 * G * t**2, abs=1e-9)
    assert not np.any(tensions[:falling])
    assert max(heights[falling:]) == pytest.approx(-0.3, abs=2e-2)
    assert np.array(tensions).min() == 0.0 and max(tensions) == pytest.approx(k * stretch, rel=1e-2)


@pytest.mark.parametrize("h", [0.005, 0.001])
def test_a_pendulum_bounces_on_a_floor(h):
    """An elastic contact keeps its normal, and gives back what it takes: energy stays."""
    structure = pendulum() | {"nodes": np.array([[0.0, 0.0], [1.0, 0.0], [1.5, -0.8]]), "links": [[0, 1], [2, 1]]}
    structure |= {"law": ["bar", "compression_only"], "stiffness": [1e5, 1e4], "initial_elongation": [0.0, 0.8]}
    structure |= {
        "direction": [[0.0, 0.0], [0.0, 1.0]],
        "mass": [0.0, 1.0, 0.0],
        "load": [[0.0, 0.0], [0.0, -G], [0.0, 0.0]],
    }
    structure |= {"fixed": [[True, True], [False, False], [True, True]]}
    with motion(structure, h) as it:
        lowest, highest, touched = 0.0, -1.0, False
        for _ in range(round(2.0 / h)):
            it.step()
            assert abs(it.energy) < 1e-6
            lowest, touched = min(lowest, it.u[1, 1]), touched or latinpc.step_tensions(it.ts)[1] < 0.0
            highest = max(highest, it.u[1, 1]) if touched else highest
        assert -0.85 < lowest < -0.8 and highest > -0.05


def test_small_amplitudes_are_those_of_prestress():
    """The implicit midpoint rule of M a + K u = 0 with the tangent stiffness of the prestressed net."""
    structure = net(6, 0.0, [0.0, 0.0, 0.0])
    open_, h, steps, mass = ~structure["fixed"].ravel(), 0.01, 40, 2.0
    s = latinpc.Structure(**structure, geometry="prestress")
    J = s.dm.createMat()
    s.jacobian(s.create_vec(), J)
    order = np.argsort(s.displacements(PETSc.Vec().createWithArray(np.arange(1.0, open_.sum() + 1))).ravel()[open_])
    K = np.empty(2 * (open_.sum(),))
    K[np.ix_(order, order)] = J.convert("dense").getDenseArray()
    v = np.random.default_rng(2).normal(size=open_.sum())
    start = np.zeros(structure["fixed"].size)
    start[open_] = 1e-6 * v
    with motion(structure | {"mass": np.full(len(structure["nodes"]), mass)}, h, v=start.reshape(-1, 3)) as it:
        it.step(steps)
        found = it.u.ravel()[open_]
    u = np.zeros(open_.sum())
    for _ in range(steps):
        d = np.linalg.solve(4.0 * mass / h**2 * np.eye(len(u)) + K, 2.0 * mass / h * v - K @ u)
        u, v = u + 2.0 * d, 4.0 * d / h - v
    assert np.linalg.norm(1e6 * found - u) < 1e-5 * np.linalg.norm(u)


def test_an_equilibrium_stays():
    """Of a net that sags, as SNES latin finds it."""
    structure = net(6, 1.0, [0.0, 0.0, -300.0])
    at_rest = turning.solve(structure, error=1e-12).displacements
    with motion(structure | {"mass": np.full(len(at_rest), 3.0)}, 0.01, u=at_rest) as it:
        it.step(20)
        assert np.abs(it.u - at_rest).max() < 1e-9


@pytest.mark.parametrize("speed", [0.0, 1e-11, 1e-8, 1e-5, 1e-2])
@pytest.mark.parametrize("rise", [0.0, 1.0])
def test_slow_motions(speed, rise):
    """Rounding of tensions is no motion: a net near its equilibrium, and one that its prestress moves."""
    structure, v = shaken(speed, rise=rise, load=0.0)
    with motion(structure, 0.005, v=v) as it:
        start = it.energy
        for _ in range(20):
            it.step()
            assert it.ts.getSNES().getIterationNumber() < 30
        assert abs(it.energy - start) < 1e-12 * start
        assert np.abs(it.v).max() <= (10.0 * speed if rise == 0.0 else 0.1)


# ---- every step is the right one --------------------------------------------------------------------
@pytest.mark.parametrize(
    "options", [{"snes_latin_error": 1e-11}, NEWTON, {"snes_latin_stop": "indicator", "snes_stol": 1e-12}]
)
def test_steps_are_those_written_out(options):
    """SNES latin, its iteration alone, newtonls, and scipy: cables slacken, and a strut turns."""
    structure, v = shaken(cells=3, speed=8.0)
    law = np.full(len(structure["links"]), "cable", dtype=object)
    law[::3] = "bar"
    structure["law"] = list(law)
    structure["prestress"] = np.full(len(law), structure["prestress"])
    u, w = written_out(structure, np.zeros(v.shape), v, 0.01, 6)
    with motion(structure, 0.01, v=v, **options) as it:
        slack = 0
        for _ in range(6):
            it.step()
            slack = max(slack, np.count_nonzero(latinpc.step_tensions(it.ts)[law == "cable"] == 0.0))
        assert np.abs(it.u - u).max() < 1e-8 * np.abs(u).max()
        assert np.abs(it.v - w).max() < 1e-8 * np.abs(w).max()
    assert slack > 0


@pytest.mark.parametrize("variant", ["primal", "macro", "corner", "none", "published"])
def test_variants_make_the_same_steps(variant):
    """And subdomains."""
    structure, v = shaken()
    found = []
    for options in (NEWTON, {"snes_latin_variant": variant, "snes_latin_subdomains": 4, "snes_latin_error": 1e-10}):
        with motion(structure, 0.005, v=v, **options) as it:
            found.append(it.step(10).u)
    assert np.abs(found[1] - found[0]).max() < 1e-7 * np.abs(found[0]).max()


def test_generalised_alpha_goes_the_same_way():
    """PETSc's own integrator on the displaced structure: both are of second order, and so is their difference."""
    far = []
    for h in (0.01, 0.005):
        found = []
        for options in ({}, NEWTON | {"ts_type": "alpha2", "ts_alpha_radius": 1.0}):
            with motion(pendulum(2.0, 1e3), h, v=[[0.0, 0.0], [1.0, 0.0]], **options) as it:
                found.append(it.step(round(0.5 / h)).u)
        far.append(np.abs(found[1] - found[0]).max())
    assert far[1] < 0.3 * far[0] < 0.01


def test_the_derivative_of_a_step():
    """Central differences, extrapolated, of the forces of a step; not symmetric."""
    structure, v = shaken(cells=3)
    with motion(structure | {"law": "bar"}, 0.01, v=v, **NEWTON) as it:  # smooth everywhere
        it.step(2)
        snes = it.ts.getSNES()
        w, r, J = it.vec_u.duplicate(), it.vec_u.duplicate(), snes.getJacobian()[0]
        rng = np.random.default_rng(3)
        w.setArray(0.02 * rng.normal(size=w.getLocalSize()))
        snes.computeJacobian(w, J)
        dense = J.convert("dense").getDenseArray()
        direction = rng.normal(size=w.getLocalSize())

        def slope(h):
            sides = []
            for sign in (1.0, -1.0):
                at = w.copy()
                at.setArray(w.getArray() + sign * h * direction)
                snes.computeFunction(at, r)
                sides.append(r.getArray().copy())
            return (sides[0] - sides[1]) / (2.0 * h)

        found = (4.0 * slope(5e-5) - slope(1e-4)) / 3.0
        assert np.abs(found - dense @ direction).max() < 1e-9 * np.abs(dense @ direction).max()
        assert np.abs(dense - dense.T).max() > 1e-4 * np.abs(dense).max()


# ---- invariants --------------------------------------------------------------------------------------
@st.composite
def structures(draw):
    """Points anywhere, bars, cables and struts that bear compression alone between them, masses and velocities."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    dim, count = draw(st.sampled_from([2, 3])), draw(st.integers(2, 9))
    nodes = rng.normal(size=(count, dim))
    pairs = np.array([(a, b) for a in range(count) for b in range(a + 1, count)])
    links = pairs[np.unique(rng.integers(0, len(pairs), 2 * count))]
    length = np.linalg.norm(nodes[links[:, 1]] - nodes[links[:, 0]], axis=1)
    law = rng.choice(["bar", "cable", "compression_only"], len(links))
    stiffness = 10.0 ** rng.uniform(1.0, 4.0, len(links))
    used = np.isin(np.arange(count), links)
    structure = {
        "nodes": nodes,
        "links": links,
        "law": list(law),
        "stiffness": stiffness,
        "mass": rng.uniform(0.5, 2.0, count),
    }
    structure["initial_elongation"] = rng.uniform(-0.2, 0.1, len(links)) * length
    structure["fixed"] = np.zeros(nodes.shape, bool)
    if draw(st.booleans()):
        structure["fixed"][links[0, 0]] = True
    load = draw(st.sampled_from([0.0, 1.0])) * rng.normal(size=nodes.shape)
    structure["load"] = np.where(structure["fixed"] | ~used[:, None], 0.0, load)
    return structure, 10.0 ** rng.uniform(-1.0, 1.0) * rng.normal(size=nodes.shape), 10.0 ** rng.uniform(-3.0, -1.0)


@settings(max_examples=max(EXAMPLES // 4, 20), deadline=None, suppress_health_check=list(HealthCheck))
@given(structures())
def test_energy_and_momenta_of_random_structures(drawn):
    """They stay, whatever the structure and the step; momenta where nothing holds or loads it."""
    structure, v, h = drawn
    with motion(structure, h, v=v, snes_latin_error=1e-11) as it:
        it.ts.setErrorIfStepFails(False)
        stiff = np.asarray(structure["stiffness"])
        for _ in range(5):
            energy, momenta, speed = it.energy, it.momenta, it.v
            it.step()
            if it.ts.getSNES().getConvergedReason() <= 0:
                return
            size = abs(energy) + (it.mass * speed**2).sum() + (stiff * structure["initial_elongation"] ** 2).sum()
            assert abs(it.energy - energy) < 1e-7 * size
            if not structure["fixed"].any() and not structure["load"].any():
                whole = (it.mass * abs(speed)).sum() * (1.0 + np.abs(it.nodes + it.u).max())
                assert np.abs(it.momenta - momenta).max() < 1e-8 * whole


def test_few_steps_of_random_structures_fail():
    """What the test above passes over."""
    failed = 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        nodes = rng.normal(size=(7, 3))
        links = np.array([(a, b) for a in range(7) for b in range(a + 1, 7)])[rng.permutation(21)[:14]]
        length = np.linalg.norm(nodes[links[:, 1]] - nodes[links[:, 0]], axis=1)
        law = list(rng.choice(["bar", "cable"], 14))
        structure = free(nodes, links, law, 10.0 ** rng.uniform(1.0, 4.0, 14), rng.uniform(0.5, 2.0, 7))
        structure["initial_elongation"] = rng.uniform(-0.2, 0.1, 14) * length
        with motion(structure, 10.0 ** rng.uniform(-3.0, -1.0), v=5.0 * rng.normal(size=(7, 3))) as it:
            it.ts.setErrorIfStepFails(False)
            it.step(5)
            failed += it.ts.getSNES().getConvergedReason() <= 0
    assert failed <= 1


def test_energy_stays_by_a_table():
    """A bar that softens, in a wheel that turns and shakes."""
    law = latinpc.register_table([-1.0, -0.01, 0.01, 1.0], [-298.0, -100.0, 100.0, 298.0], "softening bar")
    structure = wheel(stiffness=1e4) | {"law": law}
    v = 3.0 * np.column_stack([-structure["nodes"][:, 1], structure["nodes"][:, 0]])
    v += np.random.default_rng(1).normal(size=v.shape)
    with motion(structure, 0.01, v=v, snes_latin_error=1e-10) as it:
        energy, momenta = it.energy, it.momenta
        it.step(60)
        assert it.energy == pytest.approx(energy, rel=1e-7)
        assert it.momenta == pytest.approx(momenta, abs=1e-6 * abs(momenta).max())
        stretch = np.linalg.norm(np.diff((it.nodes + it.u)[structure["links"]], axis=1)[:, 0], axis=1)
        assert (
            abs(stretch / np.linalg.norm(np.diff(it.nodes[structure["links"]], axis=1)[:, 0], axis=1) - 1.0).max()
            > 0.01
        )


@pytest.mark.parametrize(("stiffness", "h"), [(1e4, 0.01), (1e6, 0.05)])
def test_a_wheel_turns(stiffness, h):
    """By half a radian a step, stiff as it may be: operators follow where they no longer serve."""
    structure = wheel(stiffness=stiffness)
    v = 10.0 * np.column_stack([-structure["nodes"][:, 1], structure["nodes"][:, 0]]) + [1.0, 0.0]
    with motion(structure, h, v=v, snes_latin_subdomains=3) as it:
        energy, momenta = it.energy, it.momenta
        it.step(100)
        assert it.energy == pytest.approx(energy, rel=1e-5)
        assert it.momenta == pytest.approx(momenta, abs=1e-5 * abs(momenta).max())


def test_rotated_structures_move_alike():
    """Nothing depends on the axes."""
    structure, v = shaken()
    Q = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    turned = structure | {"nodes": structure["nodes"] @ Q.T, "load": structure["load"] @ Q.T}
    with motion(structure, 0.005, v=v) as plain, motion(turned, 0.005, v=v @ Q.T) as rotated:
        assert np.abs(rotated.step(10).u - plain.step(10).u @ Q.T).max() < 1e-6


# ---- what a step builds, ranks, states ---------------------------------------------------------------
def test_operators_stay():
    """A net that shakes keeps those of the first step."""
    structure, v = shaken()
    with motion(structure, 0.005, v=v) as it:
        renewals = 0
        for _ in range(20):
            it.step()
            renewals += latinpc.path(it.ts.getSNES())["renewals"]
        assert renewals == 0
        assert it.ts.getSNES().getIterationNumber() < 45


@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_ranks_change_nothing(mpirun, ranks):
    """The same motion on any number of ranks."""
    found = json.loads(mpirun(ranks, __file__).stdout)
    structure, v = shaken()
    with motion(structure, 0.005, v=v, **NEWTON) as it:
        it.step(10)
        assert found["norm"] == pytest.approx(np.linalg.norm(it.u), rel=1e-7)
        assert found["energy"] == pytest.approx(it.energy, rel=1e-8)


@pytest.mark.parametrize("name", STATES)
@pytest.mark.parametrize("turns", [False, True])
def test_states_resume_to_the_bit(tmp_path, name, turns):
    """Also where operators are those of an earlier step, or have been made anew."""
    structure, v = shaken()
    if turns:
        structure = wheel(stiffness=1e6)
        v = 10.0 * np.column_stack([-structure["nodes"][:, 1], structure["nodes"][:, 0]])
    options = {"snes_latin_subdomains": 3, "snes_latin_variant": "macro" if turns else "auto"}
    with motion(structure, 0.01, v=v, **options) as first, motion(structure, 0.01, **options) as second:
        first.step(30)
        latinpc.save_state(first.ts, tmp_path / name)
        tensions = latinpc.step_tensions(first.ts)
        latinpc.load_state(second.ts, tmp_path / name)
        assert np.array_equal(latinpc.step_tensions(second.ts), tensions)
        first.step(30)
        second.step(30)
        second_u = second.u
        assert np.array_equal(first.u, second_u) and np.array_equal(first.v, second.v)
        assert first.ts.getTime() == second.ts.getTime()
    with motion(structure, 0.01, v=v, **options) as whole:
        assert np.array_equal(whole.step(60).u, second_u)


def test_the_command_line(tmp_path):
    """A scene, an option; a run that goes on from a checkpoint ends as one that does not."""
    words = ["tensegrity-grid", "--modules", 4, "--step", 1e-3, "--node-mass", 10, "-snes_latin_geometry", "large"]
    whole, report = result(tmp_path, [*words, "--steps", 12], "whole")
    run(launch(*words, "--steps", 6, "--quiet", "--checkpoint", "state"), cwd=tmp_path)
    again, _ = result(tmp_path, [*words, "--steps", 12, "--restart", "state"], "again")
    assert whole == again
    energy = np.add(report["kinetic_energy"], report["potential_energy"])
    assert np.ptp(energy) < 1e-8 * abs(energy).max()


def test_the_option_sets_the_geometry():
    """Of the structure, before the first step."""
    structure, v = shaken()
    with motion(structure, 0.005, v=v) as it:
        expected = it.step(5).u
    s = latinpc.Structure(**structure)
    u, w = s.create_vec(), s.create_vec()
    s.set_displacements(v, w)
    ts = s.create_ts(u, w)
    ts.setOptionsPrefix("by_option_")
    database = PETSc.Options()
    database["by_option_snes_latin_geometry"] = "large"
    try:
        ts.setFromOptions()
    finally:
        database.delValue("by_option_snes_latin_geometry")
    ts.setTimeStep(0.005)
    ts.setMaxSteps(5)
    ts.solve(u)
    assert s.geometry == "large"
    assert np.array_equal(s.displacements(u), expected)


def test_what_does_not_move_is_refused():
    """Small angles, and rigid laws."""
    structure, _ = shaken(cells=4)
    with pytest.raises(PETSc.Error) as error:
        latinpc.Structure(**structure, geometry="prestress").create_ts()
    assert "take large, or linear" in latinpc.error_message(error.value)
    rigid = structure | {"law": "inextensible", "prestress": None}
    with pytest.raises(PETSc.Error) as error:
        latinpc.Structure(**rigid, geometry="large").create_ts()
    assert "Motions with large displacements are for elastic links" in latinpc.error_message(error.value)


if __name__ == "__main__":
    structure, v = shaken()
    with motion(structure, 0.005, v=v, snes_latin_error=1e-10, snes_latin_subdomains=5) as it:
        it.step(10)
        size = {"norm": np.linalg.norm(it.u), "energy": it.energy}
    if PETSc.COMM_WORLD.rank == 0:
        print(json.dumps(size))
    sys.exit(0)
