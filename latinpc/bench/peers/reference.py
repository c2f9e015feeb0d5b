"""The solution that errors are measured against, with an estimate of its own error."""

from __future__ import annotations

import time

import numpy as np
from petsc4py import PETSc

from latinpc.options import default_options
from latinpc.runs.reference import direct_solver, reference_solution
from latinpc.structure import Structure

MARGIN = 100.0  # a reference is that many times more accurate than what it judges
ROUNDING = 1e-14
MAX_STEPS = 100


def by_newton(scene, accuracy):
    """Solve by full Newton steps with a direct solver, the last ones of which refine the solution; collective.

    Parameters
    ----------
    scene : Scene
    accuracy : float
        What the reference will judge.

    Returns
    -------
    displacements : (n, dim) array
        Whole, on every rank (m).
    about : dict
        method, steps, seconds, and as accuracy the relative size of the last step.

    Raises
    ------
    RuntimeError
        When the last step is not `MARGIN` times smaller than the accuracy.
    """
    start = time.perf_counter()
    structure = Structure.from_scene(scene)
    solver = direct_solver(structure.comm)[0]
    ksp, J = _factor(structure, solver)
    u, r, step = structure.create_vec(), structure.create_vec(), structure.create_vec()
    sizes = []
    try:
        _newton(structure, ksp, J, u, r, step, sizes)
    except PETSc.Error:  # a singular tangent: its mechanisms have to be held
        sizes.append(np.inf)
    if not _enough(sizes, accuracy):
        u = reference_solution(structure)
        sizes = []
        _newton(structure, ksp, J, u, r, step, sizes)
    if not _enough(sizes, accuracy):
        raise RuntimeError(f"the last of {len(sizes)} Newton steps is still {sizes[-1]:.1e} of the displacement")
    about = {
        "method": f"newton-{solver}",
        "steps": len(sizes),
        "accuracy": float(sizes[-1]),
        "seconds": time.perf_counter() - start,
    }
    return structure.displacements(u), about


def _enough(sizes, accuracy):
    return bool(sizes) and sizes[-1] <= accuracy / MARGIN


def _factor(structure, solver):
    ksp = PETSc.KSP().create(structure.comm)
    ksp.setType("preonly")
    ksp.getPC().setType("cholesky")
    ksp.getPC().setFactorSolverType(solver)
    ksp.setErrorIfNotConverged(True)
    J = structure.dm.createMat()
    J.setOption(PETSc.Mat.Option.SPD, True)
    ksp.setOperators(J)
    return ksp, J


def _newton(structure, ksp, J, u, r, step, sizes):
    """Step until the steps no longer shrink: they have come down to rounding."""
    for _ in range(MAX_STEPS):
        structure.residual(u, r)
        structure.jacobian(u, J)
        ksp.setOperators(J)
        ksp.solve(r, step)
        u.axpy(-1.0, step)
        norm = u.norm()
        sizes.append(step.norm() / norm if norm > 0 else 0.0)
        settled = len(sizes) > 1 and sizes[-1] < 1e-8 and sizes[-1] > 0.1 * sizes[-2]
        if sizes[-1] <= ROUNDING or settled or not np.isfinite(sizes[-1]):
            return


def by_latin(scene, accuracy):
    """Solve by SNES latin, where Newton's method does not fit; collective.

    Its accuracy is that of the same solve stopped three times earlier. Parameters and results are those of `by_newton`.
    """
    start = time.perf_counter()
    structure = Structure.from_scene(scene)
    u, before = structure.create_vec(), structure.create_vec()
    wanted = min(accuracy / (10 * MARGIN), 1e-8)
    steps = 0
    for vector, tolerance in ((before, 3 * wanted), (u, wanted)):
        with default_options({"snes_type": "latin", "snes_stol": tolerance}):
            snes = structure.create_snes()
            snes.setFromOptions()
            snes.solve(None, vector)
        steps = snes.getIterationNumber()
        if snes.getConvergedReason() <= 0:
            raise RuntimeError(f"SNES latin does not get to {tolerance:.0e}")
        snes.destroy()
    difference = structure.errors(before, u)[0]
    if difference > accuracy / MARGIN:
        raise RuntimeError(f"SNES latin: two stops still differ by {difference:.1e}")
    about = {"method": "latin", "steps": steps, "accuracy": difference, "seconds": time.perf_counter() - start}
    return structure.displacements(u), about
