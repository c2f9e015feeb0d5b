"""Where a path of equilibria ends: the loads that are borne, and how the structure moves on by itself."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING, Any

import numpy as np
from petsc4py import PETSc

from latinpc import solvers
from latinpc.errors import raise_cause
from latinpc.geometry import WHOLE
from latinpc.laws import RIGID, Law

from .mechanics import tensions_at
from .mechanism import inverse_iteration

if TYPE_CHECKING:
    from collections.abc import Iterator

    from latinpc.distributed import LocalStructure
    from latinpc.structure import Structure

    from .modes import Modes

__all__ = ["bearing", "borne", "branches", "moving", "slackening", "softest", "unstable"]

STEPS = 20  # of inverse iteration: at a limit point the least stiffness is far below the next
SHIFT = 1e-11  # of the mean diagonal
NAMED = 5  # links or nodes in a sentence
PART = 0.5  # of the largest displacement: nodes that move


def borne(snes: PETSc.SNES, structure: Structure) -> float | None:
    """Return the part of the loads that the displacements of a solve bear; of parts collective.

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
    if structure.geometry != "large" or snes.getType() != "latin":
        return None
    if not structure.over_ranks.largest((structure.law != Law.CABLE).any()):
        return None
    return solvers.path(snes)["borne"]


def branches(snes: PETSc.SNES, factor: float | None) -> bool:
    """Whether a stable branch begins where a path ends, with a factor of `borne`; not collective."""
    return factor is not None and factor < 1.0 and solvers.path(snes)["branch"]


@contextlib.contextmanager
def bearing(snes: PETSc.SNES, structure: Structure | LocalStructure, factor: float | None) -> Iterator[bool]:
    """Give a structure the part of its loads and prescribed displacements that a solve has ended with; collective.

    Parameters
    ----------
    snes : petsc4py.PETSc.SNES
        After its solve.
    structure : Structure or latinpc.distributed.LocalStructure
        Has its own again afterwards.
    factor : float or None
        Of `borne`.

    Yields
    ------
    bool
        Whether that is less than the whole.
    """
    ends = factor is not None and factor < 1.0 and snes.getConvergedReason() < 0
    load, prescribed = structure.load, structure.prescribed
    if ends:
        structure.set_load(factor * load)
        structure.set_prescribed(factor * prescribed)
    try:
        yield ends
    finally:
        if ends:
            structure.set_load(load)
            structure.set_prescribed(prescribed)


def softest(structure: Structure, u: PETSc.Vec, tensions: np.ndarray, drawn: bool) -> tuple[np.ndarray | None, str]:
    """Return the displacements by which an equilibrium buckles, or those that move a structure as drawn; collective.

    Of parts, each has those of its nodes.

    Links that pull resist being turned, links in compression drive it: K = E + G+ - G-, E the stiffness of the laws.
    The mode has the least mu in K x = mu M x, where M = E + G+ + G-: it is 1 of soft parts that nothing presses, as
    guys are, and 0 of what buckles, whatever the stiffness of either.

    Parameters
    ----------
    structure : Structure
        Of geometry "large".
    u : petsc4py.PETSc.Vec
        Displacements (m).
    tensions : (m,) array of float
        There (N).
    drawn : bool
        K may be singular or indefinite: u is no stable equilibrium.

    Returns
    -------
    mode : (n, dim) array or None
        The largest displacement is 1; None where a stiffness cannot be factored.
    kind : {"mechanism", "unstable", "soft"}
        Neither E nor G+ nor G- resists the mode; K does not, mu < 0; all do.
    """
    K, M, both = (structure.dm.createMat() for _ in range(3))
    v, kind = structure.create_vec(), "soft"
    random = PETSc.Random().create(structure.comm)
    random.setFromOptions()
    v.setRandom(random)
    try:
        structure.jacobian(u, K)
        structure.geometric_stiffness(u, np.abs(tensions) - tensions, M)
        M.axpy(1.0, K, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        if drawn:
            if _least(M, v) <= SHIFT * _mean(M):
                kind = "mechanism"
            else:
                M.copy(both, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)  # PETSc 3.26 loses memory with another
                both.axpy(1.0, K, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
                v.setRandom(random)
                kind = "unstable" if _least(both, v, M) < 1.0 else kind  # K + M has mu + 1, never negative
        if kind == "soft":
            _least(K, v, M)
        mode = structure.displacements(v) - structure.prescribed
        size = structure.over_ranks.largest(np.linalg.norm(mode, axis=1).max(initial=0.0))
        return (mode / size if np.isfinite(size) and size > 0.0 else None), kind
    except PETSc.Error as error:
        raise_cause(error)
        return None, kind
    finally:
        for thing in (K, M, both, v, random):
            thing.destroy()


def _least(A, v, B=None):
    """Find the least mu in A v = mu B v from v, and v, where A may be singular; collective."""
    return inverse_iteration(A, v, SHIFT * _mean(A), STEPS, B)


def _mean(A):
    """Return the mean of a diagonal; collective."""
    diagonal = A.getDiagonal()
    mean = diagonal.sum() / max(diagonal.getSize(), 1)
    diagonal.destroy()
    return mean


def unstable(structure: Structure, u: PETSc.Vec, slack: np.ndarray) -> list[str]:
    """Return a sentence where an equilibrium of geometry prestress is unstable; collective.

    What is drawn is stable, else it would be refused. Where links in compression drive it and links that stiffened it
    are slack, or on a flat part of a user's law, the tangent stiffness may have negative eigenvalues: its factors tell
    how many.

    Parameters
    ----------
    structure : Structure
    u : petsc4py.PETSc.Vec
        Displacements (m).
    slack : (m,) array of bool
        The links that are slack there.
    """
    drawn = tensions_at(structure, np.zeros(len(structure.links)))
    softens = slack | (structure.law >= len(Law))
    some = np.array([np.isin(structure.law, RIGID).any(), softens.any(), (drawn < 0.0).any()])
    rigid, softens, pressed = structure.over_ranks.largest(some)
    mumps = solvers.has_package("mumps")
    if structure.geometry != "prestress" or rigid or not (softens and pressed):
        return []
    if structure.comm.size > 1 and not mumps:
        return []
    K, pc = structure.dm.createMat(), PETSc.PC().create(structure.comm)
    structure.jacobian(u, K)
    K.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    K.setOption(PETSc.Mat.Option.SPD, False)
    pc.setOperators(K)
    pc.setType("cholesky")
    pc.setFactorSolverType("mumps" if mumps else "petsc")
    pc.setFactorSetUpSolverType()
    if mumps:
        pc.getFactorMatrix().setMumpsIcntl(13, 1)  # counts pivots also where ranks share the last front,
        pc.getFactorMatrix().setMumpsIcntl(24, 1)  # and those that are zero apart
    pc.setUp()
    negative, *_ = pc.getFactorMatrix().getInertia()
    pc.destroy()
    K.destroy()
    cure = "take -snes_latin_geometry large"
    return (
        [f"this equilibrium is unstable, as links that slacken or yield no longer stiffen it: {cure}"]
        if negative
        else []
    )


def moving(mode: np.ndarray, over: Any = WHOLE) -> np.ndarray:
    """Return the nodes that a mode moves most, those that it moves furthest first, alike ones in their order.

    Of parts collective: more of them than a sentence names, `over` the ranks.
    """
    size = np.linalg.norm(mode, axis=1)
    size = (size / (over.largest(size.max(initial=0.0)) or 1.0)).round(6)
    far = np.flatnonzero(size >= PART)
    return over.largest_first(far, size[far], NAMED + 1)


def slackening(found: Modes, rates: np.ndarray, base: float) -> list[str]:
    """Return a sentence on the links that are the first to slacken, if they do before the least factor.

    Parameters
    ----------
    found : Modes
        Of buckling.
    rates : (m,) array
        By how much all of the loads once more change the tensions (N).
    base : float
        The factor at the state.
    """
    law, tensions = found.structure.law, found.tensions
    pulled, pushed = (law == Law.CABLE) & (tensions > 0.0), (law == Law.COMPRESSION_ONLY) & (tensions < 0.0)
    loses = np.flatnonzero((pulled & (rates < 0.0)) | (pushed & (rates > 0.0)))
    if not (loses.size and found.values.size):
        return []
    factors = base - tensions[loses] / rates[loses]
    least = factors.min()
    if least >= found.values[0]:
        return []
    first = loses[factors - least <= 1e-3 * abs(least - base)]  # by symmetry at once
    named = found.structure.some_links(first[:NAMED], first.size > NAMED)
    return [
        f"the loads slacken {named} at a factor of about {least:.3g}, below the least one: factors hold while"
        " links that are taut stay so, and the structure may buckle there; solve with growing loads"
    ]
