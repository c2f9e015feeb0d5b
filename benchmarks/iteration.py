"""Where a set-up and an iteration spend their time, and how far an iteration is from the speed of memory.

python benchmarks/iteration.py [modules]   writes benchmarks/results/iteration-<modules>.json and prints the table

The bound is the time to touch once, at the triad bandwidth of this machine (VecWAXPY on vectors that no cache holds),
the factors of the subdomains and of the coarse problem, the links and the state, read and written. Factors that
subdomains share count once.
"""

import json
import sys
import time
from pathlib import Path

import petsc4py

petsc4py.init(sys.argv[:1])

from petsc4py import PETSc  # noqa: E402

import latinpc  # noqa: E402
from latinpc.scenes import make  # noqa: E402

LINK = {dim: 2 * 4 + 8 * dim + 8 + 8 + 4 for dim in (1, 2, 3)}  # ends, direction, stiffness, initial_elongation, law
EVENTS = {
    "LatinLocal": "local stage", "LatinCondense": "condensed forces", "LatinCoarse": "coarse problem",
    "LatinLinear": "relocalisation, local solves", "SNESFunctionEval": "all of G(z)", "SNESSolve": "all",
}  # fmt: skip


SETUP = {
    "LatinSubdomains": "subdomains", "LatinInterface": "interfaces", "LatinDirection": "search directions",
    "LatinMacro": "macro bases", "LatinLinear": "local operators", "LatinCondense": "condensation",
    "LatinCoarse": "coarse problem", "LatinSetUp": "all of the method", "SNESSetUp": "all, with the outer vectors",
}  # fmt: skip


def bandwidth(n=20_000_000, repeat=5):
    """Return the triad bandwidth (bytes/s): two vectors read, one written."""
    x, y, w = (PETSc.Vec().createSeq(n) for _ in range(3))
    x.set(1.0), y.set(2.0), w.set(0.0)
    best = min(_timed(w.waxpy, 3.0, x, y) for _ in range(repeat))
    return 3 * 8 * n / best


def _timed(f, *args):
    start = time.perf_counter()
    f(*args)
    return time.perf_counter() - start


def factor_bytes(snes, subdomains):
    """Return the bytes of the factors of the subdomains, shared ones once, and of the coarse problem."""
    distinct = {k.handle: k for k in (latinpc.local_ksp(snes, i) for i in range(subdomains))}
    entries = [k.getPC().getFactorMatrix().getInfo()["nz_used"] for k in distinct.values()]
    return 8 * sum(entries), 8 * latinpc.coarse_ksp(snes).getPC().getFactorMatrix().getInfo()["nz_used"]


def profile_setup(scene, repeat=3):
    """Return the milliseconds of a set-up by event, from the arrays on; the quickest of some."""
    best = None
    for k in range(repeat):
        stage = PETSc.Log.Stage(f"set-up {k}")
        stage.push()
        start = time.perf_counter()
        structure = latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF)
        found = {"links, DMPLEX": 1e3 * (time.perf_counter() - start)}
        snes = structure.create_snes()
        snes.setFromOptions()
        snes.setUp()
        stage.pop()
        found |= {label: 1e3 * PETSc.Log.Event(name).getPerfInfo(stage.id)["time"] for name, label in SETUP.items()}
        snes.destroy()
        if best is None or sum(found.values()) < sum(best.values()):
            best = found
    return best


def measure(scene, repeat=3):
    """Return the profile of one scene: milliseconds of the set-up and of an iteration by event, and the bound."""
    PETSc.Log.begin()
    setup = profile_setup(scene, repeat)
    structure = latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF)
    PETSc.Options().setValue("snes_stol", 1e-4)
    snes = structure.create_snes()
    snes.setFromOptions()
    u = structure.create_vec()
    snes.solve(None, u)
    best = None
    for k in range(repeat):
        stage = PETSc.Log.Stage(f"iterations {k}")
        stage.push()
        snes.solve(None, u)
        stage.pop()
        n = snes.getIterationNumber()
        found = {label: 1e3 * PETSc.Log.Event(name).getPerfInfo(stage.id)["time"] / n for name, label in EVENTS.items()}
        if best is None or found["all"] < best["all"]:
            best = found
    sizes = latinpc.statistics(snes)
    local, coarse = factor_bytes(snes, sizes["subdomains"])
    parts = {
        "local factors": local, "coarse factor": coarse, "links": len(scene.links) * LINK[scene.nodes.shape[1]],
        "state": 2 * 8 * sizes["state_size"],
    }  # fmt: skip
    rate = bandwidth()
    bound = 1e3 * sum(parts.values()) / rate
    return {
        "setup": setup,
        "milliseconds": best,
        "bytes": parts,
        "bandwidth": rate,
        "bound": bound,
        "ratio": best["all"] / bound,
    }


def main():
    modules = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    document = {
        "regular": measure(make("tensegrity-grid", modules=modules)),
        "metis": measure(make("tensegrity-grid", modules=min(modules, 96), partition="metis")),
    }
    file = Path(__file__).resolve().parent / "results" / f"iteration-{modules}.json"
    file.write_text(json.dumps(document, indent=1) + "\n")
    for name, found in document.items():
        print(name, json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
