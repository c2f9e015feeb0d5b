"""A square of bars, and what can be wrong in its arrays: each case with the sentence that it gets.

In C one rank alone makes the mistake.
"""

from types import SimpleNamespace

import numpy as np
from petsc4py import PETSc

import latinpc
from latinpc import _latin

# A square of bars with its diagonals, standing on its lower nodes, and a node beside it.
NODES = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [2, 0]], dtype=float)
LINKS = np.array([[0, 1], [1, 2], [2, 3], [0, 3], [0, 2], [1, 3], [1, 4], [2, 4]])
FIXED = np.array([[1, 1], [1, 1], [0, 0], [0, 0], [0, 0]], dtype=bool)
LOAD = np.array([[0, 0], [0, 0], [1, 0], [0, 0], [0, -1]], dtype=float)
SQUARE = {"nodes": NODES, "links": LINKS, "law": np.zeros(8, int), "stiffness": np.full(8, 1e3), "fixed": FIXED,
          "load": LOAD, "initial_elongation": np.zeros(8), "prescribed": np.zeros((5, 2))}  # fmt: skip
NAN, INFINITE = float("nan"), float("inf")


def rubs(**given):
    """Make a contact with friction between two nodes."""
    law, fixed, load = ["friction", "tangent"], [[1, 1], [0, 0]], [[0, 0], [0, -1]]
    return latinpc.Structure([[0, 0], [0, 1]], [[0, 1]] * 2, law, 0.0, fixed=fixed, load=load, **given)


def square(**changes):
    return latinpc.Structure(**{**SQUARE, **changes})


def spoiled(name, place, value):
    array = SQUARE[name].copy()
    array[place] = value
    return square(**{name: array})


def prestressed(law, prestress):
    return square(law=law, initial_elongation=None, prestress=prestress)


def prestress_in_c(law, prestress):
    handle = prestressed(law, 0.0)._handle
    handle.set_prestress(np.full(len(LINKS), prestress))


def share(array, dtype=None):
    """This rank's rows."""
    rank, size = PETSc.COMM_WORLD.rank, PETSc.COMM_WORLD.size
    part = array[len(array) * rank // size : len(array) * (rank + 1) // size]
    return np.array(part, dtype=dtype, order="C")


def in_c(name=None, place=(), value=None, laws=True, nodes=5):
    """Build the square as a C program would, each rank its share, one number of the last rank wrong."""
    data = {key: share(SQUARE[key]) for key in ("nodes", "stiffness", "initial_elongation", "prescribed", "load")}
    data |= {key: share(SQUARE[key], PETSc.IntType) for key in ("links", "law")}
    data["fixed"] = share(FIXED, f"i{_latin.BOOL_SIZE}")
    if name and PETSc.COMM_WORLD.rank == PETSc.COMM_WORLD.size - 1:
        data[name][place] = value
    handle = _latin.StructureHandle()
    handle.create(PETSc.COMM_WORLD, nodes, data["nodes"], data["links"])
    if laws:
        handle.set_laws(data["law"], data["stiffness"], data["initial_elongation"])
    handle.set_supports(data["fixed"], data["prescribed"])
    handle.set_loads(data["load"])
    handle.setup()
    return handle


NOTHING = SimpleNamespace(ctypes=SimpleNamespace(data=0))  # NULL


def too_many_in_c():
    """More nodes than PETSc's integers number; no array of theirs is looked at."""
    many = SimpleNamespace(shape=(np.iinfo(PETSc.IntType).max // 4 * 3, 2), ctypes=NOTHING.ctypes)
    _latin.StructureHandle().create(PETSc.COMM_WORLD, -1, many, share(LINKS, PETSc.IntType))


def partition_in_c(last):
    """The library's own checks of a partition, behind those of the Python functions."""
    handle, snes = in_c(), PETSc.SNES().create()
    handle.attach(snes)
    snes.setType("latin")
    _latin.set_partition(snes, share(np.append(np.zeros(7), last), PETSc.IntType))
    snes.setUp()


CASES = {
    # what Python refuses, the whole arrays at hand
    "node_beyond": (r"link 2 .* a node that does not exist \(.* from 0 to 4\)", lambda: spoiled("links", (2, 1), 5)),
    "node_negative": (r"link 2 .* a node that does not exist", lambda: spoiled("links", (2, 1), -1)),
    "node_to_itself": (r"link 4 .* joins a node to itself", lambda: spoiled("links", 4, 2)),
    "coincident": (r"link 1 .* has no length: its two nodes are at one place", lambda: spoiled("nodes", 2, [1, 0])),
    "stiffness_zero": (r"link 3 \(0.*\) needs a positive stiffness", lambda: spoiled("stiffness", 3, 0)),
    "stiffness_negative": (r"link 3 \(-1.*\) needs a positive stiffness", lambda: spoiled("stiffness", 3, -1)),
    "prestress_twice": (r"both give the self-stress: leave out one", lambda: square(prestress=0.0)),
    "prestress_rigid": (r"links 0 \(1.*\) .* their law cannot bear \(a rigid law", lambda: prestressed(3, 1.0)),
    "prestress_slack": (r"links 0 \(-1.*have a prestress that their law cannot bear", lambda: prestressed(1, -1.0)),
    "prestress_later": (
        r"links 0 \(nan.*have a prestress",
        lambda: prestressed(0, 0.0).set_prestress(NAN),
    ),
    "c_prestress_rigid": (
        r"Link 0 has the prestress 1\.? and the law inextensible: bars take",
        lambda: prestress_in_c(3, 1.0),
    ),
    "c_prestress_slack": (
        r"Link 0 has the prestress -1\.? and the law cable: .* not negative",
        lambda: prestress_in_c(1, -1.0),
    ),
    "stiffness_nan": (r"link 3 \(nan\) needs a positive stiffness", lambda: spoiled("stiffness", 3, NAN)),
    "stiffness_infinite": (r"link 3 \(inf\) needs a positive stiffness", lambda: spoiled("stiffness", 3, INFINITE)),
    "coordinate_nan": (r"node 2 .* has a coordinate that is not finite", lambda: spoiled("nodes", (2, 0), NAN)),
    "load_of_one_number": (r"load must have the shape \(5, 2\), .*one number does not say", lambda: square(load=-1e3)),
    "load_nan": (r"node 2 .* has an entry of load that is not finite", lambda: spoiled("load", (2, 1), NAN)),
    "initial_elongation_nan": (
        r"link 2 .* has an initial elongation that is not finite",
        lambda: spoiled("initial_elongation", 2, NAN),
    ),
    "prescribed_nan": (
        r"node 0 .* has an entry of prescribed that is not finite",
        lambda: spoiled("prescribed", 0, NAN),
    ),
    "prescribed_where_free": (r"node 2 .* in a direction that is not fixed", lambda: spoiled("prescribed", 2, 0.1)),
    "law_beyond": (
        r"link 1 .* has an unknown law \(0 bar, 1 cable, 2 compression_only, ",
        lambda: spoiled("law", 1, 9999),
    ),
    "tangent_first": (
        r"Link 0 is not part of a complete contact with friction",
        lambda: square(law=["tangent"] + 7 * ["bar"]),
    ),
    "friction_direction": (r"start.* not orthogonal: .* direction=", lambda: rubs()),
    "friction_none": (r"Link 0 has friction but no .* friction=", lambda: rubs(direction=[[0, 1], [1, 0]])),
    "no_link": (r"links must be an \(m, 2\) array of node numbers", lambda: square(links=np.zeros((0, 2), int))),
    "half_a_node": (r"links must be integers", lambda: square(links=LINKS + 0.5)),
    "four_dimensions": (r"nodes must be an \(n, dim\) array with dim 1, 2 or 3", lambda: square(nodes=np.ones((5, 4)))),
    "short_load": (r"load must have the shape \(5, 2\), a row per node", lambda: square(load=LOAD[:4])),
    "half_fixed": (r"nodes 0 .* neither true nor false", lambda: square(fixed=0.5 * FIXED)),
    "later_load_nan": (r"nodes 0 .* have an entry of load that is not finite", lambda: square().set_load(LOAD * NAN)),
    "partition_gap": (r"subdomain 1 has no link; .* without gaps", lambda: square(subdomain=[0, 0, 0, 0, 2, 2, 2, 2])),
    "partition_beyond": (r"9 subdomains for 8 links", lambda: square(subdomain=[0, 1, 2, 3, 4, 5, 6, 8])),
    "partition_negative": (r"link 4 .* negative subdomain", lambda: square(subdomain=[0, 0, 0, 0, -1, 0, 0, 0])),
    # the same in C
    "c_node_beyond": (r"Link 7 joins nodes 2 and 5, but .* from 0 to 4", lambda: in_c("links", (-1, 1), 5)),
    "c_node_to_itself": (r"Link 7 joins node 2 to itself", lambda: in_c("links", (-1, 1), 2)),
    "c_coincident": (r"Link 6 has no length: its nodes 1 and 4 lie at the same", lambda: in_c("nodes", -1, [1, 0])),
    "c_coordinate_nan": (r"Node 4 has a coordinate that is not a finite", lambda: in_c("nodes", (-1, 0), NAN)),
    "c_law_beyond": (r"Link 7 has law 9999; the laws are 0 \(bar\), 1 \(cable\), ", lambda: in_c("law", -1, 9999)),
    "c_stiffness_zero": (r"Link 7 has stiffness 0.*positive finite", lambda: in_c("stiffness", -1, 0)),
    "c_stiffness_negative": (r"Link 7 has stiffness -1.*positive finite", lambda: in_c("stiffness", -1, -1)),
    "c_stiffness_nan": (r"Link 7 has stiffness nan.*positive finite", lambda: in_c("stiffness", -1, NAN)),
    "c_initial_elongation_nan": (
        r"Link 7 has an initial elongation that is not a finite",
        lambda: in_c("initial_elongation", -1, NAN),
    ),
    "c_load_nan": (r"Node 4 has a load that is not a finite number", lambda: in_c("load", (-1, 0), NAN)),
    "c_without_laws": (r"Link 0 has no stiffness: call LatinStructureSetLaws\(\)", lambda: in_c(laws=False)),
    "c_node_count": (r"The ranks give 5 nodes in all, not the 6 announced", lambda: in_c(nodes=6)),
    "c_too_many": (
        r"\d+ nodes and 8 links in 2D are more than PETSc's integers of \d\d bits can number",
        too_many_in_c,
    ),
    "c_partition_negative": (
        r"Link 7 is in subdomain -1; .* numbered from 0",
        lambda: partition_in_c(-1),
    ),
    "c_partition_beyond": (
        r"Link 7 is in subdomain 8; .* at most as many as links",
        lambda: partition_in_c(8),
    ),
    "c_partition_gap": (
        r"Subdomain 1 of the given partition has no link; .* without gaps",
        lambda: partition_in_c(2),
    ),
}
