"""Nested condensation of the coarse problem: repeated groups of subdomains are eliminated before it is factored."""

import re
from pathlib import Path

import numpy as np
import pytest
from petsc4py import PETSc
from support import far, grid, irregular, latin, lattice, solve, statistics

import latinpc
from latinpc.scenes import Law, Scene

# 12 x 12 subdomains of 2 x 2 modules, nine kinds of them
MODULAR = {"kind": "truss", "modules": 24, "subdomains": 144}
# an iterative solver has the coarse problem as it is, here to rounding
SPARSE = {"coarse_ksp_type": "cg", "coarse_ksp_rtol": 1e-14, "coarse_pc_type": "icc"}


def matrix(scene, **options):
    """Coarse matrix of the solver, dense, and the size of the problem."""
    with latin(scene, **options) as run:
        run.snes.setUp()
        a = latinpc.coarse_ksp(run.snes).getOperators()[0]
        sizes = latinpc.statistics(run.snes)
        assert a.getSize() == (sizes["coarse_size"],) * 2
        return a.convert("dense", PETSc.Mat()).getDenseArray().copy(), sizes


@pytest.mark.parametrize("variant", ["none", "macro", "corner"])
def test_what_is_left_is_a_schur_complement(variant):
    """Symmetric, smaller, and its eigenvalues lie between those of the whole."""
    scene = lattice(nx=32, ny=32, subdomains=256)
    whole, sizes = matrix(scene, variant=variant, **SPARSE)
    left, condensed = matrix(scene, variant=variant)
    assert sizes["coarse_levels"] == 0 and condensed["coarse_levels"] > 0
    assert len(whole) == sizes["strong_macro_dofs"] + sizes["weak_dofs"] > 1.5 * len(left)
    assert abs(left - left.T).max() < 1e-14 * abs(left).max()
    low, high = np.linalg.eigvalsh(left)[[0, -1]]
    least, largest = np.linalg.eigvalsh(whole)[[0, -1]]
    assert least * (1 - 1e-9) <= low and high <= largest * (1 + 1e-9)


def test_same_iterates_with_and_without():
    """The elimination is exact: displacements after some iterations are equal to rounding."""
    scene = grid("tensegrity", modules=24, subdomains=144)
    without, with_groups = (solve(scene, max_it=3, stol=0, **options) for options in (SPARSE, {}))
    assert without.statistics["coarse_levels"] == 0 < with_groups.statistics["coarse_levels"]
    assert far(with_groups.u, without.u) < 1e-10


def test_nothing_is_grouped_where_nothing_repeats():
    """An irregular partition, or a few subdomains that are all different, keep the sparse matrix."""
    for scene in (irregular(parts=40), grid()):
        found = statistics(scene)
        assert found["coarse_levels"] == 0
        assert found["coarse_size"] == found["strong_macro_dofs"] + found["weak_dofs"]


def test_iterative_coarse_solvers_get_the_sparse_matrix():
    """Groups fill the matrix, which suits direct solvers alone."""
    scene = grid(**MODULAR)
    assert statistics(scene)["coarse_levels"] > 0
    assert statistics(scene, coarse_pc_type="gamg")["coarse_levels"] == 0
    assert statistics(scene, coarse_ksp_type="cg")["coarse_levels"] == 0


def test_preconditioner_uses_it_too():
    """PC latin: as many iterations with groups as without."""
    from latinpc.options import default_options

    counts = []
    for options in (SPARSE | {"coarse_ksp_rtol": 1e-11}, {}):
        structure = latinpc.Structure.from_scene(grid(**MODULAR), comm=PETSc.COMM_SELF)
        with default_options(
            {
                "snes_type": "ksponly",
                "ksp_type": "cg",
                "pc_type": "latin",
                "ksp_rtol": 1e-4,
            }
            | {f"pc_latin_{key}": value for key, value in options.items()}
        ):
            snes = structure.create_snes()
            snes.setFromOptions()
            u = structure.create_vec()
            snes.solve(None, u)
        assert (latinpc.statistics(snes.getKSP().getPC())["coarse_levels"] > 0) == (not options)
        counts.append(snes.getLinearSolveIterations())
        snes.destroy()
    assert counts[0] == counts[1]


PROGRAM = """
import json, sys
sys.path.insert(0, sys.argv[1])
import latinpc
from petsc4py import PETSc
from support import grid
snes = (structure := latinpc.Structure.from_scene(grid("tensegrity", modules=48, subdomains=576))).create_snes()
PETSc.Options().setValue("snes_max_it", 6)
PETSc.Options().setValue("snes_stol", 0)
snes.setFromOptions()
u = structure.create_vec()
snes.solve(None, u)
levels, found = latinpc.statistics(snes)["coarse_levels"], structure.displacements(u)
if PETSc.COMM_WORLD.rank == 0:
    print(json.dumps([levels, found.tolist()]))
"""


@pytest.mark.parametrize("ranks", [2, pytest.param(4, marks=pytest.mark.slow)])
def test_on_several_ranks(mpirun, ranks):
    """Groups stay on their rank; displacements are those of one rank."""
    import json

    levels, found = json.loads(mpirun(ranks, PROGRAM, Path(__file__).parent).stdout)
    alone = solve(grid("tensegrity", modules=48, subdomains=576), max_it=6, stol=0)
    assert levels > 0
    assert far(np.array(found), alone.u) < 1e-9


def segments(held, parts=3, links=4, count=12):
    """Make rows of bars that nothing joins, each a group of subdomains, held at their left ends or not."""
    nodes = np.concatenate([np.arange(parts * links + 1.0) + k * parts * links for k in range(count)])[:, None]
    first = np.concatenate([np.arange(parts * links) + k * (parts * links + 1) for k in range(count)])
    fixed = np.zeros((len(nodes), 1), bool)
    fixed[np.arange(0, len(nodes), parts * links + 1)[held]] = True
    return Scene(
        name="segments", nodes=nodes, links=np.column_stack([first, first + 1]), law=np.full(len(first), Law.BAR),
        stiffness=np.full(len(first), 1e3), initial_elongation=np.zeros(len(first)), fixed=fixed,
        prescribed=np.zeros_like(nodes), load=np.where(fixed, 0.0, 1.0), subdomain=np.arange(len(first)) // links,
    )  # fmt: skip


def test_disjoint_structures_are_condensed_entirely():
    """When every group is a structure of its own nothing is left for the coarse solver, and the solution is exact."""
    scene = segments(held=slice(None))
    found = solve(scene, rtol=1e-10)
    elongation = np.arange(12, 0, -1) / 1e3
    exact = np.tile(np.concatenate([[0.0], np.cumsum(elongation)]), 12)[:, None]
    assert found.statistics["coarse_levels"] > 0
    assert found.reason > 0
    assert far(found.u, exact) < 1e-9


def test_a_mechanism_inside_a_group_is_reported():
    """A group that is singular is not condensed, so that the coarse solver finds the mechanism and names nodes."""
    assert statistics(segments(held=slice(None)))["coarse_levels"] > 0
    with pytest.raises(PETSc.Error) as caught:
        statistics(segments(held=slice(0, 1)))
    assert re.search(r"has a mechanism: .* Nodes that move .*: \d", latinpc.error_message(caught.value))


def loose_bars(pairs, dim, alike):
    """Make pairs of bars that nothing holds, the node between them in two subdomains, beside a bar that is held."""
    rng = np.random.default_rng(0)
    first = 3 * np.arange(pairs)
    pair = np.arange(3.0)[:, None] ** np.arange(1, dim + 1)
    nodes = np.concatenate([pair if alike else rng.normal(size=(3, dim)) for _ in first] + [np.eye(2, dim)])
    nodes[:, 0] += 5.0 * (np.arange(len(nodes)) // 3)
    links = np.column_stack([first, first + 1, first + 1, first + 2]).reshape(-1, 2)
    links = np.vstack([links, [[3 * pairs, 3 * pairs + 1]]])
    fixed = np.arange(len(nodes))[:, None] >= np.full(dim, 3 * pairs)
    return Scene(
        name="loose bars", nodes=nodes, links=links, law=np.full(len(links), Law.BAR), stiffness=np.ones(len(links)),
        initial_elongation=np.zeros(len(links)), fixed=fixed, load=np.where(fixed, 0.0, rng.normal(size=nodes.shape)),
        subdomain=np.append(np.arange(2 * pairs), 0),
    )  # fmt: skip


@pytest.mark.parametrize("variant", ["none", "macro", "corner", "primal"])
@pytest.mark.parametrize(("pairs", "dim", "alike"), [(1, 1, True), (2, 1, False), (40, 1, True), (9, 3, True)])
def test_a_mechanism_shows_though_nothing_is_left_of_the_stiffness(variant, pairs, dim, alike):
    """Each half of a pair is condensed to rounding, beside which no displacement is soft."""
    with pytest.raises(PETSc.Error) as caught:
        statistics(loose_bars(pairs, dim, alike), variant=variant)
    assert "has a mechanism" in latinpc.error_message(caught.value)
