"""A step of a motion as a static structure, section 2.2, and its solution in ball arithmetic."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from petsc4py import PETSc

from latinpc.laws import Law
from latinpc.results.mechanics import elongations, tensions

from .case import ACCURACY
from .exact import solve_exactly

CLOSED = 1e-4  # of the flight of a step: smaller gaps are closed, as TS latin has it
EPSILON = float(np.finfo(PETSc.RealType).eps)
NOTHING = 16 * EPSILON  # of the strains: less is their rounding
STILL = EPSILON / 1e-4  # of the rest that is given: less is rounding of what has come to rest
REST = max(1e-6, EPSILON / ACCURACY)  # of what moved before, or would without links: less is rest, or its rounding


def as_statics(scene, u, v):
    """Make the structure whose displacements are h v+ in the step of length h from displacements u and velocities v.

    Nodes stand on springs M / h^2, links start from their present strains; rigid ones must not close, or stretch, by
    more than they are now.

    Parameters
    ----------
    scene : Scene
        With masses; h is its `time_step`.
    u, v : (n, dim) array
        Displacements (m) and velocities (m/s).

    Returns
    -------
    Scene
    """
    h, (n, dim) = scene.time_step, scene.nodes.shape
    heavy = np.flatnonzero(scene.mass > 0)
    free = ~scene.fixed & (scene.mass > 0)[:, None]
    force = np.where(scene.fixed, 0.0, scene.load + scene.mass[:, None] * v / h)
    flight = np.abs(_elastic(scene, u, force) * h**2 / np.where(free, scene.mass[:, None], np.inf)).max(initial=0.0)
    x = elongations(scene, u) + scene.initial_elongation
    rigid = np.isin(scene.law, (Law.INEXTENSIBLE, Law.CONTACT))
    closed = rigid & (np.where(scene.law == Law.INEXTENSIBLE, -x, x) <= CLOSED * flight)
    springs = np.column_stack([np.full(dim * len(heavy), n), np.repeat(heavy, dim)])
    return replace(
        scene,
        nodes=np.vstack([scene.nodes, scene.nodes[:1]]),  # the ground
        links=np.vstack([scene.links, springs]),
        law=np.append(scene.law, np.full(len(springs), Law.BAR)),
        stiffness=np.append(scene.stiffness, np.repeat(scene.mass[heavy], dim) / h**2),
        initial_elongation=np.append(np.where(closed, 0.0, x), np.zeros(len(springs))),
        direction=np.vstack([scene.directions, np.tile(np.eye(dim), (len(heavy), 1))]),
        fixed=np.vstack([scene.fixed, np.ones((1, dim), bool)]),
        prescribed=None,
        load=np.vstack([force, np.zeros((1, dim))]),
        subdomain=None, mass=None, velocity=None, friction=None,
    )  # fmt: skip


def _elastic(scene, u, force):
    """Return forces on the nodes with those of elastic links."""
    elastic = ~np.isin(scene.law, (Law.INEXTENSIBLE, Law.CONTACT, Law.FRICTION, Law.TANGENT))
    pull = np.where(elastic, tensions(scene, u), 0.0)[:, None] * scene.directions
    both = force.copy()
    np.add.at(both, scene.links[:, 0], pull)
    np.subtract.at(both, scene.links[:, 1], pull)
    return both


def motion_error(case, scene, u, v, rest=0.0):
    """Return the relative l2 error of the velocities after the worst step, and the kind of reference.

    Parameters
    ----------
    case : Case
    scene : Scene
    u, v : (steps + 1, n, dim) arrays
        At the start and after each step.
    rest : float
        Part of the largest speed so far that is rest: errors are relative to no less.

    Returns
    -------
    float, str
    """
    if case.solution is not None:
        known = case.solution(scene)
        floor = REST * max(map(np.linalg.norm, (scene.velocity, _flight(scene))))
        return max(_far(found, exact, floor) for found, exact in zip(v[1:], known)), "closed form"
    worst, kinds = 0.0, set()
    for k in range(case.steps):
        error, kind = _step_error(scene, u[k], v[k], v[k + 1], rest * max(map(np.linalg.norm, v[: k + 1])))
        worst = max(worst, error)
        kinds.add(kind)
    return worst, ", ".join(sorted(kinds))


def _far(found, known, floor):
    """Return how far velocities are from the true ones, beside these or a floor."""
    size = max(np.linalg.norm(known), floor)
    far = np.linalg.norm(found - known)
    return float(far / size) if size > 0 else float(far)


def _flight(scene):
    """Return what loads add to velocities in a step where no links are."""
    heavy = scene.mass[:, None] > 0
    return np.divide(scene.load * scene.time_step, scene.mass[:, None], where=heavy, out=np.zeros(scene.load.shape))


def _step_error(scene, u, v, found, rest=0.0):
    h = scene.time_step
    if max(map(np.linalg.norm, (v, found))) <= STILL * rest and not _flight(scene).any():
        return 0.0, "nothing moves but by rounding"
    statics = as_statics(scene, u, v)
    w = h * np.vstack([found, 0.0 * found[:1]])
    exact = solve_exactly(statics, w)
    if not exact.exists:
        return np.inf, "none exists"
    exact = exact.displacements
    if np.linalg.norm(found - exact[:-1] / h) * h <= NOTHING * np.linalg.norm(statics.initial_elongation):
        return 0.0, "nothing moves but by rounding"
    floor = max(rest, *(REST * np.linalg.norm(x) for x in (v, u / h, v + _flight(scene))))
    return _far(found, exact[:-1] / h, floor), "exact"
