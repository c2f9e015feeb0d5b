"""Displacements that no rounding touches: ball arithmetic on the doubles given."""

from __future__ import annotations

import numpy as np

from latinpc.scenes.scene import Law

BITS = 400  # of the balls: 120 digits, 90 of which a contrast of 1e14 in a long chain may take
STEPS = 30  # active sets that are tried


def solve_exactly(scene, guess=None):
    """Solve a small structure of bars, cables and struts exactly, by an active set method in ball arithmetic.

    Parameters
    ----------
    scene : Scene
        Of some hundred unknowns: the matrix is dense.
    guess : (n, dim) array, optional
        Displacements from which the links that carry tension are told at first.

    Returns
    -------
    (n, dim) array or None
        The displacements, rounded once; None where no active set was found to be that of the solution, or where the
        structure is singular without its slack links.
    """
    from flint import arb, arb_mat, ctx

    before, ctx.prec = ctx.prec, BITS
    try:
        return _solve(scene, guess, arb, arb_mat)
    finally:
        ctx.prec = before


def _solve(scene, guess, arb, arb_mat):
    dim, free = scene.dim, np.flatnonzero(~scene.fixed.ravel())
    row = np.full(scene.fixed.size, -1)
    row[free] = np.arange(len(free))
    nodes = [[arb(float(x)) for x in point] for point in scene.nodes]
    given = [arb(float(x)) for x in np.where(scene.fixed, scene.prescribed, 0.0).ravel()]
    links = []
    for (a, b), k, e0 in zip(scene.links, scene.stiffness, scene.prestrain):
        apart = [y - x for x, y in zip(nodes[a], nodes[b])]
        length = sum((x * x for x in apart), arb(0)).sqrt()
        n = [x / length for x in apart]
        entries = [*range(dim * a, dim * a + dim), *range(dim * b, dim * b + dim)]
        links.append((entries, [-x for x in n] + n, arb(float(k)), arb(float(e0))))

    def strain(link, u):
        entries, n, _, e0 = link
        return sum((v * u[i] for v, i in zip(n, entries)), e0)

    start = [arb(float(x)) for x in guess.ravel()] if guess is not None else None
    active = [start is None or _carries(law, strain(link, start)) for law, link in zip(scene.law, links)]
    for _ in range(STEPS):
        size = len(free)
        matrix, right = [[arb(0)] * size for _ in range(size)], [arb(float(x)) for x in scene.load.ravel()[free]]
        for link, carries in zip(links, active):
            if not carries:
                continue
            entries, n, k, _ = link
            rest = k * strain(link, given)
            for v, i in zip(n, entries):
                if row[i] < 0:
                    continue
                right[row[i]] -= v * rest
                for w, j in zip(n, entries):
                    if row[j] >= 0:
                        matrix[row[i]][row[j]] += k * v * w
        try:
            x = arb_mat(matrix).solve(arb_mat([[value] for value in right])) if size else None
        except ZeroDivisionError:
            return None
        u = list(given)
        for i in free:
            u[i] = x[int(row[i]), 0]
        now = [_carries(law, strain(link, u)) for law, link in zip(scene.law, links)]
        if now == active:
            return np.array([float(value.mid()) for value in u]).reshape(scene.nodes.shape)
        active = now
    return None


def _carries(law, x):
    """Tell whether a link of that law carries tension at the strain x."""
    return bool(law == Law.BAR or (x > 0 if law == Law.CABLE else x < 0))
