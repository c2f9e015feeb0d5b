"""Equilibria of structures with friction in 200 digits: whether there is one, and one.

There is none if no forces in the cones of the laws (bars any sign, cables traction, contacts Coulomb's cone) balance
the loads, or if no displacements meet the gaps. Both are convex problems of other structures: one has compression-only
links along the edges of the cones, the other contacts and bars. In 3D 16 edges make a cone around Coulomb's.

One is found by Newton's method for Coulomb's law. It starts from equilibria where the friction has given bounds
(Tresca's law, which is convex): none at first, then those that the last normal forces allow, then random ones. What is
neither excluded nor found is unknown.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from latinpc.laws import Law

from .exact import BITS, _Search, solve_exactly

EDGES = 16  # of the cone around Coulomb's, in 3D
SEGMENTS = 4  # directions of the bounds in 3D, where they make an octagon
STARTS, ROUNDS = 4, 10  # bounds to start from, and bounds that follow from normal forces
LARGE = 1e3  # times all forces that the structure has: a bound that no friction reaches
SLIPS = 1e-9  # of the friction that a contact bears at most: it slips, as far as doubles show
STEPS = 25  # of Newton's method for Coulomb's law
MOVED = 0.1  # of the displacements: units in the last place of the data move an equilibrium of rounding by more


@dataclass(frozen=True)
class Rubbing:
    """What is known of the equilibrium of a structure with friction."""

    exists: str  #: "yes", "no", "unknown"; "rounding": the given numbers have one, those next to them another or none
    displacements: np.ndarray | None = None  #: (n, dim), m: of one
    tensions: np.ndarray | None = None  #: (m,), N


def solve_rubbing(scene):
    """Find out whether a small structure with friction has an equilibrium.

    Parameters
    ----------
    scene : Scene
        Of bars, cables, compression-only links and contacts with friction.

    Returns
    -------
    Rubbing
    """
    if impossible(scene):
        return Rubbing("no")
    found = _within(lambda: _Coulomb(scene).search())
    if found is None:
        return Rubbing("unknown")
    moved = near(_rounded(scene), found.displacements, found.tensions)
    size = max(np.linalg.norm(found.displacements), np.finfo(float).eps * np.ptp(scene.nodes))
    if moved is None or np.linalg.norm(moved.displacements - found.displacements) > MOVED * size:
        return Rubbing("rounding")
    return found


def impossible(scene):
    """Return whether no forces in the cones of the laws balance the loads, or no displacements meet the gaps."""
    return not (solve_exactly(_cones(scene)).exists and solve_exactly(_gaps(scene)).exists)


def near(scene, u, tensions):
    """Return the equilibrium next to displacements and tensions, or None; displacements without stiffness stay."""
    return _within(lambda: _Coulomb(scene).newton_from(u, tensions))


def _within(work):
    from flint import ctx

    before, ctx.prec = ctx.prec, BITS
    try:
        return work()
    finally:
        ctx.prec = before


def _cones(scene):
    """Replace contacts by links along the edges of their cones; an equilibrium shows forces that balance the loads."""
    contacts, kept = np.flatnonzero(scene.law == Law.FRICTION), ~np.isin(scene.law, (Law.FRICTION, Law.TANGENT))
    angle = 2 * np.pi * np.arange(EDGES) / EDGES
    around = np.column_stack([np.cos(angle), np.sin(angle)]) / np.cos(np.pi / EDGES)
    edges = np.array([[1.0], [-1.0]]) if scene.dim == 2 else around
    links, directions = [scene.links[kept]], [scene.direction[kept]]
    for first in contacts:
        links.append(np.repeat(scene.links[first : first + 1], len(edges), axis=0))
        tangents = scene.direction[first + 1 : first + scene.dim]
        directions.append(scene.direction[first] + scene.friction[first] * edges @ tangents)
    count = len(edges) * len(contacts)
    stiffness = np.append(scene.stiffness[kept], np.full(count, np.median(scene.stiffness[kept])))
    return replace(scene, links=np.vstack(links), direction=np.vstack(directions), stiffness=stiffness,
                   law=np.append(scene.law[kept], np.full(count, Law.COMPRESSION_ONLY)), friction=None, subdomain=None,
                   initial_elongation=np.zeros(len(stiffness)), prescribed=np.zeros(scene.nodes.shape))  # fmt: skip


def _gaps(scene):
    """Replace contacts by ones without friction and all else by bars, without loads."""
    kept = scene.law != Law.TANGENT
    contact = scene.law[kept] == Law.FRICTION
    return replace(scene, links=scene.links[kept], direction=scene.direction[kept], stiffness=scene.stiffness[kept],
                   law=np.where(contact, Law.CONTACT, Law.BAR), friction=None, subdomain=None, load=0 * scene.load,
                   initial_elongation=np.where(contact, scene.initial_elongation[kept], 0.0))  # fmt: skip


def _rounded(scene):
    """Move all numbers by a unit in the last place."""
    rng, off = np.random.default_rng(0), {}
    for name in ("nodes", "stiffness", "initial_elongation", "load", "direction", "friction"):
        value = getattr(scene, name)
        off[name] = value * (1 + np.finfo(float).eps * rng.choice([-1, 1], value.shape))
    return replace(scene, **off)


class _Coulomb(_Search):
    """Contacts as rigid springs; what bounds of the friction make of them as pieces of further rows."""

    def __init__(self, scene):
        from flint import arb

        super().__init__(scene)
        self.arb, self.links = arb, len(self.rows)
        first = np.flatnonzero(scene.law == Law.FRICTION)
        self.contacts = [(int(i), [*range(i + 1, i + scene.dim)], arb(float(scene.friction[i]))) for i in first]
        self.normals = {first for first, _, _ in self.contacts}
        angles = np.pi * np.arange(SEGMENTS) / SEGMENTS
        self.directions = [(1.0,)] if scene.dim == 2 else list(zip(np.cos(angles), np.sin(angles)))
        for _, tangents, _ in self.contacts:
            for direction in self.directions:
                row = {}
                for c, i in zip(direction, tangents):
                    for j, v in self.rows[i]:
                        row[j] = row.get(j, self.zero) + arb(float(c)) * v
                self.rows.append([(j, v.mid()) for j, v in row.items()])
                self.rest.append(sum((arb(float(c)) * self.rest[i] for c, i in zip(direction, tangents)), self.zero))
                self.pieces.append(None)
        self._bound([self.zero] * len(self.contacts))

    def _pieces(self, i, arb):
        law = self.scene.law[i]
        if law == Law.FRICTION:
            return [self.zero], [(self.rigid, self.zero), (self.zero, self.zero)]
        return ([], [(self.zero, self.zero)]) if law == Law.TANGENT else super()._pieces(i, arb)

    def _bound(self, bounds):
        """Set the pieces of friction with these bounds; in 3D segments add up to a polygon like the circle."""
        each = len(self.directions)
        for contact, bound in enumerate(bounds):
            s = bound * self.arb(1.0 if each == 1 else float(np.pi / 2 / each))
            sticks = [-s / self.rigid, s / self.rigid], [(self.zero, -s), (self.rigid, self.zero), (self.zero, s)]
            first = self.links + contact * each
            self.pieces[first : first + each] = [sticks if s > 0 else ([], [(self.zero, self.zero)])] * each

    def search(self):
        """Find an equilibrium, or None."""
        rng, rest = np.random.default_rng(0), [self.zero] * len(self.load)
        force = max(map(abs, self.load), default=self.zero)
        largest = LARGE * (force + self.stiffest * max(map(abs, self.rest), default=self.zero))
        for start in range(STARTS):
            bounds = [largest if start == 0 else force * self.arb(float(10.0 ** rng.uniform(-2, 2)))
                      for _ in self.contacts]  # fmt: skip
            u = rest
            for turn in range(ROUNDS):
                self._bound(bounds)
                try:
                    u, strains = self._equilibrium(u, rest)
                except RuntimeError:
                    break
                found = self._newton(u, rest)
                if found is not None:
                    return found
                allowed = [-mu * self._spring(first, strains) for first, _, mu in self.contacts]
                bounds = allowed if turn < 3 else [(a + b) / 2 for a, b in zip(bounds, allowed)]
                if self._on_ground(u):
                    u = rest
        return None

    def newton_from(self, u, tensions):
        """Find the equilibrium next to displacements and tensions, or None; springs to the ground are at rest there."""
        start = [self.arb(float(x)) for x in u.ravel()[self.free]]
        return self._newton(start, start, [self.arb(float(x)) for x in tensions])

    def _spring(self, i, strains):
        k, t0 = self._piece(i, strains[i])
        return k * strains[i] + t0

    def _newton(self, u, centre, given=None):
        """Whole steps of Newton's method for Coulomb's law; the first one with what contacts do that bear `given`."""
        from flint import arb_mat

        self._bound([self.zero] * len(self.contacts))
        for _ in range(STEPS):
            matrix, force, _ = self._coulomb(u, centre, given)
            given = None
            columns = arb_mat([[f.mid()] for f in force])
            try:
                found = arb_mat([[x.mid() for x in line] for line in matrix]).solve(columns, algorithm="approx")
            except ZeroDivisionError:
                return None
            step = [found[i, 0].mid() for i in range(len(u))]
            u = [(x + s).mid() for x, s in zip(u, step)]
            if not all(x.is_finite() for x in u):
                return None
            if max(map(abs, step), default=self.zero) <= self.least * max(map(abs, u), default=self.zero):
                return self._checked(u, centre)
        return None

    def _does(self, first, tangents, mu, strains, given):
        """Return whether a contact is closed, whether it sticks, and the friction that it bears at most."""
        normal = self._spring(first, strains) if given is None else given[first]
        parts = [self.rigid * strains[i] if given is None else given[i] for i in tangents]
        size = sum((a * a for a in parts), self.zero).sqrt()
        return normal < 0, size <= -mu * normal * (1 if given is None else 1 - SLIPS), -mu * normal

    def _coulomb(self, u, centre, given=None):
        """Return the matrix of Newton's method, the unbalanced forces, and the tensions."""
        strains = self._strains(u)
        tensions = [self._spring(i, strains) for i in range(self.links)]
        slopes = [(i, i, self._piece(i, strains[i])[0]) for i in range(self.links) if i not in self.normals]
        for first, tangents, mu in self.contacts:
            closed, sticks, most = self._does(first, tangents, mu, strains, given)
            k = self.rigid if closed else self.zero
            tensions[first] = k * strains[first]
            slopes.append((first, first, k))
            x = [strains[i] for i in tangents]
            size = sum((a * a for a in x), self.zero).sqrt().mid()
            if closed and sticks:
                for i in tangents:
                    tensions[i] = self.rigid * strains[i]
                    slopes.append((i, i, self.rigid))
            elif closed and size != 0:  # it slips: friction is at its bound
                w = [(a / size).mid() for a in x]
                for a, i in zip(w, tangents):
                    tensions[i] = -mu * tensions[first] * a
                    slopes.append((i, first, -mu * k * a))
                    slopes += [(i, j, most / size * ((i == j) - a * b)) for b, j in zip(w, tangents) if len(w) > 1]
        matrix = [[self.ground if i == j else self.zero for j in range(len(u))] for i in range(len(u))]
        force = [f - self.ground * (x - c) for f, x, c in zip(self.load, u, centre)]
        for row, tension in zip(self.rows, tensions):
            for a, v in row if tension != 0 else ():
                force[a] -= v * tension
        for i, j, k in slopes:
            for a, v in self.rows[i] if k != 0 else ():
                for b, w in self.rows[j]:
                    matrix[a][b] += k * v * w
        return matrix, force, tensions

    def _checked(self, u, centre):
        """Return the equilibrium if it is one: nothing on the ground, no gaps that jam."""
        _, _, tensions = self._coulomb(u, centre)
        if self._on_ground([x - c for x, c in zip(u, centre)]) or self._jammed(tensions):
            return None
        whole = np.where(self.scene.fixed, self.scene.prescribed, 0.0).ravel()
        whole[self.free] = [float(x) for x in u]
        return Rubbing("yes", whole.reshape(self.scene.fixed.shape), np.array([float(x) for x in tensions]))
