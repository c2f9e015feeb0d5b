"""Paths of equilibria: the units of a structure, and what an error leaves behind."""

import numpy as np
import pytest
import turning
from turning import catenary, hanging, net, random_net, simplex, solve, von_mises

import latinpc

CHAIN = hanging(
    np.column_stack([np.linspace(0.0, 8.0, 13), np.zeros(13)]),
    np.column_stack([np.arange(12), np.arange(1, 13)]),
    10.0 / 12.0,
    [0, 12],
    -5.0,
) | {"law": "inextensible", "stiffness": 0.0}  # fmt: skip
STRUCTURES = {
    "saddle": net(6, 1.0, [10.0, 0.0, -300.0]),
    "simplex": simplex(300.0),
    "random": random_net(2),
    "catenary": catenary()[0],
    "chain": CHAIN,
    "truss below its limit point": von_mises(0.9 * turning.von_mises_limit()),
    "truss above it": von_mises(2.0 * turning.von_mises_limit()),
}


@pytest.mark.parametrize("name", STRUCTURES)
def test_units_change_nothing(name):
    """Forces of nanonewtons and giganewtons, lengths of millimetres and kilometres: no floor has a unit."""
    plain = solve(STRUCTURES[name], error=1e-9)
    for force, length in ((1e-9, 1.0), (1e9, 1.0), (1.0, 1e-3), (1.0, 1e3), (1e-9, 1e3), (1e9, 1e-3)):
        other = solve(turning.scaled(STRUCTURES[name], force, length), error=1e-9)
        assert other.reason == plain.reason
        assert other.borne == pytest.approx(plain.borne, rel=1e-3)
        far = np.linalg.norm(other.displacements / length - plain.displacements)
        assert far < 1e-9 * np.linalg.norm(plain.displacements)
        assert np.linalg.norm(other.tensions / force - plain.tensions) < 1e-8 * np.linalg.norm(plain.tensions)


def test_an_error_leaves_nothing_behind():
    """A monitor that raises in the middle of a path: right-hand side and solver are as before."""
    s = latinpc.Structure(**von_mises(0.5 * turning.von_mises_limit()), geometry="large")
    snes, u, b = s.create_snes(), s.create_vec(), s.create_vec()
    b.set(0.0)
    told = []

    def monitor(_snes, it, _norm):
        told.append(it)
        if it > 0 and len(told) < 5:
            raise RuntimeError("enough")

    snes.setMonitor(monitor)
    for _ in range(2):
        u.set(0.0)
        with pytest.raises(RuntimeError, match="enough"):
            snes.solve(b, u)
    u.set(0.0)
    snes.solve(b, u)
    assert snes.getConvergedReason() > 0
    exact = turning.von_mises_deflection(0.5 * turning.von_mises_limit())
    assert -s.displacements(u)[2, 1] == pytest.approx(exact, rel=1e-4)
    snes.destroy()
    assert b.refcount == 1
