"""The factorisation `latin`: CHOLMOD with rows kept to the last."""

import numpy as np
import pytest
from petsc4py import PETSc
from support import grid, irregular, latin, network

import latinpc

RANDOM = np.random.default_rng(3)


def matrix(dense, block=1):
    """Make the AIJ matrix of an array, without its zeros."""
    n = len(dense)
    A = PETSc.Mat().createAIJ((n, n), bsize=block, comm=PETSc.COMM_SELF)
    A.setUp()
    for i, j in zip(*np.nonzero(dense), strict=True):
        A.setValue(i, j, dense[i, j])
    A.assemble()
    A.setOption(PETSc.Mat.Option.SPD, True)
    return A


def definite(n, share):
    """A symmetric positive definite array of which a share of the entries is nonzero."""
    a = RANDOM.standard_normal((n, n)) * (RANDOM.random((n, n)) < share)
    return a @ a.T + np.eye(n)


def factor(A):
    """Factor a matrix."""
    ksp = PETSc.KSP().create(PETSc.COMM_SELF)
    ksp.setOperators(A)
    ksp.setType("preonly")
    ksp.getPC().setType("cholesky")
    ksp.getPC().setFactorSolverType("latin")
    ksp.setUp()
    return ksp


# full: the order as it is, and columns in several panels; small: minimum degree; large: nested dissection of the nodes
@pytest.mark.parametrize(
    ("n", "share", "block"), [(1, 1.0, 1), (40, 0.5, 1), (200, 1.0, 1), (300, 0.004, 3), (1200, 0.0005, 2)]
)
def test_solutions_are_those_of_dense_algebra(n, share, block):
    dense = definite(n, share)
    ksp = factor(matrix(dense, block))
    b = RANDOM.standard_normal((n, 70))  # more columns than are solved together
    B = PETSc.Mat().createDense(b.shape, array=b, comm=PETSc.COMM_SELF)
    X = PETSc.Mat().createDense(b.shape, comm=PETSc.COMM_SELF)
    X.setUp()
    for M in (B, X):
        M.assemble()
    ksp.getPC().matApply(B, X)
    assert np.allclose(X.getDenseArray(), np.linalg.solve(dense, b), rtol=1e-9, atol=1e-12)
    x, r = ksp.getOperators()[0].createVecs()
    r.array = b[:, 0]
    ksp.solve(r, x)
    assert np.allclose(x.array, np.linalg.solve(dense, b[:, 0]), rtol=1e-9, atol=1e-12)


def test_what_lies_above_the_diagonal_is_left_out():
    """But for the blocks of panels of 64 columns."""
    entries = factor(matrix(definite(200, 1.0))).getPC().getFactorMatrix().getInfo()["nz_used"]
    assert entries == sum((200 - 64 * k) * columns for k, columns in enumerate((64, 64, 64, 8)))


def test_new_values_in_the_same_places():
    """The factor is made anew where the matrix has changed."""
    dense = definite(60, 0.1)
    A = matrix(dense)
    ksp = factor(A)
    A.scale(2.0)
    ksp.setOperators(A)
    x, r = A.createVecs()
    r.set(1.0)
    ksp.solve(r, x)
    assert np.allclose(x.array, np.linalg.solve(2.0 * dense, np.ones(60)))


def test_a_matrix_that_is_not_definite_fails():
    """The reason says so; nothing is raised, and nothing is printed."""
    A = matrix(np.diag([1.0, 2.0, -1.0, 3.0]))
    ksp = factor(A)
    x, r = A.createVecs()
    ksp.solve(r, x)
    assert ksp.getConvergedReason() == PETSc.KSP.ConvergedReason.DIVERGED_PCSETUP_FAILED


def test_other_matrices_are_refused():
    """The type is of rows of one rank."""
    A = PETSc.Mat().createDense(4, comm=PETSc.COMM_SELF)
    A.setUp()
    A.assemble()
    with pytest.raises(PETSc.Error):
        factor(A)


# ---- rows kept to the last: the interfaces of subdomains ---------------------------------------
def homogenised(scene, run):
    """Compare H of each subdomain with dense algebra."""
    part = latinpc.subdomain_of_links(run.snes)
    shared = np.bincount(np.concatenate([np.unique(scene.links[part == s]) for s in range(part.max() + 1)])) > 1
    for s in range(part.max() + 1):
        nodes = np.unique(scene.links[part == s])
        kept = np.flatnonzero((shared[nodes, None] & ~scene.fixed[nodes]).ravel())
        matrix = latinpc.local_ksp(run.snes, s).getOperators()[0]
        K = matrix[:, :]
        inside = np.setdiff1d(np.arange(len(K)), kept)
        S = K[np.ix_(kept, kept)] - K[np.ix_(kept, inside)] @ np.linalg.solve(
            K[np.ix_(inside, inside)], K[np.ix_(inside, kept)]
        )
        H = latinpc.macro_stiffness(run.snes, s).getDenseArray()
        assert np.array_equal(H, H.T)
        assert np.array_equal(matrix[:, :], K)  # the factor that H takes has left it there
        assert np.abs(H - S).max() < 1e-12 * np.abs(K).max()


@pytest.mark.parametrize("make", [grid, irregular, network])
def test_homogenised_stiffness_is_the_schur_complement(make):
    """H of each subdomain: K on its interfaces with all else eliminated, symmetric to the bit."""
    scene = make()
    with latin(scene, variant="primal") as run:
        run.snes.setUp()
        homogenised(scene, run)


@pytest.mark.parametrize("make", [irregular, network])
def test_nodes_may_be_kept_in_part(make):
    """Supports that hold one component of the nodes on interfaces, and all of others."""
    scene = make()
    rng = np.random.default_rng(5)
    scene.fixed = scene.fixed | (rng.random(scene.fixed.shape) < 0.1)
    scene.load = np.where(scene.fixed, 0.0, scene.load)
    with latin(scene, variant="primal") as run:
        run.snes.setUp()
        homogenised(scene, run)


@pytest.mark.parametrize("seed", range(12))
def test_any_rows_may_be_kept(seed):
    """Interfaces anywhere, so that what is left of the tree of elimination without them is no tree in its order."""
    rng = np.random.default_rng(seed)
    scene = latinpc.scenes.make("network", nodes=240, seed=seed)
    near = rng.uniform(scene.nodes.min(axis=0), scene.nodes.max(axis=0), (3, 3))
    middle = scene.nodes[scene.links].mean(axis=1)
    part = np.linalg.norm(middle[:, None] - near, axis=2).argmin(axis=1)
    loose = rng.random(len(part)) < 0.05
    scene.subdomain = np.where(loose, rng.integers(0, 3, len(part)), part)
    with latin(scene, variant="primal", stol=0.0, max_it=6) as run:
        run.snes.setUp()
        many = run.structure.create_vec()
        run.snes.solve(None, many)
        homogenised(scene, run)
    scene.subdomain = np.zeros(len(scene.links), dtype=int)
    with latin(scene, variant="primal", stol=0.0, max_it=6) as run:
        one = run.structure.create_vec()
        run.snes.solve(None, one)
    assert (many - one).norm() < 1e-9 * one.norm()
