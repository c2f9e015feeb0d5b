"""Roofs and facades of cables, drawn at random: spoked wheels, domes, girders, tents, facades, hanging nets."""

from __future__ import annotations

import numpy as np

from .assembly import Assembly


def _circle(count, radius, z, turn=0.0):
    angle = 2 * np.pi * (np.arange(count) + turn) / count
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(count, z)])


def wheel(rng):
    """Draw a spoked wheel: a ring on braced columns, or held; spokes above and below to a hub of two rings."""
    a, n, rise, hub = Assembly(rng), int(rng.integers(5, 15)), rng.uniform(0.05, 0.2), rng.uniform(0.1, 0.5)
    tight = rng.random() < 0.5  # the rings of the hub are cables
    rim = a.row(_circle(n, 1.0, 0.0), held=bool(rng.random() < 0.3))
    a.ring(rim, a.bar)
    feet = a.row(_circle(n, 1.0, -0.5), held=True)
    for k in range(n):
        a.bar(rim[k], feet[k])
        a.bar(rim[k], feet[(k + 1) % n])
    upper, lower = (a.row(_circle(n, hub, z), weight=0.05) for z in (rise, -rise))
    for ring in (upper, lower):
        a.ring(ring, *((a.cable, 2.0) if tight else (a.bar,)))
        for k in range(n):
            a.cable(ring[k], rim[k], 1.0)
    for k in range(n):
        a.bar(upper[k], lower[k])
        if not tight:
            a.bar(upper[k], lower[(k + 1) % n])
    return a.scene("wheel")


def dome(rng):
    """Draw a cable dome, Geiger's or Levy's: rings of struts between ridge cables, diagonals and hoops."""
    a, n, rings, levy = Assembly(rng), int(rng.integers(5, 11)), int(rng.integers(1, 4)), rng.random() < 0.5
    radius = np.linspace(1.0, rng.uniform(0.1, 0.3), rings + 1)
    rise, depth = rng.uniform(0.05, 0.25), rng.uniform(0.1, 0.25)
    top = a.row(_circle(n, 1.0, 0.0), held=True)
    for k in range(1, rings + 1):
        turn = 0.5 * k if levy else 0.0
        z = rise * (1 - radius[k] ** 2)
        above = a.row(_circle(n, radius[k], z, turn), weight=0.03)
        below = a.row(_circle(n, radius[k], z - depth, turn))
        if k == rings:
            a.ring(above, a.cable, 0.5)
        a.ring(below, a.cable, 0.5)
        for i in range(n):
            a.bar(above[i], below[i])
            for j in (i, (i + 1) % n) if levy else (i,):
                a.cable(above[i], top[j], 1.0)
                a.cable(below[i], top[j], 0.5)
        top = above
    return a.scene("dome")


def girder(rng):
    """Draw a cable girder: two cables that sag and hog, with ties or struts, upright or inclined (Jawerth's)."""
    a, panels = Assembly(rng), int(rng.integers(3, 17))
    sag, hog, gap = rng.uniform(0.02, 0.1), rng.uniform(0.02, 0.1), rng.uniform(0.01, 0.05)
    x, inclined = np.linspace(0.0, 1.0, panels + 1), rng.random() < 0.5
    apart = rng.choice([-1.0, 1.0])  # the hogging cable below, with ties; or above, with struts between
    start = 0.0 if apart > 0 else -sag - hog - gap
    ends = np.isin(np.arange(panels + 1), (0, panels))
    upper = [a.node(t, start + gap + sag * (4 * t * (t - 1) + 1), held=end, weight=0.02) for t, end in zip(x, ends)]
    if inclined:
        x, ends = np.append(0.0, np.append((x[1:] + x[:-1]) / 2, 1.0)), np.append(ends, True)
        ends[panels] = False
    lower = [a.node(t, -hog * (4 * t * (t - 1) + 1), held=end) for t, end in zip(x, ends)]
    a.chain(upper, a.cable, 1.0)
    a.chain(lower, a.cable, 1.0)
    between = a.cable if apart > 0 else a.bar
    for k in range(1, panels) if not inclined else range(1, panels + 1):
        for other in (k - 1, k) if inclined else (k,):
            between(lower[k], upper[other])
    return a.scene("girder")


def tent(rng):
    """Draw a saddle with edge cables, two corners held, two on masts with two guys each."""
    a, meshes, rise = Assembly(rng), int(rng.integers(2, 8)), rng.uniform(0.1, 0.5)
    place, n = np.linspace(-1.0, 1.0, meshes + 1), meshes + 1
    number = np.array([[a.node(x, y, rise * x * y, held=abs(x - y) == 2.0, weight=0.02) for y in place] for x in place])
    edge = meshes * rng.uniform(0.5, 3.0)
    for k, line in enumerate(np.concatenate([number, number.T])):
        a.chain(list(map(int, line)), a.cable, edge if k in (0, meshes, n, n + meshes) else 1.0)
    for corner, side in ((0, -1.0), (n * n - 1, 1.0)):
        for i, (x, y) in enumerate([(1.0, 1.0), (1.9, 1.4), (1.4, 1.9)]):
            foot = a.node(side * x, side * y, -0.5, held=True)
            a.cable(corner, foot, edge) if i else a.bar(corner, foot)
    a.form(0, n * n - 1)
    return a.scene("tent")


def facade(rng):
    """Draw a plane net before a facade, its rim held, or upright cables with a few across."""
    a, m, n = Assembly(rng), int(rng.integers(2, 10)), int(rng.integers(2, 10))
    number = np.array([[a.node(i / m, 0.0, j / m, held=i in (0, m) or j in (0, n), weight=0.002)
                        for j in range(n + 1)] for i in range(m + 1)])  # fmt: skip
    for line in number[1:-1]:
        a.chain(list(map(int, line)), a.cable, 1.0)
    for line in number.T[1:-1]:
        a.chain(list(map(int, line)), a.cable, float(rng.choice([0.1, 1.0])))
    return a.scene("facade")


def hanging(rng):
    """Draw a net of hanging chains, its rim or its corners held; only its weight makes it tight."""
    a, m, n, sag = Assembly(rng), int(rng.integers(2, 8)), int(rng.integers(2, 8)), rng.uniform(0.05, 0.5)
    corners = rng.random() < 0.3
    held = (lambda x, y: abs(x) == 1 and abs(y) == 1) if corners else (lambda x, y: abs(x) == 1 or abs(y) == 1)
    number = np.array([[a.node(x, y * n / m, 0.0, held=held(x, y), weight=0.1)
                        for y in np.linspace(-1, 1, n + 1)] for x in np.linspace(-1, 1, m + 1)])  # fmt: skip
    for lines in (number, number.T):
        for line in lines if corners else lines[1:-1]:
            a.chain(list(map(int, line)), a.cable, 0.0125 * m / sag)
    a.form()
    return a.scene("hanging", bool(rng.random() < 0.7))


ROOFS = {"wheel": wheel, "dome": dome, "girder": girder, "tent": tent, "facade": facade, "hanging": hanging}
