"""Structures of links from numpy arrays.

Every rank passes the same whole arrays. All ranks of the communicator call what is marked *collective*. Results are
whole arrays in the caller's own numbering, the same on every rank.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from petsc4py import PETSc

from latinpc.actions import Actions
from latinpc.arrays import REAL, Slices, agreed, alike, communicator, index_set, native
from latinpc.checks import ARRAYS, INSTEAD, Agreed, Checks, check_assigned, check_scene, checked
from latinpc.equations import Equations
from latinpc.geometry import GEOMETRIES, Geometry, known_geometry
from latinpc.library import _latin
from latinpc.results.notices import coincident, duplicates, errors_as_given, unlinked_as_value
from latinpc.results.plots import Plots
from latinpc.results.result import Result
from latinpc.results.solve import solve
from latinpc.userlaws import own_stiffness, registered

if TYPE_CHECKING:
    from mpi4py import MPI

    Communicator: TypeAlias = PETSc.Comm | MPI.Comm

__all__ = ["Sizes", "Structure"]


_BOOL = np.dtype(f"i{_latin.BOOL_SIZE}")


class Sizes(NamedTuple):
    """Size of a whole structure."""

    dim: int
    nodes: int
    links: int
    free_dofs: int


class Structure(Geometry, Equations, Actions, Plots):
    """A structure of links in 1, 2 or 3 dimensions: nodes, links, laws, supports and loads.

    Collective. Every rank passes the same whole arrays.

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
        automatic. Of a table, 0 means the table's own stiffness, which the attribute then has. Either this or
        `EA` is given; neither is 0, where all laws are rigid or tables.
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
    geometry : {"linear", "prestress", "large"}, optional
        How displacements turn links: not at all; by small angles, against which each link resists by its tension as
        drawn over its length; or as far as they go, with the tension of the law at the strain ``|r| - l + e0``, r from
        the first node to the second one, l the length as drawn. The latter two are for elastic links in the
        direction of their nodes, the last one for inextensible cables as well.
    comm : petsc4py or mpi4py communicator, optional
        PETSc's default communicator when not given.
    area : (m,) array_like of float, or float, optional
        Areas of the cross sections (m^2), NaN where not known: results then have stresses.
    strength : (m,) array_like of float, or float, optional
        Stresses that the links bear (Pa), in tension and in compression, NaN where not known: results then have
        utilisations.
    name : str, optional
        For summaries and pictures.
    EA : (m,) array_like of float, or float, optional
        Axial stiffnesses (N) in place of `stiffness`, which is then EA over the length as drawn; 0 of rigid laws.

    Attributes
    ----------
    name : str
    nodes, links, law, stiffness, initial_elongation, fixed, prescribed, load : array
        What was given, whole, read-only; ``set_load`` and its like change it. `law` holds numbers, `laws` the names.
    subdomain, direction, friction, mass, area, strength : array or None
        The same, None where not given.
    lengths, directions : array
        Length (m) and unit vector of each link, (m,) and (m, dim).
    comm : petsc4py.PETSc.Comm
    notices : list of str
        What looks wrong in the arrays, for each result to warn of.

    Raises
    ------
    ValueError
        On every rank, naming the first nodes or links that do not fit.
    LatinError
        On every rank: what the library refuses.

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
    >>> frame.solve().tensions.round(3)
    array([7.071, 7.071])
    """

    nodes: np.ndarray
    links: np.ndarray
    law: np.ndarray
    stiffness: np.ndarray
    initial_elongation: np.ndarray
    fixed: np.ndarray
    prescribed: np.ndarray
    load: np.ndarray
    subdomain: np.ndarray | None
    direction: np.ndarray | None
    friction: np.ndarray | None
    mass: np.ndarray | None
    area: np.ndarray | None
    strength: np.ndarray | None

    def __init__(
        self,
        nodes: ArrayLike,
        links: ArrayLike,
        law: ArrayLike,
        stiffness: ArrayLike | None = None,
        initial_elongation: ArrayLike | None = None,
        fixed: ArrayLike | None = None,
        prescribed: ArrayLike | None = None,
        load: ArrayLike | None = None,
        subdomain: ArrayLike | None = None,
        direction: ArrayLike | None = None,
        friction: ArrayLike | None = None,
        mass: ArrayLike | None = None,
        prestress: ArrayLike | None = None,
        geometry: str = "linear",
        comm: Communicator | None = None,
        area: ArrayLike | None = None,
        strength: ArrayLike | None = None,
        name: str = "structure",
        EA: ArrayLike | None = None,
    ):
        given = locals()
        given = {array: given[array] for array in ("name", *ARRAYS, *INSTEAD)}
        self._make(given, comm, geometry)
        for array in ARRAYS:  # what the caller does to theirs is not done to ours
            if given[array] is not None and np.may_share_memory(getattr(self, array), np.asarray(given[array])):
                self._keep(array, getattr(self, array).copy())
        self.notices = self._doubles()

    @classmethod
    def from_scene(cls, scene: Any, comm: Communicator | None = None) -> Structure:
        """Make the structure of a `latinpc.scenes.Scene`; collective.

        Parameters
        ----------
        scene : latinpc.scenes.Scene
            The same on every rank. The structure shares its arrays: leave them as they are.
        comm : petsc4py or mpi4py communicator, optional
            PETSc's default communicator when not given.

        Returns
        -------
        Structure
        """
        check_scene(scene)
        given = {name: getattr(scene, name) for name in ("name", *ARRAYS)} | {"law": registered(scene)}
        structure = cls.__new__(cls)
        structure.numbering = scene.numbering
        with errors_as_given(structure):
            structure._make(given, comm, scene.geometry)
        structure.notices = structure._doubles() if "file" in scene.metadata else []  # generators mean what they do
        return structure

    def _make(self, given, comm, geometry):
        """Check the arrays, keep them, and distribute them."""
        self.comm = communicator(comm)
        _latin.keep_communicator(self.comm)
        arrays = self._checked(given)
        arrays["stiffness"] = own_stiffness(arrays["law"], arrays["stiffness"])
        for array, values in arrays.items():
            self._keep(array, values)
        self.name = given["name"]
        self._handle = handle = _latin.StructureHandle()
        mine = self._slices.mine
        handle.create(
            self.comm, self._slices.nodes, self._my_nodes(self.nodes), native(mine(self.links), PETSc.IntType)
        )
        handle.set_laws(
            native(mine(self.law), PETSc.IntType), native(mine(self.stiffness)), native(mine(self.initial_elongation))
        )
        if given.get("prestress") is not None:
            self.set_prestress(given["prestress"])
        if self.direction is not None:
            handle.set_directions(native(mine(self.direction)))
        if self.friction is not None:
            handle.set_friction(native(mine(self.friction)))
        handle.set_supports(self._my_nodes(self.fixed, _BOOL), self._my_nodes(self.prescribed))
        handle.set_loads(self._my_nodes(self.load))
        self.set_geometry(geometry)
        if self.subdomain is not None:
            self.dm.compose("subdomains", index_set(self.comm.tompi4py(), mine(self.subdomain)))
        if self.mass is not None:
            handle.set_mass(self._my_nodes(self.mass))
        with unlinked_as_value(self):
            handle.setup()
        # a solver has the DM, not this object: it finds the caller's numbering there
        self.dm.setAttr("latinpc_slices", self._slices)

    def _checked(self, given):
        """Check the arrays, and find out which of them are this rank's."""
        comm = self.comm.tompi4py()
        arrays = agreed(comm, checked, given, _latin.law_names())
        some = None if given.get("prestress") is None else np.zeros(())  # `set_prestress` compares the values
        self._alike(**arrays, prestress=some)
        self._checks = Agreed(comm, Checks(arrays["nodes"].shape, len(arrays["links"])))
        self._slices = Slices(self.comm, len(arrays["nodes"]), arrays["law"])
        return arrays

    def _doubles(self):
        return duplicates(self) + coincident(self)

    def _keep(self, name, values):
        """Keep an array of the structure, which is read and not written."""
        if values is not None:
            values = values.view()
            values.flags.writeable = False
        object.__setattr__(self, name, values)

    def __setattr__(self, name: str, value: Any) -> None:
        """Refuse what the library would not see: it has the arrays of the structure."""
        check_assigned(type(self), name)
        object.__setattr__(self, name, value)

    def __reduce_ex__(self, protocol: Any) -> Any:
        """Refuse copies and pickles, which would share or lose what the library has."""
        raise TypeError(
            "a structure is not copied or pickled, its solvers have its arrays: make another of the same arrays, as by"
            " Structure.from_scene(latinpc.scenes.Scene.from_structure(structure)). Of a result, which holds its"
            " structure, keep the arrays, such as result.tensions, or result.to_dict()"
        )

    def __repr__(self) -> str:
        s = self.sizes
        return f"<Structure: {s.links} links, {s.nodes} nodes, {s.free_dofs} free dofs in {s.dim}D>"

    @property
    def laws(self) -> np.ndarray:
        """(m,) array of str : the laws by name, such as ``"cable"``; not collective."""
        return np.array(_latin.law_names())[self.law]

    # ---- PETSc objects --------------------------------------------------------------------------------

    @property
    def dm(self) -> PETSc.DMPlex:
        """petsc4py.PETSc.DMPlex : the links as cells of dimension 1; not collective."""
        return self._handle.dm()

    @property
    def sizes(self) -> Sizes:
        """Sizes : dimension, nodes, links and free degrees of freedom of the whole; not collective."""
        return Sizes(*self._handle.sizes())

    def attach(self, solver: PETSc.SNES | PETSc.KSP | PETSc.PC | PETSc.TS) -> None:
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

    def create_snes(self, comm: Communicator | None = None) -> PETSc.SNES:
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
        snes = PETSc.SNES().create(self.comm if comm is None else communicator(comm))
        self.attach(snes)
        snes.setType("latin")
        return snes

    def create_ts(
        self, u: PETSc.Vec | None = None, v: PETSc.Vec | None = None, comm: Communicator | None = None
    ) -> PETSc.TS:
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
        ts = PETSc.TS().create(self.comm if comm is None else communicator(comm))
        self.attach(ts)
        ts.setType("latin")
        ts.setSolution2(self.create_vec() if u is None else u, self.create_vec() if v is None else v)
        return ts

    def create_vec(self) -> PETSc.Vec:
        """Make a displacement of the free degrees of freedom (m), zero; collective.

        Returns
        -------
        petsc4py.PETSc.Vec
        """
        u = self.dm.createGlobalVec()
        u.set(0)
        return u

    @property
    def geometry(self) -> str:
        """str : how displacements turn links, ``"linear"``, ``"prestress"`` or ``"large"``; not collective."""
        return GEOMETRIES[self._handle.geometry()]

    def set_geometry(self, geometry: str) -> None:
        """Choose how displacements turn links, for all solvers of the structure; collective.

        Parameters
        ----------
        geometry : {"linear", "prestress", "large"}
            As that of the class.
        """
        alike(self.comm.tompi4py(), geometry=geometry)
        self._handle.set_geometry(known_geometry(geometry))

    def solve(
        self,
        *,
        error: float | None = None,
        largest_unbalance: float | None = None,
        preset: str | None = None,
        options: Mapping[str, Any] | None = None,
        raise_on_failure: bool = False,
    ) -> Result:
        """Solve for the displacements under the loads; collective.

        Parameters
        ----------
        error : float, optional
            Relative error of the displacements to stop at, between 0 and 1; 1e-4 by default.
        largest_unbalance : float, optional
            Largest unbalanced force on a node at convergence (N); by default only the norm over all nodes is limited,
            to a hundredth of the loads.
        preset : str, optional
            A ready-made set of options, as ``"fast"``, ``"balanced"``, ``"accurate"`` or ``"large"``: the name of a
            file of the folder options, without its suffix.
        options : mapping, optional
            PETSc options by name, as ``{"snes_latin_subdomains": 16, "snes_monitor": None}``; they come before the
            preset, and what stands in PETSc's own database (``PETSC_OPTIONS``) before both. A geometry among them is
            that of this solve and of its result.
        raise_on_failure : bool
            Raise an error, not a warning, where the solve does not converge.

        Returns
        -------
        latinpc.Result
            Displacements, tensions, reactions and more, whole and the same on every rank.

        Warns
        -----
        latinpc.ConvergenceWarning
            When the solve has not converged; the result says why.
        latinpc.LatinWarning
            Of what looks wrong: duplicate links, displacements beyond the size of the structure, unused options.

        Raises
        ------
        ValueError
            For an argument out of its range, an unknown preset or a misspelt option, with the nearest name.
        latinpc.SolveError
            For a structure that cannot be solved, such as one with a mechanism; with `raise_on_failure` when the
            solve has not converged, with its result as `result`.
        """
        return solve(self, error, largest_unbalance, preset, options, raise_on_failure)

    # ---- the caller's numbering -------------------------------------------------------------------------

    def displacements(self, u: PETSc.Vec) -> np.ndarray:
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

    def tensions(self, u: PETSc.Vec) -> np.ndarray:
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

    def set_displacements(self, displacement: ArrayLike, u: PETSc.Vec) -> None:
        """Write the displacement of the nodes into the free degrees of freedom; collective.

        Parameters
        ----------
        displacement : (n, dim) array_like of float
            The same on every rank (m); entries of fixed components are ignored.
        u : petsc4py.PETSc.Vec
            Overwritten.
        """
        displacement = self._checks.node_array("displacement", displacement)
        self._alike(displacement=displacement)
        self._handle.set_displacements(self._my_nodes(displacement), u)

    def _my_nodes(self, values, dtype=REAL):
        return native(values[self._slices.node_start : self._slices.node_end], dtype)
