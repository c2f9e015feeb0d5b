"""Drawings whose lines miss each other by a little, and drawings without a unit."""

from dataclasses import replace

import pytest
from command import latinpc as command
from two_bars import write_dxf

import latinpc
from latinpc.errors import MAT_CH_ZRPVT
from latinpc.files.misses import near_misses
from latinpc.runs.solve import solve

ROOF = "v 0 0 0\nv 8 0 0\nv 4 3 0\nv 4 0 0\nl 1 3\nl 3 2\nl 4 3\n"
DRAWINGS = {
    "v 4.002 0 0\nl 1 4\nl 5 2\n": "node 5 is 0.002 m from node 4: if they are one, give --merge 0.003",
    "l 1 2\n": "node 4 lies on the line 1-2, which it does not join: split the line there",
    "l 1 4\nl 4 2\n": None,
}


@pytest.mark.parametrize("more", DRAWINGS)
def test_ends_that_miss_each_other_are_named(more, tmp_path):
    (tmp_path / "roof.obj").write_text(ROOF + more)
    scene = latinpc.read(tmp_path / "roof.obj", EA=1e6, support=["x=min", "x=max"])
    assert near_misses(scene) == ([DRAWINGS[more]] if DRAWINGS[more] else [])


def test_a_plane_frame_in_space_is_named(tmp_path):
    """Of a table without a column z, loads Fz make a structure in 3D."""
    (tmp_path / "nodes.csv").write_text("node,x,y,fix,Fz\na,0,0,xy,\nb,8,0,xy,\nc,4,3,,-1\n")
    (tmp_path / "members.csv").write_text("start,end,EA\na,c,1e6\nb,c,1e6\n")
    lines = command("solve", tmp_path, code=2).stderr.splitlines()
    said = "lies in a plane of constant z: for forces within the plane give --support all:z"
    assert lines[0] == f"latinpc: the structure has loads along z, but {said}" and "mechanism" in lines[1]
    (tmp_path / "nodes.csv").write_text("node,x,y,z,fix,Fy\na,0,0,0,xy,\nb,8,0,0,xy,\nc,4,3,0,,-1\n")
    (tmp_path / "tmp.toml").write_text("dim = 3\n")
    flat = latinpc.read(tmp_path, tmp_path / "tmp.toml")
    assert near_misses(flat) == [f"the structure {said}"]
    assert near_misses(latinpc.read(tmp_path, tmp_path / "tmp.toml", support="all:z")) == []


@pytest.mark.parametrize("words", [("solve",), ("modes", "--node-mass", 1.0)])
def test_a_mechanism_of_a_drawing_names_them(words, tmp_path):
    more, said = next(iter(DRAWINGS.items()))
    (tmp_path / "roof.obj").write_text(ROOF + more)
    options = ("--EA", 1e6, "--support", "x=min", "--support", "x=max")
    lines = command(*words, tmp_path / "roof.obj", *options, code=2).stderr.splitlines()
    assert lines[0] == f"latinpc: {said}" and "mechanism" in lines[1]
    assert command("solve", tmp_path / "roof.obj", *options, "--merge", 0.003).stdout


@pytest.mark.parametrize("ask", [lambda roof: roof.solve(), latinpc.solve_cases, solve])
def test_the_error_of_a_mechanism_has_its_code(ask, tmp_path):
    (tmp_path / "roof.obj").write_text(ROOF + next(iter(DRAWINGS)))
    roof = latinpc.read(tmp_path / "roof.obj", EA=1e6, support=["x=min", "x=max"])
    with pytest.raises(latinpc.SolveError) as refused:
        ask(replace(roof, cases=[latinpc.Case("none")]))
    assert refused.value.ierr == MAT_CH_ZRPVT


def test_a_drawing_without_a_unit_says_so(tmp_path):
    given = {"EA": 1.0, "support": "feet"}
    said = "the drawing has no unit: coordinates are taken as m (--scale)"
    write_dxf(tmp_path / "a.dxf")
    assert said in latinpc.read(tmp_path / "a.dxf", **given).metadata["notes"]
    assert said not in latinpc.read(tmp_path / "a.dxf", scale=1.0, **given).metadata["notes"]
    write_dxf(tmp_path / "b.dxf", 1e-3)
    assert said not in latinpc.read(tmp_path / "b.dxf", **given).metadata["notes"]
