"""Nets and granulates: iterations against the number of subdomains, with and without coarse spaces; what helps.

python benchmarks/granular.py                  writes results/granular.json and the first two tables of granular.md
python benchmarks/granular.py chains           the default stop: with and without Newton's method
python benchmarks/granular.py moving           grains in motion: stages and milliseconds of a step
python benchmarks/granular.py large            a net of 1e5 cables and packings of 1e5 contacts: five minutes
python benchmarks/granular.py subdomains helps
"""

import json
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import numpy as np
import run
from petsc4py import PETSc

from latinpc import Structure
from latinpc.laws import RIGID, UNILATERAL
from latinpc.options import default_options
from latinpc.runs.solve import solve
from latinpc.scenes import make

#: The iteration alone: no other method takes over where it is slow.
ITERATION = {"snes_stol": 1e-4, "snes_max_it": 6000, "snes_latin_newton": "never"}
#: Scenes, and the numbers of subdomains that cut them.
CASES = {
    "net, inextensible": ("net", {"side": 48}, (1, 4, 9, 16, 36, 64, 144)),
    "discs, rigid": ("packing", {"side": 48}, (1, 4, 9, 16, 36, 64, 144)),
    "discs, elastic": ("packing", {"side": 48, "law": "elastic"}, (1, 4, 9, 16, 36, 64, 144)),
    "discs, friction": ("packing", {"side": 24, "law": "friction"}, (1, 4, 9, 16, 36)),
    "spheres, rigid": ("packing", {"dim": 3, "side": 14}, (1, 8, 27, 64)),
    "tensegrity, for comparison": ("tensegrity-grid", {"modules": 24}, (1, 4, 9, 16, 36, 64, 144)),
}
COARSE = {
    "default": {},
    "corners and rigid motions": {"modes": "rigid"},
    "affine fields alone": {"variant": "none"},
}
ANDERSON = "outer_snes_anderson_"
HELP = {
    "default": {},
    "no restart": {ANDERSON + "restart_type": "none"},
    "depth 5": {ANDERSON + "m": 5},
    "depth 30": {ANDERSON + "m": 30},
    "mixed with 0.5": {ANDERSON + "beta": 0.5},
    "plain, damped by 0.5": {
        "outer_snes_type": "nrichardson",
        "outer_snes_linesearch_type": "basic",
        "outer_snes_linesearch_damping": 0.5,
    },
    "direction diagonal": {"direction": "diagonal"},
    "direction / 4": {"direction_value": 0.25},
    "direction x 4": {"direction_value": 4.0},
    "search parameter / 4": 0.25,
    "search parameter / 2": 0.5,
    "search parameter x 2": 2.0,
    "search parameter x 4": 4.0,
}
#: Most grains of a motion
MOVING = 5000
SHAKEN = {
    "discs, friction, 100 a side": ("packing", {"side": 100, "law": "friction"}),
    "discs, much friction, 60 a side": ("packing", {"side": 60, "law": "friction", "friction": 0.9}),
}
#: Scenes at the default stop
CHAINS = {
    f"{kind}, {side} a side": ("packing", {"side": side, **options})
    for kind, options, sides in (
        ("discs, rigid", {}, (20, 40, 80, 160)),
        ("discs, elastic", {"law": "elastic"}, (20, 40, 80, 160)),
        ("discs, friction", {"law": "friction"}, (20, 40)),
        ("spheres, rigid", {"dim": 3}, (10, 20)),
        ("spheres, elastic", {"dim": 3, "law": "elastic"}, (10, 20)),
        ("spheres, friction", {"dim": 3, "law": "friction"}, (10, 16)),
    )
    for side in sides
} | {f"net, inextensible, {side} a side": ("net", {"side": side}) for side in (30, 120)}
WAYS = {"": {}, "alone, ": {"snes_latin_newton": "never"}}
LARGE = {
    "net, inextensible": ("net", {"side": 225}),
    "discs, rigid": ("packing", {"side": 184}),
    "discs, friction, to 3e-4": ("packing", {"side": 184, "law": "friction"}),
    "discs, elastic": ("packing", {"side": 184, "law": "elastic"}),
    "spheres, rigid": ("packing", {"side": 34, "dim": 3}),
}
SHOWN = ("contacts", "free_dofs", "subdomains", "iterations", "cpu_seconds", "peak_memory_bytes", "residual")


def count(scene, **options):
    """Iterations to the indicator, None where it is not reached."""
    given = {"snes_" + key if key.startswith("stol") else "snes_latin_" + key: value for key, value in options.items()}
    report = solve(scene, {**ITERATION, **given}).report
    return report["iterations"] if report["converged"] else None


def tuned(scene):
    """Search parameter of the rigid links, as the solver chooses it: mean load over mean gap, or neighbours."""
    rigid = np.isin(scene.law, RIGID)
    if (~rigid).any():
        return scene.stiffness[~rigid].mean()
    loads = np.abs(scene.load[~scene.fixed])
    return (
        loads[loads > 0].mean()
        / scene.initial_elongation[scene.initial_elongation > 0].mean()
        * (0.1 if 5 in scene.law else 1.0)
    )


def table(title, rows, columns, cell):
    """Fill a table cell by cell, telling each row as it is done."""
    found = {}
    for row in rows:
        found[row] = {str(column): cell(row, column) for column in columns}
        print(title, row, *found[row].values(), flush=True)
    return found


def subdomains():
    """Each scene: coarse spaces against numbers of subdomains."""
    found = {}
    for name, (scene, options, numbers) in CASES.items():
        scenes = {n: make(scene, **options, subdomains=n) for n in numbers}
        found[name] = table(name, COARSE, numbers, lambda row, n: count(scenes[n], **COARSE[row]))  # noqa: B023
    return found


def helps():
    """What changes the iterations of one decomposition."""
    names = [name for name in CASES if "comparison" not in name]
    scenes = {name: make(CASES[name][0], **CASES[name][1], subdomains=CASES[name][2][3]) for name in names}

    def cell(row, name):
        scene, change = scenes[name], HELP[row]
        if isinstance(change, dict):
            return count(scene, **change)
        rigid = np.isin(scene.law, RIGID)
        if not rigid.any():
            return None
        before = scene.stiffness.copy()
        scene.stiffness = np.where(rigid, change * tuned(scene), before)
        try:
            return count(scene)
        finally:
            scene.stiffness = before

    return table("iterations to 1e-4", HELP, names, cell)


def chains():
    """Iterations and seconds of the processor to the default stop, with and without Newton's method."""
    found = {}
    for name, (scene, options) in CHAINS.items():
        made, found[name] = make(scene, **options), {}
        found[name]["contacts"] = int(np.isin(made.law, UNILATERAL).sum())
        for way, change in WAYS.items():
            start = time.process_time()
            report = solve(made, change).report
            found[name][way + "iterations"] = report["iterations"] if report["converged"] else None
            found[name][way + "cpu_seconds"] = time.process_time() - start
        print(name, *found[name].values(), flush=True)
    return found


def moving():
    """Grains of unit mass that random velocities shake: 40 steps of 10 ms, with those that have failed."""
    found = {}
    with default_options({"ts_type": "latin", "snes_type": "latin"}):
        for name, (scene, options) in (CHAINS | SHAKEN).items():
            made = make(scene, **options)
            if scene != "packing" or (name in CHAINS and len(made.nodes) > MOVING):
                continue
            velocity = np.where(made.fixed, 0.0, np.random.default_rng(0).normal(0.0, 0.1, made.nodes.shape))
            structure = Structure.from_scene(replace(made, mass=np.ones(len(made.nodes)), velocity=velocity))
            found[name] = {"contacts": int(np.isin(made.law, UNILATERAL).sum())} | steps(structure, velocity)
            print(name, *found[name].values(), flush=True)
    return found


def steps(structure, velocity, count=40, length=0.01):
    """Make steps until one fails: their number, the median and the most stages, and milliseconds of a step."""
    u, v = structure.create_vec(), structure.create_vec()
    structure.set_displacements(velocity, v)
    ts = structure.create_ts(u, v)
    ts.setTimeStep(length)
    ts.setMaxSteps(count)
    ts.setFromOptions()
    stages, start = [], time.process_time()
    for _ in range(count):
        try:
            ts.step()
        except PETSc.Error:
            break
        stages.append(ts.getSNES().getIterationNumber())
    spent = 1e3 * (time.process_time() - start) / max(len(stages), 1)
    return {
        "steps": len(stages),
        "stages, median": int(np.median(stages)),
        "most": max(stages),
        "ms a step": round(spent),
    }


def one_large(name):
    """Solve one of the large structures: what is shown of it, with the processor's time of set-up and solve."""
    scene, options = LARGE[name]
    made = make(scene, **options)
    stop = {"snes_stol": 3e-4, "snes_max_it": 20000} if "to 3e-4" in name else {}
    start = time.process_time()
    report = solve(made, stop).report
    assert report["converged"]
    report["cpu_seconds"] = time.process_time() - start
    report["contacts"] = int(np.isin(made.law, UNILATERAL).sum())
    return {key: report[key] for key in SHOWN}


def large():
    """One hundred thousand links: run to completion, each in a process of its own, with figures."""
    found = {}
    for name in LARGE:
        done = subprocess.run([sys.executable, __file__, "one", name], check=True, capture_output=True, text=True)
        found[name] = json.loads(done.stdout.splitlines()[-1])
        print(name, *found[name].values(), flush=True)
    return found


def lines(title, rows):
    """Return the lines of a table of the page."""
    columns = list(next(iter(rows.values())))
    yield f"| {title} | {' | '.join(columns)} |"
    yield "| --- |" + " ---: |" * len(columns)
    for row, cells in rows.items():
        yield f"| {row} | {' | '.join(shown(key, value) for key, value in cells.items())} |"


def shown(key, value):
    if value is None:
        return "–"
    if key.endswith("bytes"):
        return f"{value / 1e6:.0f} MB"
    if isinstance(value, float):
        return f"{value:.1e}" if key == "residual" else f"{value:.3g} s"
    return f"{value:,}" if isinstance(value, int) else str(value)


def write(found):
    """Put the tables into the page, between their marks."""
    page = Path(__file__).with_name("granular.md")
    text = page.read_text()
    blocks = {"subdomains": [line for name, rows in found["subdomains"].items() for line in (*lines(name, rows), "")]}
    blocks |= {
        key: list(lines(title, found[key]))
        for key, title in (
            ("helps", "change"),
            ("chains", "structure"),
            ("moving", "structure"),
            ("large", "structure"),
        )
        if key in found
    }
    for key, block in blocks.items():
        if f"<!-- {key} -->" not in text:
            continue
        before, _, rest = text.partition(f"<!-- {key} -->\n")
        text = "\n".join([before + f"<!-- {key} -->", *block, rest[rest.index("<!-- end -->") :]])
    page.write_text(text)


def main():
    if sys.argv[1:2] == ["one"]:
        print(json.dumps(one_large(sys.argv[2])))
        return
    path = run.RESULTS / "granular.json"
    found = json.loads(path.read_text()) if path.exists() else {}
    parts = {"subdomains": subdomains, "helps": helps, "chains": chains, "moving": moving, "large": large}
    for name in sys.argv[1:] or ("subdomains", "helps"):
        found[name] = parts[name]()
        path.write_text(json.dumps(found, indent=1) + "\n")
    write(found)


if __name__ == "__main__":
    main()
