"""A case of the robustness suite."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from petsc4py import PETSc

from latinpc.scenes import Scene

DIGITS = 3 if np.finfo(PETSc.RealType).eps > 1e-10 else 6
ACCURACY = 10.0**-DIGITS  #: relative l2 error of the displacements that every case requests
SUBDOMAINS = 8


@dataclass(frozen=True)
class Case:
    """A scene at an extreme.

    Parameters
    ----------
    group, name : str
    make : callable
        Returns the Scene, or the `matrices.Elements` of a linear problem.
    expected : {'right', 'refused', 'either'}
        What is right: a solution, a refusal that names its cause, or whichever of them the case allows.
    options : dict
        PETSc options beside the stop on an error of `ACCURACY`; those of a matrix are all here.
    ranks : int
    solution : callable, optional
        From the scene to what is unique, in closed form or by another method.
    unique : {'displacements', 'tensions', 'elongations', 'closed', 'nothing'}
        What the solution is the only one in; elongations are those of links that bear, closed the gaps that stiff
        contacts close. With tensions or nothing, the suite also checks the conditions that every solution meets.
    """

    group: str
    name: str
    make: Callable[[], Scene]
    expected: str = "right"
    options: dict = field(default_factory=dict)
    ranks: int = 1
    solution: Callable | None = None
    unique: str = "displacements"
    steps: int = 0


def options(**more):
    """Return the options of a case: the stop, the subdomains, and more."""
    return {"snes_latin_stop": "error", "snes_latin_error": ACCURACY, "snes_latin_subdomains": SUBDOMAINS, **more}
