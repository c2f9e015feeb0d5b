"""200 load cases on 48 x 48 modules of the tensegrity grid: on one set-up, one by one, and as commands.

    python benchmarks/cases.py            prints the table of docs/cases.md; some minutes

Seconds are those of the processor, which a busy machine changes less than the clock. A command is the mean of a few.
"""

import resource
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from petsc4py import PETSc

from latinpc.runs.cases import solve_cases
from latinpc.runs.solve import solve
from latinpc.scenes import Case, make

COUNT = 200
COMMANDS = 5
MODULES = 48


def patterns(scene):
    """Return eight patterns of load: all of it, halves, slopes, a wave, the middle, and sideways."""
    x, y = (scene.nodes[:, :2] / MODULES).T
    shares = [np.ones_like(x), x < 0.5, y < 0.5, x, y, np.sin(np.pi * x), np.hypot(x - 0.5, y - 0.5) < 0.22]
    sideways = np.where(scene.fixed, 0.0, np.abs(scene.load).max() * np.array([1.0, 0.0, 0.0]))
    loads = [np.asarray(share, float)[:, None] * scene.load for share in shares] + [sideways]
    return [Case(f"pattern {number}", load=load) for number, load in enumerate(loads)]


def sums(parts):
    """Return sums of the patterns at random, of 0.3 to 1.2 times the scene's load in all."""
    rng = np.random.default_rng(1)
    for number in range(COUNT):
        share = rng.uniform(0.0, 1.0, len(parts))
        share *= rng.uniform(0.3, 1.2) / share[:-1].sum()
        first, *others = (float(factor) * part for factor, part in zip(share, parts))
        yield sum(others, first).named(f"case {number}")


def measured(work):
    """Return what a function returns, the set-ups that it took, and its seconds."""
    event, start = PETSc.Log.Event("LatinSetUp"), time.process_time()
    before = event.getPerfInfo()["count"]
    found = work()
    return found, event.getPerfInfo()["count"] - before, time.process_time() - start


def main():
    PETSc.Log.begin()
    grid = make("tensegrity-grid", modules=MODULES)
    scene, cases = replace(grid, load=np.zeros_like(grid.load)), list(sums(patterns(grid)))
    print("| | set-ups | stages a case | seconds |\n| --- | --- | --- | --- |")
    for structure, text in ((scene, ""), (replace(scene, subdomain=None), ", structure without its partition")):
        found, set_ups, seconds = measured(lambda: solve_cases(structure, cases))  # noqa: B023
        assert found.converged
        stages = np.mean([case["iterations"] for case in found.report["cases"]])
        print(f"| `solve_cases`{text} | {set_ups} | {stages:.0f} | {seconds:.0f} |", flush=True)
        alone = [measured(lambda: solve(case.applied(structure)))[::2] for case in cases]  # noqa: B023
        stages = np.mean([result.report["iterations"] for result, _ in alone])
        seconds = sum(seconds for _, seconds in alone)
        print(f"| one by one in one process{text} | {COUNT} | {stages:.0f} | {seconds:.0f} |", flush=True)
    command = [
        Path(sys.executable).with_name("latinpc"),
        "solve",
        "tensegrity-grid",
        "--modules",
        str(MODULES),
        "--quiet",
    ]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    for _ in range(COMMANDS):
        subprocess.run(command, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = (after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime) / COMMANDS
    print(f"| {COUNT} commands `latinpc solve` | {COUNT} | | {COUNT * seconds:.0f} |")


if __name__ == "__main__":
    main()
