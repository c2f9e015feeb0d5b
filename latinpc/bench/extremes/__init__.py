"""The robustness suite: cases at extremes with their expected outcomes, run by ``latinpc extremes``.

`catalogue`, `rigid`, `motions` and `matrices` make the cases; `exact` computes solutions without rounding, `steps`
those of a time step; `conditions` checks solutions that are not unique; `worker` runs one case in a process of its
own. A case is

right
    when it converged and the true error of what is unique is within `SLACK` times the requested one or, of a matrix
    that does not allow it, `SLACK` times what rounding of its entries or of a dense factorisation moves,
refused
    when it did not converge, or ended in an error, and the reason says why,
wrong
    when it claims convergence with another solution, or with one that is not finite,
silent
    when it was refused without a cause, or though a solution was expected,
hang, crash
    when the process did not end, or ended by a signal.
"""

from __future__ import annotations

import json
import os
import pathlib
import subprocess
import sys
import tempfile
from dataclasses import asdict, dataclass, fields, replace

import numpy as np
from petsc4py import PETSc

from latinpc.bench.peers.launch import RANKS, THREADS
from latinpc.files.npz import save_scene
from latinpc.results.mechanics import errors

from . import catalogue, matrices, motions, rigid
from .case import ACCURACY, Case
from .conditions import closing, missed, shortening
from .steps import motion_error

__all__ = ["ACCURACY", "BAD", "SLACK", "Case", "Outcome", "by_group", "cases", "layout", "run", "run_all"]

SLACK = 3.0  #: times the requested accuracy, as `-snes_latin_stop error` promises
NO_DIGIT = 0.1  # what rounding moves where there is nothing to be right about
TIMEOUT = 300.0  # s, for one case
EXACT_DOFS = 500  # up to so many the reference is exact, beyond it is Newton's method
NOTHING = 16 * np.finfo(PETSc.RealType).eps  # of the initial elongations
BAD = ("wrong", "silent", "hang", "crash")


@dataclass
class Outcome:
    """What became of a case; fit for JSON."""

    group: str
    name: str
    verdict: str
    reason: str
    error: float | None = None  #: relative l2 error of the displacements
    iterations: int | None = None
    seconds: float | None = None
    expected: str = "right"
    reference: str = ""


def cases():
    """Return all cases, group by group."""
    return [*catalogue.cases(), *rigid.cases(), *motions.cases(), *matrices.cases()]


def run(case):
    """Run a case in a process of its own and judge it.

    Parameters
    ----------
    case : Case

    Returns
    -------
    Outcome
    """
    scene = case.make()
    with tempfile.TemporaryDirectory(prefix="latinpc-") as folder:
        folder = pathlib.Path(folder)
        kind = "matrix" if isinstance(scene, matrices.Elements) else "motion" if case.steps else "statics"
        if kind == "matrix":
            scene.save(folder / "scene.npz")
        else:
            try:
                scene = _in_this_precision(scene)
            except ValueError as error:  # nodes that are one in single precision
                return _outcome(case, _refusal(case, str(error)), str(error))
            save_scene(folder / "scene.npz", scene)
        task = {"scene": str(folder / "scene.npz"), "options": case.options, "kind": kind, "steps": case.steps,
                "answer": str(folder / "answer.json"), "solution": str(folder / "solution.npz")}  # fmt: skip
        (folder / "task.json").write_text(json.dumps(task))
        command = [sys.executable, "-P", "-m", "latinpc.bench.extremes.worker", str(folder / "task.json")]
        if case.ranks > 1:
            command = ["mpirun", "-n", str(case.ranks), *command]
        environment = {**RANKS, **os.environ, **THREADS}
        try:
            process = subprocess.run(command, env=environment, timeout=TIMEOUT, capture_output=True, check=False)
        except subprocess.TimeoutExpired:
            return _outcome(case, "hang", f"not over after {TIMEOUT:g} s")
        answer = folder / "answer.json"
        if process.returncode < 0 or not answer.exists():
            tail = process.stderr.decode(errors="replace").strip().splitlines()[-1:]
            return _outcome(case, "crash", f"exit code {process.returncode}: {' '.join(tail)}")
        found = json.loads(answer.read_text())
        solution = dict(np.load(task["solution"])) if found.get("solved") else {"u": None}
    return _judge(case, scene, found, **solution)


def _in_this_precision(scene):
    """Return the scene as the solver will have it: in single precision its numbers are others."""
    values = {field.name: getattr(scene, field.name) for field in fields(scene)}
    values = {
        name: value for name, value in values.items() if isinstance(value, np.ndarray) and value.dtype.kind == "f"
    }
    return replace(scene, **{name: value.astype(PETSc.RealType).astype(float) for name, value in values.items()})


def _outcome(case, verdict, reason, **more):
    return Outcome(case.group, case.name, verdict, reason, expected=case.expected, **more)


def _judge(case, scene, found, u, tensions=None, v=None):
    """Compare with the truth; what is not solved must say why."""
    if found.get("error"):
        return _outcome(case, _refusal(case, found["error"]), found["error"])
    counts = {"iterations": found["iterations"], "seconds": found["seconds"]}
    reason = "; ".join([found["reason"], *found["notices"]])
    if not found["converged"]:
        return _outcome(case, _refusal(case, reason), reason, **counts)
    if not np.isfinite(u).all():
        return _outcome(case, "wrong", f"{reason}, with displacements that are not finite", **counts)
    if isinstance(scene, matrices.Elements):
        error, rounding = scene.errors(u)
        hidden = f"; rounding moves {rounding:.0e}" if rounding > ACCURACY else ""
        right = rounding < NO_DIGIT and error <= SLACK * max(ACCURACY, rounding)
        return _outcome(case, "right" if right else "wrong", reason + hidden, error=error,
                        reference="exact, energy norm", **counts)  # fmt: skip
    if case.steps:
        error, kind = motion_error(case, scene, u, v)
        right = error <= SLACK * ACCURACY and case.expected != "refused"
        return _outcome(case, "right" if right else "wrong", reason, error=error, reference=kind, **counts)
    if case.unique != "displacements":
        measure = {"elongations": shortening, "closed": closing}.get(case.unique, missed)
        error, kind = measure(scene, u, tensions), "conditions" if measure is missed else case.unique
        if case.solution is not None:
            known, kind = case.solution(scene), f"{case.unique}, {kind}"
            error = max(error, np.linalg.norm(tensions - known) / np.linalg.norm(known))
        right = error <= SLACK * ACCURACY and case.expected != "refused"
        return _outcome(case, "right" if right else "wrong", reason, error=error, reference=kind, **counts)
    reference, kind = _reference(case, scene, u, tensions)
    if reference is None:
        return _outcome(case, "wrong" if case.expected == "refused" else "right", f"{reason}; {kind}", **counts)
    error = errors(scene, u, reference)[0]
    # displacements that the rounding of the initial elongations alone would make are zero; where nothing moves, that of
    # the coordinates
    least = NOTHING * np.linalg.norm(scene.initial_elongation)
    if not reference.any():
        least = max(least, NOTHING * np.ptp(scene.nodes) * np.sqrt(u.size))
    nothing = np.linalg.norm(u - reference) <= least
    right = (error <= SLACK * ACCURACY or nothing) and case.expected != "refused"
    if nothing:
        error, kind = None, "nothing moves but by rounding"
    return _outcome(case, "right" if right else "wrong", reason, error=error, reference=kind, **counts)


def _refusal(case, reason):
    """Return whether a refusal is expected and names its cause (refused), or not (silent)."""
    names = (
        "equilibrium", "mechanism", "rounding", "has no link", "as many subdomains", "no free", "precision",
        "supported",
        "Masses differ",
        "how friction holds",
    )  # fmt: skip
    return "refused" if case.expected != "right" and any(name in reason for name in names) else "silent"


def _reference(case, scene, u, tensions):
    """Return the true displacements and what they are: a closed form, exact arithmetic, or Newton's method."""
    if case.solution is not None:
        return case.solution(scene), "closed form"
    if (~scene.fixed).sum() <= EXACT_DOFS:
        from .exact import solve_exactly

        exact = solve_exactly(scene, u)
        return (exact.displacements, "exact") if exact.exists else (None, "no equilibrium exists")
    from latinpc.bench.peers.reference import by_newton

    return by_newton(scene, ACCURACY)[0], "Newton"


def run_all(chosen, progress=None):
    """Run cases one after the other.

    Parameters
    ----------
    chosen : sequence of Case
    progress : callable, optional
        Called with a sentence.

    Returns
    -------
    dict
        accuracy, cases (as `Outcome`), counts by verdict, and `converged`: the share of solvable cases that is right.
    """
    outcomes = []
    for number, case in enumerate(chosen, 1):
        if progress is not None:
            progress(f"{number} of {len(chosen)}: {case.group}, {case.name}")
        outcomes.append(run(case))
    verdicts = [outcome.verdict for outcome in outcomes]
    solvable = [outcome for outcome in outcomes if outcome.expected == "right"]
    right = sum(outcome.verdict == "right" for outcome in solvable)
    return {
        "accuracy": ACCURACY,
        "counts": {verdict: verdicts.count(verdict) for verdict in ("right", "refused", *BAD)},
        "converged": right / len(solvable) if solvable else None,
        "cases": [asdict(outcome) for outcome in outcomes],
    }


def layout(document):
    """Return the header and the rows of a table, as text."""
    header = ["group", "case", "verdict", "error", "iterations", "seconds", "reason"]
    rows = []
    for case in document["cases"]:
        error = "-" if case["error"] is None else f"{case['error']:.0e}"
        seconds = "-" if case["seconds"] is None else f"{case['seconds']:.2f}"
        iterations = "-" if case["iterations"] is None else str(case["iterations"])
        rows.append([case["group"], case["name"], case["verdict"], error, iterations, seconds, case["reason"]])
    return header, rows


def by_group(document):
    """Return the header and the rows of a table with a line for each group, as text."""
    header = ["group", "cases", "right", "refused", "bad", "largest error", "most iterations"]
    rows = []
    for group in dict.fromkeys(case["group"] for case in document["cases"]):
        mine = [case for case in document["cases"] if case["group"] == group]
        error = max((case["error"] for case in mine if case["error"] is not None), default=None)
        counts = [sum(case["verdict"] in verdicts for case in mine) for verdicts in (("right",), ("refused",), BAD)]
        iterations = max((case["iterations"] for case in mine if case["iterations"] is not None), default=None)
        rows.append(
            [group, *map(str, (len(mine), *counts)), "-" if error is None else f"{error:.0e}", str(iterations or "-")]
        )
    return header, rows
