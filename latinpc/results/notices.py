"""What a user should know of a result: warnings, the error of a solve, and sentences on what looks wrong."""

from __future__ import annotations

import contextlib
import inspect
import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from latinpc import accuracy, errors, solvers
from latinpc.geometry import extent
from latinpc.laws import Law
from latinpc.library import _latin

from . import rubbing
from .loose import idle_links
from .mechanics import changes_of_length, keeps_direction, tensions_at
from .units import ALIKE, quantity

if TYPE_CHECKING:
    from latinpc.structure import Structure

    from .result import Result

__all__ = [
    "ConvergenceWarning",
    "LatinWarning",
    "SolveError",
    "causes",
    "changed",
    "coincident",
    "duplicates",
    "errors_as_given",
    "implausible",
    "limit",
    "magnitudes",
    "one_step",
    "overstretched",
    "turned",
    "unlinked_as_value",
    "warn",
]

UNBALANCED = 1e-2  # of the loads: what a solve may leave by default (-snes_latin_balance)
TURNED, MOVED = 5.0, 0.1  # degrees, part of the size of the structure: the most that small displacements are taken for
CHANGED = 0.3  # of the tensions as drawn: the most by which geometry prestress lets those of displaced links differ
STRAINED = 0.2  # the largest strain that a constant stiffness is taken for
HELD = 0.1  # of the energy of displacements, borne by tensions as drawn: prestress holds a structure beyond it
RIGID_WHERE_LARGE = (Law.INEXTENSIBLE, Law.CONTACT)
CONTRAST = 1e10  # of stiffnesses: beyond it fewer than six digits are left of the softest links beside the stiffest
_NAMED = 5
_DRAWN = {
    "mechanism": "the structure as drawn is a mechanism that no prestress holds: tighten links, prescribe more"
    " displacements or add links",
    "unstable": "the structure as drawn is unstable: its prestress makes it buckle",
    "soft": "no stable equilibrium was found under 1e-8 of the loads, the least increment: they are far too large"
    " (apply a part of them), or prestress does not hold the structure",
}
_NOWHERE = (
    "no stable equilibrium has been found near the drawing: look at prestress and initial elongations that are not in"
    " balance there, and at bars that should be cables"
)
DTOL = PETSc.SNES.ConvergedReason.DIVERGED_DTOL


class LatinWarning(UserWarning):
    """Something about a structure, its options or its result looks wrong."""


class ConvergenceWarning(LatinWarning):
    """A solve has not converged."""


class SolveError(RuntimeError):
    """A structure that cannot be solved, or a solve that has not converged and was to raise."""

    result: Result | None = None  #: the last iterate, None where there is none

    def __init__(self, said: str, ierr: int = 0) -> None:
        super().__init__(said)
        self.ierr = ierr  #: PETSc's code of the error, 0 where there is none


def warn(comm: PETSc.Comm, text: str, category: type[Warning] = LatinWarning) -> None:
    """Warn of the line that calls this package; rank 0 prints, and a filter that makes errors does on every rank."""
    level, frame = 1, inspect.currentframe()
    while frame is not None and frame.f_globals.get("__name__", "").startswith("latinpc."):
        level, frame = level + 1, frame.f_back
    with contextlib.nullcontext() if comm.rank == 0 else warnings.catch_warnings(record=True):
        warnings.warn(text, category, stacklevel=level)


def causes(snes: PETSc.SNES, structure: Structure, past: dict) -> list[str]:
    """Return sentences on how a solve has ended, where its solver or the links show why; collective."""
    notices, reason = [], snes.getConvergedReason()
    none, ends = _no_equilibrium(snes, structure) if snes.getType() == "latin" and reason < 0 else (False, [])
    least = accuracy.rounding_floor(snes) if reason == PETSc.SNES.ConvergedReason.DIVERGED_INNER else 0.0
    if least >= 1.0:
        notices.append(
            "rounding hides what the loads do: they are too small beside the tensions as drawn, or a part of the"
            " structure is a mechanism, or nearly one"
        )
    elif least and not none and len(past.get("estimate", ())):
        notices.append(f"the requested error is below the rounding error of this structure, about {least:.0e}")
    if snes.getType() == "latin" and structure.geometry != "large" and _given_up(snes):
        notices.append(
            f"given up after {snes.getIterationNumber():,} stages, where Newton's method had failed: usually there is"
            " no equilibrium, and a larger -snes_max_it changes nothing"
        )
    if snes.getType() == "latin" and reason < 0:
        notices += ends if none else [*ends, *_contrast(structure)]
    return notices + one_step(snes, structure)


def one_step(snes: PETSc.SNES, structure: Structure) -> list[str]:
    """Return a sentence on a solver that makes one linear step, where links may slacken."""
    if not snes.getType().startswith("ksp") or (structure.law == Law.BAR).all():
        return []
    return [
        f"{snes.getType()} makes one linear step: it does not follow cables and compression-only links that slacken"
    ]


def _given_up(snes):
    """Return whether a solve has ended before the stages that are allowed, as if they had not been enough."""
    ended = snes.getConvergedReason() == PETSc.SNES.ConvergedReason.DIVERGED_MAX_IT
    return ended and snes.getIterationNumber() < snes.getTolerances()[3]


def _no_equilibrium(snes, structure):
    """Return whether it is known that there is no equilibrium, and sentences on it."""
    (jammed, links), (unsupported, nodes, distance) = _latin.jammed_links(snes), _latin.unsupported_nodes(snes)
    named, one = structure.some_nodes(nodes, unsupported > len(nodes)), unsupported == 1
    if structure.geometry == "large":  # where not all of the loads are borne `limit` says so
        ends = snes.getConvergedReason() == DTOL and solvers.path(snes)["borne"] == 1.0
        cables, contacts = (structure.over_ranks.largest((structure.law == law).any()) for law in RIGID_WHERE_LARGE)
        rigid = "lengths of inextensible cables" if cables else "gaps of contacts"
        return ends, [f"no equilibrium: the {rigid} are incompatible"] if ends and (cables or contacts) else []
    rubs = structure.comm.tompi4py().allreduce(bool((structure.law == Law.FRICTION).any()), op=MPI.LOR)
    ends = unsupported and np.isinf(distance)
    if rubs and not jammed and not ends:
        jammed, links = rubbing.jammed(structure)
    if jammed:
        rigid = structure.some_links(links, jammed > len(links))
        return True, [f"no equilibrium: the gaps of the rigid {rigid} are incompatible"]
    loose = idle_links(structure)
    asks = rubs and not ends and snes.getConvergedReason() == DTOL and not (unsupported and rubbing.rough(structure))
    if moved := rubbing.sliding(snes, structure) if asks else []:
        ends, named = True, structure.some_nodes(moved[:_NAMED], len(moved) > _NAMED)
    if ends:
        held = "neither links nor friction hold" if rubs else f"{loose} no longer hold"
        return True, [f"no equilibrium: {held} {named}"]
    if unsupported and rubs:
        they, them = ("it slides or falls", "it") if one else ("they slide or fall", "them")
        text = f"{they}, or it has not been found how friction holds {them}: no theorem says that it is"
        return False, [f"contacts that bear do not hold {named}: {text}"]
    if unsupported:
        its, it = ("its load is", "it") if one else ("their loads are", "them")
        text = f"{its} small beside the stiffness of the links that stop {it}, or there is no equilibrium"
        return False, [f"{loose} do not hold {named} yet: {text}"]
    return False, ["contacts with friction: neither an equilibrium nor convergence is certain"] if rubs else []


def _contrast(structure):
    elastic = structure.stiffness[structure.stiffness > 0.0]
    ends = np.array([elastic.max(initial=0.0), -elastic.min(initial=np.inf)])
    contrast, eps = -np.divide(*structure.over_ranks.largest(ends)), np.finfo(PETSc.RealType).eps
    if contrast < CONTRAST:
        return []
    left = (
        f"{eps * contrast:.0e} of those of the softest ones"
        if eps * contrast < 1.0
        else "as large as those of the softest"
    )
    return [f"stiffnesses differ by a factor of {contrast:.0e}: rounding of the forces of the stiffest links is {left}"]


def duplicates(structure: Structure) -> list[str]:
    """Return a sentence on links of the same two nodes, law and direction, if there are any; not collective."""
    low, high = structure.links.min(axis=1), structure.links.max(axis=1)
    key = (low * len(structure.nodes) + high) * (int(structure.law.max()) + 1) + structure.law
    order = np.argsort(key, kind="stable")
    again = np.flatnonzero(key[order[1:]] == key[order[:-1]])
    pairs = np.column_stack([order[again], order[again + 1]])
    if structure.direction is not None and len(pairs):  # bars across a cable, parts of a contact
        pairs = pairs[_parallel(structure, pairs)]
    if not len(pairs):
        return []
    names = [[structure.link_name(link) for link in pair] for pair in pairs[:_NAMED]]
    named = ", ".join(f"{a} and {b}" if a != b else f"{a} twice" for a, b in names)
    more = f", and {len(pairs) - _NAMED} more" if len(pairs) > _NAMED else ""
    return [f"links join the same two nodes by the same law: {named}{more}; what they carry adds up"]


def coincident(structure: Structure) -> list[str]:
    """Return a sentence on nodes at one place that no link there joins, if any of them is free; not collective."""
    nodes = structure.nodes
    if nodes.shape[1] == 1:  # chains beside each other
        return []
    order = np.lexsort(nodes.T)
    again = np.flatnonzero((nodes[order[1:]] == nodes[order[:-1]]).all(axis=1))
    pairs = np.column_stack([order[again], order[again + 1]])
    joined = structure.links[structure.lengths == 0.0]
    pairs = pairs[~np.isin(pairs, joined).all(axis=1) & ~structure.fixed[pairs].all(axis=(1, 2))]
    if not len(pairs):
        return []
    named = ", ".join(" and ".join(map(structure.node_name, pair)) for pair in pairs[:_NAMED])
    more = f", and {len(pairs) - _NAMED} more" if len(pairs) > _NAMED else ""
    return [
        f"nodes lie at one place and no link joins them: {named}{more}; make them one node if they move together"
        " (--merge)"
    ]


def _parallel(structure, pairs):
    first, second = (structure.vectors[column] for column in pairs.T)
    along = np.abs(np.einsum("ij,ij->i", first, second))
    return along > (1 - 1e-9) * np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1)


@contextlib.contextmanager
def errors_as_given(structure: Structure) -> Iterator[None]:
    """Raise errors of the library that name nodes or links as `SolveError`, by the names of a file if there is one."""
    try:
        yield
    except PETSc.Error as error:
        if structure.numbering is None:
            raise errors.of_library(error) from None
        raise SolveError(structure.counted_as_given(errors.error_message(error)), error.ierr) from None


@contextlib.contextmanager
def unlinked_as_value(structure: Structure) -> Iterator[None]:
    """Raise the error of the library on a free node that no link reaches as a ValueError of one sentence."""
    try:
        yield
    except PETSc.Error as error:
        if error.ierr != errors.ARG_WRONGSTATE:
            raise
        raise ValueError(structure.counted_as_given(errors.error_message(error))) from None


def turned(result: Result) -> list[str]:
    """Return a sentence where links turn, or their nodes move, further than small displacements allow.

    Of parts collective. Of links that turn: contacts and links of a direction of their own keep it with large
    displacements. Where the latter join the same two nodes, as springs across a taut cable, they are how it resists
    turning, which large displacements would count twice; of parts, those of one rank.
    """
    structure, displacements, over = result.structure, result.displacements, result.structure.over_ranks
    keeps, ends = keeps_direction(structure), np.sort(structure.links, axis=1) @ (len(structure.nodes), 1)
    links = structure.links[~keeps & ~np.isin(ends, ends[keeps & (structure.law != Law.CONTACT)])]
    if structure.geometry == "large" or not result.converged:
        return []
    drawn = np.diff(structure.nodes[links], axis=1)[:, 0]
    moved = drawn + np.diff(displacements[links], axis=1)[:, 0]
    lengths = np.linalg.norm(drawn, axis=1) * np.linalg.norm(moved, axis=1)
    cosine = np.einsum("ij,ij->i", drawn, moved)[lengths > 0.0] / lengths[lengths > 0.0]
    angle = over.largest(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)).max(initial=0.0)))
    size = np.linalg.norm(extent(structure)) or np.inf
    part = over.largest(np.linalg.norm(displacements[np.unique(links)], axis=1).max(initial=0.0)) / size
    if angle <= TURNED and part <= MOVED:
        return []
    said = []
    if angle > TURNED:
        said.append(f"links turn by up to {angle:.2g} degrees")
    if part > MOVED:
        said.append(f"nodes move by {part:.2g} of the size of the structure")
    friction = over.largest((structure.law == Law.FRICTION).any())  # of small displacements only
    cure = "" if friction else "; take -snes_latin_geometry large"
    return [f"{' and '.join(said)}: small displacements do not hold{cure}"]


def strained(result: Result) -> list[str]:
    """Return a sentence where large displacements strain links of constant stiffness too far; of parts collective."""
    structure, over = result.structure, result.structure.over_ranks
    if structure.geometry != "large" or not result.converged:
        return []
    natural = structure.lengths - structure.initial_elongation
    elastic = (structure.law <= Law.CABLE) & ~keeps_direction(structure)
    elastic &= structure.initial_elongation <= STRAINED * natural  # not springs of a force density
    elongation = result.tensions[elastic] / structure.stiffness[elastic]
    strain = over.largest(np.abs(elongation / natural[elastic]).max(initial=0.0))
    if strain <= STRAINED:
        return []
    return [
        f"strains reach {100.0 * strain:.3g} %, at a constant stiffness: are the loads in N and the stiffnesses in N/m?"
        " Materials that stretch so far have laws of their own (latinpc.register_table)"
    ]


def implausible(structure: Structure) -> list[str]:
    """Return sentences on initial elongations and areas beyond the lengths of links; of parts collective."""
    return overstretched(structure) + _thick(structure)


def overstretched(structure: Structure) -> list[str]:
    """Return a sentence on links whose length without tension would be below zero, if any; of parts collective."""
    gaps = (Law.CONTACT, Law.FRICTION, Law.TANGENT, Law.COMPRESSION_ONLY)
    acts = ~(keeps_direction(structure) | np.isin(structure.law, gaps))
    longest = structure.lengths * (
        1.0 + np.sqrt(np.finfo(float).eps)
    )  # of a given force density: zero, but for rounding
    links = np.flatnonzero(acts & (structure.initial_elongation > longest))
    links = structure.over_ranks.link_numbers(links, _NAMED + 1)
    if not len(links):
        return []
    named, one = structure.some_links(links[:_NAMED], len(links) > _NAMED), len(links) == 1
    return [
        f"the initial elongation{'' if one else 's'} of {named} {'is' if one else 'are'} larger than"
        f" {'it is' if one else 'these are'} long: a prestress is at most the stiffness,"
        " EA / length, times the length; if stiffness was given as EA, give it as EA"
    ]


def _thick(structure: Structure) -> list[str]:
    """Return a sentence on links that are thicker than long, if there are any; of parts collective."""
    if structure.area is None:
        return []
    over = structure.over_ranks
    links = np.flatnonzero((structure.lengths > 0.0) & (np.sqrt(structure.area) > structure.lengths))
    largest = over.largest(structure.area[links].max(initial=0.0))
    links = over.link_numbers(links, _NAMED + 1)
    if not len(links):
        return []
    named, one = structure.some_links(links[:_NAMED], len(links) > _NAMED), len(links) == 1
    return [
        f"{named} {'is' if one else 'are'} thicker than long, with an area of up to"
        f" {largest:.3g} m2: areas are in m2, 1 mm2 = 1e-6 m2"
    ]


def changed(result: Result) -> list[str]:
    """Return a sentence where tensions are no longer those with which geometry prestress resists turning.

    Of parts collective. Ten structures that prestress holds (saddles, a hypar, a flat and a random net, mast, tower,
    bridge, simplex, canopy) under twelve loads each: this, or `turned`, names all whose displacements are off by more
    than 14 % from those of geometry large, and none that are off by less than 5 %. Trusses that hold without prestress
    are off by 1 % where their tensions are 15 times those as drawn; so this asks whether prestress holds the structure.
    It does where there are no more links than free components: a self-stress then leaves a mechanism (Maxwell's rule).
    With more links there may be one as well, as in small nets: then it is in the displacements, as energy of turning.
    """
    structure, displacements, over = result.structure, result.displacements, result.structure.over_ranks
    if structure.geometry != "prestress" or not result.converged:
        return []
    drawn = tensions_at(structure, np.zeros(len(structure.links)))
    now = tensions_at(structure, changes_of_length(structure, displacements))
    size, change = np.sqrt(over.total(np.array([drawn @ drawn, (now - drawn) @ (now - drawn)])))
    part = change / size if size > 0.0 else 0.0
    moving = np.count_nonzero(~structure.fixed.all(axis=1)[structure.links].all(axis=1))
    holds = over.total(moving - np.count_nonzero(~structure.fixed[: over.own])) > 0
    if part <= CHANGED or (holds and _turning(structure, drawn, displacements) <= HELD):
        return []
    return [
        f"tensions of the displaced links differ from those as drawn by {100 * part:.2g} %, and geometry prestress"
        " resists turning by those as drawn: take -snes_latin_geometry large"
    ]


def _turning(structure, drawn, displacements):
    """Return the part of the energy of displacements with which tensions as drawn resist turning."""
    change = np.diff(displacements[structure.links], axis=1)[:, 0]
    along = np.einsum("ij,ij->i", structure.directions, change)
    turns = np.abs(drawn) / structure.lengths @ ((change**2).sum(axis=1) - along**2)
    stretches, turns = structure.over_ranks.total(np.array([structure.stiffness @ along**2, turns]))
    return turns / ((stretches + turns) or 1.0)


def limit(structure: Structure, report: Mapping[str, Any], nodes: Sequence[int], kind: str) -> list[str]:
    """Return a sentence where a path of equilibria ends before the loads; not collective.

    Parameters
    ----------
    structure : Structure
    report : mapping
        Of its solve: ``reason``, ``load_factor`` if there is one, and ``branch``, whether a stable branch begins there.
    nodes : sequence of int
        That move most; none where that is not known.
    kind : {"mechanism", "unstable", "soft"}
        Of their motion, as `latinpc.results.limit.softest` says.
    """
    factor = report.get("load_factor")
    told = report["reason"] == "DIVERGED_DTOL" or kind != "soft"  # the iteration may stay where the structure is drawn
    if factor is None or factor >= 1.0:
        return []
    if not told:
        return [f"the solve ended before the whole loads: displacements are those of {max(factor, 0.0):.4g} of them"]
    named = structure.node_names(nodes[:_NAMED], len(nodes) > _NAMED)
    if factor <= 0.0:  # the configuration as drawn is held by forces that are none of the loads
        return [f"{_DRAWN[kind]}; nodes that move: {named}" if named else _NOWHERE]
    if report.get("branch"):
        text = (
            f"the structure buckles at {factor:.4g} of the loads, to one side or the other, and may bear more there:"
            " a small load or imperfection along the mode leads on"
        )
    else:
        text = (
            f"no stable equilibrium follows that of {factor:.4g} of the loads: the structure buckles, or snaps through"
        )
    moved = f"; nodes that move most in its mode: {named}" if named else ""
    return [f"{text}. Displacements are those of this part of the loads{moved}"]


def magnitudes(result: Result) -> list[str]:
    """Return sentences on displacements beyond the structure, and reactions beside the loads; of parts collective."""
    over = result.structure.over_ranks
    moved = np.linalg.norm(result.displacements[: over.own], axis=1)
    strange = over.largest(not (np.isfinite(moved).all() and np.isfinite(result.tensions).all()))
    if strange or not result.converged:
        return []
    notices = []
    size, most = float(np.linalg.norm(extent(result.structure))), over.largest(moved.max(initial=0.0))
    if most > size > 0:
        node = over.node_numbers(np.flatnonzero(moved >= (1.0 - ALIKE) * most), 1)[0]
        notices.append(
            f"node {result.structure.node_name(node)} moves by {quantity(most, 'm')}, farther than the structure"
            f" is large ({quantity(size, 'm')}): look at units, stiffnesses and supports"
        )
    left = max(result.balance.force, result.balance.moment)
    if left > UNBALANCED:
        cure = ": take a smaller error, or no preset"
        if result.report["solver"].startswith("ksp"):  # of which `one_step` says more where links slacken
            cure = "" if over.largest((result.structure.law != Law.BAR).any()) else ": take a smaller -ksp_rtol"
        notices.append(f"reactions do not balance the loads, by {100 * left:.2g} % of them{cure}")
    return notices
