"""The local stage (23), (24): laws and interface conditions met, and the distance that measures convergence."""

from dataclasses import replace

import numpy as np
import oracle
import pytest
from support import PLAIN, VARIANTS, chain, far, grid, irregular, lattice, network, settled, solve, unbalance

from latinpc.scenes import Law

SCENES = {
    "grid": grid,
    "irregular": irregular,
    "network": network,
    "lattice": lattice,
    "settled": lambda: settled(network(), size=3e-5),
}


def struts(scene):
    """The mirror image: struts for cables, everything the other way round."""
    law = np.where(scene.law == Law.CABLE, Law.COMPRESSION_ONLY, scene.law)
    return replace(
        scene, law=law, initial_elongation=-scene.initial_elongation, load=-scene.load, prescribed=-scene.prescribed
    )


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("name", SCENES)
def test_converged_solution_meets_everything(name, variant):
    """Balance at every node, laws in every link, the same displacement for all copies of a node."""
    scene = SCENES[name]()
    first = solve(scene, variant=variant, stol=1e-11, max_it=3000)
    assert first.reason > 0
    assert unbalance(scene, first.u) < 1e-8
    b, e_d = oracle.kinematics(scene)
    elongation = b @ np.where(scene.fixed, 0.0, first.u).ravel() + e_d
    assert first.tensions == pytest.approx(oracle.tension(scene, elongation), rel=1e-9, abs=1e-9)
    # the error counts every copy of a node: against the mean it is zero only if they agree
    again = solve(scene, _reference=first.u, variant=variant, stol=1e-11, max_it=3000)
    assert again.history.error_l2[-1] < 1e-8
    assert far(first.u, oracle.newton(scene)) < 1e-7


@pytest.mark.parametrize("name", SCENES)
def test_slack_links_carry_exactly_nothing(name):
    """Cables never push, struts never pull, and the slack ones are at zero to the bit; some are slack."""
    scene = SCENES[name]()
    for side, sign in ((scene, 1.0), (struts(scene), -1.0)):
        result = solve(side, stol=1e-8, max_it=3000)
        nonsmooth = sign * result.tensions[scene.law == Law.CABLE]
        assert (nonsmooth >= 0.0).all()
        assert 0 < np.count_nonzero(nonsmooth == 0.0) < len(nonsmooth)
        longest = nonsmooth[nonsmooth > 0.0].min()
        assert longest > 1e-12 * nonsmooth.max()


@pytest.mark.parametrize("name", SCENES)
def test_struts_mirror_cables(name):
    """Iterate by iterate the mirrored structure moves the opposite way."""
    scene = SCENES[name]()
    one, other = (solve(s, max_it=6, stol=0) for s in (scene, struts(scene)))
    assert far(other.u, -one.u) < 1e-11
    assert other.history.indicator == pytest.approx(one.history.indicator, rel=1e-9)


def test_cables_that_stay_taut_are_bars():
    """Under a self-stress that the load cannot use up the cables make the iterates of bars."""
    scene = grid()  # whose self-stress is balanced inside modules, so that no iterate slackens anything either
    strong = replace(scene, initial_elongation=100.0 * scene.initial_elongation)
    for k in (1, 3, 6):
        cables = solve(strong, max_it=k, stol=0, **PLAIN)
        bars = solve(replace(strong, law=np.zeros_like(scene.law)), max_it=k, stol=0, **PLAIN)
        assert far(cables.u, bars.u) < 1e-10


def test_more_load_more_slack():
    """The share of slack cables grows with the load, and is none without."""
    counts = []
    for factor in (0.02, 0.5, 1.0, 1.5):
        scene = grid()
        result = solve(replace(scene, load=factor * scene.load), stol=1e-7, max_it=2000)
        assert result.reason > 0
        counts.append(np.count_nonzero(result.tensions == 0.0))
    assert counts[0] == 0
    assert counts == sorted(counts)
    assert counts[-1] > counts[-2] > counts[1]


@pytest.mark.parametrize("name", SCENES)
def test_indicator_is_the_distance_of_the_two_stages(name):
    """One number for each linear stage, by its definition, the last one below the tolerance that stopped it."""
    scene = SCENES[name]()
    result = solve(scene, stol=1e-4, variant="corner", **PLAIN)
    assert result.reason > 0
    assert len(result.history.indicator) == result.iterations
    theirs = oracle.latin_history(scene, result.iterations).indicator
    assert result.history.indicator == pytest.approx(theirs, rel=1e-8)
    assert result.history.indicator[-1] <= 1e-4 < result.history.indicator[:-1].min()


@pytest.mark.parametrize("outer", ["anderson", "nrichardson"])
def test_slack_links_between_supports(outer):
    """A link that cannot move has nothing to iterate on: supports that come closer slacken it, and that is that."""
    scene = settled(grid())
    between = scene.fixed[scene.links].all(axis=(1, 2))
    result = solve(scene, stol=1e-6, outer_snes_type=outer)
    assert result.reason > 0
    assert np.count_nonzero(result.tensions[between] == 0.0) > 3
    assert far(result.u, oracle.newton(scene)) < 1e-4


def test_two_slack_cables_side_by_side():
    """Coincident slack cables can trade state without moving anything: damped, the plain iteration ends that too."""
    scene = lattice()
    double = np.flatnonzero((scene.law == Law.CABLE) & (solve(scene, stol=1e-8).tensions == 0.0))
    assert len(double)
    parts = {name: getattr(scene, name) for name in ("links", "law", "stiffness", "initial_elongation", "subdomain")}
    parts = {name: np.concatenate([values, values[double]]) for name, values in parts.items()}
    parts["initial_elongation"][len(scene.links) :] *= 0.5
    twice = replace(scene, **parts)
    reference = oracle.newton(twice)
    for options in ({}, {**PLAIN, "outer_snes_linesearch_damping": 0.7}):
        result = solve(twice, stol=1e-6, max_it=500, **options)
        assert result.reason > 0
        assert far(result.u, reference) < 1e-4


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("name", SCENES)
def test_indicator_tells_the_error(name, variant):
    """When it stops the iteration the energy error is of its own order, or of a hundred times it at the worst."""
    scene = SCENES[name]()
    reference = oracle.newton(scene)
    for tolerance in (1e-3, 1e-5):
        result = solve(scene, _reference=reference, variant=variant, stol=tolerance, max_it=3000)
        assert result.reason > 0
        assert result.history.error_energy[-1] < 100 * tolerance


def test_errors_are_measured_over_all_copies():
    """The history of errors is that of the definition, duplicated nodes counted in each subdomain."""
    scene = settled(irregular())
    reference = oracle.newton(scene)
    mine = solve(scene, _reference=reference, max_it=8, stol=0, variant="corner", **PLAIN).history
    theirs = oracle.latin_history(scene, 8, reference=reference)
    assert mine.error_l2 == pytest.approx(theirs.error_l2, rel=1e-9)
    assert mine.error_energy == pytest.approx(theirs.error_energy, rel=1e-9)


def test_no_errors_without_reference():
    """There is nothing to compare with, and nothing is made up."""
    history = solve(chain(), max_it=3, stol=0).history
    assert len(history.error_l2) == len(history.error_energy) == 0
