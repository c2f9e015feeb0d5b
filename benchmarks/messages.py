"""What a linear stage sends on several ranks, and a model of its time and memory on as many as there are not here.

    python benchmarks/messages.py              measures on 1, 2, 4 and 8 ranks, and prints both tables
    python benchmarks/messages.py --ranks 64   also predicts for 64 ranks

Tensegrity grids in blocks of 4 x 4 modules, 21,000 unknowns a rank, with the default solver of the coarse problem:
fronts of the ranks, joined in pairs. Messages and bytes are those between two solves of different length, all that MPI
sends (the component `monitoring` of Open MPI counts them). The model:

    time   = that of one rank alone
           + (reductions + 2) log2(P) latency + messages latency + bytes / bandwidth of the network
           + entries of the coarse factor that are read one after the other, twice / bandwidth of memory
    memory = that of a rank here + what the joints grow by

Ranks are strips of the grid. The n unknowns between two strips are as many as the grid is wide, so n^2 grows as P;
joints one after the other have n^2 (1/2 + 3/2 + 5/2 + 5/2 + ...) entries, n^2 (5/2 log2 P - 3) from four ranks on.
Where all ranks share a factorisation, c C log2 C entries of C rows by nested dissection [A. George 1973], it is taken
to be shared evenly and to send what the joints send: the least that can be. Latency and bandwidth of the network are
assumed, as no network is here; all else is measured or counted. Left out is that ranks wait for each other.
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
    start = time.process_time()
    snes.solve(None, u)
    seconds = time.process_time() - start
    comm = structure.comm.tompi4py()
    factor = latinpc.coarse_ksp(snes).getPC().getFactorMatrix()
    counts = latinpc.statistics(snes)
    joints, path = joined(factor) if comm.size > 1 else (0.0, 0.0)
    row = {
        "dofs": structure.sizes.free_dofs,
        "coarse": counts["coarse_size"],
        "coarse_entries": factor.getInfo()["nz_used"],  # of all ranks
        "joints": joints,
        "path": path,
        "seconds": seconds,
        "reductions": comm.allreduce(PETSc.Log.Event("SNESSolve").getPerfInfo()["numReductions"]) / comm.size,
        "memory": max(comm.allgather(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)) * 1024,
        "iterations": snes.getIterationNumber(),
    }
    if comm.rank == 0:
        print(json.dumps(row))


def joined(factor):
    """Return the entries of all joints, and of these what comes one after the other, as the factor shows itself."""
    from petsc4py import PETSc

    with tempfile.NamedTemporaryFile("r") as file:
        name = PETSc.COMM_WORLD.tompi4py().bcast(file.name)
        viewer = PETSc.Viewer().createASCII(name, comm=factor.comm)
        viewer.pushFormat(PETSc.Viewer.Format.ASCII_INFO)
        factor.view(viewer)
        viewer.destroy()
        PETSc.COMM_WORLD.Barrier()
        text = Path(name).read_text()
        PETSc.COMM_WORLD.Barrier()
    found = re.search(r"joined in pairs: (\S+) entries, of these (\S+) one after", text)
    if not found:
        sys.exit(f"the coarse problem has no fronts of the ranks: {text}")
    return float(found[1]), float(found[2])


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
        start = time.process_time()
        np.copyto(b, a)
        best = min(best, time.process_time() - start)
    return 16.0 * entries / best


def strips(ranks):
    """Return the entries of the joints of strips one after the other, in squares of the unknowns between two of two."""
    return ranks * (2.5 * math.log2(ranks) - 3.0)


def predict(rows, ranks, memory):
    """Return coarse rows, seconds of a stage by its parts, with joints and with a factor that all share, and bytes."""
    last, most = rows[max(rows)], max(rows)
    scale = ranks / most
    coarse = last["coarse"] * scale
    part = (last["coarse_entries"] - last["joints"]) / most
    path = last["path"] * strips(ranks) / strips(most)
    shared = last["joints"] * scale * math.log2(coarse) / math.log2(last["coarse"]) / ranks
    levels = (last["reductions"] + 2.0) * math.ceil(math.log2(ranks))
    network = (levels + last["messages"]) * LATENCY + last["bytes"] / NETWORK
    bytes_more = 8.0 * (min(path, shared) - last["path"])
    return {
        "coarse": coarse,
        "own": rows[1]["seconds"],
        "network": network,
        "joints": 16.0 * (part + path) / memory,
        "shared": 16.0 * (part + shared) / memory,
        "bytes": last["memory"] + bytes_more,
    }


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
    print("| ranks | unknowns | coarse | factor, entries | joints, in turn | reductions | messages | kB | MB a rank |")
    print("| ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    for ranks, row in rows.items():
        print(
            f"| {ranks} | {row['dofs']:,} | {row['coarse']:,} | {row['coarse_entries']:,.0f} "
            f"| {row['path']:,.0f} | {row['reductions']:.1f} "
            f"| {row['messages']:.0f} | {row['bytes'] / 1e3:.0f} | {row['memory'] / 1e6:.0f} |"
        )
    print(f"\none core copies {memory / 1e9:.1f} GB/s\n")
    check = rows[8]["path"] * strips(4) / strips(8)
    print(f"entries of the joints, one after the other: from 8 ranks for 4 {check:,.0f}\n")
    print("| ranks | coarse | own part, ms | network, ms | by joints, ms | shared by all, ms | stage, ms | MB a rank |")
    print("| ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    for ranks in (*MANY, *given.ranks):
        row = predict(rows, ranks, memory)
        row["stage"] = row["own"] + row["network"] + min(row["joints"], row["shared"])
        text = " | ".join(f"{1e3 * row[key]:.2f}" for key in ("own", "network", "joints", "shared", "stage"))
        print(f"| {ranks:,} | {row['coarse']:,.0f} | {text} | {row['bytes'] / 1e6:.0f} |")


if __name__ == "__main__":
    main()
