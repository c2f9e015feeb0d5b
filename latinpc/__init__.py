"""Multiscale LATIN domain decomposition for structures of links, as PETSc solver types.

Importing this package registers the TS, SNES, KSP and PC types ``latin`` with petsc4py's PETSc.
"""

from pathlib import Path

__version__ = "0.1.0"

from latinpc.laws import register_law, register_table
from latinpc.links import Links, Sizes
from latinpc.scenes.scene import Law
from latinpc.solvers import (
    coarse_ksp,
    digits,
    energy_bound,
    error_message,
    history,
    jammed_links,
    load_state,
    local_ksp,
    loose_nodes,
    macro_stiffness,
    node_classes,
    outer_ksp,
    outer_snes,
    pcshell_set_latin,
    rounding_floor,
    save_state,
    set_reference,
    statistics,
    step_tensions,
    subdomain_is,
    subdomain_of_links,
    subdomains,
)

__all__ = [
    "Law",
    "Links",
    "Sizes",
    "coarse_ksp",
    "digits",
    "energy_bound",
    "error_message",
    "get_include",
    "get_library",
    "history",
    "jammed_links",
    "load_state",
    "local_ksp",
    "loose_nodes",
    "macro_stiffness",
    "node_classes",
    "outer_ksp",
    "outer_snes",
    "pcshell_set_latin",
    "register_law",
    "register_table",
    "rounding_floor",
    "save_state",
    "set_reference",
    "statistics",
    "step_tensions",
    "subdomain_is",
    "subdomain_of_links",
    "subdomains",
]


def get_library():
    """Path of liblatinpc.so, for PETSc's ``-dll_append`` and for C programs."""
    return str(Path(__file__).resolve().parent / "liblatinpc.so")


def get_include():
    """Directory of the C header latinpc.h."""
    return str(Path(__file__).resolve().parent / "include")
