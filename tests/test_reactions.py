"""Reactions and their balance with the loads: closed forms, and invariants of random structures."""

import pathlib
from dataclasses import replace

import meshio
import numpy as np
import oracle
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from petsc4py import PETSc
from random_structures import draws
from support import network

import latinpc
from latinpc.results.mechanics import Turned, balance, reactions

HALF = {"deadline": None, "database": None, "suppress_health_check": list(HealthCheck), "print_blob": True}
TIGHT = {"snes_max_it": 3000, "snes_latin_balance": 1e-7}


# ---- closed forms ----------------------------------------------------------------------------
@pytest.mark.parametrize("law", ["bar", "compression_only", "contact"])
def test_a_frame_on_a_pin_and_a_roller(law):
    """Statically determinate: the reactions do not depend on stiffnesses; moments about the pin."""
    span, rise, across, down = 4.0, 1.5, 3.0, 8.0
    frame = latinpc.Structure(
        nodes=[[0, 0], [span, 0], [span / 2, rise]],
        links=[[0, 1], [0, 2], [1, 2]],
        law=["bar", "bar", law],
        stiffness=[1e3, 2e3, 0 if law == "contact" else 5e2],
        fixed=[[1, 1], [0, 1], [0, 0]],
        load=[[0, 0], [7.0, 5.0], [across, -down]],
        comm=PETSc.COMM_SELF,
    )
    found = frame.solve(error=1e-8)
    right = (across * rise + down * span / 2) / span - 5.0
    expected = [[-7.0 - across, down - right - 5.0], [0, right], [0, 0]]
    assert found.reactions == pytest.approx(np.array(expected), rel=1e-6, abs=1e-6)
    assert found.balance.force < 1e-8 and found.balance.moment < 1e-8


def test_a_load_on_a_support_and_one_that_settles():
    """Two springs in a row, 0.3 m pulled: k / 2 of it; what loads a support goes straight into it."""
    row = latinpc.Structure(
        [[0], [1], [2]], [[0, 1], [1, 2]], "bar", 100.0, fixed=[[1], [0], [1]], prescribed=[[0], [0], [0.3]],
        load=[[-4.0], [0], [0]], comm=PETSc.COMM_SELF,
    )  # fmt: skip
    found = row.solve()
    assert found.reactions.ravel() == pytest.approx([4.0 - 15.0, 0, 15.0])
    assert found.balance.moment == 0


def test_prestress_bears_on_the_supports_without_a_load():
    star = latinpc.Structure(
        [[-1, 1], [1, 1], [0, -1], [0, 0]], [[0, 3], [1, 3], [2, 3]], "bar", 1e4, comm=PETSc.COMM_SELF,
        fixed=[[1, 1], [1, 1], [1, 1], [0, 0]], prestress=[3.0, 3.0, 3.0 * 2**0.5],
    )  # fmt: skip
    found = star.solve()
    assert np.abs(found.displacements).max() < 1e-12
    assert found.reactions[:3] == pytest.approx(np.array([[-3, 3], [3, 3], [0, -6]]) / 2**0.5)


def test_a_link_across_its_line_makes_a_couple():
    """A spring along y between nodes 1 m apart along x: equal forces on two lines, which turn."""
    springs = latinpc.Structure(
        [[0, 0], [1, 0]], [[0, 1], [0, 1]], "bar", [100.0, 50.0], fixed=[[1, 1], [0, 0]], load=[[0, 0], [0, -2.0]],
        direction=[[0, 0], [0, 1]], comm=PETSc.COMM_SELF,
    )  # fmt: skip
    found = springs.solve()
    assert found.reactions == pytest.approx(np.array([[0, 2.0], [0, 0]]), abs=1e-12)
    assert found.balance.force < 1e-12 and found.balance.moment < 1e-12
    assert not found.notices  # two links of two nodes, in two directions


def test_a_contact_with_friction_holds_what_slides():
    """A node pressed on the ground by 10 N and pushed by 2 N: the ground bears both."""
    found = latinpc.Structure(
        [[0, 0], [0, 0], [-1, 0]], [[0, 1], [0, 1], [1, 2]], ["friction", "tangent", "bar"], [0, 0, 1.0],
        fixed=[[1, 1], [0, 0], [1, 1]], load=[[0, 0], [2.0, -10.0], [0, 0]], friction=[0.5, 0, 0],
        direction=[[0, 1], [1, 0], [0, 0]], comm=PETSc.COMM_SELF,
    ).solve()  # fmt: skip
    assert found.converged
    assert found.reactions == pytest.approx(np.array([[-2, 10], [0, 0], [0, 0]]), abs=1e-3)


NORMALS = {"given": [0.0, 1.0], "of the nodes": None, "across": [0.6, 0.8]}


def slider(normal, **more):
    """A bar that ends on a contact with a support below, and slides along it by half its height."""
    return latinpc.Structure(
        [[0, 0], [1, 0], [1, -1]], [[0, 1], [2, 1]], ["bar", "contact"], [10.0, 0.0],
        direction=None if normal is None else [[0, 0], normal], fixed=[[1, 1], [0, 0], [1, 1]],
        load=[[0, 0], [5.0, -5.0], [0, 0]], geometry="large", **more,
    )  # fmt: skip


@pytest.mark.parametrize("normal", NORMALS.values(), ids=NORMALS)
def test_contacts_keep_their_normal_where_links_turn(normal):
    """The support bears along the normal, whatever the line to the node does; forces and couples balance."""
    found = slider(normal, comm=PETSc.COMM_SELF).solve(error=1e-10)
    n = np.array(NORMALS["given"] if normal is None else normal)
    assert np.linalg.norm(found.displacements[1]) > 0.4
    assert found.reactions[2] == pytest.approx(-found.tensions[1] * n, abs=1e-8)
    assert found.reactions.sum(axis=0) == pytest.approx([-5.0, 5.0], abs=1e-7)
    assert found.balance.force < 1e-8 and found.balance.moment < 1e-8
    assert not [text for text in found.notices if "strains reach" not in text]
    if n[1] == 1.0:  # as with small displacements: the bar does not leave its line
        assert found.reactions[2] == pytest.approx([0.0, 5.0], abs=1e-8)


def test_a_contact_whose_nodes_meet():
    """A displacement that leaves no line between them: the contact's own direction, and no line to make a couple."""
    structure, moved = slider(None, comm=PETSc.COMM_SELF), np.array([[0.0, 0.0], [0.0, -1.0], [0.0, 0.0]])
    turned, tensions = Turned(structure, moved), np.array([0.0, -5.0])
    found = reactions(turned, tensions, np.array([[0.0, 0.0], [0.0, -5.0], [0.0, 0.0]]))
    assert found[2] == pytest.approx([0.0, 5.0])
    assert balance(turned, tensions, found, np.array([[0.0, 0.0], [0.0, -5.0], [0.0, 0.0]])).moment < 1e-15


def test_elongations_of_links_that_turn(tmp_path):
    """Tensions over stiffnesses of the bar, the way along the normal of the contact; in tables and for ParaView."""
    found = slider(NORMALS["across"], comm=PETSc.COMM_SELF).solve(error=1e-10)
    expected = [found.tensions[0] / 10.0, found.displacements[1] @ NORMALS["across"]]
    assert found.members["elongation"] == pytest.approx(expected, abs=1e-9)
    found.to_vtu(tmp_path / "slider.vtu")
    assert meshio.read(tmp_path / "slider.vtu").cell_data["elongation"][0] == pytest.approx(expected, abs=1e-9)


RANKS = """
import sys
import numpy as np
import petsc4py
petsc4py.init(["p", "-skip_petscrc"])
from petsc4py import PETSc
import latinpc
from latinpc.arrays import block
from test_reactions import NORMALS, slider
comm = PETSc.COMM_WORLD.tompi4py()
for normal in NORMALS.values():
    whole = slider(normal)
    nodes = slice(*block(3, comm.rank, comm.size))
    links = [link for link in range(2) if link % comm.size == comm.rank]
    own = latinpc.LocalStructure(
        whole.nodes[nodes], whole.links[links], whole.law[links], whole.stiffness[links], fixed=whole.fixed[nodes],
        load=whole.load[nodes], direction=None if normal is None else whole.direction[links], geometry="large",
    )
    for found in (whole.solve(error=1e-9), own.solve(error=1e-9).gather()):
        assert found.balance.force < 1e-7 and found.balance.moment < 1e-7, (normal, found.balance)
        n = np.array([0.0, 1.0] if normal is None else normal)
        np.testing.assert_allclose(found.reactions[2], -found.tensions[1] * n, atol=1e-7)
"""


@pytest.mark.parametrize("ranks", [1, 2])
def test_contacts_keep_their_normal_on_ranks(mpirun, ranks):
    """The whole structure on every rank, and a part on each, gathered."""
    mpirun(ranks, f"import sys\nsys.path.insert(0, {str(pathlib.Path(__file__).parent)!r})\n{RANKS}")


# ---- invariants ------------------------------------------------------------------------------
@settings(max_examples=100, **HALF)
@given(draws(), st.integers(0, 2**16))
def test_links_leave_neither_force_nor_moment(draw, number):
    """Whatever the tensions: supports everywhere bear what the links and the loads put on them, equation (1)."""
    scene, rng = draw.scene(), np.random.default_rng(number)
    unit = 10.0**draw.force
    tensions, load = rng.normal(size=len(scene.links)) * unit, rng.normal(size=scene.nodes.shape) * unit
    held = replace(scene, fixed=np.ones_like(scene.fixed), load=load)
    found = reactions(held, tensions)
    b, _ = oracle.kinematics(held)
    assert found.ravel() == pytest.approx(b.T @ tensions - held.load.ravel(), abs=1e-12 * unit)
    left = balance(held, tensions, found)
    assert left.force < 1e-12 and left.moment < 1e-12
    wrong = found.copy()
    wrong[0, 0] += np.linalg.norm(load, axis=1).sum()  # as much as all loads
    assert balance(held, tensions, wrong).force == pytest.approx(1.0)
    if scene.dim > 1:  # two forces that turn the structure, and do not push it
        across = np.zeros(scene.dim)
        across[0], across[1] = scene.directions[0][1], -scene.directions[0][0]
        turned = found.copy()
        turned[scene.links[0]] += np.array([[1.0], [-1.0]]) * across * np.linalg.norm(load, axis=1).sum()
        arm = np.linalg.norm(across) ** 2 * scene.lengths[0]
        size = np.linalg.norm(held.nodes - held.nodes.mean(axis=0), axis=1).max()
        seen = balance(held, tensions, turned)
        assert seen.force < 1e-12 and seen.moment >= 0.99 * arm / size


@pytest.mark.filterwarnings("ignore:node .* moves:latinpc.LatinWarning")
@settings(max_examples=40, **HALF)
@given(draws())
def test_reactions_balance_the_loads(draw):
    """Solved: supports and loads, of every dimension, unit, law and partition."""
    found = draw.scene().solve(
        comm=PETSc.COMM_SELF, error=1e-8, options={"snes_max_it": 3000, "snes_latin_balance": 1e-7}
    )
    assert found.converged, (found.reason, found.notices)
    assert found.balance.force < 1e-6 and found.balance.moment < 1e-6
    free = ~found.structure.fixed
    assert (found.reactions[free] == 0).all()


def test_reactions_are_the_slope_of_the_energy():
    """A support that moves by d does the work R d: the envelope theorem, without any tension."""
    scene = network(nodes=80)
    node, axis = np.argwhere(scene.fixed)[3]
    energies = []
    for step in (1e-5, -1e-5):
        prescribed = scene.prescribed.copy()
        prescribed[node, axis] += step
        structure = latinpc.Structure.from_scene(replace(scene, prescribed=prescribed), comm=PETSc.COMM_SELF)
        u = structure.create_vec()
        found = structure.solve(error=1e-9)
        structure.set_displacements(found.displacements, u)
        energies.append(structure.energy(u))
    expected = scene.solve(comm=PETSc.COMM_SELF, error=1e-9).reactions[node, axis]
    assert (energies[0] - energies[1]) / 2e-5 == pytest.approx(expected, rel=1e-4)
