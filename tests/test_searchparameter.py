"""Search parameters of rigid links: others, the same problem."""

from dataclasses import replace

import numpy as np
import pytest
from petsc4py import PETSc
from support import latin, solve
from test_classes import balance, strain

import latinpc
from latinpc.bench.extremes.rigid import stiffened
from latinpc.scenes import make

LONG = {"stol": 1e-6, "max_it": 3000}


def is_coulombs(scene, found, small=1e-4):
    """Balance, cone, no penetration, complementarity, and friction against the slip, in the structure's own units."""
    normal, tangent = found.tensions[::2], found.tensions[1::2]
    gap, slip = strain(scene, found.u).reshape(-1, 2).T
    size, far = np.abs(normal).max(), np.abs(gap).max()
    return (
        balance(scene, found.tensions) < small
        and (normal <= 0).all()
        and (np.abs(tangent) <= scene.friction[::2] * -normal * (1 + 1e-9)).all()
        and gap.min() > -small * far
        and np.abs(gap * normal).max() < small * size * far
        and (np.abs(slip * tangent) - slip * tangent).max() < small * size * far
    )


def test_a_second_solve_starts_from_the_parameter_found_and_a_warm_one_goes_on():
    """The operators stay; gaps may change in between."""
    scene = stiffened(1e4, False)
    for warm in ("none", "last"):
        with latin(scene, warm_start=warm, newton="never", **LONG) as run:
            counts = []
            for gaps in (1.0, 1.0, 1.0 + 1e-6):
                run.structure.set_initial_elongation(gaps * scene.initial_elongation)
                run.snes.solve(None, run.structure.create_vec())
                assert run.snes.getConvergedReason() > 0
                counts.append(run.snes.getIterationNumber())
            assert max(counts[1:]) <= (3 if warm == "last" else 0.5 * counts[0])


@pytest.mark.parametrize("law", ["contact", "friction"])
@pytest.mark.parametrize("search", [1e-6, 1e-2, 1e2, 1e6, 1e10])
def test_the_search_parameter_of_the_caller_does_not_decide(law, search):
    """Forces of 1e4 N, gaps of millimetres: contacts are found with any number in the place of a stiffness."""
    scene = make("packing", side=12, law=law, seed=1)
    given = replace(scene, stiffness=np.full(len(scene.links), search))
    found, automatic = solve(given, max_it=3000), solve(scene, max_it=3000)
    assert found.reason > 0 and automatic.reason > 0
    if law == "friction":
        assert is_coulombs(scene, found)
    else:
        assert np.abs(found.tensions - automatic.tensions).max() < 1e-3 * np.abs(automatic.tensions).max()


def test_errors_against_a_reference_go_on():
    """With the operators of another parameter as well."""
    scene = stiffened(1e4, False)
    found = solve(scene, newton="never", **LONG)
    again = solve(scene, found.u, newton="never", **LONG)
    assert again.iterations == found.iterations
    assert again.history.error_l2[-1] < 1e-8


RANKS = """
import sys, petsc4py
petsc4py.init(sys.argv)
from petsc4py import PETSc
import latinpc
from latinpc.bench.extremes.rigid import stiffened
scene = stiffened(1e4, False)
structure = latinpc.Structure.from_scene(scene)
snes = structure.create_snes()
snes.setFromOptions()
u = structure.create_vec()
snes.solve(None, u)
tension = latinpc.tensions(snes)
if PETSC_RANK == 0: print("found", snes.getConvergedReason(), snes.getIterationNumber(), abs(tension).sum())
""".replace("PETSC_RANK", "PETSc.COMM_WORLD.rank")


def test_the_number_of_ranks_does_not_matter(mpirun):
    """The factors are powers of two, and the same on one and on two ranks."""
    ways = ("-snes_stol", "1e-6", "-snes_latin_newton", "never")
    lines = [mpirun(ranks, RANKS, *ways).stdout for ranks in (1, 2)]
    (reason, count, total), other = (np.array(out.split("found")[1].split(), float) for out in lines)
    assert reason > 0 and other[0] > 0
    assert abs(other[1] - count) <= 0.1 * count
    assert abs(other[2] / total - 1) < 1e-5


@pytest.mark.parametrize("force", [1e2, 1e4, 4e5, 1e7])
@pytest.mark.parametrize("first", ["set up", "no loads", "small loads"])
def test_loads_far_from_those_of_the_set_up(first, force):
    """Rigid links alone, of a solver that was set up or has solved before: 10,000 stages had not sufficed."""
    structure = latinpc.Structure(
        [[4.05324], [1.23362], [0.06872], [2.14690]], [[1, 3], [2, 3], [0, 3]], "inextensible", 0.0,
        initial_elongation=[-0.0296, -0.0067, 0.0], fixed=[[1], [1], [1], [0]],
        load=[[0], [0], [0], [1e-6 * force if first == "small loads" else 0.0]], comm=PETSc.COMM_SELF,
    )  # fmt: skip
    snes, u = structure.create_snes(), structure.create_vec()
    snes.setFromOptions()
    if first == "set up":
        snes.setUp()
    else:
        snes.solve(None, u)
    structure.set_load([[0], [0], [0], [force]])
    snes.solve(None, u)
    assert snes.getConvergedReason() > 0
    assert snes.getIterationNumber() < 100
    assert structure.displacements(u)[3, 0] == pytest.approx(0.0067, rel=1e-6)
    assert latinpc.tensions(snes) == pytest.approx([0.0, force, 0.0], rel=1e-4, abs=1e-6 * force)


def test_options_that_change_with_the_loads():
    """Loads that need other search parameters come with another number of subdomains: both are taken."""
    scene = replace(make("packing", side=6), subdomain=None)
    structure = latinpc.Structure.from_scene(scene)
    snes, u = structure.create_snes(), structure.create_vec()
    snes.setFromOptions()
    latinpc.set_subdomains(snes, 2)
    snes.solve(None, u)
    latinpc.set_subdomains(snes, 4)
    structure.set_load(1e4 * scene.load)
    snes.solve(None, u)
    assert snes.getConvergedReason() > 0
    assert latinpc.statistics(snes)["subdomains"] == 4
