"""The order in which direct solvers eliminate unknowns: nested dissection of nodes, by places where they are known."""

import numpy as np
import pytest
from petsc4py import PETSc
from support import far, irregular, solve

import latinpc
from latinpc.scenes import make


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


def without_places(K):
    """Return the same matrix, of which no mesh says where its nodes are."""
    copy = PETSc.Mat().createAIJ(K.getSize(), csr=K.getValuesCSR(), bsize=K.getBlockSize(), comm=PETSc.COMM_SELF)
    return copy


def fill(K):
    """Count the entries of the Cholesky factor, by nodes, with the order `latin`."""
    size = K.getBlockSize()
    order = K.getOrdering("latin")[0].indices[::size] // size
    first, column, _ = K.getValuesCSR()
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    below = [set() for _ in order]
    for node, at in enumerate(place):
        near = place[np.unique(column[first[size * node] : first[size * node + size]] // size)]
        below[at].update(near[near > at].tolist())
    total = len(order)
    for rows in below:
        total += len(rows)
        if rows:
            parent = min(rows)
            below[parent] |= rows - {parent}
    return total


def rolled(turns=20, around=60, across=6):
    """Make a strip of net that is rolled up: what is near is not linked."""
    angle = 2.0 * np.pi / around * np.arange(turns * around)
    radius = 5.0 + angle / (2.0 * np.pi)
    ring = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0.0 * angle], axis=1)
    nodes = (ring[:, None] + [0.0, 0.0, 1.0] * np.arange(across)[:, None]).reshape(-1, 3)
    number = np.arange(len(nodes)).reshape(-1, across)
    links = np.concatenate([np.stack([number[:-1].ravel(), number[1:].ravel()], 1),
                            np.stack([number[:, :-1].ravel(), number[:, 1:].ravel()], 1)])  # fmt: skip
    return nodes, links


def jacobian(nodes, links):
    """Return the tangent stiffness of bars, with the first node held."""
    s = latinpc.Structure(nodes, links, "bar", 1.0, fixed=np.arange(len(nodes))[:, None] < [1, 1, 1])
    K, u = s.dm.createMat(), s.create_vec()
    s.jacobian(u, K)
    return K


@pytest.mark.parametrize("name, options, most", [
    ("network", {"nodes": 1500}, 1.05),
    ("tensegrity-grid", {"modules": 20, "partition": "metis"}, 1.0),
    ("lattice", {"nx": 40, "ny": 30}, 1.05),
])  # fmt: skip
def test_places_give_no_more_fill(name, options, most):
    s = latinpc.Structure.from_scene(make(name, **options))
    K, u = s.dm.createMat(), s.create_vec()
    s.jacobian(u, K)
    size = K.getBlockSize()
    order = K.getOrdering("latin")[0].indices
    assert sorted(order) == list(range(K.getSize()[0]))
    assert (order.reshape(-1, size) == order[::size, None] + np.arange(size)).all()
    assert (order != without_places(K).getOrdering("latin")[0].indices).any()
    assert fill(K) <= most * fill(without_places(K))


def test_a_net_of_squares_is_cut_aslant():
    """Diamonds have a third fewer neighbours than squares of as many nodes."""
    number = np.arange(41 * 41).reshape(41, 41)
    links = np.concatenate([np.stack([number[:-1].ravel(), number[1:].ravel()], 1),
                            np.stack([number[:, :-1].ravel(), number[:, 1:].ravel()], 1)])  # fmt: skip
    K = jacobian(np.stack([*np.divmod(number.ravel(), 41), 0.0 * number.ravel()], 1), links)
    assert fill(K) < 0.95 * fill(without_places(K))


@pytest.mark.parametrize("places", ["rolled", "shuffled"])
def test_places_that_tell_nothing_are_left_aside(places):
    nodes, links = rolled()
    K = jacobian(np.random.default_rng(1).permutation(nodes) if places == "shuffled" else nodes, links)
    assert (K.getOrdering("latin")[0].indices == without_places(K).getOrdering("latin")[0].indices).all()


def test_a_part_of_the_matrix_of_a_mesh_has_no_places():
    """Its rows are not those of the vertices."""
    nodes, links = rolled(turns=2)
    K = jacobian(nodes, links)
    rows = PETSc.IS().createStride(3 * (len(nodes) // 2), comm=PETSc.COMM_SELF)
    part = K.createSubMatrix(rows, rows)
    part.setDM(K.getDM())
    assert (part.getOrdering("latin")[0].indices == without_places(part).getOrdering("latin")[0].indices).all()


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
