"""Compare solvers on one scene, with one process per method and repetition.

Set-up and solve are timed from the arrays in memory; the DMPLEX and the partition belong to the set-up of every
PETSc method, the matrices of the program to that of the interior point methods. Every method stops at the first
iterate below the accuracy: its tolerance is found beforehand, in a run of its own that is not timed.
"""

from __future__ import annotations

import os
import statistics
import time

from latinpc.laws import Law

from .peers import DEFAULT, LINEAR, METHODS
from .peers.launch import Bench, Failed

#: Keys of a row, in this order.
KEYS = (
    "method", "setup_seconds", "solve_seconds", "peak_memory_bytes", "iterations", "error_l2", "error_energy",
    "converged", "reason",
)  # fmt: skip
_MEDIANS = KEYS[1:7]
OURS = ("latin", "ksp-latin")  # what the others are compared with
BUSY = 1.1  # wall over processor time from which the table says so
TIGHTER = 0.5  # when the errors of the timed run and of the calibration differ by a hair

NOTE = (
    "Seconds and memory are medians; memory is the largest of the process, Python and the scene's arrays included. "
    "Each method stops at the first iterate below the accuracy,"
    " latin by its estimate where its iterates take longer."
)


def compare(scene, methods=None, accuracy=1e-4, repeat=3, ranks=1, timeout=600.0, reference="auto",
            user_options=(), progress=None):  # fmt: skip
    """Solve a scene by several methods.

    Parameters
    ----------
    scene : Scene
    methods : sequence of str
        Names of `latinpc.bench.peers.METHODS`. By default its `LINEAR` for a scene of bars, its `DEFAULT` for others,
        without those that do not take the geometry of the scene.
    accuracy : float
        Relative l2 error of the displacements to reach.
    repeat : int
        Timed runs of each method, in turn so that a busy moment of the machine does not fall on one of them.
    ranks : int
        For the PETSc methods; the interior point methods run on one core.
    timeout : float
        For one process (s).
    reference : {'auto', 'newton', 'latin'}
        What errors are measured against.
    user_options : sequence of (str, str or None)
        PETSc options that replace those of the methods.
    progress : callable, optional
        Called with a sentence.

    Returns
    -------
    dict
        scene, scene_options, free_dofs, links, accuracy, repeat, ranks, reference, cores, versions, rows, runs.
        A row has the keys of `KEYS`; a run more of them. What a method that failed does not give is None.
    """
    methods = check_methods(methods or suited(scene))
    bars, linear = not (scene.law != Law.BAR).any(), scene.geometry == "linear"
    for name in methods:
        if METHODS[name].kind == "linear" and not (bars and linear):
            raise ValueError(
                f"{name} solves structures of bars alone, in linear geometry; {scene.name} is not one: take truss-grid"
            )
        if METHODS[name].kind == "qp" and not linear:
            raise ValueError(f"{name} solves structures in linear geometry alone: leave it out of --methods")
    if not 0 < accuracy < 1:
        raise ValueError(f"--accuracy {accuracy:g}: a relative error, between 0 and 1")
    if repeat < 1 or ranks < 1:
        raise ValueError("--repeat and --ranks are at least 1")
    say = _Told(scene.name, 1 + len(methods) * (1 + repeat), progress)
    with Bench(scene, ranks, timeout, user_options) as bench:
        say("reference")
        about = bench.make_reference(accuracy, reference)
        stops, failures, runs = {}, {}, {name: [] for name in methods}
        for name in methods:
            say(f"the stop of {name}")
            try:
                stops[name] = _stop(bench, name, accuracy)
            except Failed as error:
                failures[name] = str(error)
        for turn in range(repeat):
            for name in stops:
                say(f"{name}, run {turn + 1} of {repeat}")
                if name not in failures:
                    _time(bench, name, stops, accuracy, runs, failures)
    return {
        **describe(scene),
        "accuracy": accuracy,
        "repeat": repeat,
        "ranks": ranks,
        "reference": about,
        "note": NOTE,
        "rows": [_row(name, runs[name], failures.get(name), accuracy, ranks) for name in methods],
        "runs": [{"method": name, **run} for name in methods for run in runs[name]],
    }


class _Told:
    """Says which of how many processes is under way, and how long the whole has taken.

    Parameters
    ----------
    scene : str
    total : int
        Number of processes, where none fails.
    progress : callable or None
        Called with a sentence.
    """

    def __init__(self, scene, total, progress):
        self._scene, self._total, self._progress = scene, total, progress
        self._number, self._start = 0, time.monotonic()

    def __call__(self, text):
        self._number += 1
        if self._progress is not None:
            seconds = time.monotonic() - self._start
            self._progress(f"{self._scene}: {self._number} of {self._total}, {text} ({seconds:.0f} s so far)")


def suited(scene):
    """Return the methods that take a scene: its energy is quadratic, convex, or neither with large displacements."""
    if scene.geometry == "linear":
        return DEFAULT if (scene.law != Law.BAR).any() else LINEAR
    others = ("newton-latin",) if scene.geometry == "large" else ()
    return [name for name in DEFAULT if METHODS[name].kind != "qp" and name not in others]


def check_methods(methods):
    """Return the methods without repetition; raise for an unknown one."""
    for name in methods:
        if name not in METHODS:
            raise ValueError(f"unknown method '{name}': choose from {', '.join(METHODS)}")
    return list(dict.fromkeys(methods))


def describe(scene):
    """Return what a document of measurements says of the scene, the machine and the versions."""
    from latinpc.results.report import plain
    from latinpc.runs.report import versions

    return {
        "scene": scene.name,
        "scene_options": plain(scene.metadata),
        "free_dofs": int((~scene.fixed).sum()),
        "links": len(scene.links),
        "cores": os.cpu_count(),
        "versions": versions(),
    }


def _ranks(bench, name):
    return 1 if METHODS[name].kind == "qp" else bench.ranks


def _stop(bench, name, accuracy):
    """Return the tolerance that reaches the accuracy; one that is not reached is a failure only once timed.

    None for latin, whose own stop then lets Newton's method take over: with large displacements, which take paths of
    Newton's method, and where the iteration alone takes more linear stages, as on nets.
    """
    task = {"method": name, "accuracies": [accuracy]}
    if METHODS[name].kind != "latin":
        return bench.run(_ranks(bench, name), do="calibrate", **task)["tolerances"][0] or accuracy * 1e-2
    if bench.large:
        return None
    own = bench.run(bench.ranks, do="time", method=name, tolerance=None, accuracy=accuracy)
    return bench.run(bench.ranks, do="calibrate", options={"snes_max_it": max(1, own["iterations"])}, **task)[
        "tolerances"
    ][0]


def _time(bench, name, stops, accuracy, runs, failures):
    try:
        for _ in range(3):
            run = bench.run(_ranks(bench, name), do="time", method=name, tolerance=stops[name], accuracy=accuracy)
            near = run["error_l2"] is not None and accuracy < run["error_l2"] < 2 * accuracy
            if not near or stops[name] is None:
                break
            stops[name] *= TIGHTER
        runs[name].append(run)
    except Failed as error:
        failures[name] = str(error)


def _row(name, runs, failure, accuracy, ranks):
    row = dict.fromkeys(KEYS) | {"method": name, "converged": False, "reason": failure}
    if not runs:
        return row
    for key in _MEDIANS:
        values = [run[key] for run in runs if run[key] is not None]
        row[key] = statistics.median(values) if values else None
    row["iterations"] = int(row["iterations"])
    row["reason"] = failure or runs[-1]["reason"]
    if name in ("newton-bddc", "cg-bddc", "fetidp") and ranks == 1:
        row["reason"] += ", but one subdomain a rank: on one rank BDDC is a direct solver"
    below = row["error_l2"] is not None and row["error_l2"] <= accuracy
    row["converged"] = failure is None and all(run["converged"] for run in runs) and below
    if not below and failure is None:
        row["reason"] += ", the error stays above the accuracy"
    return row


# ---- the table -------------------------------------------------------------------------------


def layout(document):
    """Return the header and the rows of a table, as text; ratios are to latin, or to ksp-latin."""
    from latinpc.results.units import quantity

    rows = document["rows"]
    latin = next((row for row in rows if row["method"] in OURS and row["converged"]), None)
    times = f"x {latin['method'] if latin else OURS[0]}"
    header = ["method", "set-up", "solve", "total", times, "memory", times, "iterations"]
    header += ["error l2", "energy", "reason"]
    table = []
    for row in rows:
        cells = [row["method"]]
        if row["solve_seconds"] is None:
            table.append([*cells, *["-"] * 9, row["reason"] or "-"])
            continue
        total = row["setup_seconds"] + row["solve_seconds"]
        cells += [quantity(value, "s") for value in (row["setup_seconds"], row["solve_seconds"], total)]
        times = memory = "-"
        if latin is not None and row["converged"]:
            times = f"{total / (latin['setup_seconds'] + latin['solve_seconds']):.1f}"
            memory = f"{row['peak_memory_bytes'] / latin['peak_memory_bytes']:.1f}"
        errors = ["-" if row[key] is None else f"{row[key]:.1e}" for key in ("error_l2", "error_energy")]
        cells += [times, quantity(row["peak_memory_bytes"], "B"), memory, str(row["iterations"]), *errors]
        table.append([*cells, row["reason"] if row["converged"] else f"not converged: {row['reason']}"])
    return header, table


def against(document):
    """Return sentences on the reference, and on a machine that had other work."""
    about = document["reference"]
    text = f" Errors are against {about['method']}, whose own error is about {about['accuracy']:.0e}."
    wall = sum(run["setup_seconds"] + run["solve_seconds"] for run in document["runs"])
    cpu = sum(run["cpu_seconds"] for run in document["runs"])
    if document["ranks"] == 1 and wall > BUSY * cpu:
        text += f" The machine was busy: the runs had {100 * cpu / wall:.0f} % of their core."
    return text
