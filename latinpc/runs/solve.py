"""Solve a scene and report on it: what the command line, the article's tables and the tests all call."""

from __future__ import annotations

import time

import numpy as np
from petsc4py import PETSc

from latinpc import accuracy, solvers
from latinpc.arrays import alike, communicator
from latinpc.laws import RIGID
from latinpc.options import default_options, given_options, subdomain_options, unknown_options
from latinpc.results.limit import bearing
from latinpc.results.mechanics import relative
from latinpc.results.notices import errors_as_given, magnitudes
from latinpc.results.report import plain
from latinpc.results.solve import attach_linear, gather
from latinpc.settings import set_reference
from latinpc.structure import Structure

from .checkpoint import Keeper
from .reference import direct_solver, reference_solution
from .report import environment


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
        Number of equal increments of the loads and prescribed displacements, each solved from an extrapolation of the
        last ones. Initial elongations apply in full from the first one.
    keeper : Keeper, optional
        Saves the state between increments.

    Returns
    -------
    latinpc.Result
        Its report has, besides those of `latinpc.results.solve.gather`, the keys scene_options, load_cases (their
        number; none of them acts), increments (iterations of each), residual, error_l2, error_energy, error_tension,
        digits, setup_seconds, solve_seconds, peak_memory_bytes, versions, options. What does not apply is None. Of
        large displacements in increments also load_path: of each the part of the loads borne, and the largest
        displacement (m).

    Raises
    ------
    ValueError, LatinError
        On every rank. A solve that does not converge is no error: see ``report["reason"]``.
    """
    comm = communicator(comm) if structure is None else structure.comm
    same = {"options": options, "subdomains": subdomains, "digits": digits, "increments": increments}
    alike(comm.tompi4py(), **same, reference=reference if isinstance(reference, bool) else reference is not None)
    if increments < 1:
        raise ValueError(f"the loads need at least one increment, not {increments}")
    structure = Structure.from_scene(scene, comm) if structure is None else structure
    keeper = keeper or Keeper(comm.tompi4py())
    settings = keeper.options | given_options(options) | subdomain_options(subdomains)
    if increments > 1:
        settings = {"snes_latin_warm_start": "extrapolate"} | settings
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
    with default_options(settings), errors_as_given(structure):
        snes = structure.create_snes()
        try:
            snes.setFromOptions()
            result = _solve(scene, structure, snes, errors_against, before_solve, increments, keeper, digits)
        finally:
            snes.destroy()
    result.notices = [*notices, *result.notices, *magnitudes(result)]
    return result


def _solve(scene, structure, snes, reference, before_solve, increments, keeper, digits):
    """Set up, solve, and report; collective."""
    comm = structure.comm.tompi4py()
    core = attach_linear(structure, snes)
    if snes.getType() == "latin" and reference is not None and increments == 1:
        set_reference(snes, reference)
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

    result = gather(structure, snes, core, u, len(counts["steps"]) / increments)
    steps, residual = counts["linear" if snes.getType() == "ksponly" else "steps"], result.report["residual_norm"]
    errors = (None,) * 3
    if reference is not None:
        errors = (*structure.errors(u, reference), _tension_error(structure, u, reference))
    report = {
        "scene_options": scene.metadata,
        "load_cases": sum(not case.part for case in scene.cases),
        "increments": steps,
        "iterations": sum(steps),
        "linear_iterations": sum(counts["linear"]),
        **({"load_path": counts["path"]} if "path" in counts else {}),
        "residual": residual / initial if initial > 0 and residual is not None else residual,
        **dict(zip(("error_l2", "error_energy", "error_tension"), errors)),
        "digits": accuracy.digits(snes) if digits and result.converged else None,
        **seconds,
        **environment(comm),
    }
    result.report.update(plain(report))
    return result


def _tension_error(structure, u, reference):
    """Return the relative error of the tensions, l2 norm over all links; None with rigid laws; collective."""
    if np.isin(structure.law, RIGID).any():
        return None
    return relative(structure.tensions(u), structure.tensions(reference))


def _ramp(scene, structure, snes, u, increments, keeper):
    """Solve under loads and prescribed displacements that grow in equal increments; return the iterations of each."""
    keeper.about(scene, number_of_increments=increments)
    done, counts = keeper.resume(snes, u)
    counts = counts or {"steps": [], "linear": []}
    for k in range(done + 1, increments + 1):
        if increments > 1:
            structure.set_load(scene.load * (k / increments))
            structure.set_prescribed(scene.prescribed * (k / increments))
        snes.solve(None, u)
        if structure.geometry == "large" and increments > 1:
            factor = solvers.path(snes)["borne"] if snes.getType() == "latin" else 1.0
            with bearing(snes, structure, factor):
                largest = np.linalg.norm(structure.displacements(u), axis=1).max()
            counts.setdefault("path", []).append([float(factor * k / increments), float(largest)])
        counts["steps"].append(snes.getIterationNumber())
        counts["linear"].append(snes.getLinearSolveIterations())
        if snes.getConvergedReason() <= 0:
            break
        if k < increments:  # the last one is the result
            keeper.step(snes, k, counts, u)
            keeper.check()
    return counts
