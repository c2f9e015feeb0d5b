"""What load cases say of their results: as a solve of each by itself would, but once for several."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from latinpc.results.loose import loose
from latinpc.results.notices import changed, magnitudes, overstretched, strained, turned
from latinpc.results.result import Result

if TYPE_CHECKING:
    from .solvedcases import Cases

__all__ = ["free", "stretched", "too_far"]

NAMED = 8  # cases in a sentence


def too_far(cases: Cases) -> list[str]:
    """Return what a solve by itself says of cases whose displacements are too large for it, the farthest case first."""
    said = {}
    rows = cases.report["cases"]
    for number in sorted(np.flatnonzero(cases.good), key=lambda case: -rows[case]["displacement"]):
        found = _alone(cases, number)
        for notice in [*(turned(found) or changed(found) or strained(found)), *magnitudes(found)]:
            kind = notice.split()[0]  # amounts differ from case to case
            said.setdefault(kind, []).append((cases.names[number], notice))
    return [
        f"case {first}: {notice}" + (f" (likewise {_some([name for name, _ in others])})" if others else "")
        for (first, notice), *others in said.values()
    ]


def free(cases: Cases) -> list[str]:
    """Return what a solve by itself says of nodes that slack or yielding links leave free, once for alike cases."""
    return _grouped({cases.names[number]: loose(_alone(cases, number)) for number in np.flatnonzero(cases.good)})


def stretched(cases: Cases) -> list[str]:
    """Return what a solve by itself says of links that a case makes shorter than nothing, once for alike cases."""
    changed = [case for case in cases.actions if case.initial_elongation is not None]
    always = overstretched(cases.scene)
    found = {case.name: overstretched(case.applied(cases.scene)) for case in changed}
    return _grouped({name: [notice for notice in said if notice not in always] for name, said in found.items()})


def _grouped(found):
    """Return the sentences on cases, by name, each once with the cases that it is of."""
    said = {}
    for name, notices in found.items():
        for notice in notices:
            said.setdefault(notice, []).append(name)
    return [f"case{'s' if len(names) > 1 else ''} {_some(names)}: {notice}" for notice, names in said.items()]


def _some(names):
    """Return the first of the names of cases."""
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return ", ".join(names[:NAMED]) + more


def _alone(cases, number):
    """Return the result of a case that has converged, as a solve by itself gives it."""
    scene = replace(cases.actions[number].applied(cases.scene), geometry=cases.geometry)
    report = {"converged": True, "solver": cases.report["solver"]}
    return Result(scene, cases.displacements[number], cases.tensions[number], scene.load, report)
