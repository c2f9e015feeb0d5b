"""The partition that all ranks make: subdomains connected and of like size, the same again, costs as of METIS."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse
from conftest import run
from scipy.sparse.csgraph import connected_components
from support import grid, lattice, network
from test_partition import partition, total

import latinpc

SCENES = {
    "grid": (lambda: grid("truss", modules=12), 7),
    "network": (lambda: network(nodes=500), 9),
    "lattice": (lambda: lattice(nx=32, ny=16), 10),
}

PROGRAM = """
import json, sys
import petsc4py
petsc4py.init(["p", "-skip_petscrc"])
sys.path.insert(0, sys.argv[2])
from dataclasses import replace
import latinpc
from support import latin
from test_partition_parallel import SCENES
found = {}
for name, (make, parts) in SCENES.items():
    scene = replace(make(), subdomain=None)
    options = {"subdomains": parts, "partitioner": sys.argv[3], "error": 1e-8}
    with latin(scene, latinpc.Structure.from_scene(scene), **options) as run:
        u = run.structure.create_vec()
        run.snes.solve(None, u)
        found[name] = {
            "subdomain": latinpc.subdomain_of_links(run.snes).tolist(),
            "reason": int(run.snes.getConvergedReason()),
            "u": run.structure.displacements(u).tolist(),
        }
        rank = run.structure.comm.rank
if not rank:
    json.dump(found, open(sys.argv[1], "w"))
"""

pytestmark = pytest.mark.skipif(
    not (latinpc.solvers.has_package("ptscotch") or latinpc.solvers.has_package("parmetis")),
    reason="PETSc has neither PT-Scotch nor ParMETIS",
)


@pytest.fixture(scope="module", params=[1, 2, 4])
def found(request, tmp_path_factory):
    """What that many ranks find, twice."""
    folder, found = tmp_path_factory.mktemp("parallel"), []
    for name in ("first", "again"):
        script = folder / "program.py"
        script.write_text(PROGRAM)
        command = [sys.executable, script, folder / f"{name}.json", Path(__file__).parent, "parallel"]
        run(["mpirun", "-n", request.param, *command] if request.param > 1 else command)
        found.append(json.loads((folder / f"{name}.json").read_text()))
    return found


def pieces(scene, subdomain, part):
    """Count the connected pieces of a subdomain."""
    links = scene.links[subdomain == part]
    nodes, ends = np.unique(links, return_inverse=True)
    ends = ends.reshape(links.shape)
    graph = scipy.sparse.coo_matrix((np.ones(len(ends)), ends.T), shape=(len(nodes), len(nodes)))
    return connected_components(graph, directed=False)[0]


@pytest.mark.parametrize("name", SCENES)
def test_subdomains_are_connected_and_of_like_size(found, name):
    """None is empty, in two pieces, or far larger than the mean."""
    scene, parts = SCENES[name][0](), SCENES[name][1]
    subdomain = np.array(found[0][name]["subdomain"])
    sizes = np.bincount(subdomain, minlength=parts)
    assert len(sizes) == parts
    assert 0.6 * sizes.mean() <= sizes.min() and sizes.max() <= 1.3 * sizes.mean()
    assert [pieces(scene, subdomain, part) for part in range(parts)] == [1] * parts


@pytest.mark.parametrize("name", SCENES)
def test_cuts_cost_no_more_than_those_of_metis(found, name):
    """Nodes shared, and directions that they miss, within a third of METIS and its repair."""
    scene, parts = SCENES[name][0](), SCENES[name][1]
    assert total(scene, np.array(found[0][name]["subdomain"])) <= 4 / 3 * total(
        scene, partition(scene, subdomains=parts)
    )


@pytest.mark.parametrize("name", SCENES)
def test_solution_is_that_of_any_partition(found, name):
    """Converged means right, whatever the partition and the ranks."""
    reference = np.array(SCENES[name][0]().solve(error=1e-9).displacements)
    case = found[0][name]
    assert case["reason"] > 0
    assert np.linalg.norm(np.array(case["u"]) - reference) <= 1e-7 * np.linalg.norm(reference)


def test_a_second_run_makes_the_same_partition(found):
    """Bit by bit: states in files are of a partition."""
    for name in SCENES:
        assert found[0][name]["subdomain"] == found[1][name]["subdomain"], name


def test_two_apart_stay_two():
    """A structure in two pieces is partitioned as any other: nothing can connect its subdomains."""
    one = lattice(nx=16, ny=8)
    n = len(one.nodes)
    two = latinpc.Structure(
        np.vstack([one.nodes, one.nodes + [0.0, 100.0]]),
        np.vstack([one.links, one.links + n]),
        np.tile(one.law, 2),
        np.tile(one.stiffness, 2),
        np.tile(one.initial_elongation, 2),
        np.tile(one.fixed, (2, 1)),
        load=np.tile(one.load, (2, 1)),
    )
    result = two.solve(options={"snes_latin_partitioner": "parallel", "snes_latin_subdomains": 6})
    assert result.converged
    assert np.bincount(result.subdomain).min() > 0
    half = np.array_split(result.displacements, 2)
    np.testing.assert_allclose(half[0], half[1], atol=1e-3 * abs(half[0]).max())


def test_the_partitioner_is_a_setting():
    """In code as by the option; a misspelt one is refused."""
    scene = lattice(nx=16, ny=8)
    structure = latinpc.Structure.from_scene(replace(scene, subdomain=None))
    snes = structure.create_snes()
    latinpc.set_subdomains(snes, 5)
    latinpc.set_partitioner(snes, "parallel")
    snes.setUp()
    assert np.bincount(latinpc.subdomain_of_links(snes)).size == 5
    with pytest.raises(ValueError, match="partitioner must be one of auto, metis, parallel"):
        latinpc.set_partitioner(snes, "scotch")


LAST = """
import sys
import petsc4py
petsc4py.init(sys.argv)
import numpy as np
from petsc4py import PETSc
import latinpc
comm = PETSc.COMM_WORLD.tompi4py()
n, last = 9, comm.rank == comm.size - 1
at = np.arange(n * n).reshape(n, n)
pairs = [(at[:, :-1], at[:, 1:]), (at[:-1], at[1:]), (at[:-1, :-1], at[1:, 1:]), (at[:-1, 1:], at[1:, :-1])]
links = np.concatenate([np.stack([a.ravel(), b.ravel()], 1) for a, b in pairs])
nodes = np.stack([at.ravel() % n, at.ravel() // n], 1).astype(float)
load = np.where(nodes == n - 1, [[1.0, -2.0]], 0.0)
nodes, links, load = (array if last else array[:0] for array in (nodes, links, load))
part = latinpc.LocalStructure(
    nodes, links, "bar", 1000.0, fixed=np.repeat(nodes[:, 1:] == 0.0, 2, 1), load=load
)
snes, u = part.create_snes(), part.create_vec()
snes.setFromOptions()
snes.solve(None, u)
PETSc.Sys.Print("found", snes.getConvergedReason(), repr(u.norm()))
"""


@pytest.mark.parametrize("subdomains", [2, 3])
def test_ranks_without_nodes(tmp_path, subdomains):
    """All of the structure on the last of four ranks, fewer subdomains than ranks."""
    script, found = tmp_path / "last.py", []
    script.write_text(LAST)
    for partitioner in ("parallel", "metis"):
        options = ["-snes_latin_partitioner", partitioner, "-snes_latin_subdomains", subdomains]
        text = run(["mpirun", "-n", 4, sys.executable, script, *options]).stdout
        found.append([float(word) for word in text.split("found")[1].split()])
    assert found[0][0] > 0
    assert found[0][1] == pytest.approx(found[1][1], rel=1e-6)


AGAIN = """
import json, sys
import petsc4py
petsc4py.init(["p", "-skip_petscrc"])
import latinpc
from latinpc.scenes import make
found = []
for nodes in (40, 200):
    structure = latinpc.Structure.from_scene(make("network", nodes=nodes))
    for _ in range(3):
        snes = structure.create_snes()
        latinpc.set_partitioner(snes, "parallel")
        latinpc.set_subdomains(snes, 4)
        snes.setFromOptions()
        snes.setUp()
        found.append(latinpc.subdomain_of_links(snes).tolist())
        snes.destroy()
if not structure.comm.rank:
    print(json.dumps(found))
"""


def test_the_same_again_in_one_program(mpirun):
    """Random numbers of PT-Scotch had gone on from one partition to the next."""
    found = json.loads(mpirun(4, AGAIN).stdout)
    assert found[0] == found[1] == found[2] and found[3] == found[4] == found[5]
