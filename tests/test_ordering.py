"""The order in which direct solvers eliminate unknowns: nested dissection of the nodes."""

import numpy as np
import pytest
from petsc4py import PETSc
from support import far, irregular, solve

import latinpc  # noqa: F401  registers the ordering


def plane(side, components):
    """Matrix of a square grid of nodes, each joined with its eight neighbours in all components."""
    nodes = np.arange(side * side).reshape(side, side)
    K = PETSc.Mat().createAIJ(components * side * side, bsize=components, nnz=9 * components, comm=PETSc.COMM_SELF)
    for i, j in np.ndindex(side, side):
        near = nodes[max(0, i - 1) : i + 2, max(0, j - 1) : j + 2].ravel()
        K.setValuesBlocked([nodes[i, j]], near.astype(PETSc.IntType), -np.ones((components, components * len(near))))
    K.assemble()
    K.shift(100.0)
    return K


def entries(K, ordering):
    """Count the entries of the Cholesky factor."""
    order = K.getOrdering(ordering)[0].indices
    dense = np.abs(K[:, :])[np.ix_(order, order)] > 0
    for k in range(len(dense)):
        rows = np.flatnonzero(dense[k + 1 :, k]) + k + 1
        dense[np.ix_(rows, rows)] = True
    return np.tril(dense).sum()


@pytest.mark.parametrize("components", [1, 2, 3])
def test_nodes_stay_together(components):
    order = plane(12, components).getOrdering("latin")[0].indices
    assert sorted(order) == list(range(components * 144))
    blocks = order.reshape(-1, components)
    assert (blocks == blocks[:, :1] + np.arange(components)).all()
    assert (blocks[:, 0] % components == 0).all()


def test_fill_is_that_of_nested_dissection():
    K = plane(24, 2)
    assert entries(K, "latin") < 0.7 * entries(K, "natural")
    assert entries(K, "latin") <= entries(K, "nd")


def test_other_matrices_are_refused():
    K = PETSc.Mat().createDense(4, comm=PETSc.COMM_SELF)
    K.setUp()
    K.assemble()
    with pytest.raises(PETSc.Error):
        K.getOrdering("latin")


@pytest.mark.parametrize("ordering", ["external", "natural"])
def test_options_choose_another(ordering):
    scene = irregular()
    chosen = {"stop": "error", "error": 1e-9}
    one = solve(scene, **chosen)
    other = solve(scene, **chosen, local_pc_factor_mat_ordering_type=ordering)
    assert far(one.u, other.u) < 1e-7
    assert one.iterations == other.iterations
