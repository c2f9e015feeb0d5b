"""OpenSees beside SNES latin on random structures of ``latinpc extremes --family large``, by the judge of that family.

pip install openseespy                        (the extra `bench`)
python benchmarks/opensees.py                 writes results/opensees.json and the table of opensees.md

Each structure is one of corotTruss elements: cables are Elastic materials without stiffness in compression, with the
initial strain of their prestress. Loads grow in equal increments by Newton's method, with a line search, or accelerated
(Krylov), until unbalanced forces are below 1e-9 of the loads, as for SNES latin. --python NAME: an interpreter
that has openseespy and numpy.
"""

import argparse
import contextlib
import json
import subprocess
import sys
import tempfile
import warnings
from collections import Counter
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
SEED, COUNT = 7, 50
BALANCE = 1e-9  # of the loads
STEPS = 100  # of Newton's method in an increment
TIMEOUT = 120  # s, for a structure
#: Name, number of increments, algorithm
WAYS = [
    ("Newton, all loads at once", 1, ["Newton"]),
    ("Newton, 10 increments", 10, ["Newton"]),
    ("Newton, 100 increments", 100, ["Newton"]),
    ("Newton with line search, 10 increments", 10, ["NewtonLineSearch"]),
    ("KrylovNewton, 10 increments", 10, ["KrylovNewton"]),
    ("KrylovNewton, 100 increments", 100, ["KrylovNewton"]),
]


def opensees(arrays, increments, algorithm):
    """Solve; return whether all increments have converged, the displacements (n, 3) and the number of iterations."""
    import openseespy.opensees as ops

    nodes, links, fixed, load = arrays["nodes"], arrays["links"], arrays["fixed"], arrays["load"]
    ops.wipe()
    ops.model("basic", "-ndm", 3, "-ndf", 3)
    for node, (x, held) in enumerate(zip(nodes, fixed), 1):
        ops.node(node, *map(float, x))
        ops.fix(node, *map(int, held))
    length = np.linalg.norm(nodes[links[:, 1]] - nodes[links[:, 0]], axis=1)
    for m, (ends, cable) in enumerate(zip(links, arrays["cable"]), 1):
        modulus, strain = arrays["stiffness"][m - 1] * length[m - 1], arrays["elongation"][m - 1] / length[m - 1]
        ops.uniaxialMaterial("Elastic", 2 * m, float(modulus), 0.0, 0.0 if cable else float(modulus))
        ops.uniaxialMaterial("InitStrainMaterial", 2 * m + 1, 2 * m, float(strain))
        ops.element("corotTruss", m, *(int(end) + 1 for end in ends), 1.0, 2 * m + 1)
    ops.timeSeries("Linear", 1)
    ops.pattern("Plain", 1, 1)
    for node, force in enumerate(load, 1):
        ops.load(node, *map(float, force))
    ops.constraints("Plain")
    ops.numberer("RCM")
    ops.system("UmfPack")
    ops.test("NormUnbalance", BALANCE * float(np.linalg.norm(load)), STEPS, 0)
    ops.algorithm(*algorithm)
    ops.integrator("LoadControl", 1.0 / increments)
    ops.analysis("Static")
    iterations, done = 0, True
    for _ in range(increments):
        done = ops.analyze(1) == 0
        iterations += ops.testIter()
        if not done:
            break
    return done, np.array([ops.nodeDisp(node) for node in range(1, len(nodes) + 1)]), iterations


def child(folder):
    """Solve what the folder holds, in all ways; a process of its own, without latinpc."""
    arrays = dict(np.load(Path(folder) / "structure.npz"))
    found = []
    for name, increments, algorithm in WAYS:
        done, u, iterations = opensees(arrays, increments, algorithm)
        found.append({"way": name, "done": bool(done), "u": u.tolist(), "iterations": int(iterations)})
        (Path(folder) / "found.json").write_text(json.dumps(found))


def by_opensees(python, scene):
    """Run OpenSees on a scene; return what it has found, as far as it came."""
    from latinpc.scenes import Law

    with tempfile.TemporaryDirectory() as folder:
        np.savez(
            Path(folder) / "structure.npz", nodes=scene.nodes, links=scene.links, fixed=scene.fixed, load=scene.load,
            cable=scene.law == Law.CABLE, stiffness=scene.stiffness, elongation=scene.initial_elongation,
        )  # fmt: skip
        command = [python, str(HERE / "opensees.py"), "--child", folder]
        with contextlib.suppress(subprocess.TimeoutExpired):
            subprocess.run(command, timeout=TIMEOUT, capture_output=True, check=False)
        file = Path(folder) / "found.json"
        return json.loads(file.read_text()) if file.exists() else []


def measure(python):
    """Return a row for each way, and one for SNES latin: verdicts and iterations of each structure."""
    from latinpc.bench.extremes import drawn, turning
    from latinpc.bench.extremes.rating import judge

    rows = {name: [] for name in ("SNES latin", *(name for name, *_ in WAYS))}
    number = 0
    while len(rows["SNES latin"]) < COUNT:
        one = drawn.draw(SEED, number, "large")
        number += 1
        if turning.Corotational(one.scene).follow().factor < 1.0:  # no equilibrium to find
            continue
        ours = judge(one, {})
        rows["SNES latin"].append([one.topology, ours["verdict"], ours["iterations"]])
        found = {each["way"]: each for each in by_opensees(python, one.scene)}
        for name, *_ in WAYS:
            each = found.get(name, {"done": False, "iterations": 0})
            verdict = turning.judge(one.scene, np.array(each["u"]))["verdict"] if each["done"] else "not found"
            rows[name].append([one.topology, verdict, each["iterations"]])
        print(number, one.topology, {name: row[-1][1] for name, row in rows.items()}, flush=True)
    return rows


def table(rows):
    """Lines of the table of the page."""
    kinds = sorted({one[0] for one in rows["SNES latin"]})
    yield "| | right | elsewhere | wrong | not found | median iterations | " + " | ".join(kinds) + " |"
    yield "| --- " * (6 + len(kinds)) + "|"
    for name, row in rows.items():
        counts = Counter("not found" if verdict == "unsolved" else verdict for _, verdict, _ in row)
        right = [iterations for _, verdict, iterations in row if verdict == "right"]
        cells = [counts[verdict] for verdict in ("right", "elsewhere", "wrong", "not found")]
        cells.append(f"{np.median(right):g}" if right else "-")
        for kind in kinds:
            mine = [verdict for topology, verdict, _ in row if topology == kind]
            cells.append(f"{mine.count('right')} of {len(mine)}")
        yield f"| {name} | " + " | ".join(map(str, cells)) + " |"


def main():
    """Measure, and write the results and the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--python", default=sys.executable)
    parser.add_argument("--child")
    given = parser.parse_args()
    if given.child:
        child(given.child)
        return
    warnings.simplefilter("ignore")
    rows = measure(given.python)
    (HERE / "results" / "opensees.json").write_text(json.dumps({"seed": SEED, "rows": rows}) + "\n")
    page = HERE / "opensees.md"
    before, _, rest = page.read_text().partition("<!-- rows -->\n")
    page.write_text("\n".join([before + "<!-- rows -->", *table(rows), rest[rest.index("<!-- end -->") :]]))


if __name__ == "__main__":
    main()
