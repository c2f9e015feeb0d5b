"""Draw diagrams of measurements: times of `latinpc compare`, work against precision of `latinpc tradeoff`, and more."""

from __future__ import annotations

import numpy as np
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter

from latinpc.results.drawing import new_figure, save

SETUP, SOLVE, MEMORY = "#9ecae1", "#1764ab", "#8c96a3"
COLOURS = ("#111111", "#1764ab", "#d7301f", "#2e8b57", "#c800a1", "#e08214", "#6a51a3", "#7f7f7f")
MARKERS = "os^Dv<>P"


def _time(value, _=None):
    """Return seconds as a short label: 50 ms, 2 s."""
    if value <= 0:
        return "0"
    return f"{1e3 * value:g} ms" if value < 1 else f"{value:g} s"


def _plain(axes):
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    axes.tick_params(labelsize=8)


def _title(document):
    links = f"{document['links']:,} links, {document['free_dofs']:,} free degrees of freedom"
    return f"{document['scene']}: {links}"


def bars(document, path):
    """Draw the rows of `latinpc.bench.compare.compare`: time with set-up and solve, and memory.

    Parameters
    ----------
    document : dict
    path : path
        Its suffix chooses the format.
    """
    rows = [row for row in document["rows"] if row["solve_seconds"] is not None]
    failed = [row["method"] for row in document["rows"] if row["solve_seconds"] is None]
    height = 1.4 + 0.36 * max(len(rows), 1)
    figure = new_figure(9.0, height)
    names = [row["method"] + ("" if row["converged"] else " *") for row in rows]
    place = np.arange(len(rows))
    times, memory = figure.subplots(1, 2, sharey=True, width_ratios=(2.2, 1))
    setup = np.array([row["setup_seconds"] for row in rows])
    total = setup + [row["solve_seconds"] for row in rows]
    times.barh(place, total, color=SOLVE, label="total", height=0.66)
    times.barh(place, setup, color=SETUP, label="set-up alone", height=0.22)
    if len(rows):
        times.set_xscale("log")
        times.set_xlim(setup.min() / 2, total.max() * 3)
    for y, value in zip(place, total):
        times.text(value * 1.06, y, _time(float(f"{value:.2g}")), va="center", fontsize=8)
    times.set_yticks(place, names)
    times.invert_yaxis()
    times.xaxis.set_major_formatter(FuncFormatter(_time))
    times.xaxis.set_minor_formatter(NullFormatter())
    times.set_xlabel("time", fontsize=9)
    times.legend(fontsize=8, frameon=False, loc="lower left", bbox_to_anchor=(0, 1), ncols=2, borderaxespad=0.1)
    size = np.array([row["peak_memory_bytes"] for row in rows]) / 1e6
    memory.barh(place, size, color=MEMORY, height=0.66)
    for y, value in zip(place, size):
        memory.text(value, y, f" {value:.3g}" if value < 1e3 else f" {value:.0f}", va="center", fontsize=8)
    memory.set_xlim(0, 1.25 * size.max(initial=1.0))
    memory.set_xlabel("memory of the process (MB)", fontsize=9)
    for axes in (times, memory):
        _plain(axes)
    memory.tick_params(left=False)
    accuracy = f"relative l2 error of {document['accuracy']:.0e}".replace("e-0", "e-")
    figure.suptitle(f"{_title(document)}; to a {accuracy}", fontsize=10, x=0.01, ha="left")
    note = []
    if any(not row["converged"] for row in rows):
        note.append("* not converged")
    if failed:
        note.append(f"no result: {', '.join(failed)}")
    figure.text(0.01, 0.012, "; ".join(note), fontsize=8, color="#555555")
    figure.tight_layout(rect=(0, 0.04 if note else 0, 1, 0.97))
    save(figure, path)


def diagrams(document, path):
    """Draw the curves of `latinpc.bench.tradeoff.tradeoff`: one panel for each knob, time against error.

    Parameters
    ----------
    document : dict
    path : path
        Its suffix chooses the format.
    """
    from .tradeoff import seconds

    knobs = list(dict.fromkeys(curve["knob"] for curve in document["curves"]))
    columns = min(len(knobs), 3)
    lines = -(-len(knobs) // columns)
    figure = new_figure(4.6 * columns, 3.7 * lines + 0.5)
    panels = figure.subplots(lines, columns, squeeze=False).ravel()
    for knob, axes in zip(knobs, panels):
        curves = [curve for curve in document["curves"] if curve["knob"] == knob]
        values = []
        for number, curve in enumerate(curves):
            points = sorted(curve["points"], key=lambda point: -point["error_l2"])
            first = number == 0
            label = curve["label"]
            if points:
                memory = max(point["peak_memory_bytes"] for point in points)
                label += f", {memory / 1e6:.0f} MB"
            else:
                label += ": none"
            time = [seconds(point) for point in points]
            values += time
            axes.plot([point["error_l2"] for point in points], time, color=COLOURS[number % len(COLOURS)],
                      marker=MARKERS[number % len(MARKERS)], markersize=4.5 if first else 3.5,
                      linewidth=2.2 if first else 1.2, zorder=3 if first else 2, label=label)  # fmt: skip
        _precision_axes(axes, document, values)
        axes.set_title(knob, fontsize=10, loc="left", fontweight="bold")
        axes.legend(fontsize=7, frameon=False, loc="upper left", ncols=1 + (len(curves) > 4), columnspacing=1.0)
    for axes in panels[len(knobs) :]:
        axes.set_visible(False)
    figure.suptitle(f"{_title(document)}; one core, set-up included", fontsize=11, x=0.01, ha="left")
    figure.tight_layout(rect=(0, 0, 1, 0.985))
    save(figure, path)


def _precision_axes(axes, document, values):
    """Make both axes logarithmic, the error falling to the right, with room for the legend above."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(3 * max(document["accuracies"]), min(document["accuracies"]) / 30)
    if values:
        low, high = min(values), max(values)
        span = max(high / low, 3.0)
        axes.set_ylim(low / span**0.12, high * span**0.75)
    axes.xaxis.set_major_locator(LogLocator(numticks=12))
    axes.xaxis.set_minor_formatter(NullFormatter())
    low, high = axes.get_ylim()
    digits = (1, 2, 5) if high / low < 300 else (1,)
    axes.yaxis.set_major_locator(FixedLocator([d * 10.0**k for k in range(-5, 5) for d in digits]))
    axes.yaxis.set_major_formatter(FuncFormatter(_time))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.grid(True, which="major", color="#e6e6e6", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.set_xlabel("relative l2 error", fontsize=9)
    axes.set_ylabel("time", fontsize=9)
    _plain(axes)


def distributions(document, path):
    """Draw benchmarks/effectivity.py's quantiles of what indicator and estimate are over the true error.

    Parameters
    ----------
    document : dict
    path : path
        Its suffix chooses the format.
    """
    rows = document["effectivity"]
    figure = new_figure(9.0, 0.8 + 0.5 * len(rows))
    axes = figure.subplots(gridspec_kw={"left": 0.2})
    for shift, what, colour in ((-0.15, "indicator", SETUP), (0.15, "estimate", SOLVE)):
        for i, row in enumerate(rows):
            low, early, median, late, high = row[what]
            axes.plot([low, high], [i + shift] * 2, color=colour, linewidth=1)
            axes.plot([early, late], [i + shift] * 2, color=colour, linewidth=5, label=what if i == 0 else None)
            axes.plot(median, i + shift, "|", color="black", markersize=9)
    axes.axvline(1.0, color="black", linewidth=0.8, linestyle=":")
    axes.set_xscale("log")
    axes.set_yticks(range(len(rows)), [f"{row['norm']}: {row['group']}" for row in rows])
    axes.invert_yaxis()
    axes.set_xlabel(
        "measure / true error at all iterates: extremes, 5 % to 95 %, median; too low on the left of 1", fontsize=8
    )
    axes.legend(fontsize=8, frameon=False)
    _plain(axes)
    save(figure, path)


def slackening(document, path):
    """Draw benchmarks/slack.py's linear stages over the share of slack cables, a panel for each structure.

    Parameters
    ----------
    document : dict
    path : path
        Its suffix chooses the format.
    """
    scenes = list(dict.fromkeys(row["scene"] for row in document["rows"]))
    figure = new_figure(4.0 * len(scenes), 3.6)
    panels = figure.subplots(1, len(scenes), sharey=True, gridspec_kw={"wspace": 0.08, "bottom": 0.16})
    for axes, scene in zip(np.atleast_1d(panels), scenes):
        rows = [row for row in document["rows"] if row["scene"] == scene and row["slack"] is not None]
        share = [100 * row["slack"] for row in rows]
        for i, key in enumerate(rows[0]["stages"]):
            variant, outer = key.split(", ")
            stages = [row["stages"][key] or np.nan for row in rows]
            line = "-" if outer == "anderson" else ":"
            axes.plot(share, stages, line, marker=MARKERS[i // 2], markersize=4, color=COLOURS[i // 2], label=key)
        by_itself = [row["default"]["stages"] for row in rows]
        axes.plot(share, by_itself, "x", color=COLOURS[6], markersize=5, label="default stop, with Newton's method")
        axes.set_yscale("log")
        axes.set_title(scene, fontsize=9)
        axes.set_xlabel("slack cables (%)", fontsize=8)
        _plain(axes)
    panels = np.atleast_1d(panels)
    panels[len(scenes) // 2].legend(fontsize=7, frameon=False, loc="upper left")
    panels[0].set_ylabel(f"linear stages to an l2 error of {document['accuracy']:.0e}".replace("e-0", "e-"), fontsize=8)
    save(figure, path)


def growth(families, methods, path):
    """Draw time against size, a diagram for each family of scenes.

    Parameters
    ----------
    families : dict
        Family -> scene -> method -> row of `latinpc.bench.compare.compare`, and ``free_dofs``.
    methods : sequence of str
    path : path
        Its suffix chooses the format.
    """
    figure = new_figure(3.4 * len(families), 3.6)
    for axes, (family, scenes) in zip(figure.subplots(1, len(families), sharey=True), families.items(), strict=True):
        for method, colour, marker in zip(methods, COLOURS, MARKERS, strict=False):
            found = [(one["free_dofs"], one[method]) for one in scenes.values()]
            found = [(n, row) for n, row in found if row["solve_seconds"] is not None]
            times = [row["setup_seconds"] + row["solve_seconds"] for _, row in found]
            axes.loglog([n for n, _ in found], times, marker=marker, color=colour, label=method, markersize=5)
        axes.set_title(family, fontsize=9)
        axes.set_xlabel("unknowns", fontsize=8)
        axes.yaxis.set_major_formatter(FuncFormatter(_time))
        axes.grid(True, which="major", alpha=0.3)
        _plain(axes)
    figure.axes[0].set_ylabel("set-up and solve", fontsize=8)
    figure.axes[-1].legend(fontsize=7, frameon=False)
    save(figure, path)
