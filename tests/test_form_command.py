"""``latinpc form``: what it takes, refuses and writes."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from command import latinpc as command
from conftest import ROOT, run
from test_form import dense

import latinpc

LATINPC = Path(sys.executable).parent / "latinpc"
CANOPY = ROOT / "examples" / "canopy.msh"


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
    ((), "give force densities with --density, forces with --force, or --natural"),
    (("--force", "edges=x"), "--force edges=x: write a number (N), LAW=number or GROUP=number with one of the drawing"),
    (("--force", "edges=5"), "link 3-18 has no --force: give a --density of such links, or --natural"),
    (("--force", "edges=5", "--force", "edges=6"), "--force edges=5 and --force edges=6 are for the same links"),
    (("--force", "-5"), "have a force or a force density that their law cannot bear"),
    (("--force", "2e3"), "no stable form bears these forces: in the nearest one link "),
    (("--density", "cable=x"), "--density cable=x: write a number"),
    (("--density", "bar=4"), "with one of the drawing (cable, edges, net)"),
    (("--density", "edges=4"), "links of the law cable have none; give cable=X"),
    (("--density", "drawn", "--density", "3"), "--density drawn stands alone"),
    (("--density", "-5"), "links 1-2 (-5.), 1-3 (-5.), "),
    (("--density", "0"), "all force densities are zero"),
    (("--density", "5", "--density", "6"), "--density 5 and --density 6 are for the same links"),
    (("--density", "net=1", "--density", "edges=3", "--density", "net=2"), "--density net=1 and --density net=2"),
    (("--density", "5", "--error", "1e-4"), "--error is for natural lengths and forces: give --natural or --force"),
    (("--natural", "-snes_latin_geometry", "linear"), "-snes_latin_geometry linear: forms are found with large"),
    (("--density", "drawn", "--picture", "a.gif"), "cannot write '.gif'"),
    (("--natural",), "all links are slack, and nothing holds a form"),
])  # fmt: skip
def test_command_refuses(words, said):
    """With 2 and a sentence."""
    assert said in command("form", CANOPY, *words, code=2).stderr


def test_command_takes_forces(tmp_path):
    """Edges of 20 kN around a net of the drawn densities; the tables hold the lengths to which they are cut."""
    words = ["--density", "drawn", "--force", "edges=20e3", "--csv", "members.csv", "nodes.csv", "--json", "-"]
    found = json.loads(run([LATINPC, "form", CANOPY, *words], cwd=tmp_path).stdout)
    assert found["tension"][1] == 20e3 and found["unbalance"] < 1e-8
    assert found["density"][0] == pytest.approx(2e3)
    hung = latinpc.Structure.from_scene(latinpc.read(tmp_path))
    hung.set_geometry("large")
    assert hung.solve().tensions.max() == pytest.approx(20e3, rel=1e-6)


def test_command_takes_densities_by_law_and_scenes():
    """Struts that push, of a grid; a net of frames is refused."""
    grid = ["tensegrity-grid", "--modules", "4"]
    ended = run([LATINPC, "form", *grid, "--density", "1000", "--density", "bar=-200", "--without-load", "--json", "-"])
    assert json.loads(ended.stdout)["density"] == pytest.approx([-200.0, 1000.0])
    refused = command("form", *grid, "--density", "bar=5", code=2).stderr
    assert "links of the law cable have none; give cable=X" in refused
    assert "directions of their own" in command("form", "net", "--law", "cable", "--density", "5", code=2).stderr
    command("form", "net", "--density", "5", code=2)


def test_drawn_densities_need_a_prestress_of_each_link(tmp_path):
    (tmp_path / "nodes.csv").write_text("node,x,y,fix\na,0,0,xy\nb,1,0,\nc,2,0,xy\nd,1,1,xy\n")
    (tmp_path / "members.csv").write_text("member,start,end,law,EA,prestress\n1,a,b,bar,1e3,\n2,b,c,bar,1e3,\n"
                                          "3,b,d,cable,1e3,5\n")  # fmt: skip
    said = "2 links have no prestress (law bar), the first is 1; give --prestress"
    assert said in command("form", tmp_path, "--density", "drawn", code=2).stderr
    command("form", tmp_path, "--density", "drawn", "--prestress", "7")


def test_command_takes_densities_by_group(tmp_path):
    """That of a layer comes before that of its law, and that before one for all, in any order."""
    given = ("--density", "edges=20e3", "--density", "CABLE=2000", "--density", "7")
    command("form", CANOPY, *given, "--csv", tmp_path / "members.csv", tmp_path / "nodes.csv")
    scene = latinpc.read(tmp_path)
    edges = scene.numbering.link_groups == "edges"
    assert edges.any() and set(scene.numbering.link_groups) == {"edges", "net"}
    assert scene.prestress / scene.lengths == pytest.approx(np.where(edges, 20e3, 2e3), rel=1e-9)


def test_the_only_group_and_one_with_the_name_of_a_law_have_densities(tmp_path):
    """Where a drawing has a group `cable`, this is meant, not the law; a group of all links is in the tables too."""
    (tmp_path / "nodes.csv").write_text("node,x,y,fix\nA,0,0,xy\nB,1,0,\nC,2,1,xy\n")
    head = "start,end,law,EA,group\n"
    for groups, given, exact in (
        (("bar", "cable"), ("7", "cable=100"), [7.0, 100.0]),
        (("wire", "wire"), ("7", "wire=50"), [50.0, 50.0]),
    ):
        rows = "".join(f"{ends},cable,1e5,{group}\n" for ends, group in zip(("A,B", "B,C"), groups))
        (tmp_path / "members.csv").write_text(head + rows)
        words = [word for text in given for word in ("--density", text)]
        command("form", tmp_path, *words, "--csv", tmp_path / "f-members.csv", tmp_path / "f-nodes.csv")
        scene = latinpc.read(tmp_path / "f-nodes.csv", support="x=min")
        assert scene.prestress / scene.lengths == pytest.approx(exact, rel=1e-9)
        assert tuple(scene.numbering.link_groups) == groups


def test_densities_of_groups_that_share_links_are_refused(tmp_path):
    """Which of them holds is not said; equal ones may be, and that of a law gives way."""
    (tmp_path / "nodes.csv").write_text("node,x,y,fix\nA,0,0,xy\nB,1,0,\nC,2,1,xy\n")
    (tmp_path / "members.csv").write_text(
        "start,end,law,EA,group\nA,B,cable,1e5,rim\nB,C,cable,1e5,rim; tie\nA,C,cable,1e5,\n"
    )
    words = "form", tmp_path, "--density", "cable=7", "--density", "rim=100", "--density"
    said = "--density rim=100 and --density tie=200: link 2 is of both groups"
    assert said in command(*words, "tie=200", code=2).stderr
    command(*words, "tie=100")


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


def test_what_is_given_per_metre_acts_over_the_lengths_of_the_form(tmp_path):
    """A line drawn with a detour to a point far away; natural lengths keep what they were cut with."""
    (tmp_path / "nodes.csv").write_text("node,x,y,fix,mass\nA,0,0,xy,\nB,4,50,,1.5\nC,8,0,xy,\n")
    (tmp_path / "members.csv").write_text("start,end,law,EA,group\nA,B,cable,1e6,rope\nB,C,cable,1e6,rope\n")
    (tmp_path / "rope.toml").write_text(
        "dim = 2\n[masses.rope]\nline = 3.0\n[loads.B]\nwhere = 'x=4'\nforce = [0, -7]\n"
    )
    words = tmp_path, "--self-weight", 30, "--csv", tmp_path / "f-members.csv", tmp_path / "f-nodes.csv"
    command("form", *words, "--density", 100)
    found = latinpc.read(tmp_path / "f-nodes.csv")
    length = found.lengths[0]
    assert found.mass == pytest.approx([1.5 * length, 1.5 + 3.0 * length, 1.5 * length], rel=1e-8)
    assert found.load[1] == pytest.approx([0.0, -7.0 - 30.0 * length], rel=1e-8)
    assert found.nodes[1] == pytest.approx([4.0, found.load[1, 1] / 200.0], rel=1e-8)
    command("form", *words, "--density", 100, "--without-load")
    found = latinpc.read(tmp_path / "f-nodes.csv")
    assert found.mass == pytest.approx([6.0, 13.5, 6.0]) and not found.load.any()
    command("form", *words, "--natural")
    drawn = latinpc.read(tmp_path, self_weight=30.0)
    assert latinpc.read(tmp_path / "f-nodes.csv").mass == pytest.approx(drawn.mass)
    assert command("form", *words, "--density", 10, code=2).stderr.split(": ")[1:] == [
        "loads per metre lengthen the form, and grow with it, without end", "give larger densities\n"
    ]  # fmt: skip


def test_a_heavy_chain_whose_loads_grow_at_first_has_a_form(tmp_path):
    """Of 20 links, 1.5 times as deep as its span: what pulls at each node is the weight of two halves."""
    nodes = "".join(f"{5 * k},0,{'xy' if k in (0, 20) else ''}\n" for k in range(21))
    (tmp_path / "nodes.csv").write_text("x,y,fix\n" + nodes)
    links = "".join(f"{k},{k + 1},cable,1e9\n" for k in range(1, 21))
    (tmp_path / "members.csv").write_text("start,end,law,EA\n" + links)
    (tmp_path / "chain.toml").write_text("dim = 2\n")
    (tmp_path / "found").mkdir()
    tables = tmp_path / "found" / "members.csv", tmp_path / "found" / "nodes.csv"
    command("form", tmp_path, "--density", 100, "--self-weight", 30, "--csv", *tables)
    found = latinpc.read(tmp_path / "found")
    steps = np.diff(found.nodes[:, 1])
    assert found.nodes[:, 1].min() < -150.0
    assert 100.0 * np.diff(steps) == pytest.approx(15.0 * (found.lengths[1:] + found.lengths[:-1]), rel=1e-6)


def test_self_weight_within_a_flat_drawing_is_noted(tmp_path):
    """A plan, drawn with z = 0 everywhere, is 2D, where weights act along y."""
    (tmp_path / "nodes.csv").write_text("node,x,y,z,fix\nA,0,0,0,xyz\nB,1,0,0,\nC,2,0,0,xyz\nD,1,1,0,xyz\n")
    (tmp_path / "members.csv").write_text("start,end,law,EA\nA,B,cable,1e5\nB,C,cable,1e5\nB,D,cable,1e5\n")
    said = "self-weight acts along -y, within the structure; for a plan, which it acts across, write dim = 3 in"
    words = tmp_path, "--self-weight", 5
    assert said in " ".join(command("form", *words, "--density", 100).stdout.split())
    assert latinpc.read(tmp_path, self_weight=5.0).metadata["notes"][0].startswith(said)
    (tmp_path / "plan.toml").write_text("dim = 3\n")
    assert not latinpc.read(tmp_path, self_weight=5.0).metadata["notes"]


def test_nodes_that_no_natural_length_holds_have_the_names_of_the_file(tmp_path):
    """A strut of two bars whose knee nothing holds, and a node that slack cables leave."""
    (tmp_path / "nodes.csv").write_text("node,x,y,fix,Fy\nfoot,0,0,xy,\nknee,0,1,,-5\nhead,0,2,x,-1\n")
    (tmp_path / "members.csv").write_text("start,end,law,EA\nfoot,knee,bar,1e3\nknee,head,bar,1e3\n")
    assert "nodes that move: knee." in command("form", tmp_path, "--natural", code=2).stderr
    numbered = {"foot": "10", "knee": "20", "head": "30"}
    for file in tmp_path.glob("*.csv"):
        text = file.read_text()
        for name, number in numbered.items():
            text = text.replace(name, number)
        file.write_text(text)
    assert "nodes that move: 20." in command("form", tmp_path, "--natural", code=2).stderr
