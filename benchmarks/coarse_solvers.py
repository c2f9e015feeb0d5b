"""Solvers of the coarse problem and of interiors: what they cost as the number of subdomains grows.

    python benchmarks/coarse_solvers.py                   writes results/coarse-solvers.json, fills in coarse-solvers.md
    python benchmarks/coarse_solvers.py truss-grid        one of the tables anew
    python benchmarks/coarse_solvers.py --tables          the page from the results that are there

Conjugate gradients with PC latin to a relative residual of 1e-8. Each case is a process of its own, so that its peak
memory is its own; seconds are those of the processor, for the machine may have other work.
"""

import argparse
import itertools
import json
import re
import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
RESULT, PAGE = HERE / "results" / "coarse-solvers.json", HERE / "coarse-solvers.md"

LATIN = {"coarse_pc_type": "latin"}
GAMG = {"coarse_pc_type": "gamg", "coarse_pc_gamg_aggressive_coarsening": 0}
DIAGONAL = {"direction": "diagonal"}

#: What solves the coarse problem; the first one, for its memory alone, has next to none of its own.
COARSE = {
    "jacobi": {"coarse_pc_type": "jacobi"},
    "direct, repeated groups": {},
    "gamg": GAMG,
}
#: Subdomains a side of each growth table.
GROWTH = {
    "truss-grid": [25, 50, 100],
    "lattice 3D": [4, 8],
}
#: Solvers of the coarse problem on several ranks.
LEVELS = {
    "direct": {},
    "gamg": GAMG,
    "bddc": {"coarse_pc_type": "bddc", "coarse_pc_bddc_use_change_of_basis": True},
    "latin": LATIN,
}
STRUCTURES = {
    "truss grid, 625 subdomains": ("truss-grid", 25),
    "truss grid, 2,500 subdomains": ("truss-grid", 50),
    "bars in 3D, 64 subdomains": ("lattice 3D", 4),
    "bars in 3D, 512 subdomains": ("lattice 3D", 8),
}
#: Solvers of interiors and of the coarse problem.
APPROXIMATE = {
    "direct, Schur complements": {},
    "direct, diagonal": DIAGONAL,
    "interiors ICC": DIAGONAL | {"interior_pc_type": "icc"},
    "interiors GAMG": DIAGONAL | {"interior_pc_type": "gamg"},
    "coarse MUMPS, low rank 1e-4": {"coarse_mat_mumps_icntl_35": 1, "coarse_mat_mumps_cntl_7": 1e-4},
}
SCENES = {
    "Poisson, 2D, 4 x 64 x 64 cells": ("poisson", 2, 128, "2,2"),
    "Poisson, 3D, 4 x 24 x 12 x 12 cells": ("poisson", 3, 24, "1,2,2"),
    "Poisson, 3D, 4 x 48 x 24 x 24 cells": ("poisson", 3, 48, "1,2,2"),
    "elasticity, 3D, 4 x 16 x 8 x 8 cells": ("elasticity", 3, 16, "1,2,2"),
    "truss grid, 4 x 16 x 16 modules": ("truss", 3, 32, "4"),
}


# ---- scenes ----------------------------------------------------------------------------------
def lattice_3d(side, cells=2):
    """Make a cube of bars along edges and face diagonals, side^3 blocks; the face x = 0 is held."""
    from latinpc.scenes import Law, Scene

    n = side * cells + 1
    at = np.stack(np.meshgrid(*[np.arange(n)] * 3, indexing="ij"), -1).reshape(-1, 3)
    steps = [s for s in itertools.product((-1, 0, 1), repeat=3) if s > (0, 0, 0) and sum(map(abs, s)) < 3]
    links, place = [], []
    for step in steps:
        end = at + step
        keep = ((end >= 0) & (end < n)).all(axis=1)
        links.append(np.column_stack([at[keep] @ [n * n, n, 1], end[keep] @ [n * n, n, 1]]))
        place.append(np.minimum(at[keep], end[keep]).clip(max=n - 2) // cells)
    links, place = np.concatenate(links), np.concatenate(place)
    fixed = np.repeat(at[:, :1] == 0, 3, axis=1)
    return Scene(
        name="lattice 3D",
        nodes=at.astype(float),
        links=links,
        law=np.full(len(links), Law.BAR),
        stiffness=np.full(len(links), 1e6),
        initial_elongation=np.zeros(len(links)),
        fixed=fixed,
        prescribed=np.zeros(fixed.shape),
        load=np.where(fixed, 0.0, [0.0, 0.0, -1.0]),
        subdomain=place @ [side * side, side, 1],
    )


def scene_of(name, side):
    """Make a structure of bars in side^2 or side^3 equal blocks."""
    from latinpc.scenes import make

    if name == "lattice 3D":
        return lattice_3d(side)
    return make("truss-grid", modules=2 * side, subdomains=side * side)


KEEP = []  # a structure lives as long as its matrix is used


# ---- one case, in a process of its own -------------------------------------------------------
def links_system(name, side):
    """Return matrix and load of a structure."""
    import latinpc

    structure = latinpc.Structure.from_scene(scene_of(name, side))
    a, u, b = structure.dm.createMat(), structure.create_vec(), structure.create_vec()
    structure.jacobian(u, a)
    structure.residual(u, b)
    b.scale(-1.0)
    KEEP.append(structure)
    return a, b, None


def matis_system(name):
    """Return matrix, load and coordinates of a matrix with one subdomain a rank."""
    sys.path.insert(0, str(HERE.parent / "tests"))
    import matis_program
    from petsc4py import PETSc

    problem, dim, cells, blocks = SCENES[name]
    args = argparse.Namespace(
        problem=problem, dim=dim, cells=cells, blocks=blocks, jump="none", scalar_map=False, owned=False
    )
    args.dirichlet, args.asymmetric, args.local_type = "eliminated" if problem == "truss" else "zeroed", False, "aij"
    made = matis_program.Truss(args) if problem == "truss" else matis_program.Grid(args)
    a, x, _ = matis_program.matis(made, args, PETSc.COMM_WORLD)
    b = a.createVecRight()
    first, last = b.getOwnershipRange()
    b.setArray(np.sin(1.0 + 7.3 * np.arange(first, last)))
    return a, b, x if problem == "truss" else x[:: made.bs]


def run(case):
    """Solve and print figures as JSON."""
    from petsc4py import PETSc

    import latinpc
    from latinpc.options import default_options

    comm = PETSc.COMM_WORLD.tompi4py()
    if case["table"] == "approximate":
        a, b, x = matis_system(case["scene"])
    else:
        a, b, x = links_system(*STRUCTURES.get(case.get("scene"), (case["table"], case.get("side"))))
    with default_options({"pc_latin_" + key: value for key, value in case["options"].items()}):
        ksp = PETSc.KSP().create()
        ksp.setOperators(a)
        ksp.setType("cg")
        ksp.setTolerances(rtol=1e-8, max_it=500 if case["options"] != COARSE["jacobi"] else 1)
        ksp.getPC().setType("latin")
        if x is not None:
            ksp.getPC().setCoordinates(x)
        ksp.setFromOptions()
        marks = [time.process_time()]
        ksp.setUp()
        marks.append(time.process_time())
        u = b.duplicate()
        ksp.solve(b, u)
        marks.append(time.process_time())
    seconds = [max(comm.allgather(q - p)) for p, q in itertools.pairwise(marks)]
    statistics = latinpc.statistics(ksp.getPC())
    peak = sum(comm.allgather(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)) * 1024
    found = {
        "unknowns": a.getSize()[0],
        "subdomains": statistics["subdomains"],
        "coarse": statistics["strong_macro_dofs"] + statistics["weak_dofs"],
        "factored": statistics["coarse_size"],
        "reason": ksp.getConvergedReason(),
        "iterations": ksp.getIterationNumber(),
        "setup": seconds[0],
        "solve": seconds[1],
        "memory": peak,
    }
    if comm.rank == 0:
        print(json.dumps(found))


def launch(case, limit):
    """Run a case in a process of its own; None where it takes too long or fails."""
    ranks = 1 if case["table"] in GROWTH else 4
    command = [sys.executable, __file__, "--case", json.dumps(case)]
    try:
        done = subprocess.run(
            ["mpirun", "-n", str(ranks), *command] if ranks > 1 else command,
            capture_output=True,
            text=True,
            timeout=limit,
        )
    except subprocess.TimeoutExpired:
        return {"failed": "time"}
    lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
    return json.loads(lines[-1]) if lines else {"failed": done.stderr[-300:]}


def cases(tables):
    """Yield (key, case) of the tables asked for."""
    for table in tables:
        if table in ("levels", "approximate"):
            scenes, solvers = (STRUCTURES, LEVELS) if table == "levels" else (SCENES, APPROXIMATE)
            for scene, solver in itertools.product(scenes, solvers):
                yield f"{table}|{scene}|{solver}", {"table": table, "scene": scene, "options": solvers[solver]}
        else:
            for side, solver in itertools.product(GROWTH[table], COARSE):
                if table == "truss-grid" and solver == "gamg" and side > 25:
                    continue  # hundreds of iterations
                yield f"{table}|{side}|{solver}", {"table": table, "side": side, "options": COARSE[solver]}


# ---- the page --------------------------------------------------------------------------------
def exponent(x, y):
    """Slope of the last two points in a double logarithmic plot."""
    return f"{np.log(y[-1] / y[-2]) / np.log(x[-1] / x[-2]):.2f}" if len(x) > 1 and min(y[-2:]) > 0 else "–"


def growth_table(found, table):
    """Write a table of one scene, a row a solver and number of subdomains."""
    heads = ("solver", "subdomains", "coarse unknowns", "iterations", "set-up", "an iteration", "memory", "all in all")
    lines = ["| " + " | ".join(heads) + " |"]
    lines.append("| --- " * 8 + "|")
    for solver in list(COARSE)[1:]:
        rows = []
        for side in GROWTH[table]:
            result, base = found.get(f"{table}|{side}|{solver}"), found.get(f"{table}|{side}|jacobi")
            if not result or "failed" in result or not base or "failed" in base:
                continue
            memory = max(result["memory"] - base["memory"], 0)
            setup, each = result["setup"] - base["setup"], result["solve"] / max(result["iterations"], 1)
            rows.append((result["subdomains"], setup, each, memory))
            size = f"{result['coarse']:,}" + (
                f", {result['factored']:,} left" if result["factored"] < result["coarse"] else ""
            )
            lines.append(
                f"| {solver} | {result['subdomains']:,} | {size} | "
                f"{result['iterations'] if result['reason'] > 0 else '–'} | {setup:.2f} s | "
                f"{1e3 * each:.1f} ms | {memory / 1e6:.0f} MB | {result['setup'] + result['solve']:.1f} s |"
            )
        if len(rows) > 1:
            x, *y = zip(*rows, strict=True)
            lines.append(f"| | exponent | | | {exponent(x, y[0])} | {exponent(x, y[1])} | {exponent(x, y[2])} | |")
    return lines


def extrapolated_table(found, table):
    """Write what larger numbers of subdomains would need, by the exponents of the last two sizes (at least 1)."""
    lines = ["| solver | 1e5 subdomains: set-up, memory, an iteration | 1e6 subdomains: set-up, memory, an iteration |"]
    lines.append("| --- | --- | --- |")
    for solver in list(COARSE)[1:]:
        last = []
        for side in GROWTH[table][-2:]:
            result, base = found.get(f"{table}|{side}|{solver}"), found.get(f"{table}|{side}|jacobi")
            if result and base and "failed" not in result and result["reason"] > 0:
                memory = max(result["memory"] - base["memory"], 1)
                setup, each = result["setup"] - base["setup"], result["solve"] / max(result["iterations"], 1)
                last.append((result["subdomains"], max(setup, 1e-3), memory / 1e9, each))
        if len(last) < 2:
            continue
        cells = []
        for count in (1e5, 1e6):
            values = []
            for k in (1, 2, 3):
                slope = max(np.log(last[1][k] / last[0][k]) / np.log(last[1][0] / last[0][0]), 1.0)
                values.append(last[1][k] * (count / last[1][0]) ** slope)
            cells.append(f"{values[0]:.3g} s, {values[1]:.3g} GB, {values[2]:.2g} s")
        lines.append(f"| {solver} | {cells[0]} | {cells[1]} |")
    return lines


def solvers_table(found, table, scene, solvers):
    """Write a table of one problem, a row a choice of solvers."""
    lines = ["| solvers | iterations | set-up | solve | memory |", "| --- | --- | --- | --- | --- |"]
    for solver in solvers:
        result = found.get(f"{table}|{scene}|{solver}")
        if not result:
            continue
        if "failed" in result or result["reason"] <= 0:
            lines.append(f"| {solver} | – | | | |")
            continue
        lines.append(
            f"| {solver} | {result['iterations']} | {result['setup']:.2f} s | {result['solve']:.2f} s | "
            f"{result['memory'] / 1e6:.0f} MB |"
        )
    return lines


def write(found):
    """Fill in the tables of the page."""
    text = PAGE.read_text()
    tables = {name: growth_table(found, name) for name in GROWTH}
    tables["extrapolated"] = extrapolated_table(found, "truss-grid")
    tables |= {scene: solvers_table(found, "levels", scene, LEVELS) for scene in STRUCTURES}
    tables |= {scene: solvers_table(found, "approximate", scene, APPROXIMATE) for scene in SCENES}
    for name, lines in tables.items():
        pattern = re.compile(rf"(<!-- {re.escape(name)} -->\n).*?(<!-- end -->)", re.DOTALL)
        text = pattern.sub(lambda match, lines=lines: match[1] + "\n".join(lines) + "\n" + match[2], text)
    PAGE.write_text(text)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tables", nargs="*", help=f"of {', '.join([*GROWTH, 'levels', 'approximate'])}; all by default")
    parser.add_argument("--case", help=argparse.SUPPRESS)
    parser.add_argument("--tables", dest="only", action="store_true", help="write the page from what has been measured")
    parser.add_argument("--limit", type=float, default=300.0, help="seconds a case may take")
    parser.add_argument("--missing", action="store_true", help="leave out the cases that have a result")
    args = parser.parse_args()
    if args.case:
        run(json.loads(args.case))
        return
    found = json.loads(RESULT.read_text()) if RESULT.exists() else {}
    for key, case in [] if args.only else cases(args.tables or [*GROWTH, "levels", "approximate"]):
        if args.missing and key in found:
            continue
        found[key] = launch(case, args.limit)
        print(key, found[key], flush=True)
        RESULT.write_text(json.dumps(found, indent=1) + "\n")
    write(found)


if __name__ == "__main__":
    main()
