"""Solve load cases on one set-up: the forces of every link in every case, their envelope, and which links slacken."""

from __future__ import annotations

import pathlib
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from latinpc import solvers
from latinpc.laws import RIGID, UNILATERAL
from latinpc.options import default_options, unknown_options
from latinpc.results.caselist import text
from latinpc.results.mechanics import slack
from latinpc.results.report import plain, problem, snes_reason
from latinpc.results.solve import attach_linear
from latinpc.scenes.scene import Scene
from latinpc.structure import Structure

from .report import environment

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from latinpc.scenes.case import Case

SKETCH = 256  # numbers that stand for the actions of a case: more than cases are independent


@dataclass(repr=False)
class Cases:
    """Solved load cases; the same on every rank. Cases that have not converged are in no envelope.

    ``print(cases)`` gives a table and the extremes.
    """

    scene: Scene
    names: list[str]
    report: dict[str, Any]  #: JSON-able, with the keys that `solve_cases` lists
    displacements: np.ndarray  #: (cases, n, dim), m
    tensions: np.ndarray  #: (cases, m), N
    slack: np.ndarray  #: (cases, m), of bool: links that bear nothing
    notices: list[str]  #: sentences the user should read

    @property
    def converged(self) -> bool:
        """Whether all cases have converged."""
        return bool(self._good.all())

    @property
    def _good(self) -> np.ndarray:
        return np.array([case["converged"] for case in self.report["cases"]], dtype=bool)

    def __repr__(self) -> str:
        return text(self)

    def plot(self) -> Figure:
        """Draw the envelope, the greatest tension and the greatest compression of each link, on one scale.

        Returns
        -------
        matplotlib.figure.Figure
            Which notebooks show; ``figure.savefig("envelope.png")`` writes it.
        """
        from latinpc.results.envelope import envelope_figure

        return envelope_figure(self)

    def to_csv(self, path: str | pathlib.Path) -> None:
        """Write a row for each link: extreme forces (N), their cases, where it is slack; call it on one rank."""
        from latinpc.results.envelope import write_envelope

        write_envelope(path, self)

    def envelope(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return the lowest and the highest force of each link, and the cases that give them.

        Returns
        -------
        lowest, highest : (m,) array of float
            In N, compression negative; NaN where no case has converged.
        lowest_case, highest_case : (m,) array of int
            Numbers of cases, from 0; -1 where none has converged.
        """
        good = np.flatnonzero(self._good)
        if not good.size:
            none, nowhere = np.full(len(self.scene.links), np.nan), np.full(len(self.scene.links), -1)
            return none, none, nowhere, nowhere
        forces = self.tensions[good]
        low, high = forces.argmin(axis=0), forces.argmax(axis=0)
        link = np.arange(forces.shape[1])
        return forces[low, link], forces[high, link], good[low], good[high]

    def slack_cases(self) -> np.ndarray:
        """Return for each link the number of cases in which it bears nothing, (m,) of int."""
        return (self.slack & self._good[:, None]).sum(axis=0)


def solve_cases(
    scene: Scene,
    cases: Sequence[Case] | None = None,
    options: Mapping[str, Any] | None = None,
    *,
    subdomains: int | None = None,
    comm: Any = None,
    each_case: Callable[[int, str], Any] | None = None,
) -> Cases:
    """Solve load cases with one solver, which is set up once; collective.

    Parameters
    ----------
    scene : Scene
        What acts in every case; the same on every rank.
    cases : sequence of Case, optional
        Those of the scene, without parts of combinations, when not given.
    options : dict, optional
        PETSc options without the leading dash, used where the user has not set them.
    subdomains : int, optional
        Number of subdomains that METIS makes when the scene has no partition.
    comm : communicator, optional
    each_case : callable, optional
        Called before each case with its number, from 0, and its name.

    Returns
    -------
    Cases
        Its report has the keys of a solve on scene, size and environment; solver, seconds (of set-up and solves), and
        cases, a list of dicts with name, iterations, converged, reason, displacement (the largest, m), lowest and
        highest (force, N), slack (links).

    Raises
    ------
    ValueError, petsc4py.PETSc.Error
        On every rank. A case that does not converge is no error.

    Notes
    -----
    A solve starts from the combination of solved cases whose actions are nearest to its own: for bars alone that is
    the solution where actions are combinations of earlier ones. Structures with rigid laws start anew, since their
    solutions need not be unique.
    """
    cases = [case for case in scene.cases if not case.part] if cases is None else list(cases)
    if not cases:
        raise ValueError(f"{scene.name} has no load case to solve: write [[case]] in its TOML file, or give a Case")
    for case in cases:  # a case that does not fit is refused before any is solved
        case.applied(scene)
    structure = Structure.from_scene(scene, comm)
    settings = dict(options or {})
    if subdomains is not None:
        settings |= {f"{family}_latin_subdomains": subdomains for family in ("snes", "ksp", "pc")}
    notices = [*unknown_options(), *structure.notices]
    start = time.perf_counter()
    with default_options(settings):
        snes = structure.create_snes()
        try:
            snes.setFromOptions()
            attach_linear(structure, snes)
            series = _Series(structure, snes, scene)
            for number, case in enumerate(cases):
                if each_case is not None:
                    each_case(number, case.name)
                series.solve(case.applied(scene), case.name)
            report = {
                **problem(structure),
                "solver": snes.getType(),
                "seconds": time.perf_counter() - start,
                "cases": series.rows,
                **environment(structure.comm.tompi4py()),
            }
        finally:
            snes.destroy()
    arrays = map(np.array, (series.displacements, series.tensions, series.slack))
    return Cases(scene, [case.name for case in cases], plain(report), *arrays, notices)


class _Series:
    """Solves on one structure, one after the other; methods are collective."""

    def __init__(self, structure, snes, scene):
        self.structure, self.snes = structure, snes
        self.rows, self.displacements, self.tensions, self.slack = [], [], [], []
        self._u = structure.create_vec()
        self._start = None if np.isin(scene.law, RIGID).any() else _Start(scene)

    def solve(self, case, name):
        """Solve a case, a scene with its actions, and record what it gives."""
        structure, snes, u = self.structure, self.snes, self._u
        structure.set_load(case.load)
        structure.set_prescribed(case.prescribed)
        structure.set_initial_elongation(case.initial_elongation)
        u.set(0.0)
        if self._start is not None:
            self._start.predict(case, u)
        snes.solve(None, u)
        converged = snes.getConvergedReason() > 0
        if self._start is not None and converged:
            self._start.keep(u)
        moved, tensions = structure.displacements(u), solvers.tensions(snes)
        loose = slack(case, tensions) & np.isin(case.law, UNILATERAL)
        self.displacements.append(moved)
        self.tensions.append(tensions)
        self.slack.append(loose)
        linear = snes.getType() == "ksponly"
        self.rows.append({
            "name": name,
            "iterations": snes.getLinearSolveIterations() if linear else snes.getIterationNumber(),
            "converged": converged,
            "reason": snes_reason(snes),
            "displacement": np.linalg.norm(moved, axis=1).max(),
            "lowest": tensions.min(),
            "highest": tensions.max(),
            "slack": np.count_nonzero(loose),
        })  # fmt: skip


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
