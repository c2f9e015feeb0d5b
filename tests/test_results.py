"""Results: tables, summaries, files, options, and what is said when something is wrong."""

import inspect
import json
import re
import sys
import warnings
import xml.etree.ElementTree
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import oracle
import pytest
from command import latinpc as command
from conftest import ROOT, run
from matplotlib.figure import Figure
from petsc4py import PETSc
from support import grid, network

import latinpc
from latinpc.options import default_options
from latinpc.results.units import quantity
from latinpc.scenes import Law, Scene, make

COMMAND = [Path(sys.executable).parent / "latinpc"]
NET = {
    "nodes": [[-1, 1], [1, 1], [0, -1], [0, 0]],
    "links": [[0, 3], [1, 3], [2, 3]],
    "law": "cable",
    "stiffness": 1e4,
    "fixed": [[1, 1], [1, 1], [1, 1], [0, 0]],
    "load": [[0, 0], [0, 0], [0, 0], [0, -10]],
    "name": "net",
}


def net(**changes):
    return latinpc.Structure(**(NET | changes), comm=PETSc.COMM_SELF)


@pytest.fixture(scope="module")
def result():
    return net(area=[1e-4, 1e-4, np.nan], strength=1e5).solve(error=1e-6)


def test_a_net_of_three_cables(result):
    """The tie is slack: two cables at right angles share the weight."""
    assert result.converged and result.iterations and result.estimated_error <= 1e-6
    assert result.displacements == pytest.approx(np.array([[0, 0], [0, 0], [0, 0], [0, -1e-3]]), abs=1e-9)
    assert result.tensions == pytest.approx([50**0.5, 50**0.5, 0])
    assert result.reactions == pytest.approx(np.array([[-5, 5], [5, 5], [0, 0], [0, 0]]), abs=1e-6)
    assert result.slack.tolist() == [False, False, True]
    assert result.stress[:2] == pytest.approx(50**0.5 / 1e-4) and np.isnan(result.stress[2])
    assert result.utilisation[:2] == pytest.approx(50**0.5 / 10)
    assert result.balance.load.tolist() == [0, -10] and result.balance.reaction == pytest.approx([0, 10], abs=1e-6)


@pytest.mark.parametrize(("name", "kind"), [("snes_latin_error", "a number"), ("snes_latin_subdomains", "an integer")])
def test_a_value_that_is_no_number_is_said_with_its_option(name, kind):
    with pytest.raises(latinpc.SolveError, match=f"^-{name} is {kind}, not abc$"):
        net().solve(options={name: "abc"})


@pytest.mark.parametrize("error", [1e-1, 1e-9])
def test_the_largest_unbalanced_force_is_that_of_equation_1(error):
    """B^t tau - F at the nodes, from what the result has; the largest one and its node are printed."""
    found = latinpc.Structure.from_scene(grid(), PETSc.COMM_SELF).solve(options={"snes_stol": error})
    structure = found.structure
    left, pull = -structure.load, found.tensions[:, None] * structure.directions
    np.add.at(left, structure.links[:, 0], -pull)
    np.add.at(left, structure.links[:, 1], pull)
    size = np.linalg.norm(np.where(structure.fixed, 0.0, left), axis=1)
    rounding = 1e-12 * np.abs(found.tensions).max()
    assert found.largest_unbalance == pytest.approx(size.max(), rel=1e-6, abs=rounding)
    assert size.max() - size[found.report["unbalanced_node"]] <= rounding
    if error > 1e-8:
        assert found.largest_unbalance > 1e-3
        assert f"at most {quantity(size.max(), 'N')} at node {size.argmax()}" in str(found)


# ---- tables and files ------------------------------------------------------------------------
def test_members_and_nodes(result):
    members, nodes = result.members, result.nodes
    assert members.dtype.names == (
        "link", "start", "end", "law", "length", "elongation", "tension", "slack", "stress", "utilisation",
    )  # fmt: skip
    assert members["law"].tolist() == ["cable"] * 3 and members[members["slack"]]["link"].tolist() == [2]
    assert members["length"] == pytest.approx([2**0.5, 2**0.5, 1])
    assert members["elongation"] * 1e4 == pytest.approx([50**0.5, 50**0.5, -10], rel=1e-5)
    assert nodes["reaction_y"] == pytest.approx([5, 5, 0, 0], abs=1e-6)
    assert nodes[nodes["supported"]]["node"].tolist() == [0, 1, 2]
    assert nodes["displacement_y"][3] == pytest.approx(-1e-3)
    assert "stress" not in net().solve().members.dtype.names
    in_space = grid(modules=3, subdomains=1).solve(comm=PETSc.COMM_SELF).nodes.dtype.names
    assert {"z", "displacement_z", "load_z", "reaction_z"} <= set(in_space)


def test_data_frames(result, monkeypatch):
    members, nodes = result.to_pandas()
    assert members.tension[0] == pytest.approx(50**0.5) and members.index.name == "link"
    assert nodes.reaction_y.sum() == pytest.approx(10) and nodes.index.name == "node"
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError, match="pip install pandas"):
        result.to_pandas()


def test_files(result, tmp_path):
    result.to_csv(tmp_path / "m.csv", tmp_path / "n.csv")
    result.to_csv(tmp_path / "alone.csv")
    assert (tmp_path / "alone.csv").read_text() == (tmp_path / "m.csv").read_text()
    rows = [line.split(",") for line in (tmp_path / "m.csv").read_text().splitlines()]
    assert rows[0] == list(result.members.dtype.names)
    assert float(rows[1][6]) == result.tensions[0]  # to the last bit
    assert rows[3][3:5] == ["cable", "1.0"] and rows[3][7:] == ["1", "", ""]  # no area, no stress
    result.to_vtu(tmp_path / "net.vtu")
    mesh = meshio.read(tmp_path / "net.vtu")
    assert mesh.point_data["reaction"][:, :2] == pytest.approx(result.reactions)
    assert mesh.cell_data["utilisation"][0][:2] == pytest.approx(result.utilisation[:2])
    assert np.isnan(mesh.cell_data["stress"][0][2])


def test_report_for_json(result):
    report = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    assert report["reactions"]["nodes"] == [0, 1, 2]
    assert report["reactions"]["forces"][0] == pytest.approx([-5, 5])
    assert report["reactions"]["sum"] == pytest.approx([0, 10], abs=1e-6)
    assert report["reactions"]["force_without_balance"] < 1e-6
    assert report["largest_utilisation"] == pytest.approx(50**0.5 / 10)
    assert report["converged"] and report["reason_in_words"] == result.reason


def test_summaries(result):
    text = str(result)
    for words in ("net", "sum (0, 10) N, of the loads (0, -10) N", "loads + reactions: force", "70.7 kPa in link",
                  "largest 70.7 % in link"):  # fmt: skip
        assert words in text
    html = xml.etree.ElementTree.fromstring(net(name="<b> & co").solve()._repr_html_())
    assert html.find("caption/b").text == "<b> & co"
    assert "reactions" in [cell.text for cell in html.iter("th")]


def test_plot(result, tmp_path):
    figure = result.plot()
    assert isinstance(figure, Figure) and "net" in [text.get_text() for text in figure.texts]
    figure.savefig(tmp_path / "net.png")
    assert (tmp_path / "net.png").stat().st_size > 10000
    mine = Figure(figsize=(4, 3))
    assert result.plot(mine, amplification=1.0) is mine
    assert any("drawn × 1" in text.get_text() for text in mine.texts)


def test_notebooks_show_plots(result):
    assert result.plot()._repr_png_().startswith(b"\x89PNG")


def test_command_line(tmp_path):
    names = ["m.csv", "n.csv", "r.json", "r.vtu"]
    files = ["--csv", *names[:2], "--json", names[2], "--output", names[3]]
    out = run([*COMMAND, "solve", ROOT / "examples" / "footbridge.msh", *files], cwd=tmp_path).stdout
    assert "sum (0, 0, 552) kN, of the loads (0, 0, -552) kN; largest 140 kN at node " in out
    assert "stress " in out and "utilisation " in out and "written" in out
    report = json.loads((tmp_path / "r.json").read_text())
    assert np.sum(report["reactions"]["forces"], axis=0) == pytest.approx(report["reactions"]["sum"])
    assert report["reactions"]["sum"][2] == pytest.approx(552e3, rel=1e-6)
    links = np.genfromtxt(tmp_path / "m.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
    assert len(links) == report["links"] and np.abs(links["stress"]).max() == pytest.approx(report["largest_stress"])
    points = np.genfromtxt(tmp_path / "n.csv", delimiter=",", names=True)
    assert points["reaction_z"].sum() == pytest.approx(552e3, rel=1e-6)
    assert meshio.read(tmp_path / "r.vtu").point_data["reaction"].sum(axis=0)[2] == pytest.approx(552e3, rel=1e-6)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["network", "--csv", "m.txt", "n.csv"], "m.txt"),
    ],
)
def test_command_line_refuses(words, said, tmp_path):
    assert said in command("solve", *words, cwd=tmp_path, code=2).stderr


def test_newtons_method_alone_says_how_accurate_it_is():
    result = make("mast", wind=200.0).solve()
    assert not len(result.history["indicator"]) and 0.0 <= result.estimated_error <= 1e-4
    assert re.search("accuracy +estimated error of the displacements .*, of the tensions ", str(result))


# ---- options ---------------------------------------------------------------------------------
def test_misspelt_options_are_refused():
    with pytest.raises(ValueError, match=r"unknown option -snes_latin_stopp: do you mean -snes_latin_stop\?"):
        net().solve(options={"snes_latin_stopp": 1})
    with pytest.raises(ValueError, match=r"unknown option -snes_latn_error: do you mean -snes_latin_error\?"):
        net().solve(options={"snes_latn_error": 1e-6})
    with (
        default_options({"snes_latin_eror": 1}),
        pytest.warns(latinpc.LatinWarning, match="do you mean -snes_latin_error"),
    ):
        net().solve()
    with pytest.raises(ValueError, match=r"do you mean -pc_latin_variant"):
        net().solve(options={"-pc_latin_varaint": "corner"})
    with pytest.raises(ValueError, match="'acurate': do you mean 'accurate'. choose from .*balanced, .*fast"):
        net().solve(preset="acurate")
    with pytest.raises(ValueError, match="between 0 and 1"):
        net().solve(error=2)
    with pytest.raises(TypeError, match="options must be a dictionary"):
        net().solve(options=["snes_monitor"])


def test_options_that_nothing_reads_are_warned_of(recwarn):
    net().solve(options={"snes_latin_outer_snes_typee": "anderson", "snes_max_itt": 3, "snes_max_it": 50})
    said = str(recwarn.pop(latinpc.LatinWarning).message)
    assert "-snes_latin_outer_snes_typee, -snes_max_itt" in said and "-snes_max_it," not in said
    assert recwarn.list == []


def test_options_leave_no_trace_and_the_database_comes_first(options):
    options("-snes_max_it 1 -snes_latin_newton never")
    before = PETSc.Options().getAll()
    with pytest.warns(latinpc.ConvergenceWarning):
        found = grid().solve(comm=PETSc.COMM_SELF, options={"snes_max_it": 500, "snes_latin_variant": "macro"})
    assert found.iterations == 1
    assert PETSc.Options().getAll() == before


@pytest.mark.parametrize("path", sorted((ROOT / "options").glob("*.opts")), ids=lambda path: path.stem)
def test_presets_are_the_files(path):
    """Each solves what it is for, and is what the file is to the command line."""
    scene = make("truss-grid", modules=12)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = scene.solve(comm=PETSc.COMM_SELF, preset=path.stem)
    assert found.converged
    line = [*COMMAND, "solve", "truss-grid", "--modules", 12, "--json", "-", "-options_file", path]
    report = json.loads(run(line).stdout)
    for key in ("solver", "iterations", "reason", "subdomains"):
        assert report[key] == found.report[key]


def test_an_error_replaces_the_stop_of_a_preset():
    scene = grid()
    loose, tight = (scene.solve(comm=PETSc.COMM_SELF, preset="fast", error=error) for error in (1e-2, 1e-8))
    assert loose.estimated_error <= 1e-2 and tight.estimated_error <= 1e-8
    exact = oracle.newton(scene)
    assert np.linalg.norm(tight.displacements - exact) < 1e-7 * np.linalg.norm(exact)
    assert loose.iterations < tight.iterations


# ---- what is wrong ---------------------------------------------------------------------------
def test_without_convergence_it_warns_or_raises():
    options = {"snes_max_it": 2, "snes_latin_newton": "never"}
    structure = latinpc.Structure.from_scene(grid(), comm=PETSc.COMM_SELF)
    with pytest.warns(latinpc.ConvergenceWarning, match="not converged: the iterations .* were not enough") as caught:
        found = structure.solve(options=options)
    assert caught[0].filename == __file__  # the line of the caller
    assert not found.converged and "DIVERGED_MAX_IT" in found.reason and found.iterations == 2
    assert "not converged" in str(found) and np.isfinite(found.displacements).all()
    for error, shown in ((0.5, True), (1.5, False)):
        found.report |= {"estimated_error": error, "tension_error": error}
        assert (f"estimated error of the displacements {100 * error:.0f} %" in str(found)) == shown
        assert (f"of the tensions {100 * error:.0f} %" in str(found)) == shown
    with pytest.raises(latinpc.SolveError, match="not converged") as error:
        structure.solve(options=options, raise_on_failure=True)
    assert np.array_equal(error.value.result.displacements, found.displacements)


def test_no_equilibrium_is_said_in_words():
    """A cable that cannot push, under a weight: the notice names the node."""
    falls = net(links=[[2, 3], [0, 3], [1, 3]], law=["cable", "compression_only", "compression_only"])
    with pytest.warns(latinpc.LatinWarning) as caught:
        found = falls.solve()
    assert not found.converged
    assert any("slack links no longer hold node 3" in str(warning.message) for warning in caught)


def test_what_cannot_be_solved_is_one_sentence():
    for fixed, words in (
        (None, "^Nothing is supported: "),
        ([[1, 1], *[[0, 0]] * 3], "^The structure has a mechanism"),
    ):
        with pytest.raises(latinpc.SolveError, match=words) as error:
            net(fixed=fixed).solve()
        assert "\n" not in str(error.value) and error.value.result is None


def test_coordinates_of_rounding_are_printed_as_zero():
    """A node on a circle, as programs that draw write it."""
    text = str(net(nodes=[[-1, 1], [1, 1], [6e-17, -1], [-1.8e-16, 0]]).solve())
    assert "at node 3 (0, 0) m" in text


def test_of_large_displacements_what_is_large_is_said():
    bar = dict(nodes=[[0.0], [1.0]], links=[[0, 1]], law="bar", stiffness=1.0, fixed=[[1], [0]], load=[[0], [1.0]])
    with pytest.warns(latinpc.LatinWarning, match="^nodes move by 1 of the size of the structure: small"):
        latinpc.Structure(**bar).solve()


def test_duplicate_links_are_warned_of():
    twice = net(links=[[0, 3], [1, 3], [3, 0], [2, 3]])
    with pytest.warns(latinpc.LatinWarning, match="same law: 0 and 2; what they carry adds up"):
        found = twice.solve()
    assert found.notices == twice.notices
    assert not net(links=[[0, 3], [1, 3], [3, 0], [2, 3]], law=["cable", "cable", "bar", "cable"]).notices
    assert not net(links=[[0, 3], [1, 3], [3, 0], [2, 3]], direction=[[0, 0], [0, 0], [0, 1], [0, 0]]).notices
    many = net(links=[[0, 3]] * 8 + [[1, 3]])
    assert "4 and 5, and 2 more" in many.notices[0]
    assert not latinpc.Structure.from_scene(grid(), comm=PETSc.COMM_SELF).notices  # whose modules share edges


def test_duplicate_lines_of_a_file_are_warned_of(tmp_path):
    lines = (ROOT / "examples" / "footbridge.msh").read_text().split("$Elements\n")
    count, first, rest = lines[1].split("\n", 2)
    (tmp_path / "bridge.msh").write_text(
        f"{lines[0]}$Elements\n{int(count) + 1}\n{first}\n9999 {first.split(' ', 1)[1]}\n{rest}"
    )
    (tmp_path / "bridge.toml").write_text((ROOT / "examples" / "footbridge.toml").read_text())
    assert "the same law: 1-2 twice; what" in run([*COMMAND, "solve", tmp_path / "bridge.msh", "--quiet"]).stderr


def test_absurd_displacements_are_warned_of():
    with pytest.warns(
        latinpc.LatinWarning, match=r"node 3 moves by 100 m, farther than the structure is large \(2.83 m\)"
    ):
        found = net(load=[[0, 0], [0, 0], [0, 0], [0, -1e6]]).solve()
    assert found.converged and found.notices


def test_reactions_that_do_not_balance_are_warned_of():
    scene = make("tensegrity-grid", modules=12)
    with pytest.warns(latinpc.LatinWarning, match="reactions do not balance the loads, by 1.* % of them"):
        found = scene.solve(comm=PETSc.COMM_SELF, preset="fast")
    assert found.balance.moment > 1e-2
    assert not scene.solve(comm=PETSc.COMM_SELF).notices


# ---- the arrays of a structure ---------------------------------------------------------------
def test_arrays_are_read_and_not_written():
    nodes = np.array(NET["nodes"], float)
    structure = net(nodes=nodes)
    nodes[3] = 99
    assert structure.nodes[3].tolist() == [0, 0]
    assert structure.law.tolist() == [Law.CABLE] * 3 and structure.stiffness.tolist() == [1e4] * 3
    assert structure.fixed.sum() == 6 and structure.area is None and structure.name == "net"
    assert structure.lengths == pytest.approx([2**0.5, 2**0.5, 1])
    for name in ("nodes", "links", "law", "stiffness", "load"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(structure, name)[0] = 0


def test_what_changes_is_read_and_what_is_solved_stays():
    structure = net(law="bar")
    before = structure.solve()
    kept = before.reactions.copy(), str(before)
    load = np.array(NET["load"]) * 2.0
    structure.set_load(load)
    load[:] = 0
    assert structure.load[3].tolist() == [0, -20]
    assert structure.solve().reactions == pytest.approx(2 * kept[0], abs=1e-9)
    again = replace(before)  # nothing computed yet
    assert np.array_equal(again.reactions, kept[0]) and str(again) == kept[1]
    structure.set_prestress([1.0, 1.0, 2.0])
    assert structure.initial_elongation == pytest.approx([1e-4, 1e-4, 2e-4])
    structure.set_initial_elongation(0.0)
    assert not structure.initial_elongation.any()
    structure.set_mass(2.0)
    assert structure.mass.tolist() == [2.0] * 4


def test_laws_by_name_everywhere():
    names = np.array(["cable", "bar", "Compression-Only"], dtype=object)  # a column of a table
    assert net(law=names).law.tolist() == [1, 0, 2]
    table = latinpc.register_table([-1, 0, 1], [-1, 0, 1])
    assert net(law=["cable", "cable", table]).law.tolist() == [1, 1, table]
    plain = {key: value for key, value in NET.items() if key != "law"}
    assert Scene(**plain, law="cable").law.tolist() == [1, 1, 1]
    known = ", ".join(law.name.lower() for law in Law)
    for make_it in (lambda law: net(law=law), lambda law: Scene(**plain, law=law)):
        with pytest.raises(ValueError, match=f"unknown law 'cabel': do you mean 'cable'. choose from {known}"):
            make_it(["cable", "cabel", "bar"])


def test_scenes_and_structures_solve_the_same():
    scene = network(nodes=100)
    one, two = scene.solve(comm=PETSc.COMM_SELF), latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF).solve()
    assert np.array_equal(one.displacements, two.displacements)
    assert one.structure.name == "network" and one.structure.nodes is not scene.nodes
    assert np.shares_memory(one.structure.nodes, scene.nodes)


def test_the_public_interface_is_typed():
    missing = []
    for name in latinpc.__all__:
        thing = getattr(latinpc, name)
        if inspect.isclass(thing):
            bases = [base for base in thing.__mro__ if base.__module__.startswith("latinpc")]
            members = [member for base in bases for key, member in vars(base).items() if not key.startswith("_")]
        else:
            members = [thing]
        for function in filter(inspect.isfunction, members):
            signature = inspect.signature(function)
            hints = [p.annotation for p in signature.parameters.values() if p.name not in ("self", "cls")]
            if inspect.Signature.empty in (*hints, signature.return_annotation):
                missing.append(f"{name}.{function.__name__}")
    assert not missing
    assert Path(latinpc.__file__).with_name("py.typed").exists()


# ---- ranks -----------------------------------------------------------------------------------
RANKS = """
import json, sys, warnings
import numpy as np
from petsc4py import PETSc
import latinpc

rank = PETSc.COMM_WORLD.rank
said = []
warnings.showwarning = lambda message, category, *_: said.append(f"{category.__name__}: {message}")
scene = latinpc.scenes.make("network", nodes=150)
result = scene.solve(error=1e-8, options={"snes_latin_subdomains": 4})
for attempt in (lambda: scene.solve(options={"snes_latin_stopp": 1}), lambda: scene.solve(preset="quick"),
                lambda: scene.solve(options={"snes_max_it": 1, "snes_latin_newton": "never"}, raise_on_failure=True)):
    try:
        attempt()
    except (ValueError, latinpc.SolveError) as error:
        said.append(str(error))
scene.solve(options={"snes_max_itt": 1})
warnings.simplefilter("error")
try:
    scene.solve(options={"snes_max_itt": 1})
except latinpc.LatinWarning as error:
    said.append(f"raised: {error}")
found = PETSc.COMM_WORLD.tompi4py().gather((said, result.reactions.tolist(), result.members.tolist(), result.to_dict()))
if rank == 0:
    print(json.dumps(found))
"""


@pytest.mark.parametrize("ranks", [1, 2])
def test_ranks(ranks, mpirun):
    """Every rank has the whole result and raises what the others raise; the first one alone prints."""
    found = json.loads(mpirun(ranks, RANKS).stdout)
    assert len(found) == ranks
    alone = make("network", nodes=150).solve(comm=PETSc.COMM_SELF, error=1e-8)
    for number, (said, forces, members, report) in enumerate(found):
        assert np.array(forces) == pytest.approx(alone.reactions, rel=1e-5, abs=1e-5 * np.abs(alone.reactions).max())
        assert forces == found[0][1] and members == found[0][2]
        assert report["reactions"]["force_without_balance"] < 1e-7 and report["ranks"] == ranks
        unread = "no solver has read -snes_max_itt: misspelt, or of no use to this solver"
        assert said == [
            "unknown option -snes_latin_stopp: do you mean -snes_latin_stop?",
            *[line for line in said if line.startswith("unknown preset 'quick'")],
            "not converged: the iterations that -snes_max_it allows were not enough (DIVERGED_MAX_IT)",
            *([f"LatinWarning: {unread}"] if number == 0 else []),
            f"raised: {unread}",
        ]


@pytest.mark.filterwarnings("ignore:links turn", "ignore:not converged")
@pytest.mark.parametrize("change", ["geometry", "prescribed displacement", "initial elongation"])
def test_a_result_is_of_the_structure_that_was_solved(change, tmp_path):
    """What it computes when asked for it is what it would have been at once, or is refused."""

    def solved():
        structure = latinpc.Structure(
            [[0, 0], [2, 0], [1, 1.0], [1, 2]], [[0, 2], [1, 2], [2, 3], [0, 3], [1, 3]], [0, 0, 1, 1, 0], 1.0,
            fixed=[[1, 1], [1, 1], [0, 0], [0, 0]], load=[[0, 0], [0, 0], [0.1, -0.1], [0.05, 0]], mass=1.0,
        )  # fmt: skip
        return structure, structure.solve(options={"snes_max_it": 1})

    def asked(result, name):
        result.to_vtu(tmp_path / name)
        return str(result.members), result.reactions, (tmp_path / name).read_bytes()

    (_, at_once), (structure, late) = solved(), solved()
    if change == "geometry":
        structure.set_geometry("large")
    elif change == "prescribed displacement":
        structure.set_prescribed(np.where(structure.fixed, 0.3, 0.0))
    else:
        structure.set_initial_elongation(0.2)
    (table, forces, file), (late_table, late_forces, late_file) = asked(at_once, "a.vtu"), asked(late, "b.vtu")
    assert table == late_table and file == late_file and np.array_equal(forces, late_forces)
    if change == "geometry":  # the result has its own
        assert late.modes().values == pytest.approx(at_once.modes().values)
        assert late.tangent().norm() == pytest.approx(at_once.tangent().norm())
        assert structure.geometry == "large"
    for ask in (late.modes, late.tangent, lambda: latinpc.modes(late)) if change != "geometry" else ():
        with pytest.raises(ValueError, match=f"^{change} of the structure changed after this result"):
            ask()
    first = at_once.modes(1).values
    at_once.structure.set_load(2.0 * structure.load)
    at_once.structure.set_mass(2.0)
    assert at_once.modes(1).values == pytest.approx(first / 2.0)
