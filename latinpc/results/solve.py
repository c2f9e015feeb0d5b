"""Solve a structure and gather what its solver has found."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from petsc4py import PETSc

from latinpc import accuracy, errors, solvers
from latinpc.arrays import alike
from latinpc.blas import CHOICE, kernels
from latinpc.laws import UNILATERAL
from latinpc.options import default_options, given_options, preset_options, unknown_options

from .limit import bearing, borne, branches, moving, softest, unstable
from .loose import loose
from .notices import (
    ConvergenceWarning,
    SolveError,
    causes,
    changed,
    implausible,
    limit,
    magnitudes,
    strained,
    turned,
    warn,
)
from .report import DECOMPOSITION, plain, problem, snes_reason
from .result import Result
from .unread import unread

if TYPE_CHECKING:
    from latinpc.structure import Structure

__all__ = ["attach_linear", "gather", "idle", "narrow", "report_of", "solve", "unread"]

LONG = 1e10  # operations of factors: a second with the narrowest kernels of OpenBLAS
LAGS = [f"snes_lag_{what}{persists}" for what in ("jacobian", "preconditioner") for persists in ("", "_persists")]


def solve(
    structure: Structure,
    error: float | None,
    largest_unbalance: float | None,
    preset: str | None,
    options: Mapping[str, Any] | None,
    raise_on_failure: bool,
    found: Callable[..., Any] | None = None,
    seen: Callable[[Any], list[str]] = magnitudes,
) -> Result:
    """Solve as `latinpc.Structure.solve` says; collective.

    `found` makes the result, by default `gather`, and `seen` returns what is said of it without its solver.
    """
    how = {"error": error, "largest_unbalance": largest_unbalance, "preset": preset, "options": options}
    alike(structure.comm.tompi4py(), **how, raise_on_failure=raise_on_failure)
    asked = {"snes_latin_error": error, "snes_latin_largest_unbalance": largest_unbalance}
    asked = {name: value for name, value in asked.items() if value is not None}
    comm, given = structure.comm, asked | given_options(options)
    stray = unknown_options()  # of ``PETSC_OPTIONS`` and the like
    stops = ("snes_latin_stop", "snes_stol") if asked else ()  # in their place
    settings = {} if preset is None else preset_options(preset)
    settings = {name: value for name, value in settings.items() if name not in stops} | given
    with _own_geometry(structure, settings), default_options(settings) as ours:
        snes, u = PETSc.SNES().create(comm), structure.create_vec()
        try:
            structure.attach(snes)
            snes.setType("latin")
            snes.setFromOptions()
            core = attach_linear(structure, snes)
            snes.solve(None, u)
            result = (found or gather)(structure, snes, core, u)
        except PETSc.Error as reported:
            text = structure.counted_as_given(errors.error_message(reported))
            text = "; ".join([text, *structure.notices] if reported.ierr == errors.MAT_CH_ZRPVT else [text])
            for option in asked:  # is an argument of this function
                if text.startswith(f"-{option} "):
                    name = option.removeprefix("snes_latin_")
                    raise ValueError(f"{name} (-{option}){text.removeprefix(f'-{option}')}") from None
            raise SolveError(text, reported.ierr) from None
        finally:
            snes.destroy()
            u.destroy()
        result.notices += [*stray, *unread(comm, [name for name in ours if name in given])]
        result.notices += seen(result)
    for notice in result.notices:
        warn(comm, notice)
    if not result.converged:
        text = f"not converged: {result.reason}"
        if raise_on_failure:
            failure = SolveError("; ".join([text, *result.notices]))
            failure.result = result
            raise failure
        warn(comm, text, ConvergenceWarning)
    return result


@contextlib.contextmanager
def _own_geometry(structure, settings):
    """Give a structure its geometry back after a solve whose options choose another; collective."""
    geometry = structure.geometry
    try:
        yield
    finally:
        if "snes_latin_geometry" in settings:
            structure.set_geometry(geometry)


def idle(snes: PETSc.SNES) -> list[str]:
    """Return sentences on options that PETSc takes and that stop or change nothing; not collective."""
    options, said = PETSc.Options(snes.getOptionsPrefix()), []

    def given(*names):
        return " and ".join(f"-{name}" for name in names if options.hasName(name))

    if snes.getType() == "latin":
        named, stop = given("snes_rtol", "snes_atol"), options.getString("snes_latin_stop", "")
        if named and stop != "residual":
            said += [f"no solve stops at {named} without -snes_latin_stop residual: take -snes_latin_error"]
        if given("snes_stol") and stop in ("residual", "error", "energy"):
            instead = "-snes_rtol" if stop == "residual" else "-snes_latin_error"
            said += [f"no solve stops at -snes_stol with -snes_latin_stop {stop}: take {instead}"]
        elif given("snes_stol") and given("snes_latin_error") and stop in ("", "auto"):
            said += ["no solve stops at -snes_stol beside -snes_latin_error: leave out one of them"]
        named = given(*LAGS)
        if named:
            inner = named.split()[0].replace("-", "-snes_latin_newton_", 1)
            said += [f"{named} without effect: SNES latin has no Jacobian; its Newton's method has {inner}"]
    elif snes.hasNPC() and snes.getNPCSide() == PETSc.PC.Side.LEFT and snes.getType().startswith("newton"):
        if snes.getConvergedReason() == PETSc.SNES.ConvergedReason.DIVERGED_LINEAR_SOLVE:
            said += ["-snes_npc_side left leaves Newton's method no matrix to precondition with: take -pc_type none"]
    return said


def narrow(core: PETSc.Object | None) -> list[str]:
    """Return a sentence on kernels of the BLAS narrower than the processor, where that costs time; collective."""
    if core is None or solvers.cost(core)["factor_operations"] < LONG:
        return []
    blas = kernels()
    if not blas or not blas["wider"]:
        return []
    return [f"OpenBLAS runs its kernels for {blas['kernels']}: export {CHOICE}={blas['wider']} makes factors faster"]


def attach_linear(structure: Structure, snes: PETSc.SNES) -> PETSc.SNES | PETSc.KSP | PETSc.PC | None:
    """Attach the structure to a KSP or PC of type latin inside a SNES of another type; collective.

    Returns
    -------
    petsc4py.PETSc.SNES, petsc4py.PETSc.KSP or petsc4py.PETSc.PC
        Which of them is of type latin; None: none.
    """
    if snes.getType() == "latin":
        return snes
    ksp = snes.getKSP()
    linear = next((solver for solver in (ksp, ksp.getPC()) if solver.getType() == "latin"), None)
    if linear is not None:
        structure.attach(linear)
    return linear


def _solver_name(snes: PETSc.SNES) -> str:
    """Return the types of a SNES and of the solvers inside, as far as it uses them; not collective."""
    types = [snes.getType()]
    if snes.getType() != "latin":
        types += [snes.getKSP().getType(), snes.getKSP().getPC().getType()]
    name = " + ".join(filter(None, types))
    return f"{name}, npc {snes.getNPC().getType()}" if snes.hasNPC() else name


def report_of(
    structure: Structure, snes: PETSc.SNES, statistics: dict[str, Any], past: dict, loose: tuple[int, int]
) -> dict[str, Any]:
    """Return what a report says of a solve, from what is known; not collective.

    Parameters
    ----------
    structure : Structure
    snes : petsc4py.PETSc.SNES
    statistics : dict
        `latinpc.statistics`, empty without a solver of type latin.
    past : dict
        `latinpc.history`, empty likewise.
    loose : (int, int)
        Number of slack links, and of links that can be slack.
    """
    iterations = snes.getIterationNumber(), snes.getLinearSolveIterations()
    tensions = accuracy.tension_error(snes) if snes.getType() == "latin" else None
    estimated = tensions is not None or len(past.get("estimate", ()))  # Newton's method alone leaves no history
    return {
        **problem(structure),
        "solver": _solver_name(snes),
        **{key: statistics.get(key) for key in DECOMPOSITION},
        "direction": statistics.get("direction_mean"),
        "iterations": iterations[snes.getType() == "ksponly"],
        "linear_iterations": iterations[1],
        "converged": snes.getConvergedReason() > 0,
        "reason": snes_reason(snes),
        "indicator": past["indicator"][-1] if len(past.get("indicator", ())) else None,
        "residual_norm": None,
        "slack_fraction": loose[0] / loose[1] if loose[1] else 0.0,
        "estimated_error": accuracy.estimated_error(snes) if estimated else None,
        "tension_error": tensions,
    }


def gather(
    structure: Structure, snes: PETSc.SNES, core: PETSc.SNES | PETSc.KSP | PETSc.PC | None, u: PETSc.Vec,
    part: float = 1.0,
) -> Result:  # fmt: skip
    """Gather what a SNES has found; collective, after its solve.

    Parameters
    ----------
    structure : Structure
    snes : petsc4py.PETSc.SNES
        Of any type.
    core : petsc4py.PETSc.SNES, petsc4py.PETSc.KSP or petsc4py.PETSc.PC
        What `attach_linear` has returned.
    u : petsc4py.PETSc.Vec
        Its solution.
    part : float
        Of the loads, that the structure has.

    Returns
    -------
    Result
        Its report has the keys scene, dofs, free_dofs, links, ranks, solver, subdomains, strong_interfaces,
        weak_interfaces, strong_macro_dofs, weak_dofs, direction, cost, iterations, linear_iterations, converged,
        reason, indicator, residual_norm, largest_unbalance, unbalanced_node, slack_fraction, estimated_error,
        tension_error. What does not apply is None. Of large displacements also load_factor: the part of the loads that
        the displacements bear, and its loads and prescribed displacements are that part.
    """
    factor = borne(snes, structure)
    with bearing(snes, structure, factor) as ends:
        return _gathered(structure, snes, core, u, part, factor, ends)


def _gathered(structure, snes, core, u, part, factor, ends):
    """Gather what a SNES has found under the loads that its displacements bear; collective."""
    is_latin = snes.getType() == "latin"
    r = structure.create_vec()
    snes.computeFunction(u, r)
    unbalance = np.linalg.norm(np.where(structure.fixed, 0.0, structure.displacements(r)), axis=1)
    tensions = solvers.tensions(snes)
    past = {key: np.array(values) for key, values in solvers.history(snes).items()} if is_latin else {}
    statistics = solvers.statistics(core) if core is not None else {}
    mode, kind = softest(structure, u, tensions, factor == 0.0) if ends else (None, "soft")
    result = Result(
        structure=structure,
        displacements=structure.displacements(u),
        tensions=tensions,
        load=structure.load,
        report={},
        mode=mode,
        subdomain=solvers.subdomain_of_links(core) if core is not None else structure.subdomain,
        node_class=solvers.node_classes(core) if core is not None else None,
        history=past,
        notices=[
            *structure.notices,
            *implausible(structure),
            *causes(snes, structure, past),
            *idle(snes),
            *narrow(core),
        ],
    )
    slack = np.count_nonzero(result.slack), np.count_nonzero(np.isin(structure.law, UNILATERAL))
    report = report_of(structure, snes, statistics, past, slack) | {
        "cost": solvers.cost(core) if core is not None else None,
        "residual_norm": r.norm(),
        "largest_unbalance": unbalance.max(initial=0.0),
        "unbalanced_node": int(unbalance.argmax()),
    }
    result.report.update(plain(report | ({} if factor is None else {"load_factor": part * factor})))
    result.notices += loose(result)
    result.notices += turned(result) or changed(result) or strained(result)
    result.notices += unstable(structure, u, result.slack) if result.converged else []
    said = result.report | {"branch": branches(snes, factor)}
    result.notices += limit(structure, said, [] if mode is None else moving(mode), kind)
    r.destroy()
    return result
