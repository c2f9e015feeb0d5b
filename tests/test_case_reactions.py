"""Reactions of load cases: of each, their envelope, the table that is written."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from command import latinpc as command
from conftest import ROOT
from test_cases import ACCURATE, row
from test_reactions import slider

from latinpc import Case
from latinpc.runs.cases import solve_cases
from latinpc.scenes import make


def test_reactions_of_each_case_and_their_envelope(tmp_path):
    """Of two springs between held ends they are what the springs bear, whatever acts; lowest and highest of them."""
    scene = row(load=np.array([[0.5], [0.0], [0.0]]))  # 0.5 N straight into the support
    cases = [
        Case("load", load=[[0.0], [1.0], [0.0]]),
        Case("sunk; deep", prescribed=np.array([[0.0], [0.0], [0.1]])),
        Case("turnbuckle", initial_elongation=np.array([0.05, 0.0])),
    ]
    found = solve_cases(scene, cases)
    pulls = found.tensions
    assert found.reactions[:, :, 0] == pytest.approx(np.column_stack([-pulls[:, 0] - 0.5, np.zeros(3), pulls[:, 1]]))
    for number, case in enumerate(cases):
        assert found.reactions[number] == pytest.approx(case.applied(scene).solve().reactions, abs=1e-6)
    lowest, highest, low, high = found.reaction_envelope()
    ends = found.reactions[:, [0, 2], 0]
    assert lowest[[0, 2], 0].tolist() == ends.min(axis=0).tolist() and not lowest[1].any()
    assert highest[[0, 2], 0].tolist() == ends.max(axis=0).tolist()
    assert low[[0, 2], 0].tolist() == ends.argmin(axis=0).tolist()
    assert high[[0, 2], 0].tolist() == ends.argmax(axis=0).tolist()
    found.to_csv(tmp_path / "e.csv", reactions=tmp_path / "r.csv")
    rows = list(csv.DictReader((tmp_path / "r.csv").open()))
    columns = ["node", "x", "axis", "lowest (N)", "lowest_case", "highest (N)", "highest_case"]
    assert list(rows[0]) == [*columns, "load (N)", "sunk; deep (N)", "turnbuckle (N)"]
    assert [(row["node"], row["x"], row["axis"]) for row in rows] == [("0", "0.0", "x"), ("2", "3.0", "x")]
    assert [float(row["turnbuckle (N)"]) for row in rows] == ends[2].tolist()
    assert rows[1]["highest_case"] == found.names[high[2, 0]]
    said = next(line for line in str(found).splitlines() if line.startswith("reactions"))
    size = np.abs(ends)
    assert "x from " in said and f"in case {found.names[size.max(axis=1).argmax()]}" in said
    held = found.to_dict()["reactions"]
    assert held["nodes"] == [0, 2] and np.shape(held["cases"]) == (3, 2, 1)
    json.dumps(found.to_dict(), allow_nan=False)


@pytest.mark.parametrize("geometry", ["prestress", "large"])
def test_reactions_balance_the_loads_where_links_turn(geometry):
    scene = replace(make("saddle"), geometry=geometry)
    push = np.where(scene.fixed, 0.0, [30.0, -20.0, -100.0])
    found = solve_cases(scene, [Case("down", load=push), Case("up", load=-0.5 * push)], ACCURATE)
    for number, case in enumerate(found.actions):
        applied = case.applied(scene)
        assert found.reactions[number].sum(axis=0) == pytest.approx(-applied.load.sum(axis=0), rel=1e-5)
        assert found.reactions[number] == pytest.approx(applied.solve(error=1e-9).reactions, rel=1e-4, abs=1e-2)


def test_reactions_of_cases_with_contacts_that_keep_their_normal():
    structure = slider(None)
    found = solve_cases(structure, [Case("nothing"), Case("more", load=[[0, 0], [2.0, -3.0], [0, 0]])], ACCURATE)
    assert found.reactions[:, 2] == pytest.approx(np.array([[0.0, 5.0], [0.0, 8.0]]), abs=1e-5)
    assert found.reactions[:, 0] == pytest.approx(np.array([[-5.0, 0.0], [-7.0, 0.0]]), abs=1e-5)


def test_reactions_are_those_of_what_was_solved():
    """They are computed when they are asked for, from what acted then: the scene and the case may have changed."""
    scene, case = row(load=np.array([[0.5], [0.0], [0.0]])), Case("load", load=[[0.0], [1.0], [0.0]])
    found = solve_cases(scene, [case])
    scene.load[0] = case.load[0] = 100.0
    assert found.reactions.ravel() == pytest.approx([-0.9, 0.0, -0.6])


def test_a_case_has_arrays_of_its_own():
    """One array may be filled anew for each case."""
    load, cases = np.zeros((3, 1)), []
    for force in (1.0, 2.0):
        load[1] = force
        cases.append(Case(f"{force:g} N", load=load))
    assert [case.load[1, 0] for case in cases] == [1.0, 2.0]
    with pytest.raises(ValueError, match="name must be a string, not 1"):
        Case(1)


def test_reactions_of_cases_that_have_not_converged_are_in_no_envelope(tmp_path):
    scene = row(fixed=(True, False, False), law="cable")
    found = solve_cases(scene, [Case("push", [[0], [0.0], [-2.0]]), Case("pull", [[0], [0.0], [2.0]])])
    lowest, highest, low, _ = found.reaction_envelope()
    assert lowest[0, 0] == highest[0, 0] == pytest.approx(-2.0) and low[0, 0] == 1
    none = solve_cases(scene, found.actions[:1])
    assert "reactions" not in str(none) and np.isnan(none.reaction_envelope()[0]).all()
    none.to_csv(tmp_path / "e.csv", tmp_path / "r.csv")
    assert none.to_dict()["reactions"]["lowest"] == [[None]]


def test_the_command_prints_and_writes_them(tmp_path):
    """As the file counts; the sums over the supports are the loads of a case."""
    bridge = ROOT / "examples" / "footbridge.msh"
    said = command("cases", bridge, "--reactions", "r.csv", "--json", "r.json", cwd=tmp_path).stdout
    rows = list(csv.DictReader((tmp_path / "r.csv").open()))
    found = json.loads((tmp_path / "r.json").read_text())
    names = [case["name"] for case in found["cases"]]
    assert "reactions" in said and [f"{name} (N)" in rows[0] for name in names] == [True] * len(names)
    up = [float(row[f"{names[0]} (N)"]) for row in rows if row["axis"] == "z"]
    assert sum(up) == pytest.approx(np.sum(found["reactions"]["cases"][0], axis=0)[2])
    assert all(int(row["name"]) == int(row["node"]) + 1 for row in rows)
