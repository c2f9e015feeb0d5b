"""A PETSc in single precision: what it can have it reaches, what it cannot have it refuses.

Held against the oracle and against exact solutions in double precision, which know nothing of the rounding here.
"""

import numpy as np
import oracle
import pytest
from petsc4py import PETSc
from support import VARIANTS, chain, grid, irregular, lattice, network, solve

import latinpc
from latinpc.bench import extremes
from latinpc.bench.extremes.drawn import draw
from latinpc.scenes import Law

if np.finfo(PETSc.RealType).eps < 1e-10:
    pytest.skip("for PETSc in single precision (make test PETSC=single)", allow_module_level=True)

REASON = PETSc.SNES.ConvergedReason
SCENES = {
    "truss": lambda: grid("truss"), "tensegrity": grid, "metis": irregular, "network": network, "lattice": lattice,
    "chain": chain,
}  # fmt: skip


def off(a, b):
    """Relative l2 error."""
    return np.linalg.norm(a - b) / np.linalg.norm(b)


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("name", SCENES)
def test_three_digits(name, variant):
    scene = SCENES[name]()
    result = solve(scene, variant=variant, stop="error", error=1e-3, max_it=500)
    assert result.reason > 0
    assert off(result.u, oracle.newton(scene)) <= 3e-3


def test_rounded_forces_are_no_reason_to_refuse():
    """Rounding of a force is three times the loads at most, a thirtieth in fact, and moves soft modes little."""
    scene = grid(modules=32, subdomains=16)
    result = solve(scene, stop="error", error=1e-3, max_it=500)
    assert result.reason > 0
    assert off(result.u, oracle.newton(scene)) <= 3e-3


@pytest.mark.parametrize(("seed", "number"), [(77, 3210), (77, 3304), (5, 2320), (5, 639)])
def test_loads_that_rounding_hides_are_refused(seed, number):
    """Rounding of a force is 90 times the loads and more at most: soft nodes would be wrong by 3 to 60 per cent."""
    assert solve(draw(seed, number, "statics").scene, stop="error", error=1e-3).reason < 0


@pytest.mark.parametrize("newton", ["auto", "never"])
@pytest.mark.parametrize("name", SCENES)
def test_more_than_rounding_leaves_is_refused(name, newton):
    """Seven digits are more than there are."""
    scene = SCENES[name]()
    result = solve(scene, stop="error", error=1e-7, max_it=500, newton=newton)
    assert result.reason < 0
    assert off(result.u, oracle.newton(scene)) <= 1e-2  # as far as it goes


@pytest.mark.parametrize("name", SCENES)
def test_default_stop(name):
    scene = SCENES[name]()
    result = solve(scene)
    assert result.reason > 0
    assert off(result.u, oracle.newton(scene)) <= 1e-2


@pytest.mark.parametrize("name", ["truss", "lattice", "chain"])
def test_preconditioner(name, options):
    scene = SCENES[name]()
    scene.law[:] = Law.BAR
    structure = latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF)
    snes = structure.create_snes()
    snes.setType("ksponly")
    ksp = snes.getKSP()
    ksp.setType("cg")
    ksp.getPC().setType("latin")
    ksp.setTolerances(rtol=1e-5)
    u = structure.create_vec()
    snes.solve(None, u)
    assert snes.reason > 0
    assert ksp.getIterationNumber() < 60
    assert off(structure.displacements(u), oracle.newton(scene)) <= 1e-2


def test_equal_on_two_ranks(mpirun):
    program = """
import petsc4py
petsc4py.init(["", "-skip_petscrc", "-snes_latin_stop", "error", "-snes_latin_error", "1e-3"])
from petsc4py import PETSc
import latinpc
from latinpc.scenes import make
structure = latinpc.Structure.from_scene(make("tensegrity-grid", modules=6, subdomains=9))
snes = structure.create_snes()
snes.setFromOptions()
u = structure.create_vec()
snes.solve(None, u)
PETSc.Sys.Print(snes.reason > 0, u.norm())
"""
    one, two = (mpirun(ranks, program).stdout.split() for ranks in (1, 2))
    assert one[0] == two[0] == "True"
    assert float(two[1]) == pytest.approx(float(one[1]), rel=3e-3)


def test_a_number_beyond_single_precision_is_refused():
    with np.errstate(over="ignore"), pytest.raises(ValueError, match="load that is not finite"):
        solve(chain(load=1e39))


def test_no_error_is_promised_where_links_are_rigid():
    """Their tensions and gaps hide digits that single precision has not; the indicator stops there, too."""
    scene = chain(law=Law.INEXTENSIBLE, load=1.0)
    scene.initial_elongation[:] = -0.01
    with pytest.raises(PETSc.Error) as caught:
        solve(scene, stop="error", error=1e-2)
    assert "PETSc in double precision" in latinpc.error_message(caught.value)
    assert solve(scene, stol=1e-3, max_it=1000).reason > 0


# of bars and cables at rest; a load 1e-6 beyond that which turns a girder over is, here, that load
GROUPS = "stiffness", "load", "slack", "units", "direction", "partition", "close nodes", "prestress", "origin", "star"
CASES = [case for case in extremes.cases() if case.group in GROUPS and not case.name.startswith("1.000001 of")]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_extremes(case):
    """Whatever becomes of a case that needs more digits: no wrong answer, no crash, no hang."""
    assert extremes.run(case).verdict not in ("wrong", "hang", "crash")


def test_functions_in_double_precision_are_refused():
    with pytest.raises(ValueError, match="take register_table"):
        latinpc.register_law("spring", 1, 1, 1)
