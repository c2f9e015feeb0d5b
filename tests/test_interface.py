"""Strong, weak and corner: what an interface is made of, whatever its nodes look like."""

from dataclasses import replace

import numpy as np
import oracle
import pytest
from support import VARIANTS, chain, grid, irregular, latin, lattice, network, settled, solve, statistics

import latinpc
from latinpc.scenes import Scene

TURN = np.linalg.qr(np.random.default_rng(7).normal(size=(3, 3)))[0]


def star(points, fixed=None, subdomains=2, seed=0):
    """Subdomains that share these nodes and nothing else: each holds them by bars to supports of its own."""
    points = np.atleast_2d(np.asarray(points, float))
    (n, dim), rng = points.shape, np.random.default_rng(seed)
    anchors = rng.normal(size=(subdomains, dim + 2, dim)) * 3.0 + points.mean(axis=0)
    nodes = np.vstack([points, anchors.reshape(-1, dim)])
    ends = [
        (node, n + s * (dim + 2) + a) for s in range(subdomains) for node in range(n) for a in range(dim + 2)
    ]  # every node would stand in one subdomain alone
    held = np.ones(nodes.shape, bool)
    held[:n] = False if fixed is None else fixed
    return Scene(
        name="star",
        nodes=nodes,
        links=ends,
        law=np.zeros(len(ends), int),
        stiffness=rng.uniform(1e3, 3e3, len(ends)),
        fixed=held,
        load=np.where(held, 0.0, rng.normal(size=nodes.shape)),
        subdomain=np.repeat(np.arange(subdomains), n * (dim + 2)),
    )


# name: nodes, fixed components of them, strong?, macro dofs of the interface
LINE = [[0.0, 0.1, 0.2], [1.0, 1.1, 1.2], [2.0, 2.1, 2.2]]
TRIANGLE = [[0.0, 0.0, 0.0], [1.0, 0.2, 0.1], [0.3, 1.0, -0.2]]
SQUARE = [*TRIANGLE, [1.3, 1.2, -0.1]]
SHAPES = {
    "3D, one node": ([[0.5, 0.5, 0.5]], None, False, 0),
    "3D, two nodes": (LINE[:2], None, False, 0),
    "3D, three nodes on a line": (LINE, None, False, 0),
    "3D, five nodes on a line": ([*LINE, [3.0, 3.1, 3.2], [7.0, 7.1, 7.2]], None, False, 0),
    "3D, almost on a line": (np.add(LINE, [[0, 0, 0], [0, 1e-9, 0], [0, 0, 0]]), None, False, 0),
    "3D, hardly bent": (np.add(LINE, [[0, 0, 0], [0, 1e-3, 0], [0, 0, 0]]), None, True, 9),
    "3D, four nodes at one point": ([[1.0, 2.0, 3.0]] * 4, None, False, 0),
    "3D, one point to rounding": (np.add([[0.1, 0.1, 0.1]] * 3, np.eye(3) * 2e-17), None, False, 0),
    "3D, three nodes at two points": ([*LINE[:2], LINE[0]], None, False, 0),
    "3D, triangle": (TRIANGLE, None, True, 9),
    "3D, triangle with a double node": ([*TRIANGLE, TRIANGLE[0]], None, True, 9),
    "3D, square": (SQUARE, None, True, 9),
    "3D, not in a plane": ([*SQUARE, [0.5, 0.5, 2.0]], None, True, 11),
    "3D, almost in a plane": ([*SQUARE, [0.65, 0.6, -0.05 + 1e-9]], None, True, 9),
    "3D, hardly out of a plane": ([*SQUARE, [0.65, 0.6, -0.05 + 1e-3]], None, True, 11),
    "3D, square with a prescribed node": (SQUARE, [[1], [0], [0], [0]], True, 9),
    "3D, square with two prescribed nodes": (SQUARE, [[1], [1], [0], [0]], False, 0),
    "3D, square with prescribed heights": (SQUARE, [[0, 0, 1]] * 4, True, 6),
    "3D, square with heights, one free": (SQUARE, [[0, 0, 1]] * 3 + [[0, 0, 0]], True, 7),
    "3D, triangle, one node on a rail": (TRIANGLE, [[0, 1, 1], [0, 0, 0], [0, 0, 0]], True, 7),
    "2D, one node": ([[0.0, 0.0]], None, False, 0),
    "2D, two nodes": ([[0.0, 0.0], [0.3, 0.1]], None, True, 4),
    "2D, two nodes at one point": ([[0.3, 0.1], [0.3, 0.1]], None, False, 0),
    "2D, three nodes on a line": ([[0.0, 0.0], [0.3, 0.1], [0.9, 0.3]], None, True, 4),
    "2D, four nodes": ([[0.0, 0.0], [0.3, 0.1], [0.5, 1.0], [2.0, 2.0]], None, True, 5),
    "2D, two nodes, one prescribed": ([[0.0, 0.0], [0.3, 0.1]], [[1], [0]], False, 0),
    "1D, one node": ([[0.3]], None, True, 1),
    "1D, three nodes": ([[0.0], [1.0], [5.0]], None, True, 1),
}


def moved(scene, shape):
    """Far away, in other units, and in 3D turned; prescribed components forbid turning."""
    turn = TURN if scene.dim == 3 and not scene.fixed[: len(np.atleast_2d(shape))].any() else np.eye(scene.dim)
    return replace(scene, nodes=(scene.nodes @ turn.T) * 1e-3 + 1.0)


@pytest.mark.parametrize("name", SHAPES)
def test_interface_by_its_shape(name):
    """Enough nodes not in line make an interface strong, with 9 modes in a plane; units and place do not matter."""
    points, fixed, strong, modes = SHAPES[name]
    scene = star(points, fixed)
    free = np.count_nonzero(~scene.fixed)
    for place in (scene, moved(scene, points)):
        for variant in VARIANTS:
            found = statistics(place, variant=variant)
            assert (found["strong_interfaces"], found["weak_interfaces"]) == ((1, 0) if strong else (0, 1))
            assert found["strong_macro_dofs"] == modes
            assert found["weak_dofs"] == (0 if strong or variant == "none" else free)
            kept = 2 * np.count_nonzero(~scene.fixed.all(axis=1)) if strong or variant == "none" else 0
            assert found["micro_sides"] == kept


@pytest.mark.parametrize("name", SHAPES)
def test_any_shape_is_solved(name):
    """All variants find the displacement of the structure, and the iterates are the oracle's."""
    points, fixed, _, _ = SHAPES[name]
    scene = star(points, fixed)
    reference = oracle.newton(scene)
    for variant in VARIANTS:
        result = solve(scene, variant=variant, stol=1e-12)
        assert result.reason > 0
        assert result.u == pytest.approx(reference, rel=1e-9, abs=1e-10 * abs(reference).max())
        first = oracle.latin_history(scene, 2, variant=variant).iterates
        for k in (1, 2):
            iterate = solve(scene, variant=variant, max_it=k, stol=0, outer_snes_type="nrichardson").u
            assert iterate == pytest.approx(first[k - 1], rel=1e-9, abs=1e-10 * abs(reference).max())


def test_prescribed_nodes_are_no_interface():
    """Where all displacements are prescribed subdomains do not meet; what else they share decides."""
    scene = settled(star([*SQUARE, [9.0, 9.0, 9.0]], [[1]] * 4 + [[0]]), size=0.1)
    for variant in VARIANTS:
        found = solve(scene, variant=variant, stol=1e-13)
        assert (found.statistics["strong_interfaces"], found.statistics["weak_interfaces"]) == (0, 1)
        assert found.statistics["weak_dofs"] == (0 if variant == "none" else 3)
        assert found.u == pytest.approx(oracle.newton(scene), rel=1e-10)


@pytest.mark.parametrize("subdomains", [3, 4, 6])
def test_weak_interfaces_that_meet_at_a_node_are_one(subdomains):
    """Trap 2: one displacement for all subdomains of the node, not one for each of their pairs."""
    scene = star([[0.0, 0.0, 0.0]], subdomains=subdomains)
    pairs = subdomains * (subdomains - 1) // 2
    for variant, dofs, sides in (("macro", 3, 0), ("corner", 3, 0), ("none", 0, 2 * pairs)):
        found = statistics(scene, variant=variant)
        assert found["weak_interfaces"] == pairs
        assert found["weak_dofs"] == dofs
        assert found["micro_sides"] == sides


@pytest.mark.parametrize("side", [2, 3, 4, 6])
def test_redundant_weak_interfaces_of_a_grid_are_recognised(side):
    """A cross-point has two weak interfaces: six unknowns, three, or none at all where strong ones imply them."""
    block = 2
    scene = grid("truss", modules=block * side, subdomains=side**2)
    faces, crosses = 2 * side * (side - 1), (side - 1) ** 2
    shared = [len(nodes) for pair, nodes in oracle.interfaces(scene, oracle.node_subdomains(scene)).items()]
    assert sum(size == 1 for size in shared) == 2 * crosses
    for variant, weak_dofs in (("macro", 6 * crosses), ("corner", 3 * crosses), ("none", 0)):
        found = statistics(scene, variant=variant)
        assert found["strong_interfaces"] == faces
        assert found["weak_interfaces"] == 2 * crosses
        assert found["strong_macro_dofs"] == 9 * faces
        assert found["weak_dofs"] == weak_dofs
        strong = sum(size for size in shared if size > 1)
        assert found["micro_sides"] == 2 * (strong - (4 * crosses if variant == "corner" else 0))


def test_weak_interfaces_that_nothing_implies_stay():
    """Variant none keeps the springs of a weak interface when no chain of strong ones replaces it."""
    # the second node joins two subdomains that share nothing else; the first three make a strong interface
    three = star([*TRIANGLE, [4.0, 4.0, 4.0]], subdomains=3)
    keep = np.array([s < 2 if node < 3 else s != 0 for s, node in zip(three.subdomain, three.links[:, 0])])
    scene = replace(
        three,
        links=three.links[keep],
        subdomain=three.subdomain[keep],
        **{name: getattr(three, name)[keep] for name in ("law", "stiffness", "initial_elongation")},
    )
    found = statistics(scene, variant="none")
    assert (found["strong_interfaces"], found["weak_interfaces"]) == (1, 1)
    assert found["micro_sides"] == 2 * 3 + 2 * 1
    assert statistics(scene, variant="corner")["micro_sides"] == 2 * 3


def test_springs_on_corners_are_dropped_or_kept():
    """As published the strong interfaces keep their springs at the cross-points, by default they do not."""
    free, published = (statistics(grid(), variant=variant)["micro_sides"] for variant in ("corner", "published"))
    assert published - free == 2 * 4 * 4


@pytest.mark.parametrize("make", [grid, irregular, network, lattice, chain])
@pytest.mark.parametrize("variant", VARIANTS)
def test_classes_of_nodes(make, variant):
    """Inside, on a strong interface, on a weak one, or with one displacement for several subdomains."""
    scene = make()
    model = oracle.build(scene, variant=variant)
    expected = np.zeros(len(scene.nodes), int)
    for pair, nodes in model.shared.items():
        expected[nodes] = np.maximum(expected[nodes], 1 if model.modes[pair] is not None else 2)
    expected[[node for node, groups in model.primal.items() if groups]] = 3
    with latin(scene, variant=variant) as run:
        run.snes.setUp()
        assert np.array_equal(latinpc.node_classes(run.snes), expected)


def test_nodes_of_three_subdomains_are_corners():
    """No node of three or more subdomains carries micro quantities, though all its interfaces may be strong."""
    scene = irregular()
    model = oracle.build(scene)
    weak = {node for pair, nodes in model.shared.items() if model.modes[pair] is None for node in nodes}
    three = [n for n, parts in enumerate(model.touching) if len(parts) > 2 and not scene.fixed[n].all()]
    with latin(scene) as run:
        run.snes.setUp()
        assert (latinpc.node_classes(run.snes)[three] == 3).all()
    assert not weak.issuperset(three)
