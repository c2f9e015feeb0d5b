"""Shock dynamics: iterations and time a step of SNES latin, beside Newton's method with CHOLMOD in the same run.

python benchmarks/dynamics.py [--modules 48] [--steps 1000] [--step 1e-4,2e-4,...] [--every 20] [--stop 5e-5]
    prints the table of benchmarks/motions.md, and writes benchmarks/results/dynamics-<modules>.json

A tensegrity grid in its self-stress is hit in the middle by 200 kg at 5 m/s, through an elastic contact, as Newton's
method needs a stiffness. SNES latin makes all steps, each from the state of the last two. At every so many steps
Newton's method makes the same step from the same state, to rounding: that gives the error of the step, relative, in
the l2 norm of the velocities, and its own time.
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np
import petsc4py

petsc4py.init(["dynamics"])

from petsc4py import PETSc  # noqa: E402

import latinpc  # noqa: E402
from latinpc.options import default_options  # noqa: E402
from latinpc.runs.report import versions  # noqa: E402
from latinpc.scenes import make  # noqa: E402

NEWTON = {
    "snes_type": "newtonls", "snes_linesearch_type": "none", "snes_rtol": 1e-12, "snes_stol": 1e-4, "snes_max_it": 50,
    "ksp_type": "preonly", "pc_type": "cholesky", "pc_factor_mat_solver_type": "cholmod",
    "pc_factor_mat_ordering_type": "nd",
}  # fmt: skip
EVENTS = ("LatinSetUp", "MatCholFctrNum")


def stepper(structure, h, options):
    """Make a TS with its own displacements and velocities."""
    u, v = structure.create_vec(), structure.create_vec()
    with default_options(options):
        ts = structure.create_ts(u, v)
        ts.setTimeStep(h)
        ts.setMaxSteps(10**9)
        ts.setFromOptions()
    return ts, u, v


def counts():
    """Set-ups and factorisations so far."""
    return [PETSc.Log.Event(name).getPerfInfo()["count"] for name in EVENTS]


def timed_step(ts):
    start = time.perf_counter()
    ts.step()
    return time.perf_counter() - start


def run(scene, h, steps, every, stop):
    """Move the scene; returns one row of the table."""
    structure = latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF)
    ts, u, v = stepper(structure, h, {"snes_stol": stop})
    newton, nu, nv = stepper(structure, h, NEWTON)
    structure.set_displacements(scene.velocity, v)
    iterations, seconds, errors, newton_steps, newton_seconds = [], [], [], [], []
    PETSc.Log.begin()
    for k in range(steps):
        sample = k % every == 0
        if sample:
            u.copy(nu), v.copy(nv)
            took = timed_step(newton)
            if k:
                newton_seconds.append(took)
                newton_steps.append(newton.getSNES().getIterationNumber())
            before = counts()
        took = timed_step(ts)
        iterations.append(ts.getSNES().getIterationNumber())
        if k:
            seconds.append(took)
        if sample:
            if k:
                assert counts() == before, "something was built again"
            nv.axpy(-1.0, v)
            errors.append(nv.norm() / v.norm())
    slack = np.mean(structure.tensions(u)[scene.law == latinpc.Law.CABLE] == 0.0)
    return {
        "step": h, "steps": steps, "stop": stop, "iterations_mean": float(np.mean(iterations[1:])),
        "iterations_max": int(max(iterations)), "error_mean": float(np.mean(errors)), "error_max": float(max(errors)),
        "seconds_a_step": float(np.median(seconds)), "newton_iterations": float(np.mean(newton_steps)),
        "newton_seconds_a_step": float(np.median(newton_seconds)), "samples": len(errors), "slack": float(slack),
    }  # fmt: skip


def main():
    """Run and report."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--modules", type=int, default=48)
    parser.add_argument("--steps", type=int, default=1000)
    parser.add_argument("--step", default="2e-4", help="lengths of a step (s)")
    parser.add_argument("--every", type=int, default=50, help="steps between two of Newton's method")
    parser.add_argument("--stop", type=float, default=5e-5, help="-snes_stol of SNES latin")
    given = parser.parse_args()
    scene = make("impact-grid", modules=given.modules, contact="elastic")
    print("| step | steps | iterations, most | step error, most | slack at the end | latin | Newton, CHOLMOD | ratio |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    rows = []
    for h in map(float, given.step.split(",")):
        r = run(scene, h, given.steps, given.every, given.stop)
        rows.append(r)
        latin, newton = 1e3 * r["seconds_a_step"], 1e3 * r["newton_seconds_a_step"]
        cells = [f"{1e3 * h:g} ms", f"{r['steps']}", f"{r['iterations_mean']:.1f}, {r['iterations_max']}"]
        cells += [f"{r['error_mean']:.0e}, {r['error_max']:.0e}", f"{100 * r['slack']:.0f} %", f"{latin:.0f} ms"]
        cells += [f"{r['newton_iterations']:.1f} iterations, {newton:.0f} ms", f"{newton / latin:.1f}"]
        print("| " + " | ".join(cells) + " |", flush=True)
    path = Path(__file__).parent / "results" / f"dynamics-{given.modules}.json"
    path.write_text(json.dumps({"modules": given.modules, "versions": versions(), "rows": rows}, indent=2) + "\n")


if __name__ == "__main__":
    main()
