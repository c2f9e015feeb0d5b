"""What a scene is: a structure of links as numpy arrays, in SI units."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from latinpc.arrays import refuse, shaped
from latinpc.checks import ARRAYS, checked
from latinpc.geometry import Geometry, known_geometry
from latinpc.laws import Law
from latinpc.numbering import Numbering
from latinpc.results.mechanics import tensions
from latinpc.results.plots import Plots
from latinpc.results.result import Result
from latinpc.results.units import counted
from latinpc.structure import Structure
from latinpc.userlaws import as_tables


@dataclass(repr=False)
class Scene(Geometry, Plots):
    """The arrays of a structure with a name, which no communicator shares yet: what generators and files give.

    Parameters
    ----------
    name : str
        Name in the registry.
    nodes : (n, dim) array of float
        Coordinates (m), dim = 1, 2 or 3.
    links : (m, 2) array of int
        The two nodes of each link, counted from 0.
    law : (m,) array of int or str, or one for all links
        A `Law` per link, or its name; ``len(Law) + i`` is the i-th of `tables`.
    stiffness : (m,) array of float, or float
        k (N/m), positive. Of a rigid law the search parameter, 0 where the solver is to choose it; 0 also for a
        law of `tables` as it is.
    initial_elongation : (m,) array of float, optional
        e0 (m); the self-stress is k e0. Zero by default.
    fixed : (n, dim) array of bool, optional
        Components whose displacement is prescribed. None by default.
    prescribed : (n, dim) array of float, optional
        Their displacement (m), zero where free. Zero by default.
    load : (n, dim) array of float, optional
        External nodal forces (N). Zero by default.
    subdomain : (m,) array of int or None
        A subdomain per link, counted from 0 without gaps; None leaves the choice to the solver.
    direction : (m, dim) array of float, optional
        Directions of links other than from their first to their second node, zero elsewhere. None by default.
    friction : (m,) array of float, optional
        Coefficients of friction, read at links of law FRICTION.
    tables : sequence of (elongation, tension), optional
        Piecewise linear laws: increasing e + e0 (m) and the tensions there (N).
    mass : (n,) array of float or None
        Lumped masses of the nodes (kg), for dynamics; None in statics.
    velocity : (n, dim) array of float or None
        Velocity at the start (m/s), zero where fixed; None: at rest.
    time_step : float or None
        A step that resolves what happens (s).
    metadata : dict
        Options and choices of the generator; fit for JSON.
    area : (m,) array of float, optional
        Areas of the cross sections (m^2).
    strength : (m,) array of float, optional
        Stresses that the links bear (Pa).
    cases : tuple of Case
        Load cases, whose actions add to those of the scene.
    geometry : {'linear', 'prestress', 'large'}
        How displacements turn links, as of `latinpc.Structure`; the option -snes_latin_geometry comes before it.
    numbering : Numbering, optional
        How the file that it was read from counts nodes and links.
    line_load, line_mass : (m, dim) and (m,) array of float, optional
        What the file gives per metre of the links (N/m, kg/m): `load` and `mass` hold it, over the drawn lengths.

    Raises
    ------
    ValueError
        When the arrays do not describe a structure; the message names the first culprit.
    """

    name: str
    nodes: np.ndarray
    links: np.ndarray
    law: np.ndarray
    stiffness: np.ndarray
    initial_elongation: np.ndarray | None = None
    fixed: np.ndarray | None = None
    prescribed: np.ndarray | None = None
    load: np.ndarray | None = None
    subdomain: np.ndarray | None = None
    direction: np.ndarray | None = None
    friction: np.ndarray | None = None
    tables: tuple = ()
    mass: np.ndarray | None = None
    velocity: np.ndarray | None = None
    time_step: float | None = None
    metadata: dict = field(default_factory=dict)
    area: np.ndarray | None = None
    strength: np.ndarray | None = None
    cases: tuple = ()
    geometry: str = "linear"
    numbering: Numbering | None = None
    line_load: np.ndarray | None = None
    line_mass: np.ndarray | None = None

    def __post_init__(self):
        self.tables = tuple(tuple(np.asarray(part, dtype=float) for part in table) for table in self.tables)
        laws = [law.name.lower() for law in Law] + [f"table {i}" for i in range(len(self.tables))]
        given = {name: getattr(self, name) for name in ("name", *ARRAYS)}
        for name, values in checked(given, laws, np.dtype(float)).items():
            setattr(self, name, None if values is None else np.require(values, requirements=("C", "W")))
        if self.velocity is not None:
            self.velocity = np.array(shaped("velocity", self.velocity, self.nodes.shape, float, "a row per node"))
            refuse(~np.isfinite(self.velocity), "node", "has a velocity that is not finite", self.velocity)
            moves = ((self.velocity != 0.0) & self.fixed).any(axis=1)
            refuse(moves, "node", "has a velocity in a direction that is fixed", self.velocity)
        if self.time_step is not None and not 0.0 < self.time_step < np.inf:
            raise ValueError(f"time_step is {self.time_step}; it is a positive time")
        known_geometry(self.geometry)

    def __setattr__(self, name: str, value: Any) -> None:
        """Refuse unknown attributes, which nothing reads."""
        if name not in self.__dataclass_fields__ and not hasattr(type(self), name):
            raise AttributeError(f"a scene has no attribute {name!r}: its arrays are {', '.join(ARRAYS)}")
        object.__setattr__(self, name, value)

    @classmethod
    def from_structure(cls, structure: Structure) -> Scene:
        """Take the arrays of a structure, as its loads now are; not collective.

        Parameters
        ----------
        structure : latinpc.Structure
            Whole on every rank, without laws of `latinpc.register_law`.

        Returns
        -------
        Scene
            With arrays of its own.

        Raises
        ------
        ValueError
            For a law of functions.
        """
        if type(structure) is not Structure:
            raise ValueError(f"a scene is made of a latinpc.Structure, not of a {type(structure).__name__}")
        given = {name: getattr(structure, name) for name in ARRAYS}
        given = {name: None if values is None else values.copy() for name, values in given.items()}
        given["law"], tables = as_tables(structure.law)
        return cls(structure.name, **given, tables=tables, geometry=structure.geometry, numbering=structure.numbering)

    @property
    def laws(self) -> np.ndarray:
        """(m,) array of str: the laws by name, such as ``"cable"``; ``"table"`` of piecewise linear ones."""
        return np.array([*(law.name.lower() for law in Law), *["table"] * len(self.tables)])[self.law]

    @property
    def prestress(self) -> np.ndarray:
        """(m,) array: tensions of bars, cables and compression-only links as drawn (N); of other laws 0."""
        return np.where(self.law <= Law.COMPRESSION_ONLY, tensions(self, np.zeros(self.nodes.shape)), 0.0)

    def solve(self, comm: Any = None, **how: Any) -> Result:
        """Solve for the displacements under the loads; collective.

        Parameters
        ----------
        comm : petsc4py or mpi4py communicator, optional
            PETSc's default communicator when not given.
        **how
            As for `latinpc.Structure.solve`.

        Returns
        -------
        latinpc.Result
        """
        return Structure.from_scene(self, comm).solve(**how)

    def __repr__(self) -> str:
        laws = ", ".join(f"{np.count_nonzero(self.law == law)} {law.plural}" for law in Law if law in self.law)
        parts = "no given partition" if self.subdomain is None else counted(self.n_subdomains, "subdomain")
        return (
            f"Scene({self.name!r}: {len(self.nodes)} nodes in {self.dim}D, {laws}, "
            f"{np.count_nonzero(~self.fixed)} free dofs, {parts})"
        )


def blocks_or_metis(partition, fit=True):
    """Return the partition of a scene: the one asked for, or equal blocks if these fit, else METIS."""
    if partition not in (None, "regular", "metis"):
        raise ValueError(f"partition must be 'regular' or 'metis', not {partition!r}")
    return partition or ("regular" if fit else "metis")
