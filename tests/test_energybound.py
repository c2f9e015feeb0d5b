"""The energy bound of linear structures: never below the true error, hardly above it; units, ranks, misuse."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import oracle
import pytest
from petsc4py import PETSc
from support import VARIANTS, chain, grid, irregular, latin, lattice, network, on_rails, settled

import latinpc
from latinpc.options import default_options
from latinpc.scenes import Law


def linear(scene):
    """Make the same structure of bars."""
    return replace(scene, law=np.full(len(scene.links), Law.BAR))


SCENES = {
    "grid": lambda: grid(kind="truss"),
    "tensegrity": lambda: linear(grid()),
    "irregular": lambda: settled(linear(irregular())),
    "network": lambda: on_rails(linear(network())),
    "lattice": lambda: settled(linear(lattice()), size=1e-4),
    "chain": lambda: chain(),
    "one subdomain": lambda: chain(parts=1),
}


def energy(scene, u, v):
    """Energy norm of the difference of two displacements, and of the second one, supports included."""
    b, e_d = oracle.kinematics(scene)
    parts = [b @ np.where(scene.fixed, 0.0, x).ravel() for x in (u - v, v)]
    return [np.sqrt(np.sum(scene.stiffness * (e + shift) ** 2)) for e, shift in zip(parts, (0.0, e_d))]


def bound_and_error(scene, **options):
    """The bound of a solve, the relative one, and the true errors."""
    with latin(scene, **options) as run:
        u = run.structure.create_vec()
        run.snes.solve(None, u)
        error, size = energy(scene, run.structure.displacements(u), oracle.newton(scene))
        return *latinpc.energy_bound(run.snes), error, error / size


# ---- what it promises ------------------------------------------------------------------------
@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("name", SCENES)
def test_bound_is_above_the_error_and_sharp(name, variant):
    for max_it in (1, 5, 15):
        bound, relative, error, true = bound_and_error(SCENES[name](), variant=variant, max_it=max_it, stol=0)
        assert bound >= error * (1.0 - 1e-6)
        assert relative >= true * (1.0 - 1e-6)
        if true > 1e-8:
            assert bound <= 1.03 * error
        if 1e-8 < true < 0.1:
            assert relative <= 1.2 * true


@pytest.mark.parametrize("seed", range(12))
def test_bound_holds_for_random_networks(seed):
    """Random structures, partitions, supports and options."""
    rng = np.random.default_rng(seed)
    scene = linear(network(nodes=int(rng.integers(60, 200)), parts=int(rng.integers(2, 8)), seed=seed))
    scene = settled(scene, size=rng.choice([0.0, 1e-4]), seed=seed)
    chosen = {"variant": rng.choice(VARIANTS), "direction_value": rng.uniform(0.02, 0.2)}
    bound, relative, error, true = bound_and_error(scene, max_it=int(rng.integers(1, 12)), stol=0, **chosen)
    assert error * (1.0 - 1e-6) <= bound <= 1.03 * error
    assert relative >= true * (1.0 - 1e-6)


def test_bound_is_of_any_solver():
    """Two steps of steepest descent: the displacements need not come from the method."""
    scene = grid(kind="truss")
    structure = latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF)
    options = {"snes_type": "nrichardson", "snes_max_it": 2, "snes_linesearch_type": "cp"}
    with default_options(options):
        snes = structure.create_snes()
        snes.setFromOptions()
    u = structure.create_vec()
    snes.solve(None, u)
    error = energy(scene, structure.displacements(u), oracle.newton(scene))[0]
    bound, relative = latinpc.energy_bound(snes)
    assert error <= bound <= 1.03 * error
    assert np.isinf(relative) or relative > 0.9


def test_exact_solution_has_a_bound_at_rounding():
    bound, relative, *_ = bound_and_error(grid(kind="truss"), stol=1e-13, max_it=200)
    assert relative < 1e-9
    assert bound >= 0.0


# ---- what must not matter --------------------------------------------------------------------
def test_units_do_not_matter():
    """Lengths in mm, forces in kN: energies are the same number of joules."""
    scene = SCENES["irregular"]()
    scaled = replace(
        scene,
        nodes=scene.nodes * 1e3,
        stiffness=scene.stiffness * 1e-6,
        initial_elongation=scene.initial_elongation * 1e3,
        prescribed=scene.prescribed * 1e3,
        load=scene.load * 1e-3,
    )
    results = [bound_and_error(s, max_it=5, stol=0, outer_snes_type="nrichardson")[:2] for s in (scene, scaled)]
    assert results[0] == pytest.approx(results[1], rel=1e-5)


def test_ranks_do_not_matter(mpirun, tmp_path):
    program = f"""
import json, sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
import latinpc
from support import irregular, latin
scene = irregular(kind="truss")
structure = latinpc.Structure.from_scene(scene)
with latin(scene, structure, max_it=5, stol=0, outer_snes_type="nrichardson") as run:
    run.snes.solve(None, structure.create_vec())
    bound = latinpc.energy_bound(run.snes)
    if structure.comm.rank == 0:
        json.dump(bound, open(sys.argv[1], "w"))
"""
    found = []
    for ranks in (1, 3):
        mpirun(ranks, program, tmp_path / f"{ranks}.json")
        found.append(json.loads((tmp_path / f"{ranks}.json").read_text()))
    assert found[0] == pytest.approx(found[1], rel=1e-5)


# ---- misuse ----------------------------------------------------------------------------------
def test_slackening_links_are_refused():
    with latin(grid()) as run:
        run.snes.solve(None, run.structure.create_vec())
        with pytest.raises(PETSc.Error) as caught:
            latinpc.energy_bound(run.snes)
    assert "-snes_latin_stop error" in latinpc.error_message(caught.value)


def test_solution_and_structure_must_be_there():
    with latin(grid(kind="truss")) as run:
        run.snes.setUp()
        with pytest.raises(PETSc.Error) as caught:
            latinpc.energy_bound(run.snes)
        assert "call SNESSolve() first" in latinpc.error_message(caught.value)
    with pytest.raises(PETSc.Error) as caught:
        latinpc.energy_bound(PETSc.SNES().create(PETSc.COMM_SELF))
    assert "attach" in latinpc.error_message(caught.value)
