"""A process that solves a scene: ``python -m latinpc.bench.peers.worker TASK.json``, under mpirun or alone.

The task names files: the scene, the reference, and where to write the answer. `latinpc.bench.peers.launch` starts it.
"""

from __future__ import annotations

import json
import sys

import petsc4py

petsc4py.init([sys.argv[0], "-skip_petscrc"])

import numpy as np  # noqa: E402
from petsc4py import PETSc  # noqa: E402

import latinpc  # noqa: E402
from latinpc.files.npz import load_scene  # noqa: E402
from latinpc.laws import Law  # noqa: E402
from latinpc.results.mechanics import errors, largest_unbalance, relative, tensions  # noqa: E402

from . import run  # noqa: E402
from .reference import by_latin, by_newton  # noqa: E402

LONG = 2.0  # s


def _timed(task, scene, reference, tolerance):
    """Solve and compare; return the measures of the run."""
    outcome = run.solve(task["method"], scene, tolerance, task.get("options"), accuracy=task.get("accuracy"))
    error_l2, error_energy = errors(scene, outcome.displacements, reference)
    return {
        "setup_seconds": outcome.setup_seconds,
        "solve_seconds": outcome.solve_seconds,
        "cpu_seconds": outcome.cpu_seconds,
        "peak_memory_bytes": outcome.peak_memory_bytes,
        "iterations": outcome.iterations,
        "linear_iterations": outcome.linear_iterations,
        "error_l2": error_l2 if np.isfinite(error_l2) else None,
        "error_energy": error_energy if np.isfinite(error_energy) else None,
        **_forces(scene, outcome.displacements, reference),
        "converged": outcome.converged,
        "reason": outcome.reason,
        "tolerance": tolerance,
    }


def _forces(scene, displacements, reference):
    """Return the error of the tensions and the largest unbalanced force, where displacements give the forces."""
    if scene.geometry != "linear" or (scene.law > Law.COMPRESSION_ONLY).any():
        return {"error_tension": None, "largest_unbalance": None}
    found = tensions(scene, displacements)
    pair = relative(found, tensions(scene, reference)), largest_unbalance(scene, found)
    return {key: x if np.isfinite(x) else None for key, x in zip(("error_tension", "largest_unbalance"), pair)}


def _repeated(task, scene, reference, tolerance):
    """Solve several times, but once only what is long: the clock's noise does not grow with it."""
    runs = []
    while len(runs) < task["repeat"] and sum(one["solve_seconds"] for one in runs) < LONG:
        run.forget_peak()
        runs.append(_timed(task, scene, reference, tolerance))
    return runs


def perform(task):
    """Perform a task and return the answer; collective."""
    scene = load_scene(task["scene"])
    if task["do"] == "reference":
        make = by_newton if task["method"] == "newton" else by_latin
        displacements, about = make(scene, task["accuracy"])
        if PETSc.COMM_WORLD.rank == 0:
            np.save(task["reference"], displacements)
        return about
    base = PETSc.COMM_WORLD.tompi4py().allreduce(run.peak_memory())
    reference = np.load(task["reference"])
    if task["do"] == "calibrate":
        found = run.calibrate(task["method"], scene, task["accuracies"], reference, task.get("options"))
        return {"tolerances": found}
    if task["do"] == "sweep" and scene.geometry == "large" and run.METHODS[task["method"]].kind == "latin":
        runs = [(one, _repeated({**task, "accuracy": one}, scene, reference, None)) for one in task["accuracies"]]
        points = [{"accuracy": one, "runs": found} for one, found in runs if all(each["converged"] for each in found)]
        return {"points": points, "base_memory_bytes": base}  # a path of Newton's method has latin's own stop
    if task["do"] == "sweep":  # calibration and all the solves in one process
        found = run.calibrate(task["method"], scene, task["accuracies"], reference, task.get("options"))
        points, known = [], {None: []}
        for accuracy, tolerance in zip(task["accuracies"], found):
            if tolerance not in known:  # one iterate of Newton's method may serve several accuracies
                known[tolerance] = _repeated(task, scene, reference, tolerance)
            if known[tolerance]:
                points.append({"accuracy": accuracy, "runs": known[tolerance]})
        return {"points": points, "base_memory_bytes": base}
    return {**_timed(task, scene, reference, task["tolerance"]), "base_memory_bytes": base}


def main():
    """Read the task, do it, write the answer: its result, or the sentence of its error."""
    with open(sys.argv[1], encoding="utf-8") as file:
        task = json.load(file)
    for name, value in task.get("user_options", []):
        PETSc.Options().setValue(name, value)
    try:
        answer = {"result": perform(task)}
    except Exception as error:
        text = latinpc.error_message(error) or type(error).__name__
        answer = {"error": " ".join(text.split())}
    if PETSc.COMM_WORLD.rank == 0 or "error" in answer:
        with open(task["answer"], "w", encoding="utf-8") as file:
            json.dump(answer, file)
    if "error" in answer and PETSc.COMM_WORLD.size > 1:
        PETSc.COMM_WORLD.tompi4py().Abort(1)


if __name__ == "__main__":
    main()
