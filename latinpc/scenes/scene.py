"""What a scene is: a structure of links as numpy arrays, in SI units."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from latinpc.laws import RIGID, Law, law_numbers


@dataclass(repr=False)
class Scene:
    """A structure, its supports and its loads.

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
    stiffness : (m,) array of float
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
    cases : tuple of Case
        Load cases, whose actions add to those of the scene.

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
    cases: tuple = ()

    def __post_init__(self):
        self.nodes = np.ascontiguousarray(self.nodes, dtype=np.float64)
        if self.nodes.ndim != 2 or self.nodes.shape[1] not in (1, 2, 3):
            raise ValueError(f"nodes must be an (n, 1), (n, 2) or (n, 3) array, not {self.nodes.shape}")
        self.links = _integers("links", self.links)
        if self.links.ndim != 2 or self.links.shape[1] != 2:
            raise ValueError(f"links must be an (m, 2) array of node numbers, not {self.links.shape}")
        n, m = self.nodes.shape, (len(self.links),)
        law = law_numbers(self.law)
        self.law = _shaped("law", _integers("law", law if law.ndim else np.full(m, law)), m)
        self.stiffness = _shaped("stiffness", self.stiffness, m, np.float64)
        self.initial_elongation = _shaped(
            "initial_elongation", np.zeros(m) if self.initial_elongation is None else self.initial_elongation, m, float
        )
        self.fixed = _shaped("fixed", np.zeros(n, bool) if self.fixed is None else self.fixed, n, bool)
        given = np.zeros(n) if self.prescribed is None else self.prescribed
        self.prescribed = _shaped("prescribed", given, n, np.float64)
        self.load = _shaped("load", np.zeros(n) if self.load is None else self.load, n, np.float64)
        if self.subdomain is not None:
            self.subdomain = _shaped("subdomain", _integers("subdomain", self.subdomain), m)
        if self.direction is not None:
            self.direction = _shaped("direction", self.direction, (len(self.links), self.dim), np.float64)
        if self.friction is not None:
            self.friction = _shaped("friction", self.friction, m, np.float64)
        self.tables = tuple(tuple(np.asarray(part, dtype=float) for part in table) for table in self.tables)
        if self.mass is not None:
            self.mass = _shaped("mass", self.mass, n[:1], float)
        if self.velocity is not None:
            self.velocity = _shaped("velocity", self.velocity, n, float)
        self.validate()

    def validate(self) -> None:
        """Check the values; see the class for what is raised."""
        for name in ("nodes", "stiffness", "initial_elongation", "prescribed", "load"):
            _refuse(~np.isfinite(getattr(self, name)), name, "is not a finite number")
        _refuse((self.links < 0) | (self.links >= len(self.nodes)), "links", "names a node that does not exist")
        _refuse(self.links[:, 0] == self.links[:, 1], "links", "joins a node to itself")
        at_one_place = self.lengths == 0.0 if self.direction is None else ~np.any(self.vectors, axis=1)
        _refuse(at_one_place, "links", "joins two nodes at the same place")
        known = [f"{law.name}={law.value}" for law in Law] + [f"{len(Law) + i}" for i in range(len(self.tables))]
        _refuse((self.law < 0) | (self.law >= len(known)), "law", f"is none of {known}")
        free = np.isin(self.law, RIGID) | (self.law >= len(Law))
        _refuse((self.stiffness < 0.0) | ((self.stiffness == 0.0) & ~free), "stiffness", "is not positive")
        _refuse((self.prescribed != 0.0) & ~self.fixed, "prescribed", "is not zero where the node is free")
        if self.mass is not None:
            _refuse(~((self.mass >= 0.0) & np.isfinite(self.mass)), "mass", "is negative or not finite")
        if self.velocity is not None:
            _refuse(~np.isfinite(self.velocity), "velocity", "is not a finite number")
            _refuse((self.velocity != 0.0) & self.fixed, "velocity", "is not zero where the node is held")
        if self.time_step is not None and not 0.0 < self.time_step < np.inf:
            raise ValueError(f"time_step is {self.time_step}; it is a positive time")
        if self.subdomain is not None and len(self.links):
            _refuse(self.subdomain < 0, "subdomain", "is negative")
            empty = np.flatnonzero(np.bincount(self.subdomain) == 0)
            if empty.size:
                raise ValueError(f"subdomain {empty[0]} has no link: number the subdomains without gaps")

    @property
    def dim(self) -> int:
        """Number of displacement components per node."""
        return self.nodes.shape[1]

    @property
    def lengths(self) -> np.ndarray:
        """Length of each link (m)."""
        return np.linalg.norm(self.nodes[self.links[:, 1]] - self.nodes[self.links[:, 0]], axis=1)

    @property
    def directions(self) -> np.ndarray:
        """Unit vector of each link, from its first node to its second."""
        vectors = self.vectors
        return vectors / np.linalg.norm(vectors, axis=1)[:, None]

    @property
    def vectors(self) -> np.ndarray:
        """From the first node of each link to its second (m), or the direction that it was given."""
        vectors = self.nodes[self.links[:, 1]] - self.nodes[self.links[:, 0]]
        if self.direction is None:
            return vectors
        return np.where(np.any(self.direction, axis=1)[:, None], self.direction, vectors)

    @property
    def n_subdomains(self) -> int | None:
        """Number of subdomains of the given partition, None without one."""
        return None if self.subdomain is None else int(self.subdomain.max()) + 1

    def __repr__(self) -> str:
        laws = ", ".join(f"{np.count_nonzero(self.law == law)} {law.plural}" for law in Law if law in self.law)
        parts = "no given partition" if self.subdomain is None else f"{self.n_subdomains} subdomains"
        return (
            f"Scene({self.name!r}: {len(self.nodes)} nodes in {self.dim}D, {laws}, "
            f"{np.count_nonzero(~self.fixed)} free dofs, {parts})"
        )


def _integers(name, values):
    """Return `values` as int64, refusing fractions rather than truncating them."""
    values = np.asarray(values)
    if values.dtype.kind not in "iub" and not np.all(values == np.floor(values)):
        raise ValueError(f"{name} must hold whole numbers")
    return np.ascontiguousarray(values, dtype=np.int64)


def _shaped(name, values, shape, dtype=None):
    values = np.ascontiguousarray(values, dtype=dtype)
    if values.shape != tuple(shape):
        raise ValueError(f"{name} must have the shape {tuple(shape)}, not {values.shape}")
    return values


def _refuse(wrong, name, why):
    """Raise for the first true entry of `wrong`."""
    if np.any(wrong):
        where = tuple(int(i) for i in np.argwhere(wrong)[0])
        raise ValueError(f"{name}[{', '.join(map(str, where))}] {why}")
