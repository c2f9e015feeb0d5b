"""Load cases: what acts on a structure besides what always acts, and linear combinations of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from numbers import Real
from typing import TYPE_CHECKING

import numpy as np

from latinpc.arrays import real
from latinpc.checks import Checks, checked_name
from latinpc.results.units import counted

if TYPE_CHECKING:
    from .scene import Scene

PARTS = "load", "prescribed", "initial_elongation"


@dataclass(repr=False)
class Case:
    """Actions on a scene, which add to those of the scene itself; ``1.35 * dead + 1.5 * snow`` combines cases.

    Parts combine, not results: where cables slacken, the response to a sum is not the sum of the responses.

    Parameters
    ----------
    name : str
        For tables and messages; cases that are solved together have names of their own.
    load : (n, dim) array of float, optional
        Nodal forces (N).
    prescribed : (n, dim) array of float, optional
        Settlements (m) of fixed directions, zero elsewhere.
    initial_elongation : (m,) array of float, optional
        Change of the initial elongations e0 (m): s where a turnbuckle shortens a link by s; -a t l where a link of the
        length l warms by t, a being its thermal expansion (1/K).
    part : bool
        Whether it is a part of combinations only, not to be solved by itself.
    """

    name: str
    load: np.ndarray | None = None
    prescribed: np.ndarray | None = None
    initial_elongation: np.ndarray | None = None
    part: bool = False

    def __post_init__(self):
        checked_name(self.name)
        for name in PARTS:  # lists would be joined, not added; what the caller does to theirs is not done to ours
            if getattr(self, name) is not None:
                setattr(self, name, np.array(real(f"case '{self.name}': {name}", getattr(self, name), float)))

    def __mul__(self, factor: float) -> Case:
        """Return the case with all its actions multiplied by a number."""
        if not isinstance(factor, Real) or not np.isfinite(factor):
            return NotImplemented
        return Case(f"{factor:g} {self.name}", *(None if part is None else factor * part for part in self.parts))

    __rmul__ = __mul__

    def __add__(self, other: Case) -> Case:
        """Return the case of the actions of both."""
        if not isinstance(other, Case):
            return NotImplemented
        sums = (a if b is None else b if a is None else a + b for a, b in zip(self.parts, other.parts))
        return Case(f"{self.name} + {other.name}", *sums)

    def __repr__(self) -> str:
        acts = []
        for what, noun, part in zip(
            ("loads on", "settlements of", "elongations of"), ("node", "node", "link"), self.parts
        ):
            if part is not None:
                rows = np.atleast_1d(part)
                acts.append(f"{what} {counted(np.count_nonzero(rows.reshape(len(rows), -1).any(axis=1)), noun)}")
        return f"Case({self.name!r}: {', '.join(acts) or 'nothing acts'})"

    def __radd__(self, other: int) -> Case:
        """Return the case itself: ``sum`` begins with 0."""
        return self if isinstance(other, int) and other == 0 else NotImplemented

    @property
    def parts(self) -> tuple[np.ndarray | None, np.ndarray | None, np.ndarray | None]:
        """Load, settlements and change of the initial elongations; None where there are none."""
        return self.load, self.prescribed, self.initial_elongation

    def named(self, name: str) -> Case:
        """Return the case under another name."""
        return replace(self, name=name)

    def check(self, scene: Scene) -> None:
        """Check that the actions fit a scene.

        Parameters
        ----------
        scene : Scene

        Raises
        ------
        ValueError
            Naming the case, where an array does not fit.
        """
        checks = Checks(scene.nodes.shape, len(scene.links))
        for name, part in zip(PARTS, self.parts):
            if part is None:
                continue
            shape = getattr(scene, name).shape
            if np.shape(part) != shape:
                raise ValueError(f"case '{self.name}': {name} must have the shape {shape}, not {np.shape(part)}")
            try:
                if name == "load":
                    checks.node_array(name, part)
                elif name == "prescribed":
                    checks.supports(scene.fixed, getattr(scene, name) + part)
                else:
                    checks.initial_elongation(part)
            except ValueError as error:
                raise ValueError(f"case '{self.name}': {error}") from None

    def applied(self, scene: Scene) -> Scene:
        """Return the scene with the actions of this case added to its own.

        Parameters
        ----------
        scene : Scene

        Raises
        ------
        ValueError
            Naming the case, where an array does not fit the scene.
        """
        self.check(scene)
        given = {name: part for name, part in zip(PARTS, self.parts) if part is not None}
        try:
            return replace(
                scene, name=f"{scene.name}: {self.name}", cases=(),
                **{name: getattr(scene, name) + part for name, part in given.items()},
            )  # fmt: skip
        except ValueError as error:
            raise ValueError(f"case '{self.name}': {error}") from None
