"""Scenes that prestress holds: balance and stability as drawn, the geometry, the command line."""

from dataclasses import replace

import numpy as np
import oracle
import pytest
import scipy.sparse as sp
from test_cli import latinpc as command
from test_cli import said
from test_scenes import HELD, SMALL

import latinpc
from latinpc.results.limit import moving, softest
from latinpc.scenes import SCENES, Law, Scene, make


def tangent(scene):
    """The tangent stiffness as drawn, dense."""
    structure = latinpc.Structure.from_scene(scene)
    J = structure.dm.createMat()
    structure.jacobian(structure.create_vec(), J)
    return J.convert("dense").getDenseArray().copy()


OPTIONS = [(name, {}) for name in HELD]
OPTIONS += [("saddle", {"side": 2, "height": 0.0}), ("hypar", {"side": 5, "sag": 0.05, "height": 0.8})]
OPTIONS += [("mast", {"levels": 1, "panels": 1}), ("mast", {"levels": 4, "panels": 3})]
OPTIONS += [("tower", {"stages": 1, "struts": 7}), ("tower", {"stages": 5, "struts": 4}), ("bridge", {"panels": 9})]


@pytest.mark.parametrize(("name", "options"), OPTIONS)
def test_tensions_balance_as_drawn_and_make_it_stable(name, options):
    """Cables are taut, struts are pressed, no node is pulled, and the tangent stiffness is positive definite."""
    scene = make(name, **(SMALL[name] | options))
    b, _ = oracle.kinematics(scene)
    tension = scene.stiffness * scene.initial_elongation
    assert np.allclose(tension, scene.prestress, rtol=1e-13)
    assert np.abs((b.T @ tension)[~scene.fixed.ravel()]).max() < 1e-12 * np.abs(tension).max()
    assert (tension[scene.law == Law.CABLE] > 0.0).all()
    values = np.linalg.eigvalsh(tangent(scene))
    assert values[0] > 1e-9 * values[-1]


@pytest.mark.parametrize(("name", "options"), [("saddle", {"height": 0.0}), *((name, {}) for name in HELD[1:])])
def test_without_prestress_they_are_mechanisms(name, options):
    """Elongations alone do not resist all displacements, and the refusal names the option."""
    scene = make(name, **(SMALL[name] | options))
    b, _ = oracle.kinematics(scene)
    b = b[:, ~scene.fixed.ravel()]
    values = np.linalg.eigvalsh((b.T @ sp.diags(scene.stiffness) @ b).toarray())
    assert values[0] < 1e-12 * values[-1]
    with pytest.raises(latinpc.SolveError, match=r"Nodes that move .* take the geometry prestress or large"):
        replace(scene, geometry="linear").solve()


@pytest.mark.parametrize("name", HELD)
def test_large_is_their_geometry_and_linear_that_of_all_others(name):
    assert make(name, **SMALL[name]).geometry == "large"
    assert latinpc.Structure.from_scene(make(name, **SMALL[name])).geometry == "large"
    assert all(make(other, **SMALL[other]).geometry == "linear" for other in set(SCENES) - set(HELD))


def test_a_linear_scene_holds_no_more_than_before():
    """The geometry is a word; prestress is computed when it is asked for."""
    scene = make("lattice", **SMALL["lattice"])
    assert "prestress" not in vars(scene)
    assert scene.prestress == pytest.approx(scene.stiffness * scene.initial_elongation)


def test_a_wrong_geometry_is_named():
    with pytest.raises(ValueError, match="geometry must be one of linear, prestress, large, not 'small'"):
        Scene("x", [[0.0], [1.0]], [[0, 1]], "bar", 1.0, fixed=[[True], [False]], geometry="small")


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("saddle", {"side": 1}, "side must be at least 2"),
        ("hypar", {"sag": 0.0}, "sag must be positive"),
        ("mast", {"levels": 0}, "at least one level"),
        ("tower", {"struts": 2}, "three struts"),
        ("bridge", {"panels": 1}, "at least 2 panels"),
        *((name, {"prestress": -1.0}, "prestress must be positive") for name in HELD),
    ],
)
def test_refusals(name, options, words):
    with pytest.raises(ValueError, match=words):
        make(name, **options)


def test_loads_slacken_cables():
    """The figures of the docstrings: a tenth of the saddle's cables, the arching cables of the bridge."""
    for name, options, share in (("saddle", {}, 0.1), ("bridge", {}, 0.128)):
        result = make(name, **options).solve(error=1e-8)  # cables next to slack ones bear less than 1e-4 of the others
        assert result.converged
        assert result.report["slack_fraction"] == pytest.approx(share, abs=0.005)


def test_the_command_line_takes_the_geometry_of_the_scene_and_the_option_comes_before_it():
    assert "converged in" in command("solve", "saddle", "--side", "6").stdout
    low = command("solve", "saddle", "--side", "6", "-snes_latin_geometry", "prestress")
    assert "take -snes_latin_geometry large" in low.stderr
    flat = said(command("solve", "saddle", "--side", "6", "--height", "0", "-snes_latin_geometry", "linear", code=2))
    assert "take the geometry prestress or large (-snes_latin_geometry)" in " ".join(flat)
    assert "prestressed" in command("scenes").stdout


@pytest.mark.filterwarnings("ignore::latinpc.LatinWarning")
@pytest.mark.parametrize("geometry", ["prestress", "large"])
@pytest.mark.parametrize("name", HELD)
def test_reactions_balance_the_loads(name, geometry):
    """In force and moment: of links that lean by small angles as drawn, else of the displaced structure."""
    result = replace(make(name, **SMALL[name]), geometry=geometry).solve(error=1e-10)
    assert result.converged
    assert max(result.balance.force, result.balance.moment) < 1e-8
    assert not any("reactions" in notice for notice in result.notices)


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_mechanism_is_drawn(tmp_path, ranks):
    """A frame without a brace, which no prestress holds, and a flat net as a linear structure."""
    (tmp_path / "frame.obj").write_text("v 0 0 0\nv 2 0 0\nv 0 1 0\nv 2 1 0\nl 1 3\nl 3 4\nl 2 4\n")
    options = ("--EA", "1e6", "--support", "y=min", "--load", "x=10:y=max")
    frame = command("solve", tmp_path / "frame.obj", *options, "--picture", tmp_path / "a.png", ranks=ranks, code=2)
    assert "Prescribe more displacements or add links" in frame.stderr
    assert f"{tmp_path / 'a.png'} shows the motion that no link resists" in frame.stderr
    linear = ("-snes_latin_geometry", "linear")
    net = command("solve", "saddle", "--side", "4", "--height", "0", "--picture", tmp_path / "b.png", *linear, code=2)
    assert "take the geometry prestress or large" in net.stderr
    assert min((tmp_path / name).stat().st_size for name in ("a.png", "b.png")) > 10000


def test_the_motion_of_a_mechanism():
    """Of two bars in a line their node moves across, whether nothing resists it or their compression drives it."""
    line = latinpc.Structure(
        [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]], [[0, 1], [1, 2]], "bar", 1e3, fixed=[[1, 1], [0, 0], [1, 1]],
        geometry="large",
    )  # fmt: skip
    for tension, expected in ((0.0, "mechanism"), (-1.0, "unstable"), (1.0, "soft")):
        line.set_prestress(np.full(2, tension))
        mode, kind = softest(line, line.create_vec(), np.full(2, tension), True)
        assert kind == expected
        if tension <= 0.0:
            assert abs(mode) == pytest.approx(np.array([[0.0, 0.0], [0.0, 1.0], [0.0, 0.0]]), abs=1e-6)


def test_nodes_that_move_alike_are_named_in_their_order():
    assert moving(np.array([[0.6, 0.0], [2.0 - 1e-9, 0.0], [0.0, -2.0], [0.0, 1.2]])).tolist() == [1, 2, 3]


def test_a_mechanism_with_large_displacements_is_called_one():
    """A hinged portal; clamped nodes are not named."""
    portal = {"nodes": [[0, 0], [2, 0], [0, 1], [2, 1]], "links": [[0, 2], [2, 3], [1, 3]], "law": "bar"}
    portal |= {"fixed": [[1, 1], [1, 1], [0, 0], [0, 0]], "stiffness": 1e6, "geometry": "large"}
    load = np.array([[0, 0], [0, 0], [0, -10], [0, -10]])
    cure = "tighten links, prescribe more displacements or add links; nodes that move: "
    with pytest.warns(latinpc.LatinWarning, match=f"is a mechanism that no prestress holds: {cure}2, 3$"):
        latinpc.Structure(**portal, load=load).solve()


def test_a_self_stress_that_buckles_is_named_where_the_iteration_stays_as_drawn():
    """A column that bears more than its critical load without loads, pulled along its axis."""
    column = latinpc.Structure(
        [[0, 0], [0, 1], [0, 2], [1, 1]], [[0, 1], [1, 2], [1, 3]], "bar", [1e6, 1e6, 100.0], prestress=[-60, -60, 0],
        fixed=[[1, 1], [0, 0], [1, 1], [1, 1]], load=[[0, 0], [0, 1], [0, 0], [0, 0]], geometry="large",
    )  # fmt: skip
    with pytest.warns(latinpc.ConvergenceWarning):
        result = column.solve(options={"snes_max_it": 3000})
    assert not result.converged
    assert "the structure as drawn is unstable: its prestress makes it buckle; nodes that move: 1" in result.notices


@pytest.mark.parametrize("tension", [100.0, -100.0, 0.0])
def test_a_self_stress_elsewhere_gives_no_hint(tension):
    """A hanging bar without tension beside a braced square: prestress cannot hold it, whatever its sign."""
    nodes = [[0, 0], [1, 0], [1, 1], [0, 1], [3, 0], [3, -1]]
    links = [[0, 1], [1, 2], [2, 3], [3, 0], [0, 2], [1, 3], [4, 5]]
    fixed = [[1, 1], [0, 1], [0, 0], [0, 0], [1, 1], [0, 0]]
    prestress = tension * np.array([1, 1, 1, 1, -np.sqrt(2), -np.sqrt(2), 0])
    load = np.zeros((6, 2)) + [0, -1]
    square = latinpc.Structure(nodes, links, "bar", 1e6, prestress=prestress, fixed=fixed, load=load)
    with pytest.raises(latinpc.SolveError, match=r"mechanism.*: 5\. Prescribe more displacements or add links$"):
        square.solve()


@pytest.mark.parametrize(("law", "cure"), [("cable", "take the geometry large"), ("bar", "Prescribe more displ")])
def test_a_mechanism_of_cables_names_the_geometry(law, cure):
    """A straight rope under its weight has no equilibrium as drawn; with large displacements it hangs."""
    nodes, load = [[i, 0] for i in range(5)], [[0, -1]] * 5
    links, fixed = [[i, i + 1] for i in range(4)], [[i in (0, 4)] * 2 for i in range(5)]
    rope = latinpc.Structure(nodes, links, law, EA=1e4, fixed=fixed, load=load)
    with pytest.raises(
        latinpc.SolveError, match=rf"mechanism.*\. {'If its cables hang.*' if law == 'cable' else ''}{cure}"
    ):
        rope.solve()
    rope.set_geometry("large")
    assert rope.solve().converged


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_plane_truss_in_space_names_the_axis(axis):
    """Nothing holds it across its plane; where it is free within the plane as well, that is not all."""
    plane = [c for c in range(3) if c != axis]
    nodes, fixed, load = np.full((3, 3), 0.7), np.zeros((3, 3), bool), np.zeros((3, 3))
    nodes[:, plane], fixed[:2], load[2, plane[0]] = [[0, 0], [1, 0], [0, 1]], True, 1.0
    truss = {"nodes": nodes, "law": "bar", "EA": 1e5, "fixed": fixed, "load": load}
    with pytest.raises(latinpc.SolveError, match=rf": 2\. It lies in a plane of constant {'xyz'[axis]}: prescribe"):
        latinpc.Structure(links=[[0, 2], [1, 2]], **truss).solve()
    with pytest.raises(latinpc.SolveError, match=r": 2\. Prescribe more displacements or add links$"):
        latinpc.Structure(links=[[0, 2]], **truss).solve()
    fixed[:, axis] = True
    assert latinpc.Structure(links=[[0, 2], [1, 2]], **truss).solve().converged


@pytest.mark.parametrize("subdomains", [1, 4])
@pytest.mark.parametrize("count", [3, 30])
def test_a_row_that_prestress_buckles_is_no_mechanism(count, subdomains):
    """A row of bars, each node held across by a soft one: stable just below the critical prestress, refused beyond."""
    ends = np.arange(count + 2)
    inner = ends[1:-1]
    nodes = np.vstack([np.column_stack([ends, 0 * ends]), np.column_stack([inner, 0 * inner - 1])]).astype(float)
    links = np.vstack([np.column_stack([ends[:-1], ends[1:]]), np.column_stack([inner, count + 1 + inner])])
    fixed = np.ones(nodes.shape, bool)
    fixed[inner] = False
    load = np.where(fixed, 0.0, [0.0, -1.0])
    along = np.arange(len(links)) <= count
    stiffness = np.where(along, 1e6, 400.0)
    critical = 200.0 / (1.0 + np.cos(np.pi / (count + 1)))
    for part, stable in ((0.99, True), (1.01, False), (10.0, False)):
        row = latinpc.Structure(
            nodes, links, "bar", stiffness, fixed=fixed, load=load, prestress=np.where(along, -part * critical, 0.0),
            geometry="prestress",
        )  # fmt: skip
        options = {"snes_latin_subdomains": subdomains}
        if stable:
            assert row.solve(options=options).converged
            continue
        with pytest.raises(latinpc.SolveError, match="as drawn is unstable: its prestress makes it buckle"):
            row.solve(options=options)
