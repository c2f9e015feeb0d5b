"""Bridges of cables, drawn at random: stayed and suspension bridges, footbridges with wind guys, ropeways."""

from __future__ import annotations

import numpy as np

from .assembly import Assembly


def stayed(rng):
    """Draw a cable-stayed bridge: one or two towers, stays in a fan or a harp, a back stay, a truss as its deck."""
    a, towers, stays, depth = Assembly(rng), int(rng.integers(1, 3)), int(rng.integers(2, 6)), rng.uniform(0.02, 0.1)
    panels = 2 * stays * towers + 2 * towers
    x = np.linspace(0.0, towers, panels + 1)
    feet = [stays + 1 + k * (2 * stays + 2) for k in range(towers)]
    top = _deck(a, x, depth, [0, panels, *feet])
    height, fan = rng.uniform(0.3, 0.7), rng.random() < 0.5
    for foot in feet:
        levels = [height] if fan else height * np.linspace(0.4, 1.0, stays)
        mast = a.row([(x[foot], z) for z in levels])
        a.chain([a.node(x[foot], 0.0, held=True), *mast], a.bar)
        for k in range(1, stays + 1):
            for side in (-k, k):
                a.cable(mast[0 if fan else k - 1], top[foot + side], rng.uniform(0.5, 2.0))
        for anchor in (x[foot] - 0.5, x[foot] + 0.5):  # back stays
            if anchor < 1e-9 or anchor > towers - 1e-9:
                a.cable(
                    mast[-1],
                    a.node(anchor + rng.uniform(-0.1, 0.0) * (-1 if anchor > 0 else 1), -depth, held=True),
                    3.0,
                )
    return a.scene("stayed")


def suspension(rng):
    """Draw a suspension bridge: a main cable on two towers, hangers, a stiffening truss."""
    a, panels, depth, sag = Assembly(rng), 2 * int(rng.integers(3, 9)), rng.uniform(0.01, 0.05), rng.uniform(0.08, 0.15)
    x, low = np.linspace(0.0, 1.0, panels + 1), rng.uniform(0.02, 0.05)
    deck = _deck(a, x, depth, [0, panels])
    main = a.row([(t, low + sag * (2 * t - 1) ** 2) for t in x])
    pull = 1.0 / panels / (8 * sag)
    for end, side in ((0, -1.0), (panels, 1.0)):
        a.bar(main[end], a.node(x[end], -0.1, held=True))
        a.cable(main[end], a.node(x[end] + side * rng.uniform(0.2, 0.4), 0.0, held=True), 8.0 * panels * pull)
    a.chain(main, a.cable, 8.0 * panels * pull)
    for k in range(1, panels):
        a.cable(main[k], deck[k], 0.1)
    return a.scene("suspension")


def _deck(a, x, depth, supported):
    """Add a truss, supported below these panel points, the first one along as well; return the upper nodes."""
    top = a.row([(t, 0.0) for t in x], weight=0.1)
    low = [a.node(t, -depth, held=(k == supported[0], k in supported)) for k, t in enumerate(x)]
    a.chain(top, a.bar)
    a.chain(low, a.bar)
    for k, (u, v) in enumerate(zip(top, low, strict=True)):
        a.bar(u, v)
        if k:
            a.bar(*((low[k - 1], u) if k % 2 else (top[k - 1], v)))
    return top


def footbridge(rng):
    """Draw a walkway hung from two cables, with cross beams and wind guys below at each side."""
    a, panels, sag = Assembly(rng), int(rng.integers(3, 10)), rng.uniform(0.05, 0.12)
    width, out, down = rng.uniform(0.02, 0.06), rng.uniform(0.1, 0.3), rng.uniform(0.0, 0.6)
    guy = rng.choice([0.2, 1.0])
    pull = 8.0 / panels * np.array([sag, guy * out])  # of hangers and of what ties the guys
    places = [(t, (2 * t - 1) ** 2, t in (0.0, 1.0)) for t in np.linspace(0.0, 1.0, panels + 1)]
    decks = []
    for side in (-1.0, 1.0):
        away = side * np.cos(down), -np.sin(down)
        deck = [a.node(t, side * width, 0.0, held=end, weight=pull[0] * (not end)) for t, _, end in places]
        main = [a.node(t, side * width, 0.03 + sag * high, held=end) for t, high, end in places]
        wind = [a.node(t, side * width + (0.03 + out * high) * away[0], (0.03 + out * high) * away[1], held=end)
                for t, high, end in places]  # fmt: skip
        a.chain(deck, a.cable, guy)
        a.chain(main, a.cable, 1.0 + guy * out / sag * np.sin(down))
        a.chain(wind, a.cable, guy)
        for k in range(1, panels):
            a.cable(main[k], deck[k], pull[0] + pull[1] * np.sin(down))
            a.cable(wind[k], deck[k], pull[1])
        decks.append(deck)
    for left, right in list(zip(*decks, strict=True))[1:-1]:
        a.bar(left, right)
    return a.scene("footbridge")


def ropeway(rng):
    """Draw a ropeway of several spans over trestles, with chairs on hangers."""
    a, spans, pieces = Assembly(rng), int(rng.integers(1, 5)), 2 * int(rng.integers(2, 5))
    sag, rise, chairs = rng.uniform(0.02, 0.1), rng.uniform(-0.3, 0.5), rng.random() < 0.7
    rope, trestles = [], []
    for k in range(spans * pieces + 1):
        t, on = k / pieces, k % pieces == 0
        z = rise * t + (0.0 if on else -4.0 * sag * (t % 1) * (1 - t % 1))
        rope.append(a.node(t, z, held=k in (0, spans * pieces), weight=0.02))
        if on and 0 < k < spans * pieces:
            trestles.append(rope[-1])
            for foot in (-0.08, 0.08):
                a.bar(rope[-1], a.node(t + foot, z - 0.3, held=True))
        elif chairs and k % 2:
            chair = float(rng.choice([0.02, 0.3]))
            a.cable(rope[-1], a.node(t, z - 0.06, weight=chair), chair)
    a.chain(rope, a.cable, 1.0 / (8 * sag) * 0.02 * pieces)
    a.form(*trestles)
    return a.scene("ropeway")


BRIDGES = {"stayed": stayed, "suspension": suspension, "footbridge": footbridge, "ropeway": ropeway}
