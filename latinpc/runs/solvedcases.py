"""Solved load cases: what an engineer asks of them."""

from __future__ import annotations

import html
import pathlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from petsc4py import PETSc

from latinpc.results.caselist import HEADER, extremes, rows, text, title
from latinpc.results.mechanics import reactions, shape, stresses, unbalanced, utilisations
from latinpc.results.report import plain, problem
from latinpc.results.result import Result
from latinpc.results.units import ALIKE
from latinpc.scenes.case import Case
from latinpc.scenes.scene import Scene
from latinpc.structure import Structure

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

__all__ = ["Cases"]


@dataclass(repr=False, eq=False)
class Cases(Mapping):
    """Solved load cases; the same on every rank. Cases that have not converged are in no envelope.

    ``print(cases)`` gives a table and the extremes; ``cases["snow"]`` is the `latinpc.Result` of a case, and ``len``,
    iteration over names, ``items()`` and the like are those of a dict. Nothing here is collective.
    """

    scene: Scene  #: what acted in every case
    names: list[str]
    report: dict[str, Any]  #: JSON-able, with the keys that `solve_cases` lists
    displacements: np.ndarray  #: (cases, n, dim), m
    tensions: np.ndarray  #: (cases, m), N; as displacements and reactions NaN of a case without results
    slack: np.ndarray  #: (cases, m), of bool: links that bear nothing
    notices: list[str]  #: sentences the user should read
    actions: list[Case]  #: what was solved
    geometry: str  #: how displacements turned links

    @property
    def converged(self) -> bool:
        """Whether all cases have converged."""
        return bool(self.good.all())

    @property
    def good(self) -> np.ndarray:
        """(cases,) array of bool: which have converged."""
        return np.array([case["converged"] for case in self.report["cases"]], dtype=bool)

    def __getitem__(self, name: str) -> Result:
        """Return the result of a case, with a structure of its own."""
        if name not in self.names:
            raise KeyError(f"no load case has the name {name!r}; there are {', '.join(self.names)}")
        number = self.names.index(name)
        row, scene = self.report["cases"][number], self.actions[number].applied(self.scene)
        part = row.get("load_factor", 1.0)
        scene = replace(scene, load=part * scene.load, prescribed=part * scene.prescribed, geometry=self.geometry)
        structure, tensions = Structure.from_scene(scene, PETSc.COMM_SELF), self.tensions[number]
        left = np.linalg.norm(unbalanced(self._shape(number), tensions, scene.load), axis=1)
        report = problem(structure) | {key: row[key] for key in row if key != "name"}
        report |= dict.fromkeys(("estimated_error", "tension_error", "indicator", "subdomains"))
        report |= {"solver": self.report["solver"], "residual_norm": np.linalg.norm(left)}
        report |= {"largest_unbalance": left.max(initial=0.0), "unbalanced_node": int(left.argmax())}
        said = f"case {name}: "
        notices = [notice.removeprefix(said) for notice in self.notices if notice.startswith(said)]
        return Result(structure, self.displacements[number], tensions, scene.load, plain(report), notices=notices)

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)

    def __repr__(self) -> str:
        return text(self)

    def _repr_html_(self) -> str:
        def row(cells, kind="td"):
            return "".join(f'<{kind} style="text-align:left">{html.escape(cell)}</{kind}>' for cell in cells)

        body = "".join(f"<tr>{row(cells)}</tr>" for cells in rows(self))
        lines = [*extremes(self), *(("notice", notice) for notice in self.notices)]
        below = "".join(f"<tr>{row([label], 'th')}{row([said])}</tr>" for label, said in lines)
        table = f"<table><caption><b>{html.escape(title(self))}</b></caption><tr>{row(HEADER, 'th')}</tr>{body}</table>"
        return f"{table}<table>{below}</table>"

    def plot(self) -> Figure:
        """Draw the envelope, the greatest tension and the greatest compression of each link, on one scale.

        Returns
        -------
        matplotlib.figure.Figure
            Which notebooks show; ``figure.savefig("envelope.png")`` writes it.
        """
        from latinpc.results.envelope import envelope_figure

        return envelope_figure(self)

    def to_csv(self, path: str | pathlib.Path, reactions: str | pathlib.Path | None = None) -> None:
        """Write a row for each link: extreme forces (N), their cases, where it is slack; call it on one rank.

        Where the structure has areas and strengths, also the largest stress (Pa), the utilisation and their case.
        Into another file, if its name is given, a row for each component of each reaction: the extremes (N), their
        cases, and its value in each case.
        """
        from latinpc.results.envelope import write_envelope, write_reactions

        write_envelope(path, self)
        if reactions is not None:
            write_reactions(reactions, self)

    def to_pandas(self) -> tuple[pandas.DataFrame, pandas.DataFrame]:
        """Return what `to_csv` writes as data frames: the envelope of the links, and the reactions.

        Raises
        ------
        ImportError
            Without pandas.
        """
        import pandas

        from latinpc.results.envelope import envelope_table, reactions_table

        envelope, forces = pandas.DataFrame(envelope_table(self)), pandas.DataFrame(reactions_table(self))
        return envelope.set_index("link"), forces.set_index(["node", "axis"])

    def to_dict(self) -> dict[str, Any]:
        """Return the report with the reactions at the supported nodes, fit for JSON."""
        held = np.flatnonzero(self.scene.fixed.any(axis=1))
        lowest, highest, *_ = self.reaction_envelope()
        forces = {"lowest": lowest[held], "highest": highest[held], "cases": self.reactions[:, held]}
        return self.report | plain({"reactions": {"nodes": held, **forces}})

    @cached_property
    def reactions(self) -> np.ndarray:
        """(cases, n, dim) array: forces of the supports on the structure (N), zero where nothing is fixed."""
        found = np.zeros_like(self.displacements)
        for number, case in enumerate(self.actions):
            load = self.scene.load if case.load is None else self.scene.load + case.load
            borne = self.report["cases"][number].get("load_factor", 1.0)  # 1 where it has converged
            found[number] = reactions(self._shape(number), self.tensions[number], borne * load)
        return found

    @cached_property
    def stress(self) -> np.ndarray | None:
        """(cases, m) array: tension over area (Pa), NaN without one; None where the structure has no areas."""
        return stresses(self.scene, self.tensions)

    @cached_property
    def utilisation(self) -> np.ndarray | None:
        """(cases, m) array: size of the stress over the strength; None where the structure has no strengths."""
        return utilisations(self.scene, self.tensions)

    def _shape(self, number):
        scene = self.scene if self.geometry == "linear" else self.actions[number].applied(self.scene)
        return shape(scene, self.displacements[number], self.geometry)

    def envelope(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return the lowest and the highest force of each link, and the cases that give them.

        Returns
        -------
        lowest, highest : (m,) array of float
            In N, compression negative; NaN where no case has converged.
        lowest_case, highest_case : (m,) array of int
            Numbers of cases, from 0; -1 where none has converged.
        """
        return self._extremes(self.tensions)

    def reaction_envelope(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return the lowest and the highest value of each component of each reaction, and the cases that give them.

        Returns
        -------
        lowest, highest : (n, dim) array of float
            In N, zero where nothing is fixed; NaN where no case has converged.
        lowest_case, highest_case : (n, dim) array of int
            Numbers of cases, from 0; -1 where none has converged.
        """
        return self._extremes(self.reactions)

    def _extremes(self, values):
        """Return the lowest and the highest of values (cases, ...) over the cases that have converged, and which."""
        good = np.flatnonzero(self.good)
        if not good.size:
            none, nowhere = np.full(values.shape[1:], np.nan), np.full(values.shape[1:], -1)
            return none, none, nowhere, nowhere
        lowest, highest = values[good[0]].copy(), values[good[0]].copy()
        for number in good[1:]:  # a case at a time stays in cache
            np.minimum(lowest, values[number], out=lowest)
            np.maximum(highest, values[number], out=highest)
        low, high = np.full(lowest.shape, good[-1]), np.full(lowest.shape, good[-1])
        size = np.maximum(np.abs(lowest), np.abs(highest))
        near = ALIKE * np.maximum(size, ALIKE * size.max(initial=0.0))
        for number in good[-2::-1]:  # the first of the cases that are alike
            np.copyto(low, number, where=values[number] <= lowest + near)
            np.copyto(high, number, where=values[number] >= highest - near)
        return lowest, highest, low, high

    def slack_cases(self) -> np.ndarray:
        """Return for each link the number of cases in which it bears nothing, (m,) of int."""
        return (self.slack & self.good[:, None]).sum(axis=0)
