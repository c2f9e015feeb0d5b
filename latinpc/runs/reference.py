"""Solve by Newton's method with a direct solver: what errors are measured against."""

from __future__ import annotations

import contextlib

from petsc4py import PETSc

from latinpc.options import default_options
from latinpc.solvers import has_package

REFERENCE_ACCURACY = 1e-9  # relative residual above which a reference is refused
REFERENCE_STEP = 1e-10  # relative full step that proves one whose residual is rounding of long chains of forces


def direct_solver(comm):
    """Return the Cholesky factorisation that this PETSc has for that many ranks; not collective.

    Returns
    -------
    (str, str or None)
        Its name for ``-pc_factor_mat_solver_type``, and a notice when it is second best.
    """
    wanted, package = ("cholmod", "suitesparse") if comm.size == 1 else ("mumps", "mumps")
    if has_package(package):
        return wanted, None
    if has_package("mumps"):
        return "mumps", "this PETSc has no CHOLMOD: MUMPS factors the reference"
    return "petsc", "this PETSc has neither CHOLMOD nor MUMPS: its own Cholesky factors the reference"


def reference_solution(structure):
    """Solve the structure by Newton's method with a direct solver, to rounding; collective.

    The energy is convex and its gradient piecewise linear, so full Newton steps end in a few iterations as
    a rule. Where slack cables leave a mechanism the tangent stiffness is singular: then it is shifted, which
    makes proximal steps, and if they still go astray they are damped along the energy's slope. Options are
    read with the prefix ``reference_``.

    Parameters
    ----------
    structure : Structure

    Returns
    -------
    Vec

    Raises
    ------
    RuntimeError
        On every rank, when no variant reaches a relative residual of 1e-9, or a full step of 1e-10.
    """
    u, r, best = structure.create_vec(), structure.create_vec(), None
    structure.residual(u, r)
    initial = r.norm()
    if initial == 0:
        return u
    for search, shift in (("none", 0.0), ("none", 1e-9), ("cp", 1e-8), ("cp", 1e-6)):
        u.set(0.0)
        proved = False
        with contextlib.suppress(PETSc.Error):  # a singular factor: the next variant shifts it
            proved = _newton(structure, u, search, shift) and not shift
        structure.residual(u, r)
        residual = r.norm() / initial
        if proved or residual <= REFERENCE_ACCURACY:
            return u
        best = residual if best is None or residual < best else best
    raise RuntimeError(
        f"no reference: Newton's method stops at a relative residual of {best:.1e}; is the structure held"
        " when its slack cables are taken away?"
    )


def _newton(structure, u, search, shift):
    """Return whether it ends with a step that is small enough."""
    comm = structure.comm
    snes = PETSc.SNES().create(comm)
    try:
        structure.attach(snes)
        snes.setOptionsPrefix("reference_")
        snes.setType("newtonls")
        # an absolute floor at rounding; the step decides when the residual has reached it
        stol, max_it = (1e-14, 400) if shift else (REFERENCE_STEP, 60)
        snes.setTolerances(rtol=1e-12, atol=1e-50, stol=stol, max_it=max_it)
        ksp = snes.getKSP()
        ksp.setType("preonly")
        ksp.getPC().setType("cholesky")
        package = direct_solver(comm)[0]
        ksp.getPC().setFactorSolverType(package)
        if package == "cholmod":  # its own ordering fills structures of a hundred thousand links too much
            ksp.getPC().setFactorOrdering("nd")
        if shift:
            _shift(structure, snes, shift)
        # a step that makes links slack may raise the residual by orders before the next ones end it
        defaults = {"reference_snes_linesearch_type": search, "reference_snes_divergence_tolerance": -1}
        with default_options(defaults):
            snes.setFromOptions()
        snes.solve(None, u)
        return snes.getConvergedReason() == PETSc.SNES.ConvergedReason.CONVERGED_SNORM_RELATIVE
    finally:
        snes.destroy()


def _shift(structure, snes, fraction):
    """Add that fraction of the mean diagonal to the tangent: mechanisms of slack cables get a little stiffness."""
    matrix = structure.dm.createMat()
    matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)

    def jacobian(snes, u, J, P):
        structure.jacobian(u, P)
        diagonal = P.getDiagonal()
        P.shift(fraction * diagonal.sum() / max(diagonal.getSize(), 1))

    snes.setJacobian(jacobian, matrix, matrix)
