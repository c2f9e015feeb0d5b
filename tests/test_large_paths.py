"""Paths of equilibria: what an error leaves behind."""

import pytest
import turning
from turning import von_mises

import latinpc

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
