"""The partition that METIS makes, and its repair: its cost counted independently, its bounds, the ranks."""

import json
import re
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from petsc4py import PETSc
from support import chain, grid, latin, lattice, network

import latinpc

BALANCE = 0.25
SOFT = 1e-2

SCENES = {
    "grid": lambda: grid(modules=12),
    "truss": lambda: grid("truss", modules=12),
    "network": lambda: network(nodes=300),
    "lattice": lambda: lattice(nx=24, ny=12),
}


def partition(scene, **options):
    """Subdomain of every link, as the solver makes it."""
    with latin(replace(scene, subdomain=None), **options) as run:
        run.snes.setUp()
        return latinpc.subdomain_of_links(run.snes)


def incident(scene):
    """Links at each node."""
    return [np.flatnonzero((scene.links == v).any(axis=1)) for v in range(len(scene.nodes))]


def held(scene, node, links):
    """Free directions in which these links hold a node."""
    n = scene.directions[links][:, ~scene.fixed[node]]
    return np.sum(np.linalg.svd(n, compute_uv=False) ** 2 > SOFT) if n.size else 0


def cost(scene, subdomain, node, links, corners):
    """1 for a second subdomain, and 1 for each direction that a subdomain misses; corners are held."""
    parts = np.unique(subdomain[links])
    if len(parts) < 2:
        return 0
    if len(parts) > 2 and corners:
        return 1
    whole = held(scene, node, links)
    return len(parts) - 1 + sum(whole - held(scene, node, links[subdomain[links] == p]) for p in parts)


def total(scene, subdomain):
    """Cost of a partition."""
    return sum(cost(scene, subdomain, v, at, True) for v, at in enumerate(incident(scene)))


@pytest.mark.parametrize("variant", ["corner", "macro"])
@pytest.mark.parametrize("name", SCENES)
def test_repair_keeps_the_sizes(name, variant):
    """No subdomain leaves the bounds of its size."""
    sizes = np.bincount(partition(SCENES[name](), subdomains=9, variant=variant))
    assert len(sizes) == 9
    assert (1 - BALANCE) * sizes.mean() <= sizes.min() and sizes.max() <= (1 + BALANCE) * sizes.mean()


@pytest.mark.parametrize("variant", ["corner", "macro"])
@pytest.mark.parametrize("name", ["truss", "lattice"])
def test_repair_ends_where_no_link_gains_by_moving(name, variant):
    """A link that goes over to a neighbour of its subdomain does not lower the cost, or the sizes forbid it."""
    scene, corners = SCENES[name](), variant == "corner"
    found = partition(scene, subdomains=9, variant=variant)
    at, sizes, mean = incident(scene), np.bincount(found), len(scene.links) / 9
    for link, ends in enumerate(scene.links):
        here = found[link]
        for there in {int(found[other]) for v in ends for other in at[v]} - {int(here)}:
            if sizes[there] + 1 > (1 + BALANCE) * mean or sizes[here] - 1 < (1 - BALANCE) * mean:
                continue
            moved = found.copy()
            moved[link] = there
            now = sum(cost(scene, found, v, at[v], corners) for v in ends)
            assert sum(cost(scene, moved, v, at[v], corners) for v in ends) >= now, (link, there)


def shared(scene, subdomain):
    """Count the nodes of two subdomains or more."""
    pairs = {(int(v), int(p)) for ends, p in zip(scene.links, subdomain) for v in ends}
    return sum(n > 1 for n in Counter(v for v, _ in pairs).values())


def test_metis_spares_nodes_whatever_their_links():
    """Interfaces of METIS have few nodes: of the order of those of square blocks."""
    scene = grid("truss", modules=12)
    assert shared(scene, partition(scene, subdomains=9)) <= 2 * shared(scene, scene.subdomain)


@pytest.mark.parametrize("name", SCENES)
def test_halves_share_few_nodes(name):
    """Two subdomains with a primal interface: like many links, hardly more nodes between them than METIS leaves."""
    scene = SCENES[name]()
    halves = partition(scene, subdomains=2, variant="primal")
    assert shared(scene, halves) <= 1.05 * shared(scene, partition(scene, subdomains=2, variant="corner"))
    assert np.bincount(halves).max() <= 0.55 * len(halves)


def test_halves_where_places_tell_nothing():
    """Planes would leave most nodes between them."""
    scene = lattice(nx=24, ny=12)
    shuffled = replace(scene, nodes=np.random.default_rng(1).permutation(scene.nodes))
    halves = partition(shuffled, subdomains=2, variant="primal")
    assert shared(scene, halves) <= 1.2 * shared(scene, partition(scene, subdomains=2, variant="primal"))


def test_a_chain_keeps_its_cuts():
    """In one dimension nothing dangles: one interface node between neighbours, which no repair can spare."""
    assert total(chain(), partition(chain(), subdomains=4)) == 3


@pytest.mark.parametrize("nodes", [60, 120])
def test_tiny_subdomains_are_not_emptied(nodes):
    """One, two or three links a subdomain: the repair takes no last link."""
    scene = network(nodes=nodes)
    for size in (1, 2, 3, 5):
        parts = -(-len(scene.links) // size)
        found = partition(scene, subdomains=parts)
        assert np.bincount(found).min() > 0
        assert found.max() + 1 <= parts


def balance(run):
    """Largest over mean that the view tells: links, degrees of freedom, ranks."""
    viewer = PETSc.Viewer().createASCII(str(run.folder / "view.txt"), comm=PETSc.COMM_SELF)
    run.snes.view(viewer)
    viewer.destroy()
    text = (run.folder / "view.txt").read_text()
    line = re.search(r"largest over mean: subdomains (\S+) in links, (\S+) in degrees of freedom; ranks (\S+) ", text)
    return [float(value) for value in line.groups()]


def test_the_view_tells_the_imbalance(tmp_path):
    """Counted from the partition itself."""
    scene = network(nodes=300)
    with latin(replace(scene, subdomain=None), subdomains=9) as run:
        run.folder = tmp_path
        run.snes.setUp()
        found = latinpc.subdomain_of_links(run.snes)
        told = balance(run)
    links = np.bincount(found)
    dofs = np.array([np.count_nonzero(~scene.fixed[np.unique(scene.links[found == p])]) for p in range(9)])
    assert told == [pytest.approx(x.max() / x.mean(), abs=6e-3) for x in (links, dofs)] + [1.0]


SIZES = """
import json, sys
import petsc4py
petsc4py.init(["p", "-skip_petscrc", "-snes_latin_variant", sys.argv[3]])
sys.path.insert(0, sys.argv[2])
from dataclasses import replace
import latinpc
from support import grid, lattice, latin, network
found, n = [], int(sys.argv[4])
for scene in (grid(modules=8 * n, partition="metis"), network(nodes=500 * n * n), lattice(nx=32 * n, ny=16 * n)):
    part = replace(scene, subdomain=None)
    with latin(part, latinpc.Structure.from_scene(part)) as run:
        run.snes.setUp()
        found.append(len(scene.links) / latinpc.statistics(run.snes)["subdomains"])
        rank = run.structure.comm.rank
if not rank:
    json.dump(found, open(sys.argv[1], "w"))
"""


def test_default_size(mpirun, tmp_path):
    """What costs least: one a rank, more of those with strong interfaces."""
    scenes = grid(modules=8, partition="metis"), network(nodes=500), lattice(nx=32, ny=16)

    def found(ranks, variant, size):
        mpirun(ranks, SIZES, tmp_path / "sizes.json", Path(__file__).parent, variant, size)
        return json.loads((tmp_path / "sizes.json").read_text())

    for ranks in (1, 2):
        assert found(ranks, "auto", 1) == [len(scene.links) / ranks for scene in scenes]
    corner = found(2, "corner", 2)
    assert all(543 <= size <= 724 for size in corner)  # 724 links at most, in four subdomains or more


PROGRAM = """
import sys
import numpy as np
import petsc4py
petsc4py.init(["p", "-skip_petscrc", "-snes_type", "latin", *sys.argv[2:]])
import latinpc
from latinpc.scenes import make
from mpi4py import MPI
structure = latinpc.Structure.from_scene(make("network", nodes=300, seed=5))
snes = structure.create_snes()
snes.setFromOptions()
snes.setUp()
found = latinpc.subdomain_of_links(snes)
if not MPI.COMM_WORLD.rank:
    np.savetxt(sys.argv[1], found, fmt="%d")
"""


def test_ranks_do_not_change_the_partition(mpirun, tmp_path):
    """Bit by bit the same on 1, 2 and 4 ranks, and at a second run."""
    found = []
    for run, ranks in enumerate((1, 1, 2, 4)):
        mpirun(ranks, PROGRAM, tmp_path / f"{run}.txt", "-snes_latin_subdomains", 7)
        found.append(np.loadtxt(tmp_path / f"{run}.txt", dtype=int))
    assert found[0].max() == 6
    assert all(np.array_equal(found[0], other) for other in found[1:])


def test_ranks_share_the_cost(mpirun, tmp_path):
    """Large and small subdomains, in this order: two ranks get like costs, not like numbers."""
    program = """
import numpy as np
import petsc4py
petsc4py.init(["p", "-skip_petscrc", "-snes_type", "latin"])
import latinpc
from dataclasses import replace
from latinpc.scenes import make
from mpi4py import MPI
scene = make("lattice", nx=32, ny=8, partition="metis")
x = scene.nodes[scene.links].mean(axis=1)[:, 0]
cuts = np.quantile(x, [0.25, 0.5, 0.6, 0.7, 0.8, 0.9])
structure = latinpc.Structure.from_scene(replace(scene, subdomain=np.searchsorted(cuts, x)))
snes = structure.create_snes()
snes.setFromOptions()
snes.setUp()
found = MPI.COMM_WORLD.gather(latinpc.subdomains(snes))
if found:
    print(found)
"""
    assert mpirun(2, program).stdout.strip() == "[(2, 0), (5, 2)]"
