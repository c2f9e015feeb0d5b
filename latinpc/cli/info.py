"""``latinpc info``: versions, packages, threads and paths, for reports of bugs."""

from __future__ import annotations

import json
import os
import pathlib
import platform
import re

import click
import numpy as np
import petsc4py
from mpi4py import MPI
from petsc4py import PETSc

import latinpc
from latinpc.blas import CHOICE, kernels
from latinpc.options import preset_files
from latinpc.runs.report import versions
from latinpc.solvers import has_package

from .arguments import Command
from .printing import open_console, print_lines, write_json
from .ranks import on_root

#: Packages of PETSc that latinpc uses or compares with: name -> PETSc's name of it
PACKAGES = {
    "MUMPS": "mumps", "CHOLMOD": "suitesparse", "METIS": "metis", "PT-Scotch": "ptscotch", "HDF5": "hdf5",
    "hypre": "hypre", "SuperLU_DIST": "superlu_dist",
}  # fmt: skip
#: What decides how many threads a rank starts
THREADS = ("OMP_NUM_THREADS", "OMP_THREAD_LIMIT", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS")


@click.command(cls=Command)
@click.option("--json", "json_file", metavar="FILE", help="Write the report; '-' prints it and nothing else.")
@click.pass_obj
def info(comm, json_file):
    """Show versions, packages, threads and paths.

    Send them with a bug report. Run the command like the program: with mpirun, in the same environment.
    """
    hosts = comm.gather((platform.node(), _cores()))
    found = on_root(comm, _found, comm.size, hosts)
    if json_file is not None:
        on_root(comm, write_json, json_file, found)
    if comm.rank == 0 and json_file != "-":
        print_lines(open_console(), "latinpc info", _lines(found))


def _cores():
    """Return the number of cores that this rank may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()


def _found(ranks, hosts):
    """Gather versions, packages, threads and paths, fit for JSON; on one rank."""
    vendor, config, library = MPI.get_vendor(), petsc4py.get_config(), latinpc.get_library()
    built = pathlib.Path(latinpc.__file__).with_name("built.json")
    return {
        "versions": versions(),
        "petsc": {
            "real": np.dtype(PETSc.RealType).name,
            "scalar": np.dtype(PETSc.ScalarType).name,
            "indices": np.dtype(PETSc.IntType).name,
            "dir": config.get("PETSC_DIR"),
            "arch": config.get("PETSC_ARCH"),
            "configure": _configured(config),
            "packages": {name: bool(has_package(package)) for name, package in PACKAGES.items()},
        },
        "built": json.loads(built.read_text(encoding="utf-8")) if built.is_file() else None,
        "mpi": f"{vendor[0]} {'.'.join(map(str, vendor[1]))}",
        "ranks": ranks,
        "hosts": len({name for name, _ in hosts}),
        "cores": min(count for _, count in hosts),
        "threads": {name: os.environ.get(name) for name in THREADS if name in os.environ},
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
        "blas": kernels(),
        "library": library,
        "library_exists": os.path.exists(library),
        "presets": list(preset_files()),
    }


def _configured(config):
    """Return the options that PETSc was configured with; None where its headers are not there."""
    for folder in (os.path.join(config["PETSC_DIR"], config["PETSC_ARCH"]), config["PETSC_DIR"]):
        header = pathlib.Path(folder, "include", "petscconfiginfo.h")
        if header.is_file():
            match = re.search(r'petscconfigureoptions = "(.*)";', header.read_text(errors="replace"))
            return match.group(1).replace('\\"', "'") if match else None
    return None


def _lines(found):
    """Return lines of (label, text)."""
    version, petsc, built = found["versions"], found["petsc"], found["built"] or {}
    threads = ", ".join(f"{name}={value}" for name, value in found["threads"].items()) or "no limit set"
    packages = [
        (name, f"{'yes' if there else 'no'}{_version(built.get(name.lower()), there)}")
        for name, there in petsc["packages"].items()
    ]
    if built.get("metis"):
        packages = [(name, f"{built['metis']}, linked" if name == "METIS" else text) for name, text in packages]
    numbers = f"{petsc['scalar']}, {petsc['indices']} indices"
    made = f"PETSc {built['petsc']}, {built['compiler']}, {built['build_type']}" if built else "not known"
    library = found["library"]
    return [
        ("latinpc", version["latinpc"]),
        ("built with", made),
        ("PETSc", f"{version['petsc']}, {numbers}"),
        ("PETSC_DIR", os.pathsep.join(filter(None, (petsc["dir"], petsc["arch"])))),
        ("configured", petsc["configure"] or "not known: PETSc's headers are not here"),
        ("petsc4py", version["petsc4py"]),
        ("MPI", f"{found['mpi']}, mpi4py {version['mpi4py']}"),
        ("ranks", f"{found['ranks']} on {found['hosts']} host{'s' if found['hosts'] > 1 else ''}"),
        ("cores", f"{found['cores']} for a rank"),
        ("threads", threads),
        ("BLAS", _kernels(found["blas"])),
        ("Python", f"{version['python']}, numpy {version['numpy']}"),
        ("system", found["system"]),
        *packages,
        ("presets", ", ".join(found["presets"])),
        ("library", library if found["library_exists"] else f"{library} (missing: run make build)"),
        ("in programs", f"./program -dll_append {library} -snes_type latin"),
    ]


def _kernels(blas):
    """Return the BLAS in words, with the cure for kernels that are too narrow."""
    if not blas:
        return "not OpenBLAS"
    cure = f"; {CHOICE}={blas['wider']} chooses wider ones, which this processor has" if blas["wider"] else ""
    return f"OpenBLAS {blas['version'] or ''}, kernels {blas['kernels']}{cure}"


def _version(number, there):
    return f", {number}" if there and isinstance(number, str) and number else ""
