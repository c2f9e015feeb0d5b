"""Run the benchmarks: measurements to benchmarks/results/*.json.

    make bench                all that is short: 48 x 48 modules
    make bench BENCH=full     200 x 200 and 400 x 400 modules too

or, for some of them: python benchmarks/run.py compare-48 presets-48
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
import effectivity  # noqa: E402

RESULTS = HERE / "results"
COMMAND = [sys.executable, "-P", "-c", "from latinpc.cli import main; main()"]
PRESETS = {"fast": ("latin", 1e-2), "balanced": ("latin", 1e-4), "accurate": ("latin", 1e-8)}

LARGE = "latin,latin-rigid,newton-cholmod,newton-mumps,newton-gamg,newton-latin"
GRID = ["tensegrity-grid", "--modules"]
SHORT = {
    "compare-48": ["compare", *GRID, "48", "--repeat", "5"],
    "tradeoff-48": ["tradeoff", *GRID, "48", "--repeat", "3"],
    "presets-48": 48,
    "counts": None,
    "extremes": ["extremes"],
}
FULL = {
    "compare-200": ["compare", *GRID, "200", "--methods", LARGE, "--repeat", "3"],
    "presets-200": 200,
    "effectivity": None,
    "compare-400": ["compare", *GRID, "400", "--methods", "latin,latin-rigid,newton-cholmod,newton-mumps",
                    "--repeat", "1", "--timeout", "1800"],
}  # fmt: skip

#: Scenes whose iterations are counted, with the accuracies.
COUNTED = {
    **{f"tensegrity-grid {n}": ("tensegrity-grid", {"modules": n}, (1e-2, 1e-3, 1e-4)) for n in (12, 24, 48, 96)},
    **{f"truss-grid {n}": ("truss-grid", {"modules": n}, (1e-4, 1e-8)) for n in (12, 24, 48, 96)},
    "tensegrity-grid 24 metis": ("tensegrity-grid", {"modules": 24, "partition": "metis"}, (1e-3, 1e-4)),
    "truss-grid 24 metis": ("truss-grid", {"modules": 24, "partition": "metis"}, (1e-4,)),
    "network 1000": ("network", {"nodes": 1000}, (1e-4,)),
    "lattice 64 x 32": ("lattice", {"nx": 64, "ny": 32}, (1e-4,)),
}


def count(name, options=None):
    """Return the linear stages that SNES latin needs, by default or with other options, per accuracy of a scene."""
    from latinpc.bench.peers import run
    from latinpc.bench.peers.reference import by_newton
    from latinpc.scenes import make

    scene_name, size, accuracies = COUNTED[name]
    scene = make(scene_name, **size)
    # METIS: as many subdomains as the regular grid would have
    more = {"snes_latin_subdomains": 36} if size.get("partition") == "metis" else {}
    reference, _ = by_newton(scene, min(accuracies))
    outcome = run.solve("latin", scene, None, more | (options or {}), reference=reference, accuracy=min(accuracies))
    found = {}
    for accuracy in accuracies:
        reached = [i for i, (_, error) in enumerate(outcome.history, 1) if error <= accuracy]
        found[f"{accuracy:.0e}"] = reached[0] if reached else None
    return found


def latinpc(*arguments):
    """Run the command line with a JSON file, in a process of its own; return what it wrote."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "out.json"
        subprocess.run([*COMMAND, *map(str, arguments), "--json", str(file)], check=False, stdout=subprocess.DEVNULL)
        return json.loads(file.read_text())


def presets(modules, repeat=3):
    """Run the three presets; medians. Those of SNES latin stop by themselves, as a user runs them."""
    rows = []
    for name, (method, accuracy) in PRESETS.items():
        file = HERE.parent / "options" / f"{name}.opts"
        chosen = ["--methods", method, "--accuracy", accuracy, "--repeat", repeat]
        document = latinpc("compare", *GRID, modules, *chosen, "-options_file", file)
        rows.append({"preset": name, "accuracy": accuracy, **document["rows"][0]})
    return {"modules": modules, "repeat": repeat, "rows": rows}


def perform(name, what):
    """Run one benchmark; return its document."""
    if name == "counts":
        return {scene: count(scene) for scene in COUNTED}
    if name == "effectivity":
        return effectivity.document()
    if isinstance(what, int):
        return presets(what)
    return {**latinpc(*what), "command": " ".join(["latinpc", *what])}


def main():
    known = {**SHORT, **FULL}
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help=f"some of {', '.join(known)}")
    parser.add_argument("--full", action="store_true", help="the large ones too")
    given = parser.parse_args()
    unknown = [name for name in given.names if name not in known]
    if unknown:
        parser.error(f"no benchmark {unknown[0]}: choose from {', '.join(known)}")
    RESULTS.mkdir(exist_ok=True)
    for name in given.names or (known if given.full else SHORT):
        print(name, flush=True)
        document = perform(name, known[name])
        (RESULTS / f"{name}.json").write_text(json.dumps(document, indent=1, allow_nan=False) + "\n")


if __name__ == "__main__":
    main()
