"""Loads, tensions and displacements that are rounding beside others: solves say what they say without them."""

import numpy as np
import pytest
from petsc4py import PETSc

import latinpc


@pytest.mark.parametrize("load", [(0.0, 0.0), (6e-14, 0.0), (0.0, -6e-14)])
def test_loads_that_turning_others_leaves_are_none(load):
    """Two bars bear 1 kN; beside them a node hangs between cables that are too long, with 1e-16 of that load."""
    forces = np.zeros((7, 2))
    forces[2], forces[3] = (1e3 * np.cos(np.pi / 2), -1e3), load
    found = latinpc.Structure(
        [[-1, 0], [1, 0], [0, -1], [0, 3], [-1, 2], [1, 2], [0, 4.5]], [[0, 2], [1, 2], [4, 3], [5, 3], [6, 3]],
        ["bar"] * 2 + ["cable"] * 3, 1e6, initial_elongation=[0, 0] + [-1e-3] * 3,
        fixed=[[1, 1]] * 2 + [[0, 0]] * 2 + [[1, 1]] * 3, load=forces, comm=PETSc.COMM_SELF,
    ).solve()  # fmt: skip
    assert found.converged
    assert found.tensions == pytest.approx([1e3 / 2**0.5] * 2 + [0.0] * 3, abs=1e-6)
    assert any("leave node 3 free" in text for text in found.notices)


@pytest.mark.parametrize("scale", [1.0, 1e-3])
@pytest.mark.parametrize("k", [88.2307842319014, 1e6])
def test_rigid_links_without_gaps_hold_everything(scale, k):
    """Nothing moves; the tensions are those of statics."""
    nodes = scale * np.array(
        [
            [-377.15186803, 785.4265023],
            [488.6323516, 437.07624703],
            [-608.4149097, 994.64089499],
            [-455.32456552, 903.69],
        ]
    )
    load = 0.74426346
    found = latinpc.Structure(
        nodes, [(3, 2), (2, 1), (3, 0), (2, 0)], ["contact", "inextensible", "contact", "bar"], [0, 0, 0, k],
        fixed=[[1, 0], [1, 1], [0, 1], [1, 0]], load=[[0, 0]] * 3 + [[0, load]], comm=PETSc.COMM_SELF,
    ).solve()  # fmt: skip
    contact, cable = ((nodes[i] - nodes[2]) / np.linalg.norm(nodes[i] - nodes[2]) for i in (3, 1))
    pushes = load / contact[1]
    assert found.converged
    assert np.abs(found.displacements).max() < 1e-14 * scale * 1e3
    assert found.tensions == pytest.approx([pushes, -pushes * contact[0] / cable[0], 0.0, 0.0], abs=1e-9)


def test_a_cable_that_is_short_and_has_nothing_to_bear():
    """It pulls its free end along; bars beside it bear nothing."""
    found = latinpc.Structure(
        [[-956.0], [-420.0], [-608.0], [811.0], [-426.0]], [(2, 0), (3, 2), (2, 1), (4, 2)],
        ["inextensible"] * 2 + ["bar"] * 2, [0, 0, 2e5, 1e5], initial_elongation=[0, 0.0146, 0, 0],
        fixed=[[0], [1], [0], [0], [0]], comm=PETSc.COMM_SELF,
    ).solve()  # fmt: skip
    assert found.converged
    assert found.displacements[3, 0] <= -0.0146 * (1.0 - 1e-6)
    assert np.abs(np.delete(found.displacements, 3)).max() < 1e-12
    assert np.abs(found.tensions).max() < 1e-6


def test_a_jam_names_every_link_that_it_needs():
    """Three cables pull a node against a stop; the stop alone does not jam."""
    found = latinpc.Structure(
        [[0, 0], [-0.3, 1], [0.3, 1], [0, 1], [0, 0.5], [1, 0], [-1, 0]], [[i, 0] for i in range(1, 7)],
        ["inextensible"] * 3 + ["contact", "bar", "bar"], [0, 0, 0, 0, 1e5, 1e5],
        initial_elongation=[1e-3] * 3 + [0, 0, 0], fixed=[[0, 0]] + [[1, 1]] * 6, comm=PETSc.COMM_SELF,
    ).solve()  # fmt: skip
    assert not found.converged
    assert any("the gaps of the rigid links 0, 1, 2, 3 are incompatible" in text for text in found.notices)


@pytest.mark.parametrize("variant", ["macro", "none", "corner", "primal"])
def test_a_structure_that_nothing_supports_is_refused_by_every_variant(variant):
    nodes = np.random.default_rng(3).uniform(-10, 10, (6, 2))
    links = [(i, j) for i in range(6) for j in range(i)]
    options = {"snes_latin_variant": variant, "snes_latin_subdomains": 5}
    with pytest.raises(latinpc.SolveError, match="^Nothing is supported"):
        latinpc.Structure(nodes, links, "bar", 1e6, comm=PETSc.COMM_SELF).solve(options=options)
