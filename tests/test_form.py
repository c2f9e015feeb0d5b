"""Forms in equilibrium: closed forms, dense references, loads afterwards, ranks, solvers, files, misuse."""

import json
import sys
from pathlib import Path

import numpy as np
import petsc4py
import pytest

if __name__ == "__main__":  # a program on ranks, with its options
    petsc4py.init(sys.argv)

import turning
from command import latinpc as command
from conftest import ROOT, run
from petsc4py import PETSc

import latinpc

LATINPC = Path(sys.executable).parent / "latinpc"
CANOPY = ROOT / "examples" / "canopy.msh"


# ---- structures -----------------------------------------------------------------------------------------
def row(links=10, load=(0.0, 0.0, -2.0), **more):
    """Links from one support to another, ten metres away, with a force on each node."""
    nodes = np.zeros((links + 1, 3))
    nodes[:, 0] = np.linspace(0.0, 10.0, links + 1)
    fixed = np.zeros((links + 1, 3), bool)
    fixed[[0, -1]] = True
    ends = np.column_stack([np.arange(links), np.arange(1, links + 1)])
    return {"nodes": nodes, "links": ends, "fixed": fixed, "load": np.tile(load, (links + 1, 1))} | more


def square(seed=0, cells=7, rise=2.0):
    """A square net with a warped rim that is clamped, random force densities and loads."""
    rng = np.random.default_rng(seed)
    drawn = turning.net(cells, rise, [0.0, 0.0, 0.0])
    density = 1000.0 * 10.0 ** rng.uniform(-1.0, 1.0, len(drawn["links"]))
    load = rng.normal(size=drawn["nodes"].shape) * 300.0
    return {key: drawn[key] for key in ("nodes", "links", "fixed")} | {"density": density, "load": load, "EA": 1e6}


def mast(strut, foot=0.5):
    """Four guys of one force density, and a strut; the head is free."""
    nodes = [[3.0, 0.0, 0.0], [0.0, 3.0, 0.0], [-3.0, 0.0, 0.0], [0.0, -3.0, 0.0], [0.0, 0.0, foot], [0.0, 0.0, 9.0]]
    fixed = np.repeat(np.arange(6)[:, None] < 5, 3, axis=1)
    return {"nodes": nodes, "links": [[k, 5] for k in range(5)], "fixed": fixed, "density": [1.0] * 4 + [strut]}


def dense(given):
    """Return the form by dense matrices, coordinate by coordinate [Schek 1974, (14)]."""
    found = np.array(given["nodes"], float)
    C = np.zeros((len(given["links"]), len(found)))
    for m, (a, b) in enumerate(given["links"]):
        C[m, a], C[m, b] = -1.0, 1.0
    D = C.T @ np.diag(given["density"]) @ C
    for axis in range(found.shape[1]):
        held = given["fixed"][:, axis]
        right = given["load"][~held, axis] - D[np.ix_(~held, held)] @ found[held, axis]
        found[~held, axis] = np.linalg.solve(D[np.ix_(~held, ~held)], right)
    return found


# ---- force densities -------------------------------------------------------------------------------------
def test_equal_densities_and_weights_make_a_parabola():
    """z_k = -w / 2 q k (n - k), and equal steps along x."""
    form = latinpc.form_find(**row(), density=5.0)
    k = np.arange(11)
    assert np.allclose(form.nodes, np.column_stack([k, 0.0 * k, -0.2 * k * (10 - k)]), rtol=0.0, atol=1e-13)
    assert np.allclose(form.tensions, 5.0 * np.hypot(1.0, 0.2 * (9 - 2 * np.arange(10))), rtol=1e-13)


@pytest.mark.parametrize("seed", range(3))
def test_square_net_beside_dense_matrices(seed):
    """Twelve digits, with the forces of all nodes in balance."""
    given = square(seed)
    form = latinpc.form_find(**given)
    exact = dense(given)
    assert np.allclose(form.nodes, exact, rtol=0.0, atol=1e-12 * abs(exact).max())
    assert np.allclose(form.tensions, given["density"] * form.lengths, rtol=1e-14)
    assert np.allclose(form.densities, given["density"], rtol=1e-14)
    assert form.unbalance < 1e-13
    assert np.allclose(form.reactions.sum(axis=0) + given["load"].sum(axis=0), 0.0, atol=1e-8)


def test_supports_may_differ_from_axis_to_axis():
    """Nodes that are guided: each coordinate has a matrix of its own."""
    given = square(4)
    given["fixed"] = given["fixed"].copy()
    given["fixed"][20:25, 2] = given["fixed"][30, 0] = True
    exact = dense(given)
    assert np.allclose(latinpc.form_find(**given).nodes, exact, rtol=0.0, atol=1e-12 * abs(exact).max())


def test_forms_turn_and_grow_with_their_supports():
    """An affine map of the supports, without loads, maps the form."""
    given = square(1) | {"load": None}
    A, shift = np.random.default_rng(5).normal(size=(3, 3)), [3.0, -1.0, 7.0]
    mapped = latinpc.form_find(**given | {"nodes": given["nodes"] @ A.T + shift})
    assert np.allclose(mapped.nodes, latinpc.form_find(**given).nodes @ A.T + shift, rtol=0.0, atol=1e-11)


def test_nodes_that_are_free_may_be_drawn_anywhere():
    """Even all of them at one place."""
    given = square(2)
    drawn = np.where(given["fixed"], given["nodes"], 0.0)
    assert np.array_equal(latinpc.form_find(**given | {"nodes": drawn}).nodes, latinpc.form_find(**given).nodes)


def test_struts_have_negative_densities():
    """The head of a mast: the balance of five forces, and bars where links push."""
    form = latinpc.form_find(**mast(-2.0), load=np.where(np.arange(6)[:, None] == 5, [0.5, 0.0, 3.0], 0.0), EA=1e4)
    assert np.allclose(form.nodes[5], [0.25, 0.0, (3.0 - 2.0 * 0.5) / 2.0])  # (4 - 2) x = sum of q x_k + p
    assert form.tensions[4] < 0.0 < form.tensions[:4].min()
    assert list(form.structure.law) == [latinpc.Law.CABLE] * 4 + [latinpc.Law.BAR]
    assert form.unbalance < 1e-14


@pytest.mark.parametrize("strut", [-4.0, -4.0 * (1.0 + 1e-15)])
def test_densities_that_cancel_are_refused_with_the_nodes(strut):
    """Four guys and a strut of four times as much: any height, or none, is in equilibrium."""
    with pytest.raises(ValueError, match=r"struts and cables cancel.* next to node 5"):
        latinpc.form_find(**mast(strut))
    assert abs(latinpc.form_find(**mast(-4.0 * (1.0 + 1e-6)), load=[[0.0, 0.0, 1e-3]] * 6).nodes[5, 2]) > 100.0


def test_natural_lengths_are_those_without_tension():
    """T = EA (L - L0) / L0, of cables and of struts."""
    form = latinpc.form_find(**mast(-2.0), load=[[0.0, 0.0, 3.0]] * 6, EA=50.0)
    stretch = form.lengths / form.natural_lengths - 1.0
    assert np.allclose(50.0 * stretch, form.tensions, rtol=1e-12)
    assert latinpc.form_find(**mast(-2.0), load=[[0.0, 0.0, 3.0]] * 6).natural_lengths is None


# ---- natural lengths ----------------------------------------------------------------------------------------
def test_given_natural_lengths_make_the_elastic_catenary():
    """The exact one, drawn along a straight line, and from a form of densities."""
    structure, exact = turning.catenary()
    natural = np.full(20, 1.05 * 10.0 / 20)
    given = {key: structure[key] for key in ("nodes", "links", "fixed", "load")} | {
        "natural_length": natural,
        "EA": 1e4,
    }
    for density in (None, 100.0):
        form = latinpc.form_find(**given, density=density, error=1e-11)
        assert np.allclose(form.nodes, structure["nodes"] + exact, rtol=0.0, atol=1e-9)
        assert np.allclose(form.tensions, 1e4 * (form.lengths / natural - 1.0), rtol=1e-8)


@pytest.mark.parametrize("seed", range(4))
def test_a_form_of_natural_lengths_is_at_rest_and_bears_loads(seed):
    """Some cables slack: no displacement without more loads, and Newton's method in numpy under them."""
    given, rng = square(seed, rise=1.0) | {"load": None}, np.random.default_rng(seed)
    drawn = latinpc.form_find(**given)
    natural = drawn.natural_lengths * rng.uniform(0.96, 1.02, len(drawn.links))
    with pytest.warns(latinpc.LatinWarning, match="slack"):
        form = latinpc.form_find(**given, natural_length=natural)
    assert form.unbalance < 1e-8 and (form.tensions == 0.0).any()
    result = form.structure.solve()
    assert result.converged and abs(result.displacements).max() < 1e-8
    assert np.allclose(result.tensions, form.tensions, rtol=0.0, atol=1e-6 * form.tensions.max())
    load = np.where(given["fixed"], 0.0, [0.0, 50.0, -400.0])
    form.structure.set_load(load)
    result = form.structure.solve(error=1e-9)
    arrays = {key: getattr(form.structure, key) for key in ("nodes", "links", "stiffness", "fixed")}
    prestress = form.structure.stiffness * form.structure.initial_elongation
    arrays |= {"law": np.full(len(form.links), "cable"), "prestress": prestress, "load": load}
    reference = turning.newton(arrays, increments=4)
    assert result.converged and np.linalg.norm(result.displacements - reference) < 1e-7 * np.linalg.norm(reference)


@pytest.mark.parametrize("seed", range(8))
def test_a_form_of_densities_is_at_rest(seed):
    """Solved with the loads that it was found under: as it is, of any stiffness and scale of forces."""
    rng = np.random.default_rng(seed)
    given = square(seed, cells=int(rng.integers(3, 12)), rise=rng.choice([0.0, 1.0, 3.0]))
    scale = 10.0 ** rng.uniform(-5.0, 3.0)
    given |= {"density": scale * given["density"], "load": rng.choice([0.0, scale]) * given["load"]}
    given["EA"] = scale * 10.0 ** rng.uniform(4.0, 9.0)
    result = latinpc.form_find(**given).structure.solve()
    assert result.converged and result.iterations < 30
    assert abs(result.displacements).max() < 1e-9


def test_a_form_of_many_short_links_is_at_rest():
    """Where coordinates are rounded by more than tensions are."""
    drawn = turning.net(80, 12.0, [0.0, 0.0, 0.0])
    form = latinpc.form_find(drawn["nodes"], drawn["links"], drawn["fixed"], 1000.0, EA=1e6)
    assert form.structure.solve().converged


def test_loads_far_below_the_prestress_are_not_taken_for_rounding():
    """A tenth of a billionth of the tensions: displacements by the tangent, to three digits."""
    drawn = turning.net(8, 1.5, [0.0, 0.0, 0.0])
    form = latinpc.form_find(drawn["nodes"], drawn["links"], drawn["fixed"], 1000.0, EA=1e6)
    s, load = form.structure, np.where(drawn["fixed"], 0.0, [0.0, 0.0, -1e-7])
    s.set_load(load)
    u, K = s.create_vec(), s.dm.createMat()
    s.jacobian(u, K)
    exact = np.zeros(load.shape)
    exact[~s.fixed] = np.linalg.solve(K.convert("dense").getDenseArray(), load[~s.fixed])
    found = s.solve()
    assert found.converged and 1e-11 < abs(exact).max() < 1e-10
    assert np.linalg.norm(found.displacements - exact) < 1e-3 * np.linalg.norm(exact)


def test_forms_with_struts_bear_loads():
    """The mast leans under a force, as the tangent at its form has it."""
    form = latinpc.form_find(**mast(-2.0), load=[[0.0, 0.0, 3.0]] * 6, EA=1e4)
    s = form.structure
    assert s.solve().converged and abs(s.solve().displacements).max() < 1e-9
    s.set_load(form.load + [1e-4, 0.0, 0.0])
    moved = s.solve(error=1e-8).displacements[5]
    u, K = s.create_vec(), s.dm.createMat()
    s.jacobian(u, K)
    assert np.allclose(
        moved, np.linalg.solve(K.convert("dense").getDenseArray(), [1e-4, 0.0, 0.0]), rtol=0.0, atol=1e-7
    )


def test_lengths_that_leave_all_links_slack_are_refused():
    """Nothing holds such a form."""
    with pytest.raises((ValueError, latinpc.SolveError), match=r"slack|mechanism|equilibrium"):
        latinpc.form_find(**row(load=(0.0, 0.0, 0.0)), natural_length=2.0, EA=1e4)


def lever(natural, law="bar", load=0.0):
    """Two bars in line between supports two metres apart, of given lengths, and a force across them."""
    nodes, fixed = [[-1.0, 0.0], [0.0, 0.0], [1.0, 0.0]], [[True] * 2, [False] * 2, [True] * 2]
    more = {"natural_length": natural, "EA": 1e4, "law": law, "load": [[0.0, load]] * 3}
    return {"nodes": nodes, "links": [[0, 1], [1, 2]], "fixed": fixed} | more


def test_a_form_in_balance_that_buckles_is_refused():
    """Bars in line that are too long balance each other, until anything touches them."""
    with pytest.raises(latinpc.SolveError, match=r"no stable equilibrium.*unstable.* move: 1.*force densities") as told:
        latinpc.form_find(**lever(1.1))
    assert not told.value.result.converged
    assert latinpc.form_find(**lever(0.9)).tensions == pytest.approx(1e4 / 9.0)
    pushed = latinpc.form_find(**lever(1.1, load=-100.0))
    assert pushed.nodes[1, 1] < -0.4 and pushed.unbalance < 1e-8


def test_a_mechanism_without_tension_is_no_form():
    """Bars in line that fit hold their node along the line alone; a third one holds it across, without tension."""
    with pytest.raises(latinpc.SolveError, match=r"no stable equilibrium.* mechanism"):
        latinpc.form_find(**lever(1.0))
    given = lever([1.0, 1.0, 1.5])
    given |= {"nodes": [*given["nodes"], [0.3, 1.5]], "fixed": [*given["fixed"], [True, True]]}
    given |= {"links": [*given["links"], [1, 3]], "natural_length": [1.0, 1.0, np.hypot(0.3, 1.5)], "load": None}
    form = latinpc.form_find(**given)
    assert form.unbalance == 0.0 and not form.tensions.any()


# ---- ranks and solvers ----------------------------------------------------------------------------------------
SOLVERS = {
    "factor": {},
    "latin": {"form_pc_type": "latin"},
    "latin, gmres": {"form_pc_type": "latin", "form_ksp_type": "gmres"},
    "bddc": {"form_pc_type": "bddc"},
    "jacobi": {"form_pc_type": "jacobi"},
}


@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_ranks_and_solvers_change_nothing(mpirun, ranks):
    """The same form from a factor, from PC latin and BDDC on MATIS, and from others; natural lengths as well."""
    *said, last = mpirun(ranks, __file__, "-form_ksp_converged_reason").stdout.splitlines()
    assert len([line for line in said if "Linear form_ solve converged" in line]) >= 3 * len(SOLVERS)
    found, exact = json.loads(last), dense(square(0))
    for name in SOLVERS:
        assert np.allclose(found[name], exact, rtol=0.0, atol=1e-9 * abs(exact).max()), name
    with pytest.warns(latinpc.LatinWarning, match="2 links are slack"):
        assert np.allclose(found["natural"], latinpc.form_find(**natural()).nodes, rtol=0.0, atol=1e-8)


def natural():
    """Lengths of a form, some cables shortened."""
    given = square(3) | {"load": None}
    form = latinpc.form_find(**given)
    return given | {"natural_length": form.natural_lengths * np.where(np.arange(len(form.links)) % 5, 0.99, 0.97)}


def test_a_solver_that_fails_is_named():
    """Conjugate gradients on a matrix that struts make indefinite."""
    given = row(density=[5.0] * 3 + [-1.25] + [5.0] * 6)
    with pytest.raises(RuntimeError, match="DIVERGED_INDEFINITE_MAT; leave out -form_ksp_type and -form_pc_type"):
        latinpc.form_find(**given, options={"-form_pc_type": "jacobi"})
    with pytest.raises(RuntimeError, match="DIVERGED_MAX_IT"):
        latinpc.form_find(**square(0), options={"form_pc_type": "none", "form_ksp_max_it": 2})
    assert latinpc.form_find(**given).unbalance < 1e-13


# ---- what is refused ----------------------------------------------------------------------------------------
def test_misuse_is_named():
    """Supports, densities, laws, stiffnesses, shapes."""
    given = row(density=5.0)
    part = given | {"links": given["links"][[0, 1, 2, 6, 7, 8, 9]], "density": [5.0] * 3 + [1.0] * 4}
    for wrong, said in (
        (given | {"fixed": False}, "nothing is held along x, y, z"),
        (given | {"fixed": given["fixed"] * [True, True, False]}, "nothing is held along z"),
        (given | {"density": 0.0}, "all force densities are zero"),
        (given | {"density": [5.0] * 3 + [0.0] * 3 + [5.0] * 4}, "nodes 4, 5 are not connected with a support"),
        (part, "nodes 4, 5 are not connected with a support"),
        (given | {"density": np.inf}, r"links 0 \(inf\).* need a finite density"),
        (given | {"density": [1.0, 2.0]}, r"density must have the shape \\(10,\\)"),
        (given | {"density": None}, "from force densities .* or natural lengths"),
        (given | {"natural_length": 1.0}, "natural lengths need the axial stiffness"),
        (given | {"natural_length": -1.0, "EA": 1.0}, "need a positive natural_length"),
        (given | {"EA": 0.0}, "need a positive EA"),
        (given | {"density": -5.0, "law": "cable"}, "have a force density that their law cannot bear"),
        (given | {"law": "inextensible"}, "takes the laws bar, cable and compression_only"),
        (given | {"density": -5.0, "EA": 1.0}, "link 0 bears .* no natural length becomes so short"),
        (given | {"links": [[0, 11]] * 10}, "join a node that does not exist"),
        (given | {"links": [[3, 3]] * 10}, "join a node to itself"),
        (given | {"nodes": np.zeros((11, 4))}, "dim 1, 2 or 3"),
        (given | {"nodes": np.zeros((11, 3)), "load": None}, "link 0 has no length in the form, one of 10"),
        (given | {"load": [[0.0, np.nan, 0.0]] * 11}, "have an entry of load that is not finite"),
        (given | {"mass": -1.0}, "have a mass that is negative"),
        (given | {"links": given["links"] + 0.5}, "links must be integers"),
        (given | {"name": 5}, "name must be a string"),
        (given | {"options": {"snes_latn_error": 1}}, "do you mean -snes_latin_error"),
    ):
        with pytest.raises(ValueError, match=said.replace("\\\\", "\\")):
            latinpc.form_find(**wrong)
    with pytest.raises(ValueError, match="a structure needs the axial stiffness of its links: give EA"):
        latinpc.form_find(**given).structure  # noqa: B018


def test_links_are_whole_numbers_of_any_type():
    """As those of a structure."""
    given = row(density=5.0)
    found = latinpc.form_find(**(given | {"links": given["links"].astype(float)}))
    assert np.array_equal(found.nodes, latinpc.form_find(**given).nodes) and found.links.dtype.kind == "i"


@pytest.mark.parametrize("lengths", [{}, {"natural_length": 1.01, "EA": 1e4}])
def test_options_that_nothing_reads_are_named(lengths):
    options = {
        "form_ksp_tpye": "cg",
        "snes_max_itt": 3,
        "form_pc_type": "lu",
        **({"snes_max_it": 99} if lengths else {}),
    }
    with pytest.warns(latinpc.LatinWarning, match="no solver has read"):
        found = latinpc.form_find(**row(density=5.0), **lengths, options=options)
    said = [text for text in found.notices if "no solver has read" in text]
    assert len(said) == 1 + bool(lengths) and "-form_ksp_tpye" in said[0] and "-snes_max_itt" in said[-1]
    assert "pc_type" not in said[0] and "max_it:" not in said[-1]


# ---- files and the command line -------------------------------------------------------------------------------
def test_tables_are_read_again_as_the_structure(tmp_path):
    """All digits of nodes, laws, natural lengths, supports, loads and masses."""
    form = latinpc.form_find(**mast(-2.0), load=[[0.1, 0.0, 3.0]] * 6, EA=1e4, mass=2.5, area=1e-4)
    form.to_csv(tmp_path / "members.csv", tmp_path / "nodes.csv")
    scene, s = latinpc.read(tmp_path), form.structure
    for name in ("nodes", "links", "law", "stiffness", "initial_elongation", "fixed", "load", "mass"):
        assert np.array_equal(getattr(scene, name), getattr(s, name)), name
    form.to_npz(tmp_path / "form.npz")
    with np.load(tmp_path / "form.npz") as file:
        assert np.array_equal(file["nodes"], form.nodes) and np.array_equal(file["tensions"], form.tensions)
        assert np.array_equal(file["area"], form.area) and np.array_equal(file["mass"], form.mass)


def test_command(tmp_path):
    """The canopy of the examples: all files, then a solve of what it has written."""
    import meshio
    from PIL import Image

    words = "--density drawn --json f.json --output f.vtu --output f.npz --csv members.csv nodes.csv --picture f.png"
    ended = run([LATINPC, "form", CANOPY, *words.split()], cwd=tmp_path)
    assert "force density  2 kN/m to 20 kN/m" in ended.stdout and not ended.stderr
    scene = latinpc.read(CANOPY)
    q = scene.stiffness * scene.initial_elongation / scene.lengths
    exact = dense({"nodes": scene.nodes, "links": scene.links, "fixed": scene.fixed, "density": q, "load": scene.load})
    assert np.allclose(np.load(tmp_path / "f.npz")["nodes"], exact, rtol=0.0, atol=1e-11)
    mesh = meshio.read(tmp_path / "f.vtu")
    assert np.allclose(mesh.points, exact) and mesh.cell_data["tension"][0].min() == pytest.approx(2998.0, abs=1.0)
    assert json.loads((tmp_path / "f.json").read_text())["unbalance"] < 1e-13
    assert Image.open(tmp_path / "f.png").size[0] > 1000
    ended = run([LATINPC, "solve", tmp_path, "--json", "-", "-snes_latin_geometry", "large"])
    assert json.loads(ended.stdout)["converged"]


def test_command_of_natural_lengths_on_ranks(tmp_path, mpirun):
    """Of the tables that a form has written, cables pulled: the form is near by."""
    run([LATINPC, "form", CANOPY, "--density", "drawn", "--csv", "members.csv", "nodes.csv"], cwd=tmp_path)
    one, two = (mpirun(n, LATINPC, "form", tmp_path, "--natural", "--json", "-").stdout for n in (1, 2))
    one, two = json.loads(one), json.loads(two)
    assert one["tension"] == pytest.approx(two["tension"], rel=1e-9)
    assert one["tension"] == pytest.approx([2998.0, 39845.0], rel=1e-3)


@pytest.mark.parametrize(("words", "said"), [
    ((), "give force densities with --density, or --natural"),
    (("--density", "cable=x"), "--density cable=x: write a number"),
    (("--density", "bar=4"), "with one of the drawing (cable, edges, net)"),
    (("--density", "edges=4"), "links of the law cable have none; give cable=X"),
    (("--density", "drawn", "--density", "3"), "--density drawn stands alone"),
    (("--density", "0"), "all force densities are zero"),
    (("--density", "drawn", "--picture", "a.gif"), "cannot write '.gif'"),
    (("--natural",), "all links are slack, and nothing holds a form"),
])  # fmt: skip
def test_command_refuses(words, said):
    """With 2 and a sentence."""
    assert said in command("form", CANOPY, *words, code=2).stderr


def test_command_takes_densities_by_law_and_scenes():
    """Struts that push, of a grid; a net of frames is refused."""
    grid = ["tensegrity-grid", "--modules", "4"]
    ended = run([LATINPC, "form", *grid, "--density", "1000", "--density", "bar=-200", "--without-load", "--json", "-"])
    assert json.loads(ended.stdout)["density"] == pytest.approx([-200.0, 1000.0])
    refused = command("form", *grid, "--density", "bar=5", code=2).stderr
    assert "links of the law cable have none; give cable=X" in refused
    assert "directions of their own" in command("form", "net", "--law", "cable", "--density", "5", code=2).stderr
    command("form", "net", "--density", "5", code=2)


def test_command_takes_densities_by_group(tmp_path):
    """That of a layer comes before that of its law, and that before one for all, in any order."""
    given = ("--density", "edges=20e3", "--density", "CABLE=2000", "--density", "7")
    command("form", CANOPY, *given, "--csv", tmp_path / "members.csv", tmp_path / "nodes.csv")
    scene = latinpc.read(tmp_path)
    edges = scene.numbering.link_groups == "edges"
    assert edges.any() and set(scene.numbering.link_groups) == {"edges", "net"}
    assert scene.prestress / scene.lengths == pytest.approx(np.where(edges, 20e3, 2e3), rel=1e-9)


def test_the_command_line_writes_drawings(tmp_path):
    ezdxf = pytest.importorskip("ezdxf")
    command("form", CANOPY, "--density", "drawn", "--output", tmp_path / "form.dxf")
    command("solve", "mast", "--output", tmp_path / "mast.dxf")
    layers = [
        {line.dxf.layer for line in ezdxf.readfile(tmp_path / name).modelspace()} for name in ("form.dxf", "mast.dxf")
    ]
    assert layers == [{"net", "edges"}, {"bar", "cable"}]
    assert (
        "use .pvd or .vtu"
        in command("solve", "impact-tower", "--num-steps", "1", "--output", tmp_path / "a.dxf", code=2).stderr
    )


def test_a_summary_says_what_was_found():
    """As print shows it."""
    text = str(latinpc.form_find(**square(0)))
    assert "force density" in text and "natural" in text and "unbalanced forces" in text
    assert "give EA for natural lengths" in str(latinpc.form_find(**row(), density=1.0))


if __name__ == "__main__":
    nodes = {name: latinpc.form_find(**square(0), options=how).nodes.tolist() for name, how in SOLVERS.items()}
    nodes["natural"] = latinpc.form_find(**natural()).nodes.tolist()
    if PETSc.COMM_WORLD.rank == 0:
        print(json.dumps(nodes), flush=True)


def test_tables_keep_the_names_of_the_file(tmp_path):
    """What was A, B, C in the tables of the drawing is so in those of the form, which are read again."""
    drawing = tmp_path / "sail"
    drawing.mkdir()
    (drawing / "nodes.csv").write_text("node,x,y,z,fix\nA,0,0,2,xyz\nB,6,0,0,xyz\nC,3,6,1,xyz\nmid,3,2,1,\n")
    stays = "member,start,end,law,EA\ns1,A,mid,cable,1e6\ns2,B,mid,cable,1e6\n7,C,mid,cable,1e6\n"
    (drawing / "members.csv").write_text(stays)
    files = [drawing / name for name in ("members.csv", "nodes.csv")]
    found = tmp_path / "found"
    found.mkdir()
    command("form", drawing, "--density", 1000, "--csv", *(found / file.name for file in files))
    before, after = latinpc.read(drawing), latinpc.read(found)
    assert [after.node_name(i) for i in range(4)] == ["A", "B", "C", "mid"]
    assert [after.link_name(i) for i in range(3)] == ["s1", "s2", "7"]
    assert (after.links == before.links).all() and after.nodes[3] == pytest.approx([3.0, 2.0, 1.0])


def test_tables_keep_groups_and_sections(tmp_path):
    """What the drawing groups, and the areas of its laws, are there for the loads and stresses of the next steps."""
    drawing = tmp_path / "sail"
    drawing.mkdir()
    (drawing / "nodes.csv").write_text("node,x,y,z,fix,group\nA,0,0,2,xyz,feet\nB,6,0,0,xyz,feet; low\nmid,3,2,1,,\n")
    cables = "start,end,law,EA,area,strength,group\nA,mid,cable,1e6,1e-5,1e9,net\nB,mid,cable,1e6,2e-5,1e9,net; edge\n"
    (drawing / "members.csv").write_text(cables + "A,mid,cable,1e6,1e-5,1e9,stay\n")
    command("form", drawing, "--density", 1000, "--csv", tmp_path / "members.csv", tmp_path / "nodes.csv")
    scene = latinpc.read(tmp_path / "nodes.csv", load=["z=-10:edge", "x=1:low"], support="low", geometry="large")
    assert scene.load.tolist() == [[0.0, 0.0, 0.0], [1.0, 0.0, -10.0], [0.0, 0.0, -10.0]]
    assert scene.area.tolist() == [1e-5, 2e-5, 1e-5] and scene.strength.tolist() == [1e9] * 3
    result = scene.solve()
    assert result.members["group"].tolist() == ["net", "net; edge", "stay"]
    assert result.nodes["group"].tolist() == ["feet", "feet; low", ""]
    found = latinpc.form_find(scene.nodes, scene.links, scene.fixed, 1e3, EA=1e6, area=1e-5, strength=[1e9, 1e9, 2e9])
    expected = found.tensions / 1e-5 / np.array([1e9, 1e9, 2e9])
    assert found.structure.solve().utilisation == pytest.approx(expected, rel=1e-9)


def test_a_form_without_supports_is_refused_by_name():
    with pytest.raises(ValueError, match="give fixed, an .* true where a coordinate stays"):
        latinpc.form_find([[0, 0], [1, 0]], [[0, 1]], None, 1.0)
