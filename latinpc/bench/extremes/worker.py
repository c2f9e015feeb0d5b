"""A process that solves one case: ``python -m latinpc.bench.extremes.worker TASK.json``, under mpirun or alone."""

from __future__ import annotations

import json
import sys
import time
import warnings

import petsc4py

petsc4py.init([sys.argv[0], "-skip_petscrc"])

import numpy as np  # noqa: E402
from petsc4py import PETSc  # noqa: E402

import latinpc  # noqa: E402
from latinpc.files.npz import load_scene  # noqa: E402
from latinpc.runs.motion import move  # noqa: E402
from latinpc.runs.solve import solve  # noqa: E402

from .matrices import Elements  # noqa: E402


def main():
    """Read the task, solve, write the answer: how it ended, or the sentence of its error."""
    with open(sys.argv[1], encoding="utf-8") as file:
        task = json.load(file)
    warnings.simplefilter("ignore")
    root = PETSc.COMM_WORLD.rank == 0
    try:
        start = time.perf_counter()
        way = {"statics": _solved, "motion": _moved, "matrix": _matrix}[task["kind"]]
        answer, arrays = way(task)
        answer |= {"solved": True, "seconds": time.perf_counter() - start}
        if root:
            np.savez(task["solution"], **arrays)
    except Exception as error:
        text = latinpc.error_message(error)
        answer = {"error": " ".join(text.split()) or type(error).__name__}
    if root:
        with open(task["answer"], "w", encoding="utf-8") as file:
            json.dump(answer, file)


def _solved(task):
    result = solve(load_scene(task["scene"]), task["options"])
    answer = {
        "converged": bool(result.converged),
        "reason": result.report["reason"],
        "iterations": int(result.report["iterations"]),
        "notices": list(result.notices),
    }
    return answer, {"u": result.displacements, "tensions": result.tensions}


def _moved(task):
    motion = move(load_scene(task["scene"]), task["steps"], options=task["options"], every=1)
    answer = {
        "converged": bool(motion.converged),
        "reason": motion.report["reason"],
        "iterations": max(motion.report["iterations"], default=0),
        "notices": list(motion.notices),
    }
    frames = motion.frames
    return answer, {"u": np.array([frame.displacements for frame in frames]),
                    "v": np.array([frame.velocities for frame in frames]),
                    "tensions": np.array([frame.tensions for frame in frames])}  # fmt: skip


def _matrix(task):
    elements = Elements.load_from(task["scene"])
    matrix = elements.matis(PETSc.COMM_WORLD)
    database = PETSc.Options()
    for name, value in task["options"].items():
        database[name] = value
    ksp = PETSc.KSP().create(PETSc.COMM_WORLD)
    ksp.setOperators(matrix)
    ksp.setFromOptions()
    x, b = matrix.createVecs()
    b.setArray(elements.load[slice(*b.getOwnershipRange())].astype(PETSc.ScalarType))
    ksp.solve(b, x)
    scatter, whole = PETSc.Scatter.toZero(x)
    scatter.scatter(x, whole)
    reason = ksp.getConvergedReason()
    names = {code: name for name, code in vars(PETSc.KSP.ConvergedReason).items() if isinstance(code, int)}
    answer = {
        "converged": reason > 0,
        "reason": names.get(reason, str(reason)),
        "iterations": ksp.getIterationNumber(),
        "notices": [],
    }
    return answer, {"u": whole.getArray()}


if __name__ == "__main__":
    main()
