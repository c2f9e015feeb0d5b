"""Large displacements: cables at their kinks, without tension as drawn or where crossed ones slacken, and branches."""

import sys
from pathlib import Path

import numpy as np
import pytest
import turning
from conftest import run
from petsc4py import PETSc
from support import far

import latinpc


def bridge(panels, prestress=0.0):
    """A cable over a truss that hangs from it, its own weight on cable and deck; nothing is tense as drawn."""
    n = panels
    x = 10.0 * np.arange(n + 1)
    sag = 12.0 * (2 * x / x[-1] - 1) ** 2 + 3.0
    nodes = np.concatenate([np.stack([x, y + 0.0 * x], 1) for y in (sag, 0.0, -2.0)])
    cable, top, low = np.arange(3 * n + 3).reshape(3, n + 1)
    pairs = [(cable[:-1], cable[1:]), (cable[1:-1], top[1:-1])]
    bars = [(top[:-1], top[1:]), (low[:-1], low[1:]), (top[:-1], low[1:]), (top, low)]
    links = np.concatenate([np.stack(pair, 1) for pair in pairs + bars])
    cables = 2 * n - 1
    fixed, load = np.zeros((3 * n + 3, 2), bool), np.zeros((3 * n + 3, 2))
    fixed[[cable[0], cable[-1], top[0]]] = fixed[top[-1], 1] = True
    load[cable[1:-1], 1], load[top[1:-1], 1] = -2e4, -15e4
    tension = np.where(np.arange(len(links)) < cables, prestress, 0.0)
    EA = np.repeat([2.1e9, 2e8, 8.4e9, 2e9], [n, n - 1, 2 * n, 2 * n + 1])
    law = ["cable"] * cables + ["bar"] * (len(links) - cables)
    return latinpc.Structure(
        nodes, links, law, EA=EA, prestress=tension, fixed=fixed, load=load, geometry="large", comm=PETSc.COMM_SELF
    )


@pytest.mark.parametrize("panels", [4, 10, 16])
def test_cables_without_tension_hold_what_is_drawn(panels):
    """Next to where the loads lead from the drawing: a newton of prestress changes little. And in few stages."""
    found, tense = bridge(panels).solve(), bridge(panels, prestress=1.0).solve()
    assert found.converged and tense.converged and not found.slack.any()
    assert far(found.displacements, tense.displacements) < 1e-3
    assert found.iterations < 30


def tower(stages, prestress, across=0.0, wind=3e3, weight=1e4, comm=PETSc.COMM_SELF):
    """Four columns, beams, crossed cables in all faces and floors; wind along x, weight on each node."""
    nodes = np.array([[x, y, 3.0 * k] for k in range(stages + 1) for x, y in ((0, 0), (2, 0), (2, 2), (0, 2))], float)
    bars, cables = [], []
    for k in range(4, 4 * stages + 4, 4):
        for i in range(4):
            a, b = k + i, k + (i + 1) % 4
            bars += [(a - 4, a), (a, b)]
            cables += [(a - 4, b), (b - 4, a)]
        cables += [(k, k + 2), (k + 1, k + 3)]
    load = np.zeros_like(nodes)
    load[4:] = wind, across * wind, -weight
    EA, tension = ([value] * len(bars) + [other] * len(cables) for value, other in ((2e8, 1e7), (0.0, prestress)))
    return latinpc.Structure(
        nodes, bars + cables, ["bar"] * len(bars) + ["cable"] * len(cables), EA=EA, prestress=tension,
        fixed=np.repeat(nodes[:, 2:] == 0.0, 3, 1), load=load, geometry="large", comm=comm,
    )  # fmt: skip


def least(result):
    """Return the least eigenvalue of the tangent stiffness at a solution."""
    structure = result.structure
    K, u = structure.dm.createMat(), structure.create_vec()
    structure.set_displacements(result.displacements, u)
    structure.jacobian(u, K)
    return np.linalg.eigvalsh(K.convert("dense").getDenseArray())[0]


@pytest.mark.parametrize("stages", [2, 3, 4, 6])
@pytest.mark.parametrize("prestress", [0.0, 10.0, 100.0, 300.0])
def test_crossed_cables_that_slacken_together(stages, prestress):
    """Symmetric loads slacken both cables of a floor at once: it shears a little, and stands as with a breath of
    wind across it."""
    found, beside = tower(stages, prestress).solve(), tower(stages, prestress, across=1e-2).solve()
    assert found.converged and beside.converged
    assert far(found.displacements, beside.displacements) < 0.1
    assert found.balance.force < 1e-3
    assert least(found) > 0.0


def test_the_number_of_subdomains_does_not_decide():
    one = tower(4, 100.0).solve()
    more = tower(4, 100.0).solve(options={"snes_latin_subdomains": 4})
    assert one.converged and more.converged
    assert far(np.abs(one.displacements), np.abs(more.displacements)) < 1e-2


RANKS = """
import sys
import petsc4py
petsc4py.init(sys.argv)
sys.path.insert(0, sys.argv[1])
from petsc4py import PETSc
from test_large_branches import tower
for stages, prestress in ((2, 10.0), (3, 0.0)):
    found = tower(stages, prestress, comm=PETSc.COMM_WORLD).solve()
    PETSc.Sys.Print("found", int(found.converged), repr(abs(found.displacements).max()))
"""


@pytest.mark.parametrize("ranks", [2, 4])
def test_any_number_of_ranks(ranks, tmp_path):
    """Which side is chance, how far is not."""
    script = tmp_path / "ranks.py"
    script.write_text(RANKS)
    text = run(["mpirun", "-n", ranks, sys.executable, script, Path(__file__).parent]).stdout
    alone = [tower(*of).solve() for of in ((2, 10.0), (3, 0.0))]
    found = np.array([line.split()[1:] for line in text.splitlines() if line.startswith("found")], float)
    assert found[:, 0].all()
    assert found[:, 1] == pytest.approx([np.abs(result.displacements).max() for result in alone], rel=1e-3)


def ended(structure):
    """Return the part of the loads at which the path of a structure ends, and whether a branch begins there."""
    snes, u = structure.create_snes(), structure.create_vec()
    snes.setFromOptions()
    snes.solve(None, u)
    assert snes.getConvergedReason() < 0
    path = latinpc.path(snes)
    return path["borne"], path["branch"]


def strut_on_strings(push):
    """Two bars in line, pushed; two strings across hold the hinge between them with their tension of 50 N."""
    nodes = [[-1, 0, 0], [0, 0, 0], [1, 0, 0], [0, 0, -1], [0, 0, 1]]
    fixed = np.ones((5, 3), bool)
    fixed[1], fixed[2, 0] = False, False
    load = np.zeros((5, 3))
    load[2, 0] = -push
    return latinpc.Structure(
        nodes, [[0, 1], [1, 2], [1, 3], [1, 4]], ["bar", "bar", "cable", "cable"], EA=[1e7, 1e7, 1e5, 1e5],
        prestress=[0, 0, 50, 50], fixed=fixed, load=load, geometry="large", comm=PETSc.COMM_SELF,
    )  # fmt: skip


def test_what_buckles_and_bears_more_is_told_from_what_snaps_through():
    """Strings stiffen as the hinge moves aside; springs along it do not, nor do two flat bars that snap through."""
    strut = strut_on_strings(75.0)
    assert ended(strut) == (pytest.approx(50.0 / 75.0, abs=5e-4), True)
    result = strut.solve()
    assert not result.converged and "buckles at 0.666" in " ".join(result.notices)
    strut.set_load(strut.load + [[0, 0, 0], [0, 1e-3, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0]])
    assert strut.solve().converged
    column, flat = turning.column(2, 75.0), turning.von_mises(2.0 * turning.von_mises_limit())
    for arrays, part in ((column, 50.0 / 75.0), (flat, 0.5)):
        structure = latinpc.Structure(**arrays, geometry="large", comm=PETSc.COMM_SELF)
        assert ended(structure) == (pytest.approx(part, abs=5e-4), False)
        assert "buckles, or snaps through" in " ".join(structure.solve().notices)


STOPS = {
    "residual": {"snes_latin_stop": "residual", "snes_rtol": 1e-6},
    "indicator": {"snes_latin_stop": "indicator", "snes_stol": 1e-6},
    "step": {"snes_stol": 1e-8},
    "loose": {"snes_stol": 1e-3},
}


@pytest.mark.parametrize("stop", STOPS)
def test_whatever_stops_the_solve(stop):
    """The end of the path of the loads: the iteration had gone on from there to another one, 2 m away."""
    drawn = {
        "nodes": [[-0.05, -0.16, 0.18], [0.2, -0.1, 0.93], [0.13, 0.88, 1.14], [-0.02, 1.07, 0.2],
                  [0.76, -0.08, 0.14], [1.05, -0.19, 1.2], [1.24, 0.76, -0.03]],
        "links": [[0, 3], [1, 3], [2, 3], [1, 4], [2, 4], [0, 4], [3, 5], [4, 5], [0, 5], [4, 6], [0, 6], [3, 6],
                  [4, 0]],
        "law": ["bar"] * 12 + ["cable"],
        "stiffness": [525.0, 267.0, 16.0, 125.0, 626.0, 74.0, 120.0, 35.0, 54.0, 13.0, 105.0, 226.0, 82.0],
        "fixed": [[k < 3] * 3 for k in range(7)],
        "load": [[0.0] * 3] * 3 + [[0.66, -0.12, 0.03], [0.65, -0.43, 0.05], [0.34, 0.68, -0.31], [-0.32, 0.07, -0.23]],
    }  # fmt: skip
    structure = latinpc.Structure(**drawn, geometry="large", comm=PETSc.COMM_SELF)
    path, found = structure.solve(error=1e-9), structure.solve(options=STOPS[stop])
    assert path.converged and found.converged
    assert np.abs(found.displacements - path.displacements).max() < (1e-4 if stop == "loose" else 1e-6)
    if stop == "residual":
        assert found.largest_unbalance < 2e-6 * np.linalg.norm(drawn["load"])


@pytest.mark.parametrize("seed", [1, 9, 12])
def test_a_limit_is_the_same_whatever_the_whole_loads(seed):
    """Cables slacken together where the shell snaps: a stable state as far beyond under fewer loads is no branch."""
    rng, i = np.random.default_rng(seed), np.indices((7, 7)).reshape(2, -1).T
    x, rim = i / 6.0, ((i == 0) | (i == 6)).any(axis=1)
    nodes = np.column_stack([20.0 * x, 18.0 * x[:, 0] * (1.0 - x[:, 0])])
    nodes[~rim] += rng.normal(0.0, 0.1, (len(i), 3))[~rim]
    number = np.arange(len(i)).reshape(7, 7)
    pairs = [(number[:-1], number[1:]), (number[:, :-1], number[:, 1:])]
    pairs += [(number[:-1, :-1], number[1:, 1:]), (number[1:, :-1], number[:-1, 1:])]
    links = np.concatenate([np.stack([a.ravel(), b.ravel()], axis=1) for a, b in pairs])
    cable = np.arange(len(links)) >= 84
    load = np.where(rim[:, None], 0.0, [0.0, 0.0, -1.0]) * rng.uniform(0.7, 1.3, (len(i), 1))
    shell = latinpc.Structure(
        nodes, links, np.where(cable, "cable", "bar"), EA=np.where(cable, 5e5, 4e6), load=load,
        prestress=np.where(cable, 800.0, 0.0), fixed=np.repeat(rim[:, None], 3, 1), geometry="large",
        comm=PETSc.COMM_SELF,
    )  # fmt: skip
    borne = []
    for times in (300.0, 550.0, 700.0):
        shell.set_load(times * load)
        borne.append(times * shell.solve().report["load_factor"])
    assert borne == pytest.approx([borne[0]] * 3, rel=1e-3)
