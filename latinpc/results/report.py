"""What reports hold: the problem, why a solver stopped, numbers fit for JSON."""

from __future__ import annotations

from typing import Any

import numpy as np
from petsc4py import PETSc

from latinpc import solvers

__all__ = ["DECOMPOSITION", "Reported", "in_words", "plain", "problem", "reason_name", "snes_reason"]

DECOMPOSITION = ("subdomains", "strong_interfaces", "weak_interfaces", "strong_macro_dofs", "weak_dofs")

_WORDS = {
    "CONVERGED_FNORM_ABS": "the unbalanced forces are below the absolute tolerance",
    "CONVERGED_FNORM_RELATIVE": "the unbalanced forces are small enough",
    "CONVERGED_ITS": "the iterations that were asked for are made",
    "DIVERGED_MAX_IT": "the iterations that -snes_max_it allows were not enough",
    "DIVERGED_FUNCTION_COUNT": "the linear stages that -snes_max_funcs allows were not enough",
    "DIVERGED_INNER": "rounding does not allow the accuracy that is asked for",
    "DIVERGED_DTOL": "no stable equilibrium was found: the displacements grow without end",
    "DIVERGED_LINE_SEARCH": "the line search found no better displacements",
    "DIVERGED_LINEAR_SOLVE": "a linear solve failed",
    "DIVERGED_FNORM_NAN": "the numbers became infinite",
    "DIVERGED_FUNCTION_NANORINF": "the numbers became infinite",
}


def problem(structure: Any) -> dict[str, Any]:
    """Return the keys of a report that name a structure and its size; not collective."""
    sizes = structure.sizes
    return {
        "scene": structure.name,
        "dofs": sizes.nodes * sizes.dim,
        "free_dofs": sizes.free_dofs,
        "links": sizes.links,
        "ranks": structure.comm.size,
    }


def reason_name(reasons: Any, value: int) -> str:
    """Return the name of a converged reason; petsc4py keeps them as attributes of a class."""
    names = {getattr(reasons, name): name for name in dir(reasons) if name.startswith(("CONVERGED_", "DIVERGED_"))}
    return names.get(value, str(value))


def snes_reason(snes: PETSc.SNES) -> str:
    """Return why a SNES stopped, with the reason of its KSP where that failed; not collective."""
    text = reason_name(PETSc.SNES.ConvergedReason, snes.getConvergedReason())
    if text == "DIVERGED_LINEAR_SOLVE":
        ksp, which = snes.getKSP(), "KSP"
        latin = snes.getType() == "latin"
        coarse = solvers.coarse_ksp(snes) if latin else None
        if coarse and coarse.getConvergedReason() < 0:
            which = f"the coarse problem after {coarse.getIterationNumber()} iterations, -snes_latin_coarse_:"
            ksp = coarse
        elif latin and ksp.getConvergedReason() >= 0:  # it does not use this one
            return text + " (of a subdomain, -snes_latin_local_)"
        text += f" ({which} {reason_name(PETSc.KSP.ConvergedReason, ksp.getConvergedReason())})"
    return text


def in_words(report: dict) -> str:
    """Return why the solve of a report stopped, in words; not collective."""
    name = report["reason"]
    if name == "CONVERGED_SNORM_RELATIVE":
        if report["estimated_error"] is not None:
            return "the estimated error of the displacements and the unbalanced forces are small enough"
        return "the displacements hardly change any more"
    if name == "CONVERGED_ITS" and report["solver"].startswith("ksponly"):
        return "the linear solve has converged"
    words = _WORDS.get(name.split(" ")[0])
    if name == "DIVERGED_DTOL" and report.get("load_factor") is not None:
        words = "no stable equilibrium follows"
    elif name == "DIVERGED_DTOL" and report["solver"].split(" ")[0] != "latin":  # it asks for residuals alone
        words = "the unbalanced forces grow without end"
    return f"{words} ({name})" if words and name.startswith("DIVERGED") else words or name


def plain(value: Any) -> Any:
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


class Reported:
    """What a report says of a solve, as properties; arrays come from the class that has it."""

    report: dict[str, Any]

    @property
    def converged(self) -> bool:
        """Whether the solver has converged: without, the arrays are those of its last iterate."""
        return self.report["converged"]

    @property
    def reason(self) -> str:
        """Why the solver stopped, in words; ``report["reason"]`` is PETSc's name."""
        return in_words(self.report)

    @property
    def iterations(self) -> int:
        """Number of iterations."""
        return self.report["iterations"]

    @property
    def estimated_error(self) -> float | None:
        """Estimated relative error of the displacements; None where the stop does not estimate it."""
        return self.report["estimated_error"]

    @property
    def tension_error(self) -> float | None:
        """Estimated relative error of the tensions, l2 norm over all links; None where it is not known."""
        return self.report["tension_error"]

    @property
    def largest_unbalance(self) -> float | None:
        """Largest unbalanced force on a node (N); ``report["unbalanced_node"]`` is the node."""
        return self.report["largest_unbalance"]
