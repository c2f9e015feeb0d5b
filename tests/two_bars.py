"""One truss of two bars, written in every format that is read."""

import json

import pytest

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
