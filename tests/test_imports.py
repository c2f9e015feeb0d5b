"""Structures of other programs: one truss in every format, what tables, scripts and compas hold."""

import json
import shutil

import numpy as np
import pytest
from conftest import ROOT
from two_bars import CSV_MEMBERS, CSV_NODES, EA, KINDS, LENGTH, PYTHON, SINKS, TCL, TENSION, written

import latinpc
from latinpc.cli.scenes import FILES
from latinpc.files import tables
from latinpc.files.arithmetic import evaluate
from latinpc.files.reading import READERS
from latinpc.runs.cases import solve_cases
from latinpc.runs.solve import solve
from latinpc.scenes.scene import Law


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
    twice = "links join the same two nodes by the same law: 1 and 3; what they carry adds up"
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
    with pytest.raises(ValueError, match=r"--EA: no line is left that needs it: bars\.obj or bars\.toml"):
        latinpc.read(path, EA=1.0)


def test_options_give_what_a_table_leaves_out(tmp_path):
    path, _ = written(tmp_path, "csv")
    members = "start,end,law,group\nleft,middle,cable,a\nright,middle,,b\n"
    (tmp_path / "bars-members.csv").write_text(members)
    scene = latinpc.read(path, EA={None: EA, "b": 2 * EA}, prestress=5.0)
    assert scene.law.tolist() == [Law.CABLE, Law.BAR]
    assert scene.stiffness == pytest.approx([EA / LENGTH, 2 * EA / LENGTH])
    assert scene.stiffness * scene.initial_elongation == pytest.approx([5.0, 5.0])


def test_options_of_a_group_fill_what_its_table_or_toml_file_leaves_empty(tmp_path):
    """What is for all lines is not for contacts, which have no EA; an option that no line takes is named."""
    head = "start,end,law,EA,prestress,group\n"
    (tmp_path / "bars-nodes.csv").write_text(CSV_NODES + "base,4,-1,xy,\n")
    members = "left,middle,cable,4e7,,a\nright,middle,,,,b\nmiddle,base,,,,c\n"
    (tmp_path / "bars-members.csv").write_text(head + members)
    (tmp_path / "bars.toml").write_text("[laws.b]\nlaw = 'cable'\n[laws.c]\nlaw = 'contact'\n")
    path = tmp_path / "bars-members.csv"
    scene = latinpc.read(path, EA=2e7, prestress={None: 7.0, "a": 5.0})
    assert scene.stiffness * LENGTH == pytest.approx([4e7, 2e7, 0.0])
    assert scene.prestress == pytest.approx([5.0, 7.0, 0.0])
    with pytest.raises(ValueError, match=r"--EA of 'a': no line is left that needs it: bars-members\.csv"):
        latinpc.read(path, EA={"a": 1e7, "b": 2e7})
    with pytest.raises(
        ValueError, match=r"bars\.toml: \[laws\.b\], with --law, --EA, --prestress of 'b': EA must be pos"
    ):
        latinpc.read(path, EA={"b": -1.0})


GRAINS = "node,x,y,z,fix,Fz\n1,0,0,0,xyz,\n2,1,0,0,xyz,\n3,0.5,0.8,0,xyz,\n4,0.5,0.3,0.8,,-1\n"


def grains(folder, head, rows, laws=""):
    """Write a grain on three others; return the scene, and its tensions."""
    (folder / "nodes.csv").write_text(GRAINS)
    members = "".join(f"{number},4,{row}\n" for number, row in enumerate(rows, 1))
    (folder / "members.csv").write_text(f"start,end,{head}\n{members}")
    (folder / "grains.toml").write_text(laws)
    scene = latinpc.read(folder)
    return scene, solve(scene).tensions


def test_tables_give_friction_and_the_gap_of_each_contact(tmp_path):
    toml = '[laws.{0}]\nlaw = "friction"\ncoefficient = {1}\ngap = {2}\n'
    known, tensions = grains(tmp_path, "group", "abb", toml.format("a", 0.3, 1e-3) + toml.format("b", 0.5, 0.0))
    rows = ["friction,0.3,1,0", "friction,0.5,,0", "friction,0.5,,0"]
    scene, found = grains(tmp_path, "law,coefficient,gap [mm],stiffness", rows)
    for name in ("law", "initial_elongation", "direction", "friction", "links", "stiffness"):
        assert np.array_equal(getattr(scene, name), getattr(known, name))
    assert found == pytest.approx(tensions)
    by_group = '[laws.members]\nlaw = "friction"\ncoefficient = 0.3\n'
    scene, _ = grains(tmp_path, "initial_elongation,area", ["0.001,2", ",2", ",2"], by_group)
    assert np.array_equal(scene.initial_elongation, known.initial_elongation)
    assert (scene.area == 2.0).all() and len(scene.area) == 9


def test_what_both_a_table_and_its_toml_file_give_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"members.csv, line 2: it gives gap, as .*grains.toml: \[laws.members\] does"):
        grains(tmp_path, "gap", ["1", "", ""], '[laws.members]\nlaw = "contact"\ngap = 1e-3\n')
    with pytest.raises(ValueError, match=r"members.csv, line 2, with .*\[laws.members\]: give only one of"):
        grains(tmp_path, "EA", ["1", "1", "1"], '[laws.members]\nlaw = "cable"\nstiffness = 1e-3\n')
    with pytest.raises(ValueError, match="line 2: the law friction needs its coefficient"):
        grains(tmp_path, "law", ["friction"] * 3)
    scene, _ = grains(tmp_path, "law", ["cable", "bar", "bar"], "[laws.members]\nEA = 4.2e7\n")
    assert scene.law.tolist() == [Law.CABLE, Law.BAR, Law.BAR]


def test_numbers_of_numpy_and_laws_of_the_library(tmp_path):
    path, _ = written(tmp_path, "obj")
    given = {"support": "points", "load": "y=-1000:y=min"}
    known = latinpc.read(path, EA=5.0, prestress=2.0, self_weight=3.0, law="cable", **given)
    scene = latinpc.read(
        path, EA=np.float32(5.0), prestress=np.int64(2), self_weight=np.float32(3.0), law=latinpc.Law.CABLE, **given
    )
    for name in ("law", "stiffness", "initial_elongation", "load"):
        assert np.array_equal(getattr(scene, name), getattr(known, name))
    path.with_suffix(".toml").write_text('\ufefftitle = "ropes"\n', encoding="utf-8")
    named = latinpc.read(path, law={"ropes": latinpc.Law.INEXTENSIBLE}, **given)
    assert named.name == "ropes" and (named.law == Law.INEXTENSIBLE).all()


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


NAMED = """
[laws.members]
law = "bar"
EA = 4e6
[supports.7]
[supports.B]
fix = "y"
[loads.top]
force = [0.0, -3e3]
[loads.7]
force = [50.0, 0.0]
"""


def named(folder):
    """Write a table whose nodes and members have names, one of them that of a group."""
    (folder / "nodes.csv").write_text("node,x,y,group\n7,0,0,\nB,2,0,\ntop,1,1,\nside,1,2,top\nalone,5,5,\n")
    (folder / "members.csv").write_text("member,start,end\npost,7,top\ntie,B,top\n,7,side\n,B,side\n")


def test_nodes_and_members_are_named_as_groups_are(tmp_path):
    """Groups come first: the load on `top` acts on the group, not on the node of that name."""
    named(tmp_path)
    (tmp_path / "members.toml").write_text(NAMED)
    scene = latinpc.read(tmp_path)
    assert scene.fixed.tolist() == [[True, True], [False, True], [False, False], [False, False]]
    assert scene.load.tolist() == [[50, 0], [0, 0], [0, 0], [0, -3e3]]
    (tmp_path / "members.toml").unlink()
    scene = latinpc.read(tmp_path, EA={"post": 1e6, None: 4e6}, support=["7", "B:y"], load=["y=-3e3:top", "x=50:7"])
    length = np.sqrt([2, 2, 5, 5])
    assert scene.stiffness * length == pytest.approx([1e6, 4e6, 4e6, 4e6])
    assert scene.load.tolist() == [[50, 0], [0, 0], [0, 0], [0, -3e3]]


def test_a_member_is_an_exception_of_its_group(tmp_path):
    """In any order, of options and in TOML files."""
    named(tmp_path)
    length = np.sqrt([2, 2, 5, 5])
    for stiff in ({"members": 4e6, "tie": 1e6}, {"tie": 1e6, "members": 4e6}):
        scene = latinpc.read(tmp_path, EA=stiff, support="y=min", load="x=50:7")
        assert scene.stiffness * length == pytest.approx([4e6, 1e6, 4e6, 4e6])
    scene = latinpc.read(
        tmp_path, EA=stiff, law={"members": "cable"}, prestress={"post": 2e3}, support="y=min", load="x=50:7"
    )
    assert (scene.law == Law.CABLE).all()  # what the member has no option of is that of its group
    assert scene.stiffness * scene.initial_elongation == pytest.approx([2e3, 0.0, 0.0, 0.0])
    tie = '[laws.tie]\nlaw = "cable"\nEA = 1e6\n'
    for text in (NAMED + tie, tie + NAMED):
        (tmp_path / "members.toml").write_text(text)
        scene = latinpc.read(tmp_path)
        assert scene.stiffness * length == pytest.approx([4e6, 1e6, 4e6, 4e6])
        assert scene.law.tolist() == [Law.BAR, Law.CABLE, Law.BAR, Law.BAR]


@pytest.mark.parametrize(("given", "said"), [
    ({"support": "8"}, "--support 8: '8' chooses no nodes; write a group or a node of the file"),
    ({"support": "alone"}, "'alone' chooses no nodes"),
    ({"EA": {"strut": 1.0}}, "no line or group of lines is 'strut'"),
])  # fmt: skip
def test_names_that_no_node_or_member_has(given, said, tmp_path):
    named(tmp_path)
    with pytest.raises(ValueError, match=said):
        latinpc.read(tmp_path, **{"EA": 1e6, "support": "y=min", "load": "x=1"} | given)


def test_a_name_that_two_members_have_chooses_none(tmp_path):
    """A member without a name has the number of its row, which another may have as its name."""
    named(tmp_path)
    members = (tmp_path / "members.csv").read_text().replace("post,", "3,")
    (tmp_path / "members.csv").write_text(members)
    with pytest.raises(ValueError, match="'3' is the name of 2 nodes or members: give them other names, or groups"):
        latinpc.read(tmp_path, EA={"3": 1e6, None: 4e6}, support="y=min", load="x=1")


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


def test_the_page_names_every_option_and_format():
    page = (ROOT / "docs" / "imports.md").read_text()
    for option, metavar, _ in FILES.values():
        assert f"| `{option} {metavar}` |" in page
    for suffix in READERS:
        assert suffix in page
    for name in (*tables.NODES, *tables.MEMBERS):
        assert f"`{name}`" in page


@pytest.mark.parametrize("name", ["bars.toml", "bars-nodes.toml", "bars-members.toml"])
def test_the_toml_file_of_two_tables(name, tmp_path):
    """Its name is that of the structure, or of either table, whichever file of both is read."""
    for table, text in ("nodes", CSV_NODES), ("members", CSV_MEMBERS):
        (tmp_path / f"bars-{table}.csv").write_text(text)
    (tmp_path / name).write_text('title = "two ropes"\ngeometry = "large"\n')
    for table in "nodes", "members":
        scene = latinpc.read(tmp_path / f"bars-{table}.csv")
        assert (scene.name, scene.geometry) == ("two ropes", "large")


def test_the_toml_file_of_a_folder_is_beside_it_or_in_it(tmp_path):
    folder = tmp_path / "bars.v2"
    folder.mkdir()
    (folder / "nodes.csv").write_text(CSV_NODES)
    (folder / "members.csv").write_text(CSV_MEMBERS)
    (tmp_path / "bars.toml").write_text('title = "another structure"\n')
    assert latinpc.read(folder).name == "bars.v2"
    for place in tmp_path / "bars.v2.toml", folder / "any.toml":
        place.write_text('title = "two ropes"\n')
        assert latinpc.read(folder).name == "two ropes"
        place.unlink()


@pytest.mark.parametrize(
    ("text", "worth"), [("abs(-7)/2", 3), ("abs(-7.0)/2", 3.5), ("fabs(-7)/2", 3.5), ("pow(2, 3)/3", 8.0 / 3.0)]
)
def test_functions_leave_whole_numbers_what_tcl_leaves(text, worth):
    assert evaluate(text) == worth
