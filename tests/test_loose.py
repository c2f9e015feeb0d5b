"""Nodes whose displacements are not unique, as slack or yielding links alone hold them in some direction."""

import re
import warnings

import numpy as np
import pytest
from petsc4py import PETSc

import latinpc
from latinpc.results import mechanics
from latinpc.scenes import Law

KINDS = "links that are slack or yield|slack links|open contacts"
SAID = re.compile(rf"(?:{KINDS}) leave nodes? (\d+(?:, \d+)*)\D* free in some direction")


def line(laws, stiffness, e0, load):
    """Four nodes in line, both ends fixed, and three links between them."""
    return latinpc.Structure(
        [[0.0], [1.0], [2.0], [3.0]], [[0, 1], [1, 2], [2, 3]], laws, stiffness, initial_elongation=e0,
        fixed=[[1], [0], [0], [1]], load=[[0.0], [load], [1e-3], [0.0]], comm=PETSc.COMM_SELF,
    )  # fmt: skip


def named(result):
    found = [SAID.match(text) for text in result.notices]
    return [int(node) for match in found if match for node in match[1].split(", ")]


@pytest.mark.parametrize(("laws", "e0"), [
    ([Law.CABLE, Law.CABLE, Law.BAR], [-0.5, -0.5, 0.0]),
    ([Law.CONTACT, Law.CABLE, Law.BAR], [0.5, -0.5, 0.0]),
    ([Law.INEXTENSIBLE, Law.COMPRESSION_ONLY, Law.BAR], [-0.5, 0.5, 0.0]),
])  # fmt: skip
def test_a_node_between_slack_links_is_named(laws, e0):
    stiffness = [0.0 if law in (Law.CONTACT, Law.INEXTENSIBLE) else 10.0 for law in laws]
    found = line(laws, stiffness, e0, 0.0).solve()
    assert found.converged and named(found) == [1]
    assert found.tensions == pytest.approx([0.0, 0.0, -1e-3], abs=1e-8)


@pytest.mark.parametrize("laws", [[Law.CABLE, Law.CABLE, Law.BAR], [Law.CONTACT, Law.CABLE, Law.BAR]])
def test_cases_name_loose_nodes_as_a_solve_does(laws):
    """Alike cases in one sentence; side by side, or one after the other with a rigid law."""
    gap = -0.5 if laws[0] == Law.CABLE else 0.5
    structure = line(laws, [10.0 if law != Law.CONTACT else 0.0 for law in laws], [gap, -0.5, 0.0], 0.0)
    loads = {"still": 0.0, "pull": 6.0 if laws[0] == Law.CABLE else -6.0}
    cases = [latinpc.Case(name, load=[[0.0], [load], [0.0], [0.0]]) for name, load in loads.items()]
    (alone,) = structure.solve().notices
    for more, names in (([], "case still"), ([cases[0].named("again")], "cases still, again")):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            found = latinpc.solve_cases(structure, [*cases, *more])
        assert found.converged and [text for text in found.notices if SAID.search(text)] == [f"{names}: {alone}"]
        assert [str(warning.message) for warning in caught] == found.notices


def test_a_node_that_a_taut_link_or_a_load_holds_is_not_named():
    assert not named(line([Law.CABLE, Law.CABLE, Law.BAR], 10.0, [-0.5, -0.5, 0.0], 6.0).solve())
    assert not named(line([Law.BAR, Law.CABLE, Law.BAR], 10.0, [0.0, -0.5, 0.0], 0.0).solve())


def test_a_node_between_the_flat_parts_of_tables_is_named():
    flat = latinpc.register_table([-2.0, -1.0, 1.0, 2.0], [-10.0, 0.0, 0.0, 10.0])
    assert named(line([flat, flat, Law.BAR], [0.0, 0.0, 10.0], 0.0, 0.0).solve()) == [1]


def test_with_large_displacements_nodes_between_slack_cables_are_named():
    """A net that loses its prestress lies anywhere; a weight holds the nodes of the cables that bear it."""
    net = latinpc.scenes.make("saddle", side=3, prestress=1e3, load=0.0)
    inside = np.flatnonzero(~net.fixed.all(axis=1)).tolist()
    structure = latinpc.Structure.from_scene(net, comm=PETSc.COMM_SELF)
    assert not named(structure.solve())
    structure.set_initial_elongation(-0.01)
    assert named(structure.solve()) == inside
    load = np.zeros(net.nodes.shape)
    load[inside[0], 2] = -100.0
    structure.set_load(load)
    found = structure.solve(error=1e-8)
    assert found.converged and inside[0] not in named(found)
    none = 1e-8 * found.tensions.max()  # a node that lies on a stretched cable may stretch the next one by rounding
    assert all((found.tensions[(net.links == node).any(axis=1)] < none).all() for node in named(found))


@pytest.mark.parametrize(("longer", "free"), [(0.5, [2]), (0.02, [])])
@pytest.mark.parametrize("law", ["contact", "compression_only"])
def test_with_large_displacements_a_floor_holds_along_its_normal_alone(law, longer, free):
    """A node sinks by 0.3 to the floor: between slack cables it slides there, between taut ones it does not."""
    found = latinpc.Structure(
        [[0, 0], [2, 0], [1, 0], [1.5, -1]], [[0, 2], [1, 2], [3, 2]], ["cable", "cable", law],
        stiffness=[10.0, 10.0, 0.0 if law == "contact" else 1e6], initial_elongation=[-longer, -longer, 0.3],
        direction=[[0, 0], [0, 0], [0, 1]], fixed=[[1, 1], [1, 1], [0, 0], [1, 1]],
        load=[[0, 0], [0, 0], [0, -5], [0, 0]], geometry="large", comm=PETSc.COMM_SELF,
    ).solve()  # fmt: skip
    assert found.converged and found.displacements[2, 1] == pytest.approx(-0.3, abs=1e-4)
    assert named(found) == free


def random_net(rng):
    """Points in a plane, each joined to some others by links that are slack half of the time."""
    nodes = rng.uniform(0.0, 1.0, (9, 2))
    links = np.array([(i, j) for i in range(9) for j in range(i) if j >= i - 2 or rng.random() < 0.3])
    law = rng.choice([Law.CABLE, Law.CABLE, Law.COMPRESSION_ONLY, Law.BAR], len(links), p=[0.3, 0.3, 0.3, 0.1])
    fixed = np.zeros((9, 2), bool)
    fixed[:4] = True
    load = np.zeros((9, 2))
    load[4] = rng.normal(size=2)
    return latinpc.Structure(
        nodes, links, law, rng.uniform(1.0, 10.0, len(links)), rng.uniform(-0.1, 0.1, len(links)), fixed=fixed,
        load=load, comm=PETSc.COMM_SELF,
    )  # fmt: skip


def test_nodes_that_are_named_move_without_a_change_of_tension():
    """Each has a direction in which it moves, a little, and no tension changes."""
    rng, seen = np.random.default_rng(3), 0
    angles = np.linspace(0.0, np.pi, 1801)
    for _ in range(60):
        structure = random_net(rng)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                found = structure.solve(error=1e-8)
            except latinpc.LatinError:  # a mechanism with all links taut
                continue
        if not found.converged:
            continue
        for node in named(found):
            step = 1e-3 * np.abs(found.displacements).max()
            changes = []
            for angle in angles:
                moved = found.displacements.copy()
                moved[node] += step * np.array([np.cos(angle), np.sin(angle)])
                change = mechanics.tensions(structure, moved) - mechanics.tensions(structure, found.displacements)
                changes.append(np.abs(change).max())
            assert min(changes) <= 10.0 * step * 4e-3  # the direction is between two angles
            seen += 1
    assert seen > 20


@pytest.mark.parametrize("law", ["inextensible", "contact"])
def test_tight_links_that_bear_hold_a_node(law):
    """Displacements are rounding: whether a link has reached its length is seen by its tension."""
    rng = np.random.default_rng(0)
    for _ in range(50):
        ends = rng.normal(size=(2, 2))
        ends[:, 1] = np.abs(ends[:, 1]) + 0.3
        if law == "contact":
            ends[:, 1] *= -1.0
        pull = (ends / np.linalg.norm(ends, axis=1)[:, None]).sum(axis=0) * (-1.0 if law == "inextensible" else 1.0)
        found = latinpc.Structure(
            [*ends, [0.0, 0.0]], [[0, 2], [1, 2]], law, 0.0, fixed=[[1, 1], [1, 1], [0, 0]],
            load=[[0, 0], [0, 0], pull], comm=PETSc.COMM_SELF,
        ).solve()  # fmt: skip
        assert found.converged and not found.slack.any() and not named(found)


def test_open_contacts_are_called_so():
    """Grains are no slack links, and those of tables may yield."""
    for laws, e0, kind in (
        ([Law.CONTACT, Law.CONTACT, Law.BAR], [0.5, 0.5, 0.0], "open contacts"),
        ([Law.CONTACT, Law.CABLE, Law.BAR], [0.5, -0.5, 0.0], "slack links"),
    ):
        (text,) = line(laws, [0.0 if law == Law.CONTACT else 10.0 for law in laws], e0, 0.0).solve().notices
        assert text.startswith(f"{kind} leave node 1 free")


def test_summaries_call_cables_slack_and_contacts_open():
    text = str(line([Law.CONTACT, Law.CABLE, Law.BAR], [0.0, 10.0, 10.0], [0.5, -0.5, 0.0], 0.0).solve())
    assert re.search("slack +1 of 1 cable\n", text) and re.search("open +1 of 1 contact\n", text)
