"""What every solution meets, unique or not: balance, the gaps of rigid links, Coulomb's law."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from latinpc.laws import Law
from latinpc.results.mechanics import elongations

NOTHING = (
    1e-10  # of the largest stiffness times the largest initial elongation: forces of slack links that are rounding
)


def missed(scene, u, tensions):
    """Return by how much the worst condition is missed, relative to the largest forces and displacements.

    Parameters
    ----------
    scene : Scene
    u : (n, dim) array
        Displacements (m).
    tensions : (m,) array
        Of all links (N).

    Returns
    -------
    float
        0 for an exact solution.
    """
    forces, size = np.zeros(scene.nodes.shape), np.zeros(len(scene.nodes))
    for end, sign in ((0, -1.0), (1, 1.0)):
        np.add.at(forces, scene.links[:, end], sign * tensions[:, None] * scene.directions)
        np.add.at(size, scene.links[:, end], np.abs(tensions))
    nothing = NOTHING * scene.stiffness.max() * np.abs(scene.initial_elongation).max()
    force = max(size.max(), np.abs(scene.load).max(), nothing) or 1.0
    balance = np.abs(np.where(scene.fixed, 0.0, forces - scene.load)).max()
    e = elongations(scene, u)
    length = max(np.abs(e).max(), np.abs(scene.initial_elongation).max())
    if length <= 64 * np.finfo(float).eps * np.ptp(scene.nodes):
        length = np.inf  # nothing moves
    push, opening = _normal(scene, e + scene.initial_elongation, tensions)
    worst = [balance / force, *(-push / force), *(-opening / length), *np.minimum(push / force, opening / length)]
    for first in np.flatnonzero(scene.law == Law.FRICTION):
        parts = slice(first + 1, first + scene.dim)
        rub, slip = tensions[parts] / force, e[parts] / length
        most = scene.friction[first] * abs(tensions[first]) / force
        worst.append(np.linalg.norm(rub) - most)
        moved = np.linalg.norm(slip)
        if moved > 0.0:  # where it slips friction is at its bound, and opposes the slip
            worst.append(min(moved, np.linalg.norm(rub - most * slip / moved)))
    return float(max(worst))


def _normal(scene, x, tensions):
    """Return what rigid links bear, and how far they are open; neither is negative."""
    rigid = np.isin(scene.law, (Law.INEXTENSIBLE, Law.CONTACT, Law.FRICTION))
    sign = np.where(scene.law == Law.INEXTENSIBLE, 1.0, -1.0)[rigid]
    return sign * tensions[rigid], -sign * x[rigid]


def shortening(scene, u, tensions):
    """Return the error of the elongations of the links that bear: all that is unique where others lie about.

    Parameters and result are those of `missed`; nothing that bears is an error.
    """
    from .exact import solve_exactly

    exact = solve_exactly(scene, u)
    if not exact.exists:
        return np.inf
    e, known = elongations(scene, u), elongations(scene, exact.displacements)
    bears = np.abs(exact.tensions) > 1e-30 * np.abs(scene.load).max()
    return float(np.linalg.norm((e - known)[bears]) / np.linalg.norm(known[bears]))


def closing(scene, u, tensions):
    """Return the error of the gaps that contacts close, elastic ones that loads hardly shorten: those of rigid ones."""
    from .rigid import simplex

    known = simplex(replace(scene, law=np.full(len(scene.law), Law.CONTACT)))
    bears = known < -1e-6 * np.abs(known).max()
    return float(
        np.linalg.norm((elongations(scene, u) + scene.initial_elongation)[bears])
        / np.linalg.norm(scene.initial_elongation[bears])
    )
