"""Equilibria of geometry prestress that are unstable: a strut that a cable held, which is slack."""

import numpy as np
import pytest
import turning
from petsc4py import PETSc

import latinpc
from latinpc.results.limit import unstable


def strut(geometry="prestress", push=100.0):
    """A strut along x, pushed by a load, its end held across by a cable below it."""
    return latinpc.Structure(
        [[0.0, 0.0], [1.0, 0.0], [1.0, -1.0]], [[0, 1], [1, 2]], ["bar", "cable"], EA=1e4, prestress=[-push, 10.0],
        fixed=[[1, 1], [0, 0], [1, 1]], load=[[0, 0], [-push, 10.0], [0, 0]], geometry=geometry, comm=PETSc.COMM_SELF,
    )  # fmt: skip


def said(structure, down):
    """What is said of displacements of the end, whose cable is slack once it has moved down by a millimetre."""
    u = structure.create_vec()
    u.setArray([0.0, -down])
    K = structure.dm.createMat()
    structure.jacobian(u, K)
    stiffness = K.getValue(1, 1).real
    return stiffness, unstable(structure, u, np.array([False, down > 1e-3]))


def test_a_strut_whose_cable_is_slack():
    """Across it the load drives it, P / L; the taut cable resists, EA / L."""
    stiffness, text = said(strut(), 0.1)
    assert stiffness == pytest.approx(-100.0)
    assert len(text) == 1 and text[0].startswith("this equilibrium is unstable") and "geometry large" in text[0]
    stiffness, text = said(strut(), 0.0)
    assert stiffness == pytest.approx(1e4 - 100.0) and not text


@pytest.mark.parametrize(("geometry", "push"), [("linear", 100.0), ("prestress", -100.0)])
def test_nothing_is_said_without_struts(geometry, push):
    """Of other geometries `large` proves stability itself, and `linear` knows no buckling."""
    structure = strut(geometry, push)
    u = structure.create_vec()
    assert not unstable(structure, u, np.array([False, True]))


def test_a_solve_says_nothing_of_a_stable_state():
    found = strut().solve()
    assert found.converged and not found.notices


@pytest.mark.parametrize("load", [0.01, 0.1, -1.0])
def test_parts_across_struts_prove_no_collapse(load):
    """One of the cables bears the load and what the struts drive the node by."""
    found = latinpc.Structure(**turning.struts(load), geometry="prestress", comm=PETSc.COMM_SELF).solve()
    assert found.converged and not found.notices
    up = found.displacements[1, 1]
    bears = 1e4 * (abs(up) - 1e-2)
    assert bears > 0.0 and found.tensions[2 if up < 0.0 else 3] == pytest.approx(bears, rel=1e-6)
    assert bears == pytest.approx(np.sign(up) * load + 200.0 * abs(up), rel=1e-6)


def test_a_flat_part_of_a_table_leaves_struts_alone():
    """Between two struts of 20 N, 1 m long: beside the start the table has 1 N, further on 19 000 N/m."""
    table = latinpc.register_table([0.0, 5e-3, 6e-3], [1.0, 1.0, 20.0], "flat beside struts")
    cases = [latinpc.Case(f"{load}", load=[[0, 0], [0, load], [0, 0], [0, 0]]) for load in (-1.0, -1.5)]
    structure = latinpc.Structure(
        [[-1.0, 0.0], [0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], [[0, 1], [1, 2], [3, 1]], [0, 0, table], [1e5, 1e5, 0.0],
        initial_elongation=[-2e-4, -2e-4, 0.0], fixed=[[1, 1], [0, 0], [1, 1], [1, 1]], geometry="prestress",
        comm=PETSc.COMM_SELF,
    )  # fmt: skip
    for case, unstable_there in zip(cases, (True, False)):
        structure.set_load(case.load)
        found = structure.solve()
        assert found.converged
        assert [text.split(",")[0] for text in found.notices] == ["this equilibrium is unstable"] * unstable_there
