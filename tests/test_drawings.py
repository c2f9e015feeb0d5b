"""Drawings: points merged, grids raised and braced, nodes chosen by conditions, edges of faces."""

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import latinpc
from latinpc.files.lines import Lines, near_points
from latinpc.files.selection import select
from latinpc.runs.solve import solve
from latinpc.scenes.scene import Law


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


@pytest.mark.parametrize("corner", [(0.0, 0.0), (3.5e6, 5.4e6)])
def test_a_forgotten_point_far_away_merges_nothing_and_neighbours_have_names_apart(corner, tmp_path):
    """At the coordinates of a map, with a point at the origin."""
    ezdxf = pytest.importorskip("ezdxf")
    document, (x, y) = ezdxf.new(), corner
    for a, b in pairwise([0.0, 1.0, 2.0, 2.01]):
        document.modelspace().add_line((x + a, y), (x + b, y + 1.0), dxfattribs={"layer": "a"})
        document.modelspace().add_line((x + b, y + 1.0), (x + b, y), dxfattribs={"layer": "a"})
    document.modelspace().add_point((0.0, 0.0, 50.0))
    document.saveas(tmp_path / "map.dxf")
    scene = latinpc.read(tmp_path / "map.dxf", EA=1.0, support=f"y<={y + 0.5}")
    assert (len(scene.nodes), len(scene.links)) == (7, 6)
    assert len({scene.node_name(node) for node in range(7)}) == 7
    assert any("1 node that no link touches left out" in note for note in scene.metadata["notes"])
    names = {0.0: "(2.01, 1)", 3.5e6: "(3500002.01, 5400001)"}
    assert names[x] in map(scene.node_name, range(7))


def test_lines_of_a_merged_table_keep_their_number(tmp_path):
    """Two members side by side are two links: only a drawing draws a line twice."""
    (tmp_path / "nodes.csv").write_text("x,fix,Fx\n0,x,\n2,,1\n2.001,,2\n")
    (tmp_path / "members.csv").write_text("start,end,EA\n1,2,1\n1,3,1\n1,3,1\n")
    scene = latinpc.read(tmp_path, merge=0.01)
    assert len(scene.links) == 3 and scene.load.ravel().tolist() == [0, 3]
    assert scene.metadata["notes"] == ["1 point merged"]


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


def test_envelopes_give_a_place_once():
    """Links of DXF drawings are named by their places."""
    pytest.importorskip("ezdxf")
    drawing = Path(__file__).parents[1] / "docs" / "tutorial" / "dome.dxf"
    dome = latinpc.read(drawing, scale=0.001, EA=8e7, support="z=min", load="z=-5e3:z>0")
    text = repr(latinpc.solve_cases(dome, [latinpc.Case("dead"), latinpc.Case("again")]))
    for line in text.splitlines():
        if line.startswith(("highest", "lowest")):
            assert line.count("(") == 2 and " to " not in line and line.endswith(" m")


def test_forms_and_results_are_drawn_again(tmp_path):
    """Nodes where they are, layers of groups or laws, slack links apart; what is read again is the same."""
    ezdxf = pytest.importorskip("ezdxf")
    (tmp_path / "nodes.csv").write_text("node,x,y,z,fix\nA,0,0,2,xyz\nB,6,0,0,xyz\nC,3,6,1,xyz\nmid,3,2,1,\n")
    rows = "A,mid,cable,1e4,main; net\nB,mid,cable,1e4,a/b\nC,mid,cable,1e4,\nA,B,bar,1e4,MAIN\n"
    (tmp_path / "members.csv").write_text("start,end,law,EA,group\n" + rows)
    scene = latinpc.read(tmp_path, prestress=100.0, load="z=-10", geometry="large")

    def drawn(file, layers, nodes):
        document = ezdxf.readfile(tmp_path / file)
        lines = list(document.modelspace())
        assert document.units == ezdxf.units.M
        assert [line.dxf.layer for line in lines] == layers
        ends = np.array([[line.dxf.start, line.dxf.end] for line in lines])
        assert ends == pytest.approx(nodes[scene.links], rel=1e-12)

    result = scene.solve()
    result.to_dxf(tmp_path / "loaded.dxf")
    drawn("loaded.dxf", ["main", "a_b", "cable", "MAIN"], scene.nodes + result.displacements)
    again = latinpc.read(tmp_path / "loaded.dxf", EA=1e4, support="all", geometry="large")
    assert len(again.nodes) == 4 and len(again.links) == 4
    scene.initial_elongation[2] = -10.0  # longer than mid can be away from C
    result = scene.solve()
    result.to_dxf(tmp_path / "slack.dxf")
    drawn("slack.dxf", ["main", "a_b", "cable slack", "MAIN"], scene.nodes + result.displacements)
    form = latinpc.form_find(scene.nodes, scene.links, scene.fixed, [1.0, 1.0, 1.0, 0.0])
    form.to_dxf(tmp_path / "form.dxf")
    drawn("form.dxf", ["cable", "cable", "cable", "cable slack"], form.nodes)
