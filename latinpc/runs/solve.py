"""Solve a scene and report on it: what the command line, the article's tables and the tests all call."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

import numpy as np
from petsc4py import PETSc

import latinpc
from latinpc.laws import RIGID, UNILATERAL, Law
from latinpc.library import _latin
from latinpc.options import default_options, unknown_options
from latinpc.results.mechanics import slack
from latinpc.scenes.scene import Scene
from latinpc.structure import Structure

from .checkpoint import Keeper
from .reference import direct_solver, reference_solution
from .report import DECOMPOSITION, environment, plain, problem, snes_reason


@dataclass
class Result:
    """A solved scene; arrays are whole, in the scene's numbering, the same on every rank."""

    scene: Scene
    report: dict  #: JSON-able, with the keys that `solve` lists
    displacements: np.ndarray  #: (n, dim), m
    tensions: np.ndarray  #: (m,), N
    subdomain: np.ndarray | None = None  #: (m,), as the solver has it
    node_class: np.ndarray | None = None  #: (n,), 0 interior, 1 strong, 2 weak interface, 3 corner
    history: dict = field(default_factory=dict)  #: per iteration: indicator, error_l2, error_energy
    notices: list = field(default_factory=list)  #: sentences the user should read

    @property
    def converged(self):
        """Whether the solver has converged."""
        return self.report["converged"]


def solve(
    scene, options=None, *, subdomains=None, reference=None, digits=False, structure=None, comm=None, before_solve=None,
    increments=1, keeper=None,
):  # fmt: skip
    """Solve a scene with the SNES that the options name, `latin` by default; collective.

    Parameters
    ----------
    scene : Scene
        The same on every rank.
    options : dict, optional
        PETSc options without the leading dash, used where the user has not set them.
    subdomains : int, optional
        Number of subdomains that METIS makes when the scene has no partition.
    reference : bool or Vec, optional
        True computes a reference by Newton's method; a Vec is one. Gives the errors.
    digits : bool
        Compute `latinpc.digits`, the number of accurate digits.
    structure : Structure, optional
        That of this scene, for a series of solves that shares one.
    comm : communicator, optional
    before_solve : callable, optional
        Called with the SNES after its set-up.
    increments : int
        Number of equal load increments, each solved from an extrapolation of the last ones. Initial elongations and
        prescribed displacements apply in full from the first one.
    keeper : Keeper, optional
        Saves the state between increments.

    Returns
    -------
    Result
        Its report has the keys scene, scene_options, dofs, free_dofs, links, ranks, subdomains,
        strong_interfaces, weak_interfaces, strong_macro_dofs, weak_dofs, increments (iterations of each), iterations,
        linear_iterations, converged, reason, indicator, residual, residual_norm, slack_fraction, estimated_error,
        error_l2, error_energy, digits,
        direction, solver, setup_seconds, solve_seconds, peak_memory_bytes, versions, options. What does not apply is
        None.

    Raises
    ------
    ValueError, petsc4py.PETSc.Error
        On every rank. A solve that does not converge is no error: see ``report["reason"]``.
    """
    if increments < 1:
        raise ValueError(f"the loads need at least one increment, not {increments}")
    structure = Structure.from_scene(scene, comm) if structure is None else structure
    keeper = keeper or Keeper(structure.comm.tompi4py())
    settings = keeper.options | dict(options or {})
    if increments > 1:
        settings = {"snes_latin_warm_start": "extrapolate"} | settings
    if subdomains is not None:
        settings |= {f"{family}_latin_subdomains": subdomains for family in ("snes", "ksp", "pc")}
    notices = unknown_options()
    errors_against = None
    if isinstance(reference, PETSc.Vec):
        errors_against = reference
    elif reference:
        rigid = [law for law in RIGID if (scene.law == law).any()]
        if rigid:
            raise ValueError(
                f"no reference: Newton's method does not solve the rigid law {rigid[0].name.lower()}; leave it out, or"
                " give displacements to compare with"
            )
        notices += filter(None, direct_solver(structure.comm)[1:])
        errors_against = reference_solution(structure)
    with default_options(settings):
        snes = structure.create_snes()
        try:
            snes.setFromOptions()
            return _solve(scene, structure, snes, errors_against, notices, before_solve, increments, keeper, digits)
        finally:
            snes.destroy()


def _solve(scene, structure, snes, reference, notices, before_solve, increments, keeper, digits):
    """Set up, solve, and report; collective."""
    comm = structure.comm.tompi4py()
    is_latin = snes.getType() == "latin"
    ksp = snes.getKSP()
    linear = next((solver for solver in (ksp, ksp.getPC()) if not is_latin and solver.getType() == "latin"), None)
    if linear is not None:
        structure.attach(linear)
    if is_latin and reference is not None and increments == 1:
        latinpc.set_reference(snes, reference)
    u, r = structure.create_vec(), structure.create_vec()
    snes.computeFunction(u, r)
    initial = r.norm()

    comm.barrier()
    start = time.perf_counter()
    snes.setUp()
    comm.barrier()
    seconds = {"setup_seconds": time.perf_counter() - start}
    if before_solve is not None:
        before_solve(snes)
    start = time.perf_counter()
    with keeper.watching(snes):
        counts = _ramp(scene, structure, snes, u, increments, keeper)
    comm.barrier()
    seconds["solve_seconds"] = time.perf_counter() - start

    snes.computeFunction(u, r)
    tensions = latinpc.tensions(snes)
    past = {key: np.array(values) for key, values in latinpc.history(snes).items()} if is_latin else {}
    core = snes if is_latin else linear
    statistics = latinpc.statistics(core) if core is not None else {}
    report = {
        **problem(scene, structure),
        "solver": snes.getType() + (f" + {ksp.getType()} + {ksp.getPC().getType()}" if not is_latin else ""),
        **{key: statistics.get(key) for key in DECOMPOSITION},
        "direction": statistics.get("direction_mean"),
        **_convergence(snes, counts, past),
        "residual": r.norm() / initial if initial > 0 else r.norm(),
        "residual_norm": r.norm(),
        "slack_fraction": _slack_fraction(scene, tensions),
        **_accuracy(structure, snes, u, reference, digits, past),
        **seconds,
        **environment(comm),
    }
    return Result(
        scene=scene,
        report=plain(report),
        displacements=structure.displacements(u),
        tensions=tensions,
        subdomain=latinpc.subdomain_of_links(core) if core is not None else scene.subdomain,
        node_class=latinpc.node_classes(core) if core is not None else None,
        history=past,
        notices=notices + _notices(snes, scene, past),
    )


def _convergence(snes, counts, past):
    """Return the keys of the report on iterations and the stop."""
    steps = counts["linear" if snes.getType() == "ksponly" else "steps"]
    return {
        "increments": steps,
        "iterations": sum(steps),
        "linear_iterations": sum(counts["linear"]),
        "converged": snes.getConvergedReason() > 0,
        "reason": snes_reason(snes),
        "indicator": past["indicator"][-1] if len(past.get("indicator", ())) else None,
    }


def _accuracy(structure, snes, u, reference, digits, past):
    """Return the keys of the report on errors; collective."""
    error_l2, error_energy = structure.errors(u, reference) if reference is not None else (None, None)
    return {
        "estimated_error": latinpc.estimated_error(snes) if len(past.get("estimate", ())) else None,
        "error_l2": error_l2,
        "error_energy": error_energy,
        "digits": latinpc.digits(snes) if digits and snes.getConvergedReason() > 0 else None,
    }


def _notices(snes, scene, past):
    """Return the sentences that the user should read after a solve."""
    notices, reason = [], snes.getConvergedReason()
    if len(past.get("estimate", ())) and reason == PETSc.SNES.ConvergedReason.DIVERGED_INNER:
        least = latinpc.rounding_floor(snes)
        notices.append(f"the requested error is below the rounding error of this structure, about {least:.0e}")
    if snes.getType() == "latin" and reason < 0:
        notices += _causes(snes, scene)
    if snes.getType() == "ksponly" and (scene.law != Law.BAR).any():
        notices.append(
            "ksponly makes one linear step: it does not follow cables and compression-only links that slacken"
        )
    return notices


def _ramp(scene, structure, snes, u, increments, keeper):
    """Solve under loads that grow in equal increments; return the iterations of each."""
    keeper.about(scene, number_of_increments=increments)
    done, counts = keeper.resume(snes, u)
    counts = counts or {"steps": [], "linear": []}
    for k in range(done + 1, increments + 1):
        if increments > 1:
            structure.set_load(scene.load * (k / increments))
        snes.solve(None, u)
        counts["steps"].append(snes.getIterationNumber())
        counts["linear"].append(snes.getLinearSolveIterations())
        if snes.getConvergedReason() <= 0:
            break
        if k < increments:  # the last one is the result
            keeper.step(snes, k, counts, u)
            keeper.check()
    return counts


def _causes(snes, scene):
    """Return sentences on why a solve has not converged, where the links show it."""
    (jammed, links), (unsupported, nodes, distance) = _latin.jammed_links(snes), _latin.unsupported_nodes(snes)

    def listed(count, numbers):
        return ", ".join(map(str, numbers)) + (" and others" if count > len(numbers) else "")

    if jammed:
        return [f"no equilibrium: the gaps of the rigid links {listed(jammed, links)} are incompatible"]
    if unsupported and np.isinf(distance):
        return [f"no equilibrium: slack links no longer hold nodes {listed(unsupported, nodes)}"]
    if unsupported:
        text = "their loads are small beside the stiffness of the links that stop them, or there is no equilibrium"
        return [f"slack links do not hold nodes {listed(unsupported, nodes)} yet: {text}"]
    if (scene.law == Law.FRICTION).any():
        return ["contacts with friction: neither an equilibrium nor convergence is certain"]
    return []


def _slack_fraction(scene, tensions):
    unilateral = np.count_nonzero(np.isin(scene.law, UNILATERAL))
    return np.count_nonzero(slack(scene, tensions)) / unilateral if unilateral else 0.0
