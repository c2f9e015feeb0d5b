"""Equilibria of links that turn as far as they go: numpy alone, unbalanced forces in long double.

A link bears the tension of its law at the strain |r| - l + e0 along the vector r between its nodes, l its length as
drawn. Loads and prescribed displacements grow from zero in increments that Newton's method follows; an equilibrium is
stable where the tangent stiffness is positive definite.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from latinpc.laws import Law

STEPS, STEPS_DRAWN = 25, 200  # of Newton's method in an increment, and from the structure as drawn
CLOSE = 1e-12  # of the displacements: a last step
NOTHING = 1e-13  # of the size: the same where nothing moves but by rounding
LEAST = 1e-5  # increments of the loads, relative to those borne: smaller ones show that no equilibrium follows
AHEAD = 2.0  # times a node's displacement by the tangent stiffness: the limit of a fold, a parabola; or its part
JUMP = 1e-4  # of the size: where a cable slackens or tightens an increment may be off by more, but by no more than this
BESIDE = 1e-2  # of the largest displacement of an increment: nodes that move less
GROW = 1.6  # times the increment after one that was followed
LARGEST = 0.02  # increment: with larger ones nodes click between slack cables and it does not show
BEYOND = 1e-4  # of the loads: what they grow by where the path ends, for the structure to leave its last equilibrium
STRIDE = 1e-3  # of the size: the largest move of a step to rest, so that no valley of the energy is passed by
STEPS_REST = 2000  # to rest
FIRST = 0.0, 1.0, 0.1, 0.01  # of the loads: a path starts at rest under the first part that holds the structure
ENDS = 20  # of paths, one after the other


@dataclass(frozen=True)
class Path:
    """Where growing loads lead."""

    factor: float  #: part of the loads at the end, on a path of stable equilibria
    displacements: np.ndarray  #: (n, dim), there (m)
    follows: bool  #: whether the path goes on from there
    first: float = 0.0  #: part of the loads where it starts: none, unless they alone hold the structure


class Corotational:
    """The equations of a structure.

    Parameters
    ----------
    scene : Scene
        Of bars, cables and compression-only links; its loads and prescribed displacements.
    """

    def __init__(self, scene):
        self.scene, self.free = scene, np.flatnonzero(~scene.fixed.ravel())
        self.first, self.second = scene.links.T
        nodes = scene.nodes.astype(np.longdouble)
        self.span = nodes[self.second] - nodes[self.first]
        self.length = np.sqrt((self.span**2).sum(axis=1))
        self.stiffness = scene.stiffness.astype(np.longdouble)
        self.elongation = scene.initial_elongation.astype(np.longdouble)
        self.load = scene.load.astype(np.longdouble)
        self.prescribed = np.where(scene.fixed, scene.prescribed, 0.0).astype(np.longdouble)
        self.size = float(np.linalg.norm(np.ptp(scene.nodes, axis=0)))

    def state(self, u):
        """Return unit vectors, lengths, tensions and slopes of the laws of all links."""
        relative = u[self.second] - u[self.first]
        r = self.span + relative
        size = np.sqrt((r**2).sum(axis=1))
        strain = ((2 * self.span + relative) * relative).sum(axis=1) / (size + self.length) + self.elongation
        tension, slope = self.stiffness * strain, self.stiffness.copy()
        slack = (self.scene.law == Law.CABLE) & (strain <= 0)
        slack |= (self.scene.law == Law.COMPRESSION_ONLY) & (strain >= 0)
        tension[slack] = slope[slack] = 0
        return r / size[:, None], size, tension, slope

    def unbalance(self, u, factor=1.0):
        """Return the unbalanced forces at the free degrees of freedom (N), in long double."""
        n, _, tension, _ = self.state(u)
        left = factor * self.load
        np.add.at(left, self.first, tension[:, None] * n)
        np.add.at(left, self.second, -tension[:, None] * n)
        return left.ravel()[self.free]

    def tangent(self, u):
        """Return the tangent stiffness of the free degrees of freedom, dense, in double precision."""
        return self._whole(u)[np.ix_(self.free, self.free)]

    def _whole(self, u):
        """Return the tangent stiffness of all degrees of freedom."""
        n, size, tension, slope = (part.astype(float) for part in self.state(u))
        dim = n.shape[1]
        across = tension / size
        block = (slope - across)[:, None, None] * n[:, :, None] * n[:, None] + across[:, None, None] * np.eye(dim)
        matrix = np.zeros((len(u), dim, len(u), dim))
        rows, ends = np.arange(dim), (self.first, self.second)
        for i, a in enumerate(ends):
            for j, b in enumerate(ends):
                place = a[:, None, None], rows[:, None], b[:, None, None], rows[None]
                np.add.at(matrix, place, block if i == j else -block)
        matrix = matrix.reshape(u.size, u.size)
        # nodes between slack links stay where they are, if they bear no load
        loose = ~matrix.any(axis=1) & np.repeat(~self.load.any(axis=1), dim)
        matrix[loose, loose] = np.abs(matrix).max() or 1.0
        return matrix

    def stable(self, u, least=1e-13):
        """Return whether the eigenvalues of the tangent stiffness are above this part of the largest: rounding."""
        values = np.linalg.eigvalsh(self.tangent(u))
        return bool(len(values) == 0 or values[0] > least * values[-1])

    def newton(self, u, factor=1.0, steps=STEPS):
        """Solve from u, its supports where this part of the path has them; return the displacements, or None."""
        u = self._held(u, factor)
        for _ in range(steps):
            left = self.unbalance(u, factor)
            try:
                step = np.linalg.solve(self.tangent(u), left.astype(float))
            except np.linalg.LinAlgError:
                return None
            u, length = self._searched(u, step, left, factor)
            if not np.isfinite(u.astype(float)).all() or np.abs(u).max() > 10 * self.size:
                return None
            if length == 1.0 and np.abs(step).max(initial=0.0) <= max(CLOSE * np.abs(u).max(), NOTHING * self.size):
                return u
        return None

    def _held(self, u, factor):
        """Return u with its supports where this part of the path has them."""
        return np.where(self.scene.fixed, factor * self.prescribed, u)

    def _searched(self, u, step, left, factor):
        """Return u after the step, or after a half, a quarter and so on of it where its forces oppose the whole."""
        length, slope = 1.0, left @ step
        while True:
            moved = u.copy()
            moved.ravel()[self.free] += length * step.astype(np.longdouble)
            if slope <= 0 or length < 1e-3 or self.unbalance(moved, factor) @ step > -0.5 * slope:
                return moved, length
            length *= 0.5

    def _continues(self, u, factor, moved, part):
        """Return whether the stable equilibrium `moved` follows u, for a growing part of the loads."""
        ahead, far = (part - factor) * self.prescribed.astype(float), np.linalg.norm((moved - u).astype(float), axis=1)
        stiffness = self._whole(u)[self.free]
        load = ((part - factor) * self.load).ravel()[self.free].astype(float) - stiffness @ ahead.ravel()
        ahead.ravel()[self.free] = np.linalg.solve(stiffness[:, self.free], load)
        ahead = np.linalg.norm(ahead, axis=1)
        jump = JUMP * self.size
        within = (far <= AHEAD * ahead + jump).all() and (ahead <= AHEAD * far + max(jump, BESIDE * far.max())).all()
        return bool(within) and self.stable(moved)

    def start(self):
        """Return the displacements as drawn: none."""
        return np.zeros(self.scene.nodes.shape, np.longdouble)

    def _first(self):
        """Return a stable equilibrium and the part of the loads that it bears, none if possible; or (None, 0)."""
        u = self.newton(self.start(), 0.0, STEPS_DRAWN)
        if u is not None and self.stable(u):
            return u, 0.0
        for factor in FIRST:
            u = self.rest(self.start(), factor)
            if u is not None and self.stable(u):
                return u, factor
        return None, 0.0

    def follow(self, until=None, last=1.0, first=None, largest=LARGEST):
        """Follow the equilibria under loads and prescribed displacements that grow together.

        Parameters
        ----------
        until : callable, optional
            Of displacements and tensions: whether the path is to end before them.
        last : float
            Part of the loads to end at.
        first : (displacements, float), optional
            A stable equilibrium to start from, and the part of the loads that it bears; else that without loads.
        largest : float
            Increment, relative to the last loads.

        Returns
        -------
        Path
            `factor` and `displacements` of the last equilibrium that was followed, stable and not beyond `until`.
        """
        u, factor = first or self._first()
        if u is None:
            return Path(0.0, self.start().astype(float), False)
        start, increment, follows = factor, largest * last, True
        while factor < last:
            part = min(last, factor + increment)
            moved = self.newton(u, part)
            good = moved is not None and self._continues(u, factor, moved, part)
            beyond = good and until is not None and until(moved.astype(float), self.state(moved)[2].astype(float))
            if good and not beyond:
                u, factor = moved, part
                increment = min(GROW * increment, largest * last)
            elif increment <= LEAST * max(part, 1e-12):
                follows = bool(good)
                break
            else:
                increment *= 0.5
        return Path(float(factor), u.astype(float), follows, start)

    def energy(self, u, factor):
        """Return the strain energy less the work of the loads (J), in long double."""
        _, _, tension, _ = self.state(u)
        return 0.5 * (tension**2 / self.stiffness).sum() - factor * (self.load * u).sum()

    def rest(self, u, factor):
        """Return the stable equilibrium where the structure comes to rest from u, or None; its energy falls."""
        u = self._held(u.astype(np.longdouble), factor)
        for _ in range(STEPS_REST):
            left = self.unbalance(u, factor)
            values, modes = np.linalg.eigh(self.tangent(u))
            across = np.maximum(np.abs(values), 1e-12 * float(self.stiffness.max()))
            step = modes @ ((modes.T @ left.astype(float)) / across)
            moved = np.abs(step).max(initial=0.0)
            if moved <= 1e-9 * self.size:  # a mechanism without loads is nowhere at rest
                return self.newton(u, factor) if values[0] > 0 else None
            length, before = min(1.0, STRIDE * self.size / moved), self.energy(u, factor)
            trial = u.copy()
            while True:
                trial.ravel()[self.free] = u.ravel()[self.free] + length * step
                if self.energy(trial, factor) < before or length < 1e-12:
                    break
                length *= 0.5
            u = trial
        return None

    def beyond(self, path):
        """Go on from the end of a path: where the structure comes to rest, and along the paths from there.

        Parameters
        ----------
        path : Path
            That ends before the loads.

        Returns
        -------
        displacements : (n, dim) array or None
            Under all loads; None where it does not come to rest.
        moved : float
            How far a node has moved at most from the end of a path to where it has come to rest, over the size.
        """
        moved = 0.0
        for _ in range(ENDS):
            factor = min(1.0, path.factor + BEYOND)
            u = self.rest(path.displacements, factor)
            if u is None:
                return None, np.inf
            far = np.linalg.norm(u.astype(float) - path.displacements, axis=1).max() / self.size
            moved, path = max(moved, float(far)), self.follow(first=(u, factor))
            if path.factor >= 1.0:
                return path.displacements, moved
        return None, np.inf
