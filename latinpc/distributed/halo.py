"""Nodes of other ranks at the links of this one."""

from __future__ import annotations

import math

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

__all__ = ["Halo"]


class Halo:
    """Where a rank finds the nodes of its links: its own first, then those of other ranks, by increasing number.

    Collective. The nodes of rank 0 are numbered first, then those of rank 1, and so on.

    Parameters
    ----------
    comm : mpi4py.MPI.Comm
    own : int
        Number of nodes of this rank.
    links : (m, 2) array of int
        Numbers of their nodes among those of all ranks.

    Attributes
    ----------
    first : int
        Number of the first node of this rank.
    ghosts : (g,) array of int
        Numbers of the nodes of other ranks.
    """

    def __init__(self, comm, own, links):
        starts = np.concatenate([[0], np.cumsum(comm.allgather(own))])
        self._comm, self.own, self.first = comm, own, int(starts[comm.rank])
        self._first_link = sum(comm.allgather(len(links))[: comm.rank])
        self._links = links
        outside = (links < self.first) | (links >= self.first + own)
        self.ghosts = np.unique(links[outside])
        rank = np.searchsorted(starts, self.ghosts, side="right") - 1
        remote = np.column_stack([rank, self.ghosts - starts[rank]]).astype(PETSc.IntType)
        self._sf = PETSc.SF().create(comm)
        self._sf.setGraph(own, None, remote.ravel())

    def follow(self, links: np.ndarray) -> None:
        """Read the same links from another array."""
        self._links = links

    @property
    def links(self) -> np.ndarray:
        """(m, 2) array of int: the nodes of the links by their places, own nodes and then ghosts."""
        places = self._links - self.first
        outside = (places < 0) | (places >= self.own)
        places[outside] = self.own + np.searchsorted(self.ghosts, self._links[outside])
        return places

    def spread(self, values: np.ndarray) -> np.ndarray:
        """Return values of the own nodes with those of the ghosts behind them; collective."""
        columns = np.reshape(values, (self.own, math.prod(np.shape(values)[1:])))
        found = np.empty((self.own + len(self.ghosts), columns.shape[1]), dtype=columns.dtype)
        found[: self.own] = columns
        for column in range(columns.shape[1]):
            mine, theirs = np.ascontiguousarray(columns[:, column]), np.empty(len(self.ghosts), columns.dtype)
            unit = _unit(mine)
            self._sf.bcastBegin(unit, mine, theirs, MPI.REPLACE)
            self._sf.bcastEnd(unit, mine, theirs, MPI.REPLACE)
            found[self.own :, column] = theirs
        return found.reshape(len(found), *np.shape(values)[1:])

    def collect(self, values: np.ndarray) -> np.ndarray:
        """Return values of the own nodes, those that other ranks have for them added; collective."""
        columns = values.reshape(self.own + len(self.ghosts), math.prod(values.shape[1:]))
        found = np.empty((self.own, columns.shape[1]), dtype=columns.dtype)
        for column in range(columns.shape[1]):
            mine, theirs = columns[: self.own, column].copy(), columns[self.own :, column].copy()
            unit = _unit(mine)
            self._sf.reduceBegin(unit, theirs, mine, MPI.SUM)
            self._sf.reduceEnd(unit, theirs, mine, MPI.SUM)
            found[:, column] = mine
        return found.reshape(self.own, *values.shape[1:])

    def total(self, values):
        """Return the sums of values over the ranks; collective."""
        return self._reduced(values, MPI.SUM)

    def largest(self, values):
        """Return the largest of values over the ranks; collective."""
        return self._reduced(values, MPI.MAX)

    def _reduced(self, values, operation):
        mine = np.array(values, float)
        found = np.empty_like(mine)
        self._comm.Allreduce(mine, found, op=operation)
        return found[()]

    def node_numbers(self, nodes: np.ndarray, most: int) -> np.ndarray:
        """Return the first numbers, among those of all ranks, of nodes of each; at least so many of them; collective.

        Of links `link_numbers`, which counts them rank by rank.
        """
        return np.concatenate(self._comm.allgather(self.first + nodes[:most]))

    def largest_first(self, nodes: np.ndarray, sizes: np.ndarray, most: int) -> np.ndarray:
        """Return the first numbers of nodes by decreasing size, at least so many of them; collective."""
        mine = np.argsort(-sizes, kind="stable")[:most]
        numbers, sizes = (np.concatenate(self._comm.allgather(v[mine])) for v in (self.first + nodes, sizes))
        return numbers[np.argsort(-sizes, kind="stable")]

    def link_numbers(self, links: np.ndarray, most: int) -> np.ndarray:
        """See `node_numbers`; collective."""
        return np.concatenate(self._comm.allgather(self._first_link + links[:most]))


def _unit(values):
    """Return MPI's type of the numbers of an array."""
    return MPI._typedict[values.dtype.char]
