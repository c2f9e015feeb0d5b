"""What wrong files and options are told: the file, its line, and the right form."""

import random
import shutil

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_fuzz import mutated
from two_bars import EA, KINDS, OBJ, written

import latinpc
from latinpc.scenes.scene import Law, Scene

BAD = [
    ("csv", "middle,4,0,,-1000", "middle,4,zero,,-1000", ["nodes.csv, line 4", "y is 'zero'", "a finite number"]),
    ("csv", "middle,4,0,,-1000", "middle,4,0,,\u22121000", ["'\u22121000' (with U+2212, minus sign); expected a"]),
    ("csv", "middle,4,0,,-1000", "middle,4,0,-1000", ["nodes.csv, line 4", "4 cells", "5, as in the head on line 1"]),
    ("csv", "middle,4,0,,-1000", "left,4,0,,-1000", ["nodes.csv, line 4", "'left' is there already, on line 2"]),
    ("csv", "node,x,y,fix,Fy", "node,x,y,fixed,Fy", ["nodes.csv, line 1", "unknown column 'fixed'", "'fix'"]),
    ("csv", "node,x,y,fix,Fy", "node,x,y,fix,y", ["nodes.csv, line 1", "column 'y' is there twice"]),
    ("csv", "node,x,y,fix,Fy", "node,x [inch],y,fix,Fy", ["line 1", "in 'inch'", "m, cm, mm"]),
    ("csv", "node,x,y,fix,Fy", "#remark,x,y,fix,Fy", ["nodes.csv, line 1", "head begins with '#remark'", "a comment"]),
    ("csv", "left,0,3,xy,", "left,0,3,both,", ["nodes.csv, line 2", "fix is 'both'", "xyz"]),
    ("csv", "left,middle,4.2e7", "left,midle,4.2e7", ["members.csv, line 2", "'midle'", "do you mean 'middle'"]),
    ("csv", "left,middle,4.2e7", "left,left,4.2e7", ["members.csv, line 2", "joins node 'left' to itself"]),
    ("csv", "left,middle,4.2e7", "left,middle,-3", ["members.csv, line 2", "EA must be positive"]),
    ("csv", "start,end,EA", "from,end,EA", ["members.csv, line 1", "unknown column 'from'"]),
    ("csv", "start,end,EA,group", "end,EA,group", ["members.csv, line 1", "no column 'start'"]),
    ("obj", "v 8 3 0", "v 8 drei 0", ["bars.obj, line 3", "'v 8 drei 0'", "v x y z"]),
    ("obj", "l 1 3 -2", "l 1 9", ["bars.obj, line 6", "vertex 9", "the file has 3"]),
    ("obj", "l 1 3 -2", "l 1 0", ["bars.obj, line 6", "vertex 0", "l i j"]),
    ("obj", "l 1 3 -2", "deg 3\ncurv 0 1 1 2 3", ["line 7", "a curve of degree 3", "of degree 1"]),
    ("obj", "l 1 3 -2", "line 1 2", ["bars.obj, line 6", "'line' is no line, face or vertex"]),
    ("obj", "l 1 3 -2", "", ["bars.obj", "holds no line"]),
    ("json", '"edge"', '"edges"', ["bars.json", "holds no edge or line"]),
    ("json", '{"7": {}}', '{"9": {}}', ["bars.json", "edge 0, 9 names '9'", "a key of a node"]),
    ("json", '"x": 8.0', '"x": "8"', ["bars.json", "node 1", "no point", "three finite coordinates"]),
    ("json", '"edge": ', '"edge": ,', ["bars.json, line 1", "not JSON"]),
    ("tcl", "node 3 $a", "node 3 $b", ["bars.tcl, line 7", "'$b' has no value so far"]),
    ("tcl", "fix 2 1 1", "fix 4 1 1", ["bars.tcl, line 10", "no node 4 so far", "fix tag"]),
    ("tcl", "fix 2 1 1", "fix 2 1 2", ["bars.tcl, line 10", "1 or 0"]),
    ("tcl", "element truss 1 1 3 $A 1", "element elasticBeamColumn 1 1 3 $A 1", ["line 12", "element truss"]),
    ("tcl", "element truss 1 1 3 $A 1", "element truss 1 1 3 $A 7", ["line 12", "no material 7 so far"]),
    ("tcl", "element truss 1 1 3 $A 1", "element truss 2 1 3 $A 1", ["line 13", "2 is there already, on line 12"]),
    ("tcl", "Elastic 1 2.1e11", "Steel01 1 2.1e11 2e8 0.1", ["line 11", "uniaxialMaterial Elastic tag E"]),
    ("tcl", "Elastic 1 2.1e11", "Elastic 1 2.1e11 0 1e11", ["line 11", "Eneg = 1e+11", "neither E nor 0"]),
    ("tcl", "load 3 0.0 -1000.0", "load 3 0.0 many", ["bars.tcl, line 15", "'many'", "no number"]),
    ("tcl", "fix 2 1 1", "for {set i 0} {$i < 3} {incr i} {\n fix $i 1 1\n}", ["line 10", "'for' is not run"]),
    ("tcl", "fix 2 1 1", "equalDOF 1 2 1", ["line 10", "'equalDOF' is not known", "trusses only"]),
    ("tcl", "pattern Plain 1 Linear {", "pattern Plain 1 Linear", ["line 16", "'}' is not known"]),
    ("tcl", "}\nanalyze", "\nanalyze", ["bars.tcl, line 14", "not closed"]),
    ("py", "ops.fix(2, 1, 1)", "ops.fix(2, 1)", ["bars.py, line 12", "fix tag"]),
    ("py", "ops.fix(2, 1, 1)", "ops.fix(2, 1, one)", ["bars.py, line 12", "'one' is no number, known name"]),
    ("py", "ops.fix(2, 1, 1)", "ops.fix(2, 1, 1", ["bars.py, line 12", "not Python"]),
    ("py", "ops.fix(2, 1, 1)", "for i in (1, 2):\n    ops.fix(i, 1, 1)", ["line 13", "'for' is not run", "'fix'"]),
    ("py", "h = math.sqrt(9.0)", "h = 9 ** 9 ** 9", ["bars.py, line 7", "'h' is no number, known name"]),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "old", "new", "words"), BAD, ids=[f"{case[0]}: {case[2][:40]}" for case in BAD])
def test_a_wrong_file_is_named_with_its_line_and_the_right_format(kind, old, new, words, tmp_path):
    path, options = written(tmp_path, kind)
    files = [path] if kind != "csv" else [path, tmp_path / "bars-members.csv"]
    changed = next(file for file in files if old in file.read_text())
    changed.write_text(changed.read_text().replace(old, new, 1))
    with pytest.raises(ValueError) as caught:
        latinpc.read(path, **options)
    for word in words:
        assert word in str(caught.value)


def test_a_wrong_entity_of_a_drawing_is_named_with_its_line(tmp_path):
    path, options = written(tmp_path, "dxf")
    text = path.read_text()
    lines = text.split("\n")
    at = next(row for row, line in enumerate(lines) if line == "LINE")
    x = next(row for row in range(at, len(lines)) if lines[row].strip() == "10")
    lines[x + 1] = "nan"
    path.write_text("\n".join(lines))
    with pytest.raises(ValueError, match=rf"bars\.dxf, line {at + 1}: LINE at \[nan.*finite coordinates"):
        latinpc.read(path, **options)
    path.write_text(text[: len(text) // 2])
    with pytest.raises(ValueError, match=r"bars\.dxf: not readable as DXF .*; expected a DXF drawing"):
        latinpc.read(path, **options)


@pytest.mark.parametrize("mark", [";", "\t"])
def test_decimal_points_beside_decimal_commas_are_refused(mark, tmp_path):
    written(tmp_path, "csv")
    nodes, members = tmp_path / "bars-nodes.csv", tmp_path / "bars-members.csv"
    nodes.write_text("node;x;y;fix;Fy\nleft;0;3;xy;\nmiddle;4;0;;-1.000\nright;8;3;xy;\n".replace(";", mark))
    assert latinpc.read(nodes).load.min() == -1.0
    text = nodes.read_text()
    nodes.write_text(text.replace("4", "4,0"))
    with pytest.raises(
        ValueError, match=r"bars-nodes\.csv, line 3: Fy is '-1\.000', but x is '4,0' in bars-nodes\.csv"
    ):
        latinpc.read(nodes)
    nodes.write_text(text.replace("-1.000", "-1,000"))
    members.write_text("start;end;EA\nleft;middle;42\nmiddle;right;42.000\n".replace(";", mark))
    with pytest.raises(ValueError, match=r"bars-members\.csv, line 3: EA is '42\.000', but Fy is '-1,000' in .*line 3"):
        latinpc.read(nodes)


@pytest.mark.parametrize("kind", ["nodes", "members"])
def test_empty_columns_are_left_out(kind, tmp_path):
    """Spreadsheets write them beside a table that was once wider."""
    path, options = written(tmp_path, "csv")
    table = tmp_path / f"bars-{kind}.csv"
    expected, lines = latinpc.read(path, **options), table.read_text().splitlines()
    table.write_text("".join(f",{line},,\n" for line in lines))
    found = latinpc.read(path, **options)
    for name in ("nodes", "links", "fixed", "load", "stiffness"):
        assert np.array_equal(getattr(found, name), getattr(expected, name))
    table.write_text("".join(f"{line},{index or ''}\n" for index, line in enumerate(lines)))
    with pytest.raises(ValueError, match=rf"bars-{kind}\.csv, line 1: column {lines[0].count(',') + 2} has no name"):
        latinpc.read(path, **options)
    table.write_text("".join(f"{line}{',' * (index > 0)}\n" for index, line in enumerate(lines)))
    with pytest.raises(ValueError, match=rf"bars-{kind}\.csv, line 2: \d+ cells; expected"):  # a decimal comma
        latinpc.read(path, **options)


OPTIONS = [
    ({"support": "feet"}, ["--support feet", "chooses no nodes", "its groups are points, ropes"]),
    ({"support": "x<5:z"}, ["--support x<5:z", "fix must be a list out of ['x', 'y']"]),
    ({"support": "z=min"}, ["--support z=min", "there is no z", "x, y"]),
    ({"support": "point"}, ["'point' chooses no nodes (do you mean 'points'?); write"]),
    ({"support": "x>100"}, ["--support x>100: holds no node of a link; x goes from 0 to 8 m, y goes from 0 to 3 m"]),
    ({"support": ()}, ["bars.obj", "nothing is held", "--support", "bars.toml"]),
    ({"load": "down=3"}, ["--load down=3", "write z=-1000"]),
    ({"load": ["y=3", "y=3"]}, ["--load y=3: given twice"]),
    ({"load": [0, 0, -1]}, ["load must be a text such as 'z=-1000:deck'", "not [0, 0, -1]"]),
    ({"support": 3}, ["support must be a text such as 'z=min', or a list of such, not 3"]),
    ({"scale": "mm"}, ["scale must be a finite number, not 'mm'"]),
    ({"self_weight": {"X": 1}}, ["--self-weight X=1: no line or group of lines is 'X'"]),
    ({"load": "z=3"}, ["--load z=3", "there is no z", "write dim = 3 in bars.toml"]),
    ({"EA": {"wires": 1.0}}, ["no line or group of lines is 'wires'"]),
    ({"EA": {"ropes": -1.0}}, ["'ropes'", "EA must be positive"]),
    ({"law": {None: "cables"}}, ["unknown law 'cables'"]),
    ({"law": "friction"}, ["the law friction takes no EA"]),
    ({"self_weight": True}, ["--self-weight must be a finite number, not True"]),
    ({"EA": True}, ["EA must be a finite number, not True"]),
    ({"scale": 0.0}, ["--scale 0", "must be positive"]),
    ({"merge": 1.0}, ["--merge 1: it must be between 0 and 0.4 m"]),
    ({"brace": -1.0}, ["--brace -1", "must be positive"]),
    ({"description": "other.toml"}, ["other.toml: no such file"]),
]


@pytest.mark.parametrize(("more", "words"), OPTIONS, ids=[str(more) for more, _ in OPTIONS])
def test_wrong_options_are_named(more, words, tmp_path):
    path, options = written(tmp_path, "obj")
    with pytest.raises((ValueError, FileNotFoundError)) as caught:
        latinpc.read(path, **(options | {"EA": EA} | more))
    for word in words:
        assert word in str(caught.value)


TWO_GROUPS = "v 0 0 0\nv 1 0 0\nv 1 1 0\ng a\nl 1 2\ng b\nl 2 3\nl 1 3\n"


def test_values_for_all_groups_beside_those_of_each_group(tmp_path):
    path = tmp_path / "two.obj"
    path.write_text(TWO_GROUPS)
    given = {"law": "cable", "support": "x=min"}
    scene = latinpc.read(path, EA=5e6, prestress={"a": 2e4, "b": 1e4}, **given)
    assert scene.stiffness * scene.initial_elongation == pytest.approx([2e4, 1e4, 1e4])
    assert (latinpc.read(path, EA={"a": 1.0, "b": 2.0}, **given).law == Law.CABLE).all()
    weight = latinpc.read(path, EA=5e6, self_weight={None: 100.0, "b": 10.0}, support="x=min").line_load
    assert weight[:, 1] == pytest.approx([-100.0, -10.0, -10.0])
    with pytest.raises(ValueError, match=r"--EA: no line is left that needs it: two\.obj, or options of other groups"):
        latinpc.read(path, EA={"a": 1.0, "b": 2.0, None: 3.0}, **given)


def test_a_group_whose_lines_all_repeat_others_takes_no_law(tmp_path):
    path = tmp_path / "two.obj"
    path.write_text(TWO_GROUPS + "g c\nl 2 1\n")
    given = {"EA": {"a": 1.0, "b": 1.0}, "support": "x=min"}
    path.with_suffix(".toml").write_text('[laws.c]\nlaw = "contact"\nnormal = [1.0, 0.0]\n')
    with pytest.raises(ValueError, match=r"\[laws\.c\]: no line is left of the group, each repeats one of another"):
        latinpc.read(path, **given)
    path.with_suffix(".toml").unlink()
    with pytest.raises(ValueError, match="of 'c': no line is left of the group"):
        latinpc.read(path, **given, law={"c": "cable"})


def test_what_acts_on_a_node_without_links_is_refused(tmp_path):
    path, _ = written(tmp_path, "csv")
    text = path.read_text()
    for cells, what in (("xy,5", "load"), (",-5", "load")):
        path.write_text(f"{text}pole,9,9,{cells}\n")
        with pytest.raises(
            ValueError, match=rf"bars-nodes\.csv: no link touches node pole, one of 1 such with a {what}"
        ):
            latinpc.read(path)
    path.write_text(f"{text}pole,9,9,xy,\nmast,9,9,,\n")
    notes = ["2 nodes that no link touches left out, 1 of them held, such as pole"]
    assert latinpc.read(path).metadata["notes"] == notes
    path.write_text(text.replace("fix,Fy", "fix,mass").replace("-1000", "1") + "pole,9,9,,3\n")
    with pytest.raises(ValueError, match="node pole, one of 1 such with a mass"):
        latinpc.read(path)


def test_a_dimension_that_drops_loads_is_refused(tmp_path):
    path, _ = written(tmp_path, "csv")
    path.write_text(path.read_text().replace("Fy", "Fz"))
    (tmp_path / "bars.toml").write_text("dim = 2\n")
    with pytest.raises(ValueError, match=r"dim = 2, but a node has a load or a .* along z in bars-nodes\.csv"):
        latinpc.read(path)


def test_blanks_around_the_place_of_supports_and_loads(tmp_path):
    path, options = written(tmp_path, "obj")
    scene = latinpc.read(path, **options | {"support": " x=min : y ", "load": "y=-1 : x=max "})
    assert scene.fixed.sum(axis=0).tolist() == [0, 1] and np.count_nonzero(scene.load) == 1


def test_toml_files_move_supports_of_tables(tmp_path):
    """Which hold them at no displacement, or at one of their own."""
    path, _ = written(tmp_path, "csv")
    toml = tmp_path / "bars.toml"
    toml.write_text('[supports.left]\nwhere = "x=min"\ndisplacement = [0.0, -0.01]\n')
    assert latinpc.read(path).prescribed.tolist() == [[0.0, -0.01], [0.0, 0.0], [0.0, 0.0]]
    toml.write_text(toml.read_text() + '[supports.again]\nwhere = "x=min"\ndisplacement = [0.0, -0.02]\n')
    with pytest.raises(ValueError, match=r"\[supports.again\]: a node has another displacement along y already"):
        latinpc.read(path)
    toml.write_text(toml.read_text().partition("[supports.again]")[0])
    path.write_text("node,x,y,fix,uy\nleft,0,3,xy,1\nright,8,3,xy,\nmiddle,4,0,,\n")
    with pytest.raises(ValueError, match=r"\[supports.left\]: a node has another displacement along y already"):
        latinpc.read(path)
    toml.write_text('[supports.held]\nwhere = "y=max"\nfix = "y"\n')
    assert latinpc.read(path, support="x=min").prescribed.tolist() == [[0.0, 1.0], [0.0, 0.0], [0.0, 0.0]]


@pytest.mark.parametrize(("toml", "words"), [
    ('[loads.w]\nlines = "zzz"\nline = [0.0, 1.0]\n', ["[loads.w]: no line or group of lines is 'zzz'", "known"]),
    ('[loads.w]\nwhere = "x=min"\nline = [0.0, 1.0]\n', ["[loads.w]: where is for nodes; name lines by lines"]),
    ('[[case]]\n[case.supports.a]\nfix = "x"\n', ["unknown key 'supports'; known: combine"]),
    ('[[case]]\nname = "c"\ncombine = {}\n', ["combine must be factors of cases, such as { dead = 1.35"]),
    ("scale = 0.1\n", ["unknown key 'scale'; known: case"]),
    (
        "[loads.all]\nforce = [0.0, 0.0, -1.0]\n",
        ["force must be a list of 2 numbers, not [0.0, 0.0, -1.0]; the structure lies in x, y, unless dim = 3 stands"],
    ),
    ('[supports.all]\nfix = "xyz"\n', ["['x', 'y']", "not 'xyz'; the structure lies in x, y, unless dim = 3 stands"]),
    (
        "[loads.w]\nbox = [[0, 4], [8, 5]]\nforce = [0.0, 1.0]\n",
        ["holds no node of a link; x goes from 0 to 8 m, y goes from 0 to 3 m"],
    ),
    ("[loads.all]\nforce = [0.5, -.5]\n", ["at line 2", "(-.5: TOML asks for a digit on both sides of the point)"]),
    ('title = "3." # 4.\n[laws.bars]\nEA = 2.e5\n', ["at line 3", "(2.e5: TOML asks for a digit on both sides"]),
    ("[supports.all]\nfix = 3\n", ["fix must be a list out of ['x', 'y'], or a text such as 'xy', not 3"]),
    ('[supports.all]\nfix = [["x"]]\n', ["or a text such as 'xy', not [['x']]"]),
    (
        '[[case]]\nname = "dead"\n[[case]]\nname = "all"\ncombine = { dead = 1.35 }\n',
        ["[[case]] 'all': combine: 'dead' has no actions of its own", "in every case, without a factor"],
    ),
    (
        '[supports.edge]\nwhere = "x=min"\n[[case]]\n[case.settlements.edge]\ndisplacement = [0.0, -0.1]\n',
        ["[case.settlements.edge]: no group or node has this name, and the where of [supports.edge] holds there alone"],
    ),
    (
        '[loads.half]\nbox = [[0, 0], [4, 3]]\nforce = [0.0, 1.0]\n[[case]]\n[case.loads.half]\nforce = [0.0, -1.0]\n',
        ["[case.loads.half]: no group or node has this name, and the box of [loads.half] holds there alone"],
    ),
])  # fmt: skip
def test_wrong_keys_are_named_without_far_guesses(toml, words, tmp_path):
    path, _ = written(tmp_path, "csv")
    (tmp_path / "bars.toml").write_text(toml)
    with pytest.raises(ValueError) as caught:
        latinpc.read(path)
    assert all(word in str(caught.value) for word in words), str(caught.value)


def test_members_have_names_of_their_own(tmp_path):
    path, _ = written(tmp_path, "csv")
    rows = ",left,middle,1\ntie,left,middle,1\n,middle,right,1\ntie,right,left,2\n"
    (tmp_path / "bars-members.csv").write_text("member,start,end,EA\n" + rows)
    with pytest.raises(ValueError, match=r"bars-members.csv, line 5: member 'tie' is there already, on line 3"):
        latinpc.read(path)


def test_velocities_of_held_nodes_are_refused(tmp_path):
    path, _ = written(tmp_path, "csv")
    toml = tmp_path / "bars.toml"
    toml.write_text('[velocities.ends]\nwhere = "y=max"\nvelocity = [0.0, 1.0]\n')
    with pytest.raises(ValueError, match=r"\[velocities.ends\]: all its nodes are held along the velocity"):
        latinpc.read(path)
    toml.write_text("[velocities.all]\nvelocity = [0.0, 1.0]\n")
    assert latinpc.read(path).velocity.tolist() == [[0.0, 0.0], [0.0, 0.0], [0.0, 1.0]]


def test_a_table_is_given_in_the_toml_file(tmp_path):
    path, _ = written(tmp_path, "csv")
    members = tmp_path / "bars-members.csv"
    members.write_text("start,end,law,group\nleft,middle,table,ropes\nmiddle,right,table,ropes\n")
    with pytest.raises(ValueError, match=r"line 2: table must be a list .*; it is missing, give it in \[laws.GROUP\]"):
        latinpc.read(path)
    (tmp_path / "bars.toml").write_text("[laws.ropes]\ntable = [[0.0, 0.0], [0.1, 5e3]]\n")
    assert len(latinpc.read(path).tables) >= 1


def test_a_table_is_made_of_pairs(tmp_path):
    path, _ = written(tmp_path, "csv")
    members = tmp_path / "bars-members.csv"
    members.write_text("start,end,law\nleft,middle,table\nmiddle,right,table\n")
    (tmp_path / "bars.toml").write_text("[laws.members]\ntable = [[0.0, 0.0, 1.0], [1.0, 2.0, 3.0]]\n")
    with pytest.raises(
        ValueError, match=r"table must be a list of two or more pairs .*; it is not \[\[0.0, 0.0, 1.0\]"
    ):
        latinpc.read(path)


def test_merged_nodes_have_one_displacement(tmp_path):
    path, _ = written(tmp_path, "csv")
    path.write_text("node,x,y,fix,uy\nmiddle,4,0,,\nP9,0,3,xy,0\nleft,0,3,xy,0.01\nright,8,3,xy,\nP7,8,3,,\n")
    with pytest.raises(ValueError, match=r"bars-nodes\.csv: --merge 0 joins nodes P9 and left of the file, which"):
        latinpc.read(path, merge=0.0)
    path.write_text("node,x,y,fix,uy\nmiddle,4,0,,\nP8,0,3,,\nP9,0,3,xy,0\nleft,0,3,xy,0.01\nright,8,3,xy,\n")
    with pytest.raises(ValueError, match="joins nodes P9 and left of the file"):
        latinpc.read(path, merge=0.0)
    path.write_text("node,x,y,fix,uy\nmiddle,4,0,,\nP8,0,3,,\nP9,0,3,x,\nleft,0,3,xy,0.01\nright,8,3,xy,\n")
    scene = latinpc.read(path, merge=0.0)
    assert scene.prescribed[scene.nodes[:, 0] == 0.0] == pytest.approx(np.array([[0.0, 0.01]]))


@pytest.mark.parametrize("kind", ["csv", "obj"])
def test_a_group_named_twice_counts_once(kind, tmp_path):
    path, options = written(tmp_path, kind)
    file = path if kind == "obj" else tmp_path / "bars-members.csv"
    once = latinpc.read(path, self_weight={"ropes": 1.0}, **options)
    twice = "g ropes ropes" if kind == "obj" else ",ropes; ropes"
    file.write_text(file.read_text().replace("g ropes" if kind == "obj" else ",ropes", twice))
    assert latinpc.read(path, self_weight={"ropes": 1.0}, **options).load == pytest.approx(once.load)


def test_a_unit_is_given_once(tmp_path):
    written(tmp_path, "csv")
    nodes = tmp_path / "bars-nodes.csv"
    nodes.write_text(nodes.read_text().replace("node,x,y", "node,x [mm],y [mm]"))
    assert latinpc.read(nodes).nodes.max() < 0.01
    said = r"--scale 0.001: there is a unit already, in the heading of '{}' in .*bars-{}\.csv"
    with pytest.raises(ValueError, match=said.format("x", "nodes")):
        latinpc.read(nodes, scale=0.001)
    nodes.write_text(nodes.read_text().replace(" [mm]", ""))
    members = tmp_path / "bars-members.csv"
    members.write_text("start,end,law,EA,initial_elongation\nleft,middle,bar,4e7,2\nright,middle,bar,4e7,\n")
    assert latinpc.read(nodes, scale=0.001).initial_elongation == pytest.approx([0.002, 0.0])
    members.write_text(members.read_text().replace("elongation", "elongation [mm]"))
    with pytest.raises(ValueError, match=said.format("initial_elongation", "members")):
        latinpc.read(nodes, scale=0.001)


def test_two_toml_files_are_refused(tmp_path):
    written(tmp_path, "csv")
    for name in "bars.toml", "bars-nodes.toml":
        (tmp_path / name).write_text("dim = 2\n")
    with pytest.raises(ValueError, match=r"several TOML files, .*bars.toml, .*bars-nodes.toml; keep one"):
        latinpc.read(tmp_path / "bars-members.csv")


def test_files_that_no_reader_takes(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"a\.dxf: no such file"):
        latinpc.read(tmp_path / "a.dxf")
    (tmp_path / "a.ifc").write_text("")
    with pytest.raises(ValueError, match=r"a\.ifc: no known kind of file; expected \.msh"):
        latinpc.read(tmp_path / "a.ifc")
    with pytest.raises(FileNotFoundError, match=r"nodes\.csv: no such file; expected a folder with"):
        latinpc.read(tmp_path)
    (tmp_path / "a.obj").write_bytes(b"v 0 0 \xff")
    with pytest.raises(ValueError, match=r"a\.obj: byte 6 is no text in UTF-8"):
        latinpc.read(tmp_path / "a.obj")
    (tmp_path / "b.obj").write_text(OBJ)
    with pytest.raises(FileNotFoundError, match=r"b\.toml: no such file; b\.obj needs it beside it .* --EA"):
        latinpc.read(tmp_path / "b.obj")


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=200, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**32))
def test_mutated_files_give_a_scene_or_a_sentence_with_their_name(kind, seed, tmp_path_factory):
    folder = tmp_path_factory.mktemp("mutated")
    path, options = written(folder, kind)
    rng = random.Random(seed)
    file = rng.choice(sorted(path.iterdir())) if path.is_dir() else path
    file.write_text(mutated(rng, file.read_text()), errors="surrogatepass")
    try:
        assert isinstance(latinpc.read(path, **options), Scene)
    except (ValueError, OSError) as error:
        assert "bars" in str(error) or "--" in str(error), str(error)
    finally:
        shutil.rmtree(folder)
