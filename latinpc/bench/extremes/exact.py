"""Displacements without rounding: ball arithmetic on the given doubles."""

from __future__ import annotations

import numpy as np

from latinpc.laws import Law

BITS = 400  # of the balls: 120 digits, 90 of which a contrast of 1e14 in a long chain may take
STEPS = 30  # active sets that are tried
APART = 60  # digits from which on a rigid link is beyond its gap
GROUND = 60  # digits by which springs to the ground are softer than the stiffest link


def solve_exactly(scene, guess=None, tensions=None, ground=False):
    """Solve a small structure exactly, by an active set method in ball arithmetic.

    Parameters
    ----------
    scene : Scene
        Of some hundred unknowns: the matrix is dense. Of any laws but friction.
    guess : (n, dim) array, optional
        Displacements for the first choice of the pieces of the laws, for instance which links carry tension.
    tensions : (m,) array, optional
        Tensions for the first choice of the rigid links that bear; without them none does.
    ground : bool
        Springs that do not show hold what nothing else does: of many solutions the one with the least displacements.

    Returns
    -------
    (n, dim) array or None
        The displacements, rounded once; None where no active set was found to be that of the solution, or where the
        structure is singular without its slack links.
    """
    from flint import ctx

    before, ctx.prec = ctx.prec, BITS
    try:
        return _ActiveSet(scene, guess, tensions, ground).solve()
    finally:
        ctx.prec = before


class _ActiveSet:
    """Laws as pieces tau = k x + t0, rigid links that bear as equations x = 0 with their tensions as unknowns."""

    def __init__(self, scene, guess, tensions, ground):
        from flint import arb

        self.scene, self.zero = scene, arb(0)
        self.ground = arb(10) ** -GROUND * float(scene.stiffness.max()) if ground else arb(0)
        self.free = np.flatnonzero(~scene.fixed.ravel())
        self.row = np.full(scene.fixed.size, -1)
        self.row[self.free] = np.arange(len(self.free))
        self.given = [arb(float(x)) for x in np.where(scene.fixed, scene.prescribed, 0.0).ravel()]
        self.load = [arb(float(x)) for x in scene.load.ravel()[self.free]]
        dim, vectors = scene.dim, self._vectors(arb)
        self.links = []
        for (a, b), v, e0 in zip(scene.links, vectors, scene.initial_elongation):
            length = sum((x * x for x in v), self.zero).sqrt()
            n = [x / length for x in v]
            entries = [*range(dim * a, dim * a + dim), *range(dim * b, dim * b + dim)]
            self.links.append((entries, [-x for x in n] + n, arb(float(e0))))
        self.sign = np.where(scene.law == Law.INEXTENSIBLE, 1, np.where(scene.law == Law.CONTACT, -1, 0))
        self.pieces = [None if sign else self._pieces(i, arb) for i, sign in enumerate(self.sign)]
        start = None if guess is None else [arb(float(x)) for x in guess.ravel()]
        self.state = [self._piece(i, None if start is None else self._strain(i, start)) for i in range(len(self.links))]
        self.bears = np.zeros(len(self.sign), bool) if tensions is None else self.sign * tensions > 0

    def _vectors(self, arb):
        nodes = [[arb(float(x)) for x in point] for point in self.scene.nodes]
        given = np.zeros(self.scene.vectors.shape) if self.scene.direction is None else self.scene.direction
        return [
            [arb(float(x)) for x in d] if d.any() else [y - x for x, y in zip(nodes[a], nodes[b])]
            for (a, b), d in zip(self.scene.links, given)
        ]

    def _pieces(self, i, arb):
        """Return the strains between the pieces, and slope and tension at no strain of each."""
        law, k = self.scene.law[i], arb(float(self.scene.stiffness[i]))
        if law in (Law.BAR, Law.CABLE, Law.COMPRESSION_ONLY):
            taut, slack = (k, self.zero), (self.zero, self.zero)
            return {Law.BAR: ([], [taut]), Law.CABLE: ([self.zero], [slack, taut]),
                    Law.COMPRESSION_ONLY: ([self.zero], [taut, slack])}[law]  # fmt: skip
        x, t = ([arb(float(value)) for value in part] for part in self.scene.tables[law - len(Law)])
        slopes = [(d - c) / (b - a) for a, b, c, d in zip(x, x[1:], t, t[1:])]
        return x[1:-1], [(s, c - s * a) for s, a, c in zip(slopes, x, t)]

    def _piece(self, i, x):
        """Return the number of the piece of a link at the strain x; without one, of the first that bears."""
        if self.sign[i]:
            return None
        breaks, pieces = self.pieces[i]
        if x is None:
            return max(range(len(pieces)), key=lambda p: pieces[p][0] != 0)
        return sum(1 for at in breaks if x > at)

    def _strain(self, i, u):
        entries, n, e0 = self.links[i]
        return sum((v * u[j] for v, j in zip(n, entries)), e0)

    def _independent(self, bearing):
        """Return bearing rigid links whose rows do not depend on each other, as many as there are."""
        from scipy.linalg import qr

        rows = np.zeros((len(bearing), len(self.free)))
        for k, i in enumerate(bearing):
            for v, j in zip(self.links[i][1], self.links[i][0]):
                if self.row[j] >= 0:
                    rows[k, self.row[j]] += float(v)
        if not rows.size:
            return []
        _, r, order = qr(rows.T, mode="economic", pivoting=True)
        size = np.abs(np.diag(r))
        return sorted(bearing[k] for k in order[: np.count_nonzero(size > 1e-9 * max(size[0], 1e-300))])

    def _displacements(self, equations):
        """Solve for these pieces and equations; return displacements and tensions of the equations."""
        from flint import arb_mat

        n = len(self.free)
        matrix = [[self.zero] * (n + len(equations)) for _ in range(n + len(equations))]
        right = self.load + [self.zero] * len(equations)
        for i in range(n):
            matrix[i][i] += self.ground
        for i, state in enumerate(self.state):
            if state is None:
                continue
            k, t0 = self.pieces[i][1][state]
            if k == 0 and t0 == 0:
                continue
            entries, normal, _ = self.links[i]
            rest = k * self._strain(i, self.given) + t0
            for v, a in zip(normal, entries):
                if self.row[a] < 0:
                    continue
                right[self.row[a]] -= v * rest
                for w, b in zip(normal, entries):
                    if self.row[b] >= 0:
                        matrix[self.row[a]][self.row[b]] += k * v * w
        for q, i in enumerate(equations, n):
            right[q] = -self._strain(i, self.given)
            for v, a in zip(self.links[i][1], self.links[i][0]):
                if self.row[a] >= 0:
                    matrix[q][self.row[a]] += v
                    matrix[self.row[a]][q] += v
        x = arb_mat(matrix).solve(arb_mat([[value] for value in right])) if matrix else None
        u = list(self.given)
        for i in self.free:
            u[i] = x[int(self.row[i]), 0]
        return u, {i: x[q, 0] for q, i in enumerate(equations, n)}

    def solve(self):
        """Try active sets until one is its own solution's."""
        from flint import arb

        beyond = arb(10) ** -APART
        for _ in range(STEPS):
            bearing = [int(i) for i in np.flatnonzero(self.bears)]
            equations = self._independent(bearing)
            try:
                u, tension = self._displacements(equations)
            except ZeroDivisionError:
                return None
            strain = [self._strain(i, u) for i in range(len(self.links))]
            state = [self._piece(i, x) for i, x in enumerate(strain)]
            bears = self.bears.copy()
            for i in np.flatnonzero(self.sign):
                sign = int(self.sign[i])
                if not bears[i]:
                    bears[i] = bool(strain[i] * sign > beyond)
                elif len(equations) == len(bearing):  # where tensions are not unique their signs mean nothing
                    bears[i] = not tension[i] * sign < 0
            if state == self.state and (bears == self.bears).all():
                return np.array([float(value.mid()) for value in u]).reshape(self.scene.nodes.shape)
            self.state, self.bears = state, bears
        return None
