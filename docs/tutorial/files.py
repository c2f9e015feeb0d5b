"""Write the files that the tutorial reads: a dome in four formats, and a guyed mast.

python docs/tutorial/files.py
"""

import csv
import json
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent


def dome():
    """Return points (m) and lines of a dome of 12 m: a crown, two rings of six, and the bars between them."""
    around = np.radians(60 * np.arange(6))
    points = [(0.0, 0.0, 2.4)]
    points += [(3.2 * np.cos(a), 3.2 * np.sin(a), 1.7) for a in around]
    points += [(6.0 * np.cos(a), 6.0 * np.sin(a), 0.0) for a in around]
    lines = [(0, 1 + k) for k in range(6)] + [(1 + k, 1 + (k + 1) % 6) for k in range(6)]
    lines += [(1 + k, 7 + k) for k in range(6)] + [(1 + k, 7 + (k + 1) % 6) for k in range(6)]
    return np.round(points, 3), lines


def write_dome():
    """Write the dome as DXF (in mm), OBJ, CSV tables and a network of compas."""
    points, lines = dome()
    pairs = [(0, "SECTION"), (2, "ENTITIES")]
    for a, b in lines:
        pairs += [(0, "LINE"), (8, "bars")]
        for code, x in zip((10, 20, 30, 11, 21, 31), 1000 * np.concatenate([points[a], points[b]])):
            pairs.append((code, f"{x:g}"))
    pairs += [(0, "ENDSEC"), (0, "EOF")]
    (HERE / "dome.dxf").write_text("".join(f"{code}\n{value}\n" for code, value in pairs))
    text = [f"v {x:g} {y:g} {z:g}" for x, y, z in points] + ["g bars"] + [f"l {a + 1} {b + 1}" for a, b in lines]
    (HERE / "dome.obj").write_text("\n".join(text) + "\n")
    write_table("dome/nodes.csv", "node,x [m],y [m],z [m],fix,Fz [kN]", (
        (k, *point, "xyz" if k > 6 else "", "" if k > 6 else -5) for k, point in enumerate(points)
    ))  # fmt: skip
    write_table("dome/members.csv", "start,end,law,EA [kN]", ((a, b, "bar", 80000) for a, b in lines))
    node = {str(k): {"x": x, "y": y, "z": z, "is_support": k > 6} for k, (x, y, z) in enumerate(points.tolist())}
    edge = {str(k): {} for k in range(len(points))}
    for a, b in lines:
        edge[str(a)][str(b)] = {}
    data = {"attributes": {}, "default_node_attributes": {"x": 0.0, "y": 0.0, "z": 0.0}, "node": node, "edge": edge}
    (HERE / "dome.json").write_text(json.dumps({"dtype": "compas.datastructures/Graph", "data": data}) + "\n")


def write_mast():
    """Write a lattice mast of 40 m, three legs, guyed at half height and at the top."""
    triangle = np.column_stack([f(np.radians([90, 210, 330])) for f in (np.cos, np.sin)])
    nodes = [(f"{bay}{leg}", *np.round(0.6 * p, 3), 2 * bay, "xyz" if bay == 0 else "", "shaft")
             for bay in range(21) for leg, p in zip("abc", triangle)]  # fmt: skip
    nodes += [(f"anchor {leg}", *np.round(25 * p, 3), 0, "xyz", "anchors") for leg, p in zip("abc", triangle)]
    members = []
    for bay in range(20):
        for leg, following in zip("abc", "bca"):
            members.append((f"{bay}{leg}", f"{bay + 1}{leg}", "bar", 200000, "", "legs"))
            members.append((f"{bay}{leg}", f"{bay + 1}{following}", "bar", 100000, "", "bracing"))
            members.append((f"{bay + 1}{leg}", f"{bay + 1}{following}", "bar", 100000, "", "bracing"))
    members += [(f"{bay}{leg}", f"anchor {leg}", "cable", 20000, 15, "guys") for bay in (10, 20) for leg in "abc"]
    write_table("mast/nodes.csv", "node,x [m],y [m],z [m],fix,group", nodes)
    write_table("mast/members.csv", "start,end,law,EA [kN],prestress [kN],group", members)


def write_table(name, header, rows):
    """Write a CSV file."""
    path = HERE / name
    path.parent.mkdir(exist_ok=True)
    with path.open("w", newline="") as file:
        file.write(header + "\n")
        csv.writer(file, lineterminator="\n").writerows(rows)


if __name__ == "__main__":
    write_dome()
    write_mast()
