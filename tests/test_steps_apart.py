"""Steps of motions: what is light, has no mass or carries much does not change what is said of the rest."""

import numpy as np
import pytest
from petsc4py import PETSc

import latinpc


def moving(structure, h, velocity=None):
    """TS, displacements and velocities."""
    u, v = structure.create_vec(), structure.create_vec()
    if velocity is not None:
        structure.set_displacements(velocity, v)
    ts = structure.create_ts(u, v)
    ts.setTimeStep(h)
    ts.setMaxSteps(1000)
    ts.setErrorIfStepFails(False)
    ts.setFromOptions()
    return ts, u, v


@pytest.mark.parametrize("light", [1.0, 1e-4, 1e-6])
@pytest.mark.parametrize("h", [1e-3, 1e-2])
def test_a_ball_lands_whatever_a_light_node_bears(light, h):
    """That node rests on a bar under 1 kN; without the bar a step would take it 0.01 to 100,000 m away."""
    structure = latinpc.Structure(
        [[0.0], [0.1], [1.0], [2.0]], [[0, 1], [2, 3]], ["contact", "bar"], [0.0, 1e6], initial_elongation=[0.1, 0.0],
        fixed=[[1], [0], [1], [0]], load=[[0], [-98.1], [0], [-1000.0]], mass=[0, 10.0, 0, light], comm=PETSc.COMM_SELF,
    )  # fmt: skip
    ts, u, v = moving(structure, h)
    structure.set_displacements([[0], [0], [0], [-1e-3]], u)
    for _ in range(round(0.3 / h)):
        ts.step()
    gap = 0.1 + structure.displacements(u)[1, 0]
    assert -1.5 * h < gap <= 0.0  # it arrives at 1.4 m/s, and may enter by a step
    assert abs(structure.displacements(v)[1, 0]) < 1e-12


@pytest.mark.parametrize(
    ("heavy", "error", "light", "load", "h"),
    [
        (36.0, 5.65e-5, 3.77e-4, 70.0, 4.20e-4),
        (260.0, 8.62e-6, 5.84e-4, 25.5, 2.41e-4),
        (0.206, 1.34e-5, 4.55e-4, 1.33, 4.30e-4),
        (1.92, 2.32e-9, 1.07e-3, 19.5, 2.49e-3),
        (0.243, 2.77e-7, 7.10e-4, 0.25, 1.03e-3),
    ],
)
def test_a_node_without_mass_is_in_balance_or_the_step_fails(heavy, error, light, load, h):
    """It hangs between cables that do not stretch, one slack, one to a light mass; a mass swings beside it."""
    forces = np.zeros((6, 2))
    forces[2] = -load, 0.3 * load
    structure = latinpc.Structure(
        [[0, 0], [0, 2], [1, 1], [3, 0], [4, 0], [2, 1.0]], [[0, 2], [1, 2], [3, 4], [3, 4], [5, 2]],
        ["inextensible", "inextensible", "bar", "bar", "inextensible"], [0, 0, 1e5, 1e5, 0],
        fixed=[[1, 1], [1, 1], [0, 0], [1, 1], [0, 0], [0, 0]], load=forces, mass=[0, 0, 0, 0, heavy, light],
        direction=[[0, 0]] * 3 + [[0, 1.0], [0, 0]], comm=PETSc.COMM_SELF,
    )  # fmt: skip
    velocity = np.zeros((6, 2))
    velocity[4], velocity[5, 0] = 1.0, -1.0
    ts, u, _ = moving(structure, h, velocity)
    latinpc.set_error(ts.getSNES(), error)
    for _ in range(3):
        ts.step()
        if ts.getConvergedReason() < 0:
            return
        tension = latinpc.step_tensions(ts)
        held = tension[0] * structure.directions[0] + tension[1] * structure.directions[1]
        held = held + tension[4] * structure.directions[4]
        assert held == pytest.approx(forces[2], abs=1e-2 * load)
        assert np.abs(structure.displacements(u)).max() < 1.0


@pytest.mark.parametrize("h", [1e-2, 1e-3])
def test_a_node_without_mass_that_a_strut_pushes_away_is_named(h):
    """Its strut is compressed at the start: mean forces of the step are zero only infinitely far away."""
    structure = latinpc.Structure(
        [[0, 0], [1, 0], [0, 2], [1, 2]], [[0, 1], [2, 3]], ["compression_only", "bar"], 1e3,
        initial_elongation=[-0.05, 0.0], fixed=[[1, 1], [0, 1], [1, 1], [0, 1]], mass=[0, 0, 0, 1.0], geometry="large",
        comm=PETSc.COMM_SELF,
    )  # fmt: skip
    ts, _, _ = moving(structure, h, [[0, 0], [0, 0], [0, 0], [1.0, 0]])
    for _ in range(4):
        if ts.getConvergedReason() >= 0:
            ts.step()
    assert ts.getConvergedReason() < 0
    assert "node 1 against the loads, and it has no mass" in latinpc.step_cause(ts)
