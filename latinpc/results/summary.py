"""Summaries of solves and motions, as lines of (label, text)."""

from __future__ import annotations

import numpy as np

from latinpc.laws import UNILATERAL, Law
from latinpc.numbering import place, place_digits

from .report import in_words
from .units import counted, first_largest, number, quantity, scaled, share

#: Parts of `latinpc.digits`, in the words of the summary
DIGITS = {"unbalance": "unbalance", "rounding": "rounding", "places": "coordinates", "values": "other data"}

SHOWN = 10  # steps of a load path


def summary_of_file(made):
    """Return what the reader of a file has noted, of the metadata of its scene, as lines of (label, text)."""
    return [("file", f"{made['file']}: {'; '.join(made['notes'])}")] if made.get("notes") else []


def summary(result, verbose=False):
    """Return the summary of a solve, as lines of (label, text); `verbose` adds what the solver has counted."""
    scene, report = result.structure, result.report
    kinds = [counted(count, law.noun, law.plural) for law in Law if (count := int(np.count_nonzero(scene.law == law)))]
    own, counts = np.unique(scene.laws[scene.law >= len(Law)], return_counts=True)
    laws = ", ".join(kinds + [f"{counted(int(count), 'link')} of the law {name}" for name, count in zip(own, counts)])
    lines = summary_of_file(report.get("scene_options", {}))
    size = f"{counted(len(scene.nodes), 'node')}, {counted(report['links'], 'link')} ({laws}) in {scene.dim}D"
    lines.append(("structure", size))
    if report.get("load_cases"):
        lines.append(
            ("load cases", f"{report['load_cases']}, none of them acts here: latinpc cases solves all, --case one")
        )
    if result.converged:
        lines.append(("solve", f"converged in {counted(report['iterations'], 'iteration')}"))
    else:
        lines.append(("not converged", result.reason))
    if "load_path" in report:
        steps = [f"{factor:.4g}: {quantity(moved, 'm')}" for factor, moved in report["load_path"]]
        lines.append(
            ("load path", ", ".join(steps if len(steps) <= SHOWN else [*steps[:4], "...", *steps[5 - SHOWN :]]))
        )
    factor = report.get("load_factor")
    if factor is not None and factor < 1.0:
        part = f"{factor:.4g}: the results are of this part of the loads"
        lines.append(("load factor", part if factor > 0.0 else "0: the results are of no stable equilibrium"))
    lines += _accuracy(result)
    if verbose:
        lines += _counts(report)
    if report.get("error_l2") is not None:
        energy = f", {report['error_energy']:.1e} (energy)" if report["error_energy"] is not None else ""
        tension = f", of the tensions {report['error_tension']:.1e}" if report["error_tension"] is not None else ""
        lines.append(("error", f"{report['error_l2']:.1e} (l2){energy}{tension} against Newton's method"))
    if report.get("digits") is not None:
        lines.append(("digits", _digits(report["digits"])))
    lines += _mechanics(scene, result)
    if "setup_seconds" in report:
        memory = quantity(report["peak_memory_bytes"], "B")
        seconds = [quantity(report[key], "s") for key in ("setup_seconds", "solve_seconds")]
        lines.append(("time", f"set-up {seconds[0]}, solve {seconds[1]}; memory {memory}"))
    return lines


def _counts(report):
    """Return lines on unknowns, subdomains, PETSc's types and reasons, and what is left of its norms."""
    ranks = counted(report["ranks"], "rank")
    lines = [("unknowns", f"{report['free_dofs']:,} free of {report['dofs']:,}, on {ranks}")]
    if report["subdomains"]:
        interfaces = f"{report['strong_interfaces']:,} strong and {report['weak_interfaces']:,} weak interfaces"
        coarse = f"coarse problem {report['strong_macro_dofs']:,} + {report['weak_dofs']:,}"
        lines.append(("decomposition", f"{counted(report['subdomains'], 'subdomain')}, {interfaces}; {coarse}"))
        lines.append(("cost", _cost(report["cost"])))
    indicator = f", indicator {report['indicator']:.1e}" if report["indicator"] is not None else ""
    lines.append(("solver", f"{report['solver']}: {report['reason']}, {in_words(report)}{indicator}"))
    norm = "energy" if report.get("options", {}).get("snes_latin_stop") == "energy" else "l2"
    error = (
        f"estimated error {report['estimated_error']:.1e} ({norm}), " if report["estimated_error"] is not None else ""
    )
    lines.append(("norms", f"{error}unbalanced forces {report['residual_norm']:.1e} N"))
    return lines


def _cost(cost):
    """Return why there are so many subdomains, what their factors take, and what was measured."""
    parts = [f"subdomains: {cost['choice']}"]
    if cost["factor_bytes"]:
        parts.append(f"factors {cost['factor_operations']:.2g} operations, {quantity(cost['factor_bytes'], 'B')}")
    if cost["linear_stages"]:
        stages = counted(cost["linear_stages"], "linear stage")
        parts.append(
            f"set-up {quantity(cost['setup_seconds'], 's')}, {stages} of {quantity(cost['stage_seconds'], 's')}"
        )
    return "; ".join(parts)


def _accuracy(result):
    """Return lines on the estimated errors, where there are any, and on unbalanced forces."""
    parts, report = [], result.report
    if _estimated(report, "estimated_error"):
        parts.append(f"of the displacements {share(report['estimated_error'])}")
    if _estimated(report, "tension_error"):
        parts.append(f"of the tensions {share(report['tension_error'])}")
    lines = [("accuracy", f"estimated error {', '.join(parts)}")] if parts else []
    if report["residual_norm"] is None:
        return [*lines, ("unbalance", "not known")]
    loads = np.linalg.norm(result.load[~result.structure.fixed])
    beside = f"{share(report['residual_norm'] / loads)} of the loads, " if loads > 0.0 else ""
    largest = report["largest_unbalance"]
    where = f" at node {result.structure.node_name(report['unbalanced_node'])}" if largest else ""
    return [*lines, ("unbalance", f"{beside}at most {quantity(largest, 'N')}{where}")]


def _estimated(report, key):
    """Return whether a relative error is an estimate: above 1 it says only that the solve is far from its result."""
    return report.get(key) is not None and report[key] <= 1.0


def _digits(lost):
    """Return how many digits of the displacements are accurate, and what limits them."""
    lost = {key: np.inf if part is None else part for key, part in lost.items()}  # nothing moves to compare with
    moved = np.sqrt(sum(part**2 for part in lost.values()))
    known = f"{-np.log10(max(moved, np.finfo(float).eps / 2)):.1f}" if moved < 1.0 else "none"
    return f"{known}: " + ", ".join(f"{text} {lost[key]:.0e}" for key, text in DIGITS.items())


def _mechanics(scene, result):
    size = np.linalg.norm(result.displacements, axis=1)
    if not (np.isfinite(size).all() and np.isfinite(result.tensions).all()):
        return [("displacement", "not known: no iterate is finite, or none is kept")]
    node = first_largest(size)
    lines = [
        (
            "displacement",
            f"largest {quantity(size[node], 'm')} at node {_node(scene, node)}:"
            f" {_vector(result.displacements[node], 'm')}",
        )
    ]
    low, high = result.tensions.min(), result.tensions.max()
    lines.append(("forces", f"from {quantity(low, 'N')} to {quantity(high, 'N')} (compression negative)"))
    lines.append(("worst member", _worst(scene, result)))
    return lines + _loose(scene, result) + _reactions(scene, result) + _stresses(result)


def _loose(scene, result):
    """Return how many cables and links in compression only are slack, and how many contacts are open."""
    found = {"slack": [], "open": []}
    for law in UNILATERAL:
        if (chosen := scene.law == law).any():
            count = f"{np.count_nonzero(result.slack & chosen):,}"
            word = "open" if law in (Law.CONTACT, Law.FRICTION) else "slack"
            found[word].append(f"{count} of {counted(int(chosen.sum()), law.noun, law.plural)}")
    return [(word, ", ".join(counts)) for word, counts in found.items() if counts]


def _worst(scene, result):
    """Return the link with the largest utilisation, or without strengths with the largest force."""
    known = result.utilisation is not None and not np.isnan(result.utilisation).all()
    link = first_largest(result.utilisation if known else np.abs(result.tensions))
    force, (start, end) = result.tensions[link], scene.links[link]
    ends = f", from node {scene.node_name(start)} to {scene.node_name(end)}" if scene.links_named else ""
    text = f"link {scene.link_name(link)}{ends}: {quantity(abs(force), 'N')} in"
    text += " compression" if force < 0.0 else " tension"
    return text + (f", {100 * result.utilisation[link]:.3g} % of its strength" if known else "")


def _node(scene, node):
    """Return the name and the coordinates of a node."""
    name, at, shown = scene.node_name(node), place(scene.nodes, node), place_digits(scene.nodes, 5)
    where = f"({', '.join(number(value, shown) for value in at)}) m"
    return where if name.startswith("(") else f"{name} {where}"


def _stresses(result):
    """Return lines on the largest stress and utilisation, where areas and strengths are known."""
    lines = []
    if result.stress is not None and not np.isnan(result.stress).all():
        link = first_largest(np.abs(result.stress))
        lines.append(
            ("stress", f"largest {quantity(result.stress[link], 'Pa')} in link {result.structure.link_name(link)}")
        )
    if result.utilisation is not None and not np.isnan(result.utilisation).all():
        link, over = first_largest(result.utilisation), int(np.count_nonzero(result.utilisation > 1.0))
        text = f"; above 100 % in {over:,} link{'s' if over > 1 else ''}" if over else ""
        name = result.structure.link_name(link)
        lines.append(("utilisation", f"largest {100 * result.utilisation[link]:.3g} % in link {name}{text}"))
    return lines


def _reactions(scene, result):
    """Return lines on the forces of the supports, and on their balance with the loads."""
    if not scene.fixed.any():
        return []
    size = np.linalg.norm(result.reactions, axis=1)
    node, balance = first_largest(size), result.balance
    sums = f"sum {_vector(balance.reaction, 'N')}, of the loads {_vector(balance.load, 'N')}"
    moment = f", moment {share(balance.moment)}" if scene.dim > 1 else ""
    return [
        ("reactions", f"{sums}; largest {quantity(size[node], 'N')} at node {_node(scene, node)}"),
        ("balance", f"loads + reactions: force {share(balance.force)}{moment} of the loads"),
    ]


def _vector(values, unit):
    """Return a vector in a readable unit; what rounding leaves beside its largest component is zero."""
    largest = np.abs(values).max()
    divisor, scaled_unit = scaled(largest, unit)
    shown = np.where(np.abs(values) > 1e-6 * largest, values / divisor, 0.0)
    return f"({', '.join(f'{value:.3g}' for value in shown)}) {scaled_unit}"


def summary_of_motion(result, verbose=False):
    """Return the summary of a motion, as lines of (label, text); `verbose` adds what the solver has counted."""
    scene, report, last = result.scene, result.report, result.frames[-1]
    size = f"{counted(len(scene.nodes), 'node')}, {counted(report['links'], 'link')} in {scene.dim}D"
    lines = [("structure", size)]
    ended = "all steps converged" if result.converged else "ended early"
    equal = np.isclose(
        report["steps"] * report["step"], report["time"], rtol=1e-6
    )  # none has failed and been made shorter
    length = ("" if equal else "at most ") + quantity(report["step"], "s")
    made = f"{counted(report['steps'], 'step')} of {length}, to {quantity(report['time'], 's')}"
    lines.append(("motion", f"{made}; {ended}"))
    if verbose:
        ranks = counted(report["ranks"], "rank")
        lines.append(("unknowns", f"{report['free_dofs']:,} free of {report['dofs']:,}, on {ranks}"))
        if report["subdomains"]:
            lines.append(("decomposition", counted(report["subdomains"], "subdomain")))
        lines.append(("solver", f"{report['solver']}: {report['reason']}"))
    if report["iterations"]:
        most = max(report["iterations"])
        lines.append(("iterations", f"{report['iterations_mean']:.1f} iterations a step, at most {most}"))
    kinetic, potential = report["kinetic_energy"], report["potential_energy"]
    if kinetic and None not in (kinetic[-1], potential[-1]):
        text = [quantity(a + b, "J") for a, b in ((kinetic[0], potential[0]), (kinetic[-1], potential[-1]))]
        lines.append(("energy", f"{text[0]} at the start, {text[1]} at the end"))
    size = np.linalg.norm(last.displacements, axis=1)
    if np.isfinite(size).all():
        lines.append(("displacement", f"largest {quantity(size.max(), 'm')} at the end"))
    if report["active"]:
        most = f"{max(report['active']):,} at most"
        lines.append(("active links", f"{report['active'][-1]:,} taut cables and closed contacts at the end, {most}"))
    per_step = report["seconds"] / max(report["steps"], 1)
    memory = quantity(report["peak_memory_bytes"], "B")
    lines.append(("time", f"{quantity(report['seconds'], 's')}, {quantity(per_step, 's')} a step; memory {memory}"))
    return lines
