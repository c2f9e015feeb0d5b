"""A process that solves and judges random structures: ``python -m latinpc.bench.extremes.rating TASK``."""

from __future__ import annotations

import json
import signal
import sys
import warnings

import petsc4py

petsc4py.init([sys.argv[0], "-skip_petscrc"])

import numpy as np  # noqa: E402
from petsc4py import PETSc  # noqa: E402

import latinpc  # noqa: E402
from latinpc.laws import Law  # noqa: E402
from latinpc.runs.motion import move  # noqa: E402
from latinpc.runs.solve import solve  # noqa: E402

from .case import Case  # noqa: E402
from .conditions import missed  # noqa: E402
from .drawn import LARGE, draw  # noqa: E402
from .exact import solve_exactly  # noqa: E402
from .rates import ASKED, SLACK  # noqa: E402
from .rubbing import impossible, near, solve_rubbing  # noqa: E402
from .steps import motion_error  # noqa: E402
from .turning import OPTIONS  # noqa: E402
from .turning import judge as judge_large  # noqa: E402
from .turning import refused as refused_large  # noqa: E402

EPSILON = float(np.finfo(PETSc.RealType).eps)
STUCK = 1e-10  # of what loads make of a link: where rigid links let nothing move, so much is nothing
REST = 1e-2  # of the largest speed of a motion: less is rest
ROUNDING = 4.0  # times the movement that one unit in the last place of all data makes, at random


def main():
    """Solve and judge one structure after the other; a line of the file each."""
    task = json.loads(sys.argv[1])
    warnings.simplefilter("ignore")
    with open(task["file"], "a", encoding="utf-8") as file:
        for number in range(task["first"], task["last"]):
            signal.setitimer(
                signal.ITIMER_PROF, task["timeout"]
            )  # of the processor; ends the process, whatever it is at
            drawn = draw(task["seed"], number, task["family"])
            outcome = {"number": number, "family": drawn.family, "topology": drawn.topology}
            outcome |= judge(drawn, task["options"])
            file.write(json.dumps(outcome) + "\n")
            file.flush()
    signal.setitimer(signal.ITIMER_PROF, 0)


def judge(drawn, options):
    """Solve a structure; compare with the truth.

    Parameters
    ----------
    drawn : drawn.Drawn
    options : dict

    Returns
    -------
    dict
        verdict, reason, iterations, u and tension (relative errors, where they are).
    """
    try:
        if drawn.steps:
            return _judge_motion(drawn, move(drawn.scene, drawn.steps, options=options, every=1))
        result = solve(drawn.scene, (OPTIONS if drawn.family in LARGE else {}) | options)
    except Exception as error:
        text = latinpc.error_message(error)
        return {"verdict": _refused(drawn, text), "reason": " ".join(text.split())[:300], "iterations": 0}
    told = {"reason": "; ".join([result.report["reason"], *result.notices])[:300]}
    told["iterations"] = int(result.report["iterations"])
    if not result.converged:
        return told | {"verdict": _refused(drawn, told["reason"])}
    return told | _judge_statics(drawn, result.displacements, result.tensions)


def _refused(drawn, reason):
    """Say whether a refusal is right: a motion of masses always has its next step; with friction it may be unknown.

    One that says that there is no equilibrium, where there is, is wrong.
    """
    if drawn.steps:
        return "unsolved"
    if drawn.family in LARGE:
        return refused_large(drawn.scene, reason)
    if ("mechanism" in reason or "no link reaches" in reason) and _mechanism(drawn.scene):
        return "refused"
    missed = "wrong" if any(text.startswith("no equilibrium") for text in reason.split("; ")) else "unsolved"
    if (drawn.scene.law == Law.FRICTION).any():
        signal.setitimer(signal.ITIMER_PROF, 0)  # the search ends, if late
        exists = solve_rubbing(drawn.scene).exists
        return {"yes": missed, "no": "refused"}.get(exists, exists)
    return missed if solve_exactly(drawn.scene).exists else "refused"


def _mechanism(scene):
    """Return whether nodes can move without any link changing its length."""
    free = ~scene.fixed.ravel()
    b = np.zeros((len(scene.links), len(scene.nodes), scene.dim))
    b[np.arange(len(scene.links)), scene.links[:, 1]] += scene.directions
    b[np.arange(len(scene.links)), scene.links[:, 0]] -= scene.directions
    return np.linalg.matrix_rank(b.reshape(len(scene.links), -1)[:, free]) < np.count_nonzero(free)


def _judge_statics(drawn, u, tensions):
    scene = drawn.scene
    if drawn.family in LARGE:
        return judge_large(scene, u)
    if not np.isfinite(u).all():
        return {"verdict": "wrong"}
    if (scene.law == Law.FRICTION).any():
        return _judge_rubbing(scene, u, tensions)
    exact = solve_exactly(scene, u, unique=True)
    if not exact.exists:
        hidden = exact.missing <= ROUNDING * _unbalance(scene, u)
        return {"verdict": "rounding" if hidden else "wrong", "why": "no equilibrium exists"}
    errors = _errors(scene, u, tensions, exact)
    if max(errors.values()) <= SLACK * ASKED:
        return errors | {"verdict": "right"}
    moved = _errors(scene, *_rounded(scene), exact)
    hidden = all(errors[key] <= max(SLACK * ASKED, ROUNDING * moved[key]) for key in errors)
    return errors | {"verdict": "rounding" if hidden else "wrong"}


def _judge_rubbing(scene, u, tensions):
    """Equilibria with friction are many as a rule: right is what meets the conditions of one, or is next to one."""
    if impossible(scene):
        return {"verdict": "wrong", "why": "no equilibrium exists"}
    errors = {"u": missed(scene, u, tensions)}
    exact = near(scene, u, tensions) if errors["u"] > SLACK * ASKED else None
    if exact is not None:
        nothing = _rounding(scene, exact.displacements)
        errors = {"u": _far(u, exact.displacements, 0.0), "tension": _far(tensions, exact.tensions, nothing)}
    return errors | {"verdict": "right" if max(errors.values()) <= SLACK * ASKED else "wrong"}


def _errors(scene, u, tensions, exact):
    """Relative l2 errors of tensions but for rigid links, beside all tensions, and of displacements where unique."""
    free, elastic = ~scene.fixed, ~np.isin(scene.law, (Law.INEXTENSIBLE, Law.CONTACT))
    errors = {}
    if exact.unique:
        stiffness = np.median(scene.stiffness[elastic]) if elastic.any() else np.inf
        nothing = max(EPSILON * np.abs(scene.nodes).max(), STUCK * np.abs(scene.load).max() / stiffness)
        errors["u"] = _far(u[free], exact.displacements[free], nothing)
    nothing = _rounding(scene, exact.displacements)
    errors["tension"] = _far(tensions[elastic], exact.tensions[elastic], nothing, np.linalg.norm(exact.tensions))
    return errors


def _rounding(scene, u):
    """Return the tension that rounding of coordinates and of what is added up leaves in a link, N."""
    moved = np.abs(scene.initial_elongation).max() + np.abs(u).max()
    coordinates = EPSILON * scene.stiffness.max() * np.ptp(scene.nodes)
    return max(coordinates, STUCK * (scene.stiffness.max() * moved + np.abs(scene.load).max()))


def _far(found, known, nothing, size=None):
    """Distance relative to `size`, or to what is known; where both are rounding of what is added up, none."""
    size, far = np.linalg.norm(known) if size is None else size, np.linalg.norm(found - known)
    if far <= 16 * nothing * max(len(found), 1) ** 0.5:
        return 0.0
    return float(far / size) if size > 0 else np.inf


def _unbalance(scene, u):
    """Return the largest force at a node that displacements leave when they are rounded to doubles, N."""
    ends = np.abs(scene.directions) * np.abs(u[scene.links]).sum(axis=1)
    off = EPSILON * scene.stiffness * (np.abs(scene.initial_elongation) + ends.sum(axis=1))
    return np.sqrt(np.bincount(scene.links.ravel(), np.repeat(off**2, 2), len(u)).max())


def _rounded(scene):
    """Displacements and tensions of the structure whose numbers are all off by a unit in the last place."""
    from dataclasses import replace

    rng = np.random.default_rng(0)
    off = {
        name: getattr(scene, name) * (1 + EPSILON * rng.choice([-1, 1], getattr(scene, name).shape))
        for name in ("nodes", "stiffness", "initial_elongation", "load")
    }
    exact = solve_exactly(replace(scene, **off))
    if not exact.exists:
        return np.full(scene.nodes.shape, 1e300), np.full(len(scene.links), 1e300)
    return exact.displacements, exact.tensions


def _judge_motion(drawn, motion):
    told = {"reason": "; ".join([motion.report["reason"], *motion.notices])[:300]}
    told["iterations"] = max(motion.report["iterations"], default=0)
    if not motion.converged:
        return told | {"verdict": _refused(drawn, told["reason"])}
    u = np.array([frame.displacements for frame in motion.frames])
    v = np.array([frame.velocities for frame in motion.frames])
    error, _ = motion_error(Case("drawn", "motion", lambda: drawn.scene, steps=drawn.steps), drawn.scene, u, v, REST)
    return told | {"u": error, "verdict": "right" if error <= SLACK * ASKED else "wrong"}


if __name__ == "__main__":
    main()
