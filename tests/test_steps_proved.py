"""Motions stopped by the step tolerance: what has no solution fails, whatever the tolerance."""

import numpy as np
import pytest
from petsc4py import PETSc

import latinpc

TOLERANCES = [1e-5, 1e-6, 1e-7, 1e-9]


@pytest.fixture(params=TOLERANCES)
def stol(request):
    """Option of every SNES of a test."""
    options = PETSc.Options()
    options["snes_stol"] = request.param
    yield request.param
    options.delValue("snes_stol")


def steps(structure, h, count, place):
    """Make steps with supports at place(n): the tensions of each, and why the last one has failed."""
    u, v = structure.create_vec(), structure.create_vec()
    ts = structure.create_ts(u, v)
    ts.setTimeStep(h)
    ts.setMaxSteps(count)
    ts.setErrorIfStepFails(False)
    ts.setPreStep(lambda ts: structure.set_prescribed(place(ts.getStepNumber() + 1)))
    tensions = []
    ts.setPostStep(lambda ts: ts.getSNES().getConvergedReason() > 0 and tensions.append(latinpc.step_tensions(ts)))
    ts.setFromOptions()
    ts.solve(u)
    return tensions, latinpc.step_cause(ts)


@pytest.mark.parametrize("balls", [1, 4])
@pytest.mark.parametrize("law", ["contact", "inextensible"])
def test_walls_that_jam_a_row(stol, law, balls):
    """Such steps had converged with tensions of MN, and walls through the balls."""
    n = balls + 2
    nodes = np.arange(n, dtype=float)[:, None]
    ends = np.column_stack([np.arange(n - 1), np.arange(1, n)])
    fixed = np.zeros((n, 1), bool)
    fixed[[0, -1]] = True
    mass = np.where(fixed[:, 0], 0.0, 1.0)
    structure = latinpc.Structure(nodes, ends, law, 0.0, fixed=fixed, mass=mass, comm=PETSc.COMM_SELF)
    inwards = np.zeros((n, 1))
    inwards[[0, -1], 0] = np.array([1e-3, -1e-3]) * (1.0 if law == "contact" else -1.0)
    tensions, cause = steps(structure, 1e-2, 3, lambda step: step * inwards)
    assert not tensions
    assert "are incompatible: look at the supports that move" in cause


def test_tensions_that_have_a_solution(stol):
    """Two nodes between walls that swing: the tensions are those of the default stop, which proves them."""
    nodes = [[0.45328], [0.93500], [0.000892], [0.096785]]
    mass = np.array([0, 35.7, 0.29, 0])
    structure = latinpc.Structure(
        nodes, [[1, 2], [2, 0], [1, 3]], ["inextensible", "contact", "contact"], 0.0, fixed=[[1], [0], [0], [1]],
        mass=mass, load=6.58 * mass[:, None], comm=PETSc.COMM_SELF,
    )  # fmt: skip
    walls = np.array([[0.00056], [0], [0], [-0.00029]])
    tensions, _ = steps(structure, 0.0222, 6, lambda n: walls * (1.0 + np.sin(3 * n)))
    assert len(tensions) == 6
    assert np.abs(tensions).max() < 1e3
    assert tensions[2] == pytest.approx([189.795, -191.337, 0.0], abs=1e-2)
