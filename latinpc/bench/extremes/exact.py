"""Equilibria without rounding: Newton's method with an exact line search in 200 digits, on the given doubles.

Energies are convex and piecewise quadratic, so that the search ends at the solution from any start. Two small
numbers, far beyond what doubles resolve, decide what a double cannot: springs to the ground that are 1e-60 times as
stiff as the stiffest link, and rigid links that are 1e40 times as stiff. The ground bears load where there is no
equilibrium; rigid links let through where their gaps jam; displacements that follow the ground are not unique.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from latinpc.laws import Law

BITS = 680  # 200 digits: 60 of the ground, 40 of rigid links, 40 of contrasts in long chains, and what is left
GROUND, RIGID = (
    60,
    40,
)  # digits by which springs to the ground are softer, and rigid links stiffer, than the stiffest link
NOTHING = (
    20  # digits: less than so much of the loads on the ground, or of the gaps in rigid links, is what springs leave
)
STEPS = 5000


@dataclass(frozen=True)
class Exact:
    """An equilibrium, rounded once.

    Without one (`exists` is False) there is only `missing`. Displacements that are not unique are the least ones.
    """

    exists: bool
    displacements: np.ndarray | None = None  #: (n, dim), m
    tensions: np.ndarray | None = None  #: (m,), N; where those of rigid links are not unique, some that balance
    unique: bool = True  #: the displacements
    missing: float = 0.0  #: the largest force that nothing bears but springs to the ground, N; infinite where gaps jam


def solve_exactly(scene, guess=None, unique=False):
    """Solve a small structure exactly.

    Parameters
    ----------
    scene : Scene
        Of up to some hundred unknowns: the matrix is dense. Of any laws but friction.
    guess : (n, dim) array, optional
        Displacements to start from (m): a matter of time, not of the result.
    unique : bool
        Whether to find out if the displacements are unique: another solve.

    Returns
    -------
    Exact

    Raises
    ------
    RuntimeError
        The search has not ended.
    """
    from flint import ctx

    before, ctx.prec = ctx.prec, BITS
    try:
        return _Search(scene).solve(guess, unique)
    finally:
        ctx.prec = before


class _Search:
    """Laws as pieces tau = k x + t0 between breaks; all numbers are `flint.arb` without radius."""

    def __init__(self, scene):
        from flint import arb

        self.scene, self.zero = scene, arb(0)
        self.free = np.flatnonzero(~scene.fixed.ravel())
        row = np.full(scene.fixed.size, -1)
        row[self.free] = np.arange(len(self.free))
        self.load = [arb(float(x)) for x in scene.load.ravel()[self.free]]
        self.stiffest = stiffest = arb(float(np.abs(scene.stiffness).max(initial=0.0) or 1.0))
        self.ground, self.rigid = stiffest * arb(10) ** -GROUND, stiffest * arb(10) ** RIGID
        self.nothing, self.least = arb(10) ** -NOTHING, arb(10) ** -(GROUND + RIGID)
        given = [arb(float(x)) for x in np.where(scene.fixed, scene.prescribed, 0.0).ravel()]
        self.rows, self.rest = [], []
        for (a, b), v, e0 in zip(scene.links, self._vectors(arb), scene.initial_elongation):
            length = sum((x * x for x in v), self.zero).sqrt()
            entries = [*range(scene.dim * a, scene.dim * (a + 1)), *range(scene.dim * b, scene.dim * (b + 1))]
            normal = [(x / length).mid() for x in v]
            both = list(zip(entries, [-x for x in normal] + normal))
            self.rest.append(sum((x * given[i] for i, x in both if row[i] < 0), arb(float(e0))).mid())
            self.rows.append([(int(row[i]), x) for i, x in both if row[i] >= 0])
        self.pieces = [self._pieces(i, arb) for i in range(len(self.rows))]

    def _vectors(self, arb):
        nodes = [[arb(float(x)) for x in point] for point in self.scene.nodes]
        given = np.zeros(self.scene.vectors.shape) if self.scene.direction is None else self.scene.direction
        return [
            [arb(float(x)) for x in d] if d.any() else [y - x for x, y in zip(nodes[a], nodes[b])]
            for (a, b), d in zip(self.scene.links, given)
        ]

    def _pieces(self, i, arb):
        """Return the strains between the pieces, and slope and tension at no strain of each."""
        law, taut, slack = self.scene.law[i], (arb(float(self.scene.stiffness[i])), self.zero), (self.zero, self.zero)
        if law == Law.BAR:
            return [], [taut]
        if law in (Law.INEXTENSIBLE, Law.CONTACT):
            taut = (self.rigid, self.zero)
        if law in (Law.CABLE, Law.INEXTENSIBLE):
            return [self.zero], [slack, taut]
        if law in (Law.COMPRESSION_ONLY, Law.CONTACT):
            return [self.zero], [taut, slack]
        x, t = ([arb(float(value)) for value in part] for part in self.scene.tables[law - len(Law)])
        slopes = [((d - c) / (b - a)).mid() for a, b, c, d in zip(x, x[1:], t, t[1:])]
        return x[1:-1], [(s, (c - s * a).mid()) for s, a, c in zip(slopes, x, t)]

    def _strains(self, u):
        return [sum((v * u[j] for j, v in row), rest).mid() for row, rest in zip(self.rows, self.rest)]

    def _piece(self, i, x):
        breaks, pieces = self.pieces[i]
        return pieces[sum(1 for at in breaks if x > at)]

    def _step(self, u, strains, centre):
        """Newton's step from u."""
        from flint import arb_mat

        n = len(u)
        matrix = [[self.zero] * n for _ in range(n)]
        force = [f - self.ground * (x - c) for f, x, c in zip(self.load, u, centre)]
        for i in range(n):
            matrix[i][i] = self.ground
        for i, (row, x) in enumerate(zip(self.rows, strains)):
            k, t0 = self._piece(i, x)
            tension = k * x + t0
            for a, v in row:
                if tension != 0:
                    force[a] -= v * tension
                if k != 0:
                    for b, w in row:
                        matrix[a][b] += k * v * w
        force = [f.mid() for f in force]
        found = arb_mat([[x.mid() for x in line] for line in matrix]).solve(
            arb_mat([[f] for f in force]), algorithm="approx"
        )
        return [found[i, 0].mid() for i in range(n)]

    def _length(self, u, strains, step, centre):
        """Return the length of the step at which the energy is least; its slope is piecewise linear, and grows."""
        moved = [sum((v * step[j] for j, v in row), self.zero).mid() for row in self.rows]
        slope = sum(((self.ground * (x - c) - f) * s for f, x, c, s in zip(self.load, u, centre, step)), self.zero)
        curve = sum((self.ground * s * s for s in step), self.zero)
        events = []
        for i, (x, d) in enumerate(zip(strains, moved)):
            if d == 0:
                continue
            breaks, pieces = self.pieces[i]
            at = sum(1 for value in breaks if x > value or (x == value and d > 0))
            slope += (pieces[at][0] * x + pieces[at][1]) * d
            curve += pieces[at][0] * d * d
            ahead = range(at, len(breaks)) if d > 0 else range(at - 1, -1, -1)
            for p in ahead:
                before, after = (pieces[p], pieces[p + 1]) if d > 0 else (pieces[p + 1], pieces[p])
                events.append((((breaks[p] - x) / d).mid(), ((after[0] - before[0]) * d * d).mid()))
        events.sort(key=lambda event: event[0])
        slope, curve, here = slope.mid(), curve.mid(), self.zero
        for at, change in events:
            if slope + curve * (at - here) >= 0:
                break
            slope, curve, here = (slope + curve * (at - here)).mid(), (curve + change).mid(), at
        return (here - slope / curve).mid() if curve > 0 else here

    def _equilibrium(self, u, centre):
        """Newton's method from u; the ground's springs are at rest at `centre`."""
        from flint import arb

        for _ in range(STEPS):
            strains = self._strains(u)
            pieces = [self._piece(i, x) for i, x in enumerate(strains)]
            step = self._step(u, strains, centre)
            whole = [(x + s).mid() for x, s in zip(u, step)]
            after = self._strains(whole)
            size = max([*map(abs, u), *map(abs, self.rest)], default=self.zero)
            if all(self._piece(i, x) is piece for (i, x), piece in zip(enumerate(after), pieces)):
                return whole, after
            length = self._length(u, strains, step, centre)  # without end where a rigid link that just bears lets go
            if max((abs(s) for s in step), default=self.zero) * max(length, arb(1)) <= self.least * size:
                return whole, after
            u = [(x + length * s).mid() for x, s in zip(u, step)]
        raise RuntimeError(f"no equilibrium of {self.scene.name} in {STEPS} steps in {BITS} bits")

    def solve(self, guess, unique):
        """Find the equilibrium, and whether it is one."""
        from flint import arb

        u = [arb(float(x)) for x in (np.zeros(self.scene.fixed.shape) if guess is None else guess).ravel()[self.free]]
        u, strains = self._equilibrium(u, [self.zero] * len(u))
        tensions = [k * x + t0 for i, x in enumerate(strains) for k, t0 in [self._piece(i, x)]]
        if self._jammed(tensions):
            return Exact(False, missing=np.inf)
        if self._on_ground(u):
            return Exact(False, missing=float(max(abs(self.ground * x) for x in u)))
        whole = np.where(self.scene.fixed, self.scene.prescribed, 0.0).ravel()
        whole[self.free] = [float(x) for x in u]
        alone = self._alone(u) if unique and u else True
        return Exact(True, whole.reshape(self.scene.fixed.shape), np.array([float(x) for x in tensions]), alone)

    def _on_ground(self, u):
        """Return whether springs to the ground bear what nothing else does."""
        load = max(map(abs, self.load), default=self.zero)
        return any(abs(self.ground * x) > self.nothing * load for x in u) and load > 0

    def _jammed(self, tensions):
        """Return whether rigid links bear more than all forces that the structure has."""
        force = max(map(abs, self.load), default=self.zero) + self.stiffest * max(
            map(abs, self.rest), default=self.zero
        )
        return any(abs(tau) * self.nothing > force for tau in tensions)

    def _alone(self, u):
        """Return whether springs to the ground that pull to opposite sides leave displacements where they are."""
        from flint import arb

        size = max([*map(abs, u), *map(abs, self.rest)])
        away = [size * arb(int(k)) / 97 for k in np.random.default_rng(0).integers(1, 97, len(u))]
        for centre in ([x + y for x, y in zip(u, away)], [x - y for x, y in zip(u, away)]):
            moved, _ = self._equilibrium(u, centre)
            if any(abs(x - y) > size * self.nothing for x, y in zip(u, moved)):
                return False
        return True
