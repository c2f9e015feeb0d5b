"""What hangs on ropes, as the rod of a trapeze, chairs of a ropeway, the deck of a bridge: large displacements."""

import numpy as np
import pytest
from petsc4py import PETSc

import latinpc
from latinpc.bench.extremes.corotational import Corotational

pytestmark = [
    pytest.mark.filterwarnings("ignore::UserWarning"),
    pytest.mark.skipif(np.finfo(PETSc.RealType).eps > 1e-10, reason="the paths are those of double precision"),
]


def structure(nodes, members, fixed, load):
    """Return the structure. members: first node, second node, law, EA, natural length over that drawn."""
    first, second, law, EA, natural = zip(*members, strict=True)
    links, nodes = np.stack([first, second], 1), np.asarray(nodes, float)
    drawn = np.linalg.norm(nodes[links[:, 1]] - nodes[links[:, 0]], axis=1)
    natural = np.array(natural) * drawn
    return latinpc.Structure(
        nodes, links, law, np.array(EA) / natural, initial_elongation=drawn - natural, fixed=fixed, load=load,
        geometry="large", comm=PETSc.COMM_SELF,
    )  # fmt: skip


def trapeze(pieces, natural, load):
    """A rod on two ropes of 7 m, each of so many pieces, of these natural lengths over those drawn."""
    n = pieces + 1
    nodes = [[x, 0.0, 7.0 - 7.0 * i / pieces] for x in (-0.6, 0.6) for i in range(n)]
    places = [k * n + i for k in (0, 1) for i in range(pieces)]
    members = [(a, a + 1, "cable", 1.3e5, part) for a, part in zip(places, natural, strict=True)]
    fixed, loads = np.zeros((2 * n, 3), bool), np.zeros((2 * n, 3))
    fixed[[0, n]] = True
    loads[pieces], loads[-1] = load, [0.0, 0.0, -60.0]
    return structure(nodes, [*members, (pieces, 2 * n - 1, "bar", 1.3e7, 1.0)], fixed, loads)


def ropeway(spans, chairs, weight):
    """A rope without tension on towers, with chairs on hinged hangers, in a side wind."""
    count = spans * (chairs + 1)
    nodes, members = [[10.0 * i, 0.0, 0.0] for i in range(count + 1)], []
    fixed, load = [[i in (0, count)] * 3 for i in range(count + 1)], [[0.0, 0.0, 0.0]] * (count + 1)
    members += [(i, i + 1, "cable", 1.5e7, 1.0) for i in range(count)]
    for i in range(1, count):
        tower = i % (chairs + 1) == 0
        members.append((i, len(nodes), "bar", 1.5e8, 1.0))
        nodes.append([10.0 * i, 0.0, 1.5 if tower else -2.0])
        fixed.append([tower] * 3)
        load.append([0.0, 0.0 if tower or i % 3 else 0.2 * weight, 0.0 if tower else -weight * (1.0 if i % 2 else 0.2)])
    return structure(nodes, members, np.array(fixed), np.array(load))


def deck(panels, weight):
    """A truss that bears itself, with hangers to a cable that is drawn straight and 2 % longer than drawn."""
    n = panels + 1
    nodes = [[10.0 * i, z] for z in (20.0, 0.0, -5.0) for i in range(n)]
    members = [(i, i + 1, "cable", 3e8, 1.02) for i in range(panels)]
    members += [(i, n + i, "cable", 2e7, 1.0) for i in range(1, panels)]
    members += [(k + i, k + i + 1, "bar", 3e9, 1.0) for k in (n, 2 * n) for i in range(panels)]
    members += [(n + i, 2 * n + i + more, "bar", 3e9, 1.0) for more in (0, 1) for i in range(n - more)]
    fixed, load = np.zeros((3 * n, 2), bool), np.zeros((3 * n, 2))
    fixed[[0, panels, n]], fixed[n + panels, 1] = True, True
    load[n + 1 : n + panels, 1] = -weight
    return structure(nodes, members, fixed, load)


def solved(drawn):
    """Return the result, in balance."""
    found = drawn.solve(error=1e-8)
    assert found.converged, found.notices
    left = Corotational(drawn).unbalance(found.displacements.astype(np.longdouble))
    assert np.linalg.norm(left) < 1e-6 * np.linalg.norm(drawn.load)
    return found


def test_ropes_of_pieces_too_short_and_too_long():
    """Without loads displacements of 1e3 m counted as an equilibrium: there were no loads to compare the rest with."""
    for seed in range(20):
        natural = np.random.default_rng(seed).choice([1.014, 1.0, 0.9986], 8)
        solved(trapeze(4, natural, [50.0, 0.0, -40.0]))


@pytest.mark.parametrize("chairs", [6, 7])
def test_chairs_of_a_ropeway(chairs):
    """Where Newton's method had leapt away, operators were made, and their mechanism was an error of the solve."""
    for weight in (3e3, 6e3, 1e4, 1.5e4):
        solved(ropeway(4, chairs, weight))


@pytest.mark.parametrize("panels", [12, 16, 20])
def test_a_slack_cable_goes_along_with_the_deck(panels):
    """Forces on nodes that slack links leave free kept increments below a thousandth: 2,000 iterations and more."""
    assert solved(deck(panels, 1e5)).iterations < 300
