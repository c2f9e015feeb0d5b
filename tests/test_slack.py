"""From no slack cable to the load under which nothing balances a structure any more: benchmarks/slack.py."""

import json
import sys

import numpy as np
import pytest
from conftest import ROOT
from petsc4py import PETSc

import latinpc
from latinpc.scenes import Law

sys.path.insert(0, str(ROOT / "benchmarks"))
import slack

ROWS = json.loads((ROOT / "benchmarks" / "results" / "slack.json").read_text())["rows"]


def relieved(factor):
    scene, uplift = slack.girder()
    scene.load = scene.load + factor * uplift
    structure = latinpc.Structure.from_scene(scene)
    snes, u = structure.create_snes(), structure.create_vec()
    snes.setTolerances(stol=1e-8, max_it=1000)
    snes.solve(None, u)
    return scene, structure, snes, u


@pytest.mark.parametrize("factor", [0.0, 0.8, 0.99, 0.999])
def test_cables_balance_what_the_uplift_leaves(factor):
    """Resultant and moment of the cables are those of the loads: statics alone."""
    scene, structure, snes, u = relieved(factor)
    assert snes.reason > 0
    tension = structure.tensions(u)[scene.law == Law.CABLE]
    x = scene.nodes[scene.links[scene.law == Law.CABLE, 0], 0]
    assert np.all(tension >= 0.0)
    whole = np.abs(scene.load[:, 1]).sum()
    assert tension.sum() == pytest.approx(-scene.load[:, 1].sum(), abs=1e-5 * whole)
    assert tension @ x == pytest.approx(-scene.load[:, 1] @ scene.nodes[:, 0], abs=1e-5 * whole * x.max())


def test_beyond_it_there_is_no_equilibrium():
    _, _, snes, _ = relieved(1.01)
    assert snes.reason == PETSc.SNES.ConvergedReason.DIVERGED_DTOL
    assert len(latinpc.unsupported_nodes(snes)) > 0


@pytest.mark.parametrize(("name", "factor"), [("tensegrity-grid", 2.0), ("lattice", 1e4), ("girder", 0.9)])
def test_iterations_are_those_of_the_table(name, factor):
    row = next(row for row in ROWS if (row["scene"], row["factor"]) == (name, factor))
    scene = next(scene for case, f, scene in slack.cases() if (case, f) == (name, factor))
    found = slack.stages(scene, slack.by_newton(scene, slack.ACCURACY)[0], {"snes_latin_variant": "corner"})
    assert found == pytest.approx(row["stages"]["corner, anderson"], rel=0.15, abs=2)
