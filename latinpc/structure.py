"""Structures of links from numpy arrays.

Every rank passes the same whole arrays. All ranks of the communicator call what is marked *collective*. Results are
whole arrays in the caller's own numbering, the same on every rank.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from petsc4py import PETSc

from latinpc.arrays import REAL, Slices, integers, native, partition, real, refuse, shaped
from latinpc.checks import Checks
from latinpc.laws import Law
from latinpc.library import _latin
from latinpc.userlaws import register_table

__all__ = ["Sizes", "Structure"]


_BOOL = np.dtype(f"i{_latin.BOOL_SIZE}")


class Sizes(NamedTuple):
    """Size of a whole structure."""

    dim: int
    nodes: int
    links: int
    free_dofs: int


class Structure:
    """A structure of links in 1, 2 or 3 dimensions: nodes, links, laws, supports and loads.

    Collective. Every rank passes the same whole arrays and keeps its share only.

    Parameters
    ----------
    nodes : (n, dim) array_like of float
        Coordinates (m).
    links : (m, 2) array_like of int
        The two nodes of each link, counted from 0.
    law : (m,) array_like of int or str, or one for all links
        `latinpc.Law`, or its name: 0 ``"bar"``, tau = k (e + e0); 1 ``"cable"``, tau = k max(e + e0, 0);
        2 ``"compression_only"``, tau = k min(e + e0, 0); 3 ``"inextensible"``; 4 ``"contact"``; 5 ``"friction"`` and
        6 ``"tangent"``, parts of a contact with friction; equations (2) to (5). Or the number that `register_table`
        or `register_law` returns.
    stiffness : (m,) array_like of float, or float
        k (N/m), positive. Of a rigid law (3 to 6) it is the search parameter: it affects speed, not the result; 0:
        automatic. Of a table, 0 means the table's own stiffness.
    initial_elongation : (m,) array_like of float, or float, optional
        e0 (m), zero by default; the self-stress is k e0. Of a contact, the gap.
    fixed : (n, dim) array_like of bool, optional
        Components whose displacement is prescribed. None by default.
    prescribed : (n, dim) array_like of float, optional
        Their displacement (m), zero by default.
    load : (n, dim) array_like of float, optional
        External nodal forces F (N), zero by default.
    subdomain : (m,) array_like of int, optional
        Subdomain of each link, counted from 0 without gaps, for solvers that are given no other by
        `latinpc.set_partition`. Without it they make a partition.
    direction : (m, dim) array_like of float, optional
        Directions of links other than from their first to their second node, zero where it is that: normals of
        contacts between nodes at one place, tangential parts of contacts, the transverse stiffness of taut cables.
    friction : (m,) array_like of float, or float, optional
        Coefficients of friction, read at links of law 5. Such a contact is `dim` consecutive links of the same nodes:
        law 5 along its normal, then law 6 along directions at right angles.
    mass : (n,) array_like of float, or float, optional
        Lumped masses of the nodes (kg), for dynamics only.
    prestress : (m,) array_like of float, or float, optional
        Self-stress T (N) in place of initial elongations, e0 = T / k: of bars, of cables not negative, of
        compression-only links not positive, and zero of other laws.
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
    >>> frame = latinpc.Structure(
    ...     nodes=[[-1, 0], [1, 0], [0, -1]], links=[[0, 2], [1, 2]], law="bar", stiffness=1e3,
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
        initial_elongation=None,
        fixed=None,
        prescribed=None,
        load=None,
        subdomain=None,
        direction=None,
        friction=None,
        mass=None,
        prestress=None,
        comm=None,
    ):
        nodes = real("nodes", nodes, REAL)
        if nodes.ndim != 2 or nodes.shape[1] not in (1, 2, 3) or len(nodes) == 0:
            raise ValueError(f"nodes must be an (n, dim) array with dim 1, 2 or 3, not of shape {nodes.shape}")
        links = integers("links", links)
        if links.ndim != 2 or links.shape[1] != 2 or len(links) == 0:
            raise ValueError(f"links must be an (m, 2) array of node numbers, not of shape {links.shape}")
        self._checks = Checks(nodes.shape, len(links))
        direction = self._checks.geometry(nodes, links, direction)
        law, stiffness, friction = self._checks.constitution(law, stiffness, friction)
        if initial_elongation is not None and prestress is not None:
            raise ValueError("initial_elongation and prestress both give the self-stress: leave out one of the two")
        initial_elongation = self._checks.initial_elongation(0.0 if initial_elongation is None else initial_elongation)
        prestress = None if prestress is None else self._checks.prestress(prestress, law)
        fixed, prescribed = self._checks.supports(fixed, prescribed)
        load = self._checks.node_array("load", 0.0 if load is None else load)
        subdomain = None if subdomain is None else partition("subdomain", subdomain, len(links))

        self.comm = _comm(comm)
        self._slices = Slices(self.comm, len(nodes), law, subdomain)
        self._handle = handle = _latin.StructureHandle()
        mine = self._slices.my_links
        handle.create(self.comm, len(nodes), self._my_nodes(nodes), native(links[mine], PETSc.IntType))
        self._my_law = native(law[mine], PETSc.IntType)
        handle.set_laws(self._my_law, native(stiffness[mine]), native(initial_elongation[mine]))
        if prestress is not None:
            handle.set_prestress(native(prestress[mine]))
        if direction is not None:
            handle.set_directions(native(direction[mine]))
        if friction is not None:
            handle.set_friction(native(friction[mine]))
        self._my_fixed = self._my_nodes(fixed, bool)
        handle.set_supports(self._my_nodes(fixed, _BOOL), self._my_nodes(prescribed))
        handle.set_loads(self._my_nodes(load))
        if subdomain is not None:
            self._compose_partition(subdomain)
        handle.setup()
        if mass is not None:
            self.set_mass(mass)
        # a solver has the DM, not this object: it finds the caller's numbering there
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
        Structure
        """
        names = ("nodes", "links", "stiffness", "initial_elongation", "fixed", "prescribed", "load", "subdomain")
        names += ("direction", "friction", "mass")
        tables = [register_table(*table) for table in scene.tables]
        law = np.append(np.array(Law), tables)[scene.law] if tables else scene.law
        return cls(**{name: getattr(scene, name) for name in names}, law=law, comm=comm)

    def __repr__(self):
        s = self.sizes
        return f"<Structure: {s.links} links, {s.nodes} nodes, {s.free_dofs} free dofs in {s.dim}D>"

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
        """Attach the structure to a solver; collective.

        A SNES gets the DM, the residual and the Jacobian, and may be of any type: ``newtonls`` solves the same
        structure as ``latin``. A TS gets the equation of motion, and may be of type ``latin`` or of a PETSc type for
        equations of second order, such as ``alpha2``. A SNES or a TS that was attached to another structure is reset:
        a TS then starts from rest, without displacement.

        Parameters
        ----------
        solver : petsc4py.PETSc.SNES, petsc4py.PETSc.KSP, petsc4py.PETSc.PC or petsc4py.PETSc.TS
        """
        if isinstance(solver, PETSc.PC):
            self._handle.set_pc(solver)
        elif isinstance(solver, PETSc.KSP):
            self._handle.set_ksp(solver)
        elif isinstance(solver, PETSc.TS):
            had = solver.getSolution()
            self._handle.attach_ts(solver)
            if had and not solver.getSolution():  # that of another structure
                solver.setSolution2(self.create_vec(), self.create_vec())
            solver.getDM().setAttr("latinpc_slices", self._slices)  # for the SNES of the steps
        else:
            self._handle.attach(solver)
            solver.getDM().setAttr("latinpc_slices", self._slices)  # where its KSP and PC are asked
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

    def create_ts(self, u=None, v=None, comm=None):
        """Make a TS with the structure attached, its options not yet read; collective.

        Parameters
        ----------
        u, v : petsc4py.PETSc.Vec, optional
            Displacement (m) and velocity (m/s) to start from, which move with the steps; zero when not given.
        comm : petsc4py or mpi4py communicator, optional
            That of the structure when not given.

        Returns
        -------
        petsc4py.PETSc.TS
            Of type latin; ``setFromOptions`` may change it. ``ts.getSolution2()`` returns ``u`` and ``v``.
        """
        ts = PETSc.TS().create(self.comm if comm is None else _comm(comm))
        self.attach(ts)
        ts.setType("latin")
        ts.setSolution2(self.create_vec() if u is None else u, self.create_vec() if v is None else v)
        return ts

    def create_vec(self):
        """Make a displacement of the free degrees of freedom (m), zero; collective.

        Returns
        -------
        petsc4py.PETSc.Vec
        """
        u = self.dm.createGlobalVec()
        u.set(0)
        return u

    # ---- mechanics --------------------------------------------------------------------------------------

    def residual(self, u, r):
        """Compute the nodal unbalance B^t tau - F (N) at the free degrees of freedom, equation (1); collective.

        Not of structures with rigid laws, whose tensions a solver has: ``snes.computeFunction(u, r)``.

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
            Made by ``dm.createMat()``; overwritten.
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

    def kinetic_energy(self, v):
        """Compute the kinetic energy 1/2 v^t M v of the free degrees of freedom (J); collective.

        Parameters
        ----------
        v : petsc4py.PETSc.Vec
            Velocity (m/s).

        Returns
        -------
        float
        """
        return self._handle.kinetic_energy(v)

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
        mine = np.zeros((s.node_end - s.node_start, self._checks.shape[1]), dtype=REAL)
        self._handle.displacements(u, mine)
        return s.gather_nodes(mine)

    def tensions(self, u):
        """Return the tension of every link by its law; collective.

        Not of structures with rigid laws, whose tensions a solver has: `latinpc.tensions`.

        Parameters
        ----------
        u : petsc4py.PETSc.Vec
            Displacement of the free degrees of freedom (m).

        Returns
        -------
        (m,) array of float
            The same on every rank (N), positive in tension.
        """
        mine = np.zeros(len(self._slices.my_links), dtype=REAL)
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
        self._handle.set_displacements(self._my_nodes(self._checks.node_array("displacement", displacement)), u)

    def set_load(self, load):
        """Change the external nodal forces; collective.

        Parameters
        ----------
        load : (n, dim) array_like of float
            The same on every rank (N).
        """
        self._handle.set_loads(self._my_nodes(self._checks.node_array("load", load)))

    def set_prescribed(self, prescribed):
        """Change the prescribed displacements, settlements for instance; collective.

        Parameters
        ----------
        prescribed : (n, dim) array_like of float
            The same on every rank (m), zero in directions that are not fixed.
        """
        fixed = self._slices.gather_nodes(self._my_fixed)
        self._handle.set_prescribed(self._my_nodes(self._checks.supports(fixed, prescribed)[1]))

    def set_initial_elongation(self, initial_elongation):
        """Change the initial elongations of the links; collective.

        Parameters
        ----------
        initial_elongation : (m,) array_like of float, or float
            The same on every rank (m).
        """
        self._handle.set_initial_elongation(
            native(self._checks.initial_elongation(initial_elongation)[self._slices.my_links])
        )

    def set_prestress(self, prestress):
        """Change the initial elongations of the links to those of given tensions; collective.

        Parameters
        ----------
        prestress : (m,) array_like of float, or float
            The same on every rank (N); see `Structure`.
        """
        prestress = self._checks.prestress(prestress, self._slices.gather_links(self._my_law))
        self._handle.set_prestress(native(prestress[self._slices.my_links]))

    def set_mass(self, mass):
        """Give the nodes their masses, or change them; collective.

        Parameters
        ----------
        mass : (n,) array_like of float, or float
            Lumped masses (kg), not negative, the same on every rank.
        """
        mass = shaped("mass", mass, self._checks.shape[:1], REAL, "a value per node")
        refuse(~((mass >= 0) & np.isfinite(mass)), "node", "has a mass that is negative or not finite", mass)
        self._handle.set_mass(self._my_nodes(mass))

    def _compose_partition(self, subdomain):
        """Leave the partition where every solver on this structure finds it."""
        mine = native(subdomain[self._slices.my_links], PETSc.IntType)
        self.dm.compose("subdomains", PETSc.IS().createGeneral(mine, comm=self.comm))

    def _my_nodes(self, values, dtype=REAL):
        return native(values[self._slices.node_start : self._slices.node_end], dtype)


def _comm(comm):
    """Make a petsc4py communicator of what the caller has."""
    if comm is None:
        comm = PETSc.Sys.getDefaultComm()
    return comm if isinstance(comm, PETSc.Comm) else PETSc.Comm(comm)
