"""The coarse problem (30), (52): its matrix, its solver, and what it is for."""

import numpy as np
import oracle
import pytest
from petsc4py import PETSc
from support import (
    ALL_VARIANTS,
    PLAIN,
    VARIANTS,
    chain,
    far,
    grid,
    irregular,
    latin,
    lattice,
    network,
    oracle_options,
    settled,
    solve,
)

import latinpc


def assembled(model):
    """Coarse matrix of the oracle, summed up from the subdomains."""
    h = np.zeros((model.n_coarse, model.n_coarse))
    for part in model.parts:
        h[np.ix_(part.coarse, part.coarse)] += part.h
    return h


def matrix(scene, **options):
    """Coarse matrix of the solver, dense."""
    with latin(scene, **options) as run:
        run.snes.setUp()
        a = latinpc.coarse_ksp(run.snes).getOperators()[0]
        sizes = latinpc.statistics(run.snes)
        assert a.getSize() == (sizes["strong_macro_dofs"] + sizes["weak_dofs"],) * 2
        return a.convert("dense", PETSc.Mat()).getDenseArray().copy()


@pytest.mark.parametrize("variant", ALL_VARIANTS)
@pytest.mark.parametrize("make", [grid, irregular, network, lattice, chain])
def test_coarse_matrix(make, variant):
    """Symmetric, positive definite, with the eigenvalues of the oracle's: bases differ by a rotation only."""
    scene, options = make(), {"variant": variant}
    a, theirs = matrix(scene, **options), assembled(oracle.build(scene, **oracle_options(options)))
    assert abs(a - a.T).max() < 1e-12 * abs(a).max()
    scale = abs(theirs).max()
    assert np.linalg.eigvalsh(a) / scale == pytest.approx(np.linalg.eigvalsh(theirs) / scale, abs=1e-11)
    unit = np.sqrt(a.diagonal())
    assert np.linalg.eigvalsh(a / unit[:, None] / unit)[0] > 1e-8


SOLVERS = {
    "mumps lu": {"coarse_pc_type": "lu", "coarse_pc_factor_mat_solver_type": "mumps"},
    "petsc": {"coarse_pc_factor_mat_solver_type": "petsc"},
    "cholmod": {"coarse_pc_factor_mat_solver_type": "cholmod"},
    "redundant": {"coarse_pc_type": "redundant"},
    "cg": {"coarse_ksp_type": "cg", "coarse_pc_type": "jacobi", "coarse_ksp_rtol": 1e-14},
    "minres": {"coarse_ksp_type": "minres", "coarse_pc_type": "jacobi", "coarse_ksp_rtol": 1e-15},
}


@pytest.mark.parametrize("solver", SOLVERS)
def test_any_solver_of_the_coarse_problem(solver):
    """Direct or iterative to rounding, by option: the same iterates."""
    scene = network()
    default, other = (solve(scene, max_it=4, stol=0, **options, **PLAIN) for options in ({}, SOLVERS[solver]))
    assert far(other.u, default.u) < 1e-9


def test_default_solver_of_the_coarse_problem():
    """On one rank that of the subdomains, under a prefix of its own; several: test_tree.py."""
    with latin(grid()) as run:
        run.snes.setUp()
        ksp = latinpc.coarse_ksp(run.snes)
        assert ksp.getOptionsPrefix() == "snes_latin_coarse_"
        assert ksp.getPC().getType() == "cholesky"
        assert ksp.getPC().getFactorSolverType() == "latin"


@pytest.mark.parametrize("limit", [{"coarse_ksp_max_it": 5}, {"coarse_ksp_divtol": 1e-3}])
def test_coarse_solver_that_gives_up_is_reported(limit):
    """A coarse solver that fails is no convergence, whatever the indicator says."""
    options = {"coarse_ksp_type": "cg", "coarse_pc_type": "jacobi", "coarse_ksp_rtol": 1e-12, **limit}
    result = solve(grid(), **options)
    assert result.reason == PETSc.SNES.ConvergedReason.DIVERGED_LINEAR_SOLVE


def test_no_coarse_problem_without_interface():
    """One subdomain is solved by its own links alone; there is no coarse solver to be had."""
    scene = settled(lattice(subdomains=32))
    scene.subdomain[:] = 0
    with latin(scene, stol=1e-12) as run:
        u = run.structure.create_vec()
        run.snes.solve(None, u)
        assert not latinpc.coarse_ksp(run.snes)
        assert run.structure.displacements(u) == pytest.approx(oracle.newton(scene), rel=1e-9)


@pytest.mark.parametrize("variant", VARIANTS)
def test_iterations_do_not_grow_with_the_number_of_subdomains(variant):
    """A long beam cut across: eight times the subdomains take no more than a few iterations more."""
    counts = []
    for blocks in (4, 32):
        scene = lattice(nx=4 * blocks, ny=4, subdomains=blocks, load=1e-3)
        result = solve(scene, variant=variant, stol=1e-8)
        assert result.reason > 0
        counts.append(result.iterations)
    assert counts[1] <= counts[0] + 4


@pytest.mark.parametrize("parts", [2, 5, 24])
def test_chain_is_solved_by_the_coarse_problem(parts):
    """In one dimension all of an interface is macro, so that bars need a single linear stage."""
    scene = chain(parts=parts)
    result = solve(scene, max_it=1)
    assert result.u == pytest.approx(oracle.newton(scene), rel=1e-11, abs=1e-14)
