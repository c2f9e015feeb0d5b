"""Force densities: the nodes that are in equilibrium when tension over length of each link is given.

Per coordinate, D x = p with D = C^t Q C, C the incidence of links and nodes and Q the force densities
[H.-J. Schek, The force density method for form finding and computation of general networks, 1974, (9), (14)].
"""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from latinpc import errors, solvers
from latinpc.arrays import block
from latinpc.files.lines import connected
from latinpc.results.report import reason_name

PREFIX = "form_"
SUBSTRUCTURING = ("latin", "bddc", "nn")  # PCs that need the operators of the ranks: MATIS
ACCURACY = 1e-12  # relative residual of iterative solvers
LEFT = 1e-8  # relative residual above which a solution is refused
SINGULAR = (
    1e-13  # of the norm of the matrix: a least singular value that rounding makes; regular ones have been seen at 1e-9
)
NUDGE = 1e-14  # the same, added to the diagonal for that test
POWERS = 4  # steps of inverse iteration towards the least singular value
_NAMED = 5
CURE = f"leave out -{PREFIX}ksp_type and -{PREFIX}pc_type for a direct factor"


def equilibrium(nodes, links, fixed, density, load, comm):
    """Return the nodes in equilibrium with given force densities; collective.

    Parameters
    ----------
    nodes : (n, dim) array of float
        Coordinates (m), of which those that are fixed count.
    links : (m, 2) array of int
    fixed : (n, dim) array of bool
    density : (m,) array of float
        Tension over length (N/m), negative in struts.
    load : (n, dim) array of float
        In N.
    comm : petsc4py.PETSc.Comm

    Returns
    -------
    (n, dim) array of float
        The same on every rank.

    Raises
    ------
    ValueError
        On every rank: no link has a density, nodes are not connected with a support, densities of both signs make the
        matrix singular.
    RuntimeError
        Where the linear solver that options have chosen fails.
    """
    if not density.any():
        raise ValueError("all force densities are zero: give each link its tension over its length, in N/m")
    found = np.array(nodes, dtype=float)
    for held in np.unique(fixed, axis=1).T:  # coordinates with the same supports share a matrix
        axes = np.flatnonzero((fixed == held[:, None]).all(axis=0))
        _connected(links, held, density, axes)
        if not held.all():
            found[np.ix_(~held, axes)] = _solve(found, links, held, density, load, axes, comm)
    return found


def _connected(links, held, density, axes):
    """Refuse nodes that no chain of links with a density joins to a support."""
    a, b = links[density != 0.0].T
    supports = np.flatnonzero(held)
    first = np.full(len(supports), supports[0]) if supports.size else supports  # all supports are one
    label = connected(len(held), np.append(a, first), np.append(b, supports))
    lost = np.flatnonzero(label != label[supports[0]]) if supports.size else np.arange(len(held))
    if lost.size:
        noun, be = ("node", "is") if lost.size == 1 else ("nodes", "are")
        named = ", ".join(map(str, lost[:_NAMED])) + (f" and {lost.size - _NAMED} more" if lost.size > _NAMED else "")
        along = ", ".join("xyz"[axis] for axis in axes)
        said = "nothing is held" if not held.any() else f"{noun} {named} {be} not connected with a support"
        raise ValueError(f"{said} along {along}: fix nodes, or give links between them a force density")


def _solve(nodes, links, held, density, load, axes, comm):
    """Solve for the free nodes, one right-hand side for each of the axes; collective."""
    number = np.cumsum(~held) - 1
    number[held] = -1
    count, ends = int((~held).sum()), number[links]
    right = load[:, axes].copy()
    for this, other in ((0, 1), (1, 0)):  # what supports pull
        pulled = held[links[:, other]] & ~held[links[:, this]]
        pull = density[pulled, None] * nodes[np.ix_(links[pulled, other], axes)]
        np.add.at(right, links[pulled, this], pull)
    right = right[~held]
    ksp, D = _solver(ends, density, count, comm)
    try:
        if (density < 0.0).any():
            _regular(ksp, D, np.linalg.norm(density), np.flatnonzero(~held))
        return np.column_stack([_solved(ksp, np.linalg.norm(density), column) for column in right.T])
    except PETSc.Error as error:
        raise RuntimeError(f"form finding: {errors.error_message(error)}") from None
    finally:
        ksp.destroy()
        D.destroy()


def _solver(ends, density, count, comm):
    """Make D and the KSP of its options, a direct factor by default; collective."""
    chosen = PETSc.Options(PREFIX).getString("pc_type", "")
    D = (
        _unassembled(ends, density, count, comm)
        if chosen in SUBSTRUCTURING
        else assembled(*_entries(ends, density), count, comm)
    )
    D.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    ksp = PETSc.KSP().create(comm)
    ksp.setOptionsPrefix(PREFIX)
    ksp.setOperators(D)
    ksp.setType("preonly" if not chosen else "cg")
    ksp.setTolerances(rtol=ACCURACY)
    solvers.symmetric_factor(ksp.getPC())  # also where struts make D indefinite
    ksp.setFromOptions()
    return ksp, D


def _entries(ends, density):
    """Return rows, columns and values of D, several of one place."""
    a, b = ends.T
    rows, columns = np.concatenate([a, b, a, b]), np.concatenate([a, b, b, a])
    values = np.concatenate([density, density, -density, -density])
    inside = (rows >= 0) & (columns >= 0)
    return rows[inside], columns[inside], values[inside]


def _csr(rows, columns, values, first, last, width):
    """Return rows first to last as compressed sparse rows."""
    mine = (rows >= first) & (rows < last)
    key, where = np.unique((rows[mine] - first) * width + columns[mine], return_inverse=True)
    start = np.searchsorted(key, np.arange(last - first + 1) * width).astype(PETSc.IntType)
    return start, (key % width).astype(PETSc.IntType), np.bincount(where, values[mine], len(key))


def assembled(rows, columns, values, count, comm):
    """Make a square matrix as AIJ from its entries, several of one place: each rank has a block of rows; collective."""
    first, last = block(count, comm.rank, comm.size)
    csr = _csr(rows, columns, values, first, last, count)
    return PETSc.Mat().createAIJ(((last - first, count), (last - first, count)), csr=csr, comm=comm)


def _unassembled(ends, density, count, comm):
    """Make D as MATIS: each rank has a block of links, whose nodes it shares with others."""
    mine = np.arange(*block(len(ends), comm.rank, comm.size))
    rows, columns, values = _entries(ends[mine], density[mine])
    seen, local = np.unique(np.concatenate([rows, columns]), return_inverse=True)
    first, second = np.split(local, 2)
    csr = _csr(first, second, values, 0, len(seen), max(len(seen), 1))
    mapping = PETSc.LGMap().create(seen.astype(PETSc.IntType), comm=comm)
    own = -np.subtract(*block(count, comm.rank, comm.size))
    D = PETSc.Mat().createIS(((own, count), (own, count)), lgmapr=mapping, lgmapc=mapping, comm=comm)
    inner = PETSc.Mat().createAIJ((len(seen), len(seen)), csr=csr, comm=PETSc.COMM_SELF)
    D.setISLocalMat(inner)
    D.assemble()
    return D


def _solved(ksp, size, column):
    """Solve for one coordinate, given whole; return it whole; collective. The norm of D is about `size`."""
    D = ksp.getOperators()[0]
    x, b, r = D.createVecRight(), D.createVecLeft(), D.createVecLeft()
    b.setArray(column[slice(*b.getOwnershipRange())])
    _apply(ksp, b, x)
    D.mult(x, r)
    r.aypx(-1.0, b)
    whole, left, most = gathered(x), r.norm(), LEFT * max(b.norm(), size * x.norm())
    for vector in (x, b, r):
        vector.destroy()
    if not left <= most:
        raise RuntimeError(f"form finding: the linear solver leaves unbalanced forces of {left:.1e} N; {CURE}")
    return whole


def _apply(ksp, b, x):
    """Solve D x = b, or raise; collective."""
    ksp.solve(b, x)
    reason = ksp.getConvergedReason()
    if reason < 0:
        name = reason_name(PETSc.KSP.ConvergedReason, reason)
        raise RuntimeError(f"form finding: the linear solver ends with {name}; {CURE}")


def gathered(x):
    """Return a vector whole, on every rank; collective."""
    return np.concatenate(x.getComm().tompi4py().allgather(x.array.copy()))


def _regular(ksp, D, size, nodes):
    """Refuse densities of both signs that cancel: the least singular value by inverse iteration; collective."""
    shifted = D.copy()
    shifted.shift(NUDGE * size)  # no factor meets a pivot of zero
    ksp.setOperators(shifted)
    x, y = D.createVecs()
    start = np.random.default_rng(0).normal(size=len(nodes))
    x.setArray(start[slice(*x.getOwnershipRange())])
    for _ in range(POWERS):
        x.normalize()
        _apply(ksp, x, y)
        least = 1.0 / max(y.norm(), 1e-300)
        x, y = y, x
    shape = np.abs(gathered(x))
    ksp.setOperators(D)
    for thing in (x, y, shifted):
        thing.destroy()
    if np.isfinite(shape).all() and least > SINGULAR * size:
        return
    order = nodes[np.argsort(-np.nan_to_num(shape, nan=np.inf), kind="stable")[:_NAMED]]
    raise ValueError(
        "the force densities of struts and cables cancel, and many forms are in equilibrium or none (the matrix is"
        f" singular): change the densities of struts, or fix nodes, next to node{'s' if len(order) > 1 else ''}"
        f" {', '.join(map(str, sorted(order)))}"
    )
