"""The motion that nothing resists: where a structure is a mechanism, or slack links leave one."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from latinpc import solvers
from latinpc.laws import Law

from .mechanics import slack

SOFT = 1e-13  # of the largest diagonal of B^t B: what rounding leaves of a stiffness of zero
ROUNDS = 3  # of inverse iteration: by rounding, more turn a motion into others that nothing resists
STILL = 1e-6  # change of a motion between two rounds


def bearing(scene, tensions=None):
    """Return which links resist, (m,) of bool: all without tensions, else those that bear something."""
    if tensions is None:
        return np.ones(len(scene.links), bool)
    return ~slack(scene, tensions) & ((scene.law != Law.TANGENT) | (tensions != 0.0))


def free_motion(scene, load=None, bears=None):
    """Find displacements of the free components that change the length of no link, B u = 0.

    Not collective: whole arrays, one factorisation of B^t B on this rank. Of all such motions it is the one that the
    loads drive, by inverse iteration from them; where they drive none, some other.

    Parameters
    ----------
    scene : Scene or Structure
        Whose links do not turn (geometry "linear").
    load : (n, dim) array, optional
        In N, that of the scene when not given.
    bears : (m,) array of bool, optional
        Links that resist, all when not given.

    Returns
    -------
    (n, dim) array or None
        Its largest displacement is 1; None where each motion is resisted.
    """
    if getattr(scene, "geometry", "linear") != "linear":
        return None
    rows = np.flatnonzero(~scene.fixed.ravel())
    if not len(rows):
        return None
    stiffness = _stiffness(scene, rows, np.ones(len(scene.links), bool) if bears is None else bears)
    x, soft = stiffness.createVecRight(), SOFT * max(stiffness.getDiagonal().max()[1], 1.0)
    try:
        force = np.asarray(scene.load if load is None else load, dtype=float).ravel()[rows]
        noise = np.random.default_rng(0).standard_normal(len(rows))
        size = np.linalg.norm(force)
        x.setArray(
            noise / np.linalg.norm(noise) if size == 0.0 else force / size + 1e-3 * noise / np.linalg.norm(noise)
        )
        least, found = inverse_iteration(stiffness, x, soft, ROUNDS), x.getArray().copy()
        if not np.isfinite(found).all() or abs(least) > 10.0 * soft:
            return None
    finally:
        stiffness.destroy()
        x.destroy()
    motion = np.zeros(scene.fixed.size)
    motion[rows] = found
    motion = motion.reshape(scene.fixed.shape)
    return motion / np.linalg.norm(motion, axis=1).max()


def inverse_iteration(A, v, shift, rounds, B=None):
    """Find the least mu in A v = mu B v, without B in A v = mu v, by inverse iteration from v; collective.

    The shift is added to the diagonal of A: a mechanism has no stiffness at all.
    """
    if shift == 0.0:  # slack links have none either: all nodes move
        v.set(1.0)
        return 0.0
    ksp, shifted, b, w = PETSc.KSP().create(A.getComm()), A.copy(), v.duplicate(), v.duplicate()
    try:
        shifted.shift(shift)
        ksp.setOperators(shifted)
        ksp.setType("preonly")
        ksp.getPC().setType("lu")
        if solvers.has_package("mumps"):
            ksp.getPC().setFactorSolverType("mumps")
        for _ in range(rounds):
            v.normalize()
            v.copy(b) if B is None else B.mult(v, b)
            ksp.solve(b, w)
            w.normalize()
            v.axpy(-np.sign(v.dot(w)), w)
            still = v.norm() <= STILL
            w.copy(v)
            if still:
                break
        A.mult(v, w)
        v.copy(b) if B is None else B.mult(v, b)
        return w.dot(v) / b.dot(v)
    finally:
        for thing in (ksp, shifted, b, w):
            thing.destroy()


def _stiffness(scene, rows, bears):
    """Assemble B^t B of the links that resist on the free components, all stiffnesses 1."""
    dim, directions = scene.dim, scene.directions[bears]
    number = np.full(scene.fixed.size, -1, dtype=PETSc.IntType)
    number[rows] = np.arange(len(rows))
    ends = scene.links[bears]
    columns = number[(ends[:, :, None] * dim + np.arange(dim)).reshape(len(ends), 2 * dim)]
    values = np.concatenate([-directions, directions], axis=1)
    first, second = np.repeat(columns, 2 * dim, axis=1).ravel(), np.tile(columns, (1, 2 * dim)).ravel()
    products = np.einsum("ij,ik->ijk", values, values).ravel()
    free = (first >= 0) & (second >= 0)
    every = np.arange(len(rows))  # a component that no link reaches has a row as well
    keys = np.concatenate([first[free] * np.int64(len(rows)) + second[free], every * np.int64(len(rows)) + every])
    place, index = np.unique(keys, return_inverse=True)
    entries = np.bincount(index, np.append(products[free], np.zeros(len(rows))))
    starts = np.searchsorted(place, np.arange(len(rows) + 1) * np.int64(len(rows))).astype(PETSc.IntType)
    matrix = PETSc.Mat().createAIJ((len(rows), len(rows)), comm=PETSc.COMM_SELF)
    matrix.setPreallocationCSR((starts, (place % len(rows)).astype(PETSc.IntType), entries))
    matrix.assemble()
    return matrix
