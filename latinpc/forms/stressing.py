"""Stress links to given forces: the natural lengths to which they are cut, by the method of Levenberg and Marquardt."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from petsc4py import PETSc

from latinpc.results.notices import SolveError
from latinpc.results.units import quantity
from latinpc.solvers import symmetric_factor

from .densities import PREFIX, assembled, gathered
from .settling import elastic, noticed, settle, shortened, unstable

STEPS = 40  # most solves: 3 to 9 are usual
DAMPING = 1e-3  # at the start, of the squares of forces
LESS, MORE = 0.1, 10.0  # times the damping where the forces come nearer to those given, and where not
LEAST, MOST = (
    1e-12,
    1e6,
)  # damping, from which it grows again in time; beyond the latter no change of lengths brings them nearer
SETTLED = 1e-4  # error of the displacements of each step, which become small
STRETCH = 0.1  # strain under a given force, of links without EA


@dataclass
class _State:
    """A structure that has settled."""

    form: Any
    natural_length: np.ndarray
    tensions: np.ndarray  # of all links
    missed: np.ndarray  # the given forces less these, zero of links without


def stressed(form, force, natural_length, density, error):
    """Return the stable form in which links have given forces; collective.

    The links of forces are cut so that they would have them in the start, and the structure settles; if it does not,
    they are softer. Each step changes their lengths by the least squares of what the forces miss, linearised and damped
    [J. J. More 1978]; the damping falls if the forces come nearer to those given. All states are stable.

    Parameters
    ----------
    form : Form
        The start.
    force, natural_length, density : (m,) array of float
        In N, m and N/m: a link has the first of these that is not nan.
    error : float
        Largest unbalanced force of the given forces, relative to the largest force.

    Raises
    ------
    ValueError
        On every rank: links of no length, or compressed by more than EA.
    latinpc.SolveError
        If no form has these forces; the message names the farthest one.
    """
    forced, damping, best, again = np.isfinite(force), DAMPING, None, True
    soft = (
        abs(force) / STRETCH if form.EA is None else np.where(forced, np.fmin(form.EA, abs(force) / STRETCH), form.EA)
    )
    EA, start = soft if form.EA is None else form.EA, form
    cut = _cut(form, force, natural_length, EA)
    for _ in range(STEPS):
        form, result = settle(form, cut, density, EA, SETTLED)
        if best is None and not result.converged and EA is not soft:  # drawn too far off: the links are slack
            form, EA, cut = start, soft, _cut(start, force, natural_length, soft)
            continue
        tensions = np.where(np.isnan(cut), density * form.lengths, elastic(form, cut, EA))
        state = _State(form, cut, tensions, np.where(forced, force - tensions, 0.0))
        form = replace(form, tensions=np.where(forced, force, tensions))
        if form.unbalance <= error and (result.converged or not unstable(form, cut, density, EA)):
            return noticed(form, tensions == 0.0)
        nearer = best is None or np.linalg.norm(state.missed) < np.linalg.norm(best.missed)
        if nearer and (result.converged or best is None):
            best, damping, again = state, max(damping * LESS, LEAST), True
        elif again and result.converged:
            again = False  # one step may lead away: valleys are narrow
        else:
            state, damping, again = best, damping * MORE, True
            if damping > MOST:
                break
        form, cut = _corrected(state, force, EA, damping)
    raise _missed(best, force, result)


def _cut(form, force, natural_length, EA):
    """Return natural lengths with which links of given forces would have them in the form."""
    return np.where(np.isfinite(force), shortened(form.lengths, EA, np.nan_to_num(force)), natural_length)


def _corrected(state, force, EA, damping):
    """Return the start and the natural lengths of the next state; collective."""
    form, cut = state.form, state.natural_length.copy()
    bears = np.isfinite(force) & (state.tensions != 0.0)
    dx, y = _least_squares(state, bears, EA, damping)
    changed = cut * (1.0 + y * cut / np.where(bears, EA * form.lengths, 1.0))
    cut[bears] = np.clip(changed, 0.5 * cut, 2.0 * cut)[bears]
    form = replace(form, nodes=form.nodes + dx)
    slack = np.isfinite(force) & ~bears  # their lengths do not show in any force
    cut[slack] = _cut(form, force, cut, EA)[slack]
    return form, cut


def _least_squares(state, bears, EA, damping):
    """Return the changes of nodes (n, dim) and of forces by lengths (m,) of one step; collective.

    With r the missed forces of the links that bear, k their stiffnesses, N their directions and K the tangent
    stiffness, the minimum of |r - k N^t dx + y|^2 + damping |y|^2 where K dx = N y. y = k l / L dL stands for the
    changes dL of the natural lengths L; with c = 1 / (1 + damping) and the multipliers p of the constraint

        y = c (k N^t dx - r + N^t p),
        (1 - c) N k^2 N^t dx + (K - c N k N^t) p = (1 - c) N k r,
        (K - c N k N^t) dx - c N N^t p = -c N r.
    """
    form, sprung = state.form, np.isnan(state.natural_length)
    length, c = form.lengths, 1.0 / (1.0 + damping)
    ends = form.nodes[form.links]
    n = (ends[:, 1] - ends[:, 0]) / length[:, None]
    along, one = n[:, :, None] * n[:, None, :], np.eye(n.shape[1])
    k = np.where(sprung | (state.tensions == 0.0), 0.0, EA / state.natural_length)
    k_bears, r = np.where(bears, k, 0.0), np.where(bears, state.missed, 0.0)

    def blocks(values):
        return values[:, None, None] * along

    across = one - np.where(sprung, 0.0, 1.0)[:, None, None] * along  # a spring without natural length has all of it
    tangent = blocks(k) + (state.tensions / length)[:, None, None] * across
    both = tangent - c * blocks(k_bears)
    number = np.where(form.fixed, -1, np.cumsum(~form.fixed).reshape(form.fixed.shape) - 1)
    count = int((~form.fixed).sum())
    parts = ((blocks((1.0 - c) * k_bears**2), 0, 0), (both, 0, 1), (both, 1, 0), (blocks(-c * bears), 1, 1))
    entries = [_entries(number, form.links, values, row * count, column * count) for values, row, column in parts]
    right = np.concatenate(
        [_on_nodes(form, n * ((1.0 - c) * k_bears * r)[:, None]), _on_nodes(form, n * (-c * r)[:, None])]
    )
    found = _solved(entries, right, form.comm)
    moves, p = np.zeros(form.nodes.shape), np.zeros(form.nodes.shape)
    moves[~form.fixed], p[~form.fixed] = found[:count], found[count:]
    stretch, other = ((np.diff(values[form.links], axis=1)[:, 0] * n).sum(axis=1) for values in (moves, p))
    return moves, np.where(bears, c * (k * stretch - r + other), 0.0)


def _entries(number, links, blocks, row, column):
    """Return rows, columns and values of a matrix of links, sum of +-blocks on their ends, free components alone."""
    first, second = number[links[:, 0]], number[links[:, 1]]
    found = []
    for a, b, sign in ((first, first, 1.0), (second, second, 1.0), (first, second, -1.0), (second, first, -1.0)):
        rows, columns = np.broadcast_arrays(a[:, :, None], b[:, None, :])
        inside = (rows >= 0) & (columns >= 0)
        found.append((rows[inside] + row, columns[inside] + column, sign * blocks[inside]))
    return [np.concatenate(values) for values in zip(*found)]


def _on_nodes(form, pull):
    """Return N times what links pull, at free components: minus at their first nodes, plus at their second."""
    found = np.zeros(form.nodes.shape)
    np.add.at(found, form.links[:, 0], -pull)
    np.add.at(found, form.links[:, 1], pull)
    return found[~form.fixed]


def _solved(entries, right, comm):
    """Solve a symmetric, indefinite system of these entries; collective.

    Zero if it is singular: each link is then cut by what its own force misses.
    """
    A = assembled(*(np.concatenate(values) for values in zip(*entries)), len(right), comm)
    A.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    ksp = PETSc.KSP().create(comm)
    ksp.setOptionsPrefix(PREFIX)
    ksp.setOperators(A)
    ksp.setType("preonly")
    symmetric_factor(ksp.getPC())
    x, b = A.createVecs()
    b.setArray(right[slice(*b.getOwnershipRange())])
    ksp.solve(b, x)
    found = gathered(x)
    for thing in (ksp, A, x, b):
        thing.destroy()
    return found if np.isfinite(found).all() else np.zeros(len(found))


def _missed(state, force, result):
    """Return the error where no form has the forces: the link that misses its own by most, or why nothing settles."""
    link = int(abs(state.missed).argmax())
    missed, wanted = (quantity(abs(value), "N") for value in (state.missed[link], force[link]))
    more = "less" if abs(state.tensions[link]) < abs(force[link]) else "more"
    said = f"in the nearest one link {link} bears {missed} {more} than its {wanted}"
    if not result.converged:
        said = "; ".join([result.reason, *result.notices])
    lost = SolveError(
        f"form finding: no stable form bears these forces: {said}. Give fewer links a force, other forces or a larger"
        " error, or draw the structure nearer to its form"
    )
    lost.result = result
    return lost
