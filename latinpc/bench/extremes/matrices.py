"""The cases of matrices: PC latin and KSP latin on a MATIS of finite elements with extreme coefficients."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, fields

import numpy as np
from petsc4py import PETSc

from .case import ACCURACY, Case

CELLS, BLOCKS = 8, 2  # along a side of the square: 72 or 144 unknowns, four local matrices
POISSON, ELASTICITY = "Poisson", "elasticity"
UNIT = float(np.finfo(PETSc.RealType).eps) / 2
ROUNDINGS = 3  # of all entries, at random
ORDERS = 3  # of elimination, at random


@dataclass
class Elements:
    """Finite elements on a square of which one side is held."""

    cells: np.ndarray  #: (n, m) numbers of the unknowns of each cell
    stiffness: np.ndarray  #: (n, m, m) of each cell
    rank: np.ndarray  #: (n,) whose cell it is
    held: np.ndarray  #: of each unknown
    load: np.ndarray  #: of each unknown
    nodes: np.ndarray  #: (unknowns, 2)

    def save(self, path):
        """Write all to a .npz file."""
        np.savez(path, **{field.name: getattr(self, field.name) for field in fields(self)})

    @classmethod
    def load_from(cls, path):
        """Read what `save` wrote."""
        with np.load(path) as file:
            return cls(**file)

    def local(self, rank):
        """Assemble the local matrix of a rank in floating point; its unknowns, sorted."""
        import scipy.sparse as sp

        mine = np.flatnonzero(self.rank == rank)
        numbers, row = np.unique(self.cells[mine], return_inverse=True)
        row = row.reshape(len(mine), self.cells.shape[1])
        entries = (np.repeat(row, row.shape[1], axis=1).ravel(), np.tile(row, row.shape[1]).ravel())
        values = self.stiffness[mine].ravel().astype(PETSc.ScalarType)
        return sp.csr_matrix((values, entries), shape=(len(numbers),) * 2), numbers

    def matis(self, comm):
        """Assemble the MATIS, the cells of a rank its local matrix, with rows of 1 for what is held; collective."""
        csr, numbers = self.local(comm.rank)
        local = PETSc.Mat().createAIJ(
            csr.shape, csr=(csr.indptr.astype(PETSc.IntType), csr.indices.astype(PETSc.IntType), csr.data),
            comm=PETSc.COMM_SELF,
        )  # fmt: skip
        numbering = PETSc.LGMap().create(numbers.astype(PETSc.IntType), comm=comm)
        matrix = PETSc.Mat().createIS([(None, len(self.held))] * 2, lgmapr=numbering, lgmapc=numbering, comm=comm)
        matrix.setISLocalMat(local)
        matrix.assemble()
        low, high = matrix.getOwnershipRange()
        matrix.zeroRowsColumns(np.flatnonzero(self.held[low:high]).astype(PETSc.IntType) + low, 1.0)
        matrix.setOption(PETSc.Mat.Option.SPD, True)
        return matrix

    def errors(self, x):
        """Return the relative error of x, and what rounding moves, in exact energy norms.

        The right solution is that of the local matrices as `matis` has them. Nothing is loaded, and x moves: 1.
        Rounding is that of the entries, at random, or of a dense Cholesky factorisation in a random order: the larger.
        """
        from flint import arb, arb_mat, ctx

        free = np.flatnonzero(~self.held)
        before, ctx.prec = ctx.prec, 400
        try:
            load = arb_mat([[arb(float(f))] for f in self.load[free]])
            matrix = self._exact(free, None)
            exact = matrix.solve(load)
            found = arb_mat([[arb(float(value))] for value in x[free]])
            rounded = [self._exact(free, np.random.default_rng(i)).solve(load) for i in range(ROUNDINGS)]
            rounded += [arb_mat([[arb(float(v))] for v in self._dense(free, i)]) for i in range(ORDERS)]
            size, error, *moved = (
                float((v.transpose() * matrix * v)[0, 0].mid())
                for v in (exact, found - exact, *(other - exact for other in rounded))
            )
            if size == 0.0:
                return float(error > 0.0), 0.0
            if min(error, size, *moved) < 0.0:  # as rounded, the matrix is not positive definite
                return float("inf"), float("inf")
            return (error / size) ** 0.5, (max(moved) / size) ** 0.5
        finally:
            ctx.prec = before

    def _dense(self, free, seed):
        """Solve by a dense Cholesky factorisation, in double precision, the unknowns in a random order."""
        import scipy.linalg as sl

        matrix = np.zeros((len(self.held),) * 2)
        for rank in np.unique(self.rank):
            local, numbers = self.local(rank)
            matrix[np.ix_(numbers, numbers)] += local.toarray().real
        order = np.random.default_rng(seed).permutation(len(free))
        rows, x = free[order], np.empty(len(free))
        x[order] = sl.cho_solve(sl.cho_factor(matrix[np.ix_(rows, rows)]), self.load[rows])
        return x

    def _exact(self, free, rng):
        """Sum the local matrices in ball arithmetic, with rng of entries that are half a unit of the last place off."""
        from flint import arb, arb_mat

        row = np.full(len(self.held), -1)
        row[free] = np.arange(len(free))
        entries = [[arb(0)] * len(free) for _ in free]
        for rank in np.unique(self.rank):
            local, numbers = self.local(rank)
            sign = np.zeros(local.shape) if rng is None else np.triu(rng.choice([-1.0, 1.0], size=local.shape))
            sign += np.triu(sign, 1).T
            local, to = local.tocoo(), row[numbers]
            for a, b, value in zip(local.row, local.col, local.data):
                if to[a] >= 0 and to[b] >= 0:
                    entries[to[a]][to[b]] += arb(float(value)) * (1 + arb(UNIT) * float(sign[a, b]))
        return arb_mat(entries)


def square(problem=POISSON, across=1.0, inside=1.0, random=1.0, tensor=(1.0, 1.0), poisson=0.3, scale=1.0, load=1.0,
           blocks=BLOCKS):  # fmt: skip
    """Make bilinear elements on a square of 8 x 8 cells, held on its left side, under a random load.

    Parameters
    ----------
    problem : {'Poisson', 'elasticity'}
    across, inside, random : float
        Coefficient of every other block, of stripes through the blocks, of the stiffest of cells at random.
    tensor : tuple of float
        Conductivities along the two axes.
    poisson : float
        Poisson's ratio, in plane strain.
    scale, load : float
        Of the matrix and of the load.
    blocks : int
        Along a side; each is a rank's.
    """
    n, each = CELLS + 1, 2 if problem == ELASTICITY else 1
    place = np.array(list(itertools.product(range(CELLS), repeat=2)))
    corner = np.array(list(itertools.product((0, 1), repeat=2)))
    at = (place[:, None] + corner) @ [n, 1]
    block = place * blocks // CELLS
    coefficient = np.where(block.sum(axis=1) % 2, across, 1.0) * np.where(place[:, 1] % 4 == 2, inside, 1.0)
    rng = np.random.default_rng(1)
    coefficient *= scale * random ** rng.random(len(place))
    nodes = np.repeat(np.array(list(itertools.product(range(n), repeat=2)), float), each, axis=0)
    held = nodes[:, 0] == 0.0
    return Elements((at[:, :, None] * each + np.arange(each)).reshape(len(at), -1),
                    coefficient[:, None, None] * _element(problem, tensor, poisson), block @ [blocks, 1], held,
                    np.where(held, 0.0, load * rng.normal(size=n * n * each)), nodes)  # fmt: skip


def _element(problem, tensor, nu):
    """Stiffness of a square cell by four points of integration."""
    corner = np.array(list(itertools.product((0, 1), repeat=2)))
    size = 8 if problem == ELASTICITY else 4
    k = np.zeros((size, size))
    for point in 0.5 + np.array(list(itertools.product((-1, 1), repeat=2))) / np.sqrt(12.0):
        along = np.where(corner, point, 1.0 - point)
        gradient = np.where(corner, 1.0, -1.0) * along[:, ::-1]  # (corner, axis)
        if problem == POISSON:
            k += 0.25 * gradient @ np.diag(tensor) @ gradient.T
            continue
        strain = np.zeros((3, 8))
        strain[0, ::2], strain[1, 1::2] = gradient.T
        strain[2, ::2], strain[2, 1::2] = gradient[:, 1], gradient[:, 0]
        law = np.array([[1 - nu, nu, 0], [nu, 1 - nu, 0], [0, 0, 0.5 - nu]]) / ((1 + nu) * (1 - 2 * nu))
        k += 0.25 * strain.T @ law @ strain
    return k


# ---- the catalogue ---------------------------------------------------------------------------


def cases():
    """Return all cases, group by group."""
    for solver in ("pc", "ksp"):
        for problem in (POISSON, ELASTICITY):
            for name, where in (
                ("across", "from block to block"),
                ("inside", "along stripes"),
                ("random", "at random"),
            ):
                for power in (6, 12) if name == "random" else (6, -6, 12, -12):
                    yield _case(solver, f"{problem}, 1e{power} {where}", problem, **{name: 10.0**power})
        for power in (-3, -6, -12):
            yield _case(solver, f"conductivity 1e{power} times as small across", tensor=(1.0, 10.0**power))
            yield _case(solver, f"conductivity 1e{power} times as small along", tensor=(10.0**power, 1.0))
        for digits in (2, 4, 8):
            ratio = 0.5 - 10.0**-digits
            yield _case(solver, f"Poisson's ratio {ratio:.10g}", ELASTICITY, poisson=ratio)
        for power in (-12, 12):
            yield _case(solver, f"1e{power} times the matrix", scale=10.0**power)
            yield _case(solver, f"1e{power} times the load", load=10.0**power)
        yield _case(solver, "no load", load=0.0)
        yield _case(solver, "one local matrix", ELASTICITY, blocks=1)
        yield _case(solver, "16 ranks", ELASTICITY, blocks=4)


def _case(solver, name, problem=POISSON, blocks=BLOCKS, **given):
    chosen = {"ksp_type": "cg", "ksp_norm_type": "natural", "pc_type": "latin"}
    if solver == "ksp":
        chosen = {"ksp_type": "latin"}
    return Case(f"{solver.upper()} latin", name, lambda: square(problem, blocks=blocks, **given),
                options=chosen | {"ksp_rtol": ACCURACY / 100, "ksp_max_it": 500}, ranks=blocks**2)  # fmt: skip
