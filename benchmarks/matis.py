"""PETSc's own tutorials that assemble a MATIS: PC latin beside BDDC.

    apt-get download libpetsc3.18-dev-examples && dpkg -x libpetsc3.18-dev-examples*.deb examples
    python benchmarks/matis.py --tutorials FOLDER      writes results/matis.json, fills in matis.md
    python benchmarks/matis.py --tutorials FOLDER --again      the work of a second set-up alone

FOLDER has ksp/ksp/tutorials/ex71.c and so on, as the sources of PETSc have in src. The programs are compiled as they
are, and find PC latin by -dll_append. Times are those of the events PCSetUp and KSPSolve: by the clock, and the work
alone, processor time outside MPI, of which the slowest rank counts, event by event. The former is what one waits for on
this machine, the latter what one would wait for where each rank has a core and messages cost nothing.
"""

import argparse
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
RESULT, PAGE = HERE / "results" / "matis.json", HERE / "matis.md"
LIBRARY = HERE.parent / "latinpc" / "liblatinpc.so"
TUTORIALS = {"ex71": "ksp/ksp", "ex49": "ksp/ksp", "ex12": "snes", "ex56": "snes"}
ELASTIC = "-elas_ksp_type cg -elas_ksp_norm_type natural -elas_ksp_rtol 1e-8 -dm_mat_type is -no_view"
FULL = "-run_type full -petscpartitioner_type simple -bc_type dirichlet -dm_mat_type is -ksp_type cg -ksp_rtol 1e-8"

#: Title: program and its arguments, prefix of the solver's options, ranks.
CASES = {
    "Poisson, 24 x 24 cells": ("ex71 -pde_type Poisson -dim 2 -cells 24,24", "", (4, 8, 16)),
    "Poisson, 128 x 128": ("ex71 -pde_type Poisson -dim 2 -cells 128,128", "", (4, 8)),
    "Poisson, 10 x 10 x 10": ("ex71 -pde_type Poisson -dim 3 -cells 10,10,10", "", (4, 8, 16)),
    "Poisson, 31 x 31 x 31": ("ex71 -pde_type Poisson -dim 3 -cells 31,31,31", "", (4, 8)),
    "Poisson, 10 x 10 x 10, -use_global": ("ex71 -pde_type Poisson -dim 3 -cells 10,10,10 -use_global", "", (8,)),
    "Poisson, nothing held": ("ex71 -pde_type Poisson -dim 3 -dirichlet 0", "", (8,)),
    "elasticity, 24 x 24": ("ex71 -pde_type Elasticity -dim 2 -cells 24,24", "", (4, 8, 16)),
    "elasticity, 96 x 96": ("ex71 -pde_type Elasticity -dim 2 -cells 96,96", "", (4, 8)),
    "elasticity, 9 x 9 x 9": ("ex71 -pde_type Elasticity -dim 3 -cells 9,9,9", "", (4, 8, 16)),
    "elasticity, 7 x 9 x 8": ("ex71 -pde_type Elasticity -dim 3 -cells 7,9,8", "", (8,)),
    "elasticity, 15 x 15 x 15": ("ex71 -pde_type Elasticity -dim 3 -cells 15,15,15", "", (4, 8)),
    "ex49, 22 x 22": (f"ex49 -mx 22 -my 22 {ELASTIC}", "elas_", (4,)),
    "ex49, sponge": (
        f"ex49 -mx 40 -my 40 -c_str 3 -sponge_E0 1 -sponge_E1 1000 -sponge_nu0 0.4 -sponge_nu1 0.2 -sponge_t 1 "
        f"-sponge_w 8 {ELASTIC}",
        "elas_",
        (4,),
    ),
    "ex49, bricks of 20": (
        f"ex49 -mx 40 -my 40 -c_str 2 -brick_E 1,1000 -brick_nu 0.4,0.2 -brick_span 20 {ELASTIC}",
        "elas_",
        (4,),
    ),
    "ex49, bricks of 10": (
        f"ex49 -mx 30 -my 30 -c_str 2 -brick_E 1,1000 -brick_nu 0.4,0.2 -brick_span 10 {ELASTIC}",
        "elas_",
        (4,),
    ),
    "snes ex12, squares of degree 2": (
        f"ex12 {FULL} -dm_plex_simplex 0 -dm_plex_box_faces 3,3 -dm_refine 2 -petscspace_degree 2 "
        "-petscspace_poly_tensor -show_solution 0",
        "",
        (5,),
    ),
    "snes ex56, degree 2": (
        "ex56 -cells 2,2,1 -max_conv_its 2 -lx 1. -alpha .01 -petscspace_degree 2 -ksp_type cg -ksp_rtol 1e-8 "
        "-petscpartitioner_type simple -ex56_dm_mat_type is",
        "",
        (4,),
    ),
}

DELUXE = "-{p}pc_bddc_use_deluxe_scaling -{p}sub_schurs_mat_solver_type mumps"
LOCAL_MUMPS = " ".join(f"-{{p}}pc_bddc_{which}_pc_factor_mat_solver_type mumps" for which in ("dirichlet", "neumann"))

#: The ways of BDDC; vector problems with -pc_bddc_monolithic, as the tutorials' own tests have it.
PEERS = {
    "as it comes": "",
    "faces": "-{p}pc_bddc_use_faces",
    "faces, MUMPS": "-{p}pc_bddc_use_faces " + LOCAL_MUMPS,
    "faces, deluxe": "-{p}pc_bddc_use_faces " + DELUXE,
}

#: What is set up a second time, after each subdomain's values have been scaled, and on how many ranks.
AGAIN = {
    "elasticity, 32 x 32 x 32": ("-pde_type Elasticity -dim 3 -cells 32,32,32", (8,)),
    "elasticity, 24 x 24 x 24": ("-pde_type Elasticity -dim 3 -cells 24,24,24", (4, 8)),
    "elasticity, 15 x 15 x 15": ("-pde_type Elasticity -dim 3 -cells 15,15,15", (4, 8)),
    "elasticity, 96 x 96": ("-pde_type Elasticity -dim 2 -cells 96,96", (4, 8)),
    "Poisson, 31 x 31 x 31": ("-pde_type Poisson -dim 3 -cells 31,31,31", (4, 8)),
}
SECOND = """
  {
    PetscLogStage stage;
    Mat           local;
    PetscMPIInt   rank;

    MPI_Comm_rank(PETSC_COMM_WORLD, &rank);
    PetscCall(PetscLogStageRegister("Again", &stage));
    PetscCall(MatISGetLocalMat(A, &local));
    PetscCall(MatScale(local, 1.1 + 0.1 * rank));
    PetscCall(MatISRestoreLocalMat(A, &local));
    PetscCall(MatAssemblyBegin(A, MAT_FINAL_ASSEMBLY));
    PetscCall(MatAssemblyEnd(A, MAT_FINAL_ASSEMBLY));
    PetscCall(KSPSetOperators(ksp, A, A));
    PetscCall(PetscLogStagePush(stage));
    PetscCall(KSPSetUp(ksp));
    PetscCall(PetscLogStagePop());
  }

  /* cleanup */"""

#: MPI calls within which the processor's time does not count, and their parameters.
CALLS = {
    "Allreduce": "const void *a, void *b, int c, MPI_Datatype d, MPI_Op e, MPI_Comm f",
    "Reduce": "const void *a, void *b, int c, MPI_Datatype d, MPI_Op e, int f, MPI_Comm g",
    "Bcast": "void *a, int b, MPI_Datatype c, int d, MPI_Comm e",
    "Barrier": "MPI_Comm a",
    "Allgather": "const void *a, int b, MPI_Datatype c, void *d, int e, MPI_Datatype f, MPI_Comm g",
    "Allgatherv": "const void *a, int b, MPI_Datatype c, void *d, const int *e, const int *f, MPI_Datatype g, "
    "MPI_Comm h",
    "Gather": "const void *a, int b, MPI_Datatype c, void *d, int e, MPI_Datatype f, int g, MPI_Comm h",
    "Alltoall": "const void *a, int b, MPI_Datatype c, void *d, int e, MPI_Datatype f, MPI_Comm g",
    "Wait": "MPI_Request *a, MPI_Status *b",
    "Waitall": "int a, MPI_Request *b, MPI_Status *c",
    "Waitany": "int a, MPI_Request *b, int *c, MPI_Status *d",
    "Test": "MPI_Request *a, int *b, MPI_Status *c",
    "Testall": "int a, MPI_Request *b, int *c, MPI_Status *d",
    "Recv": "void *a, int b, MPI_Datatype c, int d, int e, MPI_Comm f, MPI_Status *g",
    "Send": "const void *a, int b, MPI_Datatype c, int d, int e, MPI_Comm f",
    "Iprobe": "int a, int b, MPI_Comm c, int *d, MPI_Status *e",
    "Scan": "const void *a, void *b, int c, MPI_Datatype d, MPI_Op e, MPI_Comm f",
    "Reduce_scatter_block": "const void *a, void *b, int c, MPI_Datatype d, MPI_Op e, MPI_Comm f",
    "Comm_dup": "MPI_Comm a, MPI_Comm *b",
    "Comm_split": "MPI_Comm a, int b, int c, MPI_Comm *d",
}
CLOCK = r"""
#include <mpi.h>
#include <time.h>
static double inside;
static int    depth;
static double cpu(void)
{
  struct timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}
double MPI_Wtime(void) { return cpu() - inside; }
#define OUTSIDE(name, parameters, call) \
  int MPI_##name parameters \
  { \
    double t = cpu(); \
    int    result; \
    depth++; \
    result = PMPI_##name call; \
    if (!--depth) inside += cpu() - t; \
    return result; \
  }
"""


def compile_all(tutorials, folder, programs=TUTORIALS):
    """Compile the tutorials and the clock of the work alone."""
    where = subprocess.run(
        [sys.executable, "-c", "import petsc4py; print(*petsc4py.get_config().values(), sep='\\n')"],
        capture_output=True, text=True, check=True,
    ).stdout.split("\n")  # fmt: skip
    path = os.pathsep.join(str(Path(*where[:n], "lib", "pkgconfig")) for n in (2, 1))
    env = {**os.environ, "PKG_CONFIG_PATH": path}
    words = ["pkg-config", "--cflags", "--libs", "PETSc"]
    flags = subprocess.run(words, capture_output=True, text=True, check=True, env=env).stdout.split()
    flags += [f"-Wl,-rpath,{word[2:]}" for word in flags if word.startswith("-L")]
    flags += [f"-I{place}" for place in Path("/usr/include/hdf5").glob("openmpi")]  # Debian's place
    for name, place in programs.items():
        source = tutorials / place / "tutorials" / f"{name}.c"
        subprocess.run(["mpicc", "-O2", "-w", source, "-o", folder / name, *flags, "-lm"], check=True)
    lines = [CLOCK]
    for name, parameters in CALLS.items():
        call = ", ".join(re.findall(r"\w+(?=,|$)", parameters))
        lines.append(f"OUTSIDE({name}, ({parameters}), ({call}))")
    (folder / "clock.c").write_text("\n".join(lines) + "\n")
    subprocess.run(
        ["mpicc", "-O2", "-w", "-fPIC", "-shared", folder / "clock.c", "-o", folder / "clock.so"], check=True
    )


def run(folder, ranks, words, clock, stages=None):
    """Run a tutorial; returns iterations, set-up and solve (seconds), or set-ups of stages, or None: not converged."""
    log = Path(tempfile.mkdtemp(dir=folder)) / "log.py"
    preload = ["-x", f"LD_PRELOAD={folder / 'clock.so'}"] if clock else []
    command = ["mpirun", "-n", str(ranks), *preload, str(folder / words[0]), *words[1:]]
    try:
        done = subprocess.run(
            [*command, "-log_view", f":{log}:ascii_info_detail"], capture_output=True, text=True, timeout=600
        )
    except subprocess.TimeoutExpired:
        return None
    solves = re.findall(r"(CONVERGED|DIVERGED)_\w+ iterations (\d+)", done.stdout)
    if done.returncode or not solves or any(word == "DIVERGED" for word, _ in solves):
        return None
    document = {}
    exec(log.read_text(), {"nan": float("nan"), "inf": float("inf")}, document)  # a Python file is what PETSc writes
    if stages:
        each = [document["Stages"][stage]["PCSetUp"].values() for stage in stages]
        return [max(event["time"] for event in events if isinstance(event, dict)) for events in each]
    times = {"PCSetUp": 0.0, "KSPSolve": 0.0}
    for stage in document["Stages"].values():
        for event in times:
            each = [e["time"] for e in stage.get(event, {}).values() if isinstance(e, dict)]
            times[event] += max(each, default=0.0)
    return [max(int(n) for _, n in solves), times["PCSetUp"], times["KSPSolve"]]


def measure(folder, title, ranks, repeat, clocks):
    """One row: PC latin and the ways of BDDC, in turn; iterations, and medians of the two times for clock and work."""
    program, prefix, _ = CASES[title]
    common = [*program.split(), f"-{prefix}ksp_converged_reason"]
    if "ksp_rtol" not in program:
        common += ["-ksp_rtol", "1e-8"]
    vector = ["-{p}pc_bddc_monolithic"] if "lasticity" in program or prefix or "ex56" in program else []
    singular = ["-{p}pc_bddc_coarse_redundant_pc_type", "svd"] if "-dirichlet 0" in program else []
    ways = {"latin": ["-{p}pc_type", "latin", "-dll_append", str(LIBRARY)]}
    for name, options in PEERS.items():
        ways[f"BDDC, {name}"] = ["-{p}pc_type", "bddc", *options.split(), *singular, *(vector if options else [])]
    row = {}
    for clock in clocks:
        found = {name: [] for name in ways}
        for _ in range(repeat):
            for name, options in ways.items():
                found[name].append(run(folder, ranks, common + [word.format(p=prefix) for word in options], clock))
        for name, results in found.items():
            if None in results:
                row[name] = None
                continue
            times = [statistics.median(r[k] for r in results) for k in (1, 2)]
            row.setdefault(name, {"iterations": results[0][0]})
            if row[name]:
                row[name]["work" if clock else "clock"] = times
    return row


def second(tutorials, folder, repeat):
    """Return the lines of the table of second set-ups: medians of the work of the slowest rank."""
    source = (tutorials / "ksp/ksp/tutorials/ex71.c").read_text()
    place = folder / "again" / "ksp/ksp/tutorials"
    place.mkdir(parents=True)
    before, after = source.rsplit("\n  /* cleanup */", 1)
    (place / "ex71.c").write_text(before + SECOND + after)
    compile_all(folder / "again", folder, {"ex71": "ksp/ksp"})
    lines = ["| | ranks | first | second | ratio |", "| --- | ---: | ---: | ---: | ---: |"]
    for title, (words, sizes) in AGAIN.items():
        for ranks in sizes:
            command = ["ex71", *words.split(), "-ksp_rtol", "1e-8", "-ksp_converged_reason", "-pc_type", "latin"]
            command += ["-dll_append", str(LIBRARY)]
            times = [run(folder, ranks, command, True, ("KSPSetUp", "Again")) for _ in range(repeat)]
            first, again = (1e3 * statistics.median(t[k] for t in times) for k in (0, 1))
            lines.append(f"| {title} | {ranks} | {first:.0f} | {again:.0f} | {again / first:.2f} |")
            print(lines[-1], flush=True)
    return lines


def least(row, which):
    """Give the times of PC latin and of the quickest BDDC, set-up and solve together, and the latter's name."""
    total = {name: sum(found[which]) for name, found in row.items() if found and which in found}
    name = min((name for name in total if name != "latin"), key=total.get, default=None)
    return total.get("latin"), total.get(name), name


def table(document):
    """Lines of the table."""
    kinds = [
        which for which in ("clock", "work") if any(which in (row["latin"] or {}) for row in document["cases"].values())
    ]
    head = {"clock": "time (ms), latin and BDDC", "work": "work (ms), latin and BDDC"}
    columns = ["", "ranks", "iterations, latin", "BDDC as it comes", "BDDC, fewest"]
    for which in kinds:
        columns += [head[which], "ratio"]
    columns.append("BDDC, quickest")
    lines = ["| " + " | ".join(columns) + " |", "| --- |" + " ---: |" * (len(columns) - 2) + " --- |"]
    for key, row in document["cases"].items():
        title, ranks = key.rsplit(", ", 1)
        counts = {name: found["iterations"] if found else None for name, found in row.items()}
        fewest = min((n for name, n in counts.items() if n and name != "latin"), default=None)
        cells = [
            title,
            ranks.split()[0],
            *(str(n or "-") for n in (counts["latin"], counts["BDDC, as it comes"], fewest)),
        ]
        for which in kinds:
            ours, theirs, _ = least(row, which)
            cells += (
                [f"{1e3 * ours:.0f}, {1e3 * theirs:.0f}", f"{ours / theirs:.2f}"] if ours and theirs else ["-", "-"]
            )
        cells.append((least(row, kinds[-1])[2] or "-").removeprefix("BDDC, "))
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def fill_in(mark, lines):
    """Write lines between two marks of the page."""
    text = "\n".join(lines)
    page = re.sub(
        rf"(<!-- {mark} -->\n).*?(<!-- end -->)",
        lambda m: m[1] + text + "\n" + m[2],
        PAGE.read_text(),
        flags=re.DOTALL,
    )
    PAGE.write_text(page)


def main():
    """Measure, write, fill in."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tutorials", type=Path, metavar="FOLDER")
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument(
        "--only", default="", metavar="TEXT", help="cases whose title has it; others keep their results"
    )
    parser.add_argument(
        "--work", action="store_true", help="the work alone: what other programs do at the time matters little"
    )
    parser.add_argument("--again", action="store_true", help="second set-ups alone")
    parser.add_argument("--fill", action="store_true", help="the page again from the results")
    given = parser.parse_args()
    document = json.loads(RESULT.read_text()) if RESULT.exists() else {"cases": {}}
    if not given.fill:
        if not given.tutorials:
            parser.error("--tutorials FOLDER, or --fill")
        with tempfile.TemporaryDirectory() as name:
            if given.again:
                fill_in("again", second(given.tutorials, Path(name), given.repeat))
                return
            compile_all(given.tutorials, Path(name))
            for title, (_, _, sizes) in CASES.items():
                for ranks in sizes if given.only in title else ():
                    row = measure(Path(name), title, ranks, given.repeat, (True,) if given.work else (False, True))
                    document["cases"][f"{title}, {ranks} ranks"] = row
                    print(table({"cases": {f"{title}, {ranks} ranks": row}})[-1], flush=True)
                    RESULT.write_text(json.dumps(document, indent=1) + "\n")
    fill_in("tutorials", table(document))


if __name__ == "__main__":
    main()
