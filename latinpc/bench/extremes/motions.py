"""The cases of motions: TS latin with masses, steps and shocks at their extremes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from latinpc.scenes import Law, Scene, make

from .case import SUBDOMAINS, Case, options
from .rigid import dealt, net, packing

STEPS = 3  # of each motion

# ---- structures ------------------------------------------------------------------------------


def moving(scene, step=0.1, mass=1.0, spread=0.0, speed=1.0):
    """Give a structure masses, velocities, and a step of so many periods of a mass on a link.

    Parameters
    ----------
    scene : Scene
    step : float
        Over the period.
    mass : float
        Of a node (kg).
    spread : float
        Powers of ten by which masses differ at random.
    speed : float
        Over what stretches a link by a thousandth of its length in a period.
    """
    rng = np.random.default_rng(5)
    elastic = scene.stiffness > 0
    k = scene.stiffness[elastic].mean() if elastic.any() else np.abs(scene.load).max() / 1e-3
    masses = mass * 10.0 ** (spread * rng.uniform(-0.5, 0.5, len(scene.nodes)))
    period = 2 * np.pi * np.sqrt(mass / k)
    velocity = speed * 1e-3 * np.median(scene.lengths) / period * rng.normal(size=scene.nodes.shape)
    return replace(scene, mass=masses, velocity=np.where(scene.fixed, 0.0, velocity), time_step=step * period)


def truss():
    """Make bars and prestressed cables in 3D."""
    return make("network", nodes=24)


def plate():
    """Make the article's grid of 2 x 2 modules as METIS cuts it, some cables of which slacken."""
    return make("tensegrity-grid", modules=2, partition="metis")


def truss_node():
    """Return the number of a node of the truss that is free."""
    return int(np.flatnonzero(~truss().fixed.any(axis=1))[3])


def flying(scene):
    """Take the supports and the loads away."""
    return replace(scene, fixed=np.zeros_like(scene.fixed), load=np.zeros_like(scene.load))


def balls(masses, gaps, velocities, law=Law.CONTACT, step=1e-3):
    """Make balls in a row in one dimension, which touch their neighbours, or hang on to them by cables."""
    count = len(masses)
    sign = 1.0 if law == Law.CONTACT else -1.0
    return Scene(name="balls", nodes=np.arange(float(count))[:, None], law=np.full(count - 1, law),
                 links=np.column_stack([np.arange(count - 1), np.arange(1, count)]), stiffness=np.zeros(count - 1),
                 initial_elongation=sign * np.broadcast_to(gaps, count - 1), mass=np.asarray(masses, float),
                 velocity=sign * np.reshape(np.asarray(velocities, float), (-1, 1)), time_step=step)  # fmt: skip


def struck(mass, speed=1.0):
    """Make the article's grid at rest, one node of it with another mass, and struck: it alone moves."""
    scene = moving(plate(), speed=0.0)
    node = int(np.flatnonzero(~scene.fixed.any(axis=1))[3])
    masses, velocity = scene.mass.copy(), scene.velocity.copy()
    masses[node], velocity[node] = mass, [0.0, 0.0, -speed]
    return replace(scene, mass=masses, velocity=velocity)


def sliding(friction, mass=2.0, step=1e-2, speed=1.0):
    """Make a block on a table, which slides until friction has stopped it."""
    return Scene(name="sliding", nodes=[[0.0, 0.0], [0.0, 0.0]], links=[[0, 1], [0, 1]],
                 law=[Law.FRICTION, Law.TANGENT], stiffness=[0.0, 0.0], direction=[[0.0, 1.0], [1.0, 0.0]],
                 friction=[friction, 0.0], fixed=[[True, True], [False, False]],
                 load=[[0.0, 0.0], [0.0, -9.81 * mass]], mass=[0.0, mass],
                 velocity=[[0.0, 0.0], [speed, 0.0]], time_step=step)  # fmt: skip


def sliding_solution(scene):
    """Let friction take mu g h of the velocity in every step, and stop the block in the end."""
    slower = scene.friction[0] * 9.81 * scene.time_step * np.arange(1, STEPS + 1)
    v = np.zeros((STEPS, 2, 2))
    v[:, 1, 0] = np.maximum(scene.velocity[1, 0] - slower, 0.0)
    return v


# ---- the catalogue ---------------------------------------------------------------------------


def cases():
    """Return all cases, group by group."""
    return [*_motions(), *_shocks()]


def _case(group, name, make_scene, expected="right", subdomains=SUBDOMAINS, **more):
    return Case(group, name, make_scene, expected, options(snes_latin_subdomains=subdomains), steps=STEPS, **more)


def _motions():
    for power in (-6, -3, -1, 0, 1, 3):
        for make_scene, what in ((truss, "truss"), (plate, "grid")):
            yield _case("motions", f"{what}, steps of 1e{power} periods", lambda make_scene=make_scene, power=power: (
                moving(make_scene(), 10.0**power)))  # fmt: skip
    for power in (-12, -6, 6, 12):
        yield _case("motions", f"truss, 1e{power} times the masses", lambda power=power: (
            moving(truss(), mass=10.0**power)))  # fmt: skip
        yield _case("motions", f"truss, 1e{power} times the masses, the same step", lambda power=power: replace(
            moving(truss(), mass=10.0**power), time_step=moving(truss()).time_step))  # fmt: skip
        yield _case("motions", f"truss, 1e{power} times the velocities", lambda power=power: (
            moving(truss(), speed=10.0**power)))  # fmt: skip
    for spread in (6, 12, 24):
        yield _case("motions", f"truss, masses from 1e{-spread // 2} to 1e{spread // 2}", lambda spread=spread: (
            moving(truss(), spread=spread)))  # fmt: skip
    yield _case("motions", "truss, one mass, the others without", lambda: replace(
        moving(truss()), mass=np.where(np.arange(len(truss().nodes)) == truss_node(), 1.0, 0.0)))  # fmt: skip
    yield _case("motions", "truss at rest", lambda: moving(replace(truss(), load=0 * truss().load), speed=0.0))
    for step in (1e-6, 0.1, 1e3):
        yield _case("motions", f"flies, steps of {step:g} periods", lambda step=step: moving(flying(truss()), step))
    yield _case("motions", "two parts that fly", lambda: moving(flying(_two(truss()))))
    yield _case("motions", "one subdomain", lambda: moving(truss()), subdomains=1)
    yield _case("motions", "one link a subdomain", lambda: dealt(moving(truss())), subdomains=len(truss().links))
    yield _case("motions", "4 ranks", lambda: moving(truss()), ranks=4)


def _two(scene):
    """Make two of a structure, far from each other."""
    stack = {
        name: np.concatenate([getattr(scene, name)] * 2)
        for name in ("law", "stiffness", "initial_elongation", "load", "fixed")
    }
    return Scene(name="two", nodes=np.vstack([scene.nodes, scene.nodes + 100.0]),
                 links=np.vstack([scene.links, scene.links + len(scene.nodes)]), **stack)  # fmt: skip


def _shocks():
    for law, what in ((Law.CONTACT, "balls"), (Law.INEXTENSIBLE, "balls on cables")):
        for power in (-12, -6, 6, 12):
            yield _case("shocks", f"two {what}, 1e{power} times as heavy", lambda law=law, power=power: balls(
                [1.0, 10.0**power], 1e-4, [1.0, 0.0], law), subdomains=1)  # fmt: skip
            yield _case("shocks", f"six {what}, every other 1e{power} times as heavy", lambda law=law, power=power: (
                balls(np.where(np.arange(6) % 2, 10.0**power, 1.0), 0.0, [1.0, 0, 0, 0, 0, 0], law)),
                "right" if abs(power) < 12 else "either", subdomains=4)  # fmt: skip
        for gap in (0.0, 1e-12, 1e-3, 1e12):
            yield _case("shocks", f"two {what}, {gap:g} apart", lambda law=law, gap=gap: balls(
                [1.0, 2.0], gap, [1.0, -1.0], law), subdomains=1)  # fmt: skip
        for speed in (1e-12, 1e12):
            yield _case("shocks", f"two {what} at {speed:g} m/s", lambda law=law, speed=speed: balls(
                [1.0, 2.0], 0.0, [speed, -speed], law), subdomains=1)  # fmt: skip
    for mass in (1e-12, 1e-6, 1e6, 1e12):
        yield _case("shocks", f"grid, one node struck, {mass:g} times as heavy", lambda mass=mass: struck(mass))
    for power in (-6, -1, 1, 3):
        yield _case("shocks", f"net of inextensible cables, steps of 1e{power} periods", lambda power=power: moving(
            net(), 10.0**power), "right" if power < 3 else "either")  # fmt: skip
    for power in (-6, 0, 6):
        yield _case("shocks", f"grains, 1e{power} times the masses", lambda power=power: moving(
            packing(5), mass=10.0**power))  # fmt: skip
    for friction in (0.0, 1e-12, 0.3, 1e6):
        yield _case("shocks", f"block that slides, coefficient {friction:g}", lambda friction=friction: (
            sliding(friction)), subdomains=1, solution=sliding_solution)  # fmt: skip
    for mass in (1e-12, 1e12):
        yield _case("shocks", f"block that slides, {mass:g} kg", lambda mass=mass: sliding(0.3, mass), subdomains=1,
                    solution=sliding_solution)  # fmt: skip
    yield _case("shocks", "block that stops in a step", lambda: sliding(0.3, step=10.0), subdomains=1,
                solution=sliding_solution)  # fmt: skip
