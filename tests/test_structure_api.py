"""Links from numpy arrays and back: numbering, ranks, mechanics, refusals."""

import copy
import ctypes
import pickle
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import run
from petsc4py import PETSc

import latinpc

# Two squares with diagonals side by side, hung at the left; the numbering follows no order on purpose.
NODES = np.array([[1, 1], [0, 0], [2, 0], [0, 1], [1, 0], [2, 1]], dtype=float)
LINKS = np.array([[1, 4], [3, 0], [0, 4], [1, 0], [4, 3], [2, 4], [0, 5], [5, 2], [4, 5], [2, 0]])
LAW = np.array([0, 0, 0, 1, 1, 0, 2, 0, 1, 1])
FIXED = np.array([[0, 0], [1, 1], [0, 0], [1, 1], [0, 0], [0, 0]], dtype=bool)
FRAME = {
    "nodes": NODES,
    "links": LINKS,
    "law": LAW,
    "stiffness": np.linspace(1e3, 2e3, len(LINKS)),
    "initial_elongation": np.linspace(0.01, 0.02, len(LINKS)) * np.where(LAW == 2, -1, 1),
    "fixed": FIXED,
    "prescribed": np.where(FIXED, 0.003, 0),
    "load": np.where(FIXED, 0, [0.5, -2.0]),
}
SUBDOMAIN = np.array([1, 0, 1, 0, 1, 2, 2, 0, 2, 1])


def frame(**changes):
    return latinpc.Structure(**{**FRAME, **changes}, comm=PETSc.COMM_SELF)


def displacement(seed=0):
    u = np.random.default_rng(seed).normal(scale=0.02, size=NODES.shape)
    return np.where(FIXED, FRAME["prescribed"], u)


def tension(u):
    n = NODES[LINKS[:, 1]] - NODES[LINKS[:, 0]]
    n /= np.linalg.norm(n, axis=1)[:, None]
    x = np.sum(n * (u[LINKS[:, 1]] - u[LINKS[:, 0]]), axis=1) + FRAME["initial_elongation"]
    return FRAME["stiffness"] * np.choose(LAW, [x, np.maximum(x, 0), np.minimum(x, 0)]), n


def test_sizes_and_mesh():
    structure = frame()
    assert structure.sizes == (2, 6, 10, 8)
    assert structure.sizes.free_dofs == 8
    assert structure.dm.getType() == "plex"
    assert structure.dm.getDimension() == 1
    assert structure.dm.getCoordinateDim() == 2
    assert structure.create_vec().getSize() == 8


def test_displacements_come_back_in_the_callers_order():
    structure, given = frame(), displacement()
    u = structure.create_vec()
    structure.set_displacements(given, u)
    assert np.array_equal(structure.displacements(u), given)


def test_tensions_follow_the_laws():
    structure, given = frame(), displacement()
    u = structure.create_vec()
    structure.set_displacements(given, u)
    assert np.allclose(structure.tensions(u), tension(given)[0], rtol=1e-13, atol=1e-11)


def test_laws_by_name():
    names = np.array(["bar", "cable", "compression-only"])[LAW]
    by_number, by_name, given = frame(), frame(law=names), displacement()
    u = by_number.create_vec()
    by_number.set_displacements(given, u)
    assert np.array_equal(by_name.tensions(u), by_number.tensions(u))
    all_cables = frame(law="cable")
    assert np.array_equal(all_cables.tensions(u), frame(law=np.full(len(LINKS), latinpc.Law.CABLE)).tensions(u))
    scene = latinpc.scenes.Scene("frame", NODES, LINKS, "cable", FRAME["stiffness"], fixed=FIXED)
    assert (scene.law == latinpc.Law.CABLE).all()


def test_residual_is_the_unbalance_of_the_nodes():
    structure, given = frame(), displacement()
    u, r = structure.create_vec(), structure.create_vec()
    structure.set_displacements(given, u)
    structure.residual(u, r)
    tau, n = tension(given)
    unbalance = -np.asarray(FRAME["load"], dtype=float)
    np.add.at(unbalance, LINKS[:, 1], tau[:, None] * n)
    np.add.at(unbalance, LINKS[:, 0], -tau[:, None] * n)
    expected = structure.create_vec()
    structure.set_displacements(np.where(FIXED, 0, unbalance), expected)
    assert (r - expected).norm() < 1e-11


def test_residual_is_the_gradient_of_the_energy_and_jacobian_that_of_the_residual():
    structure = frame()
    u, r, s, direction = (structure.create_vec() for _ in range(4))
    structure.set_displacements(displacement(), u)
    structure.set_displacements(displacement(1), direction)
    jacobian = structure.dm.createMat()
    structure.residual(u, r)
    structure.jacobian(u, jacobian)
    step = 1e-6
    energy = [structure.energy(u + sign * step * direction) for sign in (1, -1)]
    assert (energy[0] - energy[1]) / (2 * step) == pytest.approx(r.dot(direction), rel=1e-7)
    structure.residual(u + step * direction, s)
    assert ((s - r) / step - jacobian * direction).norm() < 1e-6 * (jacobian * direction).norm()
    assert jacobian.isSymmetric(1e-9)


def test_errors_vanish_only_for_the_same_displacement():
    structure = frame()
    u = structure.create_vec()
    structure.set_displacements(displacement(), u)
    assert structure.errors(u, u) == (0, 0)
    l2, energy = structure.errors(2 * u, u)
    assert l2 > 0
    assert energy > 0


def test_newton_balances_the_structure():
    structure = frame()
    snes = structure.create_snes()
    snes.setType("newtonls")
    snes.setTolerances(rtol=1e-12)
    snes.getKSP().setType("preonly")
    snes.getKSP().getPC().setType("lu")
    u, r = structure.create_vec(), structure.create_vec()
    snes.solve(None, u)
    assert snes.reason > 0
    structure.residual(u, r)
    assert r.norm() < 1e-9
    assert np.allclose(structure.displacements(u)[FIXED], 0.003)


def test_loads_and_initial_elongations_change():
    structure, given = frame(), displacement()
    u, r, s = (structure.create_vec() for _ in range(3))
    structure.set_displacements(given, u)
    structure.residual(u, r)
    structure.set_load(FRAME["load"] + np.where(FIXED, 0, 1.0))
    structure.residual(u, s)
    assert np.allclose((r - s).array, 1)
    structure.set_initial_elongation(0.0)
    assert not np.allclose(structure.tensions(u), tension(given)[0])
    structure.set_initial_elongation(FRAME["initial_elongation"])
    assert np.allclose(structure.tensions(u), tension(given)[0])


def test_solver_returns_the_partition_in_the_callers_order():
    snes = frame(subdomain=SUBDOMAIN).create_snes()
    snes.setUp()
    assert np.array_equal(latinpc.subdomain_of_links(snes), SUBDOMAIN)
    assert latinpc.node_classes(snes).shape == (6,)
    assert latinpc.statistics(snes)["subdomains"] == 3
    assert latinpc.subdomains(snes) == (3, 0)


RANKS = """
import sys
import numpy as np
from petsc4py import PETSc
import latinpc
sys.path.insert(0, {tests!r})
import test_structure_api as t

for subdomain in (None, t.SUBDOMAIN):
    structure = latinpc.Structure(**t.FRAME, subdomain=subdomain, comm=PETSc.COMM_WORLD)
    assert structure.sizes == (2, 6, 10, 8)
    u, r = structure.create_vec(), structure.create_vec()
    structure.set_displacements(t.displacement(), u)
    assert np.array_equal(structure.displacements(u), t.displacement())
    assert np.allclose(structure.tensions(u), t.tension(t.displacement())[0], rtol=1e-13, atol=1e-11)
    structure.residual(u, r)
    assert np.isclose(r.norm(), {norm!r}, rtol=1e-12)
    assert np.isclose(structure.energy(u), {energy!r}, rtol=1e-12)
snes = structure.create_snes()
snes.setUp()
assert np.array_equal(latinpc.subdomain_of_links(snes), t.SUBDOMAIN)
assert np.array_equal(latinpc.node_classes(snes), {classes!r})
assert latinpc.statistics(snes)["subdomains"] == 3
print("fine")
"""


@pytest.mark.parametrize("ranks", [1, 2, 3, 4])
def test_any_number_of_ranks(mpirun, ranks):
    structure = frame()
    u, r = structure.create_vec(), structure.create_vec()
    structure.set_displacements(displacement(), u)
    structure.residual(u, r)
    snes = frame(subdomain=SUBDOMAIN).create_snes()
    snes.setUp()
    found = {"norm": r.norm(), "energy": structure.energy(u), "classes": latinpc.node_classes(snes).tolist()}
    script = RANKS.format(tests=str(Path(__file__).parent), **found)
    assert mpirun(ranks, script).stdout.count("fine") == ranks


REFUSED = [
    ({"links": [[0, 9], *LINKS[1:]]}, r"link 0 \(\[0 9\]\) joins a node that does not exist"),
    ({"links": [*LINKS[:-1], [-1, 2]]}, r"link 9 .* does not exist"),
    ({"links": [*LINKS[:-1], [2, 2]]}, r"link 9 .* joins a node to itself"),
    ({"links": np.ones((3, 3), int)}, r"links must be an \(m, 2\) array"),
    ({"links": np.zeros((0, 2), int)}, r"links must be an \(m, 2\) array"),
    ({"links": LINKS + 0.5}, "links must be integers"),
    ({"nodes": np.where(NODES > 1, np.nan, NODES)}, r"nodes 2 .*5 .*not finite"),
    ({"nodes": np.zeros_like(NODES)}, "no length"),
    ({"nodes": np.zeros((6, 4))}, "dim 1, 2 or 3"),
    ({"law": 10**6}, "unknown law"),
    ({"law": "cabel"}, "unknown law 'cabel': do you mean 'cable'. choose from bar, cable, compression_only"),
    ({"law": "tension-only"}, "unknown law 'tension-only': do you mean 'cable'"),
    ({"law": "tension"}, "unknown law 'tension': choose from bar, cable, "),
    ({"law": ["bar"] * 9 + ["xyz"]}, "unknown law 'xyz': choose from bar, cable, "),
    ({"law": [0, 1]}, r"law must have the shape \(10,\)"),
    ({"stiffness": 0}, "need a positive stiffness"),
    ({"stiffness": -1}, "and 5 more need a positive stiffness"),
    ({"stiffness": np.nan}, "need a positive stiffness"),
    ({"stiffness": np.inf}, "need a positive stiffness"),
    ({"initial_elongation": np.inf}, "initial elongation that is not finite"),
    ({"fixed": np.ones((5, 2))}, r"fixed must have the shape \(6, 2\)"),
    ({"prescribed": np.full((6, 2), 0.1)}, "not fixed"),
    ({"load": np.full((6, 2), np.nan)}, "load that is not finite"),
    ({"subdomain": np.full(10, -1)}, "negative subdomain"),
    ({"subdomain": [0] * 9 + [2]}, "subdomain 1 has no link"),
    ({"subdomain": np.arange(10) + 1}, "11 subdomains for 10 links"),
    ({"area": [-1.0] * 10}, "area that is not positive"),
    ({"area": np.inf}, "area that is not positive"),
    ({"strength": 1.0}, "strength is a stress, which needs the area"),
    ({"load": {3: [0, 1]}}, "load must be numbers"),
    ({"fixed": ["xy", "", "", "", "", ""]}, "fixed must be numbers: .*'xy'"),
    ({"load": [[0, 0], [1]]}, "load must be an array: its rows are not of one length"),
    ({"links": [["a", "b"]]}, "links must be integers"),
]


@pytest.mark.parametrize(("changes", "message"), REFUSED)
def test_bad_arrays_are_refused_by_name(changes, message):
    with pytest.raises(ValueError, match=message):
        frame(**changes)


@pytest.mark.parametrize("how", [copy.copy, copy.deepcopy, pickle.dumps])
def test_a_structure_is_not_copied(how):
    """A copy had shared what the library has: loads of the one were those of the other."""
    structure = frame()
    for thing in (structure, {"of a result": structure}) if how is not copy.copy else (structure,):
        with pytest.raises(TypeError, match=r"not copied or pickled.*: make another .* Structure.from_scene"):
            how(thing)
    if how is pickle.dumps:
        with pytest.raises(TypeError, match=r"Of a result, .* keep the arrays, such as result\.tensions"):
            how(structure.solve())
    another = latinpc.Structure.from_scene(latinpc.scenes.Scene.from_structure(structure), PETSc.COMM_SELF)
    another.set_load(2.0 * structure.load)
    assert np.array_equal(another.solve().load, 2.0 * structure.solve().load)


def test_masked_entries_have_no_value():
    """They had been used as if they were there."""
    stiffness = np.ma.masked_array(np.full(len(LINKS), 1e3), mask=False)
    assert frame(stiffness=stiffness).stiffness[0] == 1e3
    stiffness[1] = np.ma.masked
    with pytest.raises(ValueError, match="stiffness has masked entries, which have no value: fill them"):
        frame(stiffness=stiffness)


def test_a_number_of_subdomains_is_an_integer():
    snes = frame().create_snes()
    latinpc.set_subdomains(snes, np.int64(2))
    with pytest.raises(ValueError, match=r"subdomains must be an integer, not 2\.5"):
        latinpc.set_subdomains(snes, 2.5)


@pytest.mark.parametrize("name", [5, None])
def test_a_name_is_a_string(name):
    with pytest.raises(ValueError, match=f"name must be a string, not {name}"):
        frame(name=name)
    with pytest.raises(ValueError, match=f"name must be a string, not {name}"):
        latinpc.scenes.Scene(name, [[0.0], [1.0]], [[0, 1]], "bar", 1.0)


def test_questions_about_links_need_links():
    with pytest.raises(TypeError, match="expected a petsc4py solver, got Structure; results of solve"):
        latinpc.tensions(frame())
    pc = PETSc.PC().create(comm=PETSc.COMM_SELF)
    pc.setType("latin")
    pc.setDM(PETSc.DMShell().create(comm=PETSc.COMM_SELF))
    with pytest.raises(ValueError, match="attach"):
        latinpc.subdomain_of_links(pc)
    with pytest.raises(TypeError, match="SNES, KSP or PC"):
        latinpc.statistics(PETSc.Vec().create(comm=PETSc.COMM_SELF))


def test_error_message_is_one_sentence():
    snes = PETSc.SNES().create(comm=PETSc.COMM_SELF)
    with pytest.raises(PETSc.Error) as caught:
        snes.setType("no such type")
    assert latinpc.error_message(caught.value) == "Unable to find requested SNES type no such type"
    assert latinpc.error_message(ValueError("other")) == "other"


PRESTRESS = np.linspace(0.0, 900.0, len(LINKS)) * np.where(LAW == 2, -1, 1)  # N


def test_a_prestress_is_an_initial_elongation():
    """The same structure to the bit: e0 = T / k, and no displacement leaves the prestress itself."""
    given = frame(initial_elongation=None, prestress=PRESTRESS)
    same = frame(initial_elongation=PRESTRESS / FRAME["stiffness"])
    u, v = given.create_vec(), same.create_vec()
    for structure, x in ((given, u), (same, v)):
        structure.set_displacements(displacement(), x)
    assert np.array_equal(given.tensions(u), same.tensions(v))
    given.set_prestress(0.5 * PRESTRESS)
    same.set_initial_elongation(0.5 * PRESTRESS / FRAME["stiffness"])
    assert np.array_equal(given.tensions(u), same.tensions(v))


def test_axial_stiffness_is_divided_by_the_lengths():
    """EA in place of the stiffness, of all links or of each; one of the two is given."""
    axial = np.linspace(1e3, 2e3, len(LINKS))
    for EA in (axial, 5e3):
        given = frame(stiffness=None, EA=EA)
        assert given.stiffness == pytest.approx(EA / given.lengths, rel=1e-14)
    for wrong in ({"EA": 1e3}, {"stiffness": None}):
        with pytest.raises(ValueError, match="give either stiffness, EA / length of each link"):
            frame(**wrong)
    for wrong, named in ((axial[:-1], "EA must have the shape"), (-axial, "need a positive EA")):
        with pytest.raises(ValueError, match=named):
            frame(stiffness=None, EA=wrong)


def test_laws_without_a_stiffness_need_none():
    """Rigid ones and tables alone; beside a bar it is missing."""
    table = latinpc.register_table([0.0, 1e-3, 1e-2], [0.0, 10.0, 20.0])
    for law in ("inextensible", table):
        assert np.array_equal(frame(law=law, stiffness=None).stiffness, frame(law=law, stiffness=0.0).stiffness)
    mixed = ["bar"] + ["inextensible"] * (len(LINKS) - 1)
    with pytest.raises(ValueError, match="give either stiffness"):
        frame(law=mixed, stiffness=None)


def test_verbs_agree_with_the_links_and_nodes_that_are_named():
    """One, several, and more than are named."""
    for bad, words in (
        ([3], r"^link 3 \(0.\) needs a positive stiffness$"),
        ([3, 4], r"^links 3 \(0.\), 4 \(0.\) need a positive stiffness$"),
        (range(8), r"^links 0 \(0.\), .*, 4 \(0.\) and 3 more need a positive stiffness$"),
    ):
        stiffness = np.ones(len(LINKS))
        stiffness[list(bad)] = 0.0
        with pytest.raises(ValueError, match=words):
            frame(stiffness=stiffness)
    with pytest.raises(ValueError, match=r"^nodes 0 .* have a coordinate that is not finite$"):
        frame(nodes=NODES * np.nan)
    with pytest.raises(ValueError, match=r"^links 0 .* have no length: their two nodes are at one place"):
        frame(nodes=NODES * 0.0)


def test_rigid_laws_have_no_axial_stiffness():
    """A rod and the wall beyond a gap of 1 mm: EA of the bars, 0 of the contact."""
    given = dict(nodes=[[0.0], [0.5], [1.0], [1.1]], links=[[0, 1], [1, 2], [2, 3]], law=["bar", "bar", "contact"],
                 initial_elongation=[0, 0, 1e-3], fixed=[[1], [0], [0], [1]], load=[[0], [30e3], [0], [0]])  # fmt: skip
    rod = latinpc.Structure(**given, EA=[1e7, 1e7, 0])
    assert rod.stiffness.tolist() == [2e7, 2e7, 0]
    assert rod.solve().tensions == pytest.approx([25e3, -5e3, -5e3], rel=1e-3)
    with pytest.raises(ValueError, match=r"links 0 .*, 1 .*need a positive EA \(0 where their law has no stiffness\)"):
        latinpc.Structure(**given, EA=0)


@pytest.mark.parametrize(("name", "cure"), [("load", r"call set_load\(\)"), ("stiffness", "make another structure")])
def test_arrays_are_not_assigned(name, cure):
    """Solvers would go on with the first ones."""
    structure = frame()
    with pytest.raises(AttributeError, match=f"the {name} of a structure cannot be assigned, .*{cure}"):
        setattr(structure, name, 2 * getattr(structure, name))
    structure.set_load(2 * structure.load)


def test_unknown_attributes_are_not_assigned():
    """A misspelt name had been kept, and the structure solved with what it had."""
    structure = frame()
    with pytest.raises(AttributeError, match=r"a structure has no attribute 'loads': its arrays are nodes, .*, load, "):
        structure.loads = 2 * structure.load
    with pytest.raises(AttributeError, match=r"the geometry of a structure cannot be assigned, .* call set_geometry"):
        structure.geometry = "large"
    structure.name = "two squares"
    scene = latinpc.scenes.Scene.from_structure(structure)
    with pytest.raises(AttributeError, match="a scene has no attribute 'loads': its arrays are nodes, .*, load, "):
        scene.loads = 2 * scene.load
    scene.load = 2 * scene.load


@pytest.mark.parametrize("scene", ["lattice", {"nodes": NODES}, frame])
def test_a_structure_is_made_of_a_scene(scene):
    with pytest.raises(
        TypeError, match=r"^scene must be a latinpc.scenes.Scene, as latinpc.scenes.make\(name\) .* not "
    ):
        latinpc.Structure.from_scene(scene)


def test_a_structure_has_cases_as_its_scene_has():
    """And stays as it is, with the load that it has been given last."""
    given = dict(nodes=[[0.0], [1.0], [3.0]], links=[[0, 1], [1, 2]], stiffness=[2.0, 3.0], fixed=[[1], [0], [1]])
    structure = latinpc.Structure(**given, law="cable", load=[[0.0], [0.2], [0.0]], name="row", comm=PETSc.COMM_SELF)
    structure.set_load(2.0 * structure.load)
    right, left = latinpc.Case("right", [[0], [1.0], [0]]), latinpc.Case("left", [[0], [-1.0], [0]])
    found = latinpc.solve_cases(structure, [right, left, 2 * left + right])
    assert found.tensions == pytest.approx(np.array([[1.4, 0.0], [0.0, 0.6], [0.0, 0.6]]), abs=1e-12)
    assert structure.load[1, 0] == 0.4 and found.scene.name == "row"
    with pytest.raises(TypeError, match="a load case is a latinpc.Case, .* not 'right'"):
        latinpc.solve_cases(structure, ["right"])
    function = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double, ctypes.c_double, ctypes.c_void_p)
    whole = [function(of) for of in (lambda k, x, _: k * x, lambda k, x, _: k, lambda k, x, _: 0.5 * k * x * x)]
    law = latinpc.register_law("of functions", *whole)
    with pytest.raises(ValueError, match="cannot have the registered law 'of functions'.*latinpc.register_table"):
        latinpc.solve_cases(latinpc.Structure(**given, law=law), [right])
    with pytest.raises(ValueError, match="case 'up': load must be numbers"):
        latinpc.Case("up", load={1: 5.0})


def test_a_structure_with_tables_has_cases():
    """Its scene has them, from the number of laws on; the results have those that were registered."""
    given = dict(nodes=[[0.0], [1.0], [3.0]], links=[[0, 1], [1, 2]], stiffness=[0.0, 0.0], fixed=[[1], [0], [1]])
    other = latinpc.register_table([0.0, 1.0, 2.0], [0.0, 5.0, 6.0], "other of a row")
    yields = latinpc.register_table([0.0, 0.1, 0.2], [0.0, 0.3, 0.3], "yields in a row")
    structure = latinpc.Structure(**given, law=[yields, other], comm=PETSc.COMM_SELF)
    pulls = [latinpc.Case(f"{load}", [[0.0], [load], [0.0]]) for load in (0.5, 0.8, 1.3)]
    found = latinpc.solve_cases(structure, pulls)
    assert found.converged and len(found.scene.tables) == 2
    for name, result in found.items():
        pull = min(float(name) * 3 / 8, 0.3)  # 3 N/m beside 5 N/m, until it yields
        assert result.tensions == pytest.approx([pull, pull - float(name)], abs=1e-9)
        assert result.structure.law.tolist() == [yields, other]


def test_import_loads_what_every_solve_needs_and_no_more():
    loads = "import sys, latinpc; print([name for name in sys.argv[1:] if name in sys.modules])"
    names = ("click", "matplotlib", "meshio", "pandas", "plotly", "rich", "scipy", "slepc4py")
    assert run([sys.executable, "-P", "-c", loads, *names]).stdout == "[]\n"


def test_a_node_without_links_is_one_sentence():
    """When it is made, and in statics where it has a mass."""
    given = {
        "nodes": [[0.0], [1.0], [2.0]],
        "links": [[0, 1]],
        "law": "bar",
        "stiffness": 1.0,
        "fixed": [[1], [0], [0]],
    }
    sentence = "^Node 2 is free along x but no link reaches it; [^\n]*$"
    with pytest.raises(ValueError, match=sentence):
        latinpc.Structure(**given)
    structure = latinpc.Structure(**given, mass=1.0)
    with pytest.raises(latinpc.SolveError, match=sentence):
        structure.solve()


def test_arguments_of_solve_are_named_with_their_options():
    structure = latinpc.Structure([[0.0], [1.0]], [[0, 1]], "bar", 1.0, fixed=[[1], [0]])
    for name, wrong in (("error", 0), ("error", "small"), ("largest_unbalance", -1.0)):
        with pytest.raises(ValueError, match=rf"^{name} \(-snes_latin_{name}\) is "):
            structure.solve(**{name: wrong})
    with pytest.raises(latinpc.SolveError, match="^-snes_latin_error is "):
        structure.solve(options={"snes_latin_error": 0})


def test_friction_without_its_law_is_refused():
    given = {"nodes": [[0.0], [1.0]], "links": [[0, 1]], "stiffness": 1.0, "fixed": [[1], [0]]}
    with pytest.raises(ValueError, match="friction is given, and no link has the law friction"):
        latinpc.Structure(**given, law="bar", friction=0.3)
    latinpc.Structure(**given, law="bar", friction=0.0)
