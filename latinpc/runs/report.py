"""What the reports of all runs hold: memory, versions and options."""

from __future__ import annotations

import platform
import resource

import mpi4py
import numpy as np
import petsc4py
from petsc4py import PETSc

from latinpc.library import _latin


def environment(comm):
    """Return the keys of a report on memory, versions and options; collective."""
    return {
        "peak_memory_bytes": comm.allreduce(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024),
        "versions": versions(),
        "options": dict(PETSc.Options().getAll()),
    }


def versions():
    """Return the versions of what a result depends on."""
    return {
        "latinpc": ".".join(map(str, _latin.VERSION)),
        "petsc": ".".join(map(str, PETSc.Sys.getVersion())),
        "petsc4py": petsc4py.__version__,
        "mpi4py": mpi4py.__version__,
        "numpy": np.__version__,
        "python": platform.python_version(),
    }
