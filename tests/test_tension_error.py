"""Estimated errors of a solve: no less than the true ones, those of tensions not much more; they meet what is asked."""

import re
from dataclasses import replace

import numpy as np
import oracle
import pytest
from petsc4py import PETSc
from support import chain, cut, grid, irregular, latin, lattice, network
from test_cli import latinpc as command

import latinpc
from latinpc.runs.solve import solve
from latinpc.scenes import Law, make

double = pytest.mark.skipif(np.finfo(PETSc.RealType).eps > 1e-10, reason="ten digits are those of double precision")
SOLVED = 1e-9  # relative: a true error below it is that of the reference


def varied(number):
    """A grid, lattice or network of any size, partition, slackness and size of loads, and how to solve it."""
    rng = np.random.default_rng(number)
    kind, subdomains = rng.choice(["tensegrity-grid", "truss-grid", "lattice", "network"]), int(rng.integers(2, 12))
    if kind == "network":
        size = int(rng.integers(*((60, 600) if rng.random() < 0.5 else (1200, 2500))))
        scene = make(kind, nodes=size, slack=float(rng.choice([0.0, 0.1, 0.3])), seed=number)
    elif kind == "lattice":
        scene = make(kind, nx=4 * int(rng.integers(1, 6)), ny=4 * int(rng.integers(1, 4)))
    else:
        scene = make(kind, modules=4 * int(rng.integers(1, 8)))
    scene = replace(scene, load=scene.load * 10 ** rng.uniform(-3, 0))
    variant = str(rng.choice(["auto", "none", "macro", "corner", "primal"]))
    return cut(scene, subdomains, number), {
        "snes_latin_variant": variant,
        "snes_latin_error": str(10 ** rng.uniform(-6, -2)),
    }


def over(estimate, true):
    """Estimated over true error; 1 where both are below what the reference shows."""
    return 1.0 if max(true, estimate) <= SOLVED else np.divide(estimate, true)


def ratios(number):
    """Estimated over true error of the tensions and of the displacements."""
    scene, options = varied(number)
    result = solve(scene, options)
    exact = solve(scene, {"snes_latin_error": "1e-11"})
    assert result.converged and exact.converged
    true = [
        np.linalg.norm(getattr(result, name) - getattr(exact, name)) / np.linalg.norm(getattr(exact, name))
        for name in ("tensions", "displacements")
    ]
    assert max(true) <= float(options["snes_latin_error"])
    return over(result.tension_error, true[0]), over(result.estimated_error, true[1])


@double
@pytest.mark.parametrize("count", [24, pytest.param(200, marks=[pytest.mark.slow, pytest.mark.timeout(1800)])])
def test_the_estimates_are_no_less_than_the_errors(count):
    """That of tensions is not much more; that of displacements is of the step before where the last one is exact."""
    tensions, displacements = np.transpose([ratios(number) for number in range(count)])
    assert np.mean((tensions >= 1.0) & (tensions <= 10.0)) >= 0.95, tensions
    assert np.mean(displacements >= 1.0) >= 0.95, displacements


@double
@pytest.mark.parametrize("number", [11, 51, 65, 149])
def test_a_linear_solve_that_has_missed_the_error_claims_no_less(number):
    """One or two iterations that find little: a soft mode, which the preconditioner takes for stiff, has not shown."""
    tensions, displacements = ratios(number)
    assert displacements >= 1.0
    assert tensions >= 0.5


@double
@pytest.mark.parametrize("make_scene", [grid, irregular, network, lattice])
@pytest.mark.parametrize("asked", [1e-5, 1e-8])
def test_what_is_asked_of_the_tensions_is_met(make_scene, asked):
    """A loose error of the displacements does not make the tensions loose."""
    scene = make_scene()
    result = solve(scene, {"snes_latin_error": "1e-2", "snes_latin_tension_error": str(asked)})
    exact = solve(scene, {"snes_latin_error": "1e-11"})
    assert result.converged and 0.0 <= result.tension_error <= asked
    assert np.linalg.norm(result.tensions - exact.tensions) <= asked * np.linalg.norm(exact.tensions)


@double
@pytest.mark.parametrize("asked", [1e-3, 1e-6])
def test_tensions_of_rigid_links_are_asked_for_as_well(asked):
    scene = make("net", side=4)
    result = solve(scene, {"snes_latin_error": "1e-2", "snes_latin_tension_error": str(asked), "snes_max_it": "20000"})
    exact = solve(scene, {"snes_latin_error": "1e-9", "snes_max_it": "100000"})
    assert result.converged and exact.converged and 0.0 <= result.tension_error <= asked
    assert np.linalg.norm(result.tensions - exact.tensions) <= asked * np.linalg.norm(exact.tensions)


@double
@pytest.mark.parametrize("seed", [0, 13, 46, 58, 70, 102])
def test_self_stresses_of_nets_that_do_not_stretch_are_part_of_the_error(seed):
    """Penalties change them slowly: tensions had stayed by more than was asked for, or a hundred times the estimate."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(5, 9))
    i, j = (index.ravel() for index in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    number = np.arange(n * n).reshape(n, n)
    links = [*zip(number[:-1].ravel(), number[1:].ravel()), *zip(number[:, :-1].ravel(), number[:, 1:].ravel())]
    fixed = np.repeat((i % (n - 1) * (j % (n - 1)) == 0)[:, None], 3, axis=1)
    load = np.where(fixed, 0.0, np.array([0.0, 0.0, -5.0]) + rng.normal(size=fixed.shape))
    structure = latinpc.Structure(
        np.column_stack([i, j, 0 * i]).astype(float), links, "inextensible", 0.0, fixed=fixed, load=load,
        initial_elongation=-0.02 * rng.uniform(0.9, 1.1, len(links)), geometry="large", comm=PETSc.COMM_SELF,
    )  # fmt: skip
    found, exact = structure.solve(), structure.solve(error=SOLVED)
    assert found.converged and exact.converged
    errors = [
        np.linalg.norm(getattr(found, name) - getattr(exact, name)) / np.linalg.norm(getattr(exact, name))
        for name in ("tensions", "displacements")
    ]
    assert max(errors) <= 1e-4
    assert errors[0] <= 2.0 * found.tension_error and errors[1] <= 2.0 * found.estimated_error


def test_displacements_alone():
    """What is asked of the tensions may be anything; a small structure is proved without any error left."""
    scene = replace(make("network", nodes=1500), subdomain=None)
    loose, strict = (
        solve(scene, {"snes_latin_error": "1e-3", "snes_latin_tension_error": str(asked)}) for asked in (1e30, 1e-9)
    )
    assert loose.converged and strict.converged
    assert loose.iterations < strict.iterations


@pytest.mark.parametrize("stop", ["indicator", "residual"])
def test_other_stops_estimate_nothing(stop):
    assert solve(grid(), {"snes_latin_stop": stop}).tension_error is None


def test_next_to_a_mechanism_a_correction_shows_the_error():
    """Cables that are just taut leave a chain hardly any stiffness: displacements are right all the same."""
    scene = chain(law=Law.CABLE, load=6.0)
    result = solve(scene, {})
    assert result.converged
    exact = oracle.newton(scene)
    assert np.linalg.norm(result.displacements - exact) <= 3e-4 * np.linalg.norm(exact)


def test_it_is_set_from_c_and_python():
    with latin(grid(), error=1e-2) as run:
        latinpc.set_tension_error(run.snes, 1e-7)
        run.snes.solve(None, run.structure.create_vec())
        assert 0.0 <= latinpc.tension_error(run.snes) <= 1e-7


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf])
def test_what_is_no_error_is_refused(value):
    with latin(grid()) as run, pytest.raises(PETSc.Error):
        latinpc.set_tension_error(run.snes, value)


def test_it_is_printed():
    assert re.search(
        r"error of the displacements [^,]+ %, of the tensions [^,]+ %\n  unbalance +[^,]+ % of the loads, at most",
        command("solve", "tensegrity-grid").stdout,
    )


def test_without_newtons_method_nothing_estimates_it():
    """It had been accepted, and met by none."""
    alone = {"snes_latin_newton": "never", "snes_latin_tension_error": 1e-7}
    with pytest.raises(latinpc.SolveError, match="needs Newton's method.*leave out -snes_latin_newton never"):
        make("network", nodes=100).solve(options=alone)
