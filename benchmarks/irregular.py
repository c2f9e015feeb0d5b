"""Structures that repeat nothing: time and memory beside Newton's method, one rank and two, and a sweep of subdomains.

    python benchmarks/irregular.py            measures what results/irregular.json lacks, scene by scene; the page
    python benchmarks/irregular.py --page     the page irregular.md, the picture and the tables of HEADLINE alone

Some thirty minutes, 4 GB of memory. The structure of drawn.py needs compas, which `make bench` installs.
"""

import json
import re
import sys
from pathlib import Path

from drawn import drawn

from latinpc.bench.compare import compare
from latinpc.bench.figures import growth
from latinpc.bench.peers.launch import Bench, Failed
from latinpc.results.units import quantity
from latinpc.scenes import make

HERE = Path(__file__).resolve().parent
ACCURACY = 1e-4
REPEAT = 2
TIMEOUT = 120.0  # s, for one solve
PEERS = ("newton-cholmod", "newton-mumps")
METIS = {"partition": "metis"}
#: family -> what it is, and the scenes by size
FAMILIES = {
    "grid, equal blocks": [("tensegrity-grid", {"modules": n}) for n in (48, 100, 200)],
    "grid, cut by METIS": [("tensegrity-grid", {"modules": n, **METIS}) for n in (48, 100, 200)],
    "network": [("network", {"nodes": n}) for n in (2000, 8000, 20000, 60000)],
    "drawing": [("drawn", {})],
}
#: Scenes of the sweep, and of the runs on two ranks
SWEPT = [("tensegrity-grid", {"modules": 100, **METIS}), ("network", {"nodes": 20000})]
COUNTS = (1, 2, 4, 8, 16, 64, 256)
TWICE = [*SWEPT, ("tensegrity-grid", {"modules": 200, **METIS})]
#: What README and documentation show, structures whose subdomains are alike and others with equal weight
HEADLINE = {
    "grid of 100 x 100 modules in equal blocks": "tensegrity-grid --modules 100",
    "grid of 200 x 200 modules in equal blocks": "tensegrity-grid --modules 200",
    "the same grid without its blocks": "tensegrity-grid --modules 200 --partition metis",
    "random network of 20,000 nodes": "network --nodes 20000",
    "random network of 60,000 nodes": "network --nodes 60000",
    "floor plan as a vault of two layers, drawn by others": "drawn",
}
SHOWN = (HERE.parent / "README.md", HERE.parent / "docs" / "performance" / "index.md")


def label(name, size):
    """Return the command line's words for a scene."""
    return " ".join([name, *(f"--{key} {value}" for key, value in size.items())])


def total(row):
    """Return set-up and solve (s), or None."""
    return None if row["solve_seconds"] is None else row["setup_seconds"] + row["solve_seconds"]


def rows(scene, ranks):
    """Return the rows of `latinpc compare`."""
    methods = ["latin", "latin-one", *PEERS] if ranks == 1 else ["latin", PEERS[1]]
    document = compare(scene, methods, ACCURACY, REPEAT, ranks, TIMEOUT)
    return {row["method"]: row for row in document["rows"]} | {"free_dofs": document["free_dofs"]}


def sweep(scene):
    """Return what SNES latin takes with so many subdomains that METIS makes, on one rank."""
    found = {}
    with Bench(scene) as bench:
        bench.make_reference(ACCURACY)
        for n in COUNTS:
            task = {"method": "latin", "options": {"snes_latin_subdomains": n}}
            try:
                stop = bench.run(1, do="calibrate", accuracies=[ACCURACY], **task)["tolerances"][0]
                found[n] = bench.run(1, do="time", tolerance=stop, **task)
            except Failed as error:
                found[n] = {"solve_seconds": None, "reason": str(error)}
    return found


def measure(file):
    """Measure what the file lacks, and write it after each scene."""
    document = json.loads(file.read_text()) if file.exists() else {"accuracy": ACCURACY}
    tasks = [("families", family, scene, 1) for family, scenes in FAMILIES.items() for scene in scenes]
    tasks += [("two ranks", None, scene, 2) for scene in TWICE] + [("sweep", None, scene, 0) for scene in SWEPT]
    for part, family, (name, size), ranks in sorted(tasks, key=lambda task: task[2] == FAMILIES["network"][-1]):
        place = document.setdefault(part, {})
        place = place.setdefault(family, {}) if family else place
        if label(name, size) in place:
            continue
        print(part, label(name, size), flush=True)
        scene = make(name, **size) if size else drawn()
        place[label(name, size)] = rows(scene, ranks) if ranks else sweep(scene)
        file.write_text(json.dumps(document, indent=1, allow_nan=False) + "\n")


def markdown(header, table):
    """Return a table, numbers to the right."""
    lines = ["| " + " | ".join(header) + " |", "| --- |" + " ---: |" * (len(header) - 1)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in table])


def cell(row, to=None):
    """Return time and memory, with the time over that of another row in brackets."""
    if total(row) is None:
        return "–"
    times = "" if to is None else f" ({total(row) / total(to):.1f})"
    return f"{quantity(total(row), 's')}{times}, {quantity(row['peak_memory_bytes'], 'B')}"


def page(document):
    """Return the page."""
    one = [
        [f"`{scene}`", f"{found['free_dofs']:,}", f"{quantity(found['latin']['setup_seconds'], 's')} + "
         f"{quantity(found['latin']['solve_seconds'], 's')}, {quantity(found['latin']['peak_memory_bytes'], 'B')}",
         str(found["latin"]["iterations"]), cell(found["latin-one"], found["latin"]),
         *(cell(found[peer], found["latin"]) for peer in PEERS)]
        for scenes in document["families"].values() for scene, found in scenes.items()
    ]  # fmt: skip
    alone = {scene: found["latin"] for scenes in document["families"].values() for scene, found in scenes.items()}
    two = [
        [f"`{scene}`", cell(found["latin"]), f"{total(alone[scene]) / total(found['latin']):.2f}",
         cell(found[PEERS[1]], found["latin"])]
        for scene, found in document["two ranks"].items()
    ]  # fmt: skip
    swept = [
        [f"`{scene}`", *("–" if total(found[str(n)]) is None else
         f"{quantity(total(found[str(n)]), 's')}, {found[str(n)]['iterations']}" for n in COUNTS)]
        for scene, found in document["sweep"].items()
    ]  # fmt: skip
    header = ["scene", "unknowns", "SNES latin: set-up + solve, memory", "stages"]
    return f"""# Irregular structures

`python benchmarks/irregular.py`: seconds and memory to a relative l2 error of 1e-4. Each method stops at its first
iterate below it, from the same arrays, one thread per rank ([how](README.md#how-it-is-measured)).

- In brackets: time relative to the default of SNES latin.
- –: no result within {TIMEOUT:.0f} s, or none at all: on the network of 60,000 nodes Newton's method meets a tangent
  stiffness that is not positive definite.
- CHOLMOD has the elimination order of SNES latin (nested dissection by coordinates), computed once, and one thread; its
  default of four takes twice the time. MUMPS calls METIS itself.
- `drawn`: the lines of an existing floor plan as a vault of two layers (drawn.py).

## One rank

{markdown([*header, "one subdomain", "Newton, CHOLMOD", "Newton, MUMPS"], one)}

![time against size](figures/irregular.png)

Irregular structures have one subdomain per rank by default. Newton's method factors three to five times, SNES latin
once: the ratio is three to five where factorisation dominates, less the time for ordering, set-up and solves. It is
larger with factors in single precision, which each linear stage corrects (`-snes_latin_precision`). Rounded from
double, they halve memory and the time of solves. On solids, such as networks, they are computed in single precision, in
half the time.

## Two ranks

{markdown(["scene", "SNES latin", "one rank over two", "Newton, MUMPS, two ranks"], two)}

## How many subdomains

One rank, this number of METIS subdomains: time, linear stages.

{markdown(["scene", *map(str, COUNTS)], swept)}
"""


def headline(document):
    """Return the table of HEADLINE between its marks."""
    found = {scene: row for scenes in document["families"].values() for scene, row in scenes.items()}
    lines = [
        [text, f"{row['free_dofs']:,}", cell(row["latin"]), *(cell(row[peer], row["latin"]) for peer in PEERS)]
        for text, row in ((text, found[scene]) for text, scene in HEADLINE.items())
    ]
    table = markdown(["structure", "unknowns", "SNES latin", "Newton, CHOLMOD", "Newton, MUMPS"], lines)
    return f"<!-- irregular -->\n{table}\n<!-- end -->"


def main():
    file = HERE / "results" / "irregular.json"
    if sys.argv[1:] != ["--page"]:
        measure(file)
    document = json.loads(file.read_text())
    (HERE / "irregular.md").write_text(page(document), encoding="utf-8")
    for path in SHOWN:
        marked = r"<!-- irregular -->\n.*?<!-- end -->"
        text = re.sub(marked, lambda _: headline(document), path.read_text(encoding="utf-8"), flags=re.DOTALL)
        path.write_text(text, encoding="utf-8")
    growth(document["families"], ("latin", "latin-one", *PEERS), HERE / "figures" / "irregular.png")


if __name__ == "__main__":
    main()
