"""Messages, summaries, tables and pictures call nodes and links what the file calls them that they were read from."""

import csv
import re
from dataclasses import replace

import matplotlib.text
import numpy as np
import pytest
from test_cli import latinpc as command
from test_files import MSH, TOML
from two_bars import KINDS, written

import latinpc
from latinpc.files.gmshnodes import node_tags
from latinpc.files.npz import load_scene, save_scene
from latinpc.runs.solve import solve

#: What each kind of file calls the nodes and links of the two bars
NAMES = {
    "csv": (["left", "right", "middle"], ["1", "2"]),
    "obj": (["1", "2", "3"], ["1-3", "3-2"]),
    "tcl": (["1", "2", "3"], ["1", "2"]),
    "json": (["0", "1", "7"], ["0-7", "7-1"]),
    "dxf in mm": (["(0, 3)", "(4, 0)", "(8, 3)"], ["(0, 3)-(4, 0)", "(8, 3)-(4, 0)"]),
}
NODES = "node,x,y,fix,Fx,Fy\nA,0,0,xy,,\nB,4,0,xy,,\nC,2,1,,0,{}\nD,2,3,{},,\n"
MEMBERS = "member,start,end,law,EA\ntie,A,C,cable,1e6\nstay,B,C,cable,1e6\n"


def tables(folder, load, fix="xy", more=""):
    """A node on two cables; another node, that more members may join."""
    (folder / "nodes.csv").write_text(NODES.format(load, fix))
    (folder / "members.csv").write_text(MEMBERS + "mast,A,D,bar,1e6\n" + more)
    return folder


@pytest.mark.parametrize("kind", NAMES)
def test_names_are_those_of_the_file(kind, tmp_path):
    path, options = written(tmp_path, kind)
    scene = latinpc.read(path, **options)
    nodes, links = NAMES[kind]
    assert sorted(map(scene.node_name, range(3))) == sorted(nodes)
    assert sorted(map(scene.link_name, range(2))) == sorted(links)
    assert latinpc.Structure.from_scene(scene).node_name(2) == scene.node_name(2)
    assert scene.name == "bars"


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_file_has_names(kind, tmp_path):
    path, options = written(tmp_path, kind)
    scene = latinpc.read(path, **options)
    nodes, links = list(map(scene.node_name, range(3))), list(map(scene.link_name, range(2)))
    assert len(set(nodes)) == 3 and len(set(links)) == 2 and all(nodes) and all(links)
    said = repr(solve(scene))
    largest = int(np.abs(scene.solve().tensions).argmax())
    name = scene.link_name(largest)
    assert (f"link {name}, from node" if scene.links_named else f"link {name}: ") in said
    save_scene(tmp_path / "a.npz", scene)
    again = load_scene(tmp_path / "a.npz")
    assert [again.node_name(2), again.link_name(1)] == [nodes[2], links[1]]


def test_places_far_from_zero_tell_nodes_apart(tmp_path):
    """At the coordinates of a map."""
    (tmp_path / "nodes.csv").write_text("node,x,y,fix,Fx\nA,500000.25,5400000.5,xy,\nB,500000.75,5400000,y,-1\n")
    (tmp_path / "members.csv").write_text("start,end,EA\nA,B,1e3\n")
    said = command("solve", tmp_path).stdout
    assert "at node B (500000.75, 5,400,000) m" in said and "at node A (500000.25, 5400000.5) m" in said


def test_layers_and_merged_points_keep_the_names_of_the_first(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 2 0 0\nv 2 0 0\nv 4 0 0\nl 1 2\nl 3 4\n")
    scene = latinpc.read(tmp_path / "a.obj", brace=1.0, EA=1e6, support="x=min")
    assert [scene.node_name(node) for node in range(6)] == ["1", "2", "4", "1 upper", "2 upper", "4 upper"]
    assert scene.link_name(1) == "2-4" and scene.link_name(3) == "2 upper-4 upper"


def test_no_equilibrium_names_nodes_of_the_file(tmp_path):
    scene = latinpc.read(tables(tmp_path, -1e3))
    with pytest.warns(latinpc.ConvergenceWarning):
        result = scene.solve()
    assert "no equilibrium: slack links no longer hold node C" in result.notices
    texts = [text.get_text() for text in result.plot().findobj(matplotlib.text.Text)]
    assert {"A", "C", "tie", "stay"} <= set(texts)


def test_a_mechanism_names_nodes_of_the_file(tmp_path):
    tables(tmp_path, 1e3, fix="")
    scene = latinpc.read(tmp_path)
    for run in (scene.solve, lambda: solve(scene), lambda: latinpc.solve_cases(scene, [latinpc.Case("a")])):
        with pytest.raises(latinpc.SolveError, match=r"Nodes that move: (C, )?D\. "):
            run()
    picture = tmp_path / "m.png"
    said = command("solve", tmp_path, "--picture", picture, code=2).stderr
    assert re.search(r"Nodes that move: (C, )?D\. ", said) and picture.stat().st_size > 10000
    figure = scene.plot(mechanism=True)
    assert any("nodes that move: D" in text.get_text() for text in figure.findobj(matplotlib.text.Text))


def test_messages_name_nodes_by_their_gmsh_tags(tmp_path):
    (tmp_path / "frame.msh").write_text(MSH)
    moved = TOML.replace("[supports.feet]", "[supports.top]").replace("[loads.top]", "[loads.feet]")
    (tmp_path / "frame.toml").write_text(moved)
    assert "Nodes that move: 10, 20." in command("solve", tmp_path / "frame.msh", code=2).stderr


def test_links_that_are_there_twice_and_far_moves(tmp_path):
    again = "again,A,C,cable,1e6\n"
    scene = latinpc.read(tables(tmp_path, 1e7, more=again))
    with pytest.warns(latinpc.LatinWarning):
        notices = " ".join(scene.solve().notices)
    assert "links join the same two nodes by the same law: tie and again" in notices
    assert "node C moves by" in notices


def test_nodes_at_one_place_that_no_link_joins(tmp_path):
    """They make a mechanism, or hang apart with large displacements; not where they touch."""
    (tmp_path / "nodes.csv").write_text("node,x,y,fix,Fy\nA,-1,0,xy,\nB,1,0,xy,\nC,0,-1,,-10\nD,0,-1,,\nE,-1,0,xy,\n")
    (tmp_path / "members.csv").write_text("start,end,law,EA\nA,C,bar,1e5\nB,D,bar,1e5\nE,C,bar,1e5\n")
    said = "nodes lie at one place and no link joins them: C and D; make them one node if they move together"
    with pytest.raises(latinpc.SolveError, match=f"mechanism.*{said}"):
        latinpc.read(tmp_path).solve()
    with pytest.warns(latinpc.LatinWarning, match=said):
        latinpc.read(tmp_path, geometry="large").solve()
    assert latinpc.read(tmp_path, merge=1e-3).solve().converged
    touching = {"law": ["bar", "bar", "contact"], "stiffness": [1e5, 1e5, 0.0], "direction": [[0, 0], [0, 0], [0, 1]]}
    both = latinpc.Structure(
        [[-1, 0], [1, 0], [0, -1], [0, -1]],
        [[0, 2], [1, 3], [2, 3]],
        **touching,
        fixed=[[1, 1], [1, 1], [1, 0], [1, 0]],
    )
    assert not both.notices


def test_tables_have_both(tmp_path):
    scene = latinpc.read(tables(tmp_path, 1e3))
    result = scene.solve()
    assert result.members["name"].tolist() == ["tie", "stay", "mast"]
    assert result.members["end_name"].tolist() == ["C", "C", "D"]
    assert result.nodes["name"].tolist() == ["A", "B", "C", "D"]
    result.to_csv(tmp_path / "m.csv", tmp_path / "n.csv")
    assert [row["name"] for row in csv.DictReader((tmp_path / "n.csv").open())] == ["A", "B", "C", "D"]
    plain = latinpc.Structure(scene.nodes, scene.links, scene.law, scene.stiffness, fixed=scene.fixed, load=scene.load)
    assert "name" not in plain.solve().members.dtype.names
    found = latinpc.solve_cases(scene, [latinpc.Case("a"), latinpc.Case("b", load=scene.load)])
    assert "at node " in repr(found) and re.search("highest .* link (tie|stay), ", repr(found))
    found.to_csv(tmp_path / "e.csv", tmp_path / "r.csv")
    rows = list(csv.DictReader((tmp_path / "r.csv").open()))
    assert [(row["name"], row["axis"]) for row in rows[:2]] == [("A", "x"), ("A", "y")]


def test_the_folder_here_is_a_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tables(tmp_path, 1e3))
    assert latinpc.read(".").name == latinpc.read(tmp_path).name == tmp_path.name


def test_a_structure_of_ones_own_counts_from_0():
    scene = latinpc.scenes.make("net", side=2)
    assert scene.node_name(3) == "3" and scene.link_name(4) == "4" and scene.numbering is None
    assert scene.counted_as_given("Nodes that move (counted from 0): 3") == "Nodes that move (counted from 0): 3"


def test_errors_of_the_library_are_translated(tmp_path):
    scene = latinpc.read(tables(tmp_path, 1e3))
    for said, expected in (
        ("Nodes that move (counted from 0): 2, 3 and others. Add", "Nodes that move: C, D and others. Add"),
        ("Link 1 (contact) has", "Link stay (contact) has"),
        ("nodes 0 and 3 fall together", "nodes A and D fall together"),
        ("nodes 2, 3 and 5 more are not", "nodes C, D and 5 more are not"),
        ("3 subdomains share node 1: the", "3 subdomains share node B: the"),
        ("links 1 ([3. 4.]), 2 ([3. 4.]) have", "links stay ([3. 4.]), mast ([3. 4.]) have"),
        ("links 0 (-500.), 1 (-5e2) and 2 more have", "links tie (-500.), stay (-5e2) and 2 more have"),
    ):
        assert scene.counted_as_given(said) == expected


def test_links_that_large_displacements_refuse_are_named(tmp_path):
    path = tables(tmp_path, 1e3)
    scene = replace(latinpc.read(path), initial_elongation=[0.0, 99.0, 0.0], geometry="large")
    for attempt in (scene.solve, lambda: latinpc.solve_cases(scene, [latinpc.Case("a")])):
        with pytest.raises(latinpc.SolveError, match="^Link stay, of length .*, has the initial elongation 99"):
            attempt()


def msh_nodes(version, binary):
    """Return the start of a Gmsh file, with nodes 3, 7 and 12; one of them lies on a curve, with its parameter."""
    head = f"$MeshFormat\n{version} {int(binary)} 8\n".encode()
    xyz = np.arange(9.0).reshape(3, 3)
    if version == "2.2":
        rows = np.array([(3, xyz[0]), (7, xyz[1]), (12, xyz[2])], [("tag", "i4"), ("x", "f8", 3)])
        body = b"3\n" + (rows.tobytes() if binary else b"3 0 1 2\n7 3 4 5\n12 6 7 8")
    elif not binary:
        first, second = ("3\n7\n0 1 2\n3 4 5\n", "12\n6 7 8 0.5") if version == "4.1" else (
            "3 0 1 2\n7 3 4 5\n", "12 6 7 8 0.5")  # fmt: skip
        sizes, curve = ("2 3 3 12", "1 4") if version == "4.1" else ("2 3", "4 1")
        body = f"{sizes}\n0 0 0 2\n{first}{curve} 1 1\n{second}".encode()
    else:
        at_point, on_curve = np.array([0, 0, 0], "i4"), np.array([1, 4, 1] if version == "4.1" else [4, 1, 1], "i4")
        sizes = np.array([2, 3, 3, 12] if version == "4.1" else [2, 3], "u8")
        if version == "4.1":
            first = np.array([3, 7], "u8").tobytes() + xyz[:2].tobytes()
            second = np.array([12], "u8").tobytes() + np.append(xyz[2], 0.5).tobytes()
        else:
            first = np.array([(3, xyz[0]), (7, xyz[1])], [("tag", "i4"), ("x", "f8", 3)]).tobytes()
            second = np.array([(12, np.append(xyz[2], 0.5))], [("tag", "i4"), ("x", "f8", 4)]).tobytes()
        two, one = np.array([2], "u8").tobytes(), np.array([1], "u8").tobytes()
        body = sizes.tobytes() + at_point.tobytes() + two + first + on_curve.tobytes() + one + second
    one = np.array([1], "i4").tobytes() + b"\n" if binary else b""
    return head + one + b"$EndMeshFormat\n$Nodes\n" + body + b"\n$EndNodes\n"


@pytest.mark.parametrize("binary", [False, True])
@pytest.mark.parametrize("version", ["2.2", "4", "4.1"])
def test_tags_of_gmsh_nodes(version, binary, tmp_path):
    file = tmp_path / "nodes.msh"
    file.write_bytes(msh_nodes(version, binary))
    assert node_tags(file, 3).tolist() == [3, 7, 12]
    assert node_tags(file, 4) is None
    file.write_bytes(msh_nodes(version, binary)[:-45])
    assert node_tags(file, 3) is None


def test_nodes_of_gmsh_go_by_their_tags(tmp_path):
    """Gmsh leaves out nodes of what it does not save, and keeps the tags of the others."""
    elements = "$Elements\n2\n5 1 2 1 1 3 7\n6 1 2 1 1 7 12\n$EndElements\n"
    (tmp_path / "bars.msh").write_text(msh_nodes("2.2", False).decode() + elements)
    (tmp_path / "bars.toml").write_text('[laws.1]\nlaw = "bar"\nEA = 1e6\n')
    scene = latinpc.read(tmp_path / "bars.msh", support=["x=min"])
    assert [scene.node_name(node) for node in range(3)] == ["3", "7", "12"]
    assert [scene.link_name(link) for link in range(2)] == ["3-7", "7-12"]


def test_load_cases_have_names_of_their_own(tmp_path):
    """Tables could not tell them apart."""
    scene = latinpc.read(tables(tmp_path, 1e3))
    with pytest.raises(ValueError, match=r"load cases have the same name, a, c: tell them apart with Case.named\(\)"):
        latinpc.solve_cases(scene, [latinpc.Case(name) for name in "cabac"])
