"""Iterations against the search direction: each type, a sweep of its fraction, scenes regular and irregular.

python benchmarks/directions.py            writes benchmarks/results/directions.json and prints a table
"""

import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import run

#: The default fraction of each type.
FRACTION = {"diagonal": 0.08, "block": 0.25, "schur": 1.0}
FACTORS = (1 / 8, 1 / 4, 1 / 2, 1 / 1.4, 1, 1.4, 2, 4, 8)
SCENES = ("tensegrity-grid 12", "tensegrity-grid 24", "tensegrity-grid 48", "truss-grid 24", "tensegrity-grid 24 metis",
          "truss-grid 24 metis", "network 1000", "lattice 64 x 32")  # fmt: skip


def main():
    found = {}
    print("| direction | fraction |", " | ".join(SCENES), "|")
    for direction, default in FRACTION.items():
        for factor in FACTORS:
            options = {"snes_latin_direction": direction, "snes_latin_direction_value": factor * default}
            counts = {name: run.count(name, {**options, "snes_max_it": 200}) for name in SCENES}
            found[f"{direction} {factor * default:.3g}"] = counts
            cells = (" / ".join(str(value or "–") for value in counts[name].values()) for name in SCENES)
            print(f"| {direction} | {factor * default:.3g} |", " | ".join(cells), "|", flush=True)
    (run.RESULTS / "directions.json").write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
