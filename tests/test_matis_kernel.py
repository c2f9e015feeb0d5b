"""PC and KSP latin on a MATIS with a kernel: free bodies, rows of zeros."""

import numpy as np
import pytest
from petsc4py import PETSc

import latinpc  # noqa: F401 - registers the types


@pytest.mark.parametrize("method", ["cg", "gmres", "minres"])
@pytest.mark.parametrize("problem", ["poisson", "elasticity"])
@pytest.mark.parametrize("ranks", [1, 4])
def test_loads_of_a_free_body_with_a_resultant(ranks_for, problem, ranks, method):
    """PETSc leaves the resultant in the loads. No displacements bear it; those that bear all else are found."""
    words = ["--problem", problem, "--blocks", {1: "1,1", 4: "2,2"}[ranks], "--dirichlet", "none", "--unbalanced"]
    result = ranks_for(ranks, "matis_program", *words, "-ksp_type", method)
    assert result["reason"] > 0 and result["iterations"] <= 8 and result["residual"] < 1e-6
    assert result["resultant"] > 1e-3


@pytest.mark.parametrize("solver", [("cg", "latin"), ("latin", "none")])
@pytest.mark.parametrize("angle", [0.7, 1e-7, 1e-7 - np.pi / 2])
def test_kernel_with_a_row_of_zeros(angle, solver):
    """Springs on what else is free: one, although two vectors move it, and one of them next to nothing."""
    scale = np.array([1.0, 1.3, 0.7, 2.1, 1.0])
    chain = np.diag([1.0, 2.0, 2.0, 1.0, 0.0])
    chain[range(3), range(1, 4)] = chain[range(1, 4), range(3)] = -1.0
    chain *= np.outer(scale, scale)
    moved, zeros = np.append(1.0 / scale[:4], 0.0), np.eye(5)[4]
    moved /= np.linalg.norm(moved)
    a = PETSc.Mat().create(PETSc.COMM_SELF)
    a.setSizes(5)
    a.setType("is")
    a.setLGMap(PETSc.LGMap().create(np.arange(5, dtype=PETSc.IntType), comm=PETSc.COMM_SELF))
    a.setISLocalMat(PETSc.Mat().createDense(chain.shape, array=chain, comm=PETSc.COMM_SELF).convert("aij"))
    a.assemble()
    vectors = [a.createVecRight(), a.createVecRight()]
    vectors[0].setArray(np.cos(angle) * moved + np.sin(angle) * zeros)
    vectors[1].setArray(np.cos(angle) * zeros - np.sin(angle) * moved)
    a.setNullSpace(PETSc.NullSpace().create(vectors=vectors, comm=PETSc.COMM_SELF))
    ksp = PETSc.KSP().create(PETSc.COMM_SELF)
    ksp.setOperators(a)
    ksp.setType(solver[0])
    ksp.getPC().setType(solver[1])
    ksp.setTolerances(rtol=1e-10)
    load, u = a.createVecs()
    load.setArray(chain @ [1.0, -2.0, 0.5, 3.0, 0.0])
    ksp.solve(load, u)
    assert ksp.getConvergedReason() > 0
    assert ksp.getIterationNumber() <= 1  # one subdomain
    np.testing.assert_allclose(chain @ u.getArray(), load.getArray(), atol=1e-9)
