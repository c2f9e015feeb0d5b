"""Solve load cases on one set-up: the forces of every link in every case, their envelope, and which links slacken."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from latinpc import errors, solvers
from latinpc.arrays import REAL, agreed, alike, communicator, native, same_arrays
from latinpc.errors import LatinError, error_message
from latinpc.laws import RIGID, UNILATERAL, Law
from latinpc.library import _latin
from latinpc.options import default_options, given_options, subdomain_options, unknown_options
from latinpc.results.limit import bearing, borne, branches, moving, softest, unstable
from latinpc.results.mechanics import slack, stresses, utilisations
from latinpc.results.notices import ConvergenceWarning, causes, errors_as_given, implausible, limit, one_step, warn
from latinpc.results.report import plain, problem, snes_reason
from latinpc.results.solve import attach_linear
from latinpc.results.unread import unread
from latinpc.scenes.case import PARTS, Case
from latinpc.scenes.scene import Scene
from latinpc.structure import Structure

from .casenotices import free, stretched, too_far
from .report import environment
from .solvedcases import Cases

#: Cases of a rank that are solved side by side. Two take as long as one after the other on 48 x 48 modules of the grid,
#: a third to nine tenths of that on five other structures; one takes up to 1.6 times as long.
FEWEST = 2
REFUSALS = (
    errors.ARG_WRONG, errors.ARG_OUTOFRANGE, errors.ARG_WRONGSTATE, errors.ARG_INCOMP, errors.MAT_CH_ZRPVT,
)  # fmt: skip
AS_PRESTRESS = (
    ". Geometry prestress takes initial elongations of a case, as those of temperature, as prestress of the structure"
    " as drawn: take -snes_latin_geometry large"
)
SKETCH = 256  # numbers that stand for the actions of a case: more than cases are independent


def solve_cases(
    scene: Scene | Structure,
    cases: Sequence[Case] | None = None,
    options: Mapping[str, Any] | None = None,
    *,
    subdomains: int | None = None,
    comm: Any = None,
    each_case: Callable[[int, str], Any] | None = None,
) -> Cases:
    """Solve load cases on one set-up; collective.

    Parameters
    ----------
    scene : Scene or latinpc.Structure
        What acts in every case; the same on every rank. A structure stays as it is.
    cases : sequence of Case, optional
        Those of the scene, without parts of combinations, when not given.
    options : dict, optional
        PETSc options without the leading dash, used where the user has not set them.
    subdomains : int, optional
        Number of subdomains that METIS makes when the scene has no partition.
    comm : communicator, optional
    each_case : callable, optional
        Called with the number, from 0, and the name of each case when its solution begins; side by side all begin at
        once.

    Returns
    -------
    Cases
        Its report has the keys of a solve on scene, size and environment; solver, seconds (of set-up and solves), and
        cases, a list of dicts with name, iterations, together (solved side by side), converged, reason, displacement
        (the largest, m), lowest and highest (force, N), slack (links); of structures with areas largest_stress (Pa),
        with strengths largest_utilisation; of large displacements also load_factor, the part of the loads that the
        displacements bear.

    Warns
    -----
    latinpc.LatinWarning
        For each of its notices: what looks wrong, and why a case has not converged.
    latinpc.ConvergenceWarning
        Of the cases that have not converged, by name.

    Raises
    ------
    ValueError, LatinError
        On every rank, where the library refuses all cases. A case that does not converge is no error, nor is one that
        is refused beside others: its reason is ``REFUSED``, and a notice that begins with its name says why. Neither
        has results: displacements, tensions and reactions are NaN, unless they are those of a part of the loads.

    Notes
    -----
    Cases of bars, cables and compression-only links are solved side by side, with one factor of the stiffness with all
    links taut and one sweep over the links for all of them, to the accuracy that is asked of each
    (``SNESLatinSolveCases()``). Several ranks share the cases, each with the whole structure.

    Cases with other laws or large displacements, a single case of a rank, or cases under options that need the
    iteration are solved one after the other by all ranks, and so are those that have not converged side by side. A
    solve then starts from the combination of cases solved like this whose actions are nearest to its own: for bars
    alone that is the solution where actions are combinations of earlier ones. Structures with rigid laws start anew,
    since their solutions need not be unique; so do those of other links than cables where links turn, in geometry
    prestress or large.
    """
    if isinstance(scene, Structure):
        scene, comm = Scene.from_structure(scene), scene.comm if comm is None else comm
    comm = communicator(comm)
    cases = agreed(comm.tompi4py(), _checked, scene, cases)  # what does not fit is refused before any is solved
    names = [case.name for case in cases]
    alike(comm.tompi4py(), cases=names, options=options, subdomains=subdomains)
    acts = {f"{part} of case {case.name}": values for case in cases for part, values in zip(PARTS, case.parts)}
    same_arrays(comm.tompi4py(), **acts)
    structure = Structure.from_scene(scene, comm)
    given = given_options(options)
    settings = given | subdomain_options(subdomains)
    notices = [*unknown_options(), *structure.notices, *implausible(structure)]
    start = time.perf_counter()
    with default_options(settings) as ours, errors_as_given(structure):
        series = _Series(structure, scene, cases, each_case)
        try:
            series.solve_together()
            series.solve_rest()
            notices += one_step(series.snes, structure)
            unused = unread(structure.comm, [name for name in ours if name in given])
            report = {
                **problem(structure),
                "solver": series.snes.getType(),
                "seconds": time.perf_counter() - start,
                "cases": series.rows(),
                **environment(structure.comm.tompi4py()),
            }
        finally:
            series.snes.destroy()
    notices += [*series.notices, *unused]
    found = series.displacements, series.tensions, series.slack
    kept = replace(scene, **{name: getattr(scene, name).copy() for name in PARTS}), [replace(case) for case in cases]
    result = Cases(kept[0], names, plain(report), *found, notices, kept[1], structure.geometry)
    notices += stretched(result) + too_far(result) + free(result)
    for notice in notices:
        warn(structure.comm, notice)
    if not result.converged:
        warn(structure.comm, f"not converged: {'; '.join(failed(result))}", ConvergenceWarning)
    return result


def _checked(scene, cases):
    """Return the cases to solve; not collective."""
    if isinstance(cases, Case):
        raise TypeError(f"cases must be a list, such as [{cases.name}], not a single latinpc.Case")
    cases = [case for case in scene.cases if not case.part] if cases is None else list(cases)
    if not cases:
        raise ValueError(f"{scene.name} has no load case to solve: write [[case]] in its TOML file, or give a Case")
    for case in cases:
        if not isinstance(case, Case):
            raise TypeError(f"a load case is a latinpc.Case, such as Case('snow', load=...), not {case!r:.40}")
        case.check(scene)
    names = [case.name for case in cases]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ValueError(f"load cases have the same name, {', '.join(twice)}: tell them apart with Case.named()")
    return cases


def failed(cases: Cases) -> list[str]:
    """Return the names of the cases that have not converged, each with PETSc's reason."""
    return [f"{case['name']}: {case['reason']}" for case in cases.report["cases"] if not case["converged"]]


class _Series:
    """Cases of one structure and what is known of them; methods are collective."""

    def __init__(self, structure, scene, cases, each_case):
        self.structure, self.scene, self.cases = structure, scene, cases
        self.snes = structure.create_snes()
        self.snes.setFromOptions()
        attach_linear(structure, self.snes)
        self.displacements = np.zeros((len(cases), *scene.nodes.shape), REAL)
        self.tensions = np.zeros((len(cases), len(scene.links)), REAL)
        self.found = [None] * len(cases)  # iterations, whether side by side, converged, reason, load factor
        self.notices = []
        self._say = each_case or (lambda number, name: None)

    def solve_together(self):
        """Solve the cases side by side, as far as that goes; each rank its share."""
        comm = self.structure.comm.tompi4py()
        if self.snes.getType() != "latin" or len(self.cases) < FEWEST * comm.size:
            return
        for number, case in enumerate(self.cases):
            self._say(number, case.name)
        stages = np.zeros(len(self.cases), PETSc.IntType)
        failure = None
        try:
            self._share(range(comm.rank, len(self.cases), comm.size), stages)
        except Exception as error:  # whatever it is, the other ranks wait for this one
            failure = error
        said = comm.allgather(None if failure is None else f"{failure}".splitlines()[-1:])  # the sentence is the last
        if any(text is not None for text in said):
            raise failure or RuntimeError(next(" ".join(text) for text in said if text is not None))
        for array in (stages, self.displacements, self.tensions) if comm.size > 1 else ():
            comm.Allreduce(MPI.IN_PLACE, array)
        for number in np.flatnonzero(stages > 0):
            self.found[number] = int(stages[number]), True, True, "CONVERGED_SNORM_RELATIVE", None

    def _share(self, numbers, stages):
        """Solve the cases of this rank on a structure of its own."""
        alone = self.structure.comm.size == 1
        structure = self.structure if alone else Structure.from_scene(self.scene, PETSc.COMM_SELF)
        snes = self.snes if alone else structure.create_snes()
        if not alone:
            snes.setFromOptions()
        parts = zip(*[[None if part is None else native(part) for part in self.cases[i].parts] for i in numbers])
        load, prescribed, elongation = parts
        places = [[array[i] for i in numbers] for array in (self.displacements, self.tensions)]
        mine = np.zeros(len(numbers), PETSc.IntType)
        _latin.solve_cases(snes, load, prescribed, elongation, *places, mine)
        stages[numbers] = mine
        if not alone:
            snes.destroy()

    def solve_rest(self):
        """Solve the other cases one after the other, on all ranks."""
        structure, snes = self.structure, self.snes
        u = structure.create_vec()
        start = _Start(self.scene) if self._unique() else None
        refused = None
        for number, case in enumerate(self.cases):
            if self.found[number] is not None:
                continue
            self._say(number, case.name)
            applied = case.applied(self.scene)
            u.set(0.0)
            if start is not None:
                start.predict(applied, u)
            try:
                structure.set_load(applied.load)
                structure.set_prescribed(applied.prescribed)
                structure.set_initial_elongation(applied.initial_elongation)
                snes.solve(None, u)
            except PETSc.Error as error:
                refused = LatinError(error.ierr, f"case {case.name}: {error_message(error)}", str(error))
                if error.ierr not in REFUSALS:
                    raise refused from None
                self.found[number] = 0, False, False, "REFUSED", None
                self.displacements[number] = self.tensions[number] = np.nan
                drawn = structure.geometry == "prestress" and case.initial_elongation is not None
                refused.said += AS_PRESTRESS if drawn and error.ierr == errors.MAT_CH_ZRPVT else ""
                self.notices.append(structure.counted_as_given(refused.said))
                continue
            converged = snes.getConvergedReason() > 0
            if start is not None and converged:
                start.keep(u)
            factor = borne(snes, structure)
            with bearing(snes, structure, factor):
                found = structure.displacements(u), solvers.tensions(snes)
            known = converged or factor is not None  # iterates are no results, the end of a path is one
            self.displacements[number], self.tensions[number] = found if known else (np.nan, np.nan)
            linear = snes.getType() == "ksponly"
            iterations = snes.getLinearSolveIterations() if linear else snes.getIterationNumber()
            self.found[number] = iterations, False, converged, snes_reason(snes), factor
            with bearing(snes, structure, factor):
                self._explain(number, u)
        u.destroy()
        if refused is not None and all(found[3] == "REFUSED" for found in self.found):
            raise refused

    def _unique(self):
        """Whether a case has one equilibrium, wherever it starts: not with rigid laws, nor where struts may buckle."""
        turns = self.structure.geometry != "linear" and (self.scene.law != Law.CABLE).any()
        return not turns and not np.isin(self.scene.law, RIGID).any()

    def _explain(self, number, u):
        """Note what a solve by itself says of a case that has just been solved: unstable, or not converged."""
        structure, snes, (*_, converged, reason, factor) = self.structure, self.snes, self.found[number]
        if converged:
            said = unstable(structure, u, slack(self.scene, self.tensions[number]))
            self.notices += [f"case {self.cases[number].name}: {text}" for text in said]
            return
        past = solvers.history(snes) if snes.getType() == "latin" else {}
        said = causes(snes, structure, past)
        if factor is not None and factor < 1.0:
            mode, kind = softest(structure, u, self.tensions[number], factor == 0.0)
            nodes = [] if mode is None else moving(mode)
            report = {"reason": reason, "load_factor": factor, "branch": branches(snes, factor)}
            said += limit(structure, report, nodes, kind)
        self.notices += [f"case {self.cases[number].name}: {text}" for text in said]

    def rows(self):
        """Return a row a case for the report, and note the slack links."""
        self.slack = slack(self.scene, self.tensions) & np.isin(self.scene.law, UNILATERAL)
        rows = []
        for number, (iterations, together, converged, reason, factor) in enumerate(self.found):
            moved, tensions = self.displacements[number], self.tensions[number]
            rows.append({
                "name": self.cases[number].name,
                "iterations": iterations,
                "together": together,
                "converged": converged,
                "reason": reason,
                "displacement": np.sqrt(np.einsum("ij,ij->i", moved, moved).max()),
                "lowest": tensions.min(),
                "highest": tensions.max(),
                "slack": None if np.isnan(tensions).any() else np.count_nonzero(self.slack[number]),
                **self._largest(tensions),
                **({} if factor is None else {"load_factor": factor}),
            })  # fmt: skip
        return rows

    def _largest(self, tensions):
        """Return the largest stress and utilisation of a case, where areas and strengths are known."""
        found = {"stress": stresses(self.scene, tensions), "utilisation": utilisations(self.scene, tensions)}
        sizes = {name: np.abs(values) for name, values in found.items() if values is not None}
        return {f"largest_{name}": np.fmax.reduce(values) for name, values in sizes.items()}


class _Start:
    """Where a case starts: the combination of solved cases with the nearest actions.

    Of all combinations with these actions it is the one of the nearest cases, weights growing with the square of their
    distance, since a nonlinear response is nearly linear between near cases. Actions are compared as forces, by sums
    over random groups of them.
    """

    def __init__(self, scene):
        stiffness = np.where(scene.stiffness > 0.0, scene.stiffness, scene.stiffness.mean() or 1.0)
        self._scale = np.concatenate([
            np.ones(scene.load.size), stiffness, np.full(scene.load.size, stiffness.mean())
        ])  # fmt: skip
        rng = np.random.default_rng(0)
        self._group = rng.integers(0, SKETCH, self._scale.size)
        self._scale *= rng.choice([-1.0, 1.0], self._scale.size)
        self._actions, self._solutions, self._now = [], [], None

    def predict(self, case, u):
        """Write the start of a case into u; zero for the first."""
        actions = np.concatenate([
            np.where(case.fixed, 0.0, case.load).ravel(), case.initial_elongation, case.prescribed.ravel()
        ])  # fmt: skip
        self._now = np.bincount(self._group, self._scale * actions, SKETCH)
        if not self._actions:
            return
        known = np.array(self._actions).T
        distance = np.linalg.norm(known - self._now[:, None], axis=0)
        least = 1e-9 * (np.linalg.norm(self._now) or 1.0)
        weight = (least / np.maximum(distance, least)) ** 2
        weight /= weight.max()
        factors = weight * np.linalg.lstsq(known * weight, self._now, rcond=1e-8)[0]
        for factor, solution in zip(factors, self._solutions):
            u.axpy(factor, solution)

    def keep(self, u):
        """Keep the solution of the case that was predicted last."""
        self._actions.append(self._now)
        self._solutions.append(u.copy())
