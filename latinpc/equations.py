"""Balance, tangent stiffness and energies of a structure, for PETSc's vectors."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from petsc4py import PETSc

from latinpc.arrays import REAL, native
from latinpc.library import _latin

__all__ = ["Equations"]


class Equations:
    """What the library computes of a displacement."""

    _handle: _latin.StructureHandle

    def residual(self, u: PETSc.Vec, r: PETSc.Vec) -> None:
        """Compute the nodal unbalance B^t tau - F (N) at the free degrees of freedom, equation (1); collective.

        Where links turn, of the displaced structure.

        Not of structures with rigid laws, whose tensions a solver has: ``snes.computeFunction(u, r)``.

        Parameters
        ----------
        u : petsc4py.PETSc.Vec
            Displacement (m).
        r : petsc4py.PETSc.Vec
            Overwritten.
        """
        self._handle.residual(u, r)

    def jacobian(self, u: PETSc.Vec, J: PETSc.Mat) -> None:
        """Compute the tangent stiffness (N/m), B^t k B of the taut links where these do not turn; collective.

        Parameters
        ----------
        u : petsc4py.PETSc.Vec
            Displacement (m).
        J : petsc4py.PETSc.Mat
            Made by ``dm.createMat()``; overwritten.
        """
        self._handle.jacobian(u, J)

    def geometric_stiffness(self, u: PETSc.Vec, tensions: ArrayLike, G: PETSc.Mat) -> None:
        """Compute the geometric stiffness of given tensions (N/m), the sum of tau / R (1 - n n^t); collective.

        R and n are length and direction of a link, of the displaced structure where the geometry is ``"large"``, as
        drawn where it is ``"prestress"``. With the tensions at `u` it is the part of the tangent stiffness `jacobian`
        that prestress makes.

        Parameters
        ----------
        u : petsc4py.PETSc.Vec
            Displacement (m).
        tensions : (m,) array_like of float
            The same on every rank (N), positive in tension.
        G : petsc4py.PETSc.Mat
            Made by ``dm.createMat()``; overwritten.
        """
        tensions = self._checks.link_array("tensions", tensions)
        self._handle.geometric_stiffness(u, native(self._slices.mine(tensions)), G)

    def tension_rates(self, u: PETSc.Vec, v: PETSc.Vec) -> np.ndarray:
        """Return the derivative of the tensions at `u` along `v`, zero in slack links; collective.

        Where links turn: not of the geometry ``"linear"``.

        Parameters
        ----------
        u, v : petsc4py.PETSc.Vec
            Displacements (m).

        Returns
        -------
        (m,) array of float
            The same on every rank (N).
        """
        mine = np.zeros(len(self._slices.my_links), dtype=REAL)
        self._handle.tension_rates(u, v, mine)
        return self._slices.gather_links(mine)

    def energy(self, u: PETSc.Vec) -> float:
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

    def kinetic_energy(self, v: PETSc.Vec) -> float:
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

    def errors(self, u: PETSc.Vec, reference: PETSc.Vec) -> tuple[float, float]:
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
