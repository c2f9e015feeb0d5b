"""``latinpc info``: versions, packages and paths."""

from __future__ import annotations

import os

import click
import numpy as np
import petsc4py
from mpi4py import MPI
from petsc4py import PETSc

import latinpc
from latinpc.runs.report import versions
from latinpc.solvers import has_package

from .printing import open_console, print_lines


@click.command()
@click.pass_obj
def info(comm):
    """Show versions, packages of PETSc, and the path for -dll_append."""
    version, vendor = versions(), MPI.get_vendor()
    library = latinpc.get_library()
    packages = {"MUMPS": "mumps", "CHOLMOD": "suitesparse", "hypre": "hypre", "SuperLU_DIST": "superlu_dist"}
    here = {name: has_package(package) for name, package in packages.items()}
    config = petsc4py.get_config()
    lines = [
        ("latinpc", version["latinpc"]),
        ("PETSc", f"{version['petsc']}, {np.dtype(PETSc.ScalarType).name}, {np.dtype(PETSc.IntType).name} indices"),
        ("PETSC_DIR", os.pathsep.join(filter(None, (config.get("PETSC_DIR"), config.get("PETSC_ARCH"))))),
        ("petsc4py", version["petsc4py"]),
        ("MPI", f"{vendor[0]} {'.'.join(map(str, vendor[1]))}, mpi4py {version['mpi4py']}; run on {comm.size}"),
        ("Python", f"{version['python']}, numpy {version['numpy']}"),
        *((name, "yes" if there else "no") for name, there in here.items()),
        ("METIS", "yes, the library is linked with it"),
        ("library", library if os.path.exists(library) else f"{library} (missing: run make build)"),
        ("in programs", f"./program -dll_append {library} -snes_type latin"),
    ]
    print_lines(open_console(), "latinpc info", lines)
