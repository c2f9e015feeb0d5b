"""Factors in single precision: half the memory, and the same solutions."""

from dataclasses import replace

import numpy as np
import oracle
import pytest
from petsc4py import PETSc
from support import far, grid, irregular, latin, lattice, network, solve

import latinpc
from latinpc.options import default_options
from latinpc.scenes import make

SCENES = {"grid": grid, "irregular": irregular, "network": network, "lattice": lattice}
PRIMAL = {"variant": "primal", "precision": "single"}


def in_single(snes):
    """Whether each subdomain has its factor in single precision: four bytes an entry."""
    kinds = []
    for i in range(latinpc.statistics(snes)["subdomains"]):
        info = latinpc.local_ksp(snes, i).getPC().getFactorMatrix().getInfo()
        kinds.append(info["memory"] == 4.0 * info["nz_used"])
    return kinds


def beam(n):
    """A slender truss of n square bays, built in at one end: as soft in bending as n**4."""
    x = np.repeat(np.arange(n + 1.0), 2)
    y = np.tile([0.0, 1.0], n + 1)
    links = []
    for k in range(n):
        a, b, c, d = 2 * k, 2 * k + 1, 2 * k + 2, 2 * k + 3
        links += [[a, c], [b, d], [c, d], [a, d], [b, c]]
    nodes = np.column_stack([x, y])
    fixed = np.zeros(nodes.shape, dtype=bool)
    fixed[:2] = True
    load = np.zeros(nodes.shape)
    load[-1, 1] = -1.0
    return latinpc.scenes.Scene(
        name="beam", nodes=nodes, links=np.array(links), law=np.zeros(len(links), dtype=int),
        stiffness=np.full(len(links), 1e6), fixed=fixed, load=load,
    )  # fmt: skip


@pytest.mark.parametrize("parts", ["its own", "one"])
@pytest.mark.parametrize("name", SCENES)
def test_solutions_are_those_of_double_precision(name, parts):
    """Each stage corrects the one before: what is asked for is reached, far below single precision."""
    scene = SCENES[name]()
    if parts == "one":
        scene.subdomain = np.zeros(len(scene.links), dtype=int)
    with latin(scene, **PRIMAL) as run:
        run.snes.setUp()
        assert all(in_single(run.snes))
    single, double = (solve(scene, variant="primal", precision=p, stol=1e-12) for p in ("single", "double"))
    assert single.reason > 0
    assert far(single.u, double.u) < 1e-9
    assert single.iterations <= double.iterations + 3


def test_what_single_precision_leaves_is_not_called_converged():
    """Bars are solved at once in double precision; the stop asks for one stage more in single, not for a wrong end."""
    scene = grid("truss")
    exact = oracle.newton(scene)
    loose, tight = (solve(scene, stol=stol, **PRIMAL) for stol in (1e-3, 1e-12))
    assert loose.iterations == 1 < tight.iterations <= 4
    assert far(loose.u, exact) < 1e-3
    assert far(tight.u, exact) < 1e-11
    assert solve(scene, stop="error", error=1e-9, **PRIMAL).estimated_error < 1e-9


@pytest.mark.parametrize("bays", [10, 100, 1000])
def test_a_soft_structure_keeps_double_precision(bays):
    """What a solve leaves to the next grows with the softness; where too much is left, the factor is made again."""
    scene = beam(bays)
    with latin(scene, precision="single") as run:
        run.snes.setUp()
        single = all(in_single(run.snes))
    assert single == (bays < 1000)
    result = solve(scene, precision="single", stol=1e-10)
    assert result.reason > 0
    assert far(result.u, solve(scene, precision="double", stol=1e-10).u) < (1e-7 if bays < 1000 else 1e-14)


@pytest.mark.parametrize("bays", [10, 1000])
def test_interfaces_of_a_soft_structure(bays):
    """The same where single precision leaves its mark on the coarse problem: what a whole stage leaves decides."""
    scene = beam(bays)
    scene.subdomain = np.arange(len(scene.links)) * 3 // len(scene.links)
    with latin(scene, **PRIMAL) as run:
        run.snes.setUp()
        assert in_single(run.snes) == [bays < 1000] * 3
    single, double = (solve(scene, variant="primal", precision=p, stol=1e-10) for p in ("single", "double"))
    assert single.reason > 0
    assert far(single.u, double.u) < (1e-7 if bays < 1000 else 1e-14)


def test_a_plane_structure_is_factored_once():
    """It is no solid because its interfaces, kept to the last, are as many as the rows of a solid's separator."""
    scene = make("tensegrity-grid", modules=60)
    scene.subdomain = np.where(scene.nodes[scene.links[:, 0], 0] < 40.0, 0, 1)
    PETSc.Log.begin()
    event = PETSc.Log.Event("MatCholFctrNum")
    # A stage of its own: an error inside a factorisation leaves the event of the stage open, and it counts no more.
    with PETSc.Log.Stage("factored once"), latin(scene, variant="primal") as run:
        run.snes.setUp()
        assert in_single(run.snes) == [True, True]
        assert event.getPerfInfo()["count"] == 3  # the subdomains, and the coarse matrix


@pytest.mark.parametrize("factor", [1e-90, 1e90])
def test_numbers_that_single_precision_cannot_hold(factor):
    """Units far off: the factor is made in double precision, and the solution is the same."""
    scene = irregular()
    scaled = replace(scene, stiffness=scene.stiffness * factor, load=scene.load * factor)
    with latin(scaled, precision="single") as run:
        run.snes.setUp()
        assert not any(in_single(run.snes))
    assert far(solve(scaled, precision="single").u, solve(scene).u) < 1e-6


def test_small_factors_are_in_double_precision_by_default():
    """They stay in a cache, where single precision gains nothing."""
    with latin(irregular(), variant="primal") as run:
        run.snes.setUp()
        assert not any(in_single(run.snes))


@pytest.mark.slow
def test_large_factors_are_in_single_precision_by_default():
    """And the end is the same as in double precision."""
    scene = latinpc.scenes.make("network", nodes=3000)
    with latin(scene) as run:
        run.snes.setUp()
        assert all(in_single(run.snes))
    single, double = solve(scene, stol=1e-9), solve(scene, stol=1e-9, precision="double")
    assert single.reason > 0
    assert far(single.u, double.u) < 1e-6
    assert abs(single.iterations - double.iterations) <= 1


def test_what_is_corrected_by_none_is_exact():
    """A preconditioner is one stage from zero: it has no such option, and its factors are in double precision."""
    structure = latinpc.Structure.from_scene(grid("truss"), comm=PETSc.COMM_SELF)
    matrix, u = structure.dm.createMat(), structure.create_vec()
    structure.jacobian(u, matrix)
    pc = PETSc.PC().create(PETSc.COMM_SELF)
    pc.setType("latin")
    pc.setOperators(matrix)
    structure.attach(pc)
    with default_options({"pc_latin_variant": "primal"}):
        pc.setFromOptions()
    pc.setUp()
    assert not any(in_single(pc))


def test_a_choice_from_python_and_one_that_is_none():
    with latin(irregular(), variant="primal") as run:
        latinpc.set_precision(run.snes, "single")
        run.snes.setUp()
        assert all(in_single(run.snes))
        with pytest.raises(ValueError, match="must be one of double, single, auto"):
            latinpc.set_precision(run.snes, "half")
