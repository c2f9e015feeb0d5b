"""Actions that vary during a motion, as factors over time say."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from petsc4py import PETSc

from latinpc.scenes.case import Case

#: Options that repeat a step with another length, where what varies would be that of the first try
REPEATING = ("ts_max_snes_failures", "ts_adapt_type")


@dataclass
class History:
    """Factors of actions over time: linear between the times, the first before them and the last after them.

    Parameters
    ----------
    times : (k,) array_like of float
        In s, growing.
    factors : (k,) array_like of float
    case : latinpc.Case, optional
        The actions, which add to those of the scene; all loads of the scene when not given.
    """

    times: np.ndarray
    factors: np.ndarray
    case: Case | None = None

    def __post_init__(self):
        self.times, self.factors = np.array(self.times, dtype=float), np.array(self.factors, dtype=float)
        if self.times.ndim != 1 or self.times.shape != self.factors.shape or not self.times.size:
            raise ValueError("a history has as many factors as times, at least one")
        if not (np.isfinite(self.times).all() and np.isfinite(self.factors).all() and (np.diff(self.times) > 0).all()):
            raise ValueError("the times and factors of a history must be finite, and the times must grow")
        if self.case is not None and not isinstance(self.case, Case):
            raise TypeError(f"the case of a history is a latinpc.Case, such as one of scene.cases, not {self.case!r}")

    def factor(self, time: float) -> float:
        """Return the factor at a time (s)."""
        return float(np.interp(time, self.times, self.factors))


class Acting:
    """Sets on a structure what acts at a time; methods are collective.

    Parameters
    ----------
    structure : Structure
    scene : Scene
    history : History
    """

    def __init__(self, structure, scene, history):
        given = [name for name in REPEATING if PETSc.Options().hasName(name)]
        if given:
            raise ValueError(f"-{given[0]} repeats steps, which loads with a history do not follow: leave it out")
        self.structure, self.history, self.case = structure, history, history.case
        if self.case is None:
            self.case = Case("loads", load=scene.load)
            scene = replace(scene, load=np.zeros_like(scene.load))
        self.case.check(scene)
        if not any(part is not None and part.any() for part in self.case.parts):
            raise ValueError(f"{scene.name} has no loads that could vary: give some, or a case that has actions")
        self.constant, self.whole = scene, self.case.applied(scene)
        self._start = 0.0  # of the last step that began (s)

    def set(self, time, end=None):
        """Set the loads and initial elongations of a time (s), and the prescribed displacements of `end`."""
        structure, (load, prescribed, elongation) = self.structure, self.case.parts
        factor = self.history.factor(time)
        if load is not None:
            structure.set_load(self.constant.load + factor * load)
        if elongation is not None:
            structure.set_initial_elongation(self.constant.initial_elongation + factor * elongation)
        if prescribed is not None:
            factor = factor if end is None else self.history.factor(end)
            structure.set_prescribed(self.constant.prescribed + factor * prescribed)

    def speeds(self, time):
        """Return the mean velocities (n, dim) of supports in the last step that began, which ends at a time (s)."""
        factors = self.history.factor(time) - self.history.factor(self._start)
        moved = 0.0 if self.case.prescribed is None else factors * self.case.prescribed
        return moved / (time - self._start)

    def before_step(self, ts):
        """Set what acts during a step: that of its end with implicit Euler, else that of its middle.

        Supports of TS latin move to their place at the end of the step; PETSc's integrators know but one place.
        """
        start, step, latin = ts.getTime(), ts.getTimeStep(), ts.getType() == "latin"
        self._start = start
        euler = latin and self.structure.geometry != "large"
        self.set(start + (step if euler else 0.5 * step), start + step if latin else None)
