"""What acts on a structure, and its masses: they change without a new set-up."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from petsc4py import PETSc

from latinpc.arrays import REAL, native, same_arrays
from latinpc.library import _latin

__all__ = ["Actions"]


class Actions:
    """Loads, prescribed displacements, initial elongations and masses of `latinpc.Structure`."""

    links: np.ndarray
    law: np.ndarray
    stiffness: np.ndarray
    fixed: np.ndarray
    comm: PETSc.Comm
    _handle: _latin.StructureHandle

    def set_load(self, load: ArrayLike) -> None:
        """Change the external nodal forces; collective.

        Parameters
        ----------
        load : (n, dim) array_like of float
            The same on every rank (N).
        """
        load = np.array(self._checks.node_array("load", load))
        self._alike(load=load)
        self._handle.set_loads(self._my_nodes(load))
        self._keep("load", load)

    def set_prescribed(self, prescribed: ArrayLike) -> None:
        """Change the prescribed displacements, settlements for instance; collective.

        In a motion supports go there in the next step, at whose end they are to be there.

        Parameters
        ----------
        prescribed : (n, dim) array_like of float
            The same on every rank (m), zero in directions that are not fixed.
        """
        prescribed = np.array(self._checks.supports(self.fixed, prescribed)[1])
        self._alike(prescribed=prescribed)
        self._handle.set_prescribed(self._my_nodes(prescribed))
        self._keep("prescribed", prescribed)

    def set_initial_elongation(self, initial_elongation: ArrayLike) -> None:
        """Change the initial elongations of the links; collective.

        Parameters
        ----------
        initial_elongation : (m,) array_like of float, or float
            The same on every rank (m).
        """
        elongation = np.array(self._checks.initial_elongation(initial_elongation))
        self._alike(initial_elongation=elongation)
        self._handle.set_initial_elongation(native(self._slices.mine(elongation)))
        self._keep("initial_elongation", elongation)

    def set_prestress(self, prestress: ArrayLike) -> None:
        """Change the initial elongations of the links to those of given tensions; collective.

        Parameters
        ----------
        prestress : (m,) array_like of float, or float
            The same on every rank (N); see `Structure`.
        """
        tension = self._checks.prestress(prestress, self.law)
        self._alike(prestress=tension)
        self._handle.set_prestress(native(self._slices.mine(tension)))
        elongation = np.zeros(len(self.links), dtype=REAL)
        np.divide(tension, self.stiffness, out=elongation, where=tension != 0)
        self._keep("initial_elongation", elongation)

    def set_mass(self, mass: ArrayLike) -> None:
        """Give the nodes their masses, or change them; collective.

        Parameters
        ----------
        mass : (n,) array_like of float, or float
            Lumped masses (kg), not negative, the same on every rank.
        """
        mass = np.array(self._checks.mass(mass))
        self._alike(mass=mass)
        self._handle.set_mass(self._my_nodes(mass))
        self._keep("mass", mass)

    def _alike(self, **arrays):
        """Refuse arrays that are not the same on every rank, of which each takes its part; collective."""
        same_arrays(self.comm.tompi4py(), **arrays)
