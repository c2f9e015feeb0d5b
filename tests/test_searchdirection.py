"""The micro search direction: tuned to the structure by itself, floored, and never a matter of units."""

import re
from dataclasses import replace

import numpy as np
import oracle
import pytest
from petsc4py import PETSc
from support import PLAIN, VARIANTS, far, grid, irregular, latin, lattice, network, oracle_options, solve, statistics

import latinpc
from latinpc.scenes import Scene

DIRECTIONS = ("scalar", "diagonal", "block", "schur")
VALUES = ("direction_min", "direction_mean", "direction_max")


def expected(scene, **options):
    """Smallest, mean and largest direction of the oracle; both sides of an interface have the same."""
    d = np.concatenate([side.d.diagonal() for side in oracle.build(scene, **oracle_options(options)).sides])
    return [d.min(), d.mean(), d.max()]


def values(scene, **options):
    """The same of the solver."""
    found = statistics(scene, **options)
    return [found[name] for name in VALUES]


def crossed(n=6):
    """Two rows of links along x that meet in a column of nodes; only a third subdomain, the column, holds them up."""
    y = np.arange(float(n))
    nodes = np.vstack([np.column_stack([np.full(n, x), y]) for x in (0.0, 1.0, 2.0)])
    left, middle, right = np.arange(n), np.arange(n) + n, np.arange(n) + 2 * n
    along = [np.column_stack(pair) for pair in ((left, middle), (middle, right))]
    links = np.vstack([along[0], along[1], np.column_stack([middle[:-1], middle[1:]])])
    fixed = np.zeros((3 * n, 2), bool)
    fixed[left] = fixed[right] = fixed[middle[[0]]] = True
    part = np.repeat([0, 1, 2], [n, n, n - 1])
    load = np.where(fixed, 0.0, [1.0, -2.0])
    zero = np.zeros(len(links))
    return Scene("crossed", nodes, links, zero.astype(int), 1e3 + zero, zero, fixed, None, load, part)


@pytest.mark.parametrize("direction", DIRECTIONS)
@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("make", [grid, irregular, network, lattice])
def test_self_tuned_direction(make, variant, direction):
    """A fraction of the mean stiffness of the two subdomains, by interface or by degree of freedom."""
    options = {"variant": variant, "direction": direction}
    if direction != "scalar":
        options["direction_value"] = 0.3
    assert values(make(), **options) == pytest.approx(expected(make(), **options), rel=1e-12)


@pytest.mark.slow
def test_large_schur_complements():
    """Subdomains with 128 side dofs and more are condensed by a partial factorisation, to the same matrices."""
    scene = lattice(nx=32, ny=96, subdomains=3)
    options = {"direction": "schur", "direction_value": 0.3}
    assert values(scene, **options) == pytest.approx(expected(scene, **options), rel=1e-12)


def test_fraction_scales_the_direction():
    """Twice the fraction is twice the direction, everywhere."""
    once, twice = (values(network(), direction_value=alpha) for alpha in (0.1, 0.2))
    assert twice == pytest.approx(np.multiply(2, once), rel=1e-13)


def test_given_direction_is_taken_as_it_is():
    """The value of a scalar direction is its stiffness, not a fraction."""
    assert values(network(), direction="scalar", direction_value=12345.0) == pytest.approx([12345.0] * 3)


@pytest.mark.parametrize("direction", DIRECTIONS)
@pytest.mark.parametrize("factor", [2.0**-30, 2.0**20])
def test_stiffness_in_other_units(factor, direction):
    """Stiffnesses, self-stress and loads in other units: directions in proportion, the same iterates."""
    scene, how = irregular(), {"direction": direction}
    other = replace(scene, stiffness=scene.stiffness * factor, load=scene.load * factor)
    assert values(other, **how) == pytest.approx(np.multiply(values(scene, **how), factor), rel=1e-13)
    assert far(solve(other, max_it=5, **how, **PLAIN).u, solve(scene, max_it=5, **how, **PLAIN).u) < 1e-10


@pytest.mark.parametrize("direction", DIRECTIONS)
@pytest.mark.parametrize("make", [grid, irregular, network, lattice])
def test_every_direction_ends_at_the_same_displacement(make, direction):
    """The direction makes the way, not the end: Newton's displacement, and the sides of an interface agree on it."""
    scene = make()
    reference = oracle.newton(scene)
    result = solve(scene, _reference=reference, direction=direction, stol=1e-10, max_it=2000)
    assert result.reason > 0
    assert far(result.u, reference) < 1e-7
    assert result.history.error_l2[-1] < 1e-7


@pytest.mark.parametrize("direction", ["block", "schur"])
@pytest.mark.parametrize("make", [grid, irregular, network])
def test_trap_3_floor_of_the_matrices(monkeypatch, make, direction):
    """Symmetric positive definite, and no softer than a foundation; floppy subdomains without one have no springs."""

    def softest():
        found = []
        for side in oracle.build(make(), direction=direction, value=1.0).sides:
            assert abs(side.d - side.d.T).max() < 1e-8 * side.d.max()
            scale = np.diag(1 / np.sqrt(np.maximum(side.mean, oracle.FLOOR * side.mean.mean())))
            found.append(np.linalg.eigvalsh(scale @ side.d @ scale)[0])
        return min(found)

    floor = oracle.FOUNDATION
    assert softest() > 0.5 * floor
    monkeypatch.setattr(oracle, "FOUNDATION", 1e-6)
    if direction == "schur":
        assert softest() < 1e-2 * floor


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_equal_subdomains_share_whatever_the_direction(capfd, direction):
    """The number of different operators of a regular lattice has a bound, matrices or numbers."""
    counts = []
    for blocks in (8, 10):
        scene = lattice(nx=4 * blocks, ny=4 * blocks, subdomains=blocks**2)
        with latin(scene, direction=direction) as run:
            run.snes.setUp()
            run.snes.view()
            counts.append(int(re.search(r"first rank: (\d+) for", capfd.readouterr().out).group(1)))
    assert counts[0] == counts[1] <= 25


def test_schur_needs_the_fewest_iterations():
    """On blocks and where modules are cut, to 1e-4: the matrix that the subdomain opposes is the best scale."""
    for make, saving in ((grid, 1.0), (irregular, 0.8)):
        scene = make(modules=12)
        reference = oracle.newton(scene)
        how = {"stop": "reference", "stol": 1e-4}
        counts = [solve(scene, _reference=reference, direction=direction, **how).iterations for direction in DIRECTIONS]
        assert counts[-1] <= saving * min(counts[:2])


def test_direction_follows_the_stiffness_of_the_place():
    """A structure whose halves differ by a factor of a million gets directions that differ as much."""
    scene = grid("truss")
    soft = scene.nodes[scene.links].mean(axis=1)[:, 1] < 3.0
    contrast = replace(scene, stiffness=np.where(soft, 1e-6, 1.0) * scene.stiffness)
    low, _, high = values(contrast, variant="corner")
    assert high / low > 1e5
    reference = oracle.newton(contrast)
    tuned = solve(contrast, _reference=reference, stol=1e-8, variant="corner")
    assert tuned.reason > 0
    assert tuned.history.error_l2[-1] < 1e-5
    one = solve(contrast, stol=1e-8, direction="scalar", direction_value=values(scene, variant="corner")[1])
    assert tuned.iterations < one.iterations


@pytest.mark.parametrize("variant", ["none", "macro"])
def test_trap_3_floor_of_the_diagonal(monkeypatch, variant):
    """A dof that no link of two subdomains reaches still gets a spring; without one the bases are not numbers."""
    scene = crossed()
    reference = oracle.newton(scene)
    low, _, high = values(scene, variant=variant)
    assert 0.0 < low < 0.2 * high
    result = solve(scene, _reference=reference, variant=variant, stol=1e-10)
    assert result.reason > 0
    assert result.history.error_l2[-1] < 1e-8
    monkeypatch.setattr(oracle, "FLOOR", 0.0)
    with np.errstate(all="ignore"), pytest.raises(ValueError, match="infs or NaNs"):
        oracle.build(scene, variant=variant, direction="diagonal")


def test_trap_3_floppy_subdomains_need_a_direction_of_their_size():
    """Subdomains with mechanisms: the self-tuned direction converges where one near zero, or a huge one, does not."""
    scene = irregular("truss")
    mechanisms = [len(p.dofs) - np.linalg.matrix_rank(p.b) for p in oracle.build(scene).parts]
    assert max(mechanisms) > 6
    reference, tuned = oracle.newton(scene), values(scene)[1]
    own = solve(scene, _reference=reference, stol=1e-6, max_it=100)
    assert own.reason > 0
    assert own.history.error_l2[-1] < 1e-4
    for factor in (1e-6, 1e6):
        off = {"direction": "scalar", "direction_value": factor * tuned}
        other = solve(scene, _reference=reference, stol=1e-6, max_it=100, **off)
        assert min(other.history.error_l2) > 100 * own.history.error_l2[-1]


def test_the_tuned_direction_lies_in_the_valley():
    """Plain iterations to the same error: neither a sixteenth nor sixteen times the direction needs fewer."""
    scene = grid(modules=12)
    reference = oracle.newton(scene)

    def count(d):
        options = {"direction": "scalar", "direction_value": d, "stop": "reference", "stol": 1e-3, "max_it": 400}
        return solve(scene, _reference=reference, **options, **PLAIN).iterations

    middle = values(scene, direction="scalar")[1]
    assert count(middle) < min(count(middle / 16), count(middle * 16)) / 1.5


@pytest.mark.parametrize("factor", [1e-10, 1e10])
@pytest.mark.parametrize("direction", ["scalar", "diagonal", "block", "schur"])
def test_ends_of_the_range(direction, factor):
    """There the iteration is slow, but no structure looks like a mechanism, and no wrong solution like a right one."""
    scene = grid()
    value = factor
    if direction == "scalar":  # the self-tuned one is 0.08 of the stiffness of the interfaces
        value *= values(scene, variant="corner", direction="scalar")[1] / 0.08
    found = solve(scene, variant="corner", direction=direction, direction_value=value)
    assert found.reason > 0 and far(found.u, oracle.newton(scene)) < 1e-3


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"direction_value": -1.0}, "direction value is -1"),
        # later versions refuse it themselves
        ({"direction_value": "inf"}, "direction value is inf|value inf"),
        ({"direction": "matrix"}, "matrix"),
    ],
)
def test_impossible_directions_are_refused(options, message):
    """The message names the option and what it was given."""
    with pytest.raises(PETSc.Error) as caught:
        statistics(lattice(), **options)
    assert re.search(message, latinpc.error_message(caught.value))


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_rows_of_the_operators_are_sorted(direction):
    """PETSc's formats want each column once, in increasing order: any local solver then works."""
    with latin(network(), direction=direction) as run:
        run.snes.setUp()
        first, columns, _ = latinpc.local_ksp(run.snes).getOperators()[0].getValuesCSR()
        steps = np.diff(columns)
        steps[first[1:-1] - 1] = 1  # from one row to the next
        assert steps.min() > 0
