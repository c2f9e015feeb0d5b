"""Files: Gmsh pairs in, VTU out, and what is said when they are wrong."""

import subprocess
import sys
from dataclasses import replace

import meshio
import numpy as np
import pytest
from conftest import ROOT

import latinpc
from latinpc import Case
from latinpc.files.lines import Lines
from latinpc.files.npz import load_scene, save_scene
from latinpc.results.vtk import write_vtu
from latinpc.scenes import make
from latinpc.scenes.scene import Law, Scene

# A triangle of two bars and a cable, a free node above; MSH 2.2
MSH = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
4
0 1 "feet"
0 2 "top"
1 3 "bars"
1 4 "cable"
$EndPhysicalNames
$Nodes
4
10 0 0 0
20 3 0 0
30 3 4 0
40 9 9 0
$EndNodes
$Elements
6
1 15 2 1 1 10
2 15 2 1 2 20
3 15 2 2 3 30
4 1 2 3 1 10 30
5 1 2 3 2 20 30
6 1 2 4 3 10 20
$EndElements
"""
TOML = """
[laws.bars]
law = "bar"
EA = 100.0
[laws.cable]
law = "cable"
stiffness = 7.0
prestress = 14.0
[supports.feet]
fix = ["x", "y"]
displacement = [0.0, -0.01]
[loads.top]
force = [1.0, -2.0]
"""

# One curve in two physical groups, its two ends held; MSH 4.1
MSH_4 = """$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
3
0 3 "ends"
1 1 "chain"
1 2 "all"
$EndPhysicalNames
$Entities
2 1 0 0
1 0 0 0 1 3
2 2 0 0 1 3
1 0 0 0 2 0 0 2 1 2 2 1 -2
$EndEntities
$Nodes
3 3 1 3
0 1 0 1
1
0 0 0
0 2 0 1
2
2 0 0
1 1 0 1
3
1 0 0
$EndNodes
$Elements
3 4 1 4
0 1 15 1
1 1
0 2 15 1
2 2
1 1 1 2
3 1 3
4 3 2
$EndElements
"""


@pytest.fixture
def pair(tmp_path):
    """Write a pair of files, the mesh and the TOML with one text in place of another."""

    def write(msh=MSH, toml=TOML, old="", new=""):
        assert not old or (old in msh) != (old in toml), "the text to replace must be in one of the files"
        (tmp_path / "frame.msh").write_text(msh.replace(old, new) if old else msh)
        (tmp_path / "frame.toml").write_text(toml.replace(old, new) if old else toml)
        return tmp_path / "frame.msh"

    return write


def test_lines_without_a_number_go_by_the_nodes_of_the_file(pair):
    """Tags of Gmsh, which are not in a row."""
    lines = Lines("frame.msh", np.zeros((3, 3)), [[1, 2]], point_names=np.array([1, 205, 309]))
    assert lines.place(0) == "frame.msh: the line between nodes 205 and 309 of the file"
    lines = Lines("frame.dxf", [[0, 0, 0], [2, 0, 0], [2, 1, 0]], [[1, 2]], point_names=np.full(3, ""))
    assert lines.place(0) == "frame.dxf: the line between nodes (2, 0, 0) and (2, 1, 0) of the file"


def test_a_scene_on_disk_keeps_its_cases(tmp_path):
    scene = make("lattice", nx=4, ny=4)
    load, part = np.ones_like(scene.load), Case("part", initial_elongation=np.full(len(scene.links), 1e-3), part=True)
    save_scene(tmp_path / "scene.npz", replace(scene, cases=(Case("dead", load), part)))
    dead, part = load_scene(tmp_path / "scene.npz").cases
    assert (dead.name, dead.part, part.name, part.part) == ("dead", False, "part", True)
    assert np.array_equal(dead.load, load) and dead.prescribed is None and part.load is None
    assert (part.initial_elongation == 1e-3).all()


def test_a_pair_gives_the_scene(pair):
    scene = latinpc.read(pair())
    assert (scene.name, scene.dim) == ("frame", 2)
    assert scene.nodes.tolist() == [[0, 0], [3, 0], [3, 4]]  # the node without a link is left out
    assert scene.metadata["nodes_without_link"] == 1
    assert scene.links.tolist() == [[0, 2], [1, 2], [0, 1]]
    assert scene.law.tolist() == [Law.BAR, Law.BAR, Law.CABLE]
    assert scene.stiffness == pytest.approx([100 / 5, 100 / 4, 7])
    assert scene.initial_elongation == pytest.approx([0, 0, 2])  # 14 N over 7 N/m
    assert scene.fixed.tolist() == [[True, True], [True, True], [False, False]]
    assert scene.prescribed.tolist() == [[0, -0.01], [0, -0.01], [0, 0]]
    assert scene.load.tolist() == [[0, 0], [0, 0], [1, -2]]


@pytest.mark.parametrize(
    ("entry", "initial_elongation"),
    [("initial_elongation = 0.25", 0.25), ("strain = 0.1", 0.3), ("prestress = 7.0", 1.0)],
)
def test_initial_elongation_in_three_ways(pair, entry, initial_elongation):
    scene = latinpc.read(pair(old="prestress = 14.0", new=entry))
    assert scene.initial_elongation[2] == pytest.approx(initial_elongation)


def test_areas_and_strengths(pair):
    assert latinpc.read(pair()).area is None
    scene = latinpc.read(pair(old="EA = 100.0", new="EA = 100.0\narea = 2e-3\nstrength = 5e3"))
    assert scene.area[:2].tolist() == [2e-3, 2e-3] and scene.strength[:2].tolist() == [5e3, 5e3]
    assert np.isnan(scene.area[2]) and np.isnan(scene.strength[2])
    found = scene.solve()
    assert found.stress[:2] == pytest.approx(found.tensions[:2] / 2e-3) and np.isnan(found.stress[2])
    assert found.to_dict()["largest_utilisation"] == pytest.approx(np.abs(found.tensions[:2]).max() / 10)
    assert f"in link {scene.link_name(np.abs(found.tensions[:2]).argmax())}" in str(found)
    with pytest.raises(ValueError, match=r"laws.bars.: strength is a stress .* needs the area"):
        latinpc.read(pair(old="EA = 100.0", new="EA = 100.0\nstrength = 5e3"))
    with pytest.raises(ValueError, match=r"laws.bars.: area must be positive"):
        latinpc.read(pair(old="EA = 100.0", new="EA = 100.0\narea = 0.0"))


def test_dimension_told(pair):
    three = TOML.replace("[laws.bars]", "dim = 3\n[laws.bars]", 1).replace("-0.01]", "-0.01, 0.0]")
    three = three.replace("-2.0]", "-2.0, 0.0]").replace('["x", "y"]', '["x", "y", "z"]')
    assert latinpc.read(pair(toml=three)).dim == 3


def test_format_4_and_an_entity_in_two_groups(pair):
    toml = '[laws.chain]\nlaw = "bar"\nEA = 1.0\n[supports.ends]\n[loads.all]\nforce = [3.0]\n'
    scene = latinpc.read(pair(MSH_4, toml))
    assert scene.dim == 1  # a mesh along x
    assert scene.nodes.ravel().tolist() == [0, 2, 1]
    assert scene.fixed.ravel().tolist() == [True, True, False]
    assert scene.load.ravel().tolist() == [3, 3, 3]


def test_all_nodes_and_directions_in_a_word(pair):
    """As with --support: `all` where no group has that name, and the directions written together."""
    given = TOML.replace('["x", "y"]', '"yx"') + "[loads.all]\nforce = [0.5, 0.0]\n"
    found, usual = latinpc.read(pair(toml=given)), latinpc.read(pair())
    assert (found.fixed == usual.fixed).all() and found.fixed.any()
    assert (found.load == usual.load + [0.5, 0.0]).all()
    with pytest.raises(ValueError, match="fix must be a list out of .*, or a text such as 'xy', not 'xw'"):
        latinpc.read(pair(toml=TOML.replace('["x", "y"]', '"xw"')))


def test_boxes_hold_their_border(pair):
    toml = TOML + "[loads.right]\nbox = [[3.0, 0.0], [3.0, 4.0]]\nforce = [10.0, 0.0]\n"
    assert latinpc.read(pair(toml=toml)).load.tolist() == [[0, 0], [10, 0], [11, -2]]  # loads add up


CABLE = 'law = "cable"\nstiffness = 7.0\nprestress = 14.0'


def test_rigid_laws_ask_for_no_stiffness(pair):
    """Law inextensible with the search parameter left to the solver; a gap of a contact."""
    scene = latinpc.read(pair(old=CABLE, new='law = "inextensible"'))
    assert (scene.law[2], scene.stiffness[2], scene.initial_elongation[2]) == (Law.INEXTENSIBLE, 0.0, 0.0)
    scene = latinpc.read(pair(old=CABLE, new='law = "contact"\ngap = 0.02\nnormal = [0.0, 2.0]'))
    assert (scene.law[2], scene.initial_elongation[2]) == (Law.CONTACT, 0.02)
    assert scene.directions[2].tolist() == [0.0, 1.0]


def test_contact_with_friction_becomes_a_group(pair):
    """One line, two links in the plane: normal along the line and a tangent at right angles, which solve."""
    toml = TOML.replace(CABLE, 'law = "friction"\ncoefficient = 0.4\ngap = 0.01').replace('["x", "y"]', '["y"]')
    toml = toml.replace("[0.0, -0.01]", "[0.0, 0.0]") + '[supports.side]\nbox = [[0, 0], [0, 0]]\nfix = ["x"]\n'
    scene = latinpc.read(pair(toml=toml.replace("force = [1.0, -2.0]", "force = [0.0, 0.0]")))
    assert scene.law.tolist() == [Law.BAR, Law.BAR, Law.FRICTION, Law.TANGENT]
    assert scene.links[2].tolist() == scene.links[3].tolist()
    assert scene.initial_elongation[2:].tolist() == [0.01, 0.0]
    assert scene.friction[2] == 0.4
    assert abs(scene.directions[2] @ scene.directions[3]) < 1e-15
    latinpc.Structure.from_scene(scene)


def test_tables_go_with_the_scene(pair):
    """A piecewise linear law: its number in the scene, its points beside it, its tensions in the structure."""
    scene = latinpc.read(pair(old=CABLE, new='law = "table"\ntable = [[-1.0, 0.0], [0.0, 0.0], [1.0, 50.0]]'))
    assert scene.law[2] == len(Law)
    assert np.array(scene.tables).tolist() == [[[-1.0, 0.0, 1.0], [0.0, 0.0, 50.0]]]
    structure = latinpc.Structure.from_scene(scene)
    u = structure.create_vec()
    assert structure.tensions(u)[2] == 0.0


BAD = [
    (CABLE, 'law = "inextensible"\nEA = 3.0', ["laws.cable", "inextensible takes no EA"]),
    (CABLE, 'law = "inextensible"\ngap = 3.0', ["gap is of no use", "contact and friction"]),
    (CABLE, 'law = "contact"\nprestress = 3.0', ["takes no prestress"]),
    (CABLE, 'law = "cable"\nEA = 1e6\nprestress = -3.0', ["cable bears no prestress of -3 N", "initial_elongation"]),
    (CABLE, 'law = "compression_only"\nEA = 1e6\nprestress = 3.0', ["compression_only bears no prestress"]),
    (CABLE, 'law = "contact"\ncoefficient = 0.3', ["coefficient is of no use to the law contact"]),
    (CABLE, 'law = "friction"', ["needs its coefficient"]),
    (CABLE, 'law = "friction"\ncoefficient = -1', ["coefficient must not be negative"]),
    (
        "[loads.top]",
        "[velocities.top]\nvelocity = [1.0, 0.0]\n[velocities.all]\nvelocity = [0.0, 1.0]\n[loads.top]",
        ["[velocities.all]: velocity: a group above gives one of its nodes another value"],
    ),
    (CABLE, 'law = "friction"\ncoefficient = 0.1\nnormal = [0, 0]', ["normal has no length"]),
    (CABLE, 'law = "table"', ["table must be a list", "pairs"]),
    (CABLE, 'law = "table"\ntable = [[0, 0], [1, -1]]', ["tensions must not decrease"]),
    ("[laws.bars]", "[laws.beams]", ["laws.beams", "do you mean 'bars'", "frame.toml"]),
    ("[laws.cable]", "[law.cable]", ["unknown key 'law'", "do you mean 'laws'"]),
    ("EA = 100.0", "AE = 100.0", ["laws.bars", "unknown key 'AE'", "known: EA, area"]),
    ("EA = 100.0", "EA = -1.0", ["laws.bars", "EA must be positive"]),
    ("EA = 100.0", "EA = nan", ["EA must be a finite number"]),
    ("EA = 100.0", "EA = 1" + "0" * 400, ["EA must be a finite number"]),
    ("EA = 100.0", 'EA = "stiff"', ["EA must be a finite number"]),
    ("EA = 100.0", "", ["laws.bars", "no stiffness", "EA (N)"]),
    ("EA = 100.0", "EA = 100.0\nstiffness = 2.0", ["only one of EA, stiffness"]),
    ("stiffness = 7.0", "stiffness = 0.0", ["laws.cable", "must be positive"]),
    ("prestress = 14.0", "prestress = 14.0\nstrain = 0.1", ["only one of strain, prestress"]),
    ('law = "cable"', 'law = "rope"', ["laws.cable", "unknown law 'rope'", "bar, cable, compression_only"]),
    ('law = "cable"', "", ["laws.cable", "key 'law' is missing"]),
    ('[laws.cable]\nlaw = "cable"\nstiffness = 7.0\nprestress = 14.0', "", ["1 lines", "write [laws.cable]"]),
    ("[supports.feet]", "[supports.foot]", ["supports.foot", "do you mean 'feet'"]),
    ('fix = ["x", "y"]', 'fix = ["x", "w"]', ["supports.feet", "['x', 'y']"]),
    ('fix = ["x", "y"]', 'fix = ["x"]', ["displacement along y, which is not in fix"]),
    ("displacement = [0.0, -0.01]", "displacement = [0.0]", ["displacement must be a list of 2 numbers"]),
    ("force = [1.0, -2.0]", "force = 3.0", ["loads.top", "force must be a list of 2 numbers"]),
    ("force = [1.0, -2.0]", "", ["loads.top", "key 'force' is missing"]),
    ("[loads.top]", "[loads.top]\nbox = [[50.0, 50.0], [60.0, 60.0]]", ["holds no node"]),
    ("[loads.top]", "[loads.top]\nbox = [[5.0, 5.0], [0.0, 0.0]]", ["lower one"]),
    ("[laws.bars]", "dim = 1\n[laws.bars]", ["dim = 1", "coordinate y varies"]),
    ("[laws.bars]", "laws.bars", ["not a TOML file"]),
    ("force = [1.0, -2.0]", "force = [1.0, \u22122.0]", ["not a TOML file", "(at line", "(with U+2212, minus sign)"]),
    ("30 3 4 0", "30 0 0 0", ["zero length", "frame.msh", "Coherence"]),
    ("4 1 2 3 1 10 30", "4 2 2 3 1 10 20 30", ["'triangle'", "two-node 'line'"]),
    ("4 1 2 3 1 10 30", "4 8 2 3 1 10 20 30", ["'line3'", "ElementOrder = 1"]),
    ("4 1 2 3 1 10 30", "4 1 2 3 1 10 99", ["frame.msh"]),
    ("$MeshFormat\n2.2 0 8", "$Mash\n2.2 0 8", ["not readable as a Gmsh mesh"]),
]


@pytest.mark.parametrize(("old", "new", "words"), BAD)
def test_bad_pairs_name_the_culprit(pair, old, new, words):
    with pytest.raises(ValueError) as caught:
        latinpc.read(pair(old=old, new=new))
    for word in words:
        assert word in str(caught.value)


def test_nothing_held(pair):
    toml = TOML.replace('[supports.feet]\nfix = ["x", "y"]\ndisplacement = [0.0, -0.01]\n', "")
    with pytest.raises(ValueError, match="nothing is held"):
        latinpc.read(pair(toml=toml))


def test_missing_files(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"bridge\.msh: no such file"):
        latinpc.read(tmp_path / "bridge.msh")
    (tmp_path / "bridge.msh").write_text(MSH)
    with pytest.raises(FileNotFoundError, match=r"bridge\.toml: no such file; bridge\.msh needs it"):
        latinpc.read(tmp_path / "bridge.msh")


def test_no_line(pair):
    kept = [line for line in MSH.splitlines() if not line.startswith(("4 1 2", "5 1 2", "6 1 2"))]
    with pytest.raises(ValueError, match="holds no line"):
        latinpc.read(pair("\n".join(kept).replace("$Elements\n6", "$Elements\n3") + "\n"))


def test_examples_are_what_the_script_writes(tmp_path):
    subprocess.run([sys.executable, ROOT / "examples" / "make_meshes.py", tmp_path], check=True)
    for name, links, dim in (("footbridge", 438, 3), ("tower", 144, 2), ("canopy", 144, 3)):
        path = ROOT / "examples" / f"{name}.msh"
        assert (tmp_path / path.name).read_text() == path.read_text()
        scene = latinpc.read(path)
        assert (len(scene.links), scene.dim) == (links, dim)
        assert np.any(scene.load) == (name != "canopy")  # whose form is yet to be found


# ---- out -------------------------------------------------------------------------------------


@pytest.fixture
def chain():
    """Two cables and a strut in a row, in the plane."""
    return Scene(
        name="chain",
        nodes=np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0]]),
        links=np.array([[0, 1], [1, 2], [2, 3]]),
        law=np.array([Law.CABLE, Law.CABLE, Law.COMPRESSION_ONLY]),
        stiffness=np.array([1.0, 2.0, 4.0]),
    )


def test_vtu_comes_back(chain, tmp_path):
    u = np.array([[0.0, 0.0], [0.5, 0.1], [0.25, 0.0], [0.0, 0.0]])
    tension = np.array([0.5, 0.0, -1.0])
    write_vtu(tmp_path / "chain.vtu", chain, u, tension, np.array([0, 0, 1]), np.array([0, 0, 3, 0]))
    mesh = meshio.read(tmp_path / "chain.vtu")
    assert mesh.points[:, :2] == pytest.approx(chain.nodes)
    assert mesh.cells_dict["line"].tolist() == chain.links.tolist()
    assert mesh.point_data["displacement"] == pytest.approx(np.column_stack([u, np.zeros(4)]))
    assert mesh.point_data["interface_class"].tolist() == [0, 0, 3, 0]
    assert mesh.cell_data["tension"][0] == pytest.approx(tension)
    assert mesh.cell_data["elongation"][0] == pytest.approx([0.5, -0.25, -0.25])
    assert mesh.cell_data["slack"][0].tolist() == [0, 1, 0]
    assert mesh.cell_data["law"][0].tolist() == [1, 1, 2]
    assert mesh.cell_data["subdomain"][0].tolist() == [0, 0, 1]
    assert [path.name for path in tmp_path.iterdir()] == ["chain.vtu"]
