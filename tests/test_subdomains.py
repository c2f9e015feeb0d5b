"""Sharing the links out: METIS, a given partition, a label; and the subdomains that come of it."""

from dataclasses import replace

import numpy as np
import oracle
import pytest
from petsc4py import PETSc
from support import chain, grid, irregular, latin, lattice, network, settled, solve, statistics, with_partition

import latinpc


def without(scene):
    """Make the same structure without partition."""
    return replace(scene, subdomain=None)


def partition(scene, **options):
    """Subdomain of every link, as the solver has it."""
    with latin(scene, **options) as run:
        run.snes.setUp()
        return latinpc.subdomain_of_links(run.snes)


def entries(structure, scene):
    """Which entry of a global vector each free component of a node is, -1 where prescribed; (n, dim)."""
    u = structure.create_vec()
    u.setValues(range(u.getSize()), np.arange(u.getSize()) + 1.0)
    u.assemble()
    return np.where(scene.fixed, -1, np.rint(structure.displacements(u)).astype(int) - 1)


def shared_nodes(scene, subdomain):
    """Number of copies of nodes beyond the first."""
    pairs = np.unique(np.column_stack([np.repeat(subdomain, 2), scene.links.ravel()]), axis=0)
    return len(pairs) - len(np.unique(scene.links))


@pytest.mark.parametrize("make", [grid, irregular, network, lattice, chain])
def test_subdomains_hold_the_dofs_of_their_links(make):
    """The index sets are what the links touch, free components only, and together they cover the structure."""
    scene = settled(make())
    with latin(scene) as run:
        run.snes.setUp()
        where = entries(run.structure, scene)
        count, first = latinpc.subdomains(run.snes)
        assert (count, first) == (scene.n_subdomains, 0)
        copies = np.zeros(run.structure.sizes.free_dofs, int)
        for i in range(count):
            mine = latinpc.subdomain_is(run.snes, i).getIndices()
            touched = where[np.unique(scene.links[scene.subdomain == i])].ravel()
            assert np.array_equal(mine, np.sort(touched[touched >= 0]))
            copies[mine] += 1
    multiplicity = np.repeat([len(parts) for parts in oracle.node_subdomains(scene)], scene.dim)
    assert np.array_equal(copies[where[where >= 0]], multiplicity[where.ravel() >= 0])


@pytest.mark.parametrize("parts", [1, 2, 7, 40])
def test_metis_makes_as_many_parts_as_asked_for_of_like_size(parts):
    """Every subdomain has links, none many more than its share, and a second run makes the same cut."""
    scene = without(network(nodes=200))
    found = partition(scene, subdomains=parts)
    sizes = np.bincount(found)
    assert len(sizes) == parts
    assert sizes.min() > 0
    assert sizes.max() <= 1.25 * len(found) / parts + 2
    assert np.array_equal(found, partition(scene, subdomains=parts))


def test_metis_cuts_few_nodes():
    """The interfaces are far smaller than those of a partition that knows nothing of the structure."""
    scene = without(grid("truss", modules=12))
    found = partition(scene, subdomains=9)
    blind = np.random.default_rng(0).permutation(found)
    assert shared_nodes(scene, found) < shared_nodes(scene, blind) / 5


@pytest.mark.parametrize("parts", [1, 4, 5, 24])
def test_number_of_subdomains_of_a_chain(parts):
    """A subdomain per link is the finest cut."""
    found = partition(without(chain()), subdomains=parts)
    assert found.max() + 1 == parts
    assert (np.bincount(found) > 0).all()


def test_given_partition_is_kept():
    """Numbers, order and emptiness are the caller's business; the solver does not touch them."""
    scene = irregular()
    assert np.array_equal(partition(scene), scene.subdomain)


def test_partition_given_later_counts():
    """A new partition after a solve is taken up by the next one, which still finds the same displacement."""
    scene = grid()
    with latin(scene, stol=1e-9) as run:
        u, v = run.structure.create_vec(), run.structure.create_vec()
        run.snes.solve(None, u)
        other = irregular(modules=6, parts=4).subdomain
        latinpc.set_partition(run.snes, other)
        run.snes.solve(None, v)
        assert latinpc.statistics(run.snes)["subdomains"] == 4
        assert np.array_equal(latinpc.subdomain_of_links(run.snes), other)
        assert run.snes.getConvergedReason() > 0
        assert (u - v).norm() < 1e-7 * u.norm()


def test_a_partition_of_the_solver_comes_before_that_of_the_structure():
    """The structure keeps its own, for other solvers."""
    scene = grid()
    other = np.arange(len(scene.links)) % 2
    with latin(scene) as run, latin(scene, run.structure) as second:
        latinpc.set_partition(run.snes, other)
        run.snes.setUp()
        second.snes.setUp()
        assert np.array_equal(latinpc.subdomain_of_links(run.snes), other)
        assert np.array_equal(latinpc.subdomain_of_links(second.snes), scene.subdomain)


@pytest.mark.parametrize(
    ("options", "scene", "message"),
    [
        ({"subdomains": 25}, without(chain()), "Cannot make 25 subdomains of 24 links"),
        ({"subdomains": 3}, chain(), "has 4 subdomains, not the 3 asked for"),
        ({"subdomains": -1}, without(chain()), "-1"),
    ],
)
def test_impossible_partitions_are_refused(options, scene, message):
    """Too many subdomains, and two answers to one question."""
    with pytest.raises(PETSc.Error) as caught:
        statistics(scene, **options)
    assert message in latinpc.error_message(caught.value)


def test_links_of_a_subdomain_need_not_hang_together():
    """A subdomain in two pieces is one subdomain; the answer is the same."""
    scene = grid()
    pieces = with_partition(scene, np.where(scene.subdomain == 8, 0, scene.subdomain))
    reference = oracle.newton(scene)
    result = solve(pieces, _reference=reference, stol=1e-10)
    assert result.statistics["subdomains"] == 8
    assert result.history.error_l2[-1] < 1e-8


def test_a_subdomain_alone_needs_no_interface():
    """Two structures side by side, a subdomain each, do not meet: no interface, no coarse problem."""
    one = chain()
    both = replace(
        one,
        nodes=np.vstack([one.nodes, one.nodes + 1000.0]),
        links=np.vstack([one.links, one.links + len(one.nodes)]),
        subdomain=np.repeat([0, 1], len(one.links)),
        **{name: np.concatenate([getattr(one, name)] * 2) for name in ("law", "stiffness", "initial_elongation")},
        **{name: np.vstack([getattr(one, name)] * 2) for name in ("fixed", "prescribed", "load")},
    )
    result = solve(both)
    assert result.statistics["strong_interfaces"] == result.statistics["weak_interfaces"] == 0
    assert result.statistics["state_size"] == 0
    assert result.iterations == 1
    assert result.u == pytest.approx(oracle.newton(both), rel=1e-11)
