"""Find the form of a structure that its forces alone hold: `form_find`, and what it has found."""

from __future__ import annotations

import pathlib
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from petsc4py import PETSc

from latinpc.arrays import agreed, alike, communicator, refuse, same_arrays
from latinpc.checks import Checks, checked_name, checked_shapes
from latinpc.laws import Law
from latinpc.numbering import Numbering
from latinpc.options import default_options, given_options
from latinpc.results.notices import LatinWarning, SolveError, warn
from latinpc.results.tables import AXES, table, write_csv
from latinpc.results.units import counted, quantity
from latinpc.results.unread import unread
from latinpc.solvers import negative_pivots
from latinpc.structure import Structure

from .densities import PREFIX, equilibrium

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from latinpc.structure import Communicator

__all__ = ["Form", "form_find"]

ERROR = 1e-8  # of the largest force: what may be unbalanced in a form of natural lengths
SOLVES = 4  # most solves for natural lengths, each from the last form: 1 or 2 are usual
SOFT = 1e-9  # of the largest diagonal entry of a stiffness: negative eigenvalues that are smaller are zero
ROUNDING = 64.0  # times eps, of EA: forces that rounding of lengths makes
PLACES = 4.0  # times eps, of the stiffness times the largest coordinate: the same of coordinates
SHORT = 1e-9  # of the size of a form: links that are shorter have no direction


@dataclass(repr=False, eq=False)
class Form:
    """A form in equilibrium; arrays are whole, the same on every rank. Only `structure` is collective."""

    name: str
    nodes: np.ndarray  #: (n, dim), in equilibrium (m)
    links: np.ndarray  #: (m, 2)
    law: np.ndarray  #: (m,), `latinpc.Law`
    fixed: np.ndarray  #: (n, dim) of bool
    load: np.ndarray  #: (n, dim), under which it is in equilibrium (N)
    tensions: np.ndarray  #: (m,), positive in tension (N)
    EA: np.ndarray | None = None  #: (m,), axial stiffness (N); None where not given
    natural_lengths: np.ndarray | None = None  #: (m,), of the links without tension (m); None without EA
    mass: np.ndarray | None = None  #: (n,), of the nodes (kg), None where not given
    area: np.ndarray | None = None  #: (m,), of cross sections (m^2), None where not given
    strength: np.ndarray | None = None  #: (m,), of the material (Pa), None where not given
    comm: PETSc.Comm = field(default_factory=PETSc.Sys.getDefaultComm)
    notices: list[str] = field(default_factory=list)  #: sentences to read
    numbering: Numbering | None = None  #: of the file that it was drawn in, for tables

    @cached_property
    def lengths(self) -> np.ndarray:
        """(m,) array: lengths of the links in the form (m)."""
        return np.linalg.norm(np.diff(self.nodes[self.links], axis=1)[:, 0], axis=1)

    @cached_property
    def densities(self) -> np.ndarray:
        """(m,) array: force densities, tension over length (N/m)."""
        return self.tensions / self.lengths

    @cached_property
    def stiffness(self) -> np.ndarray | None:
        """(m,) array: stiffness EA over natural length of the structure's links (N/m); None without EA."""
        return None if self.EA is None else self.EA / self.natural_lengths

    @cached_property
    def initial_elongations(self) -> np.ndarray | None:
        """(m,) array: length in the form less natural length (m), negative in slack cables; None without EA."""
        if self.EA is None:
            return None
        bears = self.tensions != 0.0  # without the cancellation of a difference
        return np.where(bears, self.tensions / self.stiffness, self.lengths - self.natural_lengths)

    @cached_property
    def _forces(self) -> np.ndarray:
        """Force of the links on each node."""
        pull, forces = (
            self.densities[:, None] * np.diff(self.nodes[self.links], axis=1)[:, 0],
            np.zeros(self.nodes.shape),
        )
        np.add.at(forces, self.links[:, 0], pull)
        np.add.at(forces, self.links[:, 1], -pull)
        return forces

    @property
    def reactions(self) -> np.ndarray:
        """(n, dim) array: forces of the supports on the structure (N)."""
        return np.where(self.fixed, -self._forces - self.load, 0.0)

    @property
    def largest_unbalance(self) -> float:
        """Largest component of an unbalanced force on a node (N)."""
        return float(np.abs(np.where(self.fixed, 0.0, self._forces + self.load)).max())

    @property
    def unbalance(self) -> float:
        """The same over the largest tension or load."""
        return self.largest_unbalance / (max(np.abs(self.tensions).max(), np.abs(self.load).max()) or 1.0)

    @cached_property
    def structure(self) -> Structure:
        """`latinpc.Structure` : the form with its tensions, loads and large displacements, ready for other loads.

        Collective when first asked for.

        Raises
        ------
        ValueError
            Without EA.
        """
        if self.EA is None:
            raise ValueError("a structure needs the axial stiffness of its links: give EA, in N")
        elastic = (self.law, self.stiffness, self.initial_elongations)
        more = {key: getattr(self, key) for key in ("mass", "area", "strength", "comm", "name")} | {"geometry": "large"}
        return Structure(self.nodes, self.links, *elastic, self.fixed, load=self.load, **more)

    @property
    def members(self) -> np.ndarray:
        """Structured array of a row per link: start, end, law, length, density, tension; with EA also natural_length,
        stiffness (N/m) and initial_elongation (m) of the structure.
        """  # noqa: D205
        columns = {"member": np.arange(len(self.links)), "start": self.links[:, 0], "end": self.links[:, 1]}
        columns |= {"law": np.array([Law(law).name.lower() for law in self.law])}
        if self.EA is not None:
            columns |= {"stiffness": self.stiffness, "initial_elongation": self.initial_elongations}
        columns |= {key: getattr(self, key) for key in ("area", "strength") if getattr(self, key) is not None}
        columns |= {"#length": self.lengths, "#density": self.densities, "#tension": self.tensions}
        return table(columns | ({} if self.EA is None else {"#natural_length": self.natural_lengths}))

    def to_csv(self, members: str | pathlib.Path, nodes: str | pathlib.Path) -> None:
        """Write two CSV files, which `latinpc.read` reads again as the structure; call it on one rank."""
        words = np.array(["".join(axis for axis, held in zip(AXES, row) if held) for row in self.fixed])
        numbers, links = np.arange(len(self.nodes)), {name: self.members[name] for name in self.members.dtype.names}
        if self.numbering is not None and len(set(map(str, self.numbering.nodes)) - {""}) == len(self.nodes):
            numbers = np.asarray(self.numbering.nodes)
            links |= {"start": numbers[self.links[:, 0]], "end": numbers[self.links[:, 1]]}
            links |= {} if self.numbering.links is None else {"member": np.asarray(self.numbering.links)}
        of_nodes, of_links = (getattr(self.numbering, key, None) for key in ("node_groups", "link_groups"))
        links |= {} if of_links is None else {"group": of_links}
        columns = {"node": numbers}
        for prefix, array in (("", self.nodes), ("F", self.load)):
            columns |= {prefix + axis: column for axis, column in zip(AXES, array.T)}
            columns |= {"fix": words} if not prefix else {}
        columns |= {} if self.mass is None else {"mass": self.mass}
        columns |= {} if of_nodes is None else {"group": of_nodes}
        columns |= {f"#R{axis}": column for axis, column in zip(AXES, self.reactions.T)}
        write_csv(members, table(links))
        write_csv(nodes, table(columns))

    def to_npz(self, path: str | pathlib.Path) -> None:
        """Write the structure and tensions as numpy arrays; call it on one rank."""
        from latinpc.results.atomic import atomic, check_writable

        check_writable(path, (".npz",))
        arrays = {"nodes": self.nodes, "links": self.links, "law": self.law, "fixed": self.fixed, "load": self.load}
        arrays |= {"tensions": self.tensions, "densities": self.densities, "reactions": self.reactions}
        beside = {name: getattr(self, name) for name in ("mass", "area", "strength")}
        arrays |= {name: values for name, values in beside.items() if values is not None}
        if self.EA is not None:
            arrays |= {"EA": self.EA, "natural_lengths": self.natural_lengths}
        with atomic(path) as temporary, open(temporary, "wb") as file:
            np.savez(file, **arrays)

    def to_vtu(self, path: str | pathlib.Path) -> None:
        """Write nodes, tensions and reactions for ParaView; call it on one rank."""
        from latinpc.results.vtk import write_vtu

        write_vtu(path, self._drawn(), np.zeros(self.nodes.shape), self.tensions, reactions=self.reactions)

    def to_dxf(self, path: str | pathlib.Path) -> None:
        """Write the links as a drawing in m, on the layers of their groups or laws; call it on one rank.

        Slack links are on layers of their own. It needs ezdxf.
        """
        from latinpc.results.cad import write_dxf

        write_dxf(path, self, self.nodes, self.tensions == 0.0)

    def plot(self) -> Figure:
        """Draw the form with the tensions of its links; not collective."""
        from latinpc.results.pictures import structure_figure

        figure = structure_figure(self._drawn(), np.zeros(self.nodes.shape), self.tensions)
        for text in figure.texts:
            if "displacement" in text.get_text():  # there is none in a form
                text.set_text(f"{counted(len(self.links), 'link')}, force densities {_range(self.densities, 'N/m')}")
        return figure

    def to_dict(self) -> dict[str, Any]:
        """Return what `print` shows, fit for JSON."""
        lengths = self.natural_lengths
        return {
            "scene": self.name,
            "nodes": len(self.nodes),
            "links": len(self.links),
            "tension": [float(self.tensions.min()), float(self.tensions.max())],
            "density": [float(self.densities.min()), float(self.densities.max())],
            "length": [float(self.lengths.min()), float(self.lengths.max())],
            "natural_length": None if lengths is None else [float(lengths.min()), float(lengths.max())],
            "low": self.nodes.min(axis=0).tolist(),
            "high": self.nodes.max(axis=0).tolist(),
            "unbalance": self.unbalance,
            "notices": list(self.notices),
        }

    def lines(self) -> list[tuple[str, str]]:
        """Return a summary as lines of (label, text)."""
        low, high = self.nodes.min(axis=0), self.nodes.max(axis=0)
        size = " x ".join(f"{value:.4g}" for value in high - low)
        sizes = f"{counted(len(self.nodes), 'node')}, {counted(len(self.links), 'link')}, {size} m"
        lines = [("form", sizes)]
        lines.append(("tension", _range(self.tensions, "N") + " (compression negative)"))
        lines.append(("force density", _range(self.densities, "N/m")))
        if self.natural_lengths is None:
            lines.append(("length", _range(self.lengths, "m") + "; give EA for natural lengths"))
        else:
            lines.append(("length", f"{_range(self.lengths, 'm')}; natural {_range(self.natural_lengths, 'm')}"))
        return [*lines, ("balance", f"unbalanced forces {self.unbalance:.1e} of the largest force")]

    def _drawn(self):
        """Return what pictures and files for ParaView read, without the need of EA."""
        from latinpc.scenes import Scene

        stiffness = np.ones(len(self.links))
        return Scene(self.name, self.nodes, self.links, self.law, stiffness, fixed=self.fixed, load=self.load)

    def __repr__(self) -> str:
        lines = [*self.lines(), *(("notice", text) for text in self.notices)]
        return "\n".join([self.name, *(f"  {label:<15}{text}" for label, text in lines)])


def _range(values, unit):
    low, high = (quantity(value, unit, 4) for value in (values.min(), values.max()))
    return low if low == high else f"{low} to {high}"


def form_find(
    nodes: ArrayLike,
    links: ArrayLike,
    fixed: ArrayLike,
    density: ArrayLike | None = None,
    *,
    natural_length: ArrayLike | None = None,
    EA: ArrayLike | None = None,
    load: ArrayLike | None = None,
    law: ArrayLike | None = None,
    mass: ArrayLike | None = None,
    area: ArrayLike | None = None,
    strength: ArrayLike | None = None,
    error: float | None = None,
    options: Mapping[str, Any] | None = None,
    comm: Communicator | None = None,
    name: str = "form",
) -> Form:
    """Find the nodes at which links are in equilibrium with loads and supports; collective.

    With force densities by one linear system per coordinate [H.-J. Schek 1974, (14)]. With natural lengths by a solve
    with large displacements, from the form of the densities if they are given too, else from the nodes as drawn.

    Parameters
    ----------
    nodes : (n, dim) array_like of float
        Coordinates (m), dim 1, 2 or 3. With densities those that are not fixed do not matter.
    links : (m, 2) array_like of int
        The two nodes of each link, counted from 0.
    fixed : (n, dim) array_like of bool
        Coordinates that stay.
    density : (m,) array_like of float, or float, optional
        Force densities, tension over length (N/m), negative in struts.
    natural_length : (m,) array_like of float, or float, optional
        Lengths of the links without tension (m). Needs `EA`.
    EA : (m,) array_like of float, or float, optional
        Axial stiffness (N). Without it a form has no natural lengths, and no structure.
    load : (n, dim) array_like of float, optional
        Forces on the nodes (N), which do not change with the form.
    law : (m,) array_like of int or str, or one for all links, optional
        Law of the structure: bar, cable or compression_only; by default bars where the density is negative, cables
        elsewhere.
    mass : (n,) array_like of float, or float, optional
        Lumped masses of the nodes (kg) of the structure, for its modes; they are no loads.
    area, strength : (m,) array_like of float, or float, optional
        Cross sections (m^2) and strengths of the material (Pa) of the structure, for stresses and utilisations.
    error : float, optional
        Of a form of natural lengths: the largest unbalanced force, relative to the largest force; 1e-8 by default.
    options : mapping, optional
        PETSc options by name: of the KSP of the force densities, whose prefix is ``form_``, as ``{"form_pc_type":
        "latin", "form_ksp_type": "cg"}`` (a direct factor by default), and of the SNES of natural lengths.
    comm : petsc4py or mpi4py communicator, optional
        PETSc's default communicator when not given.
    name : str
        For summaries and pictures.

    Returns
    -------
    Form
        With `nodes`, `tensions`, `natural_lengths` and `structure`.

    Raises
    ------
    ValueError
        On every rank: arrays that do not fit; nothing held, or nodes without a chain of links to a support; all
        densities zero; densities of struts and cables that cancel; links of no length in the form, or compressed by
        more than EA.
    latinpc.SolveError
        When the solve for natural lengths ends without a stable equilibrium; its `result` is the last iterate.

    Examples
    --------
    A cable of equal force densities under equal weights hangs in a parabola:

    >>> import latinpc, numpy as np
    >>> form = latinpc.form_find(
    ...     nodes=[[0, 0], [1, 0], [2, 0], [3, 0], [4, 0]], links=[[0, 1], [1, 2], [2, 3], [3, 4]],
    ...     fixed=[[1, 1], [0, 0], [0, 0], [0, 0], [1, 1]], density=10.0, EA=1e5, load=[[0, -5]] * 5)
    >>> form.nodes[:, 1]
    array([ 0.  , -0.75, -1.  , -0.75,  0.  ])
    >>> form.structure.solve().converged
    True
    """
    comm = communicator(comm)
    of_links = {"density": density, "natural_length": natural_length, "EA": EA}
    more = {"name": name, "mass": mass, "area": area, "strength": strength}
    given, more = agreed(comm.tompi4py(), _checked, nodes, links, fixed, load, law, of_links, error, more)
    alike(comm.tompi4py(), error=error, options=options)
    same_arrays(comm.tompi4py(), **given, **more)
    nodes, links, fixed, load, law = (given[key] for key in ("nodes", "links", "fixed", "load", "law"))
    options, start, notices = given_options(options), nodes, []
    theirs = {key: value for key, value in options.items() if not key.startswith(PREFIX)}  # of the natural lengths
    if given["density"] is not None:
        with default_options(options) as ours:
            start = equilibrium(nodes, links, fixed, given["density"], load, comm)
            notices = unread(comm, [key for key in ours if natural_length is None or key not in theirs])
    _extended(start, links)
    form = Form(
        name, start, links, law, fixed, load, np.zeros(len(links)), given["EA"], comm=comm, notices=notices, **more
    )
    if natural_length is None:
        form.tensions = given["density"] * form.lengths
        form.natural_lengths = _natural(form)
    else:
        form.natural_lengths = given["natural_length"]
        with default_options(theirs) as ours:
            form = _settled(form, ERROR if error is None else error)
            form.notices += unread(comm, ours)
    for notice in form.notices:
        warn(comm, notice)
    return form


def _settled(form, error):
    """Return the form that given natural lengths settle into; collective."""
    rounding = np.finfo(float).eps * (ROUNDING * form.EA + PLACES * form.stiffness * np.abs(form.nodes).max())
    for _ in range(SOLVES):  # balance alone does not say whether a form is stable
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", LatinWarning)  # what counts is the balance that is left
            result = form.structure.solve(error=error)
        form = replace(form, nodes=form.nodes + result.displacements)
        _extended(form.nodes, form.links)
        strain = form.stiffness * (form.lengths - form.natural_lengths)
        strain[np.abs(strain) <= rounding] = 0.0
        slack = ((form.law == Law.CABLE) & (strain <= 0.0)) | ((form.law == Law.COMPRESSION_ONLY) & (strain >= 0.0))
        form = replace(form, tensions=np.where(slack, 0.0, strain))
        balanced = form.unbalance <= error or form.largest_unbalance <= rounding.max()
        held = slack.all() or (form.tensions.any() and not _unstable(form))  # slack nodes may lie anywhere
        found = balanced and (result.converged or held)
        if found or not result.displacements.any():  # the next solve would be the same
            break
    if not found:
        raise _lost(result, form.unbalance)
    if slack.all():
        raise ValueError("all links are slack, and nothing holds a form: the natural lengths are too long")
    count = int(slack.sum())
    if count:
        form.notices.append(f"{count} link{'s are' if count > 1 else ' is'} slack: longer than the form has room for")
    return form


def _unstable(form):
    """Whether the tangent stiffness has negative eigenvalues; zero ones of slack parts do not count; collective."""
    u = form.structure.create_vec()
    K = form.structure.dm.createMat()
    form.structure.jacobian(u, K)
    K.shift(SOFT * K.getDiagonal().norm(PETSc.NormType.INFINITY))
    count = negative_pivots(K, PREFIX)
    K.destroy()
    u.destroy()
    return count > 0


def _lost(result, unbalance):
    """Return the error of a solve that ends without a form, with what its notices say."""
    left = f"the last one leaves unbalanced forces of {unbalance:.1e} of the largest force, or buckles"
    said = "; ".join([left if result.converged else result.reason, *result.notices])
    lost = SolveError(
        f"form finding: no stable equilibrium of these natural lengths was found: {said}. Draw the structure nearer to"
        " its form, start from the form of force densities, or change the lengths"
    )
    lost.result = result
    return lost


def _checked(nodes, links, fixed, load, law, of_links, error, more):
    """Check and complete what is given; return arrays by name, and those that `more` has; not collective."""
    checked_name(more["name"])
    nodes, links = map(np.array, checked_shapes({"nodes": nodes, "links": links}, np.dtype(float)))
    if of_links["density"] is None and of_links["natural_length"] is None:
        raise ValueError("a form follows from force densities (density, N/m) or natural lengths (natural_length, m)")
    if of_links["natural_length"] is None and error is not None:
        raise ValueError("error is for natural lengths, the form of force densities has none: leave it out")
    if of_links["natural_length"] is not None and of_links["EA"] is None:
        raise ValueError("natural lengths need the axial stiffness of the links: give EA, in N")
    if fixed is None:
        raise ValueError("a form needs supports: give fixed, an (n, dim) array of bool, true where a coordinate stays")
    checks = Checks(nodes.shape, len(links), np.dtype(float))
    checks.geometry(nodes, links, np.ones((len(links), nodes.shape[1])), links)  # links may have no length yet
    found = {"nodes": nodes, "links": links}
    for key, values in of_links.items():
        found[key] = None if values is None else np.array(checks.link_array(key, values))
        if values is not None:
            right = np.isfinite(found[key]) & ((key == "density") | (found[key] > 0.0))
            refuse(~right, "link", f"needs a {'finite' if key == 'density' else 'positive'} {key}", found[key])
    found["fixed"] = np.array(checks.node_array("fixed", fixed, bool))
    found["load"] = np.array(checks.node_array("load", 0.0 if load is None else load))
    signs = np.zeros(len(links)) if found["density"] is None else found["density"]
    law = np.where(signs < 0.0, Law.BAR, Law.CABLE) if law is None else law
    found["law"] = np.array(checks.law(law, [known.name.lower() for known in Law]))
    elastic = (Law.BAR, Law.CABLE, Law.COMPRESSION_ONLY)
    if not np.isin(found["law"], elastic).all():
        raise ValueError("form finding takes the laws bar, cable and compression_only")
    wrong = ((signs < 0.0) & (found["law"] == Law.CABLE)) | ((signs > 0.0) & (found["law"] == Law.COMPRESSION_ONLY))
    refuse(wrong, "link", "has a force density that its law cannot bear", signs)
    kept = {"mass": None if more["mass"] is None else np.array(checks.mass(more["mass"]))}
    for key in ("area", "strength"):
        kept[key] = None if more[key] is None else np.array(checks.positive(key, more[key]))
    return found, kept


def _extended(nodes, links):
    """Refuse a form in which nodes of a link fall together."""
    length = np.linalg.norm(np.diff(nodes[links], axis=1)[:, 0], axis=1)
    short = np.flatnonzero(length <= SHORT * max(np.ptp(nodes, axis=0).max(), 1e-300))
    if short.size:
        a, b = links[short[0]]
        raise ValueError(
            f"link {short[0]} has no length in the form, one of {short.size}: nodes {a} and {b} fall together; hold"
            " more nodes, or change densities and loads"
        )


def _natural(form):
    """Return the natural lengths L EA / (EA + T), None without EA."""
    if form.EA is None:
        return None
    crushed = np.flatnonzero(form.EA + form.tensions <= 0.0)
    if crushed.size:
        link = crushed[0]
        raise ValueError(
            f"link {link} bears {quantity(form.tensions[link], 'N')}, and its EA is {quantity(form.EA[link], 'N')}: no"
            " natural length becomes so short; give a larger EA"
        )
    return form.lengths * form.EA / (form.EA + form.tensions)
