"""Structures drawn at random that prestress holds, and the judge of large displacements.

Nets, hypars, masts, towers and bridges of the scenes, of random sizes, shapes, tensions and stiffnesses, some of
tensions that are out of balance as drawn, under loads that differ from node to node. These are as large as a
deflection, drawn between 0.002 and 0.2 of the size, or 30 % of slack cables allow; where a limit point comes first, of
one in two structures they are beyond it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from latinpc.laws import Law
from latinpc.scenes import make

from .corotational import LARGEST, NOTHING, Corotational

OPTIONS = {"snes_latin_error": 1e-8, "snes_latin_balance": 1e-9}  #: what the judge asks for
UNBALANCED = 1e-8  #: of the loads: unbalanced forces that an equilibrium may leave
NEAR = 1e-6  # relative distance of equal displacements
DEFLECTION = (2e-3, 0.2)  # of the size
SLACK = 0.3  # of the cables
CLICK = 1e-2  # of the size: nodes that click so far between slack cables have not snapped through
FLAT = 1e-13  # of the energy, or the largest stiffness: as much is rounding, where next to nothing holds a node
FINER = 0.1  # times the increment of a path, if that leads elsewhere: next to a branch
MOST = 1e4  # times the loads of the scene: a structure that has not moved then is stiff


def structure(rng):
    """Make a structure and its loads.

    Parameters
    ----------
    rng : numpy.random.Generator

    Returns
    -------
    topology : str
        Name of the scene.
    scene : Scene
    """
    name, factor = str(rng.choice(list(SCENES))), 0.0
    while factor == 0.0:  # else the prestress alone moves it too far
        scene = shaken(rng, make(name, **SCENES[name](rng)))
        factor = grown(rng, scene)
    return name, replace(scene, load=factor * scene.load)


def grown(rng, scene):
    """Return a factor on the loads: up to a random deflection, or next to a limit point; 0 if nothing holds it."""
    path = _loaded(scene, 10.0 ** rng.uniform(*np.log10(DEFLECTION)))
    part = rng.uniform(0.3, 0.99), rng.uniform(1.03, 2.0)
    return path.factor if path.follows else path.factor * part[int(rng.random() < 0.5)]


def _loaded(scene, target):
    """Return the path of the loads up to a deflection, over the size, or to the most slack cables."""
    equations, cable = Corotational(scene), scene.law == Law.CABLE

    def until(u, tensions):
        deflection = np.linalg.norm(u, axis=1).max()
        return deflection > target * equations.size or np.mean(tensions[cable] == 0.0) > SLACK

    return equations.follow(until, MOST)


SCENES = {
    "saddle": lambda rng: {
        "side": int(rng.integers(3, 11)), "height": float(rng.choice([0.0, rng.uniform(0.02, 0.4)], p=[0.2, 0.8])),
        "prestress": float(10.0 ** rng.uniform(2, 4)), "load": float(rng.choice([-10.0, 10.0])),
        "wind": float(rng.normal(0, 5)),
    },
    "hypar": lambda rng: {
        "side": int(rng.integers(3, 9)), "height": float(rng.uniform(0.1, 0.6)), "sag": float(rng.uniform(0.05, 0.15)),
        "prestress": float(10.0 ** rng.uniform(2, 4)), "load": float(rng.choice([-10.0, 10.0])),
        "wind": float(rng.normal(0, 5)),
    },
    "mast": lambda rng: {
        "levels": int(rng.integers(1, 4)), "panels": int(rng.integers(2, 5)),
        "prestress": float(10.0 ** rng.uniform(2.5, 4)), "load": float(10.0 ** rng.uniform(0, 3)),
        "wind": float(rng.uniform(1, 20)),
        "direction": float(rng.uniform(0, 360)),
    },
    "tower": lambda rng: {
        "stages": int(rng.integers(1, 7)), "struts": int(rng.integers(3, 7)),
        "prestress": float(10.0 ** rng.uniform(2, 4)), "load": float(10.0 ** rng.uniform(0, 3)),
        "wind": float(rng.normal(0, 10)),
        "torque": float(rng.choice([0.0, rng.normal(0, 50)])),
    },
    "bridge": lambda rng: {
        "panels": int(rng.integers(4, 17)), "height": float(rng.uniform(0.02, 0.1)),
        "prestress": float(10.0 ** rng.uniform(3, 5)), "load": 10.0, "crowd": float(rng.uniform(0, 50)),
        "wind": float(rng.normal(0, 5)),
    },
}  # fmt: skip


def shaken(rng, scene):
    """Return the scene with stiffnesses that differ, loads that do, and in one of four tensions out of balance."""
    tension = scene.prestress * 10.0 ** (rng.choice([0.0, 0.1], p=[0.75, 0.25]) * rng.uniform(-1, 1, len(scene.links)))
    stiffness = scene.stiffness * 10.0 ** rng.uniform(-0.3, 0.3, len(scene.links))
    size = np.abs(scene.load).max() * rng.choice([0.0, 0.3, 2.0])
    load = np.where(scene.fixed, 0.0, scene.load + size * rng.normal(0, 1, scene.load.shape))
    return replace(scene, stiffness=stiffness, initial_elongation=tension / stiffness, load=load)


def judge(scene, u):
    """Judge displacements that a solver claims.

    Parameters
    ----------
    scene : Scene
    u : (n, dim) array
        In m.

    Returns
    -------
    dict
        verdict; u, the relative distance from the end of the path, and tension, the unbalanced forces relative to
        the loads. `elsewhere` is a stable equilibrium beside that where the structure is at rest, no further than
        `CLICK`: where slack cables let nodes click over; of rounding if its energy is the same. Further it is wrong:
        the structure has snapped through. A path in finer increments comes before such verdicts.
    """
    if not np.isfinite(u).all():
        return {"verdict": "wrong"}
    equations, loads = Corotational(scene), np.linalg.norm(scene.load)
    found = {"tension": float(np.linalg.norm(equations.unbalance(u.astype(np.longdouble)))) / (loads or 1.0)}
    if found["tension"] > UNBALANCED:
        return found | {"verdict": "wrong", "why": "unbalanced forces"}
    if not equations.stable(u.astype(np.longdouble)):
        if equations.stable(u.astype(np.longdouble), least=-FLAT):
            return found | {"verdict": "rounding", "why": "next to nothing holds a node"}
        return found | {"verdict": "wrong", "why": "the tangent stiffness is not positive definite"}
    for largest in (LARGEST, FINER * LARGEST):
        found |= _beside(equations, u, equations.follow(largest=largest))
        if found["verdict"] in ("right", "rounding"):
            break
    return found


def _beside(equations, u, path):
    """Return the verdict on a stable equilibrium beside the path, and the reason; u if the path bears all loads."""
    if path.first > 0.0:
        return {"verdict": "right", "why": "nothing holds the structure without loads: any stable equilibrium is one"}
    end, clicks, why = path.displacements, 0.0, "the path leads on"
    if path.factor < 1.0:
        why = f"the path of equilibria ends at {path.factor:.4g} of the loads"
        end, clicks = equations.beyond(path)
        if end is None:
            return {"verdict": "wrong", "why": why}
    found, far = {}, float(np.linalg.norm(u - end, axis=1).max()) / equations.size
    if path.factor >= 1.0:
        found["u"] = float(np.linalg.norm(u - end) / np.linalg.norm(end))
    if found.get("u", np.inf) <= NEAR or max(far, clicks) <= NOTHING:
        return found | {"verdict": "right"}
    verdict, told = "wrong", f"{far:.1g} of the size away from where the structure is at rest"
    if max(far, clicks) <= CLICK:
        here, there = (equations.energy(v.astype(np.longdouble), 1.0) for v in (u, end))
        verdict = "rounding" if abs(here - there) <= FLAT * abs(there) else "elsewhere"
    return found | {"verdict": verdict, "why": f"{why}; {told}"}


def refused(scene, reason):
    """Say whether a refusal is right: where the path of equilibria ends before the loads, and the reason says so."""
    told = any(why in reason for why in ("no stable equilibrium follows", "unstable, or buckles", "buckles at"))
    return "refused" if told and Corotational(scene).follow().factor < 1.0 else "unsolved"
