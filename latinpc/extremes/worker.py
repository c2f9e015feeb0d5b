"""A process that solves one case: ``python -m latinpc.extremes.worker TASK.json``, under mpirun or alone."""

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
from latinpc.peers.arrays import load_scene  # noqa: E402
from latinpc.solve import solve  # noqa: E402


def main():
    """Read the task, solve, write the answer: how it ended, or the sentence of its error."""
    with open(sys.argv[1], encoding="utf-8") as file:
        task = json.load(file)
    warnings.simplefilter("ignore")
    root = PETSc.COMM_WORLD.rank == 0
    try:
        start = time.perf_counter()
        result = solve(load_scene(task["scene"]), task["options"])
        answer = {
            "solved": True,
            "converged": bool(result.converged),
            "reason": result.report["reason"],
            "iterations": int(result.report["iterations"]),
            "notices": list(result.notices),
            "seconds": time.perf_counter() - start,
        }
        if root:
            np.savez(task["solution"], u=result.displacements, tensions=result.tensions)
    except Exception as error:
        text = latinpc.error_message(error) if isinstance(error, PETSc.Error) else str(error)
        answer = {"error": " ".join(text.split()) or type(error).__name__}
    if root:
        with open(task["answer"], "w", encoding="utf-8") as file:
            json.dump(answer, file)


if __name__ == "__main__":
    main()
