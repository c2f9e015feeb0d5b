"""Loads that grow to a limit point: the part that is borne, the motion beyond it, increments, ranks."""

import json
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
import scipy.optimize
import turning
from test_cli import latinpc as command
from test_cli import said

import latinpc
from latinpc.bench.extremes.corotational import Corotational
from latinpc.bench.extremes.drawn import draw
from latinpc.options import default_options
from latinpc.results.limit import moving
from latinpc.results.summary import summary
from latinpc.scenes import Scene, make


def scene(structure):
    """A scene of large displacements."""
    given = {key: value for key, value in structure.items() if key != "prestress"}
    return Scene(name="drawn", **given, geometry="large")


@pytest.fixture
def truss():
    """Two bars that lean on each other, under twice the load of the limit point."""
    return scene(turning.von_mises(2.0 * turning.von_mises_limit()))


@pytest.mark.filterwarnings("ignore::latinpc.LatinWarning")
def test_limit_point_of_two_bars(truss):
    """The closed form, to the least increment; the tip moves on down; results are of the loads that are borne."""
    result = truss.solve()
    factor = result.report["load_factor"]
    assert not result.converged
    assert 0.5 - 2e-4 < factor <= 0.5
    assert "no stable equilibrium follows" in result.reason
    assert any(f"that of {factor:.4g} of the loads" in text and text.endswith("mode: 2") for text in result.notices)
    assert result.load == pytest.approx(factor * truss.load)
    assert result.balance.force < 1e-3
    assert moving(result.mode).tolist() == [2]
    assert abs(result.mode[2]) == pytest.approx([0.0, 1.0], abs=1e-6)
    assert result.structure.load == pytest.approx(truss.load)
    assert "load factor" in repr(result)


@pytest.mark.filterwarnings("ignore::latinpc.LatinWarning")
@pytest.mark.parametrize("times", [50.0, 1e3, 1e5])
def test_limit_points_far_below_the_loads(times):
    """The least increment is relative to the loads borne, not to all: the closed form, to a thousandth of itself."""
    result = scene(turning.von_mises(times * turning.von_mises_limit())).solve()
    assert not result.converged
    assert 1 - 1e-3 < times * result.report["load_factor"] <= 1.0


@pytest.mark.filterwarnings("ignore::latinpc.LatinWarning")
@pytest.mark.parametrize("limit", [20, 200, 400])
def test_a_limit_of_stages_is_no_limit_point(limit):
    """-snes_max_it counts the stages of Newton's method too, and ends a path without a claim: this tower holds."""
    result = make("tower", stages=20).solve(options={"snes_max_it": limit})
    assert "not enough" in result.reason
    assert result.report["load_factor"] < 1.0
    assert result.iterations <= limit + 80  # the linear solve that reached it


def test_what_holds_has_a_load_factor_of_one():
    """And no motion beyond; linear structures have no such thing."""
    result = make("tower", stages=2).solve()
    assert result.report["load_factor"] == 1.0
    assert result.mode is None
    assert "load_factor" not in make("lattice", nx=12, ny=8).solve().report


@pytest.mark.filterwarnings("ignore::latinpc.LatinWarning")
def test_cables_alone_have_no_limit_point():
    """A solve that is cut short keeps its loads, and says nothing of an equilibrium."""
    result = make("saddle").solve(options={"snes_max_it": 3})
    assert not result.converged
    assert "load_factor" not in result.report and result.mode is None
    assert result.load.min() == -500.0
    assert not any("equilibrium" in notice for notice in result.notices)


class Growing(Corotational):
    """Its tangent is the geometric stiffness of the tensions that displacements v add at u."""

    def __init__(self, scene, v):
        super().__init__(scene)
        self.v = v

    def state(self, u):
        n, size, _, slope = super().state(u)
        return n, size, slope * (n * (self.v[self.second] - self.v[self.first])).sum(axis=1), 0.0 * slope


def buckling_mode(loaded, u):
    """Linear buckling at u, K x + mu G x = 0, dense: the least positive mu for the loads that are added, and x."""
    structure, v = Corotational(loaded), np.zeros(u.shape)
    K = structure.tangent(u)
    v.ravel()[structure.free] = np.linalg.solve(K, loaded.load.ravel()[structure.free])
    values, modes = scipy.linalg.eigh(-Growing(loaded, v).tangent(u), K)
    return 1.0 / values[-1], modes[:, -1]


def column():
    """Twelve braced storeys, loaded at the top: a bifurcation."""
    y, x = np.divmod(np.arange(26), 2)
    a = np.arange(0, 24, 2)
    links = np.concatenate([np.column_stack([a + i, a + j]) for i, j in ((0, 2), (1, 3), (0, 3), (1, 2), (2, 3))])
    fixed, load = np.repeat(y[:, None] == 0, 2, axis=1), np.zeros((26, 2))
    load[-2:, 1] = -1e4
    nodes = np.column_stack([x, y]).astype(float)
    return Scene("column", nodes, links, "bar", 1e6, fixed=fixed, load=load, geometry="large")


BUCKLED = [
    lambda: make("mast", load=20000.0),
    lambda: make("mast", load=20000.0, wind=200.0),
    lambda: make("mast", levels=4, panels=3, load=40000.0),
    lambda: make("tower", load=8000.0),
    lambda: make("tower", stages=3, load=8000.0, wind=0.5),
    lambda: make("bridge", load=-1e5),
    lambda: scene(turning.von_mises(2.0 * turning.von_mises_limit())),
    column,
]


@pytest.mark.parametrize("buckled", BUCKLED)
@pytest.mark.filterwarnings("ignore::latinpc.LatinWarning")
def test_the_mode_is_that_of_linear_buckling_at_the_last_state(buckled):
    """Also where guys or hangers that do not buckle are far softer; C finds the same nodes as Python."""
    loaded = buckled()
    result = loaded.solve()
    more, mode = buckling_mode(loaded, result.displacements.astype(np.longdouble))
    found = result.mode.ravel()[~loaded.fixed.ravel()]
    assert result.report["load_factor"] < 1.0
    assert 0.0 < more < 0.1 * result.report["load_factor"]
    assert abs(found @ mode) > 0.99 * np.linalg.norm(found) * np.linalg.norm(mode)
    structure = latinpc.Structure.from_scene(loaded)
    snes, u = structure.create_snes(), structure.create_vec()
    snes.setFromOptions()
    snes.solve(None, u)
    moved = np.abs(result.mode).max(axis=1)
    nodes = np.flatnonzero(moved >= 0.5 * moved.max()).tolist()
    assert latinpc.unsupported_nodes(snes) == (len(nodes), nodes[:8])


@pytest.mark.parametrize(("name", "options"), [("mast", {"load": 20000.0}), ("tower", {"load": 8000.0, "wind": 1.0})])
@pytest.mark.filterwarnings("ignore::latinpc.LatinWarning")
def test_limit_loads_are_those_of_an_independent_path(name, options):
    """Of a mast that buckles between its guys, and of a tower that turns over."""
    loaded = make(name, **options)
    path = Corotational(loaded).follow()
    result = loaded.solve()
    assert not path.follows
    assert result.report["load_factor"] == pytest.approx(path.factor, rel=2e-3)
    assert Corotational(loaded).stable(result.displacements.astype(np.longdouble))


def test_where_a_cable_slackens_the_path_goes_on():
    """A tower that becomes 13 times softer there, to rounding the equilibrium of an independent path."""
    loaded = draw(1, 193, "large").scene
    result = loaded.solve(error=1e-8)
    exact = Corotational(loaded).follow().displacements
    assert result.converged
    assert np.linalg.norm(result.displacements - exact) < 1e-7 * np.linalg.norm(exact)


def test_tensions_out_of_balance_move_a_mast_first():
    """The path starts where the prestress leaves it, not from the drawn configuration."""
    drawn = make("mast", levels=1, panels=3)
    rng = np.random.default_rng(0)
    off = replace(drawn, initial_elongation=drawn.initial_elongation * rng.uniform(0.8, 1.25, len(drawn.links)))
    exact = Corotational(off).follow()
    result = off.solve(error=1e-8)
    assert exact.factor == 1.0
    assert result.converged
    assert np.linalg.norm(result.displacements - exact.displacements) < 1e-7 * np.linalg.norm(exact.displacements)


@pytest.mark.parametrize("shortening", [0.01, 0.05, 0.2])
def test_turnbuckles_alone_tighten_a_simplex(shortening):
    """Where nothing acts beside them the path ends where it starts, in the least energy of three unknowns."""
    given = turning.simplex(0.0) | {"initial_elongation": np.repeat([0.0, shortening, 0.0], [6, 3, 3])}
    del given["prestress"], given["load"]
    structure = latinpc.Structure(**given, geometry="large")
    result = structure.solve(error=1e-8)
    third = np.arange(3) * 2.0 * np.pi / 3.0

    def tensions(state):
        radius, twist, rise = state
        nodes = structure.nodes.copy()
        nodes[3:] = np.column_stack([radius * np.cos(third + twist), radius * np.sin(third + twist), [rise] * 3])
        length = np.linalg.norm(np.diff(nodes[structure.links], axis=1)[:, 0], axis=1)
        strain = length - structure.lengths + structure.initial_elongation
        return structure.stiffness * np.where(structure.law == latinpc.Law.CABLE, np.maximum(strain, 0.0), strain)

    start = [1.0, np.deg2rad(150.0), 1.0]
    least = scipy.optimize.minimize(lambda state: (tensions(state) ** 2).sum() / 1e8, start, tol=1e-14)
    assert result.converged
    assert result.iterations < 100
    assert np.abs(result.tensions - tensions(least.x)).max() < 1e-5 * np.abs(result.tensions).max()


@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_increments_on_the_command_line(tmp_path, ranks):
    """The same end as without; the displacements grow; the last stable state is written where no other follows."""
    files = [tmp_path / "one.json", tmp_path / "ten.json"]
    command("solve", "tower", "--json", files[0], ranks=ranks)
    command("solve", "tower", "--increments", 5, "--json", files[1], ranks=ranks)
    one, ten = (json.loads(file.read_text()) for file in files)
    factors, moved = np.array(ten["load_path"]).T
    assert factors == pytest.approx(np.arange(1, 6) / 5)
    assert (np.diff(moved) > 0.0).all()
    assert one["reactions"]["sum"] == pytest.approx(ten["reactions"]["sum"], rel=1e-3, abs=0.1)
    beyond = command(
        "solve", "tower", "--load", "8000", "--wind", "1", "--increments", "5", "--json", files[0],
        "--output", tmp_path / "last.vtu", ranks=ranks, code=1,
    )  # fmt: skip
    assert "no stable equilibrium follows that of 0.0" in " ".join(said(beyond))
    assert "load path" in beyond.stdout and "load factor" in beyond.stdout
    report = json.loads(files[0].read_text())
    assert 0.0 < report["load_factor"] < 0.1
    assert report["reactions"]["force_without_balance"] < 1e-3
    assert (tmp_path / "last.vtu").exists()


def test_a_warm_start_goes_on_from_the_last_equilibrium():
    """Beyond the first load the path does not begin anew; of the new loads the part that both have in common counts."""
    limit = turning.von_mises_limit()
    structure = latinpc.Structure(**turning.von_mises(0.5 * limit), geometry="large")
    snes, u = structure.create_snes(), structure.create_vec()
    with default_options({"snes_latin_warm_start": "last", "snes_latin_error": 1e-10}):
        snes.setFromOptions()
    snes.solve(None, u)
    structure.set_load(turning.von_mises(0.9 * limit)["load"])
    snes.solve(None, u)
    assert latinpc.path(snes)["borne"] == 1.0
    assert -structure.displacements(u)[2, 1] == pytest.approx(turning.von_mises_deflection(0.9 * limit), rel=1e-9)
    structure.set_load(turning.von_mises(2.0 * limit)["load"])
    snes.solve(None, u)
    assert snes.getConvergedReason() < 0
    assert latinpc.path(snes)["borne"] == pytest.approx(0.5, abs=2e-4)


@pytest.mark.parametrize("error", [1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize("number", [None, 45])
def test_the_error_asked_for_is_met(number, error):
    """By towers whose cables slacken, after Newton's method has got operators of its own: soft fields count as well."""
    loaded = make("tower") if number is None else draw(5, number, "large").scene
    exact = Corotational(loaded).follow().displacements
    result = loaded.solve(error=error)
    assert result.converged
    assert np.linalg.norm(result.displacements - exact) <= error * np.linalg.norm(exact)


@pytest.mark.parametrize("pushed", [False, True])
def test_forces_that_are_no_loads_bear_no_part_of_them(pushed):
    """Prestress that does not hold its structure: 1.008 and -0.28 of the loads had been borne."""
    shapes = {
        False: (
            [[-1, 2], [-2, 2], [-1, 2], [2, 0], [2, -2]],
            [[1, 3], [1, 4], [2, 4], [3, 4]],
            [0.01, 0.01, 0.06, 0.07],
        ),
        True: ([[0, 1], [0, -2], [2, -1], [2, 0], [2, -1]], [[0, 3], [1, 4], [2, 3], [3, 4]], [0.07] * 4),
    }
    nodes, links, elongation = shapes[pushed]
    fixed, load = np.zeros((5, 2), bool), np.zeros((5, 2))
    fixed[:2] = True
    load[2:] = [[0, 10], [0, -10], [0, 0]] if pushed else [[0, 0], [10, 10], [0, -10]]
    bars = latinpc.Structure(nodes, links, "bar", 1e4, initial_elongation=elongation, fixed=fixed, load=load,
                             geometry="large")  # fmt: skip
    with pytest.warns(latinpc.LatinWarning, match="no stable equilibrium|is a mechanism"):
        result = bars.solve()
    assert not result.converged
    # with some kernels of the BLAS rounding gives the pushed mechanism a stiffness of 1e-12 of its bars
    assert result.report["load_factor"] == 0.0 or (pushed and 0.0 < result.report["load_factor"] < 1.0)


@pytest.mark.filterwarnings("ignore::latinpc.LatinWarning")
def test_a_drawing_that_is_unstable_ends_with_that_cause():
    """A strut that is too long buckles without loads: 10,000 iterations had been too few."""
    nodes, laws = [[0, 3, 3], [0, 2, 3], [0, 3, 0]], ["compression_only", "bar"]
    struts = latinpc.Structure(nodes, [[0, 1], [0, 2]], laws, [61, 55],
                               initial_elongation=[-0.068, 0.785], fixed=[[0] * 3, [1] * 3, [0] * 3],
                               load=[[4e-3, 0, 4e-3], [0] * 3, [0, 4e-3, -4e-3]], geometry="large")  # fmt: skip
    result = struts.solve()
    assert (result.report["reason"], result.report["load_factor"]) == ("DIVERGED_DTOL", 0.0)
    assert result.report["iterations"] < 6000
    assert any(notice.startswith("the structure as drawn is unstable") for notice in result.notices)
    assert "part of the loads" not in dict(summary(result))["load factor"]


@pytest.mark.parametrize("wind", [2e-3, 2e-2])
def test_a_mast_whose_slack_guys_have_nodes_of_their_own(wind):
    """These rest anywhere: the path had ended at a hundredth of the loads."""
    nodes, links = [[0.0, 0.0, 0.0], [0.0, 0.0, 10.0]], [[0, 1]]
    for angle in 2.0 * np.pi / 3.0 * np.arange(3):
        foot = np.array([6.0 * np.cos(angle), 6.0 * np.sin(angle), 0.0])
        links += [[len(nodes), len(nodes) + 1], [len(nodes) + 1, 1]]
        nodes += [foot, (foot + nodes[1]) / 2.0]
    nodes, fixed, load = np.array(nodes), np.zeros((8, 3), bool), np.zeros((8, 3))
    length = np.linalg.norm(np.diff(nodes[links], axis=1)[:, 0], axis=1)
    fixed[::2], load[1] = True, [wind, 0.0, -0.01]
    mast = latinpc.Structure(nodes, links, ["bar"] + ["cable"] * 6, 1.0 / length, fixed=fixed, load=load,
                             initial_elongation=[0.0, *1e-3 * length[1:]], geometry="large")  # fmt: skip
    found = mast.solve(error=1e-6)
    assert found.converged and found.balance.force < 1e-6
    assert np.count_nonzero(found.tensions <= 0.0) >= 2
