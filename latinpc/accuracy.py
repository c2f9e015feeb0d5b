"""How accurate the last solve was: estimates, bounds, and the digits that rounding leaves."""

from __future__ import annotations

from petsc4py import PETSc

from latinpc.library import _latin

__all__ = ["digits", "energy_bound", "estimated_error", "rounding_floor", "tension_error"]


def estimated_error(snes: PETSc.SNES) -> float:
    """Return the estimated relative error of the solution, in the norm of the stop; not collective.

    Parameters
    ----------
    snes : petsc4py.PETSc.SNES
        Of type latin, after a solve with ``-snes_latin_stop error``.

    Returns
    -------
    float
        0 with another stop.
    """
    return _latin.estimates(snes)[1]


def tension_error(snes: PETSc.SNES) -> float | None:
    """Return the estimated relative error of the tensions, l2 norm over all links; not collective.

    Parameters
    ----------
    snes : petsc4py.PETSc.SNES
        Of type latin, after a solve.

    Returns
    -------
    float or None
        None where it is not estimated: with the stops indicator, residual and reference, and in motions without
        rigid links.
    """
    error = _latin.tension_error(snes)
    return error if error >= 0.0 else None


def rounding_floor(snes: PETSc.SNES) -> float:
    """Return the smallest relative error that rounding allows on this structure, an estimate; not collective.

    Parameters
    ----------
    snes : petsc4py.PETSc.SNES
        Of type latin, after a solve with ``-snes_latin_stop error``.

    Returns
    -------
    float
        0 where it is not known.
    """
    return _latin.estimates(snes)[2]


def digits(snes: PETSc.SNES) -> dict[str, float]:
    """Return how far a solution is from equilibrium, and its sensitivity to rounding; collective.

    It costs the set-up of a PC latin and ten linear solves to four digits (PETSc prefix ``-latin_digits_``).

    Parameters
    ----------
    snes : petsc4py.PETSc.SNES
        Of any type, after a solve, with a `Structure` without rigid laws attached.

    Returns
    -------
    dict of float
        Changes of the free displacements, relative in the l2 norm: by the unbalanced forces as
        ``unbalance``; by the rounding of displacements, elongations and tensions as ``rounding``, the least error of
        any solver in this precision; by that of the coordinates as ``places``; by that of stiffnesses, initial
        elongations and loads as ``values``. The last three are root mean squares over random roundings.
    """
    return _latin.digits(snes)


def energy_bound(snes: PETSc.SNES) -> tuple[float, float]:
    """Return an upper bound of the error of a solution in the energy norm, for linear structures; collective.

    It costs the set-up of a PC latin and two linear solves.

    Parameters
    ----------
    snes : petsc4py.PETSc.SNES
        Of any type, after a solve, with a `Structure` of bars only attached.

    Returns
    -------
    bound : float
        Of the square root of the sum of k (e* - e)^2 over all links, e* being the true elongations.
    relative : float
        Of the same over that of e*; infinite while the error may be as large as the solution.
    """
    return _latin.energy_bound(snes)
