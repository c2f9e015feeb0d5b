"""Lengths, directions and subdomains of links, and how displacements turn them."""

from __future__ import annotations

from typing import Any

import numpy as np

from latinpc.numbering import Numbered

__all__ = ["GEOMETRIES", "Geometry", "Whole", "extent", "known_geometry"]

#: How displacements turn links: not at all, by small angles, as far as they go.
GEOMETRIES = ("linear", "prestress", "large")


def known_geometry(geometry: str) -> int:
    """Return the number of a geometry, or raise a ValueError."""
    if geometry not in GEOMETRIES:
        raise ValueError(f"geometry must be one of {', '.join(GEOMETRIES)}, not {geometry!r}")
    return GEOMETRIES.index(geometry)


def extent(structure: Geometry) -> np.ndarray:
    """Return the size of a structure along each axis (m); of parts collective."""
    nodes, largest = structure.nodes, structure.over_ranks.largest
    return largest(nodes.max(axis=0, initial=-np.inf)) + largest(-nodes.min(axis=0, initial=np.inf))


class Whole:
    """Amounts of a structure from those of the nodes and links of a rank, where each has all: they are the same.

    Of parts of a structure it is `latinpc.distributed.halo.Halo`, and collective.
    """

    own = None  #: number of nodes of this rank, before those of other ranks

    @staticmethod
    def total(values):
        """Return the sums of values over the ranks."""
        return values

    #: Largest values over the ranks; values of nodes, what other ranks have for them added; values with those of
    #: nodes of other ranks
    largest = collect = spread = total

    @staticmethod
    def node_numbers(nodes, most):
        """Return the first numbers of nodes, at least so many if there are more."""
        return nodes[:most]

    link_numbers = node_numbers

    @staticmethod
    def largest_first(nodes, sizes, most):
        """Return the numbers of nodes by decreasing size, those of one size in their order; at least so many."""
        return nodes[np.argsort(-sizes, kind="stable")]


WHOLE = Whole()


class Geometry(Numbered):
    """What follows from the arrays of nodes and links."""

    over_ranks: Any = WHOLE  #: how amounts of the whole follow from those of a rank
    direction: np.ndarray | None
    subdomain: np.ndarray | None

    @property
    def dim(self) -> int:
        """Number of displacement components per node."""
        return self.nodes.shape[1]

    @property
    def lengths(self) -> np.ndarray:
        """Distance of the two nodes of each link (m)."""
        return np.linalg.norm(self._lines, axis=1)

    @property
    def vectors(self) -> np.ndarray:
        """From the first node of each link to its second (m), or the direction that it was given."""
        if self.direction is None:
            return self._lines
        return np.where(np.any(self.direction, axis=1)[:, None], self.direction, self._lines)

    @property
    def directions(self) -> np.ndarray:
        """Unit vector of each link, from its first node to its second, or along the direction that it was given."""
        vectors = self.vectors
        return vectors / np.linalg.norm(vectors, axis=1)[:, None]

    @property
    def n_subdomains(self) -> int | None:
        """Number of subdomains of the given partition, None without one."""
        return None if self.subdomain is None else int(self.subdomain.max()) + 1

    @property
    def _lines(self) -> np.ndarray:
        return self.nodes[self.links[:, 1]] - self.nodes[self.links[:, 0]]
