"""Local low-energy fields of low-energy subdomains."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import oracle
import pytest
from petsc4py import PETSc
from support import PLAIN, far, grid, irregular, latin, lattice, network, solve, statistics, with_partition

import latinpc
from latinpc.scenes import make

THRESHOLD = 0.1


def jagged():
    """Make a lattice in blocks, some links of which went to the neighbour: nodes dangle in two dimensions."""
    scene = lattice(nx=12, ny=4, subdomains=3)
    away = np.random.default_rng(2).random(len(scene.links)) < 0.1
    return with_partition(scene, np.where(away, (scene.subdomain + 1) % 3, scene.subdomain))


SCENES = {"truss": lambda: irregular("truss"), "tensegrity": irregular, "network": network, "2D": jagged}


@pytest.mark.parametrize("name", SCENES)
def test_iterates_are_the_oracles(name):
    """Another way to the same eigenvectors, by Schur complement and pseudo-inverse, gives the same iterates."""
    scene = SCENES[name]()
    ours = solve(scene, modes_local=THRESHOLD, max_it=5, **PLAIN)
    theirs = oracle.latin_history(scene, 5, local=THRESHOLD)
    assert ours.statistics["local_macro_dofs"] > 0
    assert ours.statistics["strong_macro_dofs"] == theirs.latin.n_macro
    assert np.allclose(ours.history.indicator, theirs.indicator, rtol=1e-7)
    assert far(ours.u, theirs.iterates[-1].reshape(ours.u.shape)) < 1e-8


@pytest.mark.parametrize("direction", ["scalar", "block", "schur"])
def test_other_directions(direction):
    """The fields are low relative to the diagonal of a matrix direction, and orthonormal in the matrix."""
    ours = solve(irregular(), modes_local=THRESHOLD, direction=direction, max_it=5, **PLAIN)
    theirs = oracle.latin_history(irregular(), 5, local=THRESHOLD, direction=direction)
    assert ours.statistics["strong_macro_dofs"] == theirs.latin.n_macro
    assert np.allclose(ours.history.indicator, theirs.indicator, rtol=1e-7)


def test_a_second_solve_keeps_the_fields():
    """New loads, and loads given as the right-hand side: no new set-up, the right displacements."""
    scene = irregular()
    with latin(scene, modes_local=THRESHOLD, stol=1e-9, warm_start="last") as run:
        u, b = run.structure.create_vec(), run.structure.create_vec()
        run.structure.set_displacements(scene.load, b)  # as much again
        run.snes.solve(b, u)
        assert far(run.structure.displacements(u), oracle.newton(replace(scene, load=2 * scene.load))) < 1e-6
        sizes = latinpc.statistics(run.snes)
        run.structure.set_load(1.1 * scene.load)
        run.snes.solve(None, u)
        assert run.snes.reason > 0
        assert far(run.structure.displacements(u), oracle.newton(replace(scene, load=1.1 * scene.load))) < 1e-6
        assert latinpc.statistics(run.snes) == sizes


@pytest.mark.parametrize("name", SCENES)
def test_the_solution_stays(name):
    """The fields change the way to the solution, not the solution."""
    scene = SCENES[name]()
    ours = solve(scene, modes_local=THRESHOLD, stol=1e-9)
    assert ours.reason > 0
    assert far(ours.u, oracle.newton(scene)) < 1e-6


@pytest.mark.parametrize("kind", ["truss", "tensegrity"])
def test_iterations_are_saved(kind):
    """A partition that cuts through modules: fewer iterations to the same error."""
    scene = make(f"{kind}-grid", modules=16, partition="metis")
    reference = oracle.newton(scene)
    how = {
        "subdomains": 16,
        "variant": "corner",
        "stop": "reference",
        "stol": 1e-4,
        "_reference": reference,
    }
    without, with_them = solve(scene, **how), solve(scene, modes_local=1, **how)
    assert with_them.iterations <= 0.75 * without.iterations, (with_them.iterations, without.iterations)
    assert with_them.statistics["low_energy_subdomains"] == 16


def test_none_below_the_threshold():
    """The same coarse problem and the same iterates to the bit."""
    without, with_them = solve(grid(), max_it=4, variant="corner"), solve(grid(), max_it=4, modes_local=1e-6)
    assert with_them.statistics["strong_macro_dofs"] == without.statistics["strong_macro_dofs"]
    assert with_them.statistics["local_macro_dofs"] == 0
    assert np.array_equal(with_them.u, without.u)


@pytest.mark.parametrize("modules", [6, 10])
def test_a_single_subdomain_has_no_interfaces(modules):
    """No fields, and the displacements are those of a solve without them; the larger grid has a sparse factor."""
    scene = make("tensegrity-grid", modules=modules, partition="metis")
    without, with_them = solve(scene, subdomains=1), solve(scene, subdomains=1, modes_local=THRESHOLD)
    assert with_them.statistics["local_macro_dofs"] == 0
    assert np.array_equal(with_them.u, without.u)


def test_most_of_a_subdomain():
    """However large the threshold, a subdomain has 64 fields at most."""
    assert statistics(irregular(), modes_local=1e6)["local_modes_max"] == 64


def test_units_do_not_matter():
    """The threshold is relative to the search direction."""
    scene = irregular()
    other = replace(scene, stiffness=1e-3 * scene.stiffness, load=scene.load, nodes=1e3 * scene.nodes)
    other = replace(other, initial_elongation=1e3 * scene.initial_elongation)
    a, b = (solve(s, modes_local=THRESHOLD, max_it=6) for s in (scene, other))
    assert a.statistics["local_macro_dofs"] == b.statistics["local_macro_dofs"]
    assert np.allclose(a.history.indicator, b.history.indicator, rtol=1e-7)
    assert far(1e3 * a.u, b.u) < 1e-7


def test_equal_subdomains_share_their_fields():
    """Every module cut into the same two halves: bases equal to the bit, so that factors are still shared."""
    scene = make("truss-grid", modules=15, subdomains=25)
    scene = with_partition(scene, 2 * scene.subdomain + np.arange(len(scene.links)) // 8 % 2)  # 16 links a module
    factors = []
    for options in ({}, {"modes_local": THRESHOLD}):
        with latin(scene, **options) as run:
            run.snes.setUp()
            factors.append(len({latinpc.local_ksp(run.snes, i).handle for i in range(50)}))
    assert factors[1] == factors[0] < 25
    ours = solve(scene, modes_local=THRESHOLD, max_it=3, **PLAIN)
    theirs = oracle.latin_history(scene, 3, local=THRESHOLD)
    assert ours.statistics["low_energy_subdomains"] > 25
    assert ours.statistics["strong_macro_dofs"] == theirs.latin.n_macro
    assert np.allclose(ours.history.indicator, theirs.indicator, rtol=1e-7)


RANKS = """
import sys
sys.path.insert(0, sys.argv[1])
import numpy as np
from petsc4py import PETSc
from support import irregular, solve
import latinpc

scene = irregular()
structure = latinpc.Structure.from_scene(scene)
found = solve(scene, _structure=structure, modes_local=0.1, max_it=8)
s = found.statistics
if PETSc.COMM_WORLD.rank == 0:
    print(s["local_macro_dofs"], s["low_energy_subdomains"], s["local_modes_max"], s["strong_macro_dofs"])
    print(repr(float(np.abs(found.u).sum())), repr(float(found.history.indicator[-1])))
"""


def test_ranks_do_not_matter(mpirun):
    """One rank, two and four: the same fields, the same iterates to rounding."""
    found = [mpirun(n, RANKS, Path(__file__).parent).stdout.split() for n in (1, 2, 4)]
    assert int(found[0][0]) > 0
    for other in found[1:]:
        assert other[:4] == found[0][:4]
        assert np.allclose(np.array(other[4:], float), np.array(found[0][4:], float), rtol=1e-6)


def test_view_tells(tmp_path):
    """-snes_view: how many fields, and of which subdomains."""
    with latin(irregular(), modes_local=THRESHOLD) as run:
        run.snes.setUp()
        viewer = PETSc.Viewer().createASCII(str(tmp_path / "view"), comm=PETSc.COMM_SELF)
        run.snes.view(viewer)
        viewer.destroy()
        found = latinpc.statistics(run.snes)
    text = (tmp_path / "view").read_text()
    assert f"{found['low_energy_subdomains']} low-energy subdomains, at most {found['local_modes_max']} modes" in text
    assert f"{found['local_macro_dofs']} of the macro displacements" in text


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"modes_local": -1}, "it is a positive number"),
        ({"modes_local": 0.1, "variant": "macro"}, "needs -snes_latin_variant corner"),
        ({"modes_local": 0.1, "variant": "published"}, "needs -snes_latin_variant corner"),
    ],
)
def test_misuse(options, message):
    """An error that names the cure."""
    with pytest.raises(PETSc.Error) as error:
        statistics(grid(), **options)
    assert message in latinpc.error_message(error.value)
