"""Thin plates with rotations, which need more of the coarse space than other matrices."""

import json
from pathlib import Path

PROGRAM = Path(__file__).parents[1] / "benchmarks" / "bending.py"


def test_search_direction_and_local_fields_of_thin_plates(mpirun):
    """Eight times fewer iterations, as docs/preconditioners.md recommends; the solutions are equally good."""
    change = ["--change", "cells", "(24, 24)", "--change", "blocks", "(2, 1)"]
    found = {}
    for method in ("PC latin", "PC latin, schur, local fields"):
        done = mpirun(2, PROGRAM, "--one", "plate, thickness 1/1000", method, *change)
        found[method] = json.loads(done.stdout.splitlines()[-1])
        _, reason, _, residual, *_ = found[method]
        assert reason > 0 and residual < 1e-5
    most, few = (of[2] for of in found.values())
    assert few <= 6 and few <= most / 4
