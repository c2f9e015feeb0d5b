"""Solve a scene and report on it: what the command line, the article's tables and the tests all call."""

from __future__ import annotations

import contextlib
import difflib
import platform
import resource
import time
from dataclasses import dataclass, field

import mpi4py
import numpy as np
import petsc4py
from petsc4py import PETSc

import latinpc

from .checkpoint import Keeper
from .io import slack
from .library import _latin
from .links import Links
from .scenes.scene import RIGID, UNILATERAL, Law, Scene
from .solvers import has_package

#: Options of our own, after ``-snes_latin_``, ``-ksp_latin_``, ``-pc_latin_``; the last are prefixes of inner solvers.
OPTIONS = (
    "variant", "modes", "subdomains", "subdomain_links", "partition_repair", "direction", "direction_scalar",
    "direction_fraction", "corners", "promote", "monitor", "stop", "error", "error_norm", "warm_start",
    "warm_extrapolate", "polish",
    "modes_local", "modes_local_max", "modes_local_slack", "rescue", "balance",
)  # fmt: skip
PC_OPTIONS = ("weights", "condense")  # of PC latin alone
INNER_PREFIXES = ("local_", "interior_", "coarse_", "outer_", "polish_", "rescue_")

REFERENCE_ACCURACY = 1e-9  # relative residual above which a reference is refused


@dataclass
class Result:
    """A solved scene; arrays are whole, in the scene's numbering, on every rank."""

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
        """Whether the solver says so."""
        return self.report["converged"]


@contextlib.contextmanager
def default_options(options):
    """Put options in PETSc's database where the user has not set them, and take them out again.

    Parameters
    ----------
    options : dict
        Names without the leading dash; a value of None makes a flag.
    """
    database = PETSc.Options()
    ours = {name: value for name, value in (options or {}).items() if not database.hasName(name)}
    for name, value in ours.items():
        database.setValue(name, str(value).lower() if isinstance(value, bool) else value)
    try:
        yield
    finally:
        for name in ours:
            database.delValue(name)


def unknown_options():
    """Return a sentence for each option that bears our prefix and that nobody reads."""
    sentences = []
    for name in PETSc.Options().getAll():
        for prefix in ("snes_latin_", "ksp_latin_", "pc_latin_"):
            start = name.find(prefix)  # after the user's own prefix, if any
            key = name[start + len(prefix) :]
            if start >= 0 and key not in OPTIONS + PC_OPTIONS and not key.startswith(INNER_PREFIXES):
                near = difflib.get_close_matches(key, OPTIONS + PC_OPTIONS, n=1, cutoff=0.5)
                cure = f"do you mean -{name[:start]}{prefix}{near[0]}?" if near else "see -help"
                sentences.append(f"unknown option -{name}: {cure}")
    return sentences


# ---- the solve -------------------------------------------------------------------------------


def solve(
    scene, options=None, *, subdomains=None, reference=None, digits=False, links=None, comm=None, before_solve=None,
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
        How many subdomains METIS makes when the scene brings no partition.
    reference : bool or Vec, optional
        True computes a reference by Newton's method; a Vec is one. Gives the errors.
    digits : bool
        Ask `latinpc.digits` how many digits of the solution there are.
    links : Links, optional
        Of this scene, so that a series of solves shares one.
    comm : communicator, optional
    before_solve : callable, optional
        Called with the SNES after its set-up.
    increments : int
        The loads grow in so many equal increments, each solve from where the last ones lead to; prestrains and
        prescribed displacements are whole from the first one on.
    keeper : Keeper, optional
        Keeps the state between increments.

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
        raise ValueError(f"the loads grow in at least one increment, not {increments}")
    links = Links.from_scene(scene, comm) if links is None else links
    keeper = keeper or Keeper(links.comm.tompi4py())
    settings = keeper.options | dict(options or {})
    if increments > 1:
        settings = {"snes_latin_warm_start": True, "snes_latin_warm_extrapolate": True} | settings
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
                f"no reference: Newton's method has none for the rigid law {rigid[0].name.lower()}; leave it out, or"
                " give displacements to compare with"
            )
        notices += filter(None, direct_solver(links.comm)[1:])
        errors_against = reference_solution(links)
    with default_options(settings):
        snes = links.create_snes()
        try:
            snes.setFromOptions()
            return _solve(scene, links, snes, errors_against, notices, before_solve, increments, keeper, digits)
        finally:
            snes.destroy()


def _solve(scene, links, snes, reference, notices, before_solve, increments, keeper, digits):
    comm = links.comm.tompi4py()
    is_latin = snes.getType() == "latin"
    ksp = snes.getKSP()
    pc = ksp.getPC()
    linear = next((solver for solver in (ksp, pc) if not is_latin and solver.getType() == "latin"), None)
    if linear is not None:
        links.attach(linear)
    if is_latin and reference is not None and increments == 1:
        latinpc.set_reference(snes, reference)
    u, r = links.create_vec(), links.create_vec()
    links.residual(u, r)
    initial = r.norm()

    comm.barrier()
    start = time.perf_counter()
    snes.setUp()
    comm.barrier()
    setup = time.perf_counter() - start
    if before_solve is not None:
        before_solve(snes)
    start = time.perf_counter()
    with keeper.watching(snes):
        counts = _ramp(scene, links, snes, u, increments, keeper)
    comm.barrier()
    duration = time.perf_counter() - start

    links.residual(u, r)
    norm = r.norm()
    tensions = links.tensions(u)
    past = {key: np.array(values) for key, values in latinpc.history(snes).items()} if is_latin else {}
    if len(past.get("estimate", ())) and snes.getConvergedReason() == PETSc.SNES.ConvergedReason.DIVERGED_INNER:
        least = latinpc.rounding_floor(snes)
        notices.append(f"the error asked for is below what rounding leaves on this structure, about {least:.0e}")
    notices += _causes(snes, scene) if is_latin and snes.getConvergedReason() < 0 else []
    core = snes if is_latin else linear
    statistics = latinpc.statistics(core) if core is not None else {}
    ksponly = snes.getType() == "ksponly"
    if ksponly and (scene.law != Law.BAR).any():
        notices.append("ksponly makes one linear step: cables and struts that become slack are not followed")
    error_l2, error_energy = links.errors(u, reference) if reference is not None else (None, None)
    sizes = links.sizes
    report = {
        "scene": scene.name,
        "scene_options": scene.metadata,
        "dofs": sizes.nodes * sizes.dim,
        "free_dofs": sizes.free_dofs,
        "links": sizes.links,
        "ranks": comm.size,
        "solver": snes.getType() + (f" + {ksp.getType()} + {pc.getType()}" if not is_latin else ""),
        **{
            key: statistics.get(key)
            for key in ("subdomains", "strong_interfaces", "weak_interfaces", "strong_macro_dofs", "weak_dofs")
        },
        "direction": statistics.get("direction_mean"),
        "increments": counts["linear" if ksponly else "steps"],
        "iterations": sum(counts["linear" if ksponly else "steps"]),
        "linear_iterations": sum(counts["linear"]),
        "converged": snes.getConvergedReason() > 0,
        "reason": _reason(snes),
        "indicator": _last(past.get("indicator")),
        "residual": norm / initial if initial > 0 else norm,
        "residual_norm": norm,
        "slack_fraction": _slack_fraction(scene, tensions),
        "estimated_error": snes.getFunctionNorm() if len(past.get("estimate", ())) else None,
        "error_l2": error_l2,
        "error_energy": error_energy,
        "digits": latinpc.digits(snes) if digits and snes.getConvergedReason() > 0 else None,
        "setup_seconds": setup,
        "solve_seconds": duration,
        "peak_memory_bytes": comm.allreduce(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024),
        "versions": versions(),
        "options": dict(PETSc.Options().getAll()),
    }
    return Result(
        scene=scene,
        report=plain(report),
        displacements=links.displacements(u),
        tensions=tensions,
        subdomain=latinpc.subdomain_of_links(core) if core is not None else scene.subdomain,
        node_class=latinpc.node_classes(core) if core is not None else None,
        history=past,
        notices=notices,
    )


def _ramp(scene, links, snes, u, increments, keeper):
    """Solve under loads that grow in equal increments; return the iterations of each."""
    keeper.about(scene, number_of_increments=increments)
    done, counts = keeper.resume(snes, u)
    counts = counts or {"steps": [], "linear": []}
    for k in range(done + 1, increments + 1):
        if increments > 1:
            links.set_load(scene.load * (k / increments))
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
    """Return sentences on why a solve has not converged, where links tell."""
    (jammed, links), (loose, nodes, way) = _latin.jammed_links(snes), _latin.loose_nodes(snes)

    def listed(count, numbers):
        return ", ".join(map(str, numbers)) + (" and others" if count > len(numbers) else "")

    if jammed:
        return [f"no equilibrium: no displacement meets the gaps of the rigid links {listed(jammed, links)} together"]
    if loose and np.isinf(way):
        text = "slack links no longer hold nodes"
        return [f"no equilibrium: {text} {listed(loose, nodes)}, which the loads move without end"]
    if loose:
        text = "their loads are small beside the stiffness of the links that are to stop them"
        return [f"nothing holds nodes {listed(loose, nodes)} yet: {text}, or there is no equilibrium"]
    if (scene.law == Law.FRICTION).any():
        return ["contacts with friction: no equilibrium is certain, nor that the iteration finds one"]
    return []


def _last(values):
    return None if values is None or not len(values) else values[-1]


def _slack_fraction(scene, tensions):
    unilateral = np.count_nonzero(np.isin(scene.law, UNILATERAL))
    return np.count_nonzero(slack(scene, tensions)) / unilateral if unilateral else 0.0


def _name(reasons, value):
    """Return the name of a converged reason; petsc4py keeps them as attributes of a class."""
    names = {getattr(reasons, name): name for name in dir(reasons) if name.startswith(("CONVERGED_", "DIVERGED_"))}
    return names.get(value, str(value))


def _reason(snes):
    text = _name(PETSc.SNES.ConvergedReason, snes.getConvergedReason())
    if text == "DIVERGED_LINEAR_SOLVE":
        text += f" (KSP {_name(PETSc.KSP.ConvergedReason, snes.getKSP().getConvergedReason())})"
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


# ---- the reference ---------------------------------------------------------------------------


def direct_solver(comm):
    """Return the Cholesky factorisation that this PETSc has for that many ranks; not collective.

    Returns
    -------
    (str, str or None)
        Its name for ``-pc_factor_mat_solver_type``, and a notice when it is second best.
    """
    wanted, package = ("cholmod", "suitesparse") if comm.size == 1 else ("mumps", "mumps")
    if has_package(package):
        return wanted, None
    if has_package("mumps"):
        return "mumps", "this PETSc has no CHOLMOD: MUMPS factors the reference"
    return "petsc", "this PETSc has neither CHOLMOD nor MUMPS: its own Cholesky factors the reference"


def reference_solution(links):
    """Solve the structure by Newton's method with a direct solver, to rounding; collective.

    The energy is convex and its gradient piecewise linear, so full Newton steps end in a few iterations as
    a rule. Where slack links leave a mechanism the tangent stiffness is singular: then it is shifted, which
    makes proximal steps, and if they still go astray they are damped along the energy's slope. Options are
    read with the prefix ``reference_``.

    Parameters
    ----------
    links : Links

    Returns
    -------
    Vec

    Raises
    ------
    RuntimeError
        On every rank, when no variant reaches a relative residual of 1e-9.
    """
    u, r, best = links.create_vec(), links.create_vec(), None
    links.residual(u, r)
    initial = r.norm()
    if initial == 0:
        return u
    for search, shift in (("none", 0.0), ("none", 1e-9), ("cp", 1e-8), ("cp", 1e-6)):
        u.set(0.0)
        with contextlib.suppress(PETSc.Error):  # a singular factor: the next variant shifts it
            _newton(links, u, search, shift)
        links.residual(u, r)
        residual = r.norm() / initial
        if residual <= REFERENCE_ACCURACY:
            return u
        best = residual if best is None or residual < best else best
    raise RuntimeError(
        f"no reference: Newton's method stops at a relative residual of {best:.1e}; is the structure held"
        " when its slack cables are taken away?"
    )


def _newton(links, u, search, shift):
    comm = links.comm
    snes = PETSc.SNES().create(comm)
    try:
        links.attach(snes)
        snes.setOptionsPrefix("reference_")
        snes.setType("newtonls")
        # an absolute floor at rounding; the step decides when the residual has reached it
        snes.setTolerances(rtol=1e-12, atol=1e-50, stol=1e-14, max_it=60 if not shift else 400)
        ksp = snes.getKSP()
        ksp.setType("preonly")
        ksp.getPC().setType("cholesky")
        package = direct_solver(comm)[0]
        ksp.getPC().setFactorSolverType(package)
        if package == "cholmod":  # its own ordering fills structures of a hundred thousand links too much
            ksp.getPC().setFactorOrdering("nd")
        if shift:
            _shift(links, snes, shift)
        # a step that makes links slack may raise the residual by orders before the next ones end it
        defaults = {"reference_snes_linesearch_type": search, "reference_snes_divergence_tolerance": -1}
        with default_options(defaults):
            snes.setFromOptions()
        snes.solve(None, u)
    finally:
        snes.destroy()


def _shift(links, snes, fraction):
    """Add that fraction of the mean diagonal to the tangent: mechanisms of slack links get a little stiffness."""
    matrix = links.dm.createMat()
    matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)

    def jacobian(snes, u, J, P):
        links.jacobian(u, P)
        diagonal = P.getDiagonal()
        P.shift(fraction * diagonal.sum() / max(diagonal.getSize(), 1))

    snes.setJacobian(jacobian, matrix, matrix)
