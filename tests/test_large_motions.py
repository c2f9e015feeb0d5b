"""Motions of links that turn: closed forms, the scheme written out, ranks, states, refusals."""

import json
import sys
from dataclasses import replace

import numpy as np
import pytest
import turning
from conftest import run
from large_motions import NEWTON, G, free, motion, pendulum, shaken, tangle, wheel, written_out
from petsc4py import PETSc
from scipy.special import ellipk
from support import STATES
from test_checkpoints import launch, result
from turning import net

import latinpc
from latinpc.runs.history import History
from latinpc.runs.motion import move
from latinpc.scenes import make


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


@pytest.mark.parametrize(
    ("h", "given"), [(0.005, {}), (0.001, {}), (0.001, {"snes_latin_newton": "never", "snes_latin_error": 1e-9})]
)
def test_a_pendulum_bounces_on_a_floor(h, given):
    """An elastic contact keeps its normal, and gives back what it takes, by Newton's method or not: energy stays."""
    structure = pendulum() | {"nodes": np.array([[0.0, 0.0], [1.0, 0.0], [1.5, -0.8]]), "links": [[0, 1], [2, 1]]}
    structure |= {"law": ["bar", "compression_only"], "stiffness": [1e5, 1e4], "initial_elongation": [0.0, 0.8]}
    structure |= {
        "direction": [[0.0, 0.0], [0.0, 1.0]],
        "mass": [0.0, 1.0, 0.0],
        "load": [[0.0, 0.0], [0.0, -G], [0.0, 0.0]],
    }
    structure |= {"fixed": [[True, True], [False, False], [True, True]]}
    with motion(structure, h, **given) as it:
        lowest, highest, touched = 0.0, -1.0, False
        for _ in range(round(2.0 / h)):
            it.step()
            assert abs(it.energy) < (
                1e-5 if given else 1e-6
            )  # the errors of an iteration add up, by rounding of the BLAS
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


@pytest.mark.parametrize(
    ("massless", "h", "seeds"), [(0.0, 5.0, (15, 36, 51)), (0.4, 1e-2, (3, 33, 52)), (1.0, 0.05, (1019, 1029, 1041))]
)
def test_steps_are_as_accurate_as_they_claim(massless, h, seeds):
    """Steps of many periods, whose line search may stall, and nodes without mass, soft beside others. Some may fail."""
    claimed = 0
    for seed in seeds:
        structure, v = tangle(seed, massless)
        u = np.zeros(v.shape)
        with motion(structure, h, v=v) as it:
            for _ in range(15):
                try:
                    it.step()
                except PETSc.Error:
                    break
                claimed += 1
                exact, _ = written_out(structure, u, v, h, 1, it.u - u)
                assert np.linalg.norm(it.u - exact) < 1e-7 * np.linalg.norm(exact - u)
                u, v = it.u, it.v
    assert claimed >= 15


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


@pytest.mark.parametrize(("h", "most"), [(0.05, 110), (0.2, 220)])
def test_operators_made_anew_are_those_of_the_step(h, most):
    """Cables slacken and tighten within a step: with the tangents of links at its middle 650 and 4,100 stages."""
    scene = make("saddle", side=30)
    structure = latinpc.Structure.from_scene(replace(scene, mass=np.full(len(scene.nodes), 10.0)))
    ts = structure.create_ts()
    ts.setTimeStep(h)
    ts.setMaxSteps(100)
    ts.setFromOptions()
    for _ in range(8):
        ts.step()
        assert ts.getSNES().getIterationNumber() < most
    ts.destroy()


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
    words = ["tensegrity-grid", "--modules", 4, "--time-step", 1e-3, "--node-mass", 10, "-snes_latin_geometry", "large"]
    whole, report = result(tmp_path, [*words, "--num-steps", 12], "whole")
    run(launch(*words, "--num-steps", 6, "--quiet", "--checkpoint", "state"), cwd=tmp_path)
    again, _ = result(tmp_path, [*words, "--num-steps", 12, "--restart", "state"], "again")
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
    assert "Motions need the geometry linear or large" in latinpc.error_message(error.value)
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


@pytest.mark.parametrize("slack", [0.001, 0.05])
def test_a_weight_falls_whatever_a_massless_node_does(slack):
    """Beside it a node without mass hangs from a cable that starts slack; the weight obeys the midpoint rule."""
    k, mass, h = 1e3, 50.0, 0.03
    structure = {
        "nodes": [[0.0, 0.0], [0.0, -1.0], [2.0, 0.0], [2.0, -1.0]], "links": [[0, 1], [2, 3]], "law": "cable",
        "stiffness": k, "initial_elongation": [-slack, 0.0], "fixed": [[1, 1], [0, 0], [1, 1], [0, 0]],
        "mass": [0, 0, 0, mass], "load": [[0, 0], [0, -0.5], [0, 0], [0, -mass * G]], "comm": PETSc.COMM_SELF,
    }  # fmt: skip
    with motion(structure, h) as it:
        fallen = velocity = 0.0
        for _ in range(3):
            it.step()
            step = (h * velocity + h**2 / 2 * (G - k * fallen / mass)) / (1 + k * h**2 / (4 * mass))
            fallen, velocity = fallen + step, 2 * step / h - velocity
            assert it.u[3] == pytest.approx([0.0, -fallen], rel=1e-8)


@pytest.mark.parametrize("how", ["structure", "option"])
def test_a_geometry_chosen_after_the_set_up(how):
    """It had been ignored, or taken without the error of motions with large displacements."""

    def end(geometry):
        structure = latinpc.Structure(
            [[0, 0], [1, 0], [2, 0]], [[0, 1], [1, 2]], "bar", 1e4, fixed=[[1, 1], [0, 0], [0, 0]], mass=[1, 1, 1],
            load=[[0, 0], [0, -1], [0, -3]], geometry=geometry, comm=PETSc.COMM_SELF,
        )  # fmt: skip
        ts = structure.create_ts()
        ts.setTimeStep(0.01)
        ts.setMaxSteps(20)
        ts.setFromOptions()
        ts.setUp()
        if geometry == "linear" and how == "structure":
            structure.set_geometry("large")
        elif geometry == "linear":
            ts.getSNES().setOptionsPrefix("late_")
            PETSc.Options()["late_snes_latin_geometry"] = "large"
            ts.getSNES().setFromOptions()
            PETSc.Options().delValue("late_snes_latin_geometry")
        u = ts.getSolution2()[0]
        ts.solve(u)
        return structure.displacements(u)

    assert np.array_equal(end("linear"), end("large"))


def test_a_step_too_long_to_be_found_ends_soon():
    """It had taken all of the 10,000 linear stages; the message says which step, and what to do."""
    scene = make("mast", wind=20000.0)
    structure = latinpc.Structure.from_scene(replace(scene, mass=np.full(len(scene.nodes), 10.0)))
    ts = structure.create_ts()
    ts.setTimeStep(10.0)
    ts.setMaxSteps(1)
    ts.setErrorIfStepFails(False)
    ts.setFromOptions()
    ts.solve(ts.getSolution2()[0])
    assert ts.getConvergedReason() == PETSc.TS.ConvergedReason.DIVERGED_NONLINEAR_SOLVE
    assert ts.getSNES().getIterationNumber() < 3000
    assert latinpc.step_cause(ts).startswith("The iteration stalled")
    ts.destroy()
    result = move(scene, 1, 10.0, mass=10.0)
    said = (
        "step 1, from 0 s to 10 s, has not converged: DIVERGED_MAX_IT. The iteration stalled, and a larger -snes_max_it"
    )
    assert said in result.notices[-1]
    assert "Take shorter steps, or -ts_max_snes_failures" in result.notices[-1]
    varied = move(scene, 1, 10.0, mass=10.0, history=History([0.0, 1.0], [1.0, 1.0]))
    assert varied.notices[-1].endswith("Take shorter steps")  # loads would be those of the longer step
