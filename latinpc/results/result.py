"""A solved structure: what an engineer asks of it."""

from __future__ import annotations

import contextlib
import html
import pathlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from . import tables
from .mechanics import Balance, Leaning, Turned, balance, gaps, reactions, shape, slack, stresses, utilisations
from .report import Reported, plain
from .summary import summary

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike
    from petsc4py import PETSc

    from latinpc.structure import Structure

    from .modes import Modes

__all__ = ["Result"]


@dataclass(repr=False, eq=False)
class Result(Reported):
    """What a solve has found; arrays are whole, in the caller's numbering, the same on every rank.

    Nothing here is collective but `tangent` and `modes`. ``print(result)`` gives a summary.
    """

    structure: Structure  #: what was solved
    displacements: np.ndarray  #: (n, dim), of all nodes, prescribed ones included (m)
    tensions: np.ndarray  #: (m,), positive in tension (N)
    load: np.ndarray  #: (n, dim), under which it was solved (N)
    report: dict[str, Any]  #: counts, errors and reasons, fit for JSON
    subdomain: np.ndarray | None = None  #: (m,), subdomain of each link
    node_class: np.ndarray | None = None  #: (n,), 0 interior, 1 strong, 2 weak interface, 3 corner
    mode: np.ndarray | None = None  #: (n, dim), how the structure moves on where no equilibrium follows; else None
    history: dict[str, np.ndarray] = field(default_factory=dict)  #: per iteration: indicator, errors, estimate
    notices: list[str] = field(default_factory=list)  #: sentences to read

    def __post_init__(self):
        #: How displacements turned links, ``"linear"``, ``"prestress"`` or ``"large"``.
        self.geometry: str = getattr(self.structure, "geometry", "linear")
        self._acted = {name: getattr(self.structure, name) for name in ("prescribed", "initial_elongation")}

    @contextlib.contextmanager
    def as_solved(self) -> Iterator[None]:
        """Give the structure the geometry that it was solved with, its own again afterwards; collective.

        Raises
        ------
        ValueError
            Naming what has changed since, other than loads and masses: there is no tangent at these displacements.
        """
        now, geometry = self.structure, self.structure.geometry
        changed = [name for name, was in self._acted.items() if not np.array_equal(getattr(now, name), was)]
        if changed:
            words = {"prescribed": "prescribed displacement", "initial_elongation": "initial elongation"}
            named = " and ".join(words.get(name, name) for name in changed)
            raise ValueError(f"{named} of the structure changed after this result was found: solve again")
        if geometry == self.geometry:
            yield
            return
        now.set_geometry(self.geometry)
        try:
            yield
        finally:
            now.set_geometry(geometry)

    @cached_property
    def slack(self) -> np.ndarray:
        """(m,) array of bool: cables, compression-only links and contacts that carry nothing."""
        return slack(self.structure, self.tensions)

    @cached_property
    def reactions(self) -> np.ndarray:
        """(n, dim) array: forces of the supports on the structure (N), zero where nothing is fixed; equation (1)."""
        return reactions(self._shape, self.tensions, self.load)

    @cached_property
    def balance(self) -> Balance:
        """Sums of loads and reactions (N), and what force and moment they leave, relative to the loads."""
        return balance(self._shape, self.tensions, self.reactions, self.load)

    @cached_property
    def _shape(self) -> Structure | Turned | Leaning:
        return shape(self.structure, self.displacements, self.geometry)

    @cached_property
    def gap(self) -> np.ndarray | None:
        """(m,) array: what contacts have left of their gaps (m), NaN of other links; None without contacts."""
        return gaps(self.structure, self.displacements, self._acted["initial_elongation"])

    @cached_property
    def stress(self) -> np.ndarray | None:
        """(m,) array: tension over area (Pa), NaN without one; None where the structure has no areas."""
        return stresses(self.structure, self.tensions)

    @cached_property
    def utilisation(self) -> np.ndarray | None:
        """(m,) array: size of the stress over the strength, NaN without; None where the structure has no strengths."""
        return utilisations(self.structure, self.tensions)

    @property
    def members(self) -> np.ndarray:
        """Structured array of a row per link.

        Columns: link, start, end, law, length (m), elongation (m), tension (N), slack (of tangential parts that of
        their contact); gap (m) where there are contacts; stress (Pa) and utilisation where the structure has areas and
        strengths; name, start_name, end_name where a file has given them.
        """
        return tables.members(self)

    @property
    def nodes(self) -> np.ndarray:
        """Structured array of a row per node.

        Columns: node; x, y, z (m), displacement_x (m), load_x (N), reaction_x (N) and so on, of as many axes as there
        are; supported; name where a file has given one.
        """
        return tables.nodes(self)

    def to_pandas(self) -> tuple[pandas.DataFrame, pandas.DataFrame]:
        """Return `members` and `nodes` as data frames.

        Raises
        ------
        ImportError
            Without pandas.
        """
        try:
            import pandas
        except ImportError as error:
            raise ImportError(
                "to_pandas needs pandas (pip install pandas); without it take result.members and result.nodes"
            ) from error
        return pandas.DataFrame(self.members).set_index("link"), pandas.DataFrame(self.nodes).set_index("node")

    def to_csv(self, members: str | pathlib.Path, nodes: str | pathlib.Path | None = None) -> None:
        """Write `members`, and `nodes` where a file for them is named, into CSV files; call it on one rank."""
        tables.write_csv(members, self.members)
        if nodes is not None:
            tables.write_csv(nodes, self.nodes)

    def to_vtu(self, path: str | pathlib.Path) -> None:
        """Write all that is known of nodes and links for ParaView; call it on one rank."""
        from .vtk import write_vtu

        extra = {"reactions": self.reactions, "stress": self.stress, "utilisation": self.utilisation}
        extra["geometry"] = self.geometry
        arrays = (self.displacements, self.tensions, self.subdomain, self.node_class)
        write_vtu(path, self.structure, *arrays, load=self.load, **extra)

    def to_dxf(self, path: str | pathlib.Path) -> None:
        """Write the displaced links as a drawing in m, on the layers of their groups or laws; call it on one rank.

        Slack links are on layers of their own. It needs ezdxf.
        """
        from .cad import write_dxf

        write_dxf(path, self.structure, self.structure.nodes + self.displacements, self.slack)

    def to_dict(self) -> dict[str, Any]:
        """Return the report with reactions, and with the largest stress and utilisation, fit for JSON."""
        supports = np.flatnonzero(self.structure.fixed.any(axis=1))
        found = {
            "reason_in_words": self.reason,
            "reactions": {
                "nodes": supports,
                "forces": self.reactions[supports],
                "sum": self.balance.reaction,
                "sum_of_loads": self.balance.load,
                "force_without_balance": self.balance.force,
                "moment_without_balance": self.balance.moment,
            },
            "largest_stress": None if self.stress is None else np.nanmax(np.abs(self.stress), initial=0.0),
            "largest_utilisation": None if self.utilisation is None else np.nanmax(self.utilisation, initial=0.0),
        }
        return self.report | plain(found) | {"notices": list(self.notices)}

    def plot(self, figure: Figure | None = None, amplification: float | None = None, numbers: bool = False) -> Figure:
        """Draw the deformed structure: forces in its links, supports, loads; what has not converged has a stamp.

        Where the displacements grow without end, the motion that taut links do not resist is drawn in place of them.

        Parameters
        ----------
        figure : matplotlib.figure.Figure, optional
            To draw into, as ``plt.figure(figsize=(12, 7.2))`` for a window; one of its own when not given, which
            notebooks show.
        amplification : float, optional
            Of the displacements; by default a round number that makes them visible.
        numbers : bool
            Write the numbers of nodes and links.

        Returns
        -------
        matplotlib.figure.Figure
            ``figure.savefig("net.png")`` writes it.
        """
        from .motionpicture import motion_figure
        from .pictures import structure_figure

        if self.free_motion is not None:
            # of the nodes of a collapse, the notice names those that it is proved of
            proved = next((text for text in self.notices if text.startswith("no equilibrium")), None)
            reason = proved or "no equilibrium: no link that is taut resists the motion drawn"
            how = {"loose": self.slack, "figure": figure, "load": self.load, "word": "COLLAPSE", "reason": reason}
            return motion_figure(self.structure, self.free_motion, numbers=numbers or None, **how)
        how = {} if self.converged else {"word": "NOT CONVERGED", "reason": self.reason}
        arrays = (self.displacements, self.tensions, self.subdomain)
        how |= {"amplification": amplification, "figure": figure, "load": self.load, "numbers": numbers}
        how |= {"geometry": self.geometry}
        return structure_figure(self.structure, *arrays, **how)

    def interactive(self, amplification: float | None = None) -> Any:
        """Draw the structure to be turned, zoomed and asked with a mouse; needs plotly (the extra ``interactive``).

        Parameters
        ----------
        amplification : float, optional
            Of the displacements; by default a round number that makes them visible.

        Returns
        -------
        plotly.graph_objects.Figure
            Which notebooks show.

        Raises
        ------
        RuntimeError
            Without plotly.
        """
        from .browser import interactive_figure

        if self.free_motion is not None:
            word = f"COLLAPSE: {self.reason}; drawn is the motion that no taut link resists"
            return interactive_figure(
                self.structure, self.free_motion, self.tensions, load=self.load, word=word, real=False
            )
        arrays = (self.displacements, self.tensions)
        word = "" if self.converged else f"NOT CONVERGED: {self.reason}"
        how = {"amplification": amplification, "load": self.load, "word": word, "geometry": self.geometry}
        return interactive_figure(self.structure, *arrays, **how)

    def to_html(self, path: str | pathlib.Path, amplification: float | None = None) -> None:
        """Write `interactive` into one file for a browser, which needs no network; call it on one rank."""
        from .browser import write_html

        write_html(self.interactive(amplification), path)

    @cached_property
    def free_motion(self) -> np.ndarray | None:
        """(n, dim) array: a motion that the links which bear do not resist, its largest displacement 1.

        Of solves that ended because displacements grow without end; None of others, and where none is found.
        """
        if not self.report["reason"].startswith("DIVERGED_DTOL") or self.geometry != "linear":
            return None
        from .mechanism import bearing, free_motion

        tensions = np.where(np.isfinite(self.tensions), self.tensions, 0.0)
        return free_motion(self.structure, self.load, bearing(self.structure, tensions))

    def tangent(self) -> PETSc.Mat:
        """Make the tangent stiffness K (N/m) of the free degrees of freedom at the displacements; collective.

        Where links turn, with their geometric stiffness. Not with rigid laws.
        """
        from .modes import tangent

        with self.as_solved():
            return tangent(self.structure, self.displacements)

    def modes(
        self,
        number: int = 6,
        *,
        buckling: bool = False,
        load: ArrayLike | None = None,
        options: Mapping[str, Any] | None = None,
    ) -> Modes:
        """Compute natural frequencies or buckling factors at the displacements; collective, as `latinpc.modes`."""
        from .modes import modes

        return modes(self, number, buckling=buckling, load=load, options=options)

    def _lines(self) -> list[tuple[str, str]]:
        return [*summary(self), *(("notice", text) for text in self.notices)]

    def __repr__(self) -> str:
        return "\n".join([self.structure.name, *(f"  {label:<15}{text}" for label, text in self._lines())])

    def _repr_html_(self) -> str:
        rows = "".join(
            f'<tr><th style="text-align:left">{html.escape(label)}</th>'
            f'<td style="text-align:left">{html.escape(text)}</td></tr>'
            for label, text in self._lines()
        )
        return f"<table><caption><b>{html.escape(self.structure.name)}</b></caption>{rows}</table>"
