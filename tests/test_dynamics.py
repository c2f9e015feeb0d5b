"""Time stepping: the scheme of section 2.2 against closed forms, its invariants, and what a step builds again."""

import json
import re
from dataclasses import replace

import numpy as np
import oracle
import pytest
from conftest import LOGS, ROOT
from motions import EXACT, NEWTON, counts, euler, floating, heavy, message, motion, one_mass
from petsc4py import PETSc
from scipy.optimize import nnls
from support import chain, grid, irregular, lattice, logged, network

import latinpc
from latinpc.options import default_options
from latinpc.runs.motion import move
from latinpc.scenes import Law, Scene, make

# ---- closed forms ------------------------------------------------------------------------------


@pytest.mark.parametrize("options", [EXACT, NEWTON, EXACT | {"snes_latin_subdomains": 1}])
def test_an_oscillator_follows_the_closed_form_of_implicit_euler(options):
    """With z = v + i omega u, (1 + i omega h) z+ = z + i omega h f / k omega.. : damped by (1 + (omega h)^2)^(-1/2)."""
    k, m, h, n, f = 100.0, 2.0, 0.05, 40, 3.0
    omega = np.sqrt(k / m)
    with motion(one_mass(k, m, load=f, velocity=0.7), h, **options) as it:
        it.step(n)
        z = (0.7 + 1j * omega * (0.0 - f / k)) / (1 - 1j * omega * h) ** n
        assert it.v[1, 0] == pytest.approx(z.real, rel=1e-10)
        assert it.u[1, 0] == pytest.approx(z.imag / omega + f / k, rel=1e-10)
        assert it.ts.getTime() == pytest.approx(n * h)


def test_the_scheme_is_of_first_order_and_petsc_s_own_of_second():
    """Errors at a fixed time against u = a cos(omega t): halved with h; quartered by generalised alpha."""
    end, a, found = 0.5, 0.1, {}
    for kind in ("latin", "alpha2"):
        options = NEWTON | ({} if kind == "latin" else {"ts_type": "alpha2", "ts_alpha_radius": 1.0})
        errors = []
        for n in (50, 100, 200):
            with motion(one_mass(), end / n, displacement=[[0.0], [a]], **options) as it:
                it.step(n)
                errors.append(abs(it.u[1, 0] - a * np.cos(np.sqrt(50.0) * end)))
        found[kind] = np.log2(errors[0] / errors[2]) / 2
    assert found["latin"] == pytest.approx(1.0, abs=0.15)
    assert found["alpha2"] == pytest.approx(2.0, abs=0.15)


def test_a_ball_falls_on_a_bar():
    """Free fall, then a spring that only pushes: every step by hand."""
    g, k, m, gap, h = 9.81, 1e4, 3.0, 0.02, 1e-3
    scene = one_mass(k, m, law=Law.COMPRESSION_ONLY, initial_elongation=gap, load=-m * g)
    u = v = 0.0
    touched = False
    with motion(scene, h, **EXACT) as it:
        for _ in range(120):
            it.step()
            free = v - h * g
            if u + h * free + gap >= 0.0:
                v = free
            else:
                v = (m * free - h * k * (u + gap)) / (m + h * h * k)
                touched = True
            u += h * v
            assert it.u[1, 0] == pytest.approx(u, rel=1e-9, abs=1e-12)
            assert it.v[1, 0] == pytest.approx(v, rel=1e-9, abs=1e-9)
    assert touched and v > 0.0  # it has bounced


def test_a_structure_comes_to_rest_where_statics_has_it():
    """Large steps damp the motion: it ends in the static solution of the same SNES type."""
    scene = heavy(lattice(), speed=0.1)
    with motion(scene, 10.0, **EXACT) as it:
        it.step(12)
        at_rest = oracle.newton(scene)
        assert np.abs(it.u - at_rest).max() < 1e-8 * np.abs(at_rest).max()
        assert np.abs(it.v).max() < 1e-8


# ---- every step is the right one ------------------------------------------------------------------------------

STRUCTURES = {
    "grid": lambda: heavy(grid(modules=4, subdomains=4), mass=20.0),
    "irregular": lambda: heavy(irregular(modules=4, parts=3), mass=20.0),
    "network": lambda: heavy(network(nodes=60, parts=4)),
    "struts": lambda: heavy(chain(links=9, parts=3, law=Law.COMPRESSION_ONLY), speed=0.3),
    "cables": lambda: heavy(chain(links=9, parts=3, law=Law.CABLE), speed=0.3),
    "floating": lambda: heavy(floating(grid(modules=3, subdomains=9)), mass=20.0),
    "fewer nodes than ranks": lambda: heavy(chain(links=2, parts=2), speed=0.3),
}


@pytest.mark.parametrize("name", STRUCTURES)
@pytest.mark.parametrize("h", [2e-4, 5e-3])
def test_steps_agree_with_newton_and_with_a_reference(name, h):
    """SNES latin, newtonls and dense numpy make the same steps."""
    scene = STRUCTURES[name]()
    u, v = euler(scene, np.zeros(scene.nodes.shape), scene.velocity, h, 6)
    for options in (EXACT, NEWTON):
        with motion(scene, h, **options) as it:
            it.step(6)
            assert np.abs(it.u - u).max() < 1e-8 * np.abs(u).max()
            assert np.abs(it.v - v).max() < 1e-8 * np.abs(v).max()


@pytest.mark.parametrize("variant", ["none", "macro", "corner"])
def test_variants_and_preconditioned_newton_make_the_same_steps(variant):
    """Any coarse space, and PC latin inside Newton's method."""
    scene = heavy(grid(modules=4, subdomains=4), mass=20.0)
    u, v = euler(scene, np.zeros(scene.nodes.shape), scene.velocity, 1e-3, 4)
    inside = {"snes_type": "newtonls", "ksp_type": "cg", "pc_type": "latin", "pc_latin_variant": variant}
    inside |= {"ksp_rtol": 1e-12, "snes_rtol": 1e-12, "snes_linesearch_type": "none", "snes_stol": 1e-13}
    for options in (EXACT | {"snes_latin_variant": variant}, inside):
        with motion(scene, 1e-3, **options) as it:
            it.step(4)
            assert np.abs(it.v - v).max() < 1e-8 * np.abs(v).max()


def test_a_step_is_the_complementarity_problem_20():
    """The LCP of (20) for cables, with the Delassus operator, by non-negative least squares."""
    scene = heavy(floating(grid(modules=2, subdomains=4)), mass=20.0, speed=3.0)
    h, dim = 1e-3, scene.dim
    b, _ = oracle.kinematics(scene)
    b, cable = b.toarray(), scene.law == Law.CABLE
    w = b @ (b / np.repeat(scene.mass, dim)).T
    corrected = w + np.diag(1.0 / scene.stiffness) / h**2
    eta = -b @ scene.velocity.ravel()
    e0 = scene.initial_elongation
    bars = ~cable
    inverse = np.linalg.inv(corrected[np.ix_(bars, bars)])
    hat = -eta[cable] + w[np.ix_(cable, bars)] @ inverse @ (eta[bars] - e0[bars] / h)
    tilde_w = corrected[np.ix_(cable, cable)] - w[np.ix_(cable, bars)] @ inverse @ w[np.ix_(bars, cable)]
    tilde_f = hat + e0[cable] / h
    # 0 <= pi, W pi - F >= 0, complementary: the normal equations of a non-negative least squares problem
    root = np.linalg.cholesky(tilde_w).T
    pi, _ = nnls(root, np.linalg.solve(root.T, tilde_f), maxiter=10000)
    slack = tilde_w @ pi - tilde_f
    assert np.abs(pi * slack).max() < 1e-9 * np.abs(pi).max() * np.abs(slack).max()
    assert 0 < np.count_nonzero(pi) < len(pi)
    with motion(scene, h, **EXACT) as it:
        it.step()
        assert np.abs(h * it.tensions[cable] - pi).max() < 1e-8 * pi.max()


# ---- invariants ------------------------------------------------------------------------------


@pytest.mark.parametrize("stop", [1e-2, 1e-6])
@pytest.mark.parametrize(("make", "variant"), [(grid, "macro"), (grid, "corner"), (irregular, "corner")])
def test_momentum_is_kept_to_rounding_however_loose_the_stop(make, variant, stop):
    """Every linear stage is in balance as a whole: macro and corner forces leave no resultant on strong interfaces."""
    scene = heavy(floating(make()), mass=20.0)
    x, m = scene.nodes - scene.nodes.mean(axis=0), scene.mass[:, None]

    def momenta(v):
        return np.append((m * v).sum(axis=0), np.cross(x, m * v).sum(axis=0))

    with motion(scene, 1e-3, snes_stol=stop, snes_latin_variant=variant) as it:
        before, scale = momenta(it.v), np.abs(scene.mass[:, None] * it.v).sum() * np.abs(x).max()
        it.step(5)
        assert np.abs(momenta(it.v) - before).max() < 1e-12 * scale


@pytest.mark.parametrize("name", STRUCTURES)
def test_energy_never_grows_without_load(name):
    """Implicit Euler dissipates: at least the kinetic energy of the jump of the velocity."""
    scene = STRUCTURES[name]()
    scene = replace(scene, load=np.zeros(scene.load.shape))
    with motion(scene, 1e-3, **EXACT) as it:
        for _ in range(8):
            before, v = it.energy, it.v
            it.step()
            jump = 0.5 * (scene.mass[:, None] * (it.v - v) ** 2).sum()
            assert it.energy <= before - jump + 1e-9 * abs(before)


def test_slack_cables_and_lifted_struts_bear_nothing():
    """Tensions of every step meet the laws at its end, whatever the stop."""
    scene = heavy(grid(modules=4, subdomains=4), mass=20.0, speed=5.0)
    with motion(scene, 1e-3) as it:
        for _ in range(5):
            it.step()
            t = it.tensions
            assert t[scene.law == Law.CABLE].min() == 0.0
            assert np.allclose(t, it.structure.tensions(it.vec_u), rtol=1e-9, atol=1e-9 * np.abs(t).max())


def test_units_and_origin_do_not_matter():
    """Newtons and kilonewtons, metres and millimetres, a structure far from the origin: the same iterations."""
    scene = heavy(grid(modules=4, subdomains=4), mass=20.0)
    counts = []
    for force, length, shift in ((1.0, 1.0, 0.0), (1e-3, 1e3, 0.0), (1.0, 1.0, 1024.0)):
        other = replace(
            scene,
            nodes=length * (scene.nodes + shift),
            stiffness=scene.stiffness * force / length,
            initial_elongation=scene.initial_elongation * length,
            load=scene.load * force,
            mass=scene.mass * force / length,
            velocity=scene.velocity * length,
        )
        with motion(other, 1e-3) as it:
            counts.append([it.step().iterations for _ in range(5)])
            speed = np.abs(it.v).max() / length
            assert speed == pytest.approx(counts[0][-1] and speed)
    assert counts[0] == counts[1] == counts[2]


# ---- what is built again ------------------------------------------------------------------------------


def test_nothing_is_built_after_the_first_step_unless_its_length_or_the_structure_change():
    """New loads neither; a new length, new masses and new laws do."""
    with logged():
        scene = heavy(grid(), mass=20.0)
        with motion(scene, 1e-3) as it:
            it.step()
            built = counts()
            it.step(3)
            it.structure.set_load(0.5 * scene.load)
            it.step(2)
            assert counts() == built
            it.ts.setTimeStep(1e-3 * (1 + 1e-12))  # rounding is no new length
            it.step()
            assert counts() == built
            it.ts.setTimeStep(5e-4)
            it.step()
            assert counts()[0] == built[0] + 1
            built = counts()
            it.step()
            assert counts() == built
            it.structure.set_mass(2 * scene.mass)
            it.step()
            assert counts()[0] == built[0] + 1


def test_statics_of_the_same_structure_is_left_alone():
    """Masses, a TS and its steps change nothing in what a SNES finds, and the other way round."""
    scene = heavy(grid(modules=4, subdomains=4), mass=20.0)
    at_rest = oracle.newton(scene)
    with motion(scene, 1e-3, **EXACT) as it:
        static = it.structure.create_snes()
        with default_options(EXACT):
            static.setFromOptions()
        u = it.structure.create_vec()
        for _ in range(2):
            it.step()
            static.solve(None, u)
            assert np.abs(it.structure.displacements(u) - at_rest).max() < 1e-8 * np.abs(at_rest).max()
        after, _ = euler(scene, np.zeros(scene.nodes.shape), scene.velocity, 1e-3, 2)
        assert np.abs(it.u - after).max() < 1e-8 * np.abs(after).max()


MEMORY = """
import json, sys
import petsc4py; petsc4py.init(sys.argv)
from petsc4py import PETSc
import latinpc
from latinpc.scenes import make
scene = make("truss-grid", modules=16, subdomains=16)
kind = PETSc.Options().getString("kind")
structure = latinpc.Structure.from_scene(scene)
if kind != "static": structure.set_mass(20.0)
u = structure.create_vec()
if kind == "moving":
    ts = structure.create_ts(); ts.setTimeStep(1e-3); ts.setMaxSteps(1); ts.setFromOptions(); ts.solve(u)
else:
    snes = structure.create_snes(); snes.setFromOptions(); snes.solve(None, u)
"""


@pytest.mark.skipif(bool(LOGS), reason="PETSc leaves memory to valgrind")
def test_statics_takes_no_memory_for_dynamics(mpirun):
    """Masses cost one number a node, and only motions cost more: PETSc's own count of bytes."""
    found, who = {}, {}
    for kind in ("static", "masses", "moving"):
        out = mpirun(
            1,
            MEMORY,
            "-kind",
            kind,
            "-snes_latin_stop",
            "indicator",
            "-malloc_debug",
            "-memory_view",
            "-malloc_view",
            timeout=200,
        ).stdout
        found[kind] = int(re.search(r"Maximum memory PetscMalloc\(\)ed (\d+)", out)[1])
        who[kind] = set(re.findall(r"^\[0\] \d+ \d+ (\w+)\(\)", out, re.M))
    nodes = 3 * 16 * 16 + 4 * 16 + 1
    assert found["masses"] - found["static"] <= 8 * nodes + 1024
    assert found["moving"] > found["masses"]
    # of the functions for motions, contacts, friction and laws of the user's, none takes memory in statics of trusses
    beyond = set()
    for name in (
        "structure/timestep",
        "structure/rigidlaws",
        "structure/userlaws",
        "stages/localcontacts",
        "snes/searchparameter",
        "ts/tslatin",
    ):
        source = (ROOT / "latinpc" / "src" / f"{name}.c").read_text()
        beyond |= set(re.findall(r"^[a-zA-Z][\w ]*[ *](\w+)\(", source, re.M))
    assert any(name.startswith("LatinStructure") for name in who["static"]) and "LatinStructureSetMass" in beyond
    assert not who["static"] & beyond
    assert who["masses"] & beyond == {"LatinStructureSetMass"}
    assert len(who["moving"] & beyond) > 1


# ---- ranks ------------------------------------------------------------------------------

RANKS = """
import json, sys
import petsc4py; petsc4py.init(sys.argv)
from mpi4py import MPI
from petsc4py import PETSc
sys.path.insert(0, {tests!r})
from test_dynamics import STRUCTURES, motion
found = {{}}
for name in ("grid", "irregular", "cables", "fewer nodes than ranks"):
    with motion(STRUCTURES[name](), 1e-3, comm=PETSc.COMM_WORLD, snes_stol=1e-8) as it:
        counts = [it.step().iterations for _ in range(2)]
        arrays = {{"u": it.u.tolist(), "v": it.v.tolist(), "t": it.tensions.tolist(), "energy": it.energy}}
        found[name] = arrays | {{"iterations": counts}}
if MPI.COMM_WORLD.rank == 0:
    print(json.dumps(found))
"""


def test_the_number_of_ranks_does_not_matter(mpirun):
    """One, two and four ranks make the same steps with the same iterations."""
    source = RANKS.format(tests=str(ROOT / "tests"))
    found = [json.loads(mpirun(ranks, source, timeout=300).stdout) for ranks in (1, 2, 4)]
    for other in found[1:]:
        for name, one in found[0].items():
            assert other[name]["iterations"] == one["iterations"]
            for key in ("u", "v", "t", "energy"):
                a, b = np.array(one[key]), np.array(other[name][key])
                assert np.abs(a - b).max() <= 1e-7 * np.abs(a).max(), (name, key)


# ---- options and errors ------------------------------------------------------------------------------


def test_the_monitor_tells_energies_iterations_and_active_links(tmp_path):
    """One line a step, with the numbers that the library computes."""
    log = tmp_path / "steps"
    scene = heavy(grid(modules=4, subdomains=4), mass=20.0)
    with motion(scene, 1e-3, ts_latin_monitor=f"ascii:{log}") as it:
        it.ts.setMaxSteps(3)
        it.ts.solve(it.vec_u)
        lines = log.read_text().splitlines()
        assert len(lines) == 4
        words = lines[-1].split()
        taut = np.count_nonzero(it.tensions[scene.law == Law.CABLE])
        assert words[0] == "3" and words[-3:] == [str(taut), "of", str((scene.law == Law.CABLE).sum())]
        assert float(words[words.index("sum") + 1]) == pytest.approx(it.energy, rel=1e-6)
        assert int(words[words.index("iterations") + 1]) == it.iterations


def test_steps_extrapolate_whoever_sets_the_type():
    """Of a SNES that the program had given its type, steps started from nothing. What it chooses stays."""

    def run(*choices):
        scene = make("impact-grid", modules=4)
        structure = latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF)
        u, v = structure.create_vec(), structure.create_vec()
        structure.set_displacements(scene.velocity, v)
        ts, stages = structure.create_ts(u, v), []
        for choice in choices:
            choice(ts.getSNES())
        ts.setFromOptions()
        ts.setTimeStep(scene.time_step)
        ts.setMaxSteps(12)
        ts.setPostStep(lambda ts: stages.append(ts.getSNES().getIterationNumber()))
        ts.solve(u)
        return stages, structure.displacements(u)

    stages, u = run()
    typed, same = run(lambda snes: snes.setType("latin"))
    cold, near = run(lambda snes: snes.setType("latin"), lambda snes: latinpc.set_warm_start(snes, "none"))
    assert typed == stages and np.array_equal(same, u)
    assert sum(cold) > sum(stages)
    assert near == pytest.approx(u, abs=1e-3 * np.abs(u).max())


def test_the_plain_iteration_moves_when_damped():
    """As docs/motions.md says."""
    scene = heavy(grid(modules=4, subdomains=4), mass=20.0)
    plain = {"snes_latin_outer_snes_type": "nrichardson", "snes_latin_outer_snes_linesearch_damping": 0.8}
    u, v = euler(scene, np.zeros(scene.nodes.shape), scene.velocity, 1e-3, 4)
    with motion(scene, 1e-3, **(EXACT | plain)) as it:
        it.step(4)
        assert np.abs(it.v - v).max() < 1e-7 * np.abs(v).max()


def test_a_step_that_fails_says_so_or_is_made_shorter():
    """As PETSc's types do: an error by default, steps of a quarter of the length when failures are allowed."""
    scene = heavy(grid(modules=4, subdomains=4), mass=20.0, speed=10.0)
    with motion(scene, 1e-2, snes_max_it=4) as it:
        it.ts.setErrorIfStepFails(True)
        said = message(it.step)
        assert "Step 1, from 0. to 0.01, has not converged: DIVERGED_MAX_IT. The iterations that -snes_max_it" in said
        assert "Take shorter steps, or -ts_max_snes_failures -1" in said
    with motion(scene, 1e-2, snes_max_it=6, snes_stol=1e-3, ts_max_snes_failures=-1, ts_max_reject=20) as it:
        it.step()
        it.ts.getSNES().setTolerances(max_it=500)
        lengths = [it.ts.getTime()]
        while it.ts.getTime() < 1e-2 - 1e-12:  # the shorter steps end where the whole one would have
            it.step()
            lengths.append(lengths[0])
        assert len(lengths) > 2 and np.isclose(sum(lengths), 1e-2) and np.isclose(it.ts.getTime(), 1e-2, rtol=1e-12)
        it.step()
        assert np.isclose(it.ts.getTime(), 2e-2, rtol=1e-12)


def test_a_step_that_has_no_solution_names_nodes_without_mass():
    """A cable bears no push, and nothing else resists the load on its end."""
    scene = Scene(
        name="pushed", nodes=[[0.0], [1.0], [2.0]], links=[[0, 1], [0, 2]], law=[Law.CABLE, Law.BAR], stiffness=100.0,
        fixed=[[True], [False], [False]], load=[[0.0], [-1.0], [0.0]], mass=[0.0, 0.0, 1.0],
    )  # fmt: skip
    with motion(scene, 1e-2) as it:
        assert "Links do not hold node 1 against the loads, and it has no mass: give it one" in message(it.step)


def test_misuse_is_told_with_its_cure():
    """No masses, no structure, bad masses, tensions before a step."""
    scene = one_mass()
    structure = latinpc.Structure.from_scene(replace(scene, mass=None), comm=PETSc.COMM_SELF)
    assert "LatinStructureSetMass" in message(structure.create_ts)
    assert "LatinStructureSetMass" in message(structure.kinetic_energy, structure.create_vec())
    assert "node 1" in message(structure.set_mass, [1.0, -1.0])
    assert "No node has a mass" in message(structure.set_mass, 0.0)
    assert "negative" in message(lambda: replace(scene, mass=[1.0, -1.0]))
    assert "fixed" in message(lambda: replace(scene, velocity=[[1.0], [0.0]]))
    ts = PETSc.TS().create(PETSc.COMM_SELF)
    ts.setType("latin")
    ts.setTimeStep(1.0)
    ts.setMaxSteps(1)
    assert "LatinStructureAttachTS" in message(ts.solve, structure.create_vec())
    mass = latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF)
    ts = PETSc.TS().create(PETSc.COMM_SELF)
    mass.attach(ts)
    for kind, cure in (("latin", "in Python, latinpc.Structure(...).create_ts()"), ("alpha2", "Structure.tensions(u)")):
        ts.setType(kind)
        assert cure in message(latinpc.step_tensions, ts)
    with motion(scene, 1e-2) as it:
        assert (it.tensions == it.structure.tensions(it.vec_u)).all()  # those at the start


def test_a_motion_with_shorter_steps_ends_in_time():
    """The time that the number of steps was given for, not that number of shorter steps."""
    scene = make("impact-grid", modules=4)
    few = {"snes_max_it": 4, "snes_stol": 1e-3, "ts_max_snes_failures": -1, "ts_max_reject": 20}
    shorter, whole = move(scene, 10, options=few), move(scene, 10)
    assert shorter.converged and shorter.report["steps"] > 10
    assert shorter.report["time"] == pytest.approx(whole.report["time"], rel=1e-12)
    moved, exact = (motion.frames[-1].displacements for motion in (shorter, whole))
    assert moved == pytest.approx(exact, abs=0.1 * abs(exact).max())
