"""Structures that guys or crossed cables brace, drawn at random: chimneys, portals, frames."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from .assembly import Assembly


def _stack(a, rng, levels, x=0.0):
    """Add a chain of bars, pinned, each joint with three or four guys; return its joints."""
    mast = a.row([(x, 0.0, z) for z in np.arange(1, levels + 1) / levels], weight=0.1)
    a.chain([a.node(x, 0.0, 0.0, held=True), *mast], a.bar)
    count, turn = int(rng.integers(3, 5)), rng.uniform(0, 2 * np.pi)
    for k, joint in enumerate(mast):
        for angle in turn + 2 * np.pi * np.arange(count) / count:
            out = rng.uniform(0.4, 0.8) if k % 2 == 0 else 0.6
            a.cable(joint, a.node(x + out * np.cos(angle), out * np.sin(angle), 0.0, held=True), rng.uniform(0.7, 1.4))
    return mast


def chimney(rng):
    """Draw a chimney with up to ten levels of guys."""
    a = Assembly(rng)
    _stack(a, rng, int(rng.integers(1, 11)))
    return a.scene("chimney")


def portal(rng):
    """Draw two to four guyed masts with beams between their heads, and crossed cables below."""
    a, levels, masts = Assembly(rng), int(rng.integers(1, 4)), int(rng.integers(2, 5))
    stacks = [_stack(a, rng, levels, 0.5 * k) for k in range(masts)]
    for left, right in pairwise(stacks):
        a.bar(left[-1], right[-1])
        for k in range(1, levels):
            a.cable(left[k], right[k - 1], 0.2)
            a.cable(left[k - 1], right[k], 0.2)
    return a.scene("portal")


def frame(rng):
    """Draw a frame of pinned columns and beams, braced by crossed cables in some or all bays."""
    a, columns, storeys = Assembly(rng), int(rng.integers(3, 7)), int(rng.integers(1, 6))
    wide, high = rng.uniform(0.6, 1.6), 1.0
    number = [
        [a.node(wide * i, high * j, held=j == 0, weight=0.05 * (j > 0)) for j in range(storeys + 1)]
        for i in range(columns)
    ]
    for column in number:
        a.chain(column, a.bar)
    for j in range(1, storeys + 1):
        a.chain([column[j] for column in number], a.bar)
        bays = np.flatnonzero(rng.random(columns - 1) < 0.6)
        for i in bays if len(bays) else [0]:
            a.cable(number[i][j - 1], number[i + 1][j], 0.3)
            a.cable(number[i][j], number[i + 1][j - 1], 0.3)
    return a.scene("frame", bool(rng.random() < 0.6))


GUYED = {"chimney": chimney, "portal": portal, "frame": frame}
