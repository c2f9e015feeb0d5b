"""Forms in equilibrium: closed forms, dense references, loads afterwards, ranks, solvers, files, misuse."""

import json
import sys

import numpy as np
import petsc4py
import pytest

if __name__ == "__main__":  # a program on ranks, with its options
    petsc4py.init(sys.argv)

import turning
from petsc4py import PETSc

import latinpc


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


def test_rounding_refuses_no_form_of_a_long_rope():
    """Of many stiff links: more than 1e-8 of the largest force is left."""
    fixed = np.zeros((2001, 2), bool)
    fixed[[0, -1]] = True
    x = np.linspace(0.0, 200.0, 2001)
    links = np.column_stack([np.arange(2000), np.arange(1, 2001)])
    load = np.tile([0.0, -1.0], (2001, 1))
    nodes = np.column_stack([x, -1e-3 * x * (200.0 - x)])
    found = latinpc.form_find(nodes, links, fixed, natural_length=0.101, EA=1.6e9, load=load)
    assert 1e-8 < found.unbalance < 1e-6


def test_rounding_of_coordinates_of_a_map_refuses_no_form():
    """Those of a net and of its form."""
    given = square() | {"EA": 5e7}
    near, corner = latinpc.form_find(**given), np.array([5e5, 5.4e6, 0.0])
    given["nodes"] = given["nodes"] + corner
    found = latinpc.form_find(**given, natural_length=near.natural_lengths)
    assert abs(found.nodes - near.nodes - corner).max() < 1e-7 and found.unbalance > 1e-8


def test_a_form_whose_nodes_are_all_held():
    """Its links have their tensions, and there is nothing to find."""
    held = latinpc.form_find([[0, 0], [1, 0]], [[0, 1]], [[1, 1], [1, 1]], natural_length=0.8, EA=1e3)
    assert held.tensions == pytest.approx([250.0])


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
    with pytest.raises(ValueError, match="error is for natural lengths"):
        latinpc.form_find([[0, 0], [1, 0]], [[0, 1]], [[1, 1], [0, 0]], 1.0, error=1e-3)
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
        (given | {"density": -5.0, "law": "cable"}, "have a force or a force density that their law cannot bear"),
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


# ---- files and summaries ------------------------------------------------------------------------------------
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


def test_a_form_without_supports_is_refused_by_name():
    with pytest.raises(ValueError, match="give fixed, an .* true where a coordinate stays"):
        latinpc.form_find([[0, 0], [1, 0]], [[0, 1]], None, 1.0)
