"""Several solvers on one structure: each finds to the bit what it finds alone, whatever the others do in between."""

from dataclasses import replace

import numpy as np
import pytest
from petsc4py import PETSc
from support import grid, irregular

import latinpc
from latinpc.bench.extremes.rigid import stiffened
from latinpc.options import default_options
from latinpc.scenes import Law, make

LOADS = (1.0, 0.4, 1.2)  # one after the other


class Static:
    """A SNES of a structure."""

    def __init__(self, structure, options):
        self.structure, self.snes, self.u = structure, structure.create_snes(), structure.create_vec()
        with default_options(options):
            self.snes.setFromOptions()

    def set_up(self):
        self.snes.setUp()

    def go(self):
        self.snes.solve(None, self.u)
        assert self.snes.getConvergedReason() > 0
        return self.structure.displacements(self.u), latinpc.tensions(self.snes), self.snes.getIterationNumber()


class Moving:
    """A TS of a structure, a step at a time."""

    def __init__(self, structure, options):
        self.structure, self.ts = structure, structure.create_ts()
        self.latin = "ts_type" not in options
        with default_options(options):
            self.ts.setFromOptions()
        self.ts.setTimeStep(1e-2)
        self.ts.setMaxSteps(len(LOADS))

    def set_up(self):
        self.ts.setUp()

    def go(self):
        self.ts.step()
        u, _ = self.ts.getSolution2()
        tensions = latinpc.step_tensions(self.ts) if self.latin else self.structure.tensions(u)
        return self.structure.displacements(u), tensions, self.ts.getSNES().getIterationNumber()


CORNER = (Static, {})
MACRO = (Static, {"snes_latin_variant": "macro", "snes_stol": 1e-3})
NEWTON = (Static, {"snes_type": "newtonls", "ksp_type": "cg", "pc_type": "latin"})
INTERFACES = (Static, {"snes_type": "newtonls", "ksp_type": "latin", "ksp_rtol": 1e-10})
PROVED = (Static, {"snes_latin_stop": "error", "snes_latin_error": 1e-8})
WARM = (Static, {"snes_latin_warm_start": "last"})
MOTION = (Moving, {})
SMOOTH = (Moving, {"ts_type": "alpha2"})


def massive(scene):
    """Make the same structure with masses."""
    return replace(scene, mass=np.full(len(scene.nodes), 10.0))


CASES = {
    "elastic": (lambda: massive(grid()), (CORNER, MACRO, NEWTON, INTERFACES, PROVED, WARM, MOTION, SMOOTH)),
    "irregular": (irregular, (CORNER, NEWTON, NEWTON, NEWTON)),
    "inextensible": (lambda: massive(make("net", side=8)), (CORNER, MACRO, WARM, MOTION)),
    "grains": (lambda: massive(make("packing", side=6, law="friction")), (CORNER, MACRO, MOTION)),
    "other search parameters": (lambda: stiffened(1e4, False), (CORNER, MACRO)),
}


def found(scene, kinds, kept):
    """Set all solvers up, then let them solve in turn under each load; what the solver `kept` finds."""
    structure = latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF)
    solvers = [kind(structure, options) for kind, options in kinds]
    for one in solvers:
        one.set_up()
    results = []
    for factor in LOADS:
        structure.set_load(factor * scene.load)
        results.append([one.go() for one in solvers][kept])
    return results


@pytest.mark.parametrize("case", CASES)
def test_solvers_do_not_meet(case):
    make_scene, kinds = CASES[case]
    scene = make_scene()
    for which, kind in enumerate(kinds):
        for (u, tensions, count), (v, others, number) in zip(
            found(scene, [kind], 0), found(scene, kinds, which), strict=True
        ):
            assert np.array_equal(u, v) and np.array_equal(tensions, others) and count == number, kind


def test_a_matrix_keeps_its_tangent_stiffnesses():
    """A Jacobian of other displacements into another matrix leaves the preconditioner of the first one as it is."""
    scene = irregular()
    structure = latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF)
    first, second = structure.dm.createMat(), structure.dm.createMat()
    u, b = structure.create_vec(), structure.create_vec()
    b.setRandom()
    results = []
    for others in (0.0, 1.0):  # whether the second one is of displacements at which other cables are slack
        structure.jacobian(u, first)
        structure.jacobian(others * b, second)
        ksp = PETSc.KSP().create(PETSc.COMM_SELF)
        ksp.setOperators(first)
        ksp.setType("latin")  # refuses what is not the matrix
        x = structure.create_vec()
        ksp.solve(b, x)
        assert ksp.getConvergedReason() > 0
        results.append(x.getArray().copy())
    assert not second.equal(first)
    assert np.array_equal(*results)


def test_a_solver_leaves_the_callbacks_of_another_alone():
    """What is set on one SNES of a structure is not called by another one."""
    structure = latinpc.Structure.from_scene(grid("truss"), comm=PETSc.COMM_SELF)
    first, second = structure.create_snes(), structure.create_snes()

    def nothing(snes, u, r):
        raise AssertionError("the function of another solver")

    second.setFunction(nothing, structure.create_vec())
    first.setType("newtonls")
    first.solve(None, structure.create_vec())
    assert first.getConvergedReason() > 0


def test_only_a_solver_has_the_tensions_of_rigid_links():
    scene = make("net", side=8)
    structure = latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF)
    u = structure.create_vec()
    for refused in (structure.tensions, lambda u: structure.residual(u, u.duplicate())):
        with pytest.raises(PETSc.Error) as error:
            refused(u)
        assert "not a function of the displacements" in latinpc.error_message(error.value)
    snes = structure.create_snes()
    with pytest.raises(PETSc.Error) as error:
        latinpc.tensions(snes)
    assert "no solution yet" in latinpc.error_message(error.value)
    snes.solve(None, u)
    tensions = latinpc.tensions(snes)[scene.law == Law.INEXTENSIBLE]
    assert tensions.min() >= 0.0 < tensions.max()


def test_halves_of_the_ranks_solve_by_themselves(ranks_for):
    """Nothing waits for ranks of another communicator, and an error of one half leaves the other alone."""
    from halves_program import scene

    alone = [abs(scene(half).solve(PETSc.COMM_SELF).displacements).max() for half in range(2)]
    found = ranks_for(4, "halves_program")["ranks"]
    assert [half for half, *_ in found] == [0, 0, 1, 1]
    for half, size, largest, told, reasons in found:
        assert size == 2 and len(largest) == (1, 4)[half] and min(reasons) > 0
        assert largest == pytest.approx([alone[half]] * len(largest), rel=1e-3)
        assert ("Nothing is supported" in told) == bool(half)


@pytest.mark.parametrize("value", [0.0, 1.0, 100.0])
def test_another_function_does_not_replace_the_equations(value):
    """Nor does it decide when a solve ends, but for the stop on the residual, which measures it."""
    structure = latinpc.Structure.from_scene(grid("tensegrity"), comm=PETSc.COMM_SELF)
    found = []
    for function in (None, lambda snes, u, r: r.set(value)):
        snes, u = structure.create_snes(), structure.create_vec()
        snes.setFromOptions()
        if function is not None:
            snes.setFunction(function, structure.create_vec())
        snes.solve(None, u)
        found.append((snes.getConvergedReason(), snes.getIterationNumber(), u.getArray().copy()))
    assert found[0][:2] == found[1][:2] and found[0][0] > 0
    assert np.array_equal(found[0][2], found[1][2])
