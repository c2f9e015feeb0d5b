"""Masses that no link reaches: they fly in a motion, and disturb nothing else; statics refuses them by name."""

import json
from dataclasses import replace

import numpy as np
import pytest
from conftest import ROOT
from motions import EXACT, NEWTON, floating, heavy, message, motion
from petsc4py import PETSc
from support import chain, grid, lattice, network
from test_shocks import column, hanging_chain

import latinpc

H, STEPS = 1e-3, 6
INSIDE = {"snes_type": "newtonls", "snes_rtol": 1e-12, "snes_stol": 1e-13, "snes_linesearch_type": "none"}
INSIDE |= {"ksp_rtol": 1e-12}


def with_flying(scene, count=3, speed=1.0, seed=1):
    """Put masses without link among the nodes of a scene, the first one held in one direction where there are more.

    Returns the scene, which of its nodes fly, and which are the others.
    """
    rng, (n, dim) = np.random.default_rng(seed), scene.nodes.shape
    flying = np.sort(rng.choice(n + count, count, replace=False))
    others = np.setdiff1d(np.arange(n + count), flying)
    fixed = np.zeros((count, dim), bool)
    fixed[0, 0] = dim > 1

    def put(values, new):
        whole = np.zeros((n + count, *values.shape[1:]), values.dtype)
        whole[others], whole[flying] = values, new
        return whole

    def free(values):
        return np.where(fixed, 0.0, values)

    velocity = np.zeros(scene.nodes.shape) if scene.velocity is None else scene.velocity
    whole = replace(
        scene,
        nodes=put(scene.nodes, rng.uniform(size=(count, dim))),
        links=others[scene.links],
        fixed=put(scene.fixed, fixed),
        prescribed=put(scene.prescribed, 0.0),
        load=put(scene.load, free(rng.normal(size=(count, dim)))),
        mass=put(scene.mass, rng.uniform(1.0, 3.0, count)),
        velocity=put(velocity, free(speed * rng.normal(size=(count, dim)))),
    )
    return whole, flying, others


def flight(scene, h, steps):
    """Steps of the scheme without links: the velocity after each step is that of the step."""
    force = np.where(scene.fixed, 0.0, scene.load) / np.where(scene.mass > 0.0, scene.mass, 1.0)[:, None]
    u, v = np.zeros(scene.nodes.shape), scene.velocity
    for _ in range(steps):
        v = v + h * force
        u = u + h * v
    return u, v


# ---- motions ------------------------------------------------------------------------------

SOLVERS = {
    "latin": EXACT,
    "one subdomain": EXACT | {"snes_latin_subdomains": 1},
    "METIS": EXACT | {"snes_latin_subdomains": 3},
    "none": EXACT | {"snes_latin_variant": "none"},
    "macro": EXACT | {"snes_latin_variant": "macro"},
    "corner": EXACT | {"snes_latin_variant": "corner", "snes_latin_modes_local": 1},
    "residual": {"snes_latin_stop": "residual", "snes_rtol": 1e-12},
    "newton at the end": EXACT | {"snes_latin_stop": "error", "snes_latin_error": 1e-9},
    "newton": NEWTON,
    "newton, pc latin": INSIDE | {"ksp_type": "cg", "pc_type": "latin"},
    "newton, ksp latin": INSIDE | {"ksp_type": "latin"},
    "generalised alpha": NEWTON | {"ts_type": "alpha2"},
}


@pytest.mark.parametrize("name", SOLVERS)
def test_masses_without_link_fly_and_disturb_nothing(name):
    """Closed form of free flight to rounding; the rest moves as it does without them, in as many iterations."""
    alone = heavy(grid(modules=4, subdomains=4), mass=20.0)
    if "snes_latin_subdomains" in SOLVERS[name]:
        alone = replace(alone, subdomain=None)
    scene, flying, others = with_flying(alone)
    found = []
    for each in (alone, scene):
        with motion(each, H, **SOLVERS[name]) as it:
            iterations = [it.step().iterations for _ in range(STEPS)]
            found.append((iterations, it.u, it.v, it.energy))
    (before, u, v, _), (after, whole_u, whole_v, _) = found
    exact_u, exact_v = flight(scene, H, STEPS)
    assert np.abs(whole_v - exact_v)[flying].max() < 1e-12 * np.abs(exact_v[flying]).max()
    if name != "generalised alpha":  # of second order: other displacements
        assert np.abs(whole_u - exact_u)[flying].max() < 1e-12 * np.abs(exact_u[flying]).max()
    assert np.abs(whole_u[others] - u).max() < 1e-8 * np.abs(u).max()
    assert np.abs(whole_v[others] - v).max() < 1e-8 * np.abs(v).max()
    if name not in ("METIS", "newton at the end"):  # another cut; the error is relative to all displacements
        assert before == after


@pytest.mark.parametrize("make", [lambda: column(np.ones(6), 0.01, np.r_[1.0, np.zeros(5)]), hanging_chain])
def test_shocks_do_not_depend_on_what_flies_by(make):
    """What counts as a closed contact is small beside the flight of the nodes that links reach."""
    alone = make()
    scene, flying, others = with_flying(alone, 2, speed=1e5)
    found = []
    for each in (alone, scene):
        with motion(each, 2e-3, **EXACT) as it:
            found.append(([it.step().iterations for _ in range(40)], it.u))
    assert found[0][0] == found[1][0]
    assert np.array_equal(found[1][1][others], found[0][1])
    exact = flight(scene, 2e-3, 40)[0][flying]
    assert np.abs(found[1][1][flying] - exact).max() < 1e-12 * np.abs(exact).max() and np.abs(exact).max() > 1e3


def test_momentum_and_energy_count_them():
    scene, _, _ = with_flying(heavy(floating(grid(modules=3, subdomains=9)), mass=20.0))
    scene = replace(scene, load=np.zeros(scene.load.shape), fixed=np.zeros(scene.fixed.shape, bool))
    with motion(scene, H) as it:
        momentum = (scene.mass[:, None] * it.v).sum(axis=0)
        energy = 0.5 * (scene.mass[:, None] * it.v**2).sum()
        assert it.structure.kinetic_energy(it.vec_v) == pytest.approx(energy, rel=1e-14)
        it.step(5)
        after = (scene.mass[:, None] * it.v).sum(axis=0)
        assert np.abs(after - momentum).max() < 1e-12 * np.abs(scene.mass[:, None] * it.v).sum()


def test_a_motion_goes_on_from_a_file_to_the_bit(tmp_path):
    scene = with_flying(heavy(lattice()))[0]
    with motion(scene, H) as it:
        it.step(3)
        latinpc.save_state(it.ts, tmp_path / "state")
        u = it.step(3).u
    with motion(scene, H) as it:
        latinpc.load_state(it.ts, tmp_path / "state")
        assert np.array_equal(it.step(3).u, u)


RANKS = """
import json, sys
import petsc4py; petsc4py.init(sys.argv)
from mpi4py import MPI
from petsc4py import PETSc
sys.path.insert(0, {tests!r})
from test_flying import on_ranks, refused_in_statics
found = on_ranks(PETSc.COMM_WORLD)
said = MPI.COMM_WORLD.gather(refused_in_statics(PETSc.COMM_WORLD))
if MPI.COMM_WORLD.rank == 0:
    print(json.dumps([found, said]))
"""


def on_ranks(comm):
    """Move structures with masses without link, also on more ranks than nodes with links."""
    found = {}
    for name, scene, options in (
        ("grid", heavy(grid(modules=4, subdomains=4), mass=20.0), {}),
        ("METIS", replace(heavy(network(nodes=60)), subdomain=None), {"snes_latin_subdomains": 3}),
        ("few", heavy(chain(links=2, parts=2)), {}),
        ("newton", heavy(lattice()), INSIDE | {"ksp_type": "cg", "pc_type": "latin"}),
    ):
        whole, flying, _ = with_flying(scene, 5)
        with motion(whole, H, comm=comm, **(EXACT | options)) as it:
            iterations = [it.step().iterations for _ in range(4)]
            u, v = flight(whole, H, 4)
            off = max(np.abs(it.u - u)[flying].max(), np.abs(it.v - v)[flying].max())
            found[name] = {"off": off, "iterations": iterations, "u": it.u.tolist(), "v": it.v.tolist()}
    return found


def refused_in_statics(comm):
    """Return what solvers say in statics."""
    structure = latinpc.Structure.from_scene(with_flying(heavy(lattice()))[0], comm=comm)
    return [message(structure.create_snes), message(set_up, structure, comm)]


def set_up(structure, comm=PETSc.COMM_SELF):
    """Set up a PC latin on the stiffness of a structure."""
    ksp = PETSc.KSP().create(comm)
    J = structure.dm.createMat()
    structure.jacobian(structure.create_vec(), J)
    ksp.setOperators(J)
    ksp.getPC().setType("latin")
    structure.attach(ksp.getPC())
    ksp.getPC().setUp()


@pytest.mark.parametrize("ranks", [2, 4])
def test_the_number_of_ranks_does_not_matter(ranks, mpirun):
    source = RANKS.format(tests=str(ROOT / "tests"))
    there, said = json.loads(mpirun(ranks, source, timeout=300).stdout)
    here = on_ranks(PETSc.COMM_SELF)
    for name, one in here.items():
        assert max(one["off"], there[name]["off"]) < 1e-12
        assert there[name]["iterations"] == one["iterations"]
        for key in ("u", "v"):
            a, b = np.array(one[key]), np.array(there[name][key])
            assert np.abs(a - b).max() <= 1e-10 * np.abs(a).max(), (name, key)
    assert said == [refused_in_statics(PETSc.COMM_SELF)] * ranks


# ---- what is refused ------------------------------------------------------------------------------


def test_statics_names_the_node():
    """In every solver, and where it lies: the first free one, the first direction in which it is free."""
    scene, flying, _ = with_flying(heavy(lattice()))
    structure = latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF)
    sentence = f"Node {flying[0]} is free along y but no link reaches it; remove it or prescribe its displacement"
    for call in (structure.create_snes, lambda: set_up(structure), lambda: structure.attach(PETSc.SNES().create())):
        said = message(call)
        assert sentence in said and "in a motion (TS) only" in said


def test_masses_without_link_that_are_held_disturb_nothing():
    scene, flying, others = with_flying(heavy(lattice()))
    scene.fixed[flying] = True
    held = replace(scene, velocity=None, load=np.where(scene.fixed, 0.0, scene.load))
    alone = heavy(lattice())
    found = []
    for each in (held, alone):
        structure = latinpc.Structure.from_scene(each, comm=PETSc.COMM_SELF)
        snes, u = structure.create_snes(), structure.create_vec()
        snes.setFromOptions()
        snes.solve(None, u)
        found.append((structure.displacements(u), snes.getIterationNumber()))
    assert np.array_equal(found[0][0][others], found[1][0]) and found[0][1] == found[1][1]


def test_nothing_flies_without_a_mass():
    scene, flying, _ = with_flying(heavy(lattice()))
    none = np.where(np.arange(len(scene.mass)) == flying[1], 0.0, scene.mass)
    structure = latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF)
    for said in (message(latinpc.Structure.from_scene, replace(scene, mass=none)), message(structure.set_mass, none)):
        assert f"Node {flying[1]} is free along x but no link reaches it; " in said
        assert "or, for a motion, give it a mass" in said
    structure.set_mass(2.0 * scene.mass)
