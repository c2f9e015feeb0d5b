"""Structures of other programs: one truss in every format, what wrong files are told, drawings raised and braced."""

import json
import random
import shutil

import numpy as np
import pytest
from conftest import ROOT
from hypothesis import given, settings
from hypothesis import strategies as st
from test_fuzz import mutated

import latinpc
from latinpc.cli.scenes import FILES
from latinpc.files import tables
from latinpc.files.lines import Lines, near_points
from latinpc.files.reading import READERS
from latinpc.files.selection import select
from latinpc.runs.cases import solve_cases
from latinpc.runs.solve import solve
from latinpc.scenes.scene import Law, Scene

# Two bars under 30 degrees, in the plane: each bears F / (2 sin a), and the node between sinks by F l / (2 EA sin^2 a)
EA, LOAD, HALF, DEPTH = 4.2e7, 1000.0, 4.0, 3.0
LENGTH, SINE = 5.0, 0.6
SINKS, TENSION = LOAD * LENGTH / (2 * EA * SINE**2), LOAD / (2 * SINE)

CSV_NODES = "node,x,y,fix,Fy\nleft,0,3,xy,\nright,8,3,xy,\nmiddle,4,0,,-1000\n"
CSV_MEMBERS = "start,end,EA,group\nleft,middle,4.2e7,ropes\nright,middle,4.2e7,ropes\n"
OBJ = "# a comment\nv 0 3 0\nv 8 3 0\nv 4 0 0\ng ropes\nl 1 3 -2\np 1\np 2\n"
GRAPH = {
    "dtype": "compas.datastructures/Graph",
    "data": {
        "attributes": {},
        "default_node_attributes": {"x": 0.0, "y": 0.0, "z": 0.0},
        "node": {"0": {"y": 3.0, "is_support": True}, "1": {"x": 8.0, "y": 3.0, "is_support": True}, "7": {"x": 4.0}},
        "edge": {"0": {"7": {}}, "7": {"1": {}}},
    },
}
TCL = """# two bars
wipe
model BasicBuilder -ndm 2 -ndf 2; set a 4.0
set A [expr {2.0e-4}]
node 1 0.0 3.0
node 2 [expr 2*$a] 3.0
node 3 $a \\
    0.0
fix 1 1 1
fix 2 1 1
uniaxialMaterial Elastic 1 2.1e11
element truss 1 1 3 $A 1
element corotTruss 2 2 3 $A 1
pattern Plain 1 Linear {
    load 3 0.0 -1000.0   ;# N
}
analyze 1
puts "sinks by [nodeDisp 3 2]"
"""
PYTHON = """import math
import openseespy.opensees as ops
ops.wipe()
ops.model('basic', '-ndm', 2, '-ndf', 2)
a, A = 4.0, 2e-4
h = math.sqrt(9.0)
ops.node(1, 0.0, h)
ops.node(2, 8.0, h)
ops.node(3, 4.0, 0.0)
for_all = [1, 1]
ops.fix(1, *for_all)
ops.fix(2, 1, 1)
ops.uniaxialMaterial('Elastic', 1, 2.1e11)
ops.element('Truss', 1, *[1, 3], 2e-4, 1)
ops.element('truss', 2, 2, 3, 0.5 * 4e-4, 1)
ops.timeSeries('Linear', 1)
ops.pattern('Plain', 1, 1)
ops.load(3, 0.0, -1000.0)
ops.analyze(1)
for tag in (1, 2, 3):
    print(tag, ops.nodeDisp(tag))
"""


def write_dxf(path, unit=1.0):
    """Write the two bars in mm or m, with a circle, and a line on a layer that is off."""
    ezdxf = pytest.importorskip("ezdxf")
    document = ezdxf.new()
    document.units = {1.0: 0, 1e-3: ezdxf.units.MM}[unit]
    document.layers.add("ropes")
    document.layers.add("axes").off()
    space = document.modelspace()
    space.add_line((0, 3 / unit), (4 / unit, 0), dxfattribs={"layer": "ropes"})
    space.add_lwpolyline([(8 / unit, 3 / unit), (4 / unit, 0)], dxfattribs={"layer": "ropes"})
    for x in (0, 8):
        space.add_point((x / unit, 3 / unit), dxfattribs={"layer": "feet"})
    space.add_circle((0, 0), 1)
    space.add_line((0, 0), (9, 9), dxfattribs={"layer": "axes"})
    document.saveas(path)


def written(folder, kind):
    """Write the two bars in a format; return the file, and the options that say what it does not."""
    drawn = {"EA": {"ropes": EA}, "load": "y=-1000:y=min"}
    if kind == "csv":
        (folder / "bars-nodes.csv").write_text(CSV_NODES)
        (folder / "bars-members.csv").write_text(CSV_MEMBERS)
        return folder / "bars-nodes.csv", {}
    if kind == "folder":
        (folder / "bars").mkdir(exist_ok=True)
        (folder / "bars" / "nodes.csv").write_text(CSV_NODES)
        (folder / "bars" / "members.csv").write_text(CSV_MEMBERS)
        return folder / "bars", {}
    if kind in ("dxf", "dxf in mm"):
        write_dxf(folder / "bars.dxf", 1e-3 if kind == "dxf in mm" else 1.0)
        return folder / "bars.dxf", drawn | {"support": "feet"}
    text = {"obj": OBJ, "json": json.dumps(GRAPH), "tcl": TCL, "py": PYTHON}[kind]
    (folder / f"bars.{kind}").write_text(text)
    options = {"obj": drawn | {"support": "points"}, "json": drawn | {"EA": EA, "support": "is_support"}}
    return folder / f"bars.{kind}", options.get(kind, {})


KINDS = ["csv", "folder", "dxf", "dxf in mm", "obj", "json", "tcl", "py"]


@pytest.mark.parametrize("kind", KINDS)
def test_one_truss_in_every_format(kind, tmp_path):
    path, options = written(tmp_path, kind)
    scene = latinpc.read(path, **options)
    assert (len(scene.nodes), len(scene.links), scene.dim) == (3, 2, 2)
    assert scene.lengths == pytest.approx([LENGTH, LENGTH])
    result = solve(scene)
    middle = int(scene.nodes[:, 1].argmin())
    assert result.converged
    assert result.displacements[middle] == pytest.approx([0.0, -SINKS], abs=1e-9 * SINKS)
    assert result.tensions == pytest.approx([TENSION, TENSION])


def test_links_that_a_file_has_twice_are_named(tmp_path):
    path, _ = written(tmp_path, "csv")
    twice = "links join the same two nodes by the same law: 0 and 2; what they carry adds up"
    (tmp_path / "bars-members.csv").write_text(CSV_MEMBERS + "middle,left,4.2e7,ropes\n")
    scene = latinpc.read(path)
    assert solve(scene).notices == [twice]
    assert solve_cases(scene, [latinpc.Case("none")]).notices == [twice]
    with pytest.warns(latinpc.LatinWarning, match=twice):
        scene.solve()


def test_a_toml_file_beside_any_format_says_what_its_groups_are(tmp_path):
    path, _ = written(tmp_path, "obj")
    path.with_suffix(".toml").write_text(
        '[laws.ropes]\nlaw = "cable"\nEA = 4.2e7\n[supports.points]\n[loads.middle]\nwhere = "y=min"\n'
        'force = [0.0, -1000.0]\n[loads.weight]\nlines = "ropes"\nline = [0.0, -10.0]\n'
    )
    scene = latinpc.read(path)
    assert (scene.law == Law.CABLE).all()
    assert scene.load[:, 1] == pytest.approx([-25.0, -25.0, -1050.0])
    assert latinpc.read(path, self_weight={"ropes": 10.0}).load.sum() == pytest.approx(-1200.0)
    with pytest.raises(ValueError, match=r"--EA: what it gives has been given already, in bars\.obj or bars\.toml"):
        latinpc.read(path, EA=1.0)


def test_options_give_what_a_table_leaves_out(tmp_path):
    path, _ = written(tmp_path, "csv")
    members = "start,end,law,group\nleft,middle,cable,a\nright,middle,,b\n"
    (tmp_path / "bars-members.csv").write_text(members)
    scene = latinpc.read(path, EA={None: EA, "b": 2 * EA}, prestress=5.0)
    assert scene.law.tolist() == [Law.CABLE, Law.BAR]
    assert scene.stiffness == pytest.approx([EA / LENGTH, 2 * EA / LENGTH])
    assert scene.stiffness * scene.initial_elongation == pytest.approx([5.0, 5.0])


def test_columns_in_other_orders_units_and_languages(tmp_path):
    nodes = "\ufeffFy [kN];Node;X (mm);y [cm];fix;#remark\n\n;left;0;300;xy;a\n;right;8000,0;3e2;XY;\n"
    nodes += "-1,0;middle;4000;0;;b\n"
    (tmp_path / "nodes.csv").write_text(nodes)
    (tmp_path / "members.csv").write_text("# members\nEA [MN]\tend\tstart\n42,0\tmiddle\tleft\n42\tmiddle\tright\n")
    scene = latinpc.read(tmp_path)
    assert scene.nodes.tolist() == [[0, 3], [8, 3], [4, 0]]
    assert scene.load.tolist() == [[0, 0], [0, 0], [0, -1000]]
    assert scene.stiffness == pytest.approx([EA / LENGTH] * 2)


def test_areas_and_strengths_of_tables_give_stresses_and_utilisations(tmp_path):
    (tmp_path / "nodes.csv").write_text(CSV_NODES)
    members = "start,end,EA,area [mm2],strength [N/mm²]\nleft,middle,4.2e7,200,235\nright,middle,4.2e7,,\n"
    (tmp_path / "members.csv").write_text(members)
    result = latinpc.read(tmp_path).solve()
    assert result.stress[0] == pytest.approx(TENSION / 2e-4) and np.isnan(result.stress[1])
    assert result.utilisation[0] == pytest.approx(TENSION / 2e-4 / 235e6)
    (tmp_path / "members.csv").write_text(members.replace(",EA,", ",#EA,"))
    assert latinpc.read(tmp_path, EA=4.2e7).area[0] == pytest.approx(2e-4)
    (tmp_path / "members.csv").write_text(members.replace("200,", ","))
    with pytest.raises(ValueError, match="line 2.*needs the area"):
        latinpc.read(tmp_path)


def test_settlements_masses_and_groups_of_tables(tmp_path):
    (tmp_path / "nodes.csv").write_text("x,fix,ux,mass,group\n0,x,,,\n2,,,5,middle\n4,x,0.5,,end\n")
    (tmp_path / "members.csv").write_text("start,end,law,stiffness,initial_elongation\n1,2,bar,3,0\n2,3,cable,3,0.3\n")
    scene = latinpc.read(tmp_path, load="x=2:middle")
    assert scene.prescribed.ravel().tolist() == [0, 0, 0.5] and scene.mass.tolist() == [0, 5, 0]
    u = solve(scene).displacements  # 3 u = 2 + 3 (0.5 - u + 0.3)
    assert u[1, 0] == pytest.approx((2 + 3 * 0.8) / 6)


MATERIALS = [
    ("Elastic 1 2.1e11 0.0 0.0", Law.CABLE, 0.0),
    ("ENT 1 2.1e11", Law.COMPRESSION_ONLY, 0.0),
    ("ElasticPPGap 1 2.1e11 2.5e8 0.001", Law.CABLE, -0.001),
    ("ElasticPPGap 1 2.1e11 -2.5e8 -0.001", Law.COMPRESSION_ONLY, 0.001),
    ("Elastic 2 2.1e11\nuniaxialMaterial InitStrainMaterial 1 2 1e-4", Law.BAR, 1e-4),
    ("Elastic 2 2.1e11\nuniaxialMaterial InitStressMaterial 1 2 2.1e7", Law.BAR, 1e-4),
]


@pytest.mark.parametrize(("material", "law", "strain"), MATERIALS)
def test_materials_of_opensees(material, law, strain, tmp_path):
    """Stress E (strain + e0 / l), of one sign or of both; gaps as OpenSees counts them: tension beyond the gap."""
    path = tmp_path / "bars.tcl"
    path.write_text(TCL.replace("Elastic 1 2.1e11", material))
    scene = latinpc.read(path)
    assert (scene.law == law).all()
    assert scene.stiffness == pytest.approx([EA / LENGTH] * 2)
    assert scene.initial_elongation == pytest.approx([strain * LENGTH] * 2)
    assert bool(scene.metadata["notes"][:-1]) == ("Gap" in material)


def test_patterns_add_up_with_their_factors(tmp_path):
    more = """timeSeries Constant 4 -factor 3.0
pattern Plain 2 4 -fact 2.0 {
    load 3 1.0 0.0
    sp 1 2 -0.01
}
mass 3 7.0 7.0
"""
    (tmp_path / "bars.tcl").write_text(TCL + more)
    scene = latinpc.read(tmp_path / "bars.tcl")
    assert scene.load[2].tolist() == [6.0, -1000.0]
    assert scene.prescribed[0].tolist() == [0.0, -0.06] and scene.mass.tolist() == [0, 0, 7]


def test_whole_numbers_divide_as_in_each_language(tmp_path):
    (tmp_path / "a.tcl").write_text(TCL.replace("node 2 [expr 2*$a] 3.0", "node 2 [expr {16/(3/2)*0.5}] 3.0"))
    (tmp_path / "a.py").write_text(PYTHON.replace("ops.node(2, 8.0, h)", "ops.node(2, 16 / 2, h)"))
    for kind in ("tcl", "py"):
        assert latinpc.read(tmp_path / f"a.{kind}").nodes[1].tolist() == [8.0, 3.0]


def test_scripts_are_not_run(tmp_path):
    """Calls and commands with effects leave nothing behind, wherever they stand."""
    mark = tmp_path / "mark"
    call = f"open({str(mark)!r}, 'w').write('ran')"
    (tmp_path / "a.py").write_text(f"{call}\nx = {call}\nops_ = [{call}]\nclass C:\n    {call}\n{PYTHON}{call}\n")
    (tmp_path / "a.tcl").write_text(f"set f [open {mark} w]\nexit\n{TCL}\n")
    for kind in ("py", "tcl"):
        assert len(latinpc.read(tmp_path / f"a.{kind}").links) == 2
    (tmp_path / "b.py").write_text(PYTHON.replace("8.0, h)", f"{call}, h)"))
    with pytest.raises(ValueError, match=r"b\.py, line 8: "):
        latinpc.read(tmp_path / "b.py")
    assert not mark.exists()


# ---- wrong files -----------------------------------------------------------------------------

BAD = [
    ("csv", "middle,4,0,,-1000", "middle,4,zero,,-1000", ["nodes.csv, line 4", "y is 'zero'", "a finite number"]),
    ("csv", "middle,4,0,,-1000", "middle,4,0,-1000", ["nodes.csv, line 4", "4 cells", "5, as in the head on line 1"]),
    ("csv", "middle,4,0,,-1000", "left,4,0,,-1000", ["nodes.csv, line 4", "'left' is there already, on line 2"]),
    ("csv", "node,x,y,fix,Fy", "node,x,y,fixed,Fy", ["nodes.csv, line 1", "unknown column 'fixed'", "'fix'"]),
    ("csv", "node,x,y,fix,Fy", "node,x,y,fix,y", ["nodes.csv, line 1", "column 'y' is there twice"]),
    ("csv", "node,x,y,fix,Fy", "node,x [inch],y,fix,Fy", ["line 1", "in 'inch'", "m, cm, mm"]),
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


OPTIONS = [
    ({"support": "feet"}, ["--support feet", "chooses no nodes", "its groups are points, ropes"]),
    ({"support": "x<5:z"}, ["--support x<5:z", "fix must be a list out of ['x', 'y']"]),
    ({"support": "z=min"}, ["--support z=min", "there is no z", "x, y"]),
    ({"support": "x>100"}, ["--support x>100", "holds no node"]),
    ({"support": ()}, ["bars.obj", "nothing is held", "--support", "bars.toml"]),
    ({"load": "down=3"}, ["--load down=3", "write z=-1000"]),
    ({"load": ["y=3", "y=3"]}, ["--load y=3: given twice"]),
    ({"load": "z=3"}, ["--load z=3", "there is no z"]),
    ({"EA": {"wires": 1.0}}, ["no group of lines is 'wires'"]),
    ({"EA": {"ropes": -1.0}}, ["'ropes'", "EA must be positive"]),
    ({"law": {None: "cables"}}, ["unknown law 'cables'"]),
    ({"law": "friction"}, ["the law friction takes no EA"]),
    ({"scale": 0.0}, ["--scale 0", "must be positive"]),
    ({"merge": 1.0}, ["--merge 1", "twentieth of the extent, 8 m"]),
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


def test_the_page_names_every_option_and_format():
    page = (ROOT / "docs" / "imports.md").read_text()
    for option, metavar, _ in FILES.values():
        assert f"| `{option} {metavar}` |" in page
    for suffix in READERS:
        assert suffix in page
    for name in (*tables.NODES, *tables.MEMBERS):
        assert f"`{name}`" in page


# ---- drawings --------------------------------------------------------------------------------


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32), tolerance=st.floats(0.0, 0.3))
def test_merging_is_that_of_all_pairs(seed, tolerance):
    """Nodes are the connected parts of the graph of near points, found pair by pair."""
    rng = np.random.default_rng(seed)
    points = rng.integers(0, 4, (30, 3)) * 0.5 + rng.choice([0.0, 0.05], (30, 3))
    near = np.linalg.norm(points[:, None] - points[None], axis=2) <= tolerance
    for _ in points:
        near = near @ near
    first, of = near_points(points, tolerance)
    assert (of[:, None] == of[None]).tolist() == near.tolist()
    assert first.tolist() == sorted({int(row.argmax()) for row in near})
    assert (of[first] == np.arange(len(first))).all()


def grid_of_lines(side, jitter=0.0):
    """Lines of a square grid, each with points of its own and some drawn twice, as programs for drawing write them."""
    rng = np.random.default_rng(0)
    at = [(i, j) for i in range(side + 1) for j in range(side + 1)]
    pairs = [((i, j), (i + 1, j)) for i, j in at if i < side] + [((i, j), (i, j + 1)) for i, j in at if j < side]
    text, count = "", 0
    for a, b in pairs + [(b, a) for a, b in pairs[:5]]:
        for x, y in (a, b):
            dx, dy = rng.uniform(-jitter, jitter, 2)
            text += f"v {x + dx} {y + dy} 0\n"
        count += 2
        text += f"l {count - 1} {count}\n"
    return text, len(at), len(pairs)


def test_a_drawing_is_merged_raised_and_braced(tmp_path):
    """Nodes and links by count; the vault's height at the crown and the rim; posts upright, braces across the bays."""
    text, n, m = grid_of_lines(6, jitter=1e-3)
    (tmp_path / "plan.obj").write_text(text)
    rim = ["x<=0.01", "x>=5.99", "y<=0.01", "y>=5.99"]
    scene = latinpc.read(
        tmp_path / "plan.obj", merge=5e-3, rise=0.25, brace=0.8, EA={None: 6e7, "braces": 1e7}, support=rim,
        prestress={"braces": 500.0}, load="z=-100",
    )  # fmt: skip
    assert len(scene.nodes) == 2 * n and len(scene.links) == 2 * m + n + 2 * m
    assert scene.law.tolist() == [Law.BAR] * (2 * m + n) + [Law.CABLE] * 2 * m
    heights = scene.nodes[:n, 2]
    assert heights.max() == pytest.approx(0.25 * 6, rel=1e-2) and abs(heights[scene.fixed[:n, 0]]).max() < 1e-2
    posts = scene.vectors[2 * m : 2 * m + n]
    assert posts == pytest.approx(np.tile([0.0, 0.0, 0.8], (n, 1)))
    layer = np.arange(2 * n) >= n
    assert (layer[scene.links[2 * m + n :]].sum(axis=1) == 1).all()
    assert scene.fixed.all(axis=1).sum() == 2 * 24
    assert scene.metadata["notes"][0] == f"{2 * (m + 5) - n} points merged"
    result = solve(scene)
    assert result.converged and result.displacements[:, 2].min() < 0.0


def test_lines_of_a_merged_table_keep_their_number(tmp_path):
    """Two members side by side are two links: only a drawing draws a line twice."""
    (tmp_path / "nodes.csv").write_text("x,fix,Fx\n0,x,\n2,,1\n2.001,,2\n")
    (tmp_path / "members.csv").write_text("start,end,EA\n1,2,1\n1,3,1\n1,3,1\n")
    scene = latinpc.read(tmp_path, merge=0.01)
    assert len(scene.links) == 3 and scene.load.ravel().tolist() == [0, 3]


def test_upright_lines_and_slopes_are_not_raised_or_braced(tmp_path):
    lines = Lines("a.obj", [[0, 0, 0], [0, 0, 1], [1, 0, 0]], [[0, 1], [0, 2]], rows=[4, 5])
    with pytest.raises(ValueError, match=r"--raise is for a flat drawing.*z goes from 0 to 1 m"):
        lines.raised(0.2)
    with pytest.raises(ValueError, match=r"a\.obj, line 4: --brace puts posts along z, where this line is already"):
        lines.braced(1.0)


NODES = np.array([[0.0, 0.0], [1.0, 0.0], [1.0 + 1e-12, 2.0], [3.0, 2.0]])
CHOICES = [
    ("all", [0, 1, 2, 3]), ("x=min", [0]), ("y=max", [2, 3]), ("x<=1", [0, 1, 2]), ("x<1", [0]), ("x > 1", [3]),
    ("x>=1,y=0", [1]), ("x=1e0", [1, 2]), ("tip", [3]), ("x<-5", []),
]  # fmt: skip


@pytest.mark.parametrize(("text", "chosen"), CHOICES)
def test_conditions_choose_nodes_and_do_not_mind_rounding(text, chosen):
    assert select(text, NODES, {"tip": np.array([3])}, "here").tolist() == chosen


def test_faces_give_each_edge_once(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1/1 2/1 3/1\nf 1 3 4\n")
    mesh = {"vertex": {str(i): {"x": i % 2, "y": i // 2} for i in range(4)}, "face": {"0": [0, 1, 3], "1": [0, 3, 2]}}
    (tmp_path / "a.json").write_text(json.dumps({"dtype": "compas.datastructures/Mesh", "data": mesh}))
    for kind in ("obj", "json"):
        scene = latinpc.read(tmp_path / f"a.{kind}", EA=1.0, support="y=0")
        assert len(scene.links) == 5 and scene.metadata["notes"] == []


@pytest.mark.parametrize("name", ["fink.obj", "saddle.obj", "lines.obj", "open_edges.obj"])
def test_files_of_compas_itself(name):
    """Its samples: as many nodes and links as compas reads of them."""
    compas = pytest.importorskip("compas")
    from compas.datastructures import Graph

    path = compas.get(name)
    scene, graph = latinpc.read(path, EA=1.0, support="x=min"), Graph.from_obj(path)
    assert (len(scene.nodes), len(scene.links)) == (graph.number_of_nodes(), graph.number_of_edges())


@pytest.mark.parametrize("kind", ["Graph", "Mesh"])
def test_what_compas_writes_is_read(kind, tmp_path):
    pytest.importorskip("compas")
    from compas.datastructures import Graph, Mesh

    path = tmp_path / "a.json"
    if kind == "Graph":
        made = Graph.from_lines([((0, 0, 0), (1, 0, 0)), ((1, 0, 0), (1, 2, 0)), ((1, 2, 0), (0, 0, 0))])
        made.node_attribute(0, "is_anchor", True)
    else:
        made = Mesh.from_meshgrid(4, 3)
        made.vertex_attribute(0, "is_anchor", True)
    made.to_json(path)
    scene = latinpc.read(path, EA=1.0, support="is_anchor")
    assert len(scene.links) == made.number_of_edges() and scene.fixed.all(axis=1).sum() == 1


def test_lists_of_polylines(tmp_path):
    corners = [[0, 0], [1, 0], [1, 1], [0, 1]]
    line = {"dtype": "compas.geometry/Line", "data": {"start": [0, 1, 0], "end": [0, 0, 0]}}
    (tmp_path / "a.json").write_text(json.dumps([corners, line, {"points": [[2, 2], [1, 1]]}]))
    scene = latinpc.read(tmp_path / "a.json", EA=1.0, support="x=min")
    assert scene.links.tolist() == [[0, 1], [1, 2], [2, 3], [3, 0], [4, 2]]


def test_the_example_of_gmsh_takes_options_in_place_of_its_toml_file(tmp_path):
    shutil.copy(ROOT / "examples" / "tower.msh", tmp_path)
    scene = latinpc.read(tmp_path / "tower.msh", EA=1e9, law={"bracing": "cable"}, support="y=min", load="x=100:x=min")
    assert (scene.law == Law.CABLE).sum() == 64 and scene.fixed.any()
