"""Find the form of a structure that its forces alone hold: `form_find`, and what it has found."""

from __future__ import annotations

import pathlib
from collections.abc import Mapping
from dataclasses import dataclass, field
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
from latinpc.results.notices import warn
from latinpc.results.tables import AXES, table, write_csv
from latinpc.results.units import counted, quantity
from latinpc.results.unread import unread
from latinpc.structure import Structure

from .densities import PREFIX, equilibrium
from .settling import extended, settled, shortened
from .stressing import stressed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from latinpc.structure import Communicator

__all__ = ["Form", "form_find"]

ERROR = 1e-8  # of the largest force: what may be unbalanced in a form that is solved for with large displacements


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
    force: ArrayLike | None = None,
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

    Each link has what is given of it, the first of: its force, its natural length, its force density. With densities
    alone by one linear system per coordinate [H.-J. Schek 1974, (14)], else by a solve with large displacements, from
    the form of the densities if they are given too, else from the nodes as drawn.

    Parameters
    ----------
    nodes : (n, dim) array_like of float
        Coordinates (m), dim 1, 2 or 3. With densities those that are not fixed do not matter.
    links : (m, 2) array_like of int
        The two nodes of each link, counted from 0.
    fixed : (n, dim) array_like of bool
        Coordinates that stay.
    density : (m,) array_like of float, or float, optional
        Force densities, tension over length (N/m), negative in struts. Beside forces or natural lengths those of links
        without them must be positive. Those of links with them serve the start alone, which takes tensile forces over
        drawn lengths before.
    force : (m,) array_like of float, or float, optional
        Forces (N), negative in struts, whatever the lengths become. nan: none.
    natural_length : (m,) array_like of float, or float, optional
        Lengths of the links without tension (m). Needs `EA`. nan: none.
    EA : (m,) array_like of float, or float, optional
        Axial stiffness (N). Without it a form has no natural lengths, and no structure.
    load : (n, dim) array_like of float, optional
        Forces on the nodes (N), which do not change with the form.
    law : (m,) array_like of int or str, or one for all links, optional
        Law of the structure: bar, cable or compression_only; by default bars where the force or the density is
        negative, cables elsewhere.
    mass : (n,) array_like of float, or float, optional
        Lumped masses of the nodes (kg) of the structure, for its modes; they are no loads.
    area, strength : (m,) array_like of float, or float, optional
        Cross sections (m^2) and strengths of the material (Pa) of the structure, for stresses and utilisations.
    error : float, optional
        Of a form with forces or natural lengths: the largest unbalanced force, relative to the largest force; 1e-8 by
        default.
    options : mapping, optional
        PETSc options by name: of the KSP of the force densities, whose prefix is ``form_``, as ``{"form_pc_type":
        "latin", "form_ksp_type": "cg"}`` (a direct factor by default), and of the SNES of forces and natural lengths.
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
        When the solve for forces or natural lengths ends without a stable equilibrium; its `result` is the last
        iterate.

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
    of_links = {"density": density, "force": force, "natural_length": natural_length, "EA": EA}
    more = {"name": name, "mass": mass, "area": area, "strength": strength}
    given, more = agreed(comm.tompi4py(), _checked, nodes, links, fixed, load, law, of_links, error, more)
    alike(comm.tompi4py(), error=error, options=options)
    same_arrays(comm.tompi4py(), **given, **more)
    nodes, links, fixed, load, law = (given[key] for key in ("nodes", "links", "fixed", "load", "law"))
    options, start, notices = given_options(options), nodes, []
    theirs = {key: value for key, value in options.items() if not key.startswith(PREFIX)}  # of large displacements
    moves = force is not None or natural_length is not None
    density = _start(given)
    if density is not None:
        with default_options(options) as ours:
            start = equilibrium(nodes, links, fixed, density, load, comm)
            notices = unread(comm, [key for key in ours if not moves or key not in theirs])
    extended(start, links)
    form = Form(
        name, start, links, law, fixed, load, np.zeros(len(links)), given["EA"], comm=comm, notices=notices, **more
    )
    if moves:
        with default_options(theirs) as ours:
            form = _moved(form, given, ERROR if error is None else error)
            form.notices += unread(comm, ours)
    else:
        form.tensions = density * form.lengths
    form.natural_lengths = _natural(form, given["natural_length"])
    for notice in form.notices:
        warn(comm, notice)
    return form


def _checked(nodes, links, fixed, load, law, of_links, error, more):
    """Check and complete what is given; return arrays by name, and those that `more` has; not collective."""
    checked_name(more["name"])
    nodes, links = map(np.array, checked_shapes({"nodes": nodes, "links": links}, np.dtype(float)))
    kinds = [key for key in ("force", "natural_length", "density") if of_links[key] is not None]
    if not kinds:
        raise ValueError(
            "a form follows from force densities (density, N/m), forces (force, N) or natural lengths (natural_length,"
            " m)"
        )
    if kinds == ["density"] and error is not None:
        raise ValueError("error is for natural lengths and forces, the form of force densities has none: leave it out")
    if "natural_length" in kinds and of_links["EA"] is None:
        raise ValueError("natural lengths need the axial stiffness of the links: give EA, in N")
    if fixed is None:
        raise ValueError("a form needs supports: give fixed, an (n, dim) array of bool, true where a coordinate stays")
    checks = Checks(nodes.shape, len(links), np.dtype(float))
    checks.geometry(nodes, links, np.ones((len(links), nodes.shape[1])), links)  # links may have no length yet
    found = {"nodes": nodes, "links": links}
    for key, values in of_links.items():
        found[key] = None if values is None else np.array(checks.link_array(key, values))
        if values is not None:
            _right(key, found[key], several=len(kinds) > 1 and key in kinds)
    _governed(found, kinds)
    found["fixed"] = np.array(checks.node_array("fixed", fixed, bool))
    found["load"] = np.array(checks.node_array("load", 0.0 if load is None else load))
    signs = np.zeros(len(links))
    for key in ("density", "force"):
        signs = signs if found[key] is None else np.where(np.isnan(found[key]), signs, found[key])
    law = np.where(signs < 0.0, Law.BAR, Law.CABLE) if law is None else law
    found["law"] = np.array(checks.law(law, [known.name.lower() for known in Law]))
    elastic = (Law.BAR, Law.CABLE, Law.COMPRESSION_ONLY)
    if not np.isin(found["law"], elastic).all():
        raise ValueError("form finding takes the laws bar, cable and compression_only")
    wrong = ((signs < 0.0) & (found["law"] == Law.CABLE)) | ((signs > 0.0) & (found["law"] == Law.COMPRESSION_ONLY))
    refuse(wrong, "link", "has a force or a force density that its law cannot bear", signs)
    kept = {"mass": None if more["mass"] is None else np.array(checks.mass(more["mass"]))}
    for key in ("area", "strength"):
        kept[key] = None if more[key] is None else np.array(checks.positive(key, more[key]))
    return found, kept


def _right(key, values, several):
    """Refuse values of links that cannot be; several: others may say what a link has, and nan stands for none."""
    word = {"density": "finite", "force": "nonzero", "natural_length": "positive", "EA": "positive"}[key]
    right = np.isfinite(values) & ((key == "density") | (values > 0.0) | ((key == "force") & (values != 0.0)))
    refuse(~right & ~(np.isnan(values) & several), "link", f"needs a {word} {key}", values)


def _governed(found, kinds):
    """Leave each link the first of its kinds alone, but densities for the start; refuse links without any."""
    free = np.ones(len(found["links"]), bool)  # of those before
    for key in kinds:
        if key == "density" and len(kinds) > 1:
            wrong = free & (found[key] <= 0.0)
            refuse(
                wrong, "link", "has a force density that is not positive beside forces or natural lengths", found[key]
            )
        elif key == "natural_length":
            found[key][~free] = np.nan
        free &= np.isnan(found[key])
    refuse(free, "link", f"has no {' and no '.join(reversed(kinds))}", found[kinds[-1]])


def _start(given):
    """Return the force densities of the start, tensile forces over drawn lengths among them; None: the drawing."""
    density, force = given["density"], given["force"]
    if density is None or force is None:
        return density if density is None or np.isfinite(density).all() else None
    lengths = np.linalg.norm(np.diff(given["nodes"][given["links"]], axis=1)[:, 0], axis=1)
    pulls = (force > 0.0) & (lengths > 0.0)
    density = np.where(pulls, force / np.where(pulls, lengths, 1.0), density)
    return density if np.isfinite(density).all() else None


def _moved(form, given, error):
    """Return the form by large displacements; collective."""
    none = np.full(len(form.links), np.nan)
    natural, density = (none if given[key] is None else given[key] for key in ("natural_length", "density"))
    if given["force"] is None or np.isnan(given["force"]).all():
        return settled(form, natural, density, error)
    return stressed(form, given["force"], natural, density, error)


def _natural(form, given):
    """Return the natural lengths, those given or L EA / (EA + T); None without EA."""
    if form.EA is None:
        return None
    found = shortened(form.lengths, form.EA, form.tensions)
    return found if given is None else np.where(np.isnan(given), found, given)
