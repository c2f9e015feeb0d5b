"""Draw what benchmarks/run.py measured: benchmarks/figures/*.png, and the tables of benchmarks/*.md."""

import json
import re
from pathlib import Path

from latinpc.bench import compare, extremes
from latinpc.bench.figures import bars, diagrams, distributions, slackening
from latinpc.results.units import quantity

HERE = Path(__file__).resolve().parent


def markdown(header, rows):
    """Return a table in Markdown, numbers to the right."""
    lines = ["| " + " | ".join(header) + " |", "| --- |" + " ---: |" * (len(header) - 1)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows])


def tabulate(name, document):
    """Return the table of a benchmark in Markdown."""
    if name.startswith("compare"):
        header, rows = compare.layout(document)
        return markdown(header, rows) + "\n\n`" + document["command"] + "`:" + compare.against(document)
    if name.startswith("presets"):
        header = ["preset", "iterations", "error l2", "energy", "set-up", "solve", "memory"]
        rows = [[f"`options/{row['preset']}.opts`", f"{row['iterations']:.0f}", f"{row['error_l2']:.1e}",
                 f"{row['error_energy']:.1e}", quantity(row["setup_seconds"], "s"), quantity(row["solve_seconds"], "s"),
                 quantity(row["peak_memory_bytes"], "B")] for row in document["rows"]]  # fmt: skip
        return markdown(header, rows)
    if name == "counts":
        accuracies = ["1e-02", "1e-03", "1e-04", "1e-08"]
        rows = [[scene, *(str(found.get(a, "")) for a in accuracies)] for scene, found in document.items()]
        return markdown(["scene", *(a.replace("-0", "-") for a in accuracies)], rows)
    if name.startswith("iteration"):
        return iteration(document)
    if name == "extremes":
        return markdown(*extremes.by_group(document))
    if name == "slack":
        return slack(document)
    if name == "directions":
        scenes = list(next(iter(document.values())))
        rows = [[direction, *(" / ".join(str(n or "-") for n in found[scene].values()) for scene in scenes)]
                for direction, found in document.items()]  # fmt: skip
        return markdown(["direction, fraction", *scenes], rows)
    if name == "effectivity":
        return effectivities(document) + "\n\n" + stops(document)
    return cheapest(document)


def iteration(document):
    """Return the table of where a set-up and an iteration spend their time, and of the bound."""
    scenes = list(document.values())
    rows = [[f"set-up: {label}", *(f"{one['setup'][label]:.0f} ms" for one in scenes)]
            for label in scenes[0].get("setup", {})]  # fmt: skip
    rows += [
        [label, *(f"{one['milliseconds'][label]:.1f} ms" for one in scenes)] for label in scenes[0]["milliseconds"]
    ]
    rows += [[f"bytes: {part}", *(quantity(one["bytes"][part], "B") for one in scenes)] for part in scenes[0]["bytes"]]
    rows.append(["triad", *(quantity(one["bandwidth"], "B") + "/s" for one in scenes)])
    rows.append(["bound", *(f"{one['bound']:.1f} ms" for one in scenes)])
    rows.append(["all / bound", *(f"{one['ratio']:.1f}" for one in scenes)])
    return markdown(["", *document], rows)


def slack(document):
    """Return the table of linear stages as cables slacken."""
    keys = list(document["rows"][0]["stages"])
    rows = []
    for row in document["rows"]:
        own, share = row["default"], row["slack"]
        told = "refused: no equilibrium" if own["reason"] < 0 else f"{own['stages']}, {own['error_l2']:.0e}"
        stages = [str(row["stages"].get(key) or f"> {document['most']}") if row["stages"] else "" for key in keys]
        slack_cables = "" if share is None else f"{100 * share:.1f} %"
        rows.append([row["scene"], f"{row['factor']:g}", slack_cables, *stages, told])
    return markdown(["structure", "load factor", "slack", *keys, "by itself: stages, error"], rows)


def effectivities(document):
    """Return the table of what indicator and estimate are over the true error."""
    labels = [f"{100 * q:.0f} %" for q in document["quantiles"]]
    rows = [
        [f"{row['norm']}, {row['group']}", str(row["cases"]), what, *(f"{value:.2g}" for value in row[what])]
        for row in document["effectivity"]
        for what in ("indicator", "estimate")
    ]
    bound = [f"{value:.3g}" for value in document["bound"]["effectivity"]]
    rows.append(["energy, bars only", str(document["bound"]["set"]["cases"]), "bound", *bound])
    return markdown(["norm of the error, cases", "number", "measure", *labels], rows)


def stops(document):
    """Return the table of how the two stops fare."""
    rows = [
        [f"{norm} {row['target']:.0e}".replace("e-0", "e-"), what, str(row["cases"]), f"{100 * row['met']:.1f} %",
         f"{row['worst']:.2f}", f"{row['median']:.2f}",
         f"{row['extra_iterations']:.0f} ({100 * row['extra_relative']:.0f} %)", str(row["not_noticed"])]
        for norm in document["stops"]
        for what, key in (("error", "stops"), ("indicator", "indicator_stops"))
        for row in document[key][norm]
    ]  # fmt: skip
    header = ["target", "stop", "cases", "met", "worst error / target", "median", "extra iterations", "not noticed"]
    return markdown(header, rows)


def cheapest(document):
    """Return a table of the time to some accuracies, for every curve of a tradeoff, and its memory."""
    wanted = [accuracy for accuracy in document["accuracies"] if accuracy in (1e-2, 1e-4, 1e-6, 1e-8)]
    rows = []
    for curve in document["curves"]:
        at = {point["accuracy"]: point for point in curve["points"]}
        cells = []
        for accuracy in wanted:
            point = at.get(accuracy)
            text = "-"
            if point:
                text = quantity(point["setup_seconds"] + point["solve_seconds"], "s") + f" ({point['iterations']:.0f})"
            cells.append(f"**{text}**" if point and point["front"] else text)
        memory = max((point["peak_memory_bytes"] for point in curve["points"]), default=None)
        rows.append([curve["knob"], curve["label"], *cells, quantity(memory, "B") if memory else "-"])
    return markdown(["knob", "choice", *(f"{accuracy:.0e}".replace("-0", "-") for accuracy in wanted), "memory"], rows)


def main():
    pages = {page: page.read_text(encoding="utf-8") for page in sorted(HERE.glob("*.md"))}
    (HERE / "figures").mkdir(exist_ok=True)
    for file in sorted((HERE / "results").glob("*.json")):
        name, document = file.stem, json.loads(file.read_text())
        page = next((page for page, text in pages.items() if f"<!-- {name} -->" in text), None)
        if page is None:  # its script writes a page of its own
            continue
        if name.startswith("compare"):
            bars(document, HERE / "figures" / f"{name}.png")
        if name.startswith("tradeoff"):
            diagrams(document, HERE / "figures" / f"{name}.png")
        if name == "slack":
            slackening(document, HERE / "figures" / f"{name}.png")
        if name == "effectivity":
            distributions(document, HERE / "figures" / f"{name}.png")
        block = f"<!-- {name} -->\n{tabulate(name, document)}\n<!-- end -->"
        pattern = rf"<!-- {name} -->\n.*?<!-- end -->"
        pages[page] = re.sub(pattern, lambda _, block=block: block, pages[page], flags=re.DOTALL)
    for page, text in pages.items():
        page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
