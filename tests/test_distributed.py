"""Structures of which each rank gives its part: the same solution as the whole, errors named on every rank, files."""

import json
from dataclasses import replace
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest
from support import chain, grid

import latinpc
from latinpc.scenes import make
from latinpc.scenes.tensegrity_grid import grid_part

SOLVE = """
import json, sys
import numpy as np
import petsc4py
petsc4py.init(["p", "-skip_petscrc"])
from petsc4py import PETSc
import latinpc
from latinpc.arrays import block
from latinpc.scenes import make
comm = PETSc.COMM_WORLD.tompi4py()

def shared(scene, seed=0, **more):
    # nodes in blocks, each link on a rank drawn at random
    nodes = slice(*block(len(scene.nodes), comm.rank, comm.size))
    links = np.flatnonzero(np.random.default_rng(seed).integers(comm.size, size=len(scene.links)) == comm.rank)
    return latinpc.LocalStructure(
        scene.nodes[nodes], scene.links[links], scene.law[links], scene.stiffness[links],
        scene.initial_elongation[links], scene.fixed[nodes], scene.prescribed[nodes], scene.load[nodes],
        direction=None if scene.direction is None else scene.direction[links], area=np.full(len(links), 1e-4),
        strength=np.full(len(links), 1e8), **more
    ), links

found = {}
for name, how in json.loads(sys.argv[2]).items():
    scene, geometry = make(name, **how), "prestress" if name == "saddle" else None
    structure, links = shared(scene, geometry=geometry or scene.geometry)
    own = structure.solve(error=1e-8)
    assert own.displacements.shape == structure.nodes.shape and own.tensions.shape == (len(links),)
    whole, order = own.gather(), np.concatenate(comm.allgather(links))
    tensions = np.empty(len(order))
    tensions[order] = whole.tensions
    found[name] = {
        "u": whole.displacements.tolist(), "tensions": tensions.tolist(), "reactions": whole.reactions.tolist(),
        "converged": own.converged, "slack": int(whole.slack.sum()), "summary": len(str(whole)),
    }
    mine = np.concatenate(comm.allgather(own.reactions()))
    np.testing.assert_allclose(mine, whole.reactions, atol=1e-9 * abs(mine).max())
    assert comm.allreduce(own.gather(root=0) is not None) == 1
    if name in ("mast", "saddle"):
        own.to_vtu(f"{sys.argv[1]}.{name}.pvtu")
        comm.rank or whole.to_vtu(f"{sys.argv[1]}.{name}.vtu")
    reports = comm.allgather(json.dumps(own.report))
    assert all(text == reports[0] for text in reports)
if not comm.rank:
    json.dump(found, open(sys.argv[1], "w"))
"""


def compare_files(parts, ranks, whole=None):
    """Hold an index and its pieces against one file: each link once, every array, ghosts with the values of nodes."""
    index = parts.with_name(f"{parts.name}.pvtu").read_text()
    pieces = [meshio.read(parts / f"{rank:05d}.vtu") for rank in range(ranks)]
    whole = meshio.read(whole or parts.with_name(f"{parts.name}.vtu"))
    assert index.count("<Piece ") == ranks
    for name in [*whole.point_data, *whole.cell_data]:
        assert index.count(f'Name="{name}"') == 1, name
    names = [name for name in whole.cell_data if name != "subdomain"]

    def rows(mesh):
        middle = mesh.points[mesh.cells[0].data].mean(axis=1)
        return np.column_stack([middle, *(mesh.cell_data[name][0] for name in names)])

    mine, theirs = (np.vstack([rows(mesh) for mesh in meshes]) for meshes in (pieces, [whole]))
    assert mine.shape == theirs.shape
    order = [np.lexsort(np.round(values, 6).T[2::-1]) for values in (mine, theirs)]
    np.testing.assert_allclose(mine[order[0]], theirs[order[1]], rtol=1e-6, atol=1e-6)
    at = {tuple(x): node for node, x in enumerate(np.round(whole.points, 6))}
    for mesh in pieces:
        nodes = [at[tuple(x)] for x in np.round(mesh.points, 6)]
        for name in ("displacement", "load", "fixed", "reaction"):
            values = whole.point_data[name]
            np.testing.assert_allclose(mesh.point_data[name], values[nodes], atol=1e-9 * (abs(values).max() or 1.0))


#: The mast has large displacements, the saddle those of its prestress
IN_PARTS = {"network": {"nodes": 200}, "lattice": {"nx": 12, "ny": 8}, "net": {}, "mast": {}, "saddle": {}}


@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_parts_solve_as_the_whole(mpirun, tmp_path, ranks):
    """Links anywhere, nodes in blocks: displacements, tensions, reactions and counts of the whole structure."""
    mpirun(ranks, SOLVE, tmp_path / "found.json", json.dumps(IN_PARTS))
    found = json.loads((tmp_path / "found.json").read_text())
    for name, how in IN_PARTS.items():
        scene = make(name, **how)
        whole, mine = replace(scene, geometry="prestress" if name == "saddle" else scene.geometry), found[name]
        whole = whole.solve(error=1e-8)
        assert mine["converged"] and whole.converged
        assert mine["slack"] == whole.slack.sum()
        for key, values in (("u", whole.displacements), ("tensions", whole.tensions), ("reactions", whole.reactions)):
            far = np.linalg.norm(np.array(mine[key]) - values)
            assert far <= 1e-6 * np.linalg.norm(values), (name, key)
    for name in ("mast", "saddle"):
        compare_files(tmp_path / f"found.json.{name}", ranks)


@pytest.mark.parametrize("ranks", [1, 3, 4])
@pytest.mark.parametrize(
    "options", [{}, {"partition": "metis", "module": "modified"}, {"subdomains": 4, "slack": 0.02}]
)
def test_grids_are_made_in_parts(ranks, options):
    """The parts of all ranks, put together, are the scene: nodes in its order, links as a set."""
    whole = grid(modules=8, **{"subdomains": None} | options)
    parts = [grid_part("tensegrity-grid", 8, **options, rank=rank, ranks=ranks)[0] for rank in range(ranks)]
    for name in ("nodes", "fixed", "load"):
        assert np.array_equal(np.concatenate([part[name] for part in parts]), getattr(whole, name)), name
    of_links = ("links", "law", "stiffness", "initial_elongation", "subdomain")

    def rows(arrays):
        given = [arrays[name] for name in of_links if arrays[name] is not None]
        return sorted(map(tuple, np.column_stack(given).tolist()))

    together = {name: parts[0][name] for name in of_links}
    together |= {name: np.concatenate([p[name] for p in parts]) for name in of_links if parts[0][name] is not None}
    assert rows(together) == rows(vars(whole))
    assert max(len(part["links"]) for part in parts) <= 1.5 * len(whole.links) / ranks


GRID = """
import sys
import numpy as np
import petsc4py
petsc4py.init(["p", "-skip_petscrc"])
import latinpc
from latinpc.scenes import make
for partition in ("regular", "metis"):
    own = latinpc.local_scene("tensegrity-grid", modules=8, partition=partition).solve()
    whole = make("tensegrity-grid", modules=8, partition=partition).solve()
    both = own.gather()
    assert own.iterations == whole.iterations, (own.iterations, whole.iterations)
    np.testing.assert_allclose(both.displacements, whole.displacements, atol=1e-9)
own.to_vtu(sys.argv[1])
if own.structure.comm.rank == 0:
    whole.to_vtu(sys.argv[2])
"""


@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_a_grid_in_parts_and_its_files(mpirun, tmp_path, ranks):
    """As many iterations as the whole; the files of the ranks have each link once, with the values of the one file."""
    mpirun(ranks, GRID, tmp_path / "parts.pvtu", tmp_path / "whole.vtu")
    compare_files(tmp_path / "parts", ranks, tmp_path / "whole.vtu")


BAD = """
import sys
import numpy as np
import petsc4py
petsc4py.init(["p", "-skip_petscrc"])
from petsc4py import PETSc
import latinpc
comm = PETSc.COMM_WORLD.tompi4py()
last = comm.rank == comm.size - 1

def make(everywhere={}, **wrong):
    # a row of cables, three nodes a rank
    nodes = 3.0 * comm.rank + np.arange(3.0)[:, None]
    links = 3 * comm.rank + np.array([[-1, 0], [0, 1], [1, 2]])[0 if comm.rank else 1:]
    given = {"nodes": nodes, "links": links, "law": "bar", "stiffness": 1.0, "fixed": np.zeros((3, 1), bool)}
    given["fixed"][0] = comm.rank == 0
    return latinpc.LocalStructure(**(given | everywhere | (wrong if last else {})))

structure = make()
structure.set_load(np.ones((3, 1)))
assert structure.solve().converged
first = 3 * (comm.size - 1)
ahead = 3 * comm.rank + np.array([[0, 1], [1, 2], [2, 3]])[: 2 if last else 3]  # the rank before has the node at a link
cases = {
    "node 0 ([nan]) has a coordinate that is not finite": lambda: make(
        {"links": ahead}, nodes=[[np.nan], [first + 1], [first + 2]]
    ),
    "joins a node that does not exist": lambda: make(links=[[first, first + 3]]),
    "joins a node to itself": lambda: make(links=[[first, first]]),
    "a positive stiffness": lambda: make(stiffness=-1.0),
    "must be an (n, dim) array": lambda: make(nodes=np.zeros(3)),
    "law must have the shape": lambda: make(law=5 * ["bar"]),
    "a positive EA": lambda: make({"stiffness": None, "EA": 1.0}, EA=-1.0),
    " no length": lambda: make(nodes=np.full((3, 1), first + 0.5)),
    "load must have the shape": lambda: structure.set_load(np.zeros((9, 1)) if last else np.zeros((3, 1))),
    "not fixed": lambda: structure.set_prescribed(np.ones((3, 1)) if last else np.zeros((3, 1))),
}
for text, call in cases.items():
    try:
        call()
    except ValueError as error:
        where = f"rank {comm.size - 1}: " if comm.size > 1 else ""
        assert text in str(error) and where in str(error), (text, str(error))
    else:
        raise SystemExit(f"nothing was said: {text}")
for text, call in {
    "coordinates on one rank": lambda: make(nodes=np.zeros((3, 2)), fixed=np.zeros((3, 2), bool)),
    "given on some ranks": lambda: make(mass=1.0),
    "stiffness is given on some ranks": lambda: make(stiffness=None, EA=1.0),
    "prestress is given on some ranks": lambda: make(prestress=1.0),
    "give either stiffness": lambda: make({"EA": 1.0}),
    "differ in geometry: 'linear' on rank 0, 'foo' on rank": lambda: make(geometry="foo"),
    "differ in geometry: 'linear' on rank 0, 'prestress'": lambda: structure.set_geometry(
        "prestress" if last else "linear"
    ),
    "differ in error: None on rank 0, -1 on rank": lambda: structure.solve(error=-1 if last else None),
    "differ in largest_unbalance": lambda: structure.solve(largest_unbalance=-1 if last else None),
    "differ in preset": lambda: structure.solve(preset="foo" if last else "fast"),
    "differ in options: {'snes_max_it': 9} on rank 0, 3 on": lambda: structure.solve(
        options=3 if last else {"snes_max_it": 9}
    ),
    "differ in root: None on rank 0, 77 on rank": lambda: structure.solve().gather(root=77 if last else None),
    "differ in path": lambda: structure.solve().to_vtu("no.vtu" if last else "no.pvtu"),
    "differ in modules": lambda: latinpc.local_scene("tensegrity-grid", modules=-4 if last else 4),
    "differ in parts: not given on rank 0, 2 on": lambda: latinpc.local_scene(
        "tensegrity-grid", modules=4, **({"parts": 2} if last else {})
    ),
}.items():
    if comm.size == 1:
        break
    try:
        call()
    except ValueError as error:
        assert text in str(error), str(error)
    else:
        raise SystemExit(f"nothing was said: {text}")
try:
    structure.solve().gather(root=comm.size)
except ValueError as error:
    assert "is none of the ranks" in str(error), str(error)
try:
    structure.solve().to_vtu(sys.argv[1])
except OSError as error:
    print("named")
comm.barrier()
"""


@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_bad_parts_are_named_on_every_rank(mpirun, tmp_path, ranks):
    """An error of the last rank is one of all, with its number, and so is what it alone is given; nothing waits."""
    (tmp_path / "file").write_text("")
    run = mpirun(ranks, BAD, tmp_path / "file" / "no.pvtu")
    assert run.stdout.count("named") == ranks


EXTENSIBLE = """
import numpy as np
import petsc4py
petsc4py.init(["p", "-skip_petscrc"])
from petsc4py import PETSc
import latinpc
rank, x = PETSc.COMM_WORLD.rank, np.array([0.0, 1.0, 3.0, 6.0])
own = slice(2 * rank, 2 * rank + 2)
s = latinpc.LocalStructure(
    x[own, None], [[0, 1], [1, 2]] if rank else [[2, 3]], "bar", EA=2.0, fixed=x[own, None] == 0.0,
    load=np.where(x[own, None] == 6.0, 1.0, 0.0),
)
np.testing.assert_allclose(s.stiffness, [2.0, 1.0] if rank else [2.0 / 3.0])
np.testing.assert_allclose(s.solve().displacements[:, 0], x[own] / 2.0)
"""


def test_axial_stiffness_is_divided_by_lengths_between_ranks(mpirun):
    """Links carry the numbers of all ranks, and lie on any: their lengths need the nodes of the others."""
    mpirun(2, EXTENSIBLE, timeout=60)


EMPTY = """
import numpy as np
import petsc4py
petsc4py.init(["p", "-skip_petscrc"])
from petsc4py import PETSc
import latinpc
rank, n = PETSc.COMM_WORLD.rank, 5
nodes = np.arange(float(n if rank == 1 else 0))[:, None]
links = np.column_stack([np.arange(n - 1), np.arange(1, n)]) if rank == 0 else np.zeros((0, 2), int)
fixed = nodes == 0
s = latinpc.LocalStructure(nodes, links, "bar", 2.0, fixed=fixed, load=np.where(fixed, 0.0, 1.0))
r = s.solve()
r.to_vtu("{path}")
whole = r.gather()
np.testing.assert_allclose(whole.tensions, [4, 3, 2, 1])
np.testing.assert_allclose(whole.displacements[:, 0], [0, 2, 3.5, 4.5, 5])
"""


def test_ranks_without_nodes_or_links(mpirun, tmp_path):
    """One rank gives all links, another all nodes, a third nothing."""
    mpirun(3, EMPTY.replace("{path}", str(tmp_path / "chain.pvtu")))


WARM = """
import numpy as np
import petsc4py
petsc4py.init(["p", "-skip_petscrc"])
from petsc4py import PETSc
import latinpc
from latinpc.options import default_options
own = slice(0, 0 if PETSc.COMM_WORLD.rank else None)  # all links on rank 0
cut = latinpc.LocalStructure(
    np.array([[0.0, 0.0], [2.0, 0.0], [1.0, -0.5], [1.0, -1.0]])[own], np.array([[0, 2], [1, 2], [3, 2]])[own],
    ["bar", "bar", "contact"][own], np.array([1.0, 2.0, 0.0])[own],
    fixed=np.array([[1, 1], [1, 1], [0, 0], [1, 1]])[own], load=np.array([[0, 0], [0, 0], [0.1, -1.0], [0, 0]])[own],
)
with default_options({"snes_latin_warm_start": "last", "snes_latin_error": 1e-8, "snes_latin_subdomains": 3}):
    snes, u = cut.create_snes(), cut.create_vec()
    snes.setFromOptions()
for _ in range(2):
    snes.solve(None, u)
    assert snes.getConvergedReason() > 0 and snes.getLinearSolveIterations() > 0  # Newton's method has ended it
    known = np.array([1 / 720**0.5, -2 / 720**0.5, -61 / 60])[own]
    np.testing.assert_allclose(latinpc.tensions(snes), known, rtol=1e-6)
"""


def test_a_warm_start_with_a_rank_without_links(mpirun):
    """The rank did not take part in the exchange of the tensions of rigid links: the others waited for it forever."""
    mpirun(2, WARM, timeout=60)


def test_a_part_is_not_drawn_and_scenes_that_are_whole_are_named():
    """What needs the whole says so."""
    scene = chain()
    structure = latinpc.LocalStructure(
        scene.nodes, scene.links, scene.law, scene.stiffness, scene.initial_elongation, scene.fixed, scene.prescribed,
        scene.load, scene.subdomain,
    )  # fmt: skip
    assert structure.n_subdomains == 4
    result = structure.solve()
    assert result.converged and result.gather().plot()
    np.testing.assert_allclose(structure.lengths, scene.lengths)
    for draw in (structure.plot, structure.interactive, lambda: structure.to_html("no.html")):
        with pytest.raises(ValueError, match="not drawn"):
            draw()
    for state in (structure, result, result.gather()):
        with pytest.raises(ValueError, match="modes need a latinpc.Structure, whole on every rank"):
            latinpc.modes(state)
    with pytest.raises(ValueError, match="choose from tensegrity-grid, truss-grid"):
        latinpc.local_scene("network")
    with pytest.raises(ValueError, match=r"written as \.pvtu"):
        result.to_vtu("results.vtu")


def test_a_result_is_that_of_what_was_solved():
    """What changes in the structure afterwards changes neither the reactions nor the gathered result."""
    s = latinpc.LocalStructure([[0.0, 0.0], [1.0, 0.0]], [[0, 1]], "bar", 1.0, fixed=[[1, 1], [0, 1]])
    result = s.solve()
    s.set_initial_elongation(0.25)
    s.set_prescribed([[0.0, 0.0], [0.0, 0.5]])
    s.set_geometry("large")
    assert not result.reactions().any()
    whole = result.gather()
    assert whole.geometry == "linear" and not whole.structure.initial_elongation.any()
    assert not whole.structure.prescribed.any()


def test_pieces_are_beside_what_the_name_of_an_index_leads_to(tmp_path):
    (tmp_path / "far").mkdir()
    (tmp_path / "far" / "bridge.pvtu").write_text("")
    (tmp_path / "link.pvtu").symlink_to(tmp_path / "far" / "bridge.pvtu")
    s = latinpc.LocalStructure([[0.0], [1.0]], [[0, 1]], "bar", 1.0, fixed=[[1], [0]])
    s.solve().to_vtu(tmp_path / "link.pvtu")
    (piece,) = ElementTree.parse(tmp_path / "link.pvtu").getroot().findall("PUnstructuredGrid/Piece")
    assert meshio.read(tmp_path / "far" / piece.get("Source")).points.shape == (2, 3)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["far", "link.pvtu"]


def test_what_the_caller_does_to_links_is_not_done_to_ours():
    """A structure has arrays of its own, and its halo reads them."""
    links = np.array([[0, 2], [1, 2]])
    frame = latinpc.LocalStructure(
        nodes=[[-1, 0], [1, 0], [0, -1]],
        links=links,
        law="bar",
        stiffness=1e3,
        fixed=[[1, 1], [1, 1], [0, 0]],
        load=[[0, 0], [0, 0], [0, -10]],
    )
    links[:] = 0
    assert frame.halo.links.tolist() == frame.links.tolist() == [[0, 2], [1, 2]]


AGAIN = """
import gc
import numpy as np
import petsc4py
petsc4py.init(["p", "-skip_petscrc"])
from petsc4py import PETSc
import latinpc
gc.disable()  # the frames of an error are a cycle, on the rank that has it alone
rank = PETSc.COMM_WORLD.rank
for stiffness in (1.0 - 2.0 * (rank == 1), 1.0):
    try:
        links = np.array([[rank - 1, rank]])[: rank]
        one = latinpc.LocalStructure([[float(rank)]], links, "bar", stiffness, fixed=[[rank == 0]])
    except ValueError as error:
        assert str(error) == "rank 1: link 0 (-1.) needs a positive stiffness", error
else:
    print("made")
if rank == 1:
    import matplotlib.pyplot  # what it keeps goes later, or never
"""


@pytest.mark.parametrize("ranks", [2, 4])
def test_another_structure_after_an_error_of_one_rank(mpirun, ranks):
    """What Python still held on that rank had PETSc's communicator, of which the others waited for another."""
    assert mpirun(ranks, AGAIN, alone=True, timeout=60).stdout.count("made") == ranks
