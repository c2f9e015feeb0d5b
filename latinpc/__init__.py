"""Multiscale LATIN domain decomposition for structures of links, as PETSc solver types.

Importing this package registers the TS, SNES, KSP and PC types ``latin`` with petsc4py's PETSc.
"""

from pathlib import Path

__version__ = "0.1.0"

from latinpc import scenes
from latinpc.accuracy import digits, energy_bound, estimated_error, rounding_floor, tension_error
from latinpc.distributed.result import LocalResult
from latinpc.distributed.scenes import local_scene
from latinpc.distributed.structure import LocalStructure
from latinpc.errors import LatinError, error_message
from latinpc.files.reading import read
from latinpc.forms.form import Form, form_find
from latinpc.laws import Law
from latinpc.results.modes import Modes, modes
from latinpc.results.notices import ConvergenceWarning, LatinWarning, SolveError
from latinpc.results.result import Result
from latinpc.runs.cases import Cases, solve_cases
from latinpc.scenes import Case
from latinpc.settings import (
    set_balance,
    set_direction,
    set_error,
    set_largest_unbalance,
    set_modes,
    set_newton,
    set_partition,
    set_partitioner,
    set_precision,
    set_reference,
    set_stop,
    set_subdomains,
    set_tension_error,
    set_variant,
    set_warm_start,
)
from latinpc.solvers import (
    coarse_ksp,
    cost,
    history,
    jammed_links,
    load_state,
    local_ksp,
    macro_stiffness,
    node_classes,
    outer_ksp,
    outer_snes,
    path,
    pcshell_set_latin,
    save_state,
    statistics,
    step_cause,
    step_tensions,
    subdomain_is,
    subdomain_of_links,
    subdomains,
    tensions,
    unsupported_nodes,
)
from latinpc.structure import Sizes, Structure
from latinpc.userlaws import register_law, register_table

__all__ = [
    "Case",
    "Cases",
    "ConvergenceWarning",
    "Form",
    "LatinError",
    "LatinWarning",
    "Law",
    "LocalResult",
    "LocalStructure",
    "Modes",
    "Result",
    "Sizes",
    "SolveError",
    "Structure",
    "coarse_ksp",
    "cost",
    "digits",
    "energy_bound",
    "error_message",
    "estimated_error",
    "form_find",
    "get_include",
    "get_library",
    "history",
    "jammed_links",
    "load_state",
    "local_ksp",
    "local_scene",
    "macro_stiffness",
    "modes",
    "node_classes",
    "outer_ksp",
    "outer_snes",
    "path",
    "pcshell_set_latin",
    "read",
    "register_law",
    "register_table",
    "rounding_floor",
    "save_state",
    "scenes",
    "set_balance",
    "set_direction",
    "set_error",
    "set_largest_unbalance",
    "set_modes",
    "set_newton",
    "set_partition",
    "set_partitioner",
    "set_precision",
    "set_reference",
    "set_stop",
    "set_subdomains",
    "set_tension_error",
    "set_variant",
    "set_warm_start",
    "solve_cases",
    "statistics",
    "step_cause",
    "step_tensions",
    "subdomain_is",
    "subdomain_of_links",
    "subdomains",
    "tension_error",
    "tensions",
    "unsupported_nodes",
]


def get_library() -> str:
    """Path of liblatinpc.so, for PETSc's ``-dll_append`` and for C programs."""
    return str(Path(__file__).resolve().parent / "liblatinpc.so")


def get_include() -> str:
    """Directory of the C header latinpc.h."""
    return str(Path(__file__).resolve().parent / "include")
