"""One solve of a structure of bars by a KSP, timed from its arrays: what `run.solve` calls for linear methods."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
from petsc4py import PETSc

from latinpc.laws import Law
from latinpc.results.mechanics import errors
from latinpc.results.report import reason_name
from latinpc.structure import Structure

LEAST = 1e-13  # relative norm at which a calibration ends


def solve(method, scene, tolerance, comm, reference, near_null_space):
    """Solve K u = F; collective, with the options of the method set.

    Parameters
    ----------
    method : Method
    scene : Scene
        Of bars alone.
    tolerance : float or None
        Of the norm that the KSP watches, relative to the first; None goes to the end.
    comm : communicator or None
    reference : (n, dim) array or None
        Makes the solve record its errors; its times then mean nothing.
    near_null_space : callable
        Called with links, scene and matrix for methods that need the rigid modes.

    Returns
    -------
    dict
        displacements, setup_seconds, solve_seconds, cpu_seconds, iterations, converged, reason, history.
    """
    if (scene.law != Law.BAR).any():
        raise ValueError("the scene has links that are no bars: linear methods solve structures of bars alone")
    barrier, history = PETSc.COMM_WORLD.tompi4py().barrier, []
    if method.matrix == "is" and scene.subdomain is not None:  # so that those of a rank lie together
        scene = _sorted(scene)
    barrier()
    cpu, start = time.process_time(), time.perf_counter()
    structure = Structure.from_scene(scene, comm)
    structure.dm.setMatType(method.matrix)
    matrix, u, b = structure.dm.createMat(), structure.create_vec(), structure.create_vec()
    structure.jacobian(u, matrix)
    structure.residual(u, b)
    b.scale(-1.0)
    matrix.setOption(PETSc.Mat.Option.SPD, True)
    if method.rigid:
        near_null_space(structure, scene, matrix)
    ksp = PETSc.KSP().create(matrix.comm)
    ksp.setOperators(matrix)
    ksp.setTolerances(rtol=min(tolerance or LEAST, 0.9), max_it=1000)
    ksp.setFromOptions()
    if reference is not None:
        ksp.setMonitor(_watch(structure, scene, reference, history))
    ksp.setUp()
    barrier()
    middle = time.perf_counter()
    ksp.solve(b, u)
    barrier()
    end, cpu = time.perf_counter(), time.process_time() - cpu
    found = {
        "displacements": structure.displacements(u),
        "setup_seconds": middle - start,
        "solve_seconds": end - middle,
        "cpu_seconds": cpu,
        "iterations": ksp.getIterationNumber(),
        "converged": ksp.getConvergedReason() > 0,
        "reason": reason_name(PETSc.KSP.ConvergedReason, ksp.getConvergedReason()),
        "history": history,
    }
    for held in (ksp, matrix, u, b):  # before the structure, whose DM they hold
        held.destroy()
    return found


def _sorted(scene):
    """Return the scene with its links in the order of their subdomains: a rank gets a piece of them that follow."""
    order = np.argsort(scene.subdomain, kind="stable")
    arrays = {
        name: getattr(scene, name)[order] for name in ("links", "law", "stiffness", "initial_elongation", "subdomain")
    }
    return replace(scene, **arrays)


def _watch(structure, scene, reference, history):
    first = []

    def monitor(ksp, _iteration, norm):
        first[:] = first or [norm or 1.0]
        error = errors(scene, structure.displacements(ksp.buildSolution()), reference)[0]
        history.append((norm / first[0], error))

    return monitor
