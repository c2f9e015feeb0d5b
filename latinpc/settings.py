"""Settings of a SNES, KSP or PC of type latin, as its options make them.

Every rank of the solver calls them with the same values. They count from the next set-up or solve on.
"""

from __future__ import annotations

import operator

from numpy.typing import ArrayLike
from petsc4py import PETSc

from latinpc.arrays import Solver, native, slices_of
from latinpc.library import _latin

__all__ = [
    "set_balance",
    "set_direction",
    "set_error",
    "set_largest_unbalance",
    "set_modes",
    "set_newton",
    "set_partition",
    "set_partitioner",
    "set_precision",
    "set_reference",
    "set_stop",
    "set_subdomains",
    "set_tension_error",
    "set_variant",
    "set_warm_start",
]

PARTITIONERS = ("auto", "metis", "parallel")
VARIANTS = ("none", "macro", "corner", "published", "primal", "auto")
MODES = ("affine", "rigid")
PRECISIONS = ("double", "single", "auto")
DIRECTIONS = ("scalar", "diagonal", "block", "schur", "auto")
STOPS = ("indicator", "residual", "reference", "error", "energy", "auto")
NEWTONS = ("auto", "never")
WARM_STARTS = ("none", "last", "extrapolate")


def _number(name, names, value):
    """Find a choice among those of an option."""
    if value not in names:
        raise ValueError(f"{name} must be one of {', '.join(names)}, not {value!r}")
    return names.index(value)


def set_partition(solver: Solver, subdomain: ArrayLike) -> None:
    """Set the subdomain of each link, in place of METIS; collective, before the set-up.

    Parameters
    ----------
    solver : petsc4py.PETSc.SNES, petsc4py.PETSc.KSP or petsc4py.PETSc.PC
        Of type latin, with a `Structure` attached. Of a TS, take ``ts.getSNES()``.
    subdomain : (m,) array_like of int
        The same on every rank, numbered from 0 without gaps; with a `LocalStructure` that of this rank's links.
    """
    _latin.set_partition(solver, native(slices_of(solver).partition("subdomain", subdomain), PETSc.IntType))


def set_partitioner(solver: Solver, partitioner: str) -> None:
    """Choose the partitioner, ``-snes_latin_partitioner``; logically collective, before the set-up.

    Parameters
    ----------
    solver : petsc4py.PETSc.SNES, petsc4py.PETSc.KSP or petsc4py.PETSc.PC
        Of type latin.
    partitioner : {"auto", "metis", "parallel"}
        METIS on one rank, which gathers all links; PT-Scotch or ParMETIS on all ranks; ``"auto"``: METIS up to eight
        ranks, and for a million links or less.
    """
    _latin.set_partitioner(solver, _number("partitioner", PARTITIONERS, partitioner))


def set_subdomains(solver: Solver, subdomains: int) -> None:
    """Choose the number of subdomains, ``-snes_latin_subdomains``; logically collective, before the set-up.

    Parameters
    ----------
    solver : petsc4py.PETSc.SNES, petsc4py.PETSc.KSP or petsc4py.PETSc.PC
        Of type latin.
    subdomains : int
        Of a structure, or into which the pieces of a MATIS are merged. 0: automatic.
    """
    try:
        count = operator.index(subdomains)
    except TypeError:
        raise ValueError(f"subdomains must be an integer, not {subdomains!r}") from None
    _latin.set_subdomains(solver, count)


def set_variant(solver: Solver, variant: str) -> None:
    """Choose the interface dofs in the coarse problem, ``-snes_latin_variant``; logically collective.

    Parameters
    ----------
    solver : petsc4py.PETSc.SNES, petsc4py.PETSc.KSP or petsc4py.PETSc.PC
        Of type latin.
    variant : str
        Of weak interfaces, section 4 of the article: ``"none"``, ``"macro"``, ``"corner"`` or ``"published"``; of all:
        ``"primal"``. ``"auto"``: ``"primal"``, or ``"corner"`` if most subdomains repeat others.
    """
    _latin.set_variant(solver, _number("variant", VARIANTS, variant))


def set_modes(solver: Solver, modes: str, local: float | None = None) -> None:
    """Choose the macro fields of strong interfaces, ``-snes_latin_modes``; logically collective, before the set-up.

    Parameters
    ----------
    solver : petsc4py.PETSc.SNES, petsc4py.PETSc.KSP or petsc4py.PETSc.PC
        Of type latin.
    modes : str
        ``"affine"`` or ``"rigid"``.
    local : float, optional
        Eigenvalue threshold of local low-energy fields in the macro space (``-snes_latin_modes_local``), 0: none.
        Default: automatic.
    """
    _latin.set_modes(solver, _number("modes", MODES, modes), PETSc.DEFAULT if local is None else local)


def set_direction(solver: Solver, direction: str, value: float = 0.0) -> None:
    """Choose the search direction of the interfaces, ``-snes_latin_direction``; logically collective.

    Parameters
    ----------
    solver : petsc4py.PETSc.SNES, petsc4py.PETSc.KSP or petsc4py.PETSc.PC
        Of type latin.
    direction : str
        ``"scalar"``, ``"diagonal"``, ``"block"``, ``"schur"`` or ``"auto"``.
    value : float, optional
        Scalar direction: stiffness d (N/m); others: fraction of the interface stiffness; 0: automatic. The fraction,
        or d relative to the stiffness of the interfaces, is between 1e-10 and 1e10 (single precision: 1e-4 and 1e4);
        others are refused, here or at the set-up.
    """
    _latin.set_direction(solver, _number("direction", DIRECTIONS, direction), value)


def set_precision(snes: PETSc.SNES, precision: str) -> None:
    """Choose the precision of factors, ``-snes_latin_precision``, which linear stages correct; logically collective.

    Parameters
    ----------
    snes : petsc4py.PETSc.SNES
        Of type latin, before the set-up.
    precision : str
        ``"double"``; ``"single"``: if accurate enough, tested at set-up; ``"auto"``: the same, for large factors only.
    """
    _latin.set_precision(snes, _number("precision", PRECISIONS, precision))


def set_stop(snes: PETSc.SNES, stop: str) -> None:
    """Set what must become small, as ``-snes_latin_stop``; logically collective.

    Parameters
    ----------
    snes : petsc4py.PETSc.SNES
        Of type latin.
    stop : {"indicator", "residual", "reference", "error", "energy", "auto"}
        A test given to ``snes.setConvergenceTest`` decides in its place.
    """
    _latin.set_stop(snes, _number("stop", STOPS, stop))


def set_error(snes: PETSc.SNES, error: float) -> None:
    """Set the estimated error at which ``-snes_latin_stop error`` or ``energy`` ends a solve; logically collective.

    Parameters
    ----------
    snes : petsc4py.PETSc.SNES
        Of type latin.
    error : float
        Relative error of the displacements, between 0 and 1.
    """
    _latin.set_estimated_error(snes, error)


def set_tension_error(snes: PETSc.SNES, error: float) -> None:
    """Set the error of the tensions at which a solve may end, as ``-snes_latin_tension_error``; logically collective.

    Parameters
    ----------
    snes : petsc4py.PETSc.SNES
        Of type latin.
    error : float
        Relative, l2 norm over all links; positive. 1e30: any. Without it, the error asked for of the displacements.
    """
    _latin.set_tension_error(snes, error)


def set_balance(snes: PETSc.SNES, balance: float) -> None:
    """Set the largest unbalanced forces at convergence, as ``-snes_latin_balance``; logically collective.

    Parameters
    ----------
    snes : petsc4py.PETSc.SNES
        Of type latin.
    balance : float
        Relative to the loads, l2 norms; without loads relative to the tensions at the nodes. Positive; 1e30: any.
    """
    _latin.set_balance(snes, balance)


def set_largest_unbalance(snes: PETSc.SNES, force: float) -> None:
    """Set the largest unbalanced force on a node, as ``-snes_latin_largest_unbalance``; logically collective.

    Parameters
    ----------
    snes : petsc4py.PETSc.SNES
        Of type latin, for statics, with the stop auto, error or energy.
    force : float
        In N; 0, the default: any.
    """
    _latin.set_largest_unbalance(snes, force)


def set_warm_start(snes: PETSc.SNES, warm: str) -> None:
    """Set the initial state of a solve, as ``-snes_latin_warm_start``; logically collective.

    Parameters
    ----------
    snes : petsc4py.PETSc.SNES
        Of type latin.
    warm : {"none", "last", "extrapolate"}
        From the displacements in the solution vector; from the state of the last solve; from those of the last two,
        extrapolated, for loads that change in equal steps.
    """
    _latin.set_warm_start(snes, _number("warm", WARM_STARTS, warm))


def set_newton(snes: PETSc.SNES, newton: str) -> None:
    """Set when Newton's method takes over from the iteration, as ``-snes_latin_newton``; logically collective.

    Parameters
    ----------
    snes : petsc4py.PETSc.SNES
        Of type latin.
    newton : {"auto", "never"}
        Where the iteration stalls or rounding ends it, and to prove an error; not at all.
    """
    _latin.set_newton(snes, _number("newton", NEWTONS, newton))


def set_reference(snes: PETSc.SNES, reference: PETSc.Vec | None) -> None:
    """Give the displacement that ``-snes_latin_stop reference`` and the history measure against; collective.

    Parameters
    ----------
    snes : petsc4py.PETSc.SNES
        Of type latin.
    reference : petsc4py.PETSc.Vec or None
        Displacement of the free degrees of freedom (m).
    """
    _latin.set_reference(snes, reference)
