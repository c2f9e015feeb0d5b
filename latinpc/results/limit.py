"""Where a path of equilibria ends: the loads that are borne, and how the structure moves on by itself."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING

import numpy as np
from petsc4py import PETSc

from latinpc import solvers
from latinpc.laws import Law

if TYPE_CHECKING:
    from latinpc.structure import Structure

__all__ = ["borne", "moving", "softest"]

STEPS = 20  # of inverse iteration: at a limit point the least stiffness is far below the next
SHIFT = 1e-11  # of the mean diagonal
STILL = 1e-6  # change of the motion between two of them
PART = 0.5  # of the largest displacement: nodes that move


def borne(snes: PETSc.SNES, structure: Structure) -> float | None:
    """Return the part of the loads that the displacements of a solve bear; not collective.

    Parameters
    ----------
    snes : petsc4py.PETSc.SNES
        After its solve.
    structure : Structure

    Returns
    -------
    float or None
        None where displacements are not large, where there are cables alone, which have no limit point, or where the
        solver is another.
    """
    if structure.geometry != "large" or snes.getType() != "latin" or (structure.law == Law.CABLE).all():
        return None
    return solvers.path(snes)["borne"]


def softest(structure: Structure, u: PETSc.Vec) -> np.ndarray | None:
    """Return the displacements that the tangent stiffness resists least, by inverse iteration; collective.

    Parameters
    ----------
    structure : Structure
    u : petsc4py.PETSc.Vec
        Displacements (m).

    Returns
    -------
    (n, dim) array or None
        The largest one is 1 long; None where the tangent stiffness cannot be factored.
    """
    J, ksp, v = structure.dm.createMat(), PETSc.KSP().create(structure.comm), structure.create_vec()
    w, random = v.duplicate(), PETSc.Random().create(structure.comm)
    random.setFromOptions()
    v.setRandom(random)
    with contextlib.suppress(PETSc.Error):
        structure.jacobian(u, J)
        diagonal = J.getDiagonal()
        J.shift(SHIFT * diagonal.sum() / max(diagonal.getSize(), 1))  # a mechanism has no stiffness at all
        ksp.setOperators(J)
        ksp.setType("preonly")
        ksp.getPC().setType("lu")
        if solvers.has_package("mumps"):
            ksp.getPC().setFactorSolverType("mumps")
        for _ in range(STEPS):
            v.normalize()
            ksp.solve(v, w)
            w.normalize()
            v.axpy(-np.sign(v.dot(w)), w)
            still = v.norm() <= STILL
            w.copy(v)
            if still:
                break
        mode = structure.displacements(v) - structure.prescribed
        size = np.linalg.norm(mode, axis=1).max(initial=0.0)
        return mode / size if np.isfinite(size) and size > 0.0 else None
    return None


def moving(mode: np.ndarray) -> np.ndarray:
    """Return the nodes that a mode moves most, those that it moves furthest first."""
    size = np.linalg.norm(mode, axis=1)
    return np.argsort(-size, kind="stable")[: np.count_nonzero(size >= PART * size.max())]
