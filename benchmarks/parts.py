"""Peak memory of each rank, time and iterations of a tensegrity grid that no rank has whole.

    mpirun -n 8 python benchmarks/parts.py --modules 284 --partition regular
    mpirun -n 8 python benchmarks/parts.py --modules 284 --partition metis

90,000 unknowns a rank: 100 modules a side on one rank, 140 on two, 200 on four, 284 on eight. With --whole every rank
passes the whole arrays. Processor seconds are those of the slowest rank and of all, waiting in MPI among them. With
--write FOLDER each rank writes its part for parts.c, and nothing is solved.
"""

import argparse
import resource
import sys
import time
from pathlib import Path

import petsc4py

petsc4py.init(sys.argv)
import numpy as np  # noqa: E402
from petsc4py import PETSc  # noqa: E402

import latinpc  # noqa: E402
from latinpc.scenes import make  # noqa: E402


def peak(comm):
    """Peak resident memory of each rank so far (MB); collective."""
    return [round(kilobytes / 1024) for kilobytes in comm.allgather(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)]


def processor(comm, before):
    """Return the processor seconds of the slowest rank and of all since then, as text; collective."""
    seconds = comm.allgather(time.process_time() - before)
    return f"{max(seconds):.2f} and {sum(seconds):.2f} s of processors"


def write(structure, folder):
    """Write the part of this rank as parts.c reads it."""
    comm = PETSc.COMM_WORLD
    sizes = [structure.nodes.shape[1], len(structure.nodes), structure.sizes.nodes, len(structure.links)]
    with open(folder / f"part-{comm.rank}-of-{comm.size}", "wb") as file:
        for values, kind in (
            (sizes, PETSc.IntType),
            (structure.nodes, PETSc.RealType),
            (structure.load, PETSc.RealType),
            (structure.fixed, np.int8),
            (structure.links, PETSc.IntType),
            (structure.law, PETSc.IntType),
            (structure.stiffness, PETSc.RealType),
            (structure.initial_elongation, PETSc.RealType),
        ):
            np.asarray(values, kind).tofile(file)


def main():
    """Solve, and print a line for each stage."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--modules", type=int, default=100)
    parser.add_argument("--partition", choices=("regular", "metis"), default="regular")
    parser.add_argument("--whole", action="store_true")
    parser.add_argument("--write", type=Path, metavar="FOLDER")
    given, _ = parser.parse_known_args()
    options = {"modules": given.modules, "partition": given.partition}
    PETSc.Log.begin()
    comm = PETSc.COMM_WORLD.tompi4py()
    say = PETSc.Sys.Print
    if given.whole:
        structure = latinpc.Structure.from_scene(make("tensegrity-grid", **options))
    else:
        structure = latinpc.local_scene("tensegrity-grid", **options)
    if given.write:
        return write(structure, given.write)
    say(f"{structure.sizes.free_dofs} unknowns, {comm.size} ranks, {given.partition}")
    say("  structure: MB a rank", *peak(comm))
    snes = structure.create_snes()
    snes.setFromOptions()
    comm.barrier()
    start, used = time.perf_counter(), time.process_time()
    snes.setUp()
    comm.barrier()
    seconds, text = time.perf_counter() - start, processor(comm, used)
    partition = comm.allreduce(PETSc.Log.Event("LatinPartition").getPerfInfo()["time"]) / comm.size
    subdomains = latinpc.statistics(snes)["subdomains"]
    say(
        f"  set-up: {seconds:.1f} s, {text}, {partition:.2f} s partition; {subdomains} subdomains; MB a rank",
        *peak(comm),
    )
    u = structure.create_vec()
    start, used = time.perf_counter(), time.process_time()
    snes.solve(None, u)
    seconds, text = time.perf_counter() - start, processor(comm, used)
    count, reason = snes.getIterationNumber(), snes.getConvergedReason()
    say(f"  solve: {seconds:.1f} s, {text}, {count} iterations, reason {reason}; MB a rank", *peak(comm))


if __name__ == "__main__":
    main()
