"""Nets some of whose cables slacken: where Newton's method starts, and what it claims."""

import sys

import numpy as np
import pytest
from conftest import ROOT
from petsc4py import PETSc

import latinpc

sys.path.insert(0, str(ROOT / "benchmarks"))

import large

pytestmark = pytest.mark.skipif(np.finfo(PETSc.RealType).eps > 1e-10, reason="the counts are those of double precision")


def saddle(meshes, load):
    """A saddle of squares of 1 m that rises by a fifth of its span, of cables of 1 MN with tensions of 1 kN."""
    i, j = np.meshgrid(np.arange(meshes + 1), np.arange(meshes + 1), indexing="ij")
    height = 0.2 * meshes * ((i / meshes - 0.5) ** 2 - (j / meshes - 0.5) ** 2)
    nodes = np.stack([i, j, height], -1).reshape(-1, 3).astype(float)
    number, rim = i * (meshes + 1) + j, (i % meshes == 0) | (j % meshes == 0)
    links = np.concatenate([np.stack([x[:-1], x[1:]], -1)[:, 1:-1].reshape(-1, 2) for x in (number, number.T)])
    lengths = np.linalg.norm(nodes[links[:, 1]] - nodes[links[:, 0]], axis=1) / (1.0 + 1e-3)
    fixed = np.repeat(rim.reshape(-1, 1), 3, 1)
    load = np.where(fixed, 0.0, load)
    return latinpc.Structure(
        nodes, links, "cable", 1e6 / lengths, prestress=1e3, fixed=fixed, load=load, geometry="large"
    )


def solve(structure):
    snes, u = structure.create_snes(PETSc.COMM_SELF), structure.create_vec()
    snes.setFromOptions()
    snes.solve(None, u)
    assert snes.getConvergedReason() > 0
    return u, 1 + latinpc.path(snes)["renewals"]


def test_newtons_method_starts_with_the_cables_slack_that_are():
    """From the strains of the local stage; from the lengths of its cables it takes another set-up."""
    structure = saddle(30, [0.0, 0.0, -500.0])
    u, setups = solve(structure)
    assert setups <= 3
    assert 0.0 < np.mean(structure.tensions(u) <= 0.0) < 0.1


def test_links_that_change_hide_no_error(options):
    """78 cables of a net in the wind have changed since the operators were made, and the last steps are small."""
    structure = latinpc.Structure.from_scene(large.scene("wind", 30), PETSc.COMM_SELF)
    u, _ = solve(structure)
    options("-snes_latin_error", "1e-10")
    exact, _ = solve(structure)
    assert (u - exact).norm() < 1e-4 * exact.norm()


@pytest.mark.parametrize("side", [92, pytest.param(140, marks=pytest.mark.slow)])
def test_a_front_of_cables_that_slacken_hides_no_error(options, side):
    """Steps of one length that each leave next to no forces: claimed at 1.2 and 15 times the error asked for."""
    structure = latinpc.Structure.from_scene(large.scene("saddle", side), PETSc.COMM_SELF)
    u, _ = solve(structure)
    options("-snes_latin_error", "1e-10")
    exact, _ = solve(structure)
    assert (u - exact).norm() < 1e-4 * exact.norm()
