"""The iteration as a whole: the solver and the slow implementation of the tests agree to rounding."""

import numpy as np
import oracle
import pytest
from petsc4py import PETSc
from support import (
    ALL_VARIANTS,
    PLAIN,
    ROUNDING,
    VARIANTS,
    chain,
    cut,
    far,
    grid,
    irregular,
    lattice,
    network,
    on_rails,
    oracle_options,
    settled,
    solve,
)

from latinpc.scenes import Law, make

ITERATIONS = 8
SCENES = {
    "regular": grid,
    "regular truss": lambda: grid("truss"),
    "irregular": irregular,
    "network": network,
    "many subdomains": lambda: network(parts=30),
    "settled": lambda: settled(network()),
    "on rails": lambda: on_rails(irregular()),
    "2D": lambda: lattice(nx=12, subdomains=12),
    "2D irregular": lambda: settled(cut(make("lattice", nx=10, ny=6, partition="metis"), 7)),
    "1D": lambda: chain(law=Law.CABLE, load=6.0),
}


def close(mine, theirs, scale=1.0):
    """Equal to rounding, relative to the numbers themselves and to where they started from."""
    return np.allclose(mine, theirs, rtol=ROUNDING, atol=ROUNDING * scale)


@pytest.mark.parametrize("variant", ALL_VARIANTS)
@pytest.mark.parametrize("name", SCENES)
def test_iterates_are_the_oracles(name, variant):
    """Eight plain iterations: displacements, indicator and both errors."""
    scene = SCENES[name]()
    reference = oracle.newton(scene)
    theirs = oracle.latin_history(scene, ITERATIONS, reference=reference, variant=variant)
    for k in range(1, ITERATIONS + 1):
        mine = solve(scene, _reference=reference, max_it=k, stol=0, variant=variant, **PLAIN)
        assert mine.iterations == k
        assert mine.reason == -5
        assert far(mine.u, theirs.iterates[k - 1]) < ROUNDING
    assert mine.statistics["strong_macro_dofs"] == theirs.latin.n_macro
    assert mine.statistics["weak_dofs"] == theirs.latin.n_coarse - theirs.latin.n_macro
    assert mine.statistics["state_size"] == len(theirs.x)
    for quantity in ("indicator", "error_l2", "error_energy"):
        values = getattr(theirs, quantity)
        assert close(getattr(mine.history, quantity), values, max(values))


@pytest.mark.parametrize(
    "options",
    [
        {"direction": "scalar"},
        {"direction": "diagonal"},
        {"direction": "scalar", "direction_value": 3e6},
        {"direction": "diagonal", "direction_value": 0.02},
        {"direction": "block"},
        {"direction": "schur", "direction_value": 0.3},
    ],
)
@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("name", ["regular", "irregular", "settled"])
def test_iterates_for_every_direction(name, variant, options):
    """A number, a diagonal, a matrix or given: the third and the eighth iterate are the oracle's."""
    scene, options = SCENES[name](), {"variant": variant, **options}
    theirs = oracle.latin_history(scene, ITERATIONS, **oracle_options(options)).iterates
    for k in (3, 8):
        assert far(solve(scene, max_it=k, stol=0, **options, **PLAIN).u, theirs[k - 1]) < ROUNDING


def test_iterates_of_many_equal_subdomains():
    """Equal subdomains swept and solved together, or, where the solver is not direct, only swept together."""
    scene = make("tensegrity-grid", modules=40)
    theirs = oracle.latin_history(scene, 3)
    for options in ({}, {"local_ksp_type": "cg", "local_ksp_rtol": 1e-13}):
        mine = solve(scene, max_it=3, stol=0, **options, **PLAIN)
        assert far(mine.u, theirs.iterates[-1]) < 10 * ROUNDING  # more of it: ten times the nodes
        assert np.allclose(mine.history.indicator, theirs.indicator, rtol=10 * ROUNDING)


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("name", SCENES)
def test_acceleration_ends_where_the_plain_iteration_does(name, variant):
    """Anderson's iterates are others, their limit is the displacement of the structure."""
    scene = SCENES[name]()
    reference = oracle.newton(scene)
    result = solve(scene, _reference=reference, variant=variant, stol=1e-11, max_it=3000, newton="never")
    assert result.reason > 0
    assert far(result.u, reference) < 1e-8
    assert result.history.error_l2[-1] < 1e-8


def test_a_leap_of_the_acceleration_is_no_divergence():
    """Steps that are equal but for rounding throw it far away, at two loads in five; the next stages lead back."""
    for load in 6.0 + 0.006 * np.arange(20):
        scene = chain(law=Law.CABLE, load=load)
        result = solve(scene, variant="macro", stol=1e-11, max_it=3000, newton="never")
        assert result.reason != PETSc.SNES.ConvergedReason.DIVERGED_DTOL
        assert far(result.u, oracle.newton(scene)) < 1e-6  # a leap costs digits


@pytest.mark.parametrize("outer", ["anderson", "nrichardson", "ngmres", "qn"])
def test_any_fixed_point_solver(outer):
    """The inner SNES is the user's choice; every one ends at the same displacement."""
    scene = grid()
    result = solve(scene, stol=1e-9, outer_snes_type=outer)
    assert result.reason > 0
    assert far(result.u, oracle.newton(scene)) < 1e-6


def test_acceleration_pays():
    """Fewer linear stages than the plain iteration needs to the same indicator, and depth is an option."""
    scene = grid(modules=12)
    plain, shallow, deep = (
        solve(scene, stol=1e-5, **options).iterations
        for options in (PLAIN, {"outer_snes_anderson_m": 1}, {"outer_snes_anderson_m": 10})
    )
    assert deep < shallow < plain
    assert deep == solve(scene, stol=1e-5).iterations


def test_first_anderson_step_is_a_plain_one():
    """Without memory the two agree; with it they part."""
    scene = grid()
    for k, same in ((1, True), (2, True), (4, False)):
        accelerated, plain = (solve(scene, max_it=k, stol=0, **options).u for options in ({}, PLAIN))
        assert (far(accelerated, plain) < ROUNDING) == same
