"""Why a structure with friction has no equilibrium: its gaps contradict each other, or friction lets a motion pass."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from petsc4py import PETSc

from latinpc import solvers
from latinpc.arrays import Slices
from latinpc.errors import raise_cause
from latinpc.laws import UNILATERAL, Law
from latinpc.library import _latin

from .limit import moving
from .mechanics import elongations
from .mechanism import bearing, free_motion

if TYPE_CHECKING:
    from latinpc.structure import Structure

__all__ = ["jammed", "rough", "sliding"]

MOST = 10_000  # links: their solve without friction takes seconds
LITTLE = 1e-8  # coefficient of friction, whose forces are rounding; of more the solver itself finds out
SLIDES = 1e-6  # of the limit of friction: a tangential force that is nearer to it holds nothing
STOPS = 1e-9  # of a motion: elongations that are smaller are rounding


def jammed(structure: Structure) -> tuple[int, list[int]]:
    """Return how many contacts have incompatible gaps, and some of them; collective.

    That is a question of the gaps alone. So friction is left out, and the loads: springs stand for the tangential
    parts, and a convex problem is left, which the solver decides.
    """
    if structure.sizes.links > MOST:
        return 0, []
    law, stiffness = structure.law.copy(), structure.stiffness.copy()
    elastic = (stiffness > 0.0) & ((law <= Law.COMPRESSION_ONLY) | (law >= len(Law)))
    total, count = structure.comm.tompi4py().allreduce(np.array([stiffness[elastic].sum(), elastic.sum()]))
    stiffness[law == Law.TANGENT] = total / count if count else 1.0
    law[law == Law.FRICTION], law[law == Law.TANGENT] = Law.CONTACT, Law.BAR
    same = ("nodes", "links", "initial_elongation", "fixed", "prescribed", "direction")
    given = {name: getattr(structure, name) for name in same}
    alone = type(structure)(law=law, stiffness=stiffness, comm=structure.comm, **given)
    snes, u = alone.create_snes(), alone.create_vec()
    snes.setOptionsPrefix("jammed_")  # not the options of the caller
    try:
        snes.solve(None, u)
        return _latin.jammed_links(snes)
    except PETSc.Error as error:  # then the cause stays unknown
        raise_cause(error)
        return 0, []
    finally:
        snes.destroy()
        u.destroy()


def rough(structure: Structure) -> bool:
    """Return whether all contacts have friction that is more than rounding; collective."""
    smooth = (structure.law == Law.FRICTION) & (structure.friction <= LITTLE)
    return not structure.over_ranks.largest(smooth.any())


def sliding(snes: PETSc.SNES, structure: Structure) -> list[int]:
    """Return nodes that the loads move without end along contacts of little or no friction; collective.

    After a solve whose displacements have grown without end. The motion changes no link that bears, and no slack link
    stops it. Contacts slide in it whose friction is at its limit; the loads do more work than they take. With more
    friction that proves nothing: contacts that are pressed harder against each other may hold.
    """
    tensions, rows = solvers.tensions(snes), np.flatnonzero(structure.law == Law.FRICTION)
    if not isinstance(structure._slices, Slices) or not np.isfinite(tensions).all():
        return []
    parts = rows[:, None] + np.arange(1, structure.dim)
    most = structure.friction[rows] * np.maximum(-tensions[rows], 0.0)
    slides = np.linalg.norm(tensions[parts], axis=1) >= (1.0 - SLIDES) * most
    slides &= structure.friction[rows] <= LITTLE
    bears = bearing(structure, tensions)
    bears[parts[slides]] = False
    motion = free_motion(structure, bears=bears)
    if motion is None:
        return []
    work = float((structure.load * motion).sum())
    motion *= np.sign(work) or 1.0
    change = elongations(structure, motion)
    pulls = np.isin(structure.law, (Law.CABLE, Law.INEXTENSIBLE))
    stopped = np.isin(structure.law, UNILATERAL) & ~bears & (np.where(pulls, change, -change) > STOPS)
    taken = float((most * np.linalg.norm(change[parts], axis=1)).sum())
    if stopped.any() or abs(work) <= taken * (1.0 + SLIDES):
        return []
    return moving(motion).tolist()
