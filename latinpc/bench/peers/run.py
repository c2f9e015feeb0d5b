"""One solve of a scene by one method, timed from its arrays.

`solve` is what the processes of `latinpc compare` and `latinpc tradeoff` call; `calibrate` finds the stop that each
method needs to reach an accuracy, by comparing every iterate with a reference.
"""

from __future__ import annotations

import contextlib
import ctypes
import dataclasses
import gc
import time
from dataclasses import dataclass, field

import numpy as np
from petsc4py import PETSc

import latinpc
from latinpc.options import default_options
from latinpc.results.mechanics import errors
from latinpc.results.report import snes_reason
from latinpc.structure import Structure

from . import METHODS, linear

#: Tolerances of the interior point methods, tried in this order: they have no iterates to look at.
QP_TOLERANCES = tuple(10.0**-k for k in range(3, 13))
NOT_FINITE = -4  # SNES_DIVERGED_FUNCTION_NANORINF; its name in Python changes with PETSc 3.25
BELOW = 0.3  # a calibration goes on until the error is that much below the smallest accuracy


@dataclass
class Outcome:
    """What a solve gave; times in seconds."""

    displacements: np.ndarray  #: (n, dim), whole, on every rank
    setup_seconds: float
    solve_seconds: float
    cpu_seconds: float  #: of both; much below their sum on a busy machine
    peak_memory_bytes: int
    iterations: int
    linear_iterations: int | None
    converged: bool
    reason: str
    history: list = field(default_factory=list)  #: of (measure, error), when a reference was given


def peak_memory():
    """Return the largest memory that this process has held (bytes).

    Linux keeps it with the program that runs; ``ru_maxrss`` would count what the parent held when it started us.
    """
    try:
        with open("/proc/self/status") as file:
            for line in file:
                if line.startswith("VmHWM"):
                    return int(line.split()[1]) * 1024
    except OSError:
        pass
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def forget_peak():
    """Give freed memory back to the system and start `peak_memory` afresh, where Linux allows it; collective.

    petsc4py keeps the objects that Python has dropped until the ranks clear them together, and what several
    solves leave scattered in the heap would count as memory of the last one.
    """
    gc.collect()
    if hasattr(PETSc, "garbage_cleanup"):
        PETSc.garbage_cleanup()
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)
    with contextlib.suppress(OSError), open("/proc/self/clear_refs", "w") as file:
        file.write("5")


def solve(name, scene, tolerance, options=None, comm=None, reference=None, accuracy=None):
    """Solve a scene; collective.

    Parameters
    ----------
    name : str
        One of `METHODS`.
    scene : Scene
    tolerance : float or None
        Stop: of the indicator (latin), of the residual over the first one (Newton), of the program (piqp,
        clarabel), of the norm that a KSP watches. None with an accuracy. A stop of latin is one of its own iterates:
        Newton's method does not take over.
    options : dict, optional
        More PETSc options, which replace those of the method.
    comm : communicator, optional
    reference : (n, dim) array, optional
        Makes the solve record its errors; its times then mean nothing.
    accuracy : float, optional
        Without a tolerance, the error at which to stop: against the reference, or as latin estimates it.

    Returns
    -------
    Outcome
    """
    method = METHODS[name]
    if method.kind == "qp":
        return _solve_program(name, scene, tolerance)
    settings = {**method.options, **(options or {})}
    if settings.get("pc_factor_mat_solver_type") == "cholmod" and PETSc.COMM_WORLD.size > 1:
        raise RuntimeError("CHOLMOD factors on one rank only")
    if method.kind == "latin" and tolerance is None and reference is None:
        settings |= {"snes_latin_error": accuracy}
    elif method.kind == "latin":
        settings = {"snes_latin_newton": "never"} | settings
        settings |= {"snes_stol": tolerance} if tolerance else {"snes_latin_stop": "reference", "snes_stol": accuracy}
    if method.kind == "linear":
        with default_options(settings):
            found = linear.solve(method, scene, tolerance, comm, reference, _tell_rigid_modes)
        memory = PETSc.COMM_WORLD.tompi4py().allreduce(peak_memory())
        return Outcome(**found, peak_memory_bytes=memory, linear_iterations=found["iterations"])
    with default_options(settings):
        return _solve_snes(method, scene, tolerance, comm, reference, accuracy)


def _solve_program(name, scene, tolerance):
    from .qp import SOLVERS

    cpu, start = time.process_time(), time.perf_counter()
    solver = SOLVERS[name](scene, tolerance)
    middle = time.perf_counter()
    x, solved, iterations, reason = solver.solve()
    end, cpu = time.perf_counter(), time.process_time() - cpu
    return Outcome(
        displacements=solver.program.displacements(scene, x),
        setup_seconds=middle - start,
        solve_seconds=end - middle,
        cpu_seconds=cpu,
        peak_memory_bytes=peak_memory(),
        iterations=int(iterations),
        linear_iterations=None,
        converged=bool(solved),
        reason=reason,
    )


def _solve_snes(method, scene, tolerance, comm, reference, accuracy):
    history, target, barrier = [], None, PETSc.COMM_WORLD.tompi4py().barrier
    barrier()
    cpu, start = time.process_time(), time.perf_counter()
    if method.whole:
        scene = dataclasses.replace(scene, subdomain=None)
    structure = Structure.from_scene(scene, comm)
    structure.dm.setMatType(method.matrix)
    snes = structure.create_snes()
    snes.setFromOptions()
    pc = snes.getKSP().getPC()
    if method.kind == "newton":
        if pc.getType() == "latin":
            structure.attach(pc)
        snes.setConvergenceTest(_stop(structure, scene, tolerance, reference, accuracy, history))
    elif reference is not None:
        target = structure.create_vec()
        structure.set_displacements(reference, target)
        latinpc.set_reference(snes, target)
    snes.setUp()
    if method.rigid:
        _tell_rigid_modes(structure, scene, snes.getJacobian()[1])
    u = structure.create_vec()
    barrier()
    middle = time.perf_counter()
    snes.solve(None, u)
    barrier()
    end, cpu = time.perf_counter(), time.process_time() - cpu
    memory = PETSc.COMM_WORLD.tompi4py().allreduce(peak_memory())
    if method.kind == "latin" and reference is not None:
        past = latinpc.history(snes)
        history = [(float(a), float(b)) for a, b in zip(past["indicator"], past["error_l2"])]
    outcome = Outcome(
        displacements=structure.displacements(u),
        setup_seconds=middle - start,
        solve_seconds=end - middle,
        cpu_seconds=cpu,
        peak_memory_bytes=memory,
        iterations=snes.getIterationNumber(),
        linear_iterations=snes.getLinearSolveIterations() if method.kind == "newton" else None,
        converged=snes.getConvergedReason() > 0,
        reason=snes_reason(snes),
        history=history,
    )
    snes.setConvergenceTest(None)
    for held in (snes, u, target):  # before the structure, whose DM they hold
        if held is not None:
            held.destroy()
    return outcome


def _stop(structure, scene, tolerance, reference, accuracy, history):
    """Return the stop of Newton's method: on the residual over the first one, which may well be above 1.

    PETSc's own test refuses such tolerances, and a step that makes links slack raises the residual by orders
    while it lowers the error.
    """
    first = []

    def test(snes, iteration, norms):
        norm = norms[2]
        if not np.isfinite(norm):
            return NOT_FINITE
        if iteration == 0:
            first[:] = [norm or 1.0]
            return None
        ratio = norm / first[0]
        if reference is not None:
            error = errors(scene, structure.displacements(snes.getSolution()), reference)[0]
            history.append((ratio, error))
            if accuracy is not None and error <= accuracy:
                return PETSc.SNES.ConvergedReason.CONVERGED_FNORM_RELATIVE
        if tolerance is not None and ratio <= tolerance:
            return PETSc.SNES.ConvergedReason.CONVERGED_FNORM_RELATIVE
        if iteration >= snes.getTolerances()[3]:
            return PETSc.SNES.ConvergedReason.DIVERGED_MAX_IT
        return None

    return test


def _tell_rigid_modes(structure, scene, matrix):
    """Give the matrix its near null space: translations and rotations."""
    centred = scene.nodes - scene.nodes.mean(axis=0)
    dim = centred.shape[1]
    modes = []
    for axis in range(dim):
        mode = np.zeros_like(centred)
        mode[:, axis] = 1.0
        modes.append(mode)
    for a in range(dim):
        for b in range(a + 1, dim):
            mode = np.zeros_like(centred)
            mode[:, a], mode[:, b] = -centred[:, b], centred[:, a]
            modes.append(mode)
    vectors = []
    for mode in modes:
        vectors.append(structure.create_vec())
        structure.set_displacements(mode, vectors[-1])
    for i, vector in enumerate(vectors):  # orthonormal, as PETSc demands
        for _ in range(2):
            for other in vectors[:i]:
                vector.axpy(-vector.dot(other), other)
        vector.normalize()
    matrix.setNearNullSpace(PETSc.NullSpace().create(vectors=vectors, comm=matrix.comm))


# ---- the stop that reaches an accuracy -------------------------------------------------------


def calibrate(name, scene, accuracies, reference, options=None, comm=None):
    """Find, for each accuracy, the loosest tolerance from which the error stays below; collective.

    Parameters
    ----------
    name : str
        One of `METHODS`.
    scene : Scene
    accuracies : sequence of float
        Wanted relative l2 errors.
    reference : (n, dim) array
    options, comm
        As for `solve`.

    Returns
    -------
    list of (float or None)
        None where the method does not get so far.
    """
    if METHODS[name].kind == "qp":
        return _calibrate_program(name, scene, accuracies, reference)
    outcome = solve(name, scene, None, options, comm, reference, BELOW * min(accuracies))
    return [loosest(outcome.history, accuracy) for accuracy in accuracies]


def loosest(history, accuracy):
    """Return the tolerance that stops at the first iterate below an accuracy, or None.

    The measure need not fall at every iteration: the iterate must be the first with a measure so small.

    Examples
    --------
    >>> round(loosest([(1.0, 1e-1), (0.5, 2e-2), (0.6, 1e-3), (0.1, 1e-4)], 1e-2), 2)
    0.22
    """
    lowest = np.inf
    for measure, error in history:
        if measure < lowest:
            if error <= accuracy:  # half-way in size, so that rounding moves no stop
                return float(np.sqrt(measure * min(lowest, 1e4 * measure))) if measure > 0 else 1e-300
            lowest = measure
    return None


def _calibrate_program(name, scene, accuracies, reference):
    found, position = [None] * len(accuracies), 0
    order = np.argsort(accuracies)[::-1]
    for tolerance in QP_TOLERANCES:
        outcome = solve(name, scene, tolerance)
        error = errors(scene, outcome.displacements, reference)[0]
        while position < len(order) and error <= accuracies[order[position]]:
            found[order[position]] = tolerance
            position += 1
        if position == len(order) or not outcome.converged:
            break
    return found
