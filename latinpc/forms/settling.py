"""Let a structure settle: the stable form of natural lengths and force densities, by large displacements."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
from petsc4py import PETSc

from latinpc.laws import Law
from latinpc.results.notices import LatinWarning, SolveError
from latinpc.results.units import quantity
from latinpc.solvers import negative_pivots
from latinpc.structure import Structure

from .densities import PREFIX

SOLVES = 4  # most solves for natural lengths, each from the last form: 1 or 2 are usual
SOFT = 1e-9  # of the largest diagonal entry of a stiffness: negative eigenvalues that are smaller are zero
ROUNDING = 64.0  # times eps, of EA: forces that rounding of lengths makes
PLACES = 4.0  # times eps, of the stiffness times the largest coordinate: the same of coordinates
SHORT = 1e-9  # of the size of a form: links that are shorter have no direction


def settled(form, natural_length, density, error):
    """Return the stable form of links of natural lengths (m) or, where these are nan, densities (N/m); collective.

    Parameters
    ----------
    form : Form
        The start.
    natural_length, density : (m,) array of float
    error : float
        Largest unbalanced force, relative to the largest force.

    Raises
    ------
    ValueError
        On every rank: links of no length, or all slack.
    latinpc.SolveError
        When the solve ends without a stable equilibrium.
    """
    for _ in range(SOLVES):  # balance alone does not say whether a form is stable
        form, result = settle(form, natural_length, density, form.EA, error)
        form, slack, rounding = _borne(form, natural_length, density)
        balanced = form.unbalance <= error or form.largest_unbalance <= rounding
        held = slack.all() or (form.tensions.any() and not unstable(form, natural_length, density, form.EA))
        found = balanced and (result.converged or held)  # slack nodes may lie anywhere
        if found or not result.displacements.any():  # the next solve would be the same
            break
    if not found:
        raise _lost(result, form.unbalance)
    if slack.all():
        raise ValueError("all links are slack, and nothing holds a form: the natural lengths are too long")
    return noticed(form, slack)


def noticed(form, slack):
    """Return the form with a notice of its slack links; not collective."""
    count = int(slack.sum())
    if count:
        form.notices.append(f"{count} link{'s are' if count > 1 else ' is'} slack: longer than the form has room for")
    return form


def settle(form, natural_length, density, EA, error):
    """Return the form in which links of these lengths and densities settle, and the result; collective."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LatinWarning)  # what counts is the balance that is left
        result = _structure(form, natural_length, density, EA).solve(error=error)
    form = replace(form, nodes=form.nodes + result.displacements)
    extended(form.nodes, form.links)
    return form, result


def _structure(form, natural_length, density, EA):
    """Return a structure, drawn as the form; a link of a density is a spring without natural length; collective."""
    sprung = np.isnan(natural_length)
    law = np.where(sprung, Law.BAR, form.law)
    stiffness = np.where(sprung, density, np.nan if EA is None else EA / natural_length)
    elongation = form.lengths - np.where(sprung, 0.0, natural_length)
    more = {"load": form.load, "comm": form.comm, "name": form.name, "geometry": "large"}
    return Structure(form.nodes, form.links, law, stiffness, elongation, form.fixed, **more)


def elastic(form, natural_length, EA):
    """Return the tensions of links of natural lengths, zero where their laws do not bear them; nan of others."""
    tensions = EA / natural_length * (form.lengths - natural_length)
    return np.where(_slack(form.law, tensions), 0.0, tensions)


def _slack(law, tensions):
    return ((law == Law.CABLE) & (tensions <= 0.0)) | ((law == Law.COMPRESSION_ONLY) & (tensions >= 0.0))


def _borne(form, natural_length, density):
    """Return the form with its tensions, which links are slack, and the force that rounding of lengths makes."""
    sprung = np.isnan(natural_length)
    tensions, size, stiffness = density * form.lengths, density * form.lengths, density
    if not sprung.all():
        size, stiffness = np.where(sprung, size, form.EA), np.where(sprung, density, form.EA / natural_length)
        tensions = np.where(sprung, tensions, stiffness * (form.lengths - natural_length))
    rounding = np.finfo(float).eps * (ROUNDING * size + PLACES * stiffness * np.abs(form.nodes).max())
    tensions[~sprung & (np.abs(tensions) <= rounding)] = 0.0
    slack = ~sprung & _slack(form.law, tensions)
    return replace(form, tensions=np.where(slack, 0.0, tensions)), slack, rounding.max()


def unstable(form, natural_length, density, EA):
    """Whether the tangent stiffness has negative eigenvalues; zero ones of slack parts do not count; collective."""
    structure = _structure(form, natural_length, density, EA)
    u = structure.create_vec()
    K = structure.dm.createMat()
    structure.jacobian(u, K)
    K.shift(SOFT * K.getDiagonal().norm(PETSc.NormType.INFINITY))
    count = negative_pivots(K, PREFIX)
    K.destroy()
    u.destroy()
    return count > 0


def _lost(result, unbalance):
    """Return the error of a solve that ends without a form, with what its notices say."""
    left = f"the last one leaves unbalanced forces of {unbalance:.1e} of the largest force, or buckles"
    said = "; ".join([left if result.converged else result.reason, *result.notices])
    lost = SolveError(
        f"form finding: no stable equilibrium of these natural lengths was found: {said}. Draw the structure nearer to"
        " its form, start from the form of force densities, or change the lengths"
    )
    lost.result = result
    return lost


def extended(nodes, links):
    """Refuse a form in which nodes of a link fall together; not collective."""
    length = np.linalg.norm(np.diff(nodes[links], axis=1)[:, 0], axis=1)
    short = np.flatnonzero(length <= SHORT * max(np.ptp(nodes, axis=0).max(), 1e-300))
    if short.size:
        a, b = links[short[0]]
        raise ValueError(
            f"link {short[0]} has no length in the form, one of {short.size}: nodes {a} and {b} fall together; hold"
            " more nodes, or change densities, forces and loads"
        )


def shortened(lengths, EA, tensions):
    """Return the natural lengths L EA / (EA + T) of links of these tensions; not collective.

    Raises
    ------
    ValueError
        For links compressed by more than EA.
    """
    crushed = np.flatnonzero(EA + tensions <= 0.0)
    if crushed.size:
        link = crushed[0]
        raise ValueError(
            f"link {link} bears {quantity(tensions[link], 'N')}, and its EA is {quantity(EA[link], 'N')}: no natural"
            " length becomes so short; give a larger EA"
        )
    return lengths * EA / (EA + tensions)
