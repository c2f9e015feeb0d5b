"""What it costs to be told that there is no equilibrium, beside solves of the same structure.

    python benchmarks/refusals.py                      # the table of refusals.md; half an hour
    python benchmarks/refusals.py --nodes 300 600      # a part of it
    python benchmarks/refusals.py --json FILE          # goes on where FILE ends

The same nodes, links and supports in four states: as the scene is made ("holds": prestress, 9 % of the cables slack),
and cut loose, where three links in five have become cables without prestress: under loads that random admissible
tensions bear ("slack": some cables slacken); under the loads of the scene ("loose"); and with bars again at all nodes
that their own links do not hold ("parts"), so that only larger parts are loose, or none. Seconds of the processor for
set-up and solve, the mesh made before; each in a process of its own.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

NODES, SEEDS = (300, 600, 2000, 7000, 20000), (101, 102, 103)
FAMILIES, CUT = ("network", "grid"), 0.6  # share of the links that become cables
UNBOUNDED = -9  # SNES_DIVERGED_DTOL
STATES = ("holds", "slack", "loose", "parts")


def whole(family, nodes, seed):
    """Return a network or a grid of modules."""
    from latinpc.scenes import make

    if family == "network":
        return make("network", nodes=nodes, seed=seed)
    return make("tensegrity-grid", modules=4 * round((nodes / 3.0) ** 0.5 / 4.0))


def cut(scene, seed):
    """Make a share of the links cables without prestress."""
    from latinpc.scenes import Law

    law = np.where(np.random.default_rng(seed).random(len(scene.links)) < CUT, Law.CABLE, scene.law)
    return replace(scene, law=law, initial_elongation=0.0 * scene.initial_elongation)


def borne(scene, seed):
    """Give the scene loads of random tensions that its cables admit, a fifth of them without tension."""
    from latinpc.bench.peers.qp import kinematics
    from latinpc.scenes import Law

    rng = np.random.default_rng(seed)
    cable = scene.law == Law.CABLE
    tension = rng.random(len(cable)) * np.where(
        cable, rng.random(len(cable)) < 0.8, rng.choice([-1.0, 1.0], len(cable))
    )
    load = np.zeros(scene.load.shape)
    load[~scene.fixed] = kinematics(scene)[0].T @ tension
    return replace(scene, load=load * np.linalg.norm(scene.load) / np.linalg.norm(load))


def held(scene):
    """Make the links bars at each node that they do not hold by themselves, by non-negative least squares."""
    from scipy.optimize import nnls

    from latinpc.scenes import Law

    law, at = scene.law.copy(), [[] for _ in scene.nodes]
    for link, (first, second) in enumerate(scene.links):
        at[first].append((link, 1.0))
        at[second].append((link, -1.0))
    for node in np.flatnonzero(scene.load.any(axis=1)):
        links, signs = (np.array(part) for part in zip(*at[node], strict=True))
        pulls = signs[:, None] * scene.directions[links.astype(int)]
        bars = pulls[law[links.astype(int)] == Law.BAR]
        free = ~scene.fixed[node]
        if nnls(np.vstack([pulls, -bars]).T[free], -scene.load[node][free])[1] > 1e-9 * np.linalg.norm(
            scene.load[node]
        ):
            law[links.astype(int)] = Law.BAR
    return replace(scene, law=law)


def solve(family, nodes, seed, state):
    """Solve one structure; return what it took."""
    import petsc4py

    petsc4py.init(sys.argv[:1] + sys.argv[3:])
    import latinpc

    scene = whole(family, nodes, seed)
    if state != "holds":
        scene = cut(scene, seed)
        scene = borne(scene, seed) if state == "slack" else held(scene) if state == "parts" else scene
    structure = latinpc.Structure.from_scene(scene)
    snes, u = structure.create_snes(), structure.create_vec()
    snes.setFromOptions()
    start = time.process_time()
    snes.setUp()
    snes.solve(None, u)
    seconds = time.process_time() - start
    newton = snes.getLinearSolveIterations()
    return {"nodes": len(scene.nodes), "unknowns": u.getSize(), "seconds": seconds, "reason": int(snes.reason),
            "stages": snes.getIterationNumber() - newton, "newton": newton,
            "loose": int(latinpc.unsupported_nodes(snes)[0])}  # fmt: skip


def alone(*task):
    """Solve in a process of its own."""
    words = [sys.executable, __file__, "--task", json.dumps(task)]
    return json.loads(subprocess.run(words, check=True, capture_output=True, text=True).stdout.splitlines()[-1])


def measure(families, nodes, seeds, states, file):
    """Return what was measured, by structure and state; the file keeps it."""
    rows = json.loads(file.read_text()) if file and file.exists() else {}
    for task in [(f, n, s, state) for n in nodes for f in families for s in seeds for state in states]:
        key = " ".join(map(str, task))
        if key not in rows:
            rows[key] = alone(*task)
            print(key, rows[key], file=sys.stderr, flush=True)
            if file:
                file.write_text(json.dumps(rows, indent=1) + "\n")
    return rows


def cell(rows, state, base):
    """Return the seconds of the refusals of a state, median, and the median and largest ratio to a solve."""
    pairs = [(row[state], row[base]) for row in rows if state in row and base in row]
    pairs = [
        (one["seconds"], other["seconds"]) for one, other in pairs if one["reason"] == UNBOUNDED and other["reason"] > 0
    ]
    if not pairs:
        return "–"
    ratios = [one / other for one, other in pairs]
    return f"{np.median([one for one, _ in pairs]):.2g} s, {np.median(ratios):.1f} ({max(ratios):.1f})"


def table(rows):
    """Return the table in Markdown."""
    lines = ["| structure | unknowns | holds | slack | loose: time, times holds (most) | times slack | parts: time,"
             " times holds (most) |", "| --- |" + " ---: |" * 6]  # fmt: skip
    groups = {}
    for key, row in rows.items():
        family, nodes, seed, state = key.split()
        groups.setdefault((family, nodes), {}).setdefault(seed, {})[state] = row
    for (family, _), seeds in groups.items():
        found = list(seeds.values())
        solved = [[row[state]["seconds"] for row in found if state in row] for state in STATES[:2]]
        solved = [f"{np.median(seconds):.2g} s" if seconds else "–" for seconds in solved]
        beside = cell(found, "loose", "slack").split(", ")[-1]
        first, parts = found[0]["holds"], cell(found, "parts", "holds")
        cells = [
            f"{family}, {first['nodes']:,} nodes",
            f"{first['unknowns']:,}",
            *solved,
            cell(found, "loose", "holds"),
        ]
        lines.append("| " + " | ".join([*cells, beside, parts]) + " |")
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--families", nargs="+", default=FAMILIES, choices=FAMILIES)
    parser.add_argument("--nodes", nargs="+", type=int, default=NODES)
    parser.add_argument("--seeds", nargs="+", type=int, default=SEEDS)
    parser.add_argument("--states", nargs="+", default=STATES, choices=STATES)
    parser.add_argument("--task", type=json.loads, help=argparse.SUPPRESS)
    parser.add_argument("--json", type=Path, help="file that keeps what is measured")
    given, _ = parser.parse_known_args()  # the rest is for PETSc
    if given.task:
        print(json.dumps(solve(*given.task)))
    else:
        print(table(measure(given.families, given.nodes, given.seeds, given.states, given.json)))


if __name__ == "__main__":
    main()
