"""Structures that nothing can solve, options and objects that do not fit: each case with the sentence that it gets."""

import numpy as np
from mistakes_in_data import FIXED, INFINITE, LINKS, LOAD, NAN, NODES, square
from petsc4py import PETSc

import latinpc
from latinpc.scenes import make


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


def system(size=None):
    """The structure of a KSP latin, with a matrix of its own or a diagonal one of `size` rows."""
    structure, ksp = square(), bare(PETSc.KSP, "latin")
    if size:
        A = PETSc.Mat().createAIJ(size, nnz=1)
        A.setUp()
        A.assemble()
        A.shift(1.0)
    else:
        A = structure.dm.createMat()
        structure.jacobian(structure.create_vec(), A)
    ksp.setOperators(A)
    structure.attach(ksp)
    return ksp, A.createVecLeft()


def post(tension):
    """Two bars in a line, clamped at both ends and held across by a soft one; they buckle at -50 N."""
    fixed, load = [[1, 1], [0, 0], [1, 1], [1, 1]], [[0, 0], [1, 0], [0, 0], [0, 0]]
    return latinpc.Structure(
        [[0, 0], [0, 1], [0, 2], [1, 1]], [[0, 1], [1, 2], [1, 3]], "bar", [1e6, 1e6, 100.0], fixed=fixed,
        prestress=[tension, tension, 0.0], load=load, geometry="prestress",
    )  # fmt: skip


MECHANISM = r"The structure has a mechanism: .* Nodes that move \(counted from 0\): "
TOO_EARLY = r"The decomposition does not exist yet: call SNESSetUp\(\) or PCSetUp\(\) first"
FOREIGN = r"The vector has \d entries on a rank where the structure has \d free degrees of freedom"
# behind a bar: what a newer PETSc, or one with its own checks (make test PETSC=debug), finds before we do
CASES = {
    # structures that nothing can solve
    "node_without_link": (
        r"Node 5 is free along x but no link reaches it; remove it, prescribe its displacement",
        lambda: latinpc.Structure(np.vstack([NODES, [3, 3]]), LINKS, 0, 1e3, fixed=np.vstack([FIXED, [0, 0]])),
    ),
    "not_held": (
        r"^Nothing is supported: no displacement of any node is prescribed",
        lambda: solve(square(fixed=None, prescribed=None)),
    ),
    "held_at_one_node": (MECHANISM + r".*4", lambda: solve(square(fixed=FIXED & (np.arange(5) < 1)[:, None]))),
    "mechanism_inside": (MECHANISM + r"45\.", lambda: solve(lattice_with_a_dangling_node(), snes_latin_subdomains=4)),
    "mechanism_by_rounding": (
        r"or links too soft to survive rounding: .* factor of 1e\+15 \(from 1e-11 to 10000\.\)",
        lambda: solve(held_softly()),
    ),
    "buckles_under_prestress": (
        r"^The structure as drawn is unstable: its prestress makes it buckle\. Nodes that move .*: 1\. Change",
        lambda: solve(post(-60.0)),
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
    "subdomains_negative": (
        r"-1 subdomains: the number is positive",
        lambda: solve(square(), snes_latin_subdomains=-1),
    ),
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
    "unbalance_nan": (
        r"-snes_latin_largest_unbalance .* not nan",
        lambda: latinpc.set_largest_unbalance(square().create_snes(), NAN),
    ),
    "unbalance_elsewhere": (
        r"-snes_latin_largest_unbalance belongs to statics .* the stop residual has -snes_atol",
        lambda: solve(square(), snes_latin_largest_unbalance=1.0, snes_latin_stop="residual"),
    ),
    "unbalance_and_stol": (
        r"-snes_latin_largest_unbalance belongs to statics",
        lambda: solve(square(), snes_latin_largest_unbalance=1.0, snes_stol=1e-3),
    ),
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
    "balance_of_what": (
        r"_balance belongs to .* add -snes_latin_stop error",
        lambda: solve(square(), snes_latin_balance=1e-9, snes_latin_stop="indicator"),
    ),
    "tension_error_of_what": (
        r"_tension_error belongs to .* add -snes_latin_stop error",
        lambda: solve(square(), snes_latin_tension_error=1e-9, snes_latin_stop="indicator"),
    ),
    "balance_of_a_step": (
        r"_balance has no effect with a step tolerance .* leave out one of them",
        lambda: solve(square(), snes_latin_balance=1e-9, snes_stol=1e-3),
    ),
    "tension_error_of_a_step": (
        r"_tension_error has no effect with a step tolerance .* leave out one of them",
        lambda: solve(square(), snes_latin_tension_error=1e-9, snes_stol=1e-3),
    ),
    "warm_start": (r"hot.*none last extrapolate", lambda: solve(square(), snes_latin_warm_start="hot")),
    "no_reference": (
        r"SNESLatinSetReference\(\) \(in Python, latinpc.set_reference\(snes, u\); on the",
        lambda: solve(square(), snes_latin_stop="reference"),
    ),
    "must_converge": (
        r"has not converged|DIVERGED",
        lambda: solve(grid(), snes_max_it=2, snes_error_if_not_converged=1),
    ),
    # objects
    "snes_alone": (
        r"-snes_type latin has no structure .*attach\(snes\)",
        lambda: bare(PETSc.SNES, "latin").solve(None, foreign_vec()),
    ),
    "pc_alone": (
        r"-pc_type latin has no structure .*LatinStructureAttachPC\(\) \(in Python, .*attach\(\)\)",
        pc_on_foreign_matrix,
    ),
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
    "solution_size": (FOREIGN, lambda: square().create_snes().solve(None, foreign_vec())),
    "more_load_size": (FOREIGN, lambda: (s := square()).create_snes().solve(foreign_vec(), s.create_vec())),
    "ksp_solution_size": (
        r"The solution vector has \d entries on a rank where the matrix has \d columns",
        lambda: (s := system())[0].solve(s[1], foreign_vec()),
    ),
    "ksp_matrix_size": (
        r"The matrix of -ksp_type latin has \d rows on a rank where its structure has \d free",
        lambda: (s := system(7))[0].solve(s[1], s[1].duplicate()),
    ),
    "displacement_size": (FOREIGN, lambda: square().displacements(foreign_vec())),
    "tension_size": (FOREIGN, lambda: square().tensions(foreign_vec())),
    "write_size": (FOREIGN, lambda: square().set_displacements(LOAD, foreign_vec())),
    "residual_size": (FOREIGN, lambda: square().residual(foreign_vec(), foreign_vec())),
    "step_nan": (r"A time step has the length nan", lambda: step_of(NAN)),
    "step_none": (r"A time step has the length 0", lambda: step_of(0.0)),
    "step_infinite": (r"A time step has the length .*; it must be positive and finite", lambda: step_of(INFINITE)),
    "step_back": (r"A time step has the length -0.001", lambda: step_of(-1e-3)),
    "step_too_short": (r"length 1e-200; .* finite 1 / h\^2", lambda: step_of(1e-200)),
    "bound_nan": (r"Displacements or loads are not finite|is not-a-number", lambda: bound_of(NAN)),
    "matrix_nan": (r"an entry that is not a finite number, at row \d, column \d", lambda: matis(entry=NAN)),
    "matrix_infinite": (r"an entry that is not a finite number", lambda: matis(entry=INFINITE)),
    "coordinates_nan": (r"coordinates that are not finite", lambda: matis(coordinate=NAN)),
    "near_nan": (r"near null space, .* not finite|norm of 1.0, it is nan", lambda: matis(near=NAN)),
    "foreign_jacobian": (r"DMCreateMatrix", lambda: square().jacobian(square().create_vec(), PETSc.Mat().createAIJ(7))),
}
if PETSc.IntType == np.int32:
    CASES["meeting"] = (r"1700 subdomains share node 0: .* fewer", lambda: solve(star(1700)))
