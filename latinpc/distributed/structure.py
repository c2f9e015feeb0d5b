"""Structures of which each rank gives its own nodes and links."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from mpi4py import MPI

from latinpc.arrays import REAL, Parts, agreed, refuse
from latinpc.checks import ARRAYS, INSTEAD, Agreed, Checks, checked, checked_shapes
from latinpc.library import _latin
from latinpc.results.solve import solve
from latinpc.structure import Structure

from .halo import Halo
from .result import LocalResult, gather_local, seen

if TYPE_CHECKING:
    pass

__all__ = ["LocalStructure"]


class LocalStructure(Structure):
    """A structure of links of which each rank gives its own part; no rank has it whole.

    Collective. A `Structure` in all that solvers do with it; arrays that it takes and returns are those of this
    rank's nodes and links. Solvers leave them there as well, as do `latinpc.tensions`, `latinpc.subdomain_of_links`
    and `latinpc.node_classes` for them.

    Parameters
    ----------
    nodes : (n, dim) array_like of float
        Coordinates of this rank's nodes (m). The nodes of rank 0 are numbered first, then those of rank 1, and so on.
    links : (m, 2) array_like of int
        The two nodes of each link of this rank, by their numbers among the nodes of all ranks. Any rank may have them.
    law, stiffness, initial_elongation, subdomain, direction, friction, prestress, area, strength, EA
        Of this rank's links, as of `Structure`; the parts of a contact with friction stay on one rank.
    fixed, prescribed, load, mass
        Of this rank's nodes, as of `Structure`.
    geometry : {"linear", "prestress", "large"}, optional
        The same on every rank.
    comm : petsc4py or mpi4py communicator, optional
        PETSc's default communicator when not given.
    name : str, optional

    Raises
    ------
    ValueError
        On every rank, naming the first rank whose arrays do not fit, and its first nodes or links, counted there
        from 0; or a rank with another argument than rank 0.
    LatinError
        On every rank: what the library refuses.

    Notes
    -----
    Links that two ranks both give, the same two nodes and law, are not noticed: what they carry adds up.
    Give springs across a taut cable on the rank of the cable: elsewhere, notices take the cable for one that turns.

    Examples
    --------
    On one rank it is the same as a `Structure`; `examples/16_distributed.py` shares a bridge out to any number.

    >>> import latinpc
    >>> frame = latinpc.LocalStructure(
    ...     nodes=[[-1, 0], [1, 0], [0, -1]], links=[[0, 2], [1, 2]], law="bar", stiffness=1e3,
    ...     fixed=[[1, 1], [1, 1], [0, 0]], load=[[0, 0], [0, 0], [0, -10]],
    ... )
    >>> frame.solve().tensions.round(3)
    array([7.071, 7.071])
    """

    def _checked(self, given):
        """Check the arrays of each rank; what one refuses is an error on all."""
        comm = self.comm.tompi4py()
        nodes, links = agreed(comm, checked_shapes, given, REAL, 0)
        self._same(comm, given, nodes)
        total = comm.allreduce(len(nodes))
        agreed(comm, _known_nodes, links, total)
        self._halo = Halo(comm, len(nodes), links)
        around = self._halo.spread(nodes), self._halo.links
        arrays = agreed(comm, checked, given, _latin.law_names(), REAL, around)
        self._checks = Agreed(comm, Checks(nodes.shape, len(links)))
        self._slices = Parts(self.comm, len(nodes), len(links))
        return arrays

    def _keep(self, name, values):
        """Keep an array; the halo reads the links that are kept, not the caller's, which may change or go."""
        super()._keep(name, values)
        if name == "links":
            self._halo.follow(self.links)

    def _alike(self, **arrays):
        pass  # each rank has its own

    def _doubles(self):
        return []  # another rank may have the other one

    @staticmethod
    def _same(comm, given, nodes):
        """Refuse dimensions, and optional arrays, that not all ranks have."""
        optional = (*ARRAYS, *INSTEAD)
        mine = np.array([nodes.shape[1], *(given[name] is not None for name in optional)])
        most, least = np.empty_like(mine), np.empty_like(mine)
        comm.Allreduce(mine, most, op=MPI.MAX)
        comm.Allreduce(mine, least, op=MPI.MIN)
        if most[0] != least[0]:
            raise ValueError(f"nodes have {least[0]} coordinates on one rank and {most[0]} on another")
        for name, high, low in zip(optional, most[1:], least[1:]):
            if high != low:
                raise ValueError(f"{name} is given on some ranks and not on others: give it on all, or on none")

    @property
    def halo(self) -> Halo:
        """Halo : where the nodes of other ranks at this rank's links are."""
        return self._halo

    over_ranks = halo

    @property
    def _lines(self) -> np.ndarray:
        x = self._halo.spread(self.nodes)
        links = self._halo.links
        return x[links[:, 1]] - x[links[:, 0]]

    @property
    def n_subdomains(self) -> int | None:
        """Number of subdomains of the given partition, None without one; collective."""
        if self.subdomain is None:
            return None
        return 1 + self.comm.tompi4py().allreduce(int(self.subdomain.max(initial=-1)), op=MPI.MAX)

    def solve(
        self,
        *,
        error: float | None = None,
        largest_unbalance: float | None = None,
        preset: str | None = None,
        options: Mapping[str, Any] | None = None,
        raise_on_failure: bool = False,
    ) -> LocalResult:
        """Solve for the displacements under the loads; collective.

        Parameters, warnings and errors are those of `Structure.solve`.

        Returns
        -------
        LocalResult
            Displacements and tensions of this rank's nodes and links; `LocalResult.gather` makes it whole.
        """
        return solve(self, error, largest_unbalance, preset, options, raise_on_failure, gather_local, seen)

    @property
    def first_node(self) -> int:
        """Number, among the nodes of all ranks, of the first node of this rank."""
        return self._halo.first

    def plot(self, *_: Any, **__: Any) -> None:
        """Refuse: pictures are of whole structures. Draw ``solve().gather()``, or write ``.pvtu`` for ParaView."""
        raise ValueError("a part of a structure is not drawn: draw the gathered result, or write it as .pvtu")

    free_motion = interactive = plot


def _known_nodes(links, total):
    """Refuse links to nodes that no rank has."""
    why = f"joins a node that does not exist (nodes are numbered from 0 to {total - 1} over all ranks)"
    refuse((links < 0) | (links >= total), "link", why, links)
