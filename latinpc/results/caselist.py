"""Solved load cases as text: a row a case, and the extremes of the envelope."""

from __future__ import annotations

import numpy as np

from latinpc.laws import UNILATERAL

from .tables import AXES
from .units import counted, first_largest, quantity

HEADER = ("case", "stages", "displacement", "lowest", "highest", "slack", "")
MOST_SLACK = 8  # links that are listed


def title(cases):
    """Return what was solved."""
    scene = cases.scene
    size = f"{counted(len(scene.nodes), 'node')}, {counted(len(scene.links), 'link')}"
    return f"{scene.name}: {counted(len(cases.names), 'load case')}, {size}"


def rows(cases):
    """Return a row for each case, below `HEADER`."""
    return [
        [case["name"], str(case["iterations"]), quantity(case["displacement"], "m"), quantity(case["lowest"], "N"),
         quantity(case["highest"], "N"), _slack(case), "" if case["converged"] else _ended(case)]
        for case in cases.report["cases"]
    ]  # fmt: skip


def _slack(case):
    """Return the number of slack links; a case without results has no tensions."""
    return "not known" if case["slack"] is None else f"{case['slack']:,}"


def _ended(case):
    """Return why a case has not converged, and the part of its loads where its row is that of a part."""
    factor = case.get("load_factor", 1.0)
    return case["reason"] + (f" at {factor:.4g} of its loads" if factor < 1.0 else "")


def extremes(cases):
    """Return lines of (label, text) on the highest and the lowest force of all cases, and on slack links."""
    scene, lines = cases.scene, []
    lowest, highest, low, high = cases.envelope()
    for label, forces, case, sign in (("highest", highest, high, 1.0), ("lowest", lowest, low, -1.0)):
        if np.isfinite(forces).all():
            link = first_largest(sign * forces)
            name, places = scene.link_name(link), scene.nodes[scene.links[link]]
            ends = " to ".join(f"({', '.join(f'{x:.4g}' for x in place)})" for place in places)
            said = f"{name} m" if name.startswith("(") else f"{name}, {ends} m"  # a drawing has places for names
            where = f"in case {cases.names[case[link]]}: link {said}"
            lines.append((label, f"{quantity(forces[link], 'N')} {where}"))
    lines += [*_reactions(cases), *_worst(cases)]
    often = cases.slack_cases()
    if np.isin(scene.law, UNILATERAL).any():
        worst = [link for link in np.argsort(-often, kind="stable")[:MOST_SLACK] if often[link]]
        listed = ", ".join(f"{scene.link_name(link)} ({often[link]})" for link in worst)
        most = f"; most often (cases): {listed}" if worst else ""
        lines.append(("slack", f"{counted(np.count_nonzero(often), 'link')} in some case{most}"))
    return lines


def _worst(cases):
    """Return lines on the largest stress and utilisation of the cases that have converged, where they are known."""
    lines = []
    for label, values in (("stress", cases.stress), ("utilisation", cases.utilisation)):
        values = None if values is None else np.where(cases.good[:, None], values, np.nan)
        if values is None or np.isnan(values).all():
            continue
        case, link = np.unravel_index(first_largest(np.abs(values)), values.shape)
        largest, over = values[case, link], np.count_nonzero((values > 1.0).any(axis=0))
        text = quantity(largest, "Pa") if label == "stress" else f"{100 * largest:.3g} %"
        more = f"; above 100 % in {counted(over, 'link')}" if over and label == "utilisation" else ""
        lines.append((label, f"largest {text} in case {cases.names[case]}: link {cases.scene.link_name(link)}{more}"))
    return lines


def _reactions(cases):
    """Return a line on the reactions: their range along each axis, and the largest one."""
    scene, (lowest, highest, *_) = cases.scene, cases.reaction_envelope()
    if not scene.fixed.any() or not cases.good.any():
        return []
    size = np.where(cases.good[:, None], np.linalg.norm(cases.reactions, axis=2), 0.0)
    case, node = np.unravel_index(first_largest(size), size.shape)
    ranges = [
        f"{axis} from {quantity(low[held].min(), 'N')} to {quantity(high[held].max(), 'N')}"
        for axis, low, high, held in zip(AXES, lowest.T, highest.T, scene.fixed.T)
        if held.any()
    ]
    largest = f"largest {quantity(size[case, node], 'N')} at node {scene.node_name(node)} in case {cases.names[case]}"
    return [("reactions", f"{', '.join(ranges)}; {largest}")]


def text(cases):
    """Return title, table and extremes as lines of plain text."""
    cells = [list(HEADER), *rows(cases)]
    widths = [max(map(len, column)) for column in zip(*cells)]
    aligned = [
        "  ".join([row[0].ljust(widths[0]), *map(str.rjust, row[1:-1], widths[1:-1]), row[-1]]).rstrip()
        for row in cells
    ]
    lines = [title(cases), *aligned, *(f"{label:<13}{said}" for label, said in extremes(cases))]
    return "\n".join([*lines, *(f"notice       {notice}" for notice in cases.notices)])
