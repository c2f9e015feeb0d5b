"""200 load cases of 48 x 48 modules of the tensegrity grid: on one set-up, and each as a solve of its own.

    python benchmarks/cases.py            prints the table of docs/cases.md; five minutes
    python benchmarks/cases.py --series   the same with the cases one after the other

Two sets: combinations of dead load, live load on parts of the grid, wind from any angle, temperatures, turnbuckles and
settlements; and loads on every node that have nothing in common. Seconds are those of the processor in this process,
which a busy machine changes less than the clock: the least of some runs, which alternate. Of solves alone some are
made, which stand for all.
"""

import sys
import time
import warnings
from dataclasses import replace

import numpy as np

import latinpc
from latinpc.runs import cases as runs
from latinpc.scenes import Case, make

COUNT = 200
ALONE = 20  # cases that are solved by themselves in each run, at equal distances
RUNS = 3
MODULES = 48
UNIT = 1.17  # N, the load of a node with which 9 % of the cables are slack


def combined(scene, count=COUNT, seed=11):
    """Return combinations of dead load, live load, wind, temperature, turnbuckles and settlements."""
    rng = np.random.default_rng(seed)
    x, y = (scene.nodes[:, :2] / np.ptp(scene.nodes[:, :2], axis=0)).T
    free, left = ~scene.fixed.any(axis=1), scene.fixed[:, 2] & (x < 0.5)
    across = (scene.nodes[scene.links].mean(axis=1)[:, 1]) / np.ptp(scene.nodes[:, 1])
    down = free[:, None] * np.array([0.0, 0.0, -UNIT])
    for number in range(count):
        live = np.zeros(len(x))
        for _ in range(rng.integers(1, 5)):  # snow or people on rectangles
            (x0, x1), (y0, y1) = np.sort(rng.uniform(0.0, 1.0, 2)), np.sort(rng.uniform(0.0, 1.0, 2))
            live[(x0 <= x) & (x <= x1) & (y0 <= y) & (y <= y1)] = rng.uniform(0.3, 1.0)
        angle = rng.uniform(0.0, 2.0 * np.pi)
        along = (x - 0.5) * np.cos(angle) + (y - 0.5) * np.sin(angle)
        lift = 0.4 * np.clip(0.2 - along, 0.0, None)  # on the side that the wind comes from
        drag = 0.3 * np.ones_like(x)
        wind = free[:, None] * UNIT * np.stack([drag * np.cos(angle), drag * np.sin(angle), lift], axis=1)
        dead, crowd, storm = rng.choice([1.0, 1.35]), rng.choice([0.0, 1.05, 1.5]), rng.choice([0.0, 0.9, 1.5])
        degrees = rng.choice([0.0, 0.0, -10.0, 2.5]) * (1.0 + 0.3 * (across - 0.5))
        elongation = -1.2e-5 * degrees * scene.lengths
        if rng.uniform() < 0.3:
            turned = (scene.law == latinpc.Law.CABLE) & (rng.uniform(size=len(scene.links)) < 0.005)
            elongation += turned * rng.uniform(1e-6, 1e-5) * scene.lengths
        sunk = np.zeros_like(scene.load)
        if rng.uniform() < 0.3:
            sunk[left, 2] = -rng.uniform(1e-4, 1e-3) * (y[left] if rng.uniform() < 0.5 else 1.0)
        load = dead * 0.4 * down + crowd * 0.45 * live[:, None] * down + storm * wind
        yield Case(f"combination {number}", load, sunk, elongation)


def independent(scene, count=COUNT, seed=12):
    """Return forces in random directions on every node."""
    rng = np.random.default_rng(seed)
    for number in range(count):
        size = rng.uniform(0.3, 1.0) * 35.0 * UNIT
        yield Case(f"random {number}", np.where(scene.fixed, 0.0, size * rng.normal(size=scene.load.shape)))


def timed(work):
    """Return what a function returns, and its seconds."""
    start = time.process_time()
    return work(), time.process_time() - start


def alone(scene, case):
    """Solve a case by itself."""
    load, prescribed, elongation = (0.0 if part is None else part for part in case.parts)
    return latinpc.Structure(
        scene.nodes, scene.links, scene.law, scene.stiffness, scene.initial_elongation + elongation,
        scene.fixed, scene.prescribed + prescribed, scene.load + load, scene.subdomain,
    ).solve()  # fmt: skip


def measure(scene, cases):
    """Return the last result of all cases, its seconds, iterations and seconds of cases by themselves."""
    together, single = [], []
    for _ in range(RUNS):
        found, seconds = timed(lambda: (result := runs.solve_cases(scene, cases), result.envelope())[0])
        assert found.converged
        together.append(seconds)
        some = [timed(lambda: alone(scene, case)) for case in cases[:: COUNT // ALONE]]  # noqa: B023
        assert all(result.converged for result, _ in some)
        single.append(np.mean([seconds for _, seconds in some]))
    return found, min(together), np.mean([result.report["iterations"] for result, _ in some]), COUNT * min(single)


def main():
    warnings.simplefilter("ignore", latinpc.LatinWarning)  # twin cables
    if "--series" in sys.argv:
        runs.FEWEST = sys.maxsize
    grid = make("tensegrity-grid", modules=MODULES)
    scene = replace(grid, load=np.zeros_like(grid.load))
    cables = np.count_nonzero(scene.law == latinpc.Law.CABLE)
    print("| cases | structure | slack cables | stages a case, together and alone | seconds together | alone | ratio |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for make_cases in (combined, independent):
        cases = list(make_cases(scene))
        for structure, text in ((scene, "144 equal blocks"), (replace(scene, subdomain=None), "without a partition")):
            found, seconds, stages, total = measure(structure, cases)
            share = 100.0 * found.slack.sum(axis=1) / cables
            mean = np.mean([case["iterations"] for case in found.report["cases"]])
            print(
                f"| {make_cases.__name__} | {text} | {share.min():.1f} to {share.max():.1f} % "
                f"| {mean:.1f}, {stages:.1f} | {seconds:.2f} | {total:.1f} | 1/{total / seconds:.1f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
