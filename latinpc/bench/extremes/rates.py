"""The rates of random structures: what was right, refused or wrong, by family, against exact arithmetic."""

from __future__ import annotations

import json
import os
import pathlib
import signal
import subprocess
import sys
import tempfile

import numpy as np

from latinpc.bench.peers.launch import THREADS

from .drawn import FAMILIES

ASKED = 1e-4  #: relative error of displacements and tensions that the default stop promises
SLACK = 3.0  #: times the error asked for, as in the suite
TIMEOUT = 60  # s of the processor, for one structure
VERDICTS = ("right", "refused", "unsolved", "unknown", "elsewhere", "wrong", "rounding", "hang", "crash")
#: verdicts on what has an equilibrium, of which rates are taken
SOLVABLE = ("right", "unsolved", "elsewhere", "wrong", "hang", "crash")
BAD = ("wrong", "hang", "crash")


def run(count, seed, options=None, family=None, progress=None):
    """Solve random structures and judge the answers.

    Parameters
    ----------
    count, seed : int
    options : dict, optional
        PETSc options of the solver; the defaults without.
    family : str, optional
        One of `drawn.FAMILIES`; else those of `drawn.SHARES`.
    progress : callable, optional
        Called with a sentence.

    Returns
    -------
    dict
        seed, options, and outcomes: a dict of number, family, topology, verdict, reason, errors and iterations each.
    """
    outcomes = []
    with tempfile.TemporaryDirectory(prefix="latinpc-") as folder:
        file = pathlib.Path(folder) / "outcomes"
        while len(outcomes) < count:
            task = {"seed": seed, "first": len(outcomes), "last": count, "options": options or {}, "family": family,
                    "file": str(file), "timeout": TIMEOUT}  # fmt: skip
            file.write_text("")
            process = subprocess.Popen(
                [sys.executable, "-P", "-m", "latinpc.bench.extremes.rating", json.dumps(task)],
                env={**os.environ, **THREADS}, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            )  # fmt: skip
            while process.poll() is None:
                try:
                    process.wait(5)
                except subprocess.TimeoutExpired:
                    done = len(outcomes) + file.read_text().count("\n")
                    if progress is not None:
                        progress(f"{done} of {count} structures")
            outcomes += [json.loads(line) for line in file.read_text().splitlines()]
            if len(outcomes) < count:  # the process ended in this one
                hung = process.returncode == -signal.SIGPROF
                reason = f"not over after {TIMEOUT} s of the processor" if hung else f"exit code {process.returncode}"
                outcomes.append({"number": len(outcomes), "family": family or "?", "topology": "?",
                                 "verdict": "hang" if hung else "crash", "reason": reason})  # fmt: skip
    return {"seed": seed, "options": options or {}, "asked": ASKED, "outcomes": outcomes}


def layout(document):
    """Return the header and the rows of a table with a line for each family, as text."""
    header = ["family", "structures", *VERDICTS, "solved", "largest error u", "tensions", "median iterations"]
    rows = []
    outcomes = document["outcomes"]
    for family in [*FAMILIES, "all"]:
        mine = [one for one in outcomes if family in (one["family"], "all")]
        if not mine:
            continue
        counts = [sum(one["verdict"] == verdict for one in mine) for verdict in VERDICTS]
        solvable = [one for one in mine if one["verdict"] in SOLVABLE]
        right = [one for one in solvable if one["verdict"] == "right"]
        largest = [
            max((one[key] for one in right if one.get(key) is not None), default=0.0) for key in ("u", "tension")
        ]
        stages = np.median([one["iterations"] for one in right]) if right else 0
        share = 100 * len(right) / len(solvable) if solvable else 100.0
        rows.append([family, str(len(mine)), *map(str, counts), f"{share:.1f} %", *(f"{x:.0e}" for x in largest),
                     f"{stages:g}"])  # fmt: skip
    return header, rows
