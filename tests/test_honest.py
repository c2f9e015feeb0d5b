"""What has failed, or is no number, is not called converged; what was set up for something else is not used."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import MALLOC_DUMP as CHECKS
from petsc4py import PETSc
from support import chain, far, latin, lattice, solve

import latinpc
from latinpc.options import default_options

PLATE = lattice(4, 4, subdomains=4)
WHOLE = replace(PLATE, subdomain=np.zeros(len(PLATE.links), int))
FAILED = PETSc.KSP.ConvergedReason.DIVERGED_PCSETUP_FAILED
MOVING = {"mass": np.ones(len(PLATE.nodes))}


def structure(scene):
    return latinpc.Structure.from_scene(scene, PETSc.COMM_SELF)


def linear(scene, value=None, solves=1, **options):
    """Reasons of some solves with the stiffness of a structure, and the last relative residual."""
    links = structure(scene)
    J, b, x = links.dm.createMat(), links.create_vec(), links.create_vec()
    links.jacobian(x, J)
    b.set(1.0)
    if value is not None:
        b[0] = value
    with default_options(options):
        ksp = PETSc.KSP().create(PETSc.COMM_SELF)
        ksp.setOperators(J)
        ksp.setFromOptions()
        links.attach(ksp if ksp.getType() == "latin" else ksp.getPC())
        reasons = []
        for _ in range(solves):
            ksp.solve(b, x)
            reasons.append(ksp.getConvergedReason())
    r = b.duplicate()
    J.mult(x, r)
    r.axpy(-1.0, b)
    return reasons, r.norm() / b.norm()


@pytest.mark.parametrize("stop", ["indicator", "residual", "error"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_load_that_is_no_number_has_no_solution_without_interfaces_either(stop, value):
    with latin(chain(parts=1), stop=stop) as run:
        u, more = run.structure.create_vec(), run.structure.create_vec()
        more[0] = value
        if CHECKS:
            with pytest.raises(PETSc.Error, match="not-a-number"):
                run.snes.solve(more, u)
            return
        run.snes.solve(more, u)
        assert run.snes.getConvergedReason() == -4  # DIVERGED_FUNCTION_NANORINF; its name in Python changes


@pytest.mark.parametrize("scene", [WHOLE, PLATE], ids=["one subdomain", "four"])
@pytest.mark.parametrize("value", [np.nan, 1e300])
def test_forces_that_overflow_end_no_ksp_as_converged(scene, value):
    assert linear(scene, value, ksp_type="latin")[0][0] < 0


@pytest.mark.parametrize("scene", [WHOLE, PLATE], ids=["one subdomain", "four"])
@pytest.mark.parametrize("how", [{"ksp_max_it": 1}, {"ksp_divtol": 1e-30}], ids=["its", "dtol"])
def test_ksp_latin_fails_with_its_local_solver(scene, how):
    inner = {"ksp_type": "cg", "pc_type": "jacobi", **how}
    reasons, residual = linear(scene, ksp_type="latin", **{f"ksp_latin_local_{key}": inner[key] for key in inner})
    assert residual > 1e-2
    assert reasons == [FAILED]


@pytest.mark.parametrize("part", ["local", "interior"])
def test_pc_latin_fails_with_its_inner_solvers(part):
    inner = {"ksp_type": "cg", "pc_type": "jacobi", "ksp_divtol": 1e-30}
    options = {f"pc_latin_{part}_{key}": inner[key] for key in inner}
    assert linear(PLATE, ksp_type="fgmres", pc_type="latin", **options)[0] == [FAILED]


def test_a_matrix_without_interfaces_has_no_local_fields():
    links = structure(WHOLE)
    links.dm.setMatType("is")
    J, b, x = links.dm.createMat(), links.create_vec(), links.create_vec()
    links.jacobian(x, J)
    J.compose("__PETSc_dm", None)
    b.set(1.0)
    with default_options({"ksp_type": "cg", "pc_type": "latin", "pc_latin_modes_local": 1}):
        ksp = PETSc.KSP().create(PETSc.COMM_SELF)
        ksp.setOperators(J)
        ksp.setFromOptions()
        ksp.solve(b, x)
    assert ksp.getConvergedReason() > 0
    assert ksp.getIterationNumber() == 1


def test_inner_iterations_that_are_few_on_purpose_are_no_failure():
    inner = {"ksp_type": "cg", "pc_type": "jacobi", "ksp_max_it": 3}
    options = {f"pc_latin_local_{key}": inner[key] for key in inner}
    reasons, residual = linear(PLATE, solves=3, ksp_type="fgmres", pc_type="latin", ksp_rtol=1e-8, **options)
    assert reasons == 3 * [PETSc.KSP.ConvergedReason.CONVERGED_RTOL]
    assert residual < 1e-6


@pytest.mark.parametrize("solver", ["latin", "newtonls"])
@pytest.mark.parametrize("other", [replace(PLATE, stiffness=10 * PLATE.stiffness), lattice(8, 4, subdomains=8)])
def test_a_snes_that_gets_another_structure_solves_that_one(solver, other):
    first, second = structure(PLATE), structure(other)
    snes = first.create_snes()
    snes.setType(solver)
    snes.solve(None, first.create_vec())
    second.attach(snes)
    u = second.create_vec()
    snes.solve(None, u)
    assert snes.getConvergedReason() > 0
    assert far(second.displacements(u), solve(other).u) < 1e-3


def test_a_ts_that_gets_another_structure_moves_that_one():
    def move(links, ts):
        ts.setTime(0.0)
        ts.setStepNumber(0)
        ts.setTimeStep(1e-3)
        ts.setMaxSteps(2)
        u = ts.getSolution2()[0]
        ts.solve(u)
        return links.displacements(u)

    first, second = structure(replace(PLATE, **MOVING)), structure(replace(PLATE, **MOVING, load=2 * PLATE.load))
    ts = first.create_ts()
    move(first, ts)
    second.attach(ts)
    assert np.array_equal(move(second, ts), move(second, second.create_ts()))
    second.attach(ts)  # the same once more changes nothing
    assert ts.getSolution2()[0].norm() > 0


@pytest.mark.parametrize("kind", ["pc", "ksp"])
def test_a_linear_solver_that_gets_another_structure_is_set_up_again(kind):
    first, second = structure(PLATE), structure(WHOLE)
    J, b = first.dm.createMat(), first.create_vec()
    first.jacobian(b, J)
    second.jacobian(b, second.dm.createMat())
    b.set(1.0)
    ksp = PETSc.KSP().create(PETSc.COMM_SELF)
    ksp.setType("cg" if kind == "pc" else "latin")
    ksp.getPC().setType("latin" if kind == "pc" else "none")
    ksp.setOperators(J)
    counts = []
    for links in (first, second):
        links.attach(ksp.getPC() if kind == "pc" else ksp)
        ksp.solve(b, links.create_vec())
        counts.append(latinpc.statistics(ksp.getPC() if kind == "pc" else ksp)["subdomains"])
    assert counts == [4, 1]


def test_options_of_the_inner_snes_are_read_again():
    with latin(PLATE) as run:
        run.snes.solve(None, run.structure.create_vec())
        with default_options({"snes_latin_outer_snes_type": "nrichardson"}):
            run.snes.setFromOptions()
        assert latinpc.outer_snes(run.snes).getType() == "nrichardson"
        u = run.structure.create_vec()
        run.snes.solve(None, u)
        plain = solve(PLATE, outer_snes_type="nrichardson")
        assert run.snes.getIterationNumber() == plain.iterations
        assert np.array_equal(run.structure.displacements(u), plain.u)


@pytest.mark.parametrize("newton", ["auto", "never"])
def test_another_function_that_is_left_is_not_converged(newton):
    """The equations are those of the structure: with springs to the ground added, its solution leaves a residual."""
    links = structure(PLATE)
    with default_options({"snes_latin_stop": "residual", "snes_rtol": 1e-8, "snes_latin_newton": newton}):
        snes = links.create_snes()
        snes.setFromOptions()
    own = links.create_snes()

    def springs(_, u, r):
        own.computeFunction(u, r)
        r.axpy(1e5, u)

    snes.setFunction(springs, links.create_vec())
    u = links.create_vec()
    snes.solve(None, u)
    assert snes.getConvergedReason() == PETSc.SNES.ConvergedReason.DIVERGED_INNER
    own.solve(None, u)
    assert own.getConvergedReason() > 0


@pytest.mark.parametrize("size", [1e-165, 1e-200])
def test_loads_whose_squares_vanish(size):
    """No norm sees them: a node on two bars of stiffness 1 N/m does not stay where it is, alone or as a load case."""
    load = size * np.array([[0.0, 0.0], [1.0, -1.0], [0.0, 0.0]])
    links = latinpc.Structure(
        [[0, 0], [1, 0], [1, 1]], [[0, 1], [1, 2]], ["bar", "cable"], 1.0, fixed=[[1, 1], [0, 0], [1, 1]], load=load,
        comm=PETSc.COMM_SELF,
    )  # fmt: skip
    snes, u = links.create_snes(), links.create_vec()
    snes.setFromOptions()
    snes.solve(None, u)
    assert snes.getConvergedReason() < 0
    links.set_load(load / size)
    snes.solve(None, u)
    assert snes.getConvergedReason() > 0
