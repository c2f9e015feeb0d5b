"""Tents whose tensions as drawn are not in balance, so that they are soft at first: large displacements."""

import itertools

import numpy as np
import pytest
from petsc4py import PETSc

import latinpc
from latinpc.bench.extremes.corotational import Corotational

pytestmark = pytest.mark.skipif(np.finfo(PETSc.RealType).eps > 1e-10, reason="the paths are those of double precision")


def tent(meshes, load, tension):
    """A saddle of cables with edge cables; two corners are held, two on masts, each with two guys."""
    place, n = np.linspace(-1.0, 1.0, meshes + 1), meshes + 1
    nodes = [[10.0 * a, 10.0 * b, 6.0 + 4.0 * a * b] for a in place for b in place]
    number = np.arange(n * n).reshape(n, n)
    members = [
        (*pair, "cable", *((1e7, 1.5 * tension * meshes) if k in (0, meshes, n, n + meshes) else (1e6, tension)))
        for k, row in enumerate(np.concatenate([number, number.T]))
        for pair in itertools.pairwise(row)
    ]
    fixed, loads = [[False] * 3 for _ in nodes], [[0.0, 0.0, load] for _ in nodes]
    for corner in (meshes, n * meshes):
        fixed[corner] = [True] * 3
    for corner, side in ((0, -1.0), (n * n - 1, 1.0)):
        for i, (along, across) in enumerate([(10.0, 10.0), (19.0, 14.0), (14.0, 19.0)]):
            members.append((corner, len(nodes), *(("cable", 3e7, 1.5 * tension * meshes) if i else ("bar", 2e8, 0.0))))
            nodes.append([along * side, across * side, -0.5])
            fixed.append([True] * 3)
            loads.append([0.0] * 3)
    first, second, law, EA, prestress = (np.array(column) for column in zip(*members, strict=True))
    length = np.linalg.norm(np.array(nodes)[second] - np.array(nodes)[first], axis=1)
    return latinpc.Structure(
        nodes, np.stack([first, second], 1), law, EA / length * (1.0 + prestress / EA), prestress=prestress,
        fixed=fixed, load=loads, geometry="large", comm=PETSc.COMM_SELF,
    )  # fmt: skip


@pytest.mark.parametrize("load", [-3000.0, -300.0, 1000.0])
@pytest.mark.parametrize(("meshes", "tension"), [(2, 100.0), (3, 100.0), (6, 1000.0)])
def test_what_stiffens_under_a_millionth_of_the_loads(meshes, tension, load):
    """A ten-thousandth of the loads is too large an increment: it stiffens where it is soft."""
    drawn = tent(meshes, load, tension)
    found = drawn.solve(error=1e-8)
    assert found.converged, found.notices
    equations, u = Corotational(drawn), found.displacements.astype(np.longdouble)
    assert np.linalg.norm(equations.unbalance(u)) < 1e-6 * np.linalg.norm(drawn.load)
    assert equations.stable(u)
