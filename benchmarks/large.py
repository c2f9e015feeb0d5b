"""Large displacements: SNES latin with its defaults, and Newton's method with a direct solver on the same object.

A saddle net, some of whose cables slacken, the same in a side wind, which slackens more of them, the same whose cables
were cut with errors of a thousandth of their length, so that slack ones are all over it, and a grid of tensegrity
modules that sags by a twentieth of its span. Newton's method has the exact Jacobian and PETSc's line search `bt`, and
the loads in as few equal increments, 1, 2, 4 ..., as it needs. One process each, on one core, which ends after
`--limit` seconds; seconds in the table are those of the processor.

    python benchmarks/large.py                                  # 300 x 300 meshes, 100 x 100 modules: an hour
    python benchmarks/large.py --side 30 60 --modules 8 16      # counts
    python benchmarks/large.py --side 60 --modules --json large.json
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

PRESTRESS = {"saddle": 100.0, "wind": 1000.0, "cut": 300.0}  # of the saddles (N)
LOADS = {"saddle": lambda size: 300.0 / size, "grid": lambda size: 1.2e5 / size**2}  # on each node (N)
LOADS["wind"] = LOADS["cut"] = LOADS["saddle"]
WIND = {"saddle": 0.0, "wind": 10.0, "cut": 0.0}  # times the load, along x
CUT = 1e-3  # standard deviation of the errors of lengths, over the length
METHODS = ("latin", "newton-mumps", "newton-cholmod")
MOST = 64  # increments of the loads
BALANCE = 1e-2  # forces that a solution leaves, of the loads: as SNES latin
STEPS = 100  # of Newton's method in an increment


def scene(name, size):
    """Make the saddle or the grid."""
    from latinpc.scenes import make

    if name in WIND:
        load = LOADS[name](size)
        made = make("saddle", side=size, prestress=PRESTRESS[name], load=load, wind=WIND[name] * load)
        return cut(made) if name == "cut" else made
    made = make("tensegrity-grid", modules=size, partition="metis", subdomains=1, load=LOADS[name](size))
    return replace(made, geometry="large", subdomain=None)


def cut(made):
    """Make cables too long or too short, each by its own error."""
    length = np.linalg.norm(np.diff(made.nodes[made.links], axis=1)[:, 0], axis=1)
    off = CUT * length * np.random.default_rng(1).standard_normal(len(length))
    return replace(made, initial_elongation=made.initial_elongation + off)


def solve(made, method):
    """Solve; return what it took, the vector and the structure."""
    from petsc4py import PETSc

    import latinpc

    start = time.process_time()
    s = latinpc.Structure.from_scene(made, PETSc.COMM_SELF)
    snes, u = s.create_snes(PETSc.COMM_SELF), s.create_vec()
    row = {"method": method, "dofs": u.getSize()}
    if method == "latin":
        snes.setFromOptions()
        snes.solve(None, u)
        newton = snes.getLinearSolveIterations()
        row |= {"increments": 1, "stages": snes.getIterationNumber() - newton, "iterations": newton}
        row |= {"factorisations": 1 + latinpc.path(snes)["renewals"], "converged": snes.getConvergedReason() > 0}
    else:
        row |= by_newton(made, s, snes, u, method.split("-")[1])
    row["seconds"] = time.process_time() - start
    tensions = s.tensions(u)
    row["slack"] = float(np.mean(tensions[made.law == 1] <= 0.0))
    row["sag"] = float(np.linalg.norm(s.displacements(u), axis=1).max() / np.ptp(made.nodes[:, 0]))
    return row, u, s


def by_newton(made, s, snes, u, package):
    """Newton's method, in twice the increments wherever one fails."""
    from petsc4py import PETSc

    snes.setType("newtonls")
    snes.getKSP().setType("preonly")
    snes.getKSP().getPC().setType("cholesky")
    snes.getKSP().getPC().setFactorSolverType(package)
    snes.setTolerances(rtol=1e-6, max_it=STEPS)
    snes.setFromOptions()
    steps, increments = 0, 1
    while increments <= MOST:
        u.set(0.0)
        for k in range(1, increments + 1):
            s.set_load(made.load * (k / increments))
            try:
                snes.solve(None, u)
            except PETSc.Error:  # a factor that broke down
                break
            steps += snes.getIterationNumber()
            if snes.getConvergedReason() <= 0:
                break
        else:
            if snes.getFunctionNorm() <= BALANCE * np.linalg.norm(
                made.load
            ):  # the search may have cut steps to nothing
                return {"increments": increments, "factorisations": steps, "converged": True}
        increments *= 2
    return {"increments": increments // 2, "factorisations": steps, "converged": False}


def one(name, size, method, file):
    """A child: print what it took as JSON, write the displacements."""
    import petsc4py

    petsc4py.init([sys.argv[0]])
    row, u, s = solve(scene(name, size), method)
    np.save(file, s.displacements(u))
    print(json.dumps(row))


def measure(name, size, folder, limit=300.0):
    """Each method in a process of its own, for at most `limit` seconds; differences are from SNES latin."""
    rows, first = [], None
    for method in METHODS:
        file = Path(folder) / f"{method}.npy"
        command = [sys.executable, __file__, "--one", name, str(size), method, str(file)]
        failed = {"scene": name, "size": size, "method": method, "converged": False}
        environment = os.environ | {"OMP_NUM_THREADS": "1"}
        try:
            done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=limit)
        except subprocess.TimeoutExpired:
            rows.append(failed | {"why": f"more than {limit:g} s"})
            continue
        if done.returncode:
            rows.append(failed | {"why": "failed", "message": done.stderr[-200:]})
            continue
        row = {"scene": name, "size": size} | json.loads(done.stdout.splitlines()[-1])
        u = np.load(file)
        first = u if first is None else first
        row["difference"] = float(np.linalg.norm(u - first) / np.linalg.norm(first))
        rows.append(row)
    return rows


def table(rows):
    """Return the lines of a table."""
    lines = ["| structure | free dofs | slack | sag | method | increments | factorisations | stages + CG | time | u |"]
    lines.append("| --- | ---: | ---: | ---: | --- | ---: | ---: | ---: | ---: | ---: |")
    for row in rows:
        head = f"| {row['scene']}, {row['size']} x {row['size']} |"
        if "seconds" not in row:
            lines.append(f"{head} | | | {row['method']} | | | | {row['why']} | |")
            continue
        work = f"{row['stages']} + {row['iterations']}" if "stages" in row else ""
        end = f"{row['seconds']:.3g} s | {row['difference']:.0e}" if row["converged"] else "did not converge |"
        lines.append(
            f"{head} {row['dofs']} | {100 * row['slack']:.1f} % | {row['sag']:.3f} | {row['method']} | "
            f"{row['increments']} | {row['factorisations']} | {work} | {end} |"
        )
    return lines


def main():
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--side", type=int, nargs="*", default=[300], help="meshes along the side of the saddles")
    parser.add_argument("--modules", type=int, nargs="*", default=[100], help="modules along the side of the grid")
    parser.add_argument("--limit", type=float, default=300.0, help="most seconds of a method (default 300)")
    parser.add_argument("--json", type=Path, help="write the rows to this file")
    parser.add_argument("--one", nargs=4, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.one:
        name, size, method, file = chosen.one
        one(name, int(size), method, file)
        return
    import tempfile

    import petsc4py

    petsc4py.init([sys.argv[0]])
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for name, sizes in (
            ("saddle", chosen.side),
            ("wind", chosen.side),
            ("cut", chosen.side),
            ("grid", chosen.modules),
        ):
            for size in sizes:
                rows += measure(name, size, folder, chosen.limit)
    print("\n".join(table(rows)))
    if chosen.json:
        chosen.json.write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
