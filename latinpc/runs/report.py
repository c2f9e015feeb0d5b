"""What the reports of all runs hold: the problem, the decomposition, reasons and versions."""

from __future__ import annotations

import platform
import resource

import mpi4py
import numpy as np
import petsc4py
from petsc4py import PETSc

import latinpc

DECOMPOSITION = ("subdomains", "strong_interfaces", "weak_interfaces", "strong_macro_dofs", "weak_dofs")


def problem(scene, structure):
    """Return the keys of a report that name a problem and its size; not collective."""
    sizes = structure.sizes
    return {
        "scene": scene.name,
        "scene_options": scene.metadata,
        "dofs": sizes.nodes * sizes.dim,
        "free_dofs": sizes.free_dofs,
        "links": sizes.links,
        "ranks": structure.comm.size,
    }


def environment(comm):
    """Return the keys of a report on memory, versions and options; collective."""
    return {
        "peak_memory_bytes": comm.allreduce(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024),
        "versions": versions(),
        "options": dict(PETSc.Options().getAll()),
    }


def reason_name(reasons, value):
    """Return the name of a converged reason; petsc4py keeps them as attributes of a class."""
    names = {getattr(reasons, name): name for name in dir(reasons) if name.startswith(("CONVERGED_", "DIVERGED_"))}
    return names.get(value, str(value))


def snes_reason(snes):
    """Return why a SNES stopped, with the reason of its KSP where that failed; not collective."""
    text = reason_name(PETSc.SNES.ConvergedReason, snes.getConvergedReason())
    if text == "DIVERGED_LINEAR_SOLVE":
        text += f" (KSP {reason_name(PETSc.KSP.ConvergedReason, snes.getKSP().getConvergedReason())})"
    return text


def plain(value):
    """Return a copy of a report fit for JSON: Python's own numbers, None for what is not finite."""
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [plain(item) for item in value]
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, (float, np.floating)):
        return float(value) if np.isfinite(value) else None
    return value


def versions():
    """Return the versions of what a result depends on."""
    return {
        "latinpc": latinpc.__version__,
        "petsc": ".".join(map(str, PETSc.Sys.getVersion())),
        "petsc4py": petsc4py.__version__,
        "mpi4py": mpi4py.__version__,
        "numpy": np.__version__,
        "python": platform.python_version(),
    }
