"""Lengths, directions and subdomains of links, and how displacements turn them."""

from __future__ import annotations

import numpy as np

from latinpc.numbering import Numbered

__all__ = ["GEOMETRIES", "Geometry", "known_geometry"]

#: How displacements turn links: not at all, by small angles, as far as they go.
GEOMETRIES = ("linear", "prestress", "large")


def known_geometry(geometry: str) -> int:
    """Return the number of a geometry, or raise a ValueError."""
    if geometry not in GEOMETRIES:
        raise ValueError(f"geometry must be one of {', '.join(GEOMETRIES)}, not {geometry!r}")
    return GEOMETRIES.index(geometry)


class Geometry(Numbered):
    """What follows from the arrays of nodes and links."""

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
