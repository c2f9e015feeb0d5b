"""Structures of links from numpy arrays.

Every rank passes the same whole arrays; a class method or function marked *Collective* must be called by all
ranks of the communicator. Whatever comes back is in the caller's own numbering, whole, on every rank.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from petsc4py import PETSc

try:
    from latinpc import _latin
except ImportError as error:
    raise ImportError(
        f"the compiled part of latinpc cannot be loaded ({error}). In a source tree run `make build`; elsewhere "
        "run `pip install .` with the petsc4py that is to be used."
    ) from error

__all__ = ["Links", "Sizes"]


def _check_petsc():
    """Refuse a PETSc that is not the one that latinpc was built with."""
    built, found = _latin.PETSC_VERSION, PETSc.Sys.getVersion()
    cure = "build latinpc again with this petsc4py (`make build`, or `pip install --force-reinstall .`)"
    if built[:2] != tuple(found[:2]):
        text = [".".join(map(str, version)) for version in (built, found)]
        raise ImportError(f"latinpc was built with PETSc {text[0]}, petsc4py brings PETSc {text[1]}: {cure}")
    if not _latin.initialized():
        raise ImportError(f"latinpc is linked with another PETSc library than petsc4py: {cure}")


_check_petsc()
_latin.initialize_package()

_BOOL = np.dtype(f"i{_latin.BOOL_SIZE}")
_MAX_NAMED = 5


class Sizes(NamedTuple):
    """Size of a whole structure."""

    dim: int
    nodes: int
    links: int
    free_dofs: int


class _Slices:
    """Which nodes and links of the caller's arrays this rank has handed to the library.

    Nodes go in consecutive blocks. Links go in consecutive blocks too, or in blocks of subdomains when the
    caller gives a partition, so that a subdomain starts on the rank that will own it.
    """

    def __init__(self, comm, nodes, links, subdomain):
        self.comm = comm.tompi4py()
        self.nodes = nodes
        self.links = links
        self.node_start, self.node_end = self._block(nodes)
        if subdomain is None:
            self.my_links = np.arange(*self._block(links))
        else:
            first, last = self._block(int(subdomain.max()) + 1)
            self.my_links = np.flatnonzero((subdomain >= first) & (subdomain < last))

    def _block(self, n):
        """Split n entries as PetscSplitOwnership does."""
        size, rank = self.comm.size, self.comm.rank
        return tuple(n // size * r + min(r, n % size) for r in (rank, rank + 1))

    def gather_nodes(self, mine):
        """Assemble a nodal array; collective."""
        return np.concatenate(self.comm.allgather(mine), axis=0)

    def gather_links(self, mine):
        """Assemble an array over the links; collective."""
        whole = np.empty((self.links, *mine.shape[1:]), dtype=mine.dtype)
        for where, values in self.comm.allgather((self.my_links, mine)):
            whole[where] = values
        return whole


class Links:
    """A structure of links in 1, 2 or 3 dimensions: nodes, links, laws, supports and loads.

    Collective. Every rank passes the same whole arrays and keeps its share only.

    Parameters
    ----------
    nodes : (n, dim) array_like of float
        Coordinates (m).
    links : (m, 2) array_like of int
        The two nodes of each link, counted from 0.
    law : (m,) array_like of int, or int
        `latinpc.scenes.Law`: 0 bar, tau = k (e + e0); 1 cable, tau = k max(e + e0, 0); 2 strut,
        tau = k min(e + e0, 0); equations (2), (4), (5).
    stiffness : (m,) array_like of float, or float
        k (N/m), positive.
    prestrain : (m,) array_like of float, or float, optional
        e0 (m), zero by default; the self-stress is k e0.
    fixed : (n, dim) array_like of bool, optional
        Components whose displacement is prescribed. None by default.
    prescribed : (n, dim) array_like of float, optional
        Their displacement (m), zero by default.
    load : (n, dim) array_like of float, optional
        External nodal forces F (N), zero by default.
    subdomain : (m,) array_like of int, optional
        Subdomain of each link, counted from 0 without gaps. Without it the solver makes a partition.
    comm : petsc4py or mpi4py communicator, optional
        PETSc's default communicator when not given.

    Raises
    ------
    ValueError
        On every rank, naming the first nodes or links that do not fit.
    petsc4py.PETSc.Error
        On every rank; `latinpc.error_message` gives its sentence.

    Examples
    --------
    A weight of 10 N under two bars:

    >>> import latinpc
    >>> frame = latinpc.Links(
    ...     nodes=[[-1, 0], [1, 0], [0, -1]], links=[[0, 2], [1, 2]], law=0, stiffness=1e3,
    ...     fixed=[[1, 1], [1, 1], [0, 0]], load=[[0, 0], [0, 0], [0, -10]],
    ... )
    >>> frame.sizes
    Sizes(dim=2, nodes=3, links=2, free_dofs=2)
    """

    def __init__(
        self,
        nodes,
        links,
        law,
        stiffness,
        prestrain=None,
        fixed=None,
        prescribed=None,
        load=None,
        subdomain=None,
        comm=None,
    ):
        nodes = np.asarray(nodes, dtype=np.float64)
        if nodes.ndim != 2 or nodes.shape[1] not in (1, 2, 3) or len(nodes) == 0:
            raise ValueError(f"nodes must be an (n, dim) array with dim 1, 2 or 3, not of shape {nodes.shape}")
        links = _integers("links", links)
        if links.ndim != 2 or links.shape[1] != 2 or len(links) == 0:
            raise ValueError(f"links must be an (m, 2) array of node numbers, not of shape {links.shape}")
        self._shape = nodes.shape
        self._count = len(links)
        _refuse(~np.isfinite(nodes).all(axis=1), "node", "has a coordinate that is not finite", nodes)
        _refuse(
            ((links < 0) | (links >= len(nodes))).any(axis=1),
            "link",
            f"joins a node that does not exist (nodes are numbered from 0 to {len(nodes) - 1})",
            links,
        )
        _refuse(links[:, 0] == links[:, 1], "link", "joins a node to itself", links)
        length = np.linalg.norm(nodes[links[:, 1]] - nodes[links[:, 0]], axis=1)
        _refuse(length == 0, "link", "has no length: its two nodes are at one place", links)
        law = self._link_array("law", _integers("law", law), np.int64)
        _refuse((law < 0) | (law > 2), "link", "has an unknown law (0 bar, 1 cable, 2 strut)", law)
        stiffness = self._link_array("stiffness", stiffness)
        _refuse(~((stiffness > 0) & np.isfinite(stiffness)), "link", "needs a positive stiffness", stiffness)
        prestrain = self._prestrain(0.0 if prestrain is None else prestrain)
        fixed = np.zeros(self._shape, bool) if fixed is None else self._node_array("fixed", fixed, bool)
        prescribed = self._node_array("prescribed", 0.0 if prescribed is None else prescribed)
        _refuse(
            ((prescribed != 0) & ~fixed).any(axis=1),
            "node",
            "has a prescribed displacement in a direction that is not fixed",
            prescribed,
        )
        load = self._node_array("load", 0.0 if load is None else load)
        subdomain = None if subdomain is None else self._subdomain(subdomain)

        self.comm = _comm(comm)
        self._slices = _Slices(self.comm, len(nodes), len(links), subdomain)
        self._handle = handle = _latin.LinksHandle()
        mine = self._slices.my_links
        handle.create(self.comm, len(nodes), self._my_nodes(nodes), _native(links[mine], PETSc.IntType))
        handle.set_laws(
            _native(law[mine], PETSc.IntType), _native(stiffness[mine]), _native(np.asarray(prestrain)[mine])
        )
        handle.set_supports(self._my_nodes(fixed, _BOOL), self._my_nodes(prescribed))
        handle.set_loads(self._my_nodes(load))
        if subdomain is not None:
            handle.set_subdomains(_native(subdomain[mine], PETSc.IntType))
        handle.setup()
        # solvers know the DM, not this object: they find the caller's numbering there
        self.dm.setAttr("latinpc_slices", self._slices)

    @classmethod
    def from_scene(cls, scene, comm=None):
        """Make the structure of a `latinpc.scenes.Scene`; collective.

        Parameters
        ----------
        scene : latinpc.scenes.Scene
            The same on every rank.
        comm : petsc4py or mpi4py communicator, optional
            PETSc's default communicator when not given.

        Returns
        -------
        Links
        """
        names = ("nodes", "links", "law", "stiffness", "prestrain", "fixed", "prescribed", "load", "subdomain")
        return cls(**{name: getattr(scene, name) for name in names}, comm=comm)

    def __repr__(self):
        s = self.sizes
        return f"<Links: {s.links} links, {s.nodes} nodes, {s.free_dofs} free dofs in {s.dim}D>"

    # ---- PETSc objects --------------------------------------------------------------------------------

    @property
    def dm(self):
        """petsc4py.PETSc.DMPlex : the links as cells of dimension 1; not collective."""
        return self._handle.dm()

    @property
    def sizes(self):
        """Sizes : dimension, nodes, links and free degrees of freedom of the whole; not collective."""
        return Sizes(*self._handle.sizes())

    def attach(self, solver):
        """Give a SNES the DM, the residual and the Jacobian; give a PC of type latin the structure.

        Collective. A SNES may be of any type: ``newtonls`` solves the same structure as ``latin``.

        Parameters
        ----------
        solver : petsc4py.PETSc.SNES or petsc4py.PETSc.PC
        """
        if isinstance(solver, PETSc.PC):
            self._handle.set_pc(solver)
        else:
            self._handle.attach(solver)
        solver.setAttr("latinpc_slices", self._slices)

    def create_snes(self, comm=None):
        """Make a SNES with the structure attached, its options not yet read; collective.

        Parameters
        ----------
        comm : petsc4py or mpi4py communicator, optional
            That of the structure when not given.

        Returns
        -------
        petsc4py.PETSc.SNES
            Of type latin; ``setFromOptions`` may change it.
        """
        snes = PETSc.SNES().create(self.comm if comm is None else _comm(comm))
        self.attach(snes)
        snes.setType("latin")
        return snes

    def create_vec(self):
        """Make a displacement of the free degrees of freedom (m), zero; collective.

        Returns
        -------
        petsc4py.PETSc.Vec
        """
        u = self.dm.createGlobalVector()
        u.set(0)
        return u

    # ---- mechanics --------------------------------------------------------------------------------------

    def residual(self, u, r):
        """Compute the nodal unbalance B^t tau - F (N) at the free degrees of freedom, equation (1); collective.

        Parameters
        ----------
        u : petsc4py.PETSc.Vec
            Displacement (m).
        r : petsc4py.PETSc.Vec
            Overwritten.
        """
        self._handle.residual(u, r)

    def jacobian(self, u, J):
        """Compute the tangent stiffness B^t k B of the taut links (N/m); collective.

        Parameters
        ----------
        u : petsc4py.PETSc.Vec
            Displacement (m).
        J : petsc4py.PETSc.Mat
            Made by ``dm.createMatrix()``; overwritten.
        """
        self._handle.jacobian(u, J)

    def energy(self, u):
        """Compute the potential energy of links and loads (J); collective.

        Parameters
        ----------
        u : petsc4py.PETSc.Vec
            Displacement (m).

        Returns
        -------
        float
        """
        return self._handle.energy(u)

    def errors(self, u, reference):
        """Compare two displacements; collective.

        Parameters
        ----------
        u, reference : petsc4py.PETSc.Vec
            Displacements (m).

        Returns
        -------
        l2 : float
            Norm of the difference over that of the reference.
        energy : float
            The same in the norm sum k e^2 over the links.
        """
        return self._handle.errors(u, reference)

    # ---- the caller's numbering -------------------------------------------------------------------------

    def displacements(self, u):
        """Return the displacement of every node, prescribed ones included; collective.

        Parameters
        ----------
        u : petsc4py.PETSc.Vec
            Displacement of the free degrees of freedom (m).

        Returns
        -------
        (n, dim) array of float
            The same on every rank (m).
        """
        s = self._slices
        mine = np.zeros((s.node_end - s.node_start, self._shape[1]))
        self._handle.displacements(u, mine)
        return s.gather_nodes(mine)

    def tensions(self, u):
        """Return the tension of every link by its law; collective.

        Parameters
        ----------
        u : petsc4py.PETSc.Vec
            Displacement of the free degrees of freedom (m).

        Returns
        -------
        (m,) array of float
            The same on every rank (N), positive in tension.
        """
        mine = np.zeros(len(self._slices.my_links))
        self._handle.tensions(u, mine)
        return self._slices.gather_links(mine)

    def set_displacements(self, displacement, u):
        """Write the displacement of the nodes into the free degrees of freedom; collective.

        Parameters
        ----------
        displacement : (n, dim) array_like of float
            The same on every rank (m); entries of fixed components are ignored.
        u : petsc4py.PETSc.Vec
            Overwritten.
        """
        self._handle.set_displacements(self._my_nodes(self._node_array("displacement", displacement)), u)

    def set_load(self, load):
        """Change the external nodal forces; collective.

        Parameters
        ----------
        load : (n, dim) array_like of float
            The same on every rank (N).
        """
        self._handle.set_loads(self._my_nodes(self._node_array("load", load)))

    def set_prestrain(self, prestrain):
        """Change the prestrain of the links; collective.

        Parameters
        ----------
        prestrain : (m,) array_like of float, or float
            The same on every rank (m).
        """
        self._handle.set_prestrain(_native(self._prestrain(prestrain)[self._slices.my_links]))

    def set_subdomains(self, subdomain):
        """Change the partition of the links, before a solver is set up; collective.

        Parameters
        ----------
        subdomain : (m,) array_like of int
            The same on every rank, counted from 0 without gaps.
        """
        self._handle.set_subdomains(_native(self._subdomain(subdomain)[self._slices.my_links], PETSc.IntType))

    # ---- shapes -----------------------------------------------------------------------------------------

    def _link_array(self, name, values, dtype=np.float64):
        return _shaped(name, values, (self._count,), dtype, "a value per link")

    def _node_array(self, name, values, dtype=np.float64):
        values = _shaped(name, values, self._shape, dtype, "a row per node, a column per direction")
        if dtype is not bool:
            _refuse(~np.isfinite(values).all(axis=1), "node", f"has a {name} that is not finite", values)
        return values

    def _prestrain(self, values):
        values = self._link_array("prestrain", values)
        _refuse(~np.isfinite(values), "link", "has a prestrain that is not finite", values)
        return values

    def _subdomain(self, values):
        values = self._link_array("subdomain", _integers("subdomain", values), np.int64)
        _refuse(values < 0, "link", "has a negative subdomain", values)
        count = int(values.max()) + 1
        if count > self._count:
            raise ValueError(f"{count} subdomains for {self._count} links: at most one a link")
        empty = np.flatnonzero(np.bincount(values, minlength=count) == 0)
        if empty.size:
            raise ValueError(f"subdomain {empty[0]} has no link; subdomains are numbered from 0 without gaps")
        return values

    def _my_nodes(self, values, dtype=np.float64):
        return _native(values[self._slices.node_start : self._slices.node_end], dtype)


def _native(values, dtype=np.float64):
    """Make an array that C reads as it is."""
    return np.require(values, dtype=dtype, requirements=["C", "A"])


def _integers(name, values):
    values = np.asarray(values)
    if not np.issubdtype(values.dtype, np.integer):
        if values.size and not (values == np.floor(values)).all():
            raise ValueError(f"{name} must be integers, not {values.dtype}")
        values = values.astype(np.int64)
    return values


def _shaped(name, values, shape, dtype, meaning):
    values = np.asarray(values, dtype=dtype)
    if values.ndim and values.shape != shape:
        raise ValueError(f"{name} must have the shape {shape}, {meaning}, not {values.shape}")
    return np.broadcast_to(values, shape)


def _refuse(wrong, what, why, values):
    """Raise a ValueError that names the first culprits."""
    culprits = np.flatnonzero(wrong)
    if not culprits.size:
        return
    named = ", ".join(f"{i} ({np.array2string(values[i])})" for i in culprits[:_MAX_NAMED])
    more = f" and {culprits.size - _MAX_NAMED} more" if culprits.size > _MAX_NAMED else ""
    raise ValueError(f"{what} {named}{more} {why}")


def _comm(comm):
    """Make a petsc4py communicator of what the caller has."""
    if comm is None:
        comm = PETSc.Sys.getDefaultComm()
    return comm if isinstance(comm, PETSc.Comm) else PETSc.Comm(comm)
