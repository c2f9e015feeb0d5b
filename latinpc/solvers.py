"""Diagnostics of a SNES, KSP or PC of type latin: decomposition, history, inner solvers, subdomains, states.

All ranks of the solver call what is marked *collective*. Arrays are whole, in the caller's own numbering, the same on
every rank.
"""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from petsc4py import PETSc

from latinpc.arrays import Solver, slices_of
from latinpc.library import _latin
from latinpc.options import default_options

__all__ = [
    "coarse_ksp",
    "cost",
    "history",
    "load_state",
    "local_ksp",
    "macro_stiffness",
    "node_classes",
    "outer_ksp",
    "outer_snes",
    "pcshell_set_latin",
    "save_state",
    "statistics",
    "step_cause",
    "step_tensions",
    "subdomain_is",
    "subdomain_of_links",
    "subdomains",
    "tensions",
]


def statistics(solver: Solver) -> dict[str, Any]:
    """Return the size of the decomposition, as in Table 3; collective, after ``setUp``.

    Parameters
    ----------
    solver : petsc4py.PETSc.SNES, petsc4py.PETSc.KSP or petsc4py.PETSc.PC
        Of type latin.

    Returns
    -------
    dict
        ``subdomains``, ``strong_interfaces``, ``weak_interfaces``, ``strong_macro_dofs``, ``weak_dofs``,
        ``coarse_size``, ``coarse_levels``, ``local_macro_dofs``, ``low_energy_subdomains``, ``local_modes_max``,
        ``micro_sides``, ``state_size``, and the search direction (N/m) as ``direction_min``, ``direction_mean``,
        ``direction_max`` (of a matrix, its diagonal).
    """
    return dict(_latin.statistics(solver))


def cost(solver: Solver) -> dict[str, Any]:
    """Return what the decomposition costs, predicted and measured; collective, after ``setUp``.

    Parameters
    ----------
    solver : petsc4py.PETSc.SNES, petsc4py.PETSc.KSP or petsc4py.PETSc.PC
        Of type latin.

    Returns
    -------
    dict
        ``choice``, why there are so many subdomains; ``factor_operations`` and ``factor_bytes`` of the subdomains'
        factors, by their analysis, which a linear stage reads twice (0: another local solver was chosen);
        ``setup_seconds``, ``linear_stages`` since the set-up, and ``stage_seconds`` of one of them.
    """
    return dict(_latin.cost(solver))


def history(snes: PETSc.SNES) -> dict[str, np.ndarray]:
    """Return the measures of each iteration; not collective.

    Parameters
    ----------
    snes : petsc4py.PETSc.SNES
        Of type latin.

    Returns
    -------
    dict of (iterations,) arrays
        ``indicator``, ``error_l2``, ``error_energy``, ``estimate``; the errors are empty without a reference, the
        estimated error without ``-snes_latin_stop error``.
    """
    values = (*_latin.history(snes), _latin.estimates(snes)[0])
    return dict(zip(("indicator", "error_l2", "error_energy", "estimate"), values))


def path(snes: PETSc.SNES) -> dict[str, int | float | bool]:
    """Return how the last solve with large displacements went; not collective.

    Parameters
    ----------
    snes : petsc4py.PETSc.SNES
        Of type latin, of a structure of geometry ``"large"``.

    Returns
    -------
    dict
        ``renewals``, how often operators were made at displaced configurations; ``borne``, the part of the loads and
        prescribed displacements that the displacements are of: 1, or less where no stable equilibrium follows that
        of this part; ``branch``, whether a stable branch begins there: the structure buckles to one side or the
        other, and bears more.
    """
    renewals, borne, branch = _latin.path(snes)
    return {"renewals": renewals, "borne": borne, "branch": branch}


def unsupported_nodes(snes: PETSc.SNES) -> tuple[int, list[int]]:
    """Return the nodes that slack links no longer hold, after a solve without convergence; not collective.

    The loads move them without end or, where they are small, slowly to a support. With large displacements: those that
    move most in the mode by which the last stable equilibrium buckles, or snaps through.

    Parameters
    ----------
    snes : petsc4py.PETSc.SNES
        Of type latin, after a solve that has not converged.

    Returns
    -------
    count : int
        Number of nodes; 0 when the structure has an equilibrium or the cause is not known.
    nodes : list of int
        At most eight of them, in the caller's numbering.
    """
    return _latin.unsupported_nodes(snes)[:2]


def jammed_links(snes: PETSc.SNES) -> tuple[int, list[int]]:
    """Return rigid links with incompatible gaps, after a solve without convergence; not collective.

    Parameters
    ----------
    snes : petsc4py.PETSc.SNES
        Of type latin, after a solve that has not converged.

    Returns
    -------
    count : int
        Number of links; 0 when the gaps are compatible or the cause is not known.
    links : list of int
        At most eight of them, in the caller's numbering.
    """
    return _latin.jammed_links(snes)


def tensions(snes: PETSc.SNES) -> np.ndarray:
    """Return the tension of every link at the solution, of rigid ones as the solve has found it; collective.

    Parameters
    ----------
    snes : petsc4py.PETSc.SNES
        After a solve, with a `Structure` attached; of type latin where links are rigid.

    Returns
    -------
    (m,) array of float
        In the caller's numbering, the same on every rank (N), positive in tension.
    """
    slices = slices_of(snes)
    mine = np.zeros(len(slices.my_links), dtype=PETSc.RealType)
    _latin.tensions(snes, mine)
    return slices.gather_links(mine)


def step_cause(ts: PETSc.TS) -> str:
    """Say why the last time step has not converged, as far as it is known, and what to change; collective.

    Parameters
    ----------
    ts : petsc4py.PETSc.TS
        Of any type, with a `Structure` attached; after ``ts.setErrorIfStepFails(False)`` a step that fails ends the
        motion without an error.

    Returns
    -------
    str
        Sentences; links and nodes are numbered from 0. Empty if the step has converged.
    """
    return _latin.step_cause(ts)


def step_tensions(ts: PETSc.TS) -> np.ndarray:
    """Return the mean tension of every link during the last time step, impulse over length of the step; collective.

    Parameters
    ----------
    ts : petsc4py.PETSc.TS
        Of type latin, with a `Structure` attached. Before the first step the tensions are those at the start, where
        rigid links bear nothing.

    Returns
    -------
    (m,) array of float
        In the caller's numbering, the same on every rank (N), positive in tension.
    """
    slices = slices_of(ts)
    mine = np.zeros(len(slices.my_links), dtype=PETSc.RealType)
    _latin.step_tensions(ts, mine)
    return slices.gather_links(mine)


def subdomains(solver: Solver) -> tuple[int, int]:
    """Return the number of subdomains of this rank and the number of its first one; not collective.

    Parameters
    ----------
    solver : petsc4py.PETSc.SNES, petsc4py.PETSc.KSP or petsc4py.PETSc.PC
        Of type latin, set up.

    Returns
    -------
    count, first : int
    """
    return _latin.subdomains(solver)


def subdomain_is(solver: Solver, i: int) -> PETSc.IS:
    """Return the free degrees of freedom of a subdomain of this rank; not collective.

    Parameters
    ----------
    solver : petsc4py.PETSc.SNES, petsc4py.PETSc.KSP or petsc4py.PETSc.PC
        Of type latin, set up.
    i : int
        Number of the subdomain on this rank, from 0.

    Returns
    -------
    petsc4py.PETSc.IS
        Indices into a global vector of the DM.
    """
    return _latin.subdomain_is(solver, i)


def macro_stiffness(solver: Solver, i: int) -> PETSc.Mat:
    """Return the homogenised behaviour of a subdomain of this rank, equations (29) and (51); not collective.

    Parameters
    ----------
    solver : petsc4py.PETSc.SNES, petsc4py.PETSc.KSP or petsc4py.PETSc.PC
        Of type latin, set up.
    i : int
        Number of the subdomain on this rank, from 0.

    Returns
    -------
    petsc4py.PETSc.Mat
        Dense, symmetric, positive semidefinite (N/m).
    """
    return _latin.macro_stiffness(solver, i)


def subdomain_of_links(solver: Solver) -> np.ndarray:
    """Return the subdomain of every link; collective.

    Parameters
    ----------
    solver : petsc4py.PETSc.SNES, petsc4py.PETSc.KSP or petsc4py.PETSc.PC
        Of type latin, set up, with a `Structure` attached.

    Returns
    -------
    (m,) array of int
        In the caller's numbering, the same on every rank.
    """
    slices = slices_of(solver)
    mine = np.zeros(len(slices.my_links), dtype=PETSc.IntType)
    _latin.subdomain_of_links(solver, mine)
    return slices.gather_links(mine)


def node_classes(solver: Solver) -> np.ndarray:
    """Return where every node lies; collective.

    Parameters
    ----------
    solver : petsc4py.PETSc.SNES, petsc4py.PETSc.KSP or petsc4py.PETSc.PC
        Of type latin, set up, with a `Structure` attached.

    Returns
    -------
    (n,) array of int
        0 interior, 1 on a strong interface, 2 on a weak interface, 3 corner; in the caller's numbering, the
        same on every rank.
    """
    slices = slices_of(solver)
    mine = np.zeros(slices.node_end - slices.node_start, dtype=PETSc.IntType)
    _latin.node_classes(solver, mine)
    return slices.gather_nodes(mine)


def local_ksp(solver: Solver, i: int = 0) -> PETSc.KSP:
    """Return the KSP of subdomain ``i`` of this rank; not collective.

    Equal subdomains share one. Its matrix may have lost its values after another set-up, until the next call.
    There is none, and its ``handle`` is 0, where a dense inverse takes its place: in coarse problems of substructures.

    Parameters
    ----------
    solver : petsc4py.PETSc.SNES, petsc4py.PETSc.KSP or petsc4py.PETSc.PC
        Of type latin.
    i : int
        Number of the subdomain on this rank.

    Returns
    -------
    petsc4py.PETSc.KSP
        Options prefix ``latin_local_`` behind that of the solver.
    """
    return _latin.local_ksp(solver, i)


def coarse_ksp(solver: Solver) -> PETSc.KSP | None:
    """Return the KSP of the coarse problem; not collective.

    Parameters
    ----------
    solver : petsc4py.PETSc.SNES, petsc4py.PETSc.KSP or petsc4py.PETSc.PC
        Of type latin.

    Returns
    -------
    petsc4py.PETSc.KSP or None
        Options prefix ``latin_coarse_`` behind that of the solver; None where there is no interface. Of SNES latin on
        several ranks, with the solver ``latintree``, its matrix has given its values up: it has a size, and no product,
        so that monitors end in an error.
    """
    return _latin.coarse_ksp(solver)


def outer_ksp(ksp: PETSc.KSP) -> PETSc.KSP:
    """Return the KSP that solves for the interface data; not collective.

    Parameters
    ----------
    ksp : petsc4py.PETSc.KSP
        Of type latin.

    Returns
    -------
    petsc4py.PETSc.KSP
        ``richardson`` is the article's iteration, ``gmres`` its acceleration.
        After ``ksp.setUp()`` its operator acts on the interface data.
    """
    return _latin.outer_ksp(ksp)


def outer_snes(snes: PETSc.SNES) -> PETSc.SNES:
    """Return the SNES that iterates the fixed-point map; not collective.

    Parameters
    ----------
    snes : petsc4py.PETSc.SNES
        Of type latin.

    Returns
    -------
    petsc4py.PETSc.SNES
        ``nrichardson`` is the article's iteration, ``anderson`` its acceleration.
    """
    return _latin.outer_snes(snes)


def iterating(snes: PETSc.SNES) -> PETSc.SNES:
    """Return what iterates in a SNES: one of type latin itself would compute a residual for its monitors."""
    return outer_snes(snes) if snes.getType() == "latin" else snes


def save_state(
    solver: PETSc.SNES | PETSc.TS, path: str | os.PathLike, u: PETSc.Vec | None = None, note: bytes = b""
) -> None:
    """Save the state of a solver, from which another run continues bit by bit; collective.

    The file is of PETSc's binary format, or of HDF5 when its name ends in ``.h5`` or ``.hdf5``. It replaces
    an older one in one step, once it is complete on the disk: a killed run leaves one or the other.

    Parameters
    ----------
    solver : petsc4py.PETSc.SNES or petsc4py.PETSc.TS
        A SNES, of type latin or another one, after a solve; or a TS of type latin, after a step.
    path : str or path-like
    u : petsc4py.PETSc.Vec, optional
        Solution of the SNES; not for a TS, which has its own.
    note : bytes, optional
        Data of the caller, for instance the number of the load step; from rank 0.

    Raises
    ------
    petsc4py.PETSc.Error
        On every rank, when there is nothing to save, the file cannot be written, or it would be of HDF5 and PETSc has
        none.
    """
    _latin.save_state(solver, u, os.fsencode(path), bytes(note))


def load_state(solver: PETSc.SNES | PETSc.TS, path: str | os.PathLike, u: PETSc.Vec | None = None) -> bytes:
    """Read what `save_state` has written, for the same structure, options and number of ranks; collective.

    The next solve of a SNES latin that starts warm (``-snes_latin_warm_start``), or the next step of the TS, continues
    from there. Loads, initial elongations and prescribed displacements are the caller's.

    Parameters
    ----------
    solver : petsc4py.PETSc.SNES or petsc4py.PETSc.TS
        With its structure, after ``setFromOptions``.
    path : str or path-like
    u : petsc4py.PETSc.Vec, optional
        Solution of the SNES, overwritten.

    Returns
    -------
    bytes
        The note.

    Raises
    ------
    petsc4py.PETSc.Error
        On every rank, when the file is not whole, or is of another structure, partition, number of ranks or version.
    """
    return _latin.load_state(solver, u, os.fsencode(path))


def pcshell_set_latin(pc: PETSc.PC) -> None:
    """Make a PC of type shell apply the preconditioner latin; collective.

    Parameters
    ----------
    pc : petsc4py.PETSc.PC
        For a program that insists on ``PCSHELL``.
    """
    _latin.pcshell_set_latin(pc)


def has_package(name: str) -> bool:
    """Return whether this PETSc has an external package; not collective."""
    # earlier versions of PETSc name SuiteSparse as a whole, later ones its parts
    return PETSc.Sys.hasExternalPackage(name) or (name == "suitesparse" and PETSc.Sys.hasExternalPackage("cholmod"))


def symmetric_factor(pc: PETSc.PC) -> None:
    """Make a PC a direct factor of a symmetric matrix, indefinite ones among them, by default; not collective."""
    pc.setType("cholesky")
    if has_package("mumps"):
        pc.setFactorSolverType("mumps")


def negative_pivots(A: PETSc.Mat, prefix: str) -> int:
    """Count the negative eigenvalues of a symmetric, regular matrix, by the inertia of a factor; collective.

    Parameters
    ----------
    A : petsc4py.PETSc.Mat
    prefix : str
        Of the options of the factor, after which MUMPS takes ``mat_mumps_icntl_24 1``: it counts only so.

    Returns
    -------
    int
    """
    if not A.getSize()[0]:
        return 0  # not every factor of nothing has an inertia
    pc = PETSc.PC().create(A.getComm())
    pc.setOptionsPrefix(prefix)
    pc.setOperators(A)
    symmetric_factor(pc)
    with default_options({f"{prefix}mat_mumps_icntl_24": 1}):
        pc.setUp()
    count = pc.getFactorMatrix().getInertia()[0]
    pc.destroy()
    return count
