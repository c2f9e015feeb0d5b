"""A table with the same tension everywhere: the cable of a counterweight or a winch, as a load that turns with it."""

import numpy as np
import pytest

import latinpc

NODES = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [1.0, 2.0], [1.0, -1.0]]
LINKS = [[0, 1], [1, 2], [0, 4], [2, 4], [1, 4], [1, 3]]
FIXED = [[1, 1], [0, 0], [1, 1], [1, 1], [0, 0]]
WEIGHT = 500.0  # N


def girder(law, load, geometry, stiffness=0.0):
    """A girder with a tie below, hung at its middle by a link of this law to a point above."""
    laws, load = ["bar"] * 5 + [law], [[0, 0], [30.0, load], [0, 0], [0, 0], [0, 0]]
    more = {"fixed": FIXED, "load": load, "geometry": geometry}
    return latinpc.Structure(NODES, LINKS, laws, [1e6] * 5 + [stiffness], **more)


@pytest.mark.parametrize("span", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("geometry", ["linear", "prestress"])
def test_a_small_displacement_sees_a_load(span, geometry):
    """The table's range is no stiffness: the solution is that of a force on the node."""
    law = latinpc.register_table([0.0, span], [WEIGHT, WEIGHT])
    hung = girder(law, -2000.0, geometry).solve(error=1e-10)
    pulled = girder("bar", -2000.0 + WEIGHT, "linear", stiffness=1e-9).solve(error=1e-10)
    assert hung.tensions[5] == pytest.approx(WEIGHT, rel=1e-14)
    scale = abs(pulled.displacements).max()
    across = WEIGHT / 2.0 / 1e6 if geometry == "prestress" else 0.0  # of the geometric stiffness
    assert np.allclose(hung.displacements, pulled.displacements, rtol=0.0, atol=(1e-9 + across) * scale)


@pytest.mark.parametrize("span", [1e-3, 1.0, 1e3])
def test_it_keeps_its_tension_where_it_turns(span):
    """Large displacements: equilibrium of the moved nodes with the weight along the turned cable."""
    law = latinpc.register_table([-span, span], [WEIGHT, WEIGHT])
    result = girder(law, -2000.0, "large").solve(error=1e-11)
    moved = np.array(NODES) + result.displacements
    lengths = np.linalg.norm(np.diff(moved[LINKS], axis=1)[:, 0], axis=1)
    drawn = np.linalg.norm(np.diff(np.array(NODES)[LINKS], axis=1)[:, 0], axis=1)
    tensions = np.append(1e6 * (lengths - drawn)[:5], WEIGHT)
    pull = (tensions / lengths)[:, None] * np.diff(moved[LINKS], axis=1)[:, 0]
    forces = np.zeros((5, 2))
    np.add.at(forces, np.array(LINKS)[:, 0], pull)
    np.add.at(forces, np.array(LINKS)[:, 1], -pull)
    forces[1] += [30.0, -2000.0]
    assert abs(forces[[1, 4]]).max() < 1e-6 and abs(result.displacements[1]).max() > 5e-4


def test_a_stiffness_scales_the_tension():
    """It stands for tension over range, as for the steepest slope of other tables."""
    law = latinpc.register_table([0.0, 2.0], [WEIGHT, WEIGHT])
    assert girder(law, 0.0, "linear", stiffness=500.0).solve().tensions[5] == pytest.approx(1000.0, rel=1e-12)
    assert girder(law, 0.0, "linear").solve().tensions[5] == pytest.approx(WEIGHT, rel=1e-12)


def test_a_weight_between_two_counterweights():
    """Over two pulleys W hangs where 2 T sin a = W, far below where it is drawn."""
    law = latinpc.register_table([0.0, 1.0], [100.0, 100.0])
    nodes, links, fixed = [[-3.0, 0.0], [3.0, 0.0], [0.0, -1.0]], [[0, 2], [1, 2]], [[1, 1], [1, 1], [0, 0]]
    load = [[0, 0], [0, 0], [0, -120.0]]
    hung = latinpc.Structure(nodes, links, law, 0.0, fixed=fixed, load=load, geometry="large")
    result = hung.solve(error=1e-11)
    depth = 3.0 * np.tan(np.arcsin(0.6))
    assert result.displacements[2, 1] == pytest.approx(1.0 - depth, abs=1e-8)


def test_no_tension_is_no_link():
    with pytest.raises(latinpc.LatinError, match="no tension anywhere: leave out its links"):
        latinpc.register_table([0.0, 1.0], [0.0, 0.0])


@pytest.mark.parametrize("length", [0.05, 0.2])
def test_a_mass_between_two_counterweights_keeps_its_energy(length):
    """Kinetic energy, and the potential T l - W y."""
    law = latinpc.register_table([0.0, 1.0], [100.0, 100.0])
    nodes, links, fixed = [[-3.0, 0.0], [3.0, 0.0], [0.0, -1.0]], [[0, 2], [1, 2]], [[1, 1], [1, 1], [0, 0]]
    load, mass = [[0, 0], [0, 0], [0, -120.0]], [0.0, 0.0, 12.0]
    hung = latinpc.Structure(nodes, links, law, 0.0, fixed=fixed, load=load, mass=mass, geometry="large")
    u, v = hung.create_vec(), hung.create_vec()
    ts = hung.create_ts(u, v)
    ts.setTimeStep(length)
    ts.setMaxSteps(60)
    depths, energies = [], []
    for _ in range(60):
        ts.step()
        u, v = ts.getSolution2()
        depths.append(1.0 - hung.displacements(u)[2, 1])
        stretched = 2.0 * 100.0 * (np.hypot(3.0, depths[-1]) - np.hypot(3.0, 1.0))
        speed = np.linalg.norm(hung.displacements(v)[2])
        energies.append(stretched - 120.0 * (depths[-1] - 1.0) + 0.5 * 12.0 * speed**2)
    assert max(depths) > 3.0 and abs(np.array(energies)).max() < 1e-6
