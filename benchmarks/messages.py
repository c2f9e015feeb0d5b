"""What a linear stage sends on several ranks, and a model of its time and memory on as many as there are not here.

    python benchmarks/messages.py              measures on 1, 2, 4 and 8 ranks, and prints both tables
    python benchmarks/messages.py --ranks 64   also predicts for 64 ranks

Tensegrity grids in blocks of 4 x 4 modules, 21,000 unknowns a rank. Messages and bytes are those between two solves of
different length, all that MPI sends, MUMPS included (the component `monitoring` of Open MPI counts them). The model:

    time   = that of one rank alone
           + reductions log2(P) latency + messages latency + bytes / bandwidth of the network
           + coarse factor, twice / (P bandwidth of memory)
    memory = that of a rank here, but for the coarse factor + coarse factor / P

with the entries of the coarse factor as c C log2 C of its C rows, a plane grid's by nested dissection [A. George 1973].
Latency and bandwidth of the network are assumed, as no network is here; all else is measured or counted. Left out is
what MUMPS sends beyond 8 ranks, and that ranks wait for each other: the times are the least that can be.
"""

from __future__ import annotations

import argparse
import json
import math
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

MODULES = {1: 48, 2: 68, 4: 96, 8: 136}  # a side, on so many ranks
STAGES = (10, 30)
MANY = (64, 1000, 10000)
FIXED = [
    "-snes_latin_stop",
    "indicator",
    "-snes_stol",
    "1e-300",
    "-snes_latin_newton",
    "never",
]  # stages and nothing else
FIXED += ["-snes_latin_coarse_pc_factor_mat_solver_type", "mumps"]  # on one rank as well
LATENCY, NETWORK = 2e-6, 10e9  # of a message (s), and bytes/s of a link between nodes: InfiniBand of some years ago
HERE = Path(__file__).resolve().parent


def one(modules, stages):
    """A rank of a child: solve so many stages; rank 0 prints what they took as JSON."""
    import resource

    import petsc4py

    petsc4py.init([sys.argv[0], *FIXED, "-snes_max_it", str(stages)])
    from petsc4py import PETSc

    import latinpc

    PETSc.Log.begin()
    structure = latinpc.local_scene("tensegrity-grid", modules=modules, partition="regular")
    snes, u = structure.create_snes(), structure.create_vec()
    snes.setFromOptions()
    snes.setUp()
    start = time.perf_counter()
    snes.solve(None, u)
    seconds = time.perf_counter() - start
    comm = structure.comm.tompi4py()
    coarse = latinpc.coarse_ksp(snes).getPC().getFactorMatrix()
    counts = latinpc.statistics(snes)
    row = {
        "dofs": structure.sizes.free_dofs,
        "coarse": counts["coarse_size"],
        "coarse_entries": coarse.getMumpsInfog(29),  # of the factor, all ranks
        "seconds": seconds,
        "reductions": comm.allreduce(PETSc.Log.Event("SNESSolve").getPerfInfo()["numReductions"]) / comm.size,
        "memory": max(comm.allgather(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)) * 1024,
        "iterations": snes.getIterationNumber(),
    }
    if comm.rank == 0:
        print(json.dumps(row))


def sent(folder):
    """Return messages and bytes of the rank that sends most, from lines `E rank rank bytes messages`.

    What reductions send has lines of its own.
    """
    most = np.zeros(2)
    for file in Path(folder).glob("sent*"):
        found = re.findall(r"^E\t\d+\t\d+\t(\d+) bytes\t(\d+) msgs", file.read_text(), re.MULTILINE)
        most = np.maximum(most, np.array([[int(n), int(size)] for size, n in found]).reshape(-1, 2).sum(axis=0))
    return most


def run(ranks, stages):
    """Return the row of a child and what its ranks have sent."""
    with tempfile.TemporaryDirectory() as folder:
        watch = {
            "pml_monitoring_enable": 2,
            "pml_monitoring_enable_output": 3,
            "pml_monitoring_filename": f"{folder}/sent",
        }
        told = [word for key, value in watch.items() for word in ("--mca", key, str(value))]
        task = [sys.executable, __file__, "--one", str(MODULES[ranks]), str(stages)]
        done = subprocess.run(["mpirun", "-n", str(ranks), *told, *task], capture_output=True, text=True)
        if done.returncode:
            sys.exit(f"{ranks} ranks: {done.stderr[:400]}")
        line = next(line for line in done.stdout.splitlines() if line.startswith("{"))
        return json.loads(line), sent(folder)


def measure():
    """Return a row for each number of ranks, counts of one stage."""
    rows = {}
    for ranks in MODULES:
        (few, before), (many, after) = (run(ranks, stages) for stages in STAGES)
        stages = many["iterations"] - few["iterations"]
        messages, size = (after - before) / stages
        more = {key: (many[key] - few[key]) / stages for key in ("reductions", "seconds")}
        rows[ranks] = many | more | {"messages": messages, "bytes": size}
    return rows


def bandwidth(entries=2**25):
    """Return bytes/s that one core copies from memory, reads and writes counted."""
    a, b = np.ones(entries), np.zeros(entries)
    best = math.inf
    for _ in range(5):
        start = time.perf_counter()
        np.copyto(b, a)
        best = min(best, time.perf_counter() - start)
    return 16.0 * entries / best


def predict(rows, ranks, memory):
    """Return rows of the coarse problem, seconds of a stage by its parts, and bytes a rank."""
    last = rows[max(rows)]
    scale = ranks / max(rows)
    coarse = last["coarse"] * scale
    entries = last["coarse_entries"] * scale * math.log2(coarse) / math.log2(last["coarse"])
    network = (last["reductions"] * math.ceil(math.log2(ranks)) + last["messages"]) * LATENCY + last["bytes"] / NETWORK
    base = last["memory"] - 8.0 * last["coarse_entries"] / max(rows)
    return coarse, rows[1]["seconds"], network, 16.0 * entries / ranks / memory, base + 8.0 * entries / ranks


def main():
    """Measure, and print both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ranks", type=int, nargs="*", default=[], help="further numbers of ranks to predict for")
    parser.add_argument("--one", type=int, nargs=2, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.one:
        one(*given.one)
        return
    rows, memory = measure(), bandwidth()
    print("| ranks | unknowns | coarse | its factor, entries | reductions | messages a rank | kB a rank | MB a rank |")
    print("| ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    for ranks, row in rows.items():
        print(
            f"| {ranks} | {row['dofs']:,} | {row['coarse']:,} | {row['coarse_entries']:,} | {row['reductions']:.1f} "
            f"| {row['messages']:.0f} | {row['bytes'] / 1e3:.0f} | {row['memory'] / 1e6:.0f} |"
        )
    print(f"\none core copies {memory / 1e9:.1f} GB/s\n")
    print("| ranks | coarse | own part, ms | network, ms | coarse factor, ms | stage, ms | MB a rank |")
    print("| ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    for ranks in (*MANY, *given.ranks):
        coarse, *parts, size = predict(rows, ranks, memory)
        text = " | ".join(f"{1e3 * part:.2f}" for part in (*parts, sum(parts)))
        print(f"| {ranks:,} | {coarse:,.0f} | {text} | {size / 1e6:.0f} |")


if __name__ == "__main__":
    main()
