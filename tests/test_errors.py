"""Bad input: the same clear sentence on every rank, no deadlock, and the process goes on.

Each case runs here on one rank; all of them run on two ranks in one `mpirun` of this very file.
"""

import json
import re
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import run
from petsc4py import PETSc

import latinpc
from latinpc import _latin
from latinpc.scenes import make

# A square of bars with its diagonals, standing on its lower nodes, and a node beside it.
NODES = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [2, 0]], dtype=float)
LINKS = np.array([[0, 1], [1, 2], [2, 3], [0, 3], [0, 2], [1, 3], [1, 4], [2, 4]])
FIXED = np.array([[1, 1], [1, 1], [0, 0], [0, 0], [0, 0]], dtype=bool)
LOAD = np.array([[0, 0], [0, 0], [1, 0], [0, 0], [0, -1]], dtype=float)
SQUARE = {"nodes": NODES, "links": LINKS, "law": np.zeros(8, int), "stiffness": np.full(8, 1e3), "fixed": FIXED,
          "load": LOAD, "initial_elongation": np.zeros(8), "prescribed": np.zeros((5, 2))}  # fmt: skip
NAN, INFINITE = float("nan"), float("inf")
TIMEOUT = 90  # seconds, after which two ranks are taken to wait for each other


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


def solve(structure, reference=None, **settings):
    """Solve with options given as keywords, which leave no trace."""
    database = PETSc.Options()
    for name, value in settings.items():
        database[name] = value
    try:
        snes, u = structure.create_snes(), structure.create_vec()
        snes.setFromOptions()
        if reference is not None:
            latinpc.set_reference(snes, reference)
        snes.solve(None, u)
    finally:
        for name in settings:
            database.delValue(name)
    return snes, u


def grid():
    return latinpc.Structure.from_scene(make("tensegrity-grid", modules=6, subdomains=9))


def the_process_goes_on():
    """Solve the square right: what a mistake leaves behind must not be in the way."""
    structure = square()
    snes, u = solve(structure, snes_latin_subdomains=2)
    assert snes.reason > 0
    axis = np.diff(NODES[LINKS], axis=1)[:, 0]
    axis /= np.linalg.norm(axis, axis=1)[:, None]
    B = np.zeros((8, 5, 2))
    for row, (a, b) in enumerate(LINKS):
        B[row, a], B[row, b] = -axis[row], axis[row]
    B = B.reshape(8, 10)[:, ~FIXED.ravel()]
    assert np.allclose(structure.displacements(u)[~FIXED], np.linalg.solve(1e3 * B.T @ B, LOAD[~FIXED]), rtol=1e-3)


# ---- mistakes that only one rank makes, in C ------------------------------------------------------------


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


# ---- structures and objects that do not fit -------------------------------------------------------------


def held_softly():
    """A network, half of whose links are softer than the others by more than the digits of a number."""
    scene = make("network", nodes=60)
    scene.stiffness = np.where(np.arange(len(scene.links)) % 2, 1e4, 1e-11)
    scene.law[:] = latinpc.Law.BAR
    return latinpc.Structure.from_scene(scene)


def hinged_plates():
    """A held plate and a triangle that share one node; each is a subdomain."""
    return latinpc.Structure(
        nodes=[[0, 0], [1, 0], [1, 1], [0, 1], [2, 0], [2, 1]],
        links=[[0, 1], [1, 2], [2, 3], [0, 2], [1, 3], [1, 4], [4, 5], [1, 5]],
        law=0,
        stiffness=1e3,
        fixed=[[1, 1], [0, 0], [0, 0], [1, 1], [0, 0], [0, 0]],
        subdomain=[0, 0, 0, 0, 0, 1, 1, 1],
    )


def lattice_with_a_dangling_node():
    scene = make("lattice", nx=8, ny=4, load=1.0, partition="metis")
    scene.nodes = np.vstack([scene.nodes, [9, 9]])
    scene.links = np.vstack([scene.links, [44, 45]])
    for name, one in (("law", 0), ("stiffness", 1e7), ("initial_elongation", 0.0)):
        setattr(scene, name, np.append(getattr(scene, name), one))
    scene.fixed, scene.load, scene.prescribed = (
        np.vstack([array, np.zeros((1, 2), array.dtype)]) for array in (scene.fixed, scene.load, scene.prescribed)
    )
    return latinpc.Structure.from_scene(scene)


def bare(kind, type_name):
    thing = kind().create()
    thing.setType(type_name)
    return thing


def pc_on_foreign_matrix():
    A = PETSc.Mat().createAIJ(4, nnz=1)
    A.setUp()
    A.assemble()
    pc = bare(PETSc.PC, "latin")
    pc.setOperators(A)
    pc.setUp()


def pc_on_dead_structure():
    structure = square()
    K, u, pc = structure.dm.createMat(), structure.create_vec(), bare(PETSc.PC, "latin")
    structure.jacobian(u, K)
    pc.setOperators(K)
    del structure
    pc.setUp()


def early(ksp_type, pc_type):
    """Set up the KSP of a SNES that has no Jacobian yet."""
    snes = square().create_snes()
    snes.setType("newtonls")
    ksp = snes.getKSP()
    ksp.setType(ksp_type)
    ksp.getPC().setType(pc_type)
    snes.setUp()
    ksp.setUp()


def with_bounds():
    structure = square()
    snes, u = structure.create_snes(), structure.create_vec()
    snes.setVariableBounds(u, u.duplicate())
    snes.solve(None, u)


def star(count):
    """Cables around one node, each a subdomain."""
    angle = 2 * np.pi * np.arange(count) / count
    nodes = np.vstack([[0, 0], np.column_stack([np.cos(angle), np.sin(angle)])])
    links = np.column_stack([np.zeros(count, int), np.arange(1, count + 1)])
    return latinpc.Structure(nodes, links, 1, 1e3, 1e-3, fixed=(nodes != 0).any(axis=1)[:, None] * [1, 1],
                         subdomain=np.arange(count))  # fmt: skip


def step_of(length):
    structure = square(mass=1.0)
    ts = structure.create_ts()
    ts.setTimeStep(length)
    ts.setMaxSteps(1)
    ts.solve(structure.create_vec())


def bound_of(value):
    snes, u = solve(square(), snes_latin_subdomains=2)
    u.set(value)
    latinpc.energy_bound(snes)


def matis(entry=None, coordinate=0.0, near=1.0):
    """A matrix without a structure, and what is told of it, to PC latin."""
    structure, pc = square(), bare(PETSc.PC, "latin")
    structure.dm.setMatType("is")
    A, u = structure.dm.createMat(), structure.create_vec()
    structure.jacobian(u, A)
    A.compose("__PETSc_dm", None)
    if entry is not None:
        local = A.getISLocalMat()
        local.setValue(0, 0, entry)
        local.assemble()
    u.set(near)
    u.normalize()
    A.setNearNullSpace(PETSc.NullSpace().create(vectors=[u], comm=A.comm))
    pc.setOperators(A)
    pc.setCoordinates(np.full((A.getLocalSize()[0], 2), coordinate))
    pc.setUp()


def foreign_vec():
    return PETSc.Vec().createMPI(7)


MECHANISM = r"The structure has a mechanism: .* Nodes that move \(counted from 0\): "
TOO_EARLY = r"The decomposition does not exist yet: call SNESSetUp\(\) or PCSetUp\(\) first"
FOREIGN = r"The vector has \d entries on a rank where the structure has \d free degrees of freedom"
# behind a bar: what a newer PETSc, or one with its own checks (make test PETSC=debug), finds before we do
CASES = {
    # what Python refuses, the whole arrays at hand
    "node_beyond": (r"link 2 .* a node that does not exist \(.* from 0 to 4\)", lambda: spoiled("links", (2, 1), 5)),
    "node_negative": (r"link 2 .* a node that does not exist", lambda: spoiled("links", (2, 1), -1)),
    "node_to_itself": (r"link 4 .* joins a node to itself", lambda: spoiled("links", 4, 2)),
    "coincident": (r"link 1 .* has no length: its two nodes are at one place", lambda: spoiled("nodes", 2, [1, 0])),
    "stiffness_zero": (r"link 3 \(0.*\) needs a positive stiffness", lambda: spoiled("stiffness", 3, 0)),
    "stiffness_negative": (r"link 3 \(-1.*\) needs a positive stiffness", lambda: spoiled("stiffness", 3, -1)),
    "prestress_twice": (r"both give the self-stress: leave out one", lambda: square(prestress=0.0)),
    "prestress_rigid": (r"link 0 \(1.*\) .* its law cannot bear \(a rigid law", lambda: prestressed(3, 1.0)),
    "prestress_slack": (r"link 0 \(-1.*has a prestress that its law cannot bear", lambda: prestressed(1, -1.0)),
    "prestress_later": (
        r"link 0 \(nan.*has a prestress",
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
    "load_nan": (r"node 2 .* has a load that is not finite", lambda: spoiled("load", (2, 1), NAN)),
    "initial_elongation_nan": (
        r"link 2 .* has an initial elongation that is not finite",
        lambda: spoiled("initial_elongation", 2, NAN),
    ),
    "prescribed_nan": (r"node 0 .* has a prescribed that is not finite", lambda: spoiled("prescribed", 0, NAN)),
    "prescribed_where_free": (r"node 2 .* in a direction that is not fixed", lambda: spoiled("prescribed", 2, 0.1)),
    "law_beyond": (
        r"link 1 .* has an unknown law \(0 bar, 1 cable, 2 compression_only, ",
        lambda: spoiled("law", 1, 99),
    ),
    "no_link": (r"links must be an \(m, 2\) array of node numbers", lambda: square(links=np.zeros((0, 2), int))),
    "half_a_node": (r"links must be integers", lambda: square(links=LINKS + 0.5)),
    "four_dimensions": (r"nodes must be an \(n, dim\) array with dim 1, 2 or 3", lambda: square(nodes=np.ones((5, 4)))),
    "short_load": (r"load must have the shape \(5, 2\), a row per node", lambda: square(load=LOAD[:4])),
    "half_fixed": (r"node 0 .* neither true nor false", lambda: square(fixed=0.5 * FIXED)),
    "later_load_nan": (r"node 0 .* has a load that is not finite", lambda: square().set_load(LOAD * NAN)),
    "partition_gap": (r"subdomain 1 has no link; .* without gaps", lambda: square(subdomain=[0, 0, 0, 0, 2, 2, 2, 2])),
    "partition_beyond": (r"9 subdomains for 8 links", lambda: square(subdomain=[0, 1, 2, 3, 4, 5, 6, 8])),
    "partition_negative": (r"link 4 .* negative subdomain", lambda: square(subdomain=[0, 0, 0, 0, -1, 0, 0, 0])),
    # the same in C
    "c_node_beyond": (r"Link 7 joins nodes 2 and 5, but .* from 0 to 4", lambda: in_c("links", (-1, 1), 5)),
    "c_node_to_itself": (r"Link 7 joins node 2 to itself", lambda: in_c("links", (-1, 1), 2)),
    "c_coincident": (r"Link 6 has no length: its nodes 1 and 4 lie at the same", lambda: in_c("nodes", -1, [1, 0])),
    "c_coordinate_nan": (r"Node 4 has a coordinate that is not a finite", lambda: in_c("nodes", (-1, 0), NAN)),
    "c_law_beyond": (r"Link 7 has law 99; the laws are 0 \(bar\), 1 \(cable\), ", lambda: in_c("law", -1, 99)),
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
    # structures that nothing can solve
    "node_without_link": (
        r"Node 5 is free in direction 0 but no link reaches it; remove it or prescribe its displacement",
        lambda: latinpc.Structure(np.vstack([NODES, [3, 3]]), LINKS, 0, 1e3, fixed=np.vstack([FIXED, [0, 0]])),
    ),
    "not_held": (
        r"^Nothing is supported: no displacement of any node is prescribed",
        lambda: solve(square(fixed=None, prescribed=None)),
    ),
    "held_at_one_node": (MECHANISM + r".*4", lambda: solve(square(fixed=FIXED & (np.arange(5) < 1)[:, None]))),
    "mechanism_inside": (MECHANISM + r"45\.", lambda: solve(lattice_with_a_dangling_node(), snes_latin_subdomains=4)),
    "mechanism_by_rounding": (
        r"or only such links as rounding hides: .* factor of 1e\+15 \(from 1e-11 to 10000\.\)",
        lambda: solve(held_softly()),
    ),
    "mechanism_between": (MECHANISM + r"4, 5\.", lambda: solve(hinged_plates())),
    # options
    "variant": (r"cornr.*none macro corner published primal auto", lambda: solve(square(), snes_latin_variant="cornr")),
    "direction": (r"full.*scalar diagonal block schur", lambda: solve(square(), snes_latin_direction="full")),
    "stop": (r"soon.*indicator residual reference", lambda: solve(square(), snes_latin_stop="soon")),
    "subdomains": (
        r"Cannot make 9 subdomains of 8 links: .* at most",
        lambda: solve(square(), snes_latin_subdomains=9),
    ),
    "subdomains_negative": (r"-1 less than allowed bound 0", lambda: solve(square(), snes_latin_subdomains=-1)),
    "subdomains_twice": (
        r"The given partition has 2 subdomains, not the 3 asked for: leave out one of the two",
        lambda: solve(square(subdomain=np.repeat([0, 1], 4)), snes_latin_subdomains=3),
    ),
    "direction_negative": (
        r"direction value is -1.*; it is a positive number \(0: automatic\)",
        lambda: solve(square(), snes_latin_direction_value=-1),
    ),
    "direction_nan": (
        r"direction value is nan.*positive|value nan",
        lambda: solve(square(), snes_latin_direction_value="nan"),
    ),
    "direction_inf": (
        r"-snes_latin_direction_value.* value is inf.*positive.* from 1e-10 to 1e\+10|value inf",
        lambda: solve(square(), snes_latin_direction_value="inf"),
    ),
    "direction_great": (
        r"-snes_latin_direction_value.* value is 1e\+30; with the direction schur .* fraction .*, from 1e-10 to 1e\+10",
        lambda: solve(square(), snes_latin_direction_value=1e30),
    ),
    "direction_small": (
        r"value is 1e-30; with the direction block it is a fraction .*, from 1e-10 to 1e\+10 \(0: automatic\)",
        lambda: solve(square(), snes_latin_direction="block", snes_latin_direction_value=1e-30),
    ),
    "direction_scalar_great": (
        r"-snes_latin_direction_value.* value is 1e\+30; with the direction scalar it is a stiffness .*, from .* to ",
        lambda: solve(grid(), snes_latin_direction="scalar", snes_latin_direction_value=1e30),
    ),
    "direction_scalar_small": (
        r"value is 1e-30; with the direction scalar it is a stiffness .*, from .* to .* beside that of the interfaces",
        lambda: solve(grid(), snes_latin_direction="scalar", snes_latin_direction_value=1e-30),
    ),
    "direction_of_pc": (
        r"LatinSetDirection\(\): The direction value is 1e\+300; .* from 1e-10 to 1e\+10",
        lambda: latinpc.set_direction(bare(PETSc.PC, "latin"), "schur", 1e300),
    ),
    "direction_of_ksp": (
        r"LatinSetDirection\(\): The direction value is nan\.?; it is a positive number",
        lambda: latinpc.set_direction(bare(PETSc.KSP, "latin"), "diagonal", NAN),
    ),
    "modes_local": (
        r"-snes_latin_modes_local, .* The threshold of local modes is -1\.?; .* \(0: none, -2: automatic\)",
        lambda: solve(square(), snes_latin_modes_local=-1),
    ),
    "modes_local_of_pc": (
        r"_latin_modes_local, LatinSetModes\(\): The threshold of local modes is inf\.?; it is a positive number",
        lambda: latinpc.set_modes(bare(PETSc.PC, "latin"), "affine", INFINITE),
    ),
    "error_zero": (r"-snes_latin_error .* between 0 and 1, .* not 0", lambda: solve(square(), snes_latin_error=0)),
    "error_large": (r"-snes_latin_error .* between 0 and 1, .* not 1", lambda: solve(square(), snes_latin_error=1)),
    "error_nan": (
        r"-snes_latin_error .* not nan",
        lambda: latinpc.set_error(square().create_snes(), NAN),
    ),
    "balance_negative": (
        r"-snes_latin_balance .* positive and finite, .* not -1",
        lambda: solve(square(), snes_latin_balance=-1),
    ),
    "balance_nan": (r"-snes_latin_balance .* not nan", lambda: latinpc.set_balance(square().create_snes(), NAN)),
    "balance_inf": (r"-snes_latin_balance .* not inf", lambda: latinpc.set_balance(square().create_snes(), INFINITE)),
    "outer": (
        r"Unable to find requested SNES type picard",
        lambda: solve(square(), snes_latin_outer_snes_type="picard"),
    ),
    "local": (
        r"Setting up the local solver failed .*its options start with -snes_latin_local_",
        lambda: solve(square(), snes_latin_local_pc_factor_mat_solver_type="nobody"),
    ),
    "tolerance_nan": (
        r"not a finite number: stol nan|set value nan",
        lambda: solve(square(), snes_stol="nan"),
    ),
    "tolerance_inf": (r"not a finite number: .* rtol inf|set value inf", lambda: solve(square(), snes_rtol="inf")),
    "error_of_what": (
        r"_error belongs to .* add -snes_latin_stop error",
        lambda: solve(square(), snes_latin_error=1e-3, snes_latin_stop="residual"),
    ),
    "warm_start": (r"hot.*none last extrapolate", lambda: solve(square(), snes_latin_warm_start="hot")),
    "no_reference": (r"SNESLatinSetReference\(\)", lambda: solve(square(), snes_latin_stop="reference")),
    "must_converge": (
        r"has not converged|DIVERGED",
        lambda: solve(grid(), snes_max_it=2, snes_error_if_not_converged=1),
    ),
    # objects
    "snes_alone": (
        r"-snes_type latin has no structure .*attach\(snes\)",
        lambda: bare(PETSc.SNES, "latin").solve(None, foreign_vec()),
    ),
    "pc_alone": (r"-pc_type latin has no structure .*LatinStructureAttachPC\(\)", pc_on_foreign_matrix),
    "pc_dead": (r"-pc_type latin has no structure", pc_on_dead_structure),
    "pc_early": (r"-pc_type latin has no matrix yet: .* call SNESComputeJacobian\(\)", lambda: early("cg", "latin")),
    "ksp_early": (r"-ksp_type latin has no matrix yet: .* and KSPSetOperators\(\)", lambda: early("latin", "none")),
    "reference_size": (r"The reference has 7 entries, .* 6 free degrees", lambda: solve(square(), foreign_vec())),
    "statistics_early": (TOO_EARLY, lambda: latinpc.statistics(square().create_snes())),
    "pc_statistics_early": (TOO_EARLY, lambda: latinpc.statistics(bare(PETSc.PC, "latin"))),
    "classes_early": (TOO_EARLY, lambda: latinpc.node_classes(square().create_snes())),
    "macro_early": (TOO_EARLY, lambda: latinpc.macro_stiffness(square().create_snes(), 0)),
    "subdomain_beyond": (
        r"Subdomain 9 of this rank does not exist: it has [12]",
        lambda: latinpc.subdomain_is(solve(square(), snes_latin_subdomains=2)[0], 9),
    ),
    "wrong_snes": (r"The SNES is of type newtonls, not latin", lambda: latinpc.history(bare(PETSc.SNES, "newtonls"))),
    "wrong_pc": (r"The PC is of type jacobi, not latin", lambda: latinpc.statistics(bare(PETSc.PC, "jacobi"))),
    "wrong_object": (
        r"expected a petsc4py SNES, KSP or PC of type latin, got Vec",
        lambda: latinpc.statistics(PETSc.Vec().create()),
    ),
    "no_object": (r"got str", lambda: latinpc.statistics("latin")),
    "not_a_shell": (
        r"call PCSetType\(pc, PCSHELL\) first",
        lambda: latinpc.pcshell_set_latin(bare(PETSc.PC, "jacobi")),
    ),
    "bounds": (r"does not take bounds on the unknowns", with_bounds),
    "displacement_size": (FOREIGN, lambda: square().displacements(foreign_vec())),
    "tension_size": (FOREIGN, lambda: square().tensions(foreign_vec())),
    "write_size": (FOREIGN, lambda: square().set_displacements(LOAD, foreign_vec())),
    "residual_size": (FOREIGN, lambda: square().residual(foreign_vec(), foreign_vec())),
    "step_nan": (r"A time step has the length nan", lambda: step_of(NAN)),
    "step_none": (r"A time step has the length 0", lambda: step_of(0.0)),
    "step_back": (r"A time step has the length -0.001", lambda: step_of(-1e-3)),
    "step_too_short": (r"length 1e-200; .* 1 / h\^2 is a number", lambda: step_of(1e-200)),
    "bound_nan": (r"The displacements, or the loads, are not finite numbers|is not-a-number", lambda: bound_of(NAN)),
    "matrix_nan": (r"an entry that is not a finite number, at row \d, column \d", lambda: matis(entry=NAN)),
    "matrix_infinite": (r"an entry that is not a finite number", lambda: matis(entry=INFINITE)),
    "coordinates_nan": (r"coordinates that are not finite", lambda: matis(coordinate=NAN)),
    "near_nan": (r"near null space, .* not finite|norm of 1.0, it is nan", lambda: matis(near=NAN)),
    "foreign_jacobian": (r"DMCreateMatrix", lambda: square().jacobian(square().create_vec(), PETSc.Mat().createAIJ(7))),
}


if PETSc.IntType == np.int32:
    CASES["meeting"] = (r"1700 subdomains share node 0: .* fewer", lambda: solve(star(1700)))


def outcome(name):
    """The kind and the sentence of what a case raises."""
    try:
        CASES[name][1]()
    except Exception as error:
        return [type(error).__name__, latinpc.error_message(error)]
    return ["nothing", ""]


def check(name, found):
    kind, sentence = found
    assert kind in ("ValueError", "TypeError", "Error"), found
    assert re.search(CASES[name][0], sentence), sentence
    assert "\n" not in sentence


def no_convergence_is_no_error():
    """A reason instead; the last iterate is there, better than the ones before, and more iterations end it."""
    structure = grid()
    exact = solve(structure, snes_stol=1e-9)[1]
    errors = []
    for iterations in (1, 3, 9):
        snes, u = solve(structure, exact, snes_max_it=iterations)
        assert snes.reason == PETSc.SNES.ConvergedReason.DIVERGED_MAX_IT
        assert snes.getIterationNumber() == iterations == len(latinpc.history(snes)["indicator"])
        errors.append(structure.errors(u, exact)[0])
        assert np.isclose(latinpc.history(snes)["error_l2"][-1], errors[-1], rtol=0.5)  # copies there, means here
    assert errors[0] > 2 * errors[1] > 4 * errors[2] > 0
    snes.setTolerances(max_it=200)
    snes.solve(None, u)
    assert snes.reason > 0


def test_no_convergence_is_no_error():
    no_convergence_is_no_error()


@pytest.mark.parametrize("name", CASES)
def test_one_rank(name):
    check(name, outcome(name))
    the_process_goes_on()


@pytest.fixture(scope="module")
def two_ranks(tmp_path_factory):
    """Outcomes of all cases on each of two ranks; a deadlock shows the last case begun."""
    folder = tmp_path_factory.mktemp("errors")
    run(["mpirun", "-n", 2, sys.executable, __file__, folder], timeout=TIMEOUT, leaks=False)
    return [json.loads((folder / f"{rank}.json").read_text()) for rank in range(2)]


@pytest.mark.parametrize("name", CASES)
def test_two_ranks(name, two_ranks):
    check(name, two_ranks[0][name])
    assert two_ranks[0][name] == two_ranks[1][name]


if __name__ == "__main__":
    outcomes = {}
    for case in CASES:
        print(case, flush=True)
        outcomes[case] = outcome(case)
        the_process_goes_on()
    no_convergence_is_no_error()
    Path(sys.argv[1], f"{PETSc.COMM_WORLD.rank}.json").write_text(json.dumps(outcomes))
