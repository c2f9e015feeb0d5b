"""Elongations, tensions and errors of a scene's arrays: numpy only, no solver."""

from __future__ import annotations

import numpy as np

from latinpc.laws import Law


def elongations(scene, displacement):
    """Return the elongations e = B U.

    Parameters
    ----------
    scene : Scene
    displacement : (n, dim) array
        Of all nodes, prescribed components included (m).

    Returns
    -------
    (m,) array
        In m.
    """
    relative = displacement[scene.links[:, 1]] - displacement[scene.links[:, 0]]
    return np.einsum("ij,ij->i", relative, scene.directions)


def tensions(scene, displacement):
    """Return the tensions of bars, cables and compression-only links, equations (2), (4), (5).

    Parameters
    ----------
    scene : Scene
    displacement : (n, dim) array
        Of all nodes, prescribed components included (m).

    Returns
    -------
    (m,) array
        In N.
    """
    tau = scene.stiffness * (elongations(scene, displacement) + scene.initial_elongation)
    tau = np.where(scene.law == Law.CABLE, np.maximum(tau, 0.0), tau)
    return np.where(scene.law == Law.COMPRESSION_ONLY, np.minimum(tau, 0.0), tau)


def slack(scene, tensions):
    """Find the slack links: cables, compression-only links and contacts without force.

    Parameters
    ----------
    scene : Scene
    tensions : (m,) array
        In N. What is below rounding of the largest one counts as zero.

    Returns
    -------
    (m,) array of bool
    """
    threshold = 1e-12 * np.abs(tensions).max(initial=0.0)
    cable = np.isin(scene.law, (Law.CABLE, Law.INEXTENSIBLE)) & (tensions <= threshold)
    return cable | (np.isin(scene.law, (Law.COMPRESSION_ONLY, Law.CONTACT, Law.FRICTION)) & (tensions >= -threshold))


def errors(scene, displacement, reference):
    """Compare two displacements as `latinpc.Structure.errors` does.

    Parameters
    ----------
    scene : Scene
    displacement, reference : (n, dim) array
        Of all nodes (m).

    Returns
    -------
    l2, energy : float
        Relative; of the free components, and in the norm sum k e^2. Infinite when a value is not finite.
    """
    difference = np.where(scene.fixed, 0.0, displacement - reference)
    if not np.isfinite(difference).all():
        return np.inf, np.inf
    l2 = np.linalg.norm(difference), np.linalg.norm(np.where(scene.fixed, 0.0, reference))
    root = np.sqrt(scene.stiffness)
    energy = [np.linalg.norm(root * elongations(scene, field)) for field in (difference, reference)]
    return tuple(float(a / b) if b > 0 else float(a) for a, b in (l2, energy))
