"""Iterations as cables slacken, from none to the load under which a structure takes off.

python benchmarks/slack.py      writes benchmarks/results/slack.json and the figure; minutes

Two structures whose slack share only grows to a limit, however large the loads, and a girder hung from cables that an
uplift relieves: when the resultant of its loads reaches the first cable, at the factor 1, nothing balances it any more.
Linear stages until the relative l2 error stays below 1e-4, without Newton's method; then what SNES latin does itself.
"""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

from run import RESULTS

from latinpc import Structure
from latinpc.bench.extremes import catalogue
from latinpc.bench.peers import run
from latinpc.bench.peers.reference import by_newton
from latinpc.options import default_options
from latinpc.scenes import Law, make

ACCURACY, MOST = 1e-4, 1000
GROWING = (0.3, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0, 100.0, 1e4)
RELIEVED = (0.0, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99, 0.999, 1.01)
OUTER = {"anderson": {}, "plain": {"snes_latin_outer_snes_type": "nrichardson"}}


def girder(cells=64, height=4, block=4):
    """Return a girder of bars hung from a cable at each upper node, and the uplift that ends its balance (N)."""
    scene, relieved = (catalogue.girder(uplift, cells, height) for uplift in (0.0, 1.0))
    cable = scene.law == Law.CABLE
    stretched = np.where(cable, np.random.default_rng(0).uniform(0.0, 2e-3, len(cable)), 0.0)
    part = np.minimum(scene.nodes[scene.links].min(axis=1)[:, 0] // block, cells // block - 1).astype(int)
    return replace(scene, initial_elongation=stretched, subdomain=part), relieved.load - scene.load


def cases():
    """Yield the name of a structure, a load factor, and the scene."""
    for name, size in (("tensegrity-grid", {"modules": 24}), ("lattice", {"nx": 32, "ny": 16})):
        for factor in GROWING:
            scene = make(name, **size)
            scene.load = scene.load * factor
            yield name, factor, scene
    for factor in RELIEVED:
        scene, uplift = girder()
        scene.load = scene.load + factor * uplift
        yield "girder", factor, scene


def slack_share(scene, u):
    """Return the share of cables without tension."""
    a, b = scene.links.T
    along = scene.nodes[b] - scene.nodes[a]
    along /= np.linalg.norm(along, axis=1)[:, None]
    strain = np.einsum("ij,ij->i", u[b] - u[a], along) + scene.initial_elongation
    return float(np.mean(strain[scene.law == Law.CABLE] <= 0.0))


def stages(scene, reference, options):
    """Return the linear stages after which the error stays below the accuracy, or None."""
    bare = {"snes_latin_newton": "never", "snes_max_it": MOST, "snes_divergence_tolerance": -1}
    outcome = run.solve("latin", scene, None, bare | options, reference=reference, accuracy=ACCURACY)
    below = [i for i, (_, error) in enumerate(outcome.history, 1) if error <= ACCURACY]
    return below[0] if below else None


def by_itself(scene, reference):
    """Return what SNES latin says with its defaults, and its error."""
    structure = Structure.from_scene(scene)
    snes, u = structure.create_snes(), structure.create_vec()
    with default_options({}):
        snes.setFromOptions()
    snes.solve(None, u)
    error = None
    if reference is not None:
        error = float(np.linalg.norm(structure.displacements(u) - reference) / np.linalg.norm(reference))
    return {"stages": snes.getIterationNumber(), "reason": int(snes.reason), "error_l2": error}


def main():
    rows = []
    for name, factor, scene in cases():
        reference = None
        if not (name == "girder" and factor >= 1.0):
            reference = by_newton(scene, ACCURACY)[0]
        row = {"scene": name, "factor": factor, "slack": None if reference is None else slack_share(scene, reference)}
        row["default"] = by_itself(scene, reference)
        row["stages"] = {
            f"{variant}, {outer}": stages(scene, reference, {"snes_latin_variant": variant} | more)
            for variant in ("corner", "macro", "none")
            for outer, more in OUTER.items()
            if reference is not None
        }
        rows.append(row)
        print(name, factor, row["slack"], row["default"], list(row["stages"].values()), flush=True)
    document = {"accuracy": ACCURACY, "most": MOST, "rows": rows}
    (RESULTS / "slack.json").write_text(json.dumps(document, indent=1, allow_nan=False) + "\n")


if __name__ == "__main__":
    main()
