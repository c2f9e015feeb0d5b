"""The geometry in files: TOML, corotTruss elements, what does not turn, saved scenes."""

import json

import numpy as np
import pytest
from test_cli import latinpc as command
from test_cli import said

import latinpc
from latinpc.bench.extremes.corotational import Corotational
from latinpc.files.npz import load_scene, save_scene
from latinpc.scenes import make

OBJ = "v 0 0 1\nv 2 0 0\nv 2 2 1\nv 0 2 0\nv 1 1 0.5\ng net\nl 1 5\nl 2 5\nl 3 5\nl 4 5\n"
TOML = """
[laws.net]
law = "cable"
EA = 1e5
prestress = 1000.0
[supports.ends]
where = "x=min"
[supports.others]
where = "x=max"
[loads.middle]
box = [[1, 1, 0], [1, 1, 1]]
force = [0.0, 100.0, -500.0]
"""
TCL = """model BasicBuilder -ndm 2 -ndf 2
node 1 0 0
node 2 2 0
node 3 1 0.3
fix 1 1 1
fix 2 1 1
uniaxialMaterial Elastic 1 1e5
element corotTruss 1 1 3 1.0 1
element {} 2 2 3 1.0 1
timeSeries Linear 1
pattern Plain 1 1 {{
  load 3 0 -100
}}
"""


@pytest.fixture
def net(tmp_path):
    """Write a drawing and its TOML file, with a first line."""

    def write(line, text=TOML):
        (tmp_path / "net.obj").write_text(OBJ)
        (tmp_path / "net.toml").write_text(f"{line}\n{text}")
        return tmp_path / "net.obj"

    return write


def test_toml_says_the_geometry(net):
    """Of scene, structure and solution; by default links keep their direction."""
    assert latinpc.read(net("")).geometry == "linear"
    scene = latinpc.read(net('geometry = "large"'))
    assert scene.geometry == latinpc.Structure.from_scene(scene).geometry == "large"
    assert scene.prestress == pytest.approx(1000.0)
    result = scene.solve(error=1e-9)
    exact = Corotational(scene).follow().displacements
    assert np.linalg.norm(result.displacements - exact) < 1e-8 * np.linalg.norm(exact)


def test_python_and_the_option_come_before_the_file(net):
    file = net('geometry = "large"')
    assert latinpc.read(file, geometry="prestress").geometry == "prestress"
    assert "small displacements do not hold" not in command("solve", file).stderr
    flat = command("solve", file, "-snes_latin_geometry", "linear")
    assert flat.stdout != command("solve", file).stdout


def test_the_option_is_for_every_solver(net):
    options = ("--json", "-", "-snes_latin_geometry", "large")
    newton = json.loads(command("solve", net(""), *options, "-snes_type", "newtonls", "-snes_rtol", "1e-12").stdout)
    known = json.loads(command("solve", net(""), *options, "-snes_latin_error", "1e-10").stdout)
    forces = [np.array(found["reactions"]["forces"]) for found in (newton, known)]
    assert forces[0] == pytest.approx(forces[1], rel=1e-6, abs=1e-6)
    wrong = command("solve", net(""), "-snes_latin_geometry", "larg", code=2)
    assert "-snes_latin_geometry larg: geometry must be one of linear, prestress, large" in wrong.stderr


@pytest.mark.parametrize(
    ("line", "old", "new", "words"),
    [
        ('geometry = "larg"', "", "", "net.toml: geometry = 'larg'; use linear, prestress, large"),
        ("geometry = 3", "", "", "net.toml: geometry = 3; use linear, prestress, large"),
        ('geometri = "large"', "", "", "unknown key 'geometri'; do you mean 'geometry'?"),
        (
            'geometry = "prestress"',
            '"cable"\nEA = 1e5\nprestress = 1000.0',
            '"inextensible"',
            "net.toml: [laws.net]: the law inextensible does not turn with displacements",
        ),
        (
            'geometry = "large"',
            '"cable"\nEA = 1e5\nprestress = 1000.0',
            '"friction"\ncoefficient = 0.5\nnormal = [0.0, 0.0, 1.0]',
            "net.toml: [laws.net]: the law friction does not turn with displacements",
        ),
        (
            'geometry = "prestress"',
            '"cable"\nEA = 1e5\nprestress = 1000.0',
            '"contact"\nnormal = [0.0, 0.0, 1.0]',
            "net.toml: [laws.net]: a link with a normal of its own does not turn",
        ),
    ],
)
def test_mistakes_are_named(net, line, old, new, words):
    assert words.split("; do")[0] in said(command("solve", net(line, TOML.replace(old, new)), code=2))[0]


def test_inextensible_cables_hang(net):
    """A node on four cables a tenth longer than drawn: none is longer than that, and taut ones bear the load."""
    text = TOML.replace('"cable"\nEA = 1e5\nprestress = 1000.0', '"inextensible"\nstrain = -0.1')
    path = net('geometry = "large"', text)
    scene = latinpc.read(path)
    result = scene.solve(error=1e-10)
    moved = scene.nodes + result.displacements
    r = np.diff(moved[scene.links], axis=1)[:, 0]
    size, natural = (
        np.linalg.norm(r, axis=1),
        1.1 * np.linalg.norm(np.diff(scene.nodes[scene.links], axis=1)[:, 0], axis=1),
    )
    t = result.tensions
    assert (size - natural).max() < 1e-9 and t.min() >= 0.0
    assert np.abs(t * (size - natural)).max() < 1e-9 * t.max()
    free = ~scene.fixed.any(axis=1)
    force = sum(
        np.where(scene.links[:, [end]] == np.flatnonzero(free), t[:, None], 0.0).T @ (sign * r / size[:, None])
        for end, sign in ((0, 1.0), (1, -1.0))
    )
    assert np.abs(force + scene.load[free]).max() < 1e-8 * t.max()
    assert "converged" in command("solve", path).stdout


def test_a_wrong_argument_is_named(net):
    with pytest.raises(ValueError, match="geometry = 'big'; use linear, prestress, large"):
        latinpc.read(net(""), geometry="big")


def test_scripts_of_corotational_trusses_are_of_large_displacements(tmp_path):
    """Where all elements are; beside other trusses the summary says that they are not."""
    file = tmp_path / "truss.tcl"
    file.write_text(TCL.format("corotTruss"))
    scene = latinpc.read(file)
    assert scene.geometry == "large" and not scene.metadata["notes"]
    exact = Corotational(scene).follow().displacements
    assert np.linalg.norm(scene.solve(error=1e-9).displacements - exact) < 1e-8 * np.linalg.norm(exact)
    file.write_text(TCL.format("truss"))
    scene = latinpc.read(file)
    assert scene.geometry == "linear" and "truss beside corotTruss" in scene.metadata["notes"][0]


def test_saved_scenes_keep_it(tmp_path):
    for name, options in (("tower", {"stages": 1}), ("lattice", {"nx": 12, "ny": 8})):
        scene = make(name, **options)
        save_scene(tmp_path / "scene.npz", scene)
        assert load_scene(tmp_path / "scene.npz").geometry == scene.geometry
        assert (b"geometry" in (tmp_path / "scene.npz").read_bytes()) == (name == "tower")
