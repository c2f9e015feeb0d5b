"""Elongations, tensions, reactions, balance and errors from the arrays of a structure: numpy only, no solver.

What is called a scene here is anything with those arrays: a `Scene` or a `Structure`.
"""

from __future__ import annotations

from typing import NamedTuple

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


def gaps(scene, displacement, initial_elongation):
    """Return the gaps e + e0 that contacts have left (m), NaN of other links; None where there are no contacts."""
    contact = np.isin(scene.law, (Law.CONTACT, Law.FRICTION))
    return np.where(contact, elongations(scene, displacement) + initial_elongation, np.nan) if contact.any() else None


def stretches(scene, displacement, geometry=None):
    """Return ``|r| - l`` of links where displacements are large, else e = B U (m); parameters of `elongations`.

    The geometry is that of the scene when not given.
    """
    large = (geometry or scene.geometry) == "large"
    return (changes_of_length if large else elongations)(scene, displacement)


def changes_of_length(scene, displacement):
    """Return ``|r| - l`` of links (m), or e of links that keep their direction; parameters of `elongations`."""
    drawn, moved = (np.diff(places[scene.links], axis=1)[:, 0] for places in (scene.nodes, displacement))
    sizes = np.linalg.norm(drawn, axis=1) + np.linalg.norm(drawn + moved, axis=1)
    grown = np.einsum("ij,ij->i", 2.0 * drawn + moved, moved)  # |r|^2 - l^2 without cancellation
    return np.where(keeps_direction(scene), elongations(scene, displacement), grown / np.where(sizes > 0.0, sizes, 1.0))


def tensions(scene, displacement):
    """Return the tensions of links that are not rigid, equations (2), (4), (5).

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
    return tensions_at(scene, elongations(scene, displacement))


def tensions_at(scene, elongation):
    """Return the tensions (N) of links that are not rigid at elongations (m)."""
    strain = elongation + scene.initial_elongation
    tau = scene.stiffness * strain
    tau = np.where(scene.law == Law.CABLE, np.maximum(tau, 0.0), tau)
    tau = np.where(scene.law == Law.COMPRESSION_ONLY, np.minimum(tau, 0.0), tau)
    own = scene.law >= len(Law)
    if own.any():
        from latinpc.userlaws import own_tensions, registered

        tau[own] = own_tensions(registered(scene)[own], scene.stiffness[own], strain[own])
    return tau


def slack(scene, tensions, largest=None):
    """Find the slack links: cables, compression-only links and contacts without force.

    Parameters
    ----------
    scene : Scene
    tensions : (..., m) array
        In N. What is below rounding of the largest one counts as zero.
    largest : float, optional
        That one (N), where the links are a part of a structure.

    Returns
    -------
    (..., m) array of bool
    """
    pulls = np.isin(scene.law, (Law.CABLE, Law.INEXTENSIBLE))
    pushes = np.isin(scene.law, (Law.COMPRESSION_ONLY, Law.CONTACT, Law.FRICTION))
    sign = pulls.astype(float) - pushes
    found = np.empty(tensions.shape, bool)
    for number in np.ndindex(tensions.shape[:-1]):  # a row at a time stays in cache
        row = tensions[number]
        most = max(row.max(initial=0.0), -row.min(initial=0.0)) if largest is None else largest
        np.less_equal(sign * row, 1e-12 * most, out=found[number])
    return found & (pulls | pushes)


def reactions(scene, tensions, load=None):
    """Return the forces of the supports on the structure, R = B^t tau - F at the fixed components, equation (1).

    Parameters
    ----------
    scene : Scene
    tensions : (m,) array
        In N.
    load : (n, dim) array, optional
        F (N), that of the scene when not given. A load on a fixed component goes straight into the support.

    Returns
    -------
    (n, dim) array
        In N, zero where nothing is fixed.
    """
    return np.where(scene.fixed, _left(scene, tensions, load), 0.0)


def largest_unbalance(scene, tensions, load=None):
    """Return the largest unbalanced force on a node, |B^t tau - F| at the free components, equation (1), in N."""
    return float(np.linalg.norm(unbalanced(scene, tensions, load), axis=1).max(initial=0.0))


def unbalanced(scene, tensions, load=None):
    """Return the unbalanced forces B^t tau - F on the nodes, (n, dim) in N, zero where they are fixed, equation (1)."""
    return np.where(scene.fixed, 0.0, _left(scene, tensions, load))


def stresses(scene, tensions):
    """Return tension over area (Pa) of tensions (..., m), NaN without one; None where there are no areas."""
    return None if scene.area is None else tensions / scene.area


def utilisations(scene, tensions):
    """Return the size of the stress over the strength, as `stresses`; None where there are no strengths."""
    stress = stresses(scene, tensions)
    return None if stress is None or scene.strength is None else np.abs(stress) / scene.strength


def _left(scene, tensions, load):
    """Return B^t tau - F, (n, dim)."""
    pull, ends = _pull(scene, tensions), scene.links.T
    forces = np.empty(scene.nodes.shape)
    for axis in range(scene.dim):
        first, second = (np.bincount(end, weights=pull[:, axis], minlength=len(forces)) for end in ends)
        forces[:, axis] = second - first
    return forces - (scene.load if load is None else load)


OWN = 1e-8  # a direction that differs so much from that of the nodes is one of its own: LATIN_TURNING_OWN
ROUNDING = 1e-10  # of the largest stiffness times the largest elongation given, and of tensions: forces that are none


def keeps_direction(scene):
    """Return which links keep their direction where displacements are large, (m,) of bool.

    Those are contacts, which keep their normal, and links of a direction other than that of their nodes, as
    `LatinStructureSetGeometry()` has it.
    """
    keeps = np.asarray(scene.law) == Law.CONTACT
    if scene.direction is None:
        return keeps
    lines = np.diff(scene.nodes[scene.links], axis=1)[:, 0]
    apart = np.abs(_units(lines) - scene.directions).max(axis=1)
    return keeps | (scene.direction.any(axis=1) & (apart > OWN))


def _units(vectors):
    """Return unit vectors, zero of vectors without length."""
    lengths = np.linalg.norm(vectors, axis=1)[:, None]
    return vectors / np.where(lengths > 0.0, lengths, 1.0)


class Turned:
    """A structure with its nodes displaced and its links turned, for `reactions` and `balance`.

    Parameters
    ----------
    structure : Scene or Structure
        Whose links have the direction of their nodes, but for those of `keeps_direction`.
    displacements : (n, dim) array
        In m.
    """

    def __init__(self, structure, displacements):
        self.over_ranks = structure.over_ranks
        self.nodes, self.links = structure.nodes + displacements, structure.links
        self.fixed, self.load, self.dim = structure.fixed, structure.load, self.nodes.shape[1]
        self.prescribed = structure.prescribed
        self.stiffness, self.initial_elongation = structure.stiffness, structure.initial_elongation
        self.directions, self.direction = _units(np.diff(self.nodes[self.links], axis=1)[:, 0]), None
        keeps = keeps_direction(structure)
        if keeps.any():  # their forces are across the displaced line, and make couples
            self.directions[keeps] = structure.directions[keeps]
            self.direction = np.where(keeps[:, None], self.directions, 0.0)


class Leaning:
    """A structure whose links lean by small angles against their tensions as drawn, for `reactions` and `balance`.

    Parameters
    ----------
    structure : Scene or Structure
        Without rigid links.
    displacements : (n, dim) array
        In m.
    """

    def __init__(self, structure, displacements):
        self.over_ranks = structure.over_ranks
        self.nodes, self.links = structure.nodes, structure.links
        self.fixed, self.load, self.dim = structure.fixed, structure.load, structure.dim
        self.prescribed = structure.prescribed
        self.stiffness, self.initial_elongation = structure.stiffness, structure.initial_elongation
        self.directions = self.direction = structure.directions  # a force across a link makes a couple
        relative = np.diff(displacements[self.links], axis=1)[:, 0]
        across = relative - np.einsum("ij,ij->i", relative, self.directions)[:, None] * self.directions
        drawn = tensions(structure, np.zeros(structure.nodes.shape))
        self.across = (drawn / structure.lengths)[:, None] * across


def shape(scene, displacements, geometry):
    """Return what forces balance on: a scene or structure as drawn, or where links turn as displaced."""
    if geometry == "linear":
        return scene
    return (Turned if geometry == "large" else Leaning)(scene, displacements)


def _pull(scene, tensions):
    """Return the forces (m, dim) of the links on their first nodes."""
    return tensions[:, None] * scene.directions + getattr(scene, "across", 0.0)


class Balance(NamedTuple):
    """Loads and reactions as a whole: an equilibrium leaves neither force nor moment."""

    load: np.ndarray  #: (dim,), their sum (N)
    reaction: np.ndarray  #: (dim,), their sum (N)
    force: float  #: sum of both, over the sum of the sizes of the loads, or where there are none of the reactions
    moment: float  #: sum of their moments, over the same times the size of the structure


def balance(scene, tensions, reactions, load=None):
    """Compare the reactions with the loads; of parts of a structure collective.

    Parameters
    ----------
    scene : Scene
    tensions : (m,) array
        In N. A link that acts along a direction of its own, across the line between its nodes, makes a couple, which
        counts among the moments.
    reactions : (n, dim) array
        In N.
    load : (n, dim) array, optional
        In N, that of the scene when not given.

    Returns
    -------
    Balance
        In one dimension there are no moments.
    """
    load, over = scene.load if load is None else load, scene.over_ranks
    nodes = scene.nodes[: over.own]
    forces, arms = (np.zeros((len(load), 3)) for _ in range(2))
    forces[:, : scene.dim] = load + reactions
    arms[:, : scene.dim] = scene.nodes - over.total(nodes.sum(axis=0)) / over.total(len(nodes))
    moment = np.cross(arms, forces).sum(axis=0)
    if scene.direction is not None:
        own = np.flatnonzero(scene.direction.any(axis=1))
        lines, pull = (np.zeros((len(own), 3)) for _ in range(2))
        lines[:, : scene.dim] = np.diff(scene.nodes[scene.links[own]], axis=1)[:, 0]
        pull[:, : scene.dim] = _pull(scene, tensions)[own]
        moment -= np.cross(lines, pull).sum(axis=0)
    whole = over.total(np.linalg.norm(load, axis=1).sum()) or over.total(np.linalg.norm(reactions, axis=1).sum())
    sizes = (scene.stiffness, scene.initial_elongation, scene.prescribed, tensions)
    sizes = over.largest(np.array([np.abs(values).max(initial=0.0) for values in sizes]))
    rounding = ROUNDING * max(sizes[0] * (sizes[1] + sizes[2]), sizes[3])
    whole = max(whole, rounding) or 1.0  # forces of slack links are rounding, and balance as such
    size = over.largest(np.linalg.norm(arms, axis=1).max(initial=0.0)) or 1.0
    force, moment = (float(np.linalg.norm(over.total(left)) / whole) for left in (forces.sum(axis=0), moment / size))
    return Balance(over.total(load.sum(axis=0)), over.total(reactions.sum(axis=0)), force, moment)


def relative(values, reference):
    """Return the l2 norm of what differs over that of the reference; infinite when a value is not finite."""
    size, difference = np.linalg.norm(reference), np.linalg.norm(values - reference)
    if not np.isfinite(difference):
        return np.inf
    return float(difference / size if size > 0 else difference)


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
