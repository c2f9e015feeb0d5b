"""Contacts that open and cables that slacken in chains: an interior-point method gives Newton's method its start."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from petsc4py import PETSc
from support import far, latin, solve
from test_collapse import borne

from latinpc.bench.extremes.conditions import missed
from latinpc.scenes import Law, make

CHAINS = {
    "elastic discs": {"side": 40, "law": "elastic"},
    "rigid discs": {"side": 60},
    "elastic spheres": {"side": 10, "dim": 3, "law": "elastic"},
    "rigid spheres": {"side": 12, "dim": 3},
    "elastic discs, METIS": {"side": 40, "law": "elastic", "partition": "metis"},
    "rigid discs, one subdomain": {"side": 60, "subdomains": 1},
}


def mixed(side=40):
    """Discs of which some touch elastically, others do not yield, and some are tied to a wall by cables."""
    scene = make("packing", side=side, law="elastic")
    rigid = np.random.default_rng(0).random(len(scene.links)) < 0.5
    free = np.flatnonzero(~scene.fixed.any(axis=1))[::50]
    wall = np.flatnonzero(scene.fixed.all(axis=1))[: len(free)]
    ties = np.column_stack([wall, free[: len(wall)]])
    along = scene.nodes[ties[:, 1]] - scene.nodes[ties[:, 0]]
    more = len(ties)
    return replace(
        scene,
        links=np.vstack([scene.links, ties]),
        law=np.append(np.where(rigid, Law.CONTACT, Law.COMPRESSION_ONLY), np.full(more, Law.CABLE)),
        stiffness=np.append(np.where(rigid, 0.0, scene.stiffness), np.full(more, 1e5)),
        initial_elongation=np.append(scene.initial_elongation, np.full(more, 1e-3)),
        direction=np.vstack([scene.directions, along / np.linalg.norm(along, axis=1)[:, None]]),
        subdomain=None,
    )


def chains(name):
    """Make a scene of CHAINS, or the mixed one."""
    return mixed() if name == "mixed" else make("packing", **CHAINS[name])


@pytest.mark.parametrize("name", [*CHAINS, "mixed"])
def test_chains_of_contacts_are_found(name):
    """Balance, laws and signs hold, at the default stop."""
    scene = chains(name)
    result = solve(scene)
    assert result.reason > 0
    assert result.iterations < 400
    assert missed(scene, result.u, result.tensions) < 1e-5


@pytest.mark.parametrize("side", [20, 60])
def test_tensions_of_nets_do_not_creep(side):
    """The interior-point method closes the gaps as well: it leaves no tensions to the method of multipliers."""
    scene = make("net", side=side, current=0.5, partition="metis")
    result = solve(scene)
    assert result.reason > 0
    assert result.iterations <= 141  # 129 and 137; with gaps of 1e-8 of the displacements 144 and 149
    assert missed(scene, result.u, result.tensions) < 1e-5


@pytest.mark.parametrize("contrast", [1e2, 1e4])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_spheres_of_different_stiffness_beside_rigid_ones(contrast, seed):
    """Open contacts are no mechanism to the factorisation, however stiff the closed rigid ones are."""
    scene = make("packing", side=9, dim=3, law="elastic")
    random = np.random.default_rng(seed)
    rigid = random.random(len(scene.links)) < 0.5
    stiffness = scene.stiffness * contrast ** random.random(len(scene.links))
    scene = replace(
        scene,
        law=np.where(rigid, Law.CONTACT, Law.COMPRESSION_ONLY),
        stiffness=np.where(rigid, 0.0, stiffness),
    )
    result = solve(scene, error=1e-6)
    assert result.reason > 0
    assert result.iterations < 400
    assert missed(scene, result.u, result.tensions) < 1e-6


def test_networks_next_to_their_limit_load():
    """Half of the cables bear nothing: Newton's method alone finds none, and full steps leave the guess of some."""
    assert sum(solve(borne(seed, 1.0)).reason > 0 for seed in range(8)) >= 7


@pytest.mark.parametrize("law", ["elastic", "contact"])
def test_the_iteration_alone_takes_far_longer(law):
    scene = make("packing", side=40, law=law)
    assert solve(scene, newton="never", max_it=4 * solve(scene).iterations).reason < 0


@pytest.mark.parametrize("forces", [1e-9, 1e6])
def test_units_do_not_matter(forces):
    """The same displacements, in as many iterations but for rounding."""
    scene = make("packing", side=40, law="elastic")
    one = solve(scene, error=1e-8)
    other = solve(replace(scene, load=forces * scene.load, stiffness=forces * scene.stiffness), error=1e-8)
    assert one.reason > 0 and other.reason > 0
    assert far(other.tensions, forces * one.tensions) < 1e-7
    assert abs(other.iterations - one.iterations) < 20


def test_loads_given_to_the_solve_and_prescribed_displacements():
    """Half of the loads in the right-hand side, and a wall that moves: the solution of the structure that has both."""
    scene = make("packing", side=30, law="elastic")
    moves = np.where(scene.fixed & (scene.nodes[:, :1] == scene.nodes[:, 0].min()), [5e-4, 0.0], 0.0)
    whole = solve(replace(scene, prescribed=moves), error=1e-8)
    half = replace(scene, load=0.5 * scene.load, prescribed=moves)
    with latin(half, error=1e-8) as run:
        u, b = run.structure.create_vec(), run.structure.create_vec()
        run.structure.set_displacements(0.5 * scene.load, b)
        run.snes.solve(b, u)
        assert run.snes.reason > 0 and whole.reason > 0
        bears = np.abs(whole.tensions) > 1e-6 * np.abs(whole.tensions).max()
        found = run.structure.tensions(u)
        assert far(found[bears], whole.tensions[bears]) < 1e-6


def test_loads_that_nothing_bears_are_refused_as_before():
    """A disc is pulled out of the packing: the search for a collapse comes first, and names it."""
    scene = make("packing", side=40, law="elastic")
    top = np.argmax(np.where(scene.fixed.any(axis=1), -np.inf, scene.nodes[:, 1]))
    load = scene.load.copy()
    load[top] = [0.0, 2000.0]
    result = solve(replace(scene, load=load))
    assert result.reason == PETSc.SNES.ConvergedReason.DIVERGED_DTOL
    assert result.iterations < 200


PROGRAM = """
import sys
import petsc4py
petsc4py.init([sys.argv[0], "-skip_petscrc"])
sys.path.insert(0, {tests!r})
import numpy as np
from petsc4py import PETSc
from latinpc.scenes import make
from support import solve
result = solve(make("packing", side=40, law=sys.argv[1], partition="metis"), error=1e-8)
assert result.reason > 0
if not PETSc.COMM_WORLD.rank:
    np.save(sys.argv[2], result.tensions)
"""


@pytest.mark.parametrize("law", ["elastic", "contact"])
def test_ranks_find_the_same(mpirun, tmp_path, law):
    """Tensions on 1, 2 and 4 ranks."""
    program = PROGRAM.format(tests=str(Path(__file__).parent))
    found = []
    for ranks in (1, 2, 4):
        file = tmp_path / f"{ranks}.npy"
        mpirun(ranks, program, law, str(file))
        found.append(np.load(file))
    assert far(found[1], found[0]) < 1e-6
    assert far(found[2], found[0]) < 1e-6
