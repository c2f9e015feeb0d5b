"""Time and size of a state of a long run, in PETSc's binary format and in HDF5.

Run:  python benchmarks/states.py [MODULES ...]        (on several ranks: mpirun -n 2 ...)

Prints the rows of the table in benchmarks/motions.md: medians of nine writes and of nine reads, in turn. A write ends
when the disk has the bytes.
"""

import statistics
import sys
import tempfile
import time
from pathlib import Path

import petsc4py

petsc4py.init(sys.argv[:1])

from petsc4py import PETSc  # noqa: E402

import latinpc  # noqa: E402
from latinpc.options import default_options  # noqa: E402
from latinpc.scenes import make  # noqa: E402

FILES = ("state", "state.h5")
ROUNDS = 9


def measure(modules, folder):
    """Seconds of writes and reads and bytes of both formats, after a few iterations on the grid."""
    comm = PETSc.COMM_WORLD.tompi4py()
    structure = latinpc.Structure.from_scene(make("tensegrity-grid", modules=modules))
    found = {file: {"write": [], "read": []} for file in FILES}
    with default_options({"snes_max_it": 3}):
        snes, u = structure.create_snes(), structure.create_vec()
        snes.setFromOptions()
        snes.solve(None, u)
        for _ in range(ROUNDS):
            for file in FILES:
                for what, call in ("write", latinpc.save_state), ("read", latinpc.load_state):
                    comm.barrier()
                    start = time.perf_counter()
                    call(snes, folder / file, u)
                    found[file][what].append(time.perf_counter() - start)
    for file in FILES:
        found[file] = {what: statistics.median(values) for what, values in found[file].items()}
        found[file]["bytes"] = (folder / file).stat().st_size
    return found


def main():
    """Print a row for each size and format."""
    comm = PETSc.COMM_WORLD.tompi4py()
    for modules in map(int, sys.argv[1:] or (48, 200)):
        folder = Path(comm.bcast(tempfile.mkdtemp(dir=".") if comm.rank == 0 else None))
        found = measure(modules, folder)
        if comm.rank == 0:
            for file in FILES:
                row, kind = found[file], "HDF5" if file.endswith("h5") else "binary"
                print(
                    f"| {modules} x {modules} | {kind} | {row['bytes'] / 1e6:.1f} MB "
                    f"| {1e3 * row['write']:.0f} ms | {1e3 * row['read']:.0f} ms |",
                    flush=True,
                )
                (folder / file).unlink()
            folder.rmdir()


if __name__ == "__main__":
    main()
