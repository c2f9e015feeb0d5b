"""Load cases: closed forms, each as a solve of its own, one set-up for all, envelopes, the tables of a TOML file."""

import csv
import json

import numpy as np
import pytest
from conftest import ROOT
from petsc4py import PETSc
from support import chain, far, grid, irregular, lattice, logged, network
from test_cli import latinpc as command
from test_cli import said
from test_files import MSH, TOML

import latinpc
from latinpc import Case
from latinpc.results.envelope import COLUMNS, draw_envelope, write_envelope
from latinpc.runs.cases import solve_cases
from latinpc.runs.solve import solve
from latinpc.scenes import Law, Scene, make

ACCURATE = {"snes_latin_error": 1e-9}


def row(fixed=(True, False, True), law="bar", stiffness=(2.0, 3.0), **given):
    """Two links in a row."""
    return Scene(
        "row", [[0.0], [1.0], [3.0]], [[0, 1], [1, 2]], law, stiffness, fixed=np.array(fixed)[:, None], **given
    )


def random_cases(scene, count, seed=0):
    """Loads, settlements and changes of length at random, sums of a few and others."""
    rng = np.random.default_rng(seed)
    size, length = np.abs(scene.load).max(), scene.lengths

    def one(name):
        return Case(
            name,
            load=np.where(scene.fixed, 0.0, rng.normal(size=scene.load.shape) * size * 0.3),
            prescribed=np.where(scene.fixed, rng.normal(size=scene.load.shape) * 1e-5, 0.0),
            initial_elongation=rng.normal(size=len(length)) * 1e-6 * length,
        )

    parts = [one(f"part {i}") for i in range(3)]
    sums = [sum((float(f) * p for f, p in zip(rng.uniform(0, 2, 3), parts)), 0.0 * parts[0]) for _ in range(count - 1)]
    return [case.named(f"case {i}") for i, case in enumerate([*sums, one("alone")])]


# ---- closed forms ----------------------------------------------------------------------------


def test_loads_settlements_temperatures_and_turnbuckles():
    """Two springs between held ends, with initial elongations e1, e2: u = (F + k2 (U + e2) - k1 e1) / (k1 + k2)."""
    scene = row()
    cases = [
        Case("load", load=[[0.0], [1.0], [0.0]]),
        Case("settlement", prescribed=np.array([[0.0], [0.0], [0.1]])),
        Case("turnbuckle", initial_elongation=np.array([0.05, 0.0])),
        Case("warmer", initial_elongation=-1.2e-5 * 40.0 * scene.lengths),
    ]
    found = solve_cases(scene, cases)
    k1, k2 = 2.0, 3.0
    warm = 1.2e-5 * 40.0
    middle = [1.0 / 5, k2 * 0.1 / 5, -k1 * 0.05 / 5, (k1 * warm - k2 * 2 * warm) / 5]
    assert found.displacements[:, 1, 0] == pytest.approx(middle)
    assert found.tensions[1] == pytest.approx([k1 * 0.06, k2 * 0.04])
    assert found.tensions[2] == pytest.approx([k1 * (0.05 - 0.02), k2 * 0.02])
    assert found.tensions[3, 0] == pytest.approx(found.tensions[3, 1])
    assert found.tensions[3, 0] == pytest.approx(-warm * 3.0 / (1 / k1 + 1 / k2))  # no room for 3 m of bars


def test_cables_slacken_in_some_cases():
    """Two cables pulled either way: one bears all; with prestress they share until one is slack."""
    found = solve_cases(row(law="cable"), [Case("right", [[0], [1.0], [0]]), Case("left", [[0], [-1.0], [0]])])
    assert found.tensions == pytest.approx(np.array([[1.0, 0.0], [0.0, 1.0]]), abs=1e-12)
    assert found.slack.tolist() == [[False, True], [True, False]]
    lowest, highest, low, high = found.envelope()
    assert lowest == pytest.approx([0, 0], abs=1e-12) and highest == pytest.approx([1, 1])
    assert (low.tolist(), high.tolist(), found.slack_cases().tolist()) == ([1, 0], [0, 1], [1, 1])
    taut = solve_cases(row(law="cable"), [Case("tight", [[0], [0.1], [0]], None, np.array([0.5, 0.0]))])
    assert not taut.slack.any() and taut.tensions[0, 0] - taut.tensions[0, 1] == pytest.approx(0.1)


def test_cases_are_a_vector_space():
    a = Case("a", load=np.ones((2, 1)), prescribed=np.ones((2, 1)))
    b = Case("b", load=np.full((2, 1), 3.0), initial_elongation=np.ones(1))
    c = 1.35 * a + b * 2
    assert c.name == "1.35 a + 2 b"
    assert c.load.ravel().tolist() == [7.35, 7.35] and c.prescribed.ravel().tolist() == [1.35, 1.35]
    assert c.initial_elongation.tolist() == [2.0]
    with pytest.raises(TypeError):
        a + 1.0
    with pytest.raises(TypeError):
        a * "2"


def test_results_of_bars_combine_as_their_actions_do():
    """Linear: 1.35 a + 1.5 b has 1.35 times the response to a plus 1.5 times that to b, and takes no iteration more."""
    scene = make("truss-grid", modules=8, subdomains=4)
    scene.load = np.zeros_like(scene.load)
    scene.initial_elongation = np.zeros_like(scene.initial_elongation)
    a, b = random_cases(make("truss-grid", modules=8, subdomains=4), 2, seed=4)
    found = solve_cases(scene, [a, b, 1.35 * a + 1.5 * b], ACCURATE)
    for array in (found.displacements, found.tensions):
        assert far(array[2], 1.35 * array[0] + 1.5 * array[1]) < 1e-7


# ---- beside solves of their own --------------------------------------------------------------

SCENES = {
    "grid": grid,
    "irregular": irregular,
    "network": network,
    "lattice": lattice,
    "chain of cables": lambda: chain(law=Law.CABLE),
    "hung truss": lambda: make("hung-truss"),
    "net": lambda: make("net", side=6, law="inextensible"),
}


@pytest.mark.parametrize("name", SCENES)
def test_each_case_is_as_solved_by_itself(name):
    scene = SCENES[name]()
    cases = random_cases(scene, 5)
    how = {} if name == "net" else ACCURATE
    found = solve_cases(scene, cases, how)
    assert found.converged and found.names == [case.name for case in cases]
    for number, case in enumerate(cases):
        alone = solve(case.applied(scene), how)
        assert alone.converged
        if name != "net":
            assert far(found.displacements[number], alone.displacements) < 1e-6
        assert far(found.tensions[number], alone.tensions) < (1e-3 if name == "net" else 1e-6)


@pytest.mark.parametrize("make_scene", [grid, irregular])
def test_one_set_up_for_all_cases(make_scene):
    """Counted by PETSc's log: the set-ups of latin, and the factorisations; the partition is made once."""
    scene = make_scene()
    events = ("LatinSetUp", "LatinSubdomains", "LatinInterface", "LatinMacro", "MatCholFctrNum", "MatCholFctrSym")
    with logged():
        counts = []
        for count in (1, 12):
            before = [PETSc.Log.Event(event).getPerfInfo()["count"] for event in events]
            found = solve_cases(scene, random_cases(scene, count), {"snes_stol": 1e-7})
            assert found.converged
            counts.append([PETSc.Log.Event(e).getPerfInfo()["count"] - b for e, b in zip(events, before)])
    assert counts[0] == counts[1] and counts[0][0] == 1


def test_a_start_from_other_cases_saves_stages_and_their_order_changes_nothing(monkeypatch):
    """One after the other."""
    monkeypatch.setattr("latinpc.runs.cases.FEWEST", 100)
    scene = irregular(modules=12)
    cases = random_cases(scene, 12, seed=2)
    found = solve_cases(scene, cases, ACCURATE)
    backwards = solve_cases(scene, cases[::-1], ACCURATE)
    assert far(backwards.displacements[::-1], found.displacements) < 1e-6
    alone = sum(solve(case.applied(scene), ACCURATE).report["iterations"] for case in cases[4:-1])
    assert sum(case["iterations"] for case in found.report["cases"][4:-1]) < 0.9 * alone


def together(found):
    return [case["together"] for case in found.report["cases"]]


@pytest.mark.parametrize("name", ["grid", "irregular", "network", "lattice"])
def test_side_by_side_is_as_accurate_as_promised(name):
    """Displacements and tensions to the error that is asked for, forces in balance, whatever else is solved beside."""
    scene = SCENES[name]()
    cases = random_cases(scene, 21, seed=3)  # more than there are lanes
    for error in (1e-3, 1e-5):
        found = solve_cases(scene, cases, {"snes_latin_error": error})
        assert found.converged and all(together(found))
        for number in (0, 7, 20):
            exact = solve(cases[number].applied(scene), {"snes_latin_error": 1e-9})
            free = ~scene.fixed
            assert far(found.displacements[number][free], exact.displacements[free]) < error
            assert far(found.tensions[number], exact.tensions) < error
            applied = latinpc.Structure.from_scene(cases[number].applied(scene))
            u, r = applied.create_vec(), applied.create_vec()
            applied.set_displacements(found.displacements[number], u)
            applied.residual(u, r)
            assert r.norm() < 1.01e-2 * np.linalg.norm(applied.load[free])
    some = solve_cases(scene, cases[5:12], {"snes_latin_error": 1e-5})
    assert (some.displacements == found.displacements[5:12]).all() and (some.tensions == found.tensions[5:12]).all()


def test_bars_take_three_stages_a_case():
    scene = make("truss-grid", modules=8, subdomains=4)
    found = solve_cases(scene, random_cases(scene, 12, seed=5))
    assert all(together(found)) and max(case["iterations"] for case in found.report["cases"]) <= 3


def test_what_does_not_go_side_by_side_is_solved_all_the_same():
    """Laws without a stiffness, options of the iteration, few cases; and one case among others without equilibrium."""
    grids = random_cases(grid(), 4)
    for scene, cases, how in (
        (SCENES["net"](), random_cases(SCENES["net"](), 4), {}),
        (grid(), grids, {"snes_stol": 1e-6}),
        (grid(), grids, {"snes_latin_newton": "never"}),
        (grid(), grids[:1], {}),
    ):
        found = solve_cases(scene, cases, how)
        assert found.converged and not any(together(found))
    scene = row(fixed=(True, False, False), law="cable")
    cases = [Case(f"{pull}", [[0], [1e-3], [1e-3 * pull]]) for pull in (2.0, 3.0, -2.0, 4.0, 5.0)]
    found = solve_cases(scene, cases)
    assert [case["converged"] for case in found.report["cases"]] == [True, True, False, True, True]
    assert together(found) == [True, True, False, True, True]


def test_held_nodes_without_links_are_solved_side_by_side():
    """They stay where they are prescribed to be."""
    lone = lattice()
    apart = Scene(
        "apart", np.vstack([lone.nodes, [[50.0, 50.0]]]), lone.links, lone.law, lone.stiffness, lone.initial_elongation,
        np.vstack([lone.fixed, [[True, True]]]), load=np.vstack([lone.load, [[0.0, 0.0]]]),
    )  # fmt: skip
    cases = random_cases(lone, 3)
    moved = np.array([[0.1, -0.2]])
    with_it = [
        Case(c.name, np.vstack([c.load, 0 * moved]), np.vstack([c.prescribed, moved]), c.initial_elongation)
        for c in cases
    ]
    mine, without = solve_cases(apart, with_it), solve_cases(lone, cases)
    assert all(together(mine)) and mine.converged
    assert (mine.displacements[:, -1] == moved).all()
    assert far(mine.tensions, without.tensions) < 1e-4


RANKS = """
import sys
import petsc4py
petsc4py.init(sys.argv[:1] + ["-skip_petscrc"])
sys.path.insert(0, sys.argv[1])
from mpi4py import MPI
from support import grid
from test_cases import random_cases
from latinpc.runs.cases import solve_cases
scene = grid()
cases = random_cases(scene, 18, seed=6)
found = solve_cases(scene, cases)
alone = solve_cases(scene, cases, comm=MPI.COMM_SELF)
assert found.converged and all(case["together"] for case in found.report["cases"])
for array in ("displacements", "tensions", "slack"):
    assert (getattr(found, array) == getattr(alone, array)).all()
assert found.report["cases"] == alone.report["cases"]
few = solve_cases(scene, cases[:3])
assert few.converged and not any(case["together"] for case in few.report["cases"])
print("shared")
"""


@pytest.mark.parametrize("ranks", [2, 4])
def test_ranks_share_the_cases(mpirun, ranks):
    """The same bits as on one rank; too few cases for all ranks are solved by them together."""
    assert mpirun(ranks, RANKS, ROOT / "tests").stdout.count("shared") == ranks


def test_equal_cases_and_cases_without_actions():
    scene = grid()
    twice = solve_cases(scene, [Case("a"), Case("b"), Case("c", load=-scene.load)], ACCURATE)
    assert twice.converged and far(twice.displacements[1], twice.displacements[0]) < 1e-7
    nothing = solve_cases(row(), [Case("a"), Case("b")])
    assert nothing.converged and not nothing.tensions.any()


def test_the_envelope_is_that_of_the_cases_that_have_converged():
    """Two masses on one cable: the load that lifts one off the ground has no equilibrium."""
    scene = row(fixed=(True, False, False), law="cable")
    cases = [Case("pull", [[0], [1.0], [2.0]]), Case("push", [[0], [0.0], [-2.0]]), Case("more", [[0], [1.0], [5.0]])]
    found = solve_cases(scene, cases)
    assert [case["converged"] for case in found.report["cases"]] == [True, False, True] and not found.converged
    lowest, highest, low, high = found.envelope()
    assert lowest == pytest.approx([3.0, 2.0]) and highest == pytest.approx([6.0, 5.0])
    assert low.tolist() == [0, 0] and high.tolist() == [2, 2] and found.slack_cases().tolist() == [0, 0]
    none = solve_cases(scene, cases[1:2]).envelope()
    assert np.isnan(none[0]).all() and none[3].tolist() == [-1, -1]


def test_envelopes_are_written_and_drawn(tmp_path):
    scene = grid()
    found = solve_cases(scene, random_cases(scene, 4))
    write_envelope(tmp_path / "e.csv", found)
    rows = list(csv.DictReader((tmp_path / "e.csv").read_text().splitlines()))
    assert tuple(rows[0]) == COLUMNS and len(rows) == len(scene.links)
    link = int(found.tensions.max(axis=0).argmax())
    number = int(found.tensions[:, link].argmax())
    assert rows[link]["highest_case"] == f"case {number}"
    assert float(rows[link]["highest (N)"]) == found.tensions[number, link]
    assert [int(row["slack"]) for row in rows] == found.slack.sum(axis=0).tolist()
    loose = int(found.slack.sum(axis=0).argmax())
    names = [f"case {number}" for number in np.flatnonzero(found.slack[:, loose])]
    assert rows[loose]["slack_cases"] == "; ".join(names)
    for name, structure in (("grid.png", found), ("flat.svg", solve_cases(lattice(), [Case("a"), Case("b")]))):
        draw_envelope(structure, tmp_path / name)
        assert (tmp_path / name).stat().st_size > 10000


def test_solved_cases_print_draw_and_write_themselves(tmp_path):
    """From latinpc alone: a row a case, the extremes, the figure and the table of the envelope."""
    cable = row(law=["cable", "bar"], stiffness=[2.0, 2.0])
    pull, push = (Case(name, load=[[0.0], [force], [0.0]]) for name, force in (("pull", 4e3), ("push", -6e3)))
    found = latinpc.solve_cases(cable, [pull, push])
    assert isinstance(found, latinpc.Cases)
    lines = str(found).splitlines()
    assert lines[0] == "row: 2 load cases, 3 nodes, 2 links"
    assert [line.split()[0] for line in lines[2:4]] == ["pull", "push"]
    assert "6 kN in case push: link 1, (1) to (3) m" in next(line for line in lines if line.startswith("highest"))
    assert "-2 kN in case pull: link 1" in next(line for line in lines if line.startswith("lowest"))
    assert "1 link in some case; most often (cases): 0 (1)" in next(line for line in lines if line.startswith("slack"))
    assert "row: envelope of 2 load cases" in [text.get_text() for text in found.plot().texts]
    found.to_csv(tmp_path / "mine.csv")
    write_envelope(tmp_path / "other.csv", found)
    assert (tmp_path / "mine.csv").read_text() == (tmp_path / "other.csv").read_text()


def test_misspelt_options_of_cases_are_refused():
    with pytest.raises(ValueError, match=r"do you mean -snes_latin_error\?"):
        solve_cases(row(), [Case("a")], {"snes_latn_error": 1e-6})


def test_wrong_cases_are_named():
    scene = row()
    with pytest.raises(ValueError, match=r"row has no load case to solve: write \[\[case\]\]"):
        solve_cases(scene)
    with pytest.raises(ValueError, match=r"case 'a': load must have the shape \(3, 1\), not \(2, 1\)"):
        solve_cases(scene, [Case("a", load=np.zeros((2, 1)))])
    with pytest.raises(
        ValueError, match="case 'a': node 1 .* has a prescribed displacement in a direction that is not fixed"
    ):
        solve_cases(scene, [Case("a", prescribed=np.ones((3, 1)))])


# ---- files -----------------------------------------------------------------------------------

CASES = """
[[case]]
name = "wind"
part = true
[case.loads.top]
force = [3.0, 0.0]

[[case]]
name = "weight"
[case.loads.all]
lines = "all"
line = [0.0, -2.0]

[[case]]
name = "sunk"
[case.settlements.left]
where = "x=min"
displacement = [0.0, -0.02]

[[case]]
name = "summer"
[case.elongations.bars]
temperature = 30.0
expansion = 1e-5

[[case]]
name = "tight"
[case.elongations.cable]
shortening = 0.5

[[case]]
name = "all of it"
combine = { wind = 1.5, weight = 1.35, sunk = 1.0 }
[case.loads.top]
force = [0.0, 0.5]
"""


@pytest.fixture
def file(tmp_path):
    """Write the triangle of test_files with cases, one text in place of another."""

    def write(old="", new="", cases=CASES):
        assert old in cases
        (tmp_path / "frame.msh").write_text(MSH)
        (tmp_path / "frame.toml").write_text(TOML + cases.replace(old, new, 1))
        return tmp_path / "frame.msh"

    return write


def test_the_cases_of_a_toml_file(file):
    scene = latinpc.read(file())
    cases = {case.name: case for case in scene.cases}
    assert list(cases) == ["wind", "weight", "sunk", "summer", "tight", "all of it"]
    assert [case.part for case in cases.values()] == [True] + [False] * 5
    assert scene.load[2].tolist() == [1, -2] and cases["wind"].load[2].tolist() == [3, 0]
    assert cases["weight"].load[:, 1] == pytest.approx([-8.0, -7.0, -9.0])  # lengths 5, 4 and 3
    assert cases["sunk"].prescribed.tolist() == [[0, -0.02], [0, 0], [0, 0]]
    assert cases["summer"].initial_elongation == pytest.approx([-1.5e-3, -1.2e-3, 0.0])
    assert cases["tight"].initial_elongation.tolist() == [0, 0, 0.5]
    last = cases["all of it"]
    assert last.load[2] == pytest.approx([4.5, -1.35 * 9 + 0.5]) and last.prescribed[0].tolist() == [0, -0.02]
    one = latinpc.read(file(), case="tight")
    assert one.name == "frame: tight" and one.initial_elongation.tolist() == [0, 0, 2.5] and not one.cases
    found = solve_cases(scene)
    assert found.names == list(cases)[1:] and found.converged


BAD = [
    ('name = "weight"', 'name = "wind"', ["[[case]] 'wind'", "a name of its own"]),
    ("part = true", "part = 1", ["[[case]] 'wind'", "part must be true or false"]),
    ("force = [3.0, 0.0]", "force = [3.0]", ["[[case]] 'wind': [case.loads.top]: force must be a list of 2"]),
    ("[case.loads.top]", "[case.load.top]", ["[[case]] 'wind'", "unknown key 'load'", "'loads'"]),
    ('lines = "all"', 'lines = "any"', ["[[case]] 'weight': [case.loads.all]", "no line or group of lines is 'any'"]),
    ('lines = "all"', "lines = []", ["[[case]] 'weight': [case.loads.all]", "no line or group of lines is []"]),
    ("displacement = [0.0, -0.02]", "moved = 1", ["'sunk': [case.settlements.left]", "unknown key 'moved'"]),
    ('where = "x=min"\ndisplacement = [0.0, -0.02]', "", ["[case.settlements.left]", "no group or node has this name"]),
    ('where = "x=min"', 'where = "y=max"', ["[case.settlements.left]", "in which a node is not held"]),
    (
        "[case.settlements.left]",
        '[case.settlements.feet]\nwhere = "y=min"\ndisplacement = [0.01, 0.0]\n[case.settlements.left]',
        ["[case.settlements.left]: displacement: a group above gives one of its nodes another value"],
    ),
    ("expansion = 1e-5", "", ["'summer': [case.elongations.bars]", "go together"]),
    ("shortening = 0.5", "", ["'tight': [case.elongations.cable]", "give temperature"]),
    ("shortening = 0.5", "shortening = nan", ["shortening must be a finite number"]),
    ("wind = 1.5", "win = 1.5", ["[[case]] 'all of it'", "no case above has the name 'win'", "'wind'"]),
    ("wind = 1.5", "wind = true", ["the factor of wind must be a finite number"]),
    ("combine = { wind = 1.5, weight = 1.35, sunk = 1.0 }", "combine = 3", ["combine must be factors"]),
    ('name = "tight"', "name = 3", ["a name of its own, a text"]),
]


@pytest.mark.parametrize(("old", "new", "words"), BAD)
def test_wrong_tables_name_the_case_and_the_key(file, old, new, words):
    with pytest.raises(ValueError) as caught:
        latinpc.read(file(old, new))
    for word in ("frame.toml", *words):
        assert word in str(caught.value)
    with pytest.raises(ValueError, match=r"must be tables, written \[\[case\]\]"):
        latinpc.read(file(cases="[case]\nname = 'a'\n"))


def test_the_command_solves_all_cases_and_writes_their_envelope(file, tmp_path):
    path = file()
    files = ["--json", tmp_path / "c.json", "--csv", tmp_path / "c.csv", "--picture", tmp_path / "c.png"]
    text = command("cases", path, *files).stdout
    report = json.loads((tmp_path / "c.json").read_text())
    names = ["weight", "sunk", "summer", "tight", "all of it"]
    assert [case["name"] for case in report["cases"]] == names and all(case["converged"] for case in report["cases"])
    assert (tmp_path / "c.png").stat().st_size > 10000 and len((tmp_path / "c.csv").read_text().splitlines()) == 4
    for word in ("frame: 5 load cases, 3 nodes, 3 links", *names, "highest", "lowest", "slack", "one set-up", "c.csv"):
        assert word in text
    assert command("cases", path, ranks=2).stdout.count("all of it") == text.count("all of it")
    assert json.loads(command("cases", path, "--json", "-").stdout)["cases"] == pytest.approx(report["cases"])
    assert "load cases     5, none of them acts here" in command("solve", path).stdout
    alone = command("solve", path, "--case", "tight", "--json", tmp_path / "t.json").stdout
    assert alone.startswith("frame: tight") and json.loads((tmp_path / "t.json").read_text())["converged"]


WRONG = [
    (["cases", "FILE", "--case", "tight"], "latinpc cases solves all"),
    (["cases", "FILE", "--csv", "c.txt"], "c.txt: cannot write '.txt' files"),
    (["cases", "lattice"], "lattice has no load case to solve"),
    (["solve", "FILE", "--case", "tigt"], "frame.toml: no [[case]] has the name 'tigt' (do you mean 'tight'?)"),
    (["solve", "lattice", "--case", "tight"], "--case has no meaning for the scene lattice"),
]


@pytest.mark.parametrize(("arguments", "word"), WRONG)
def test_wrong_commands_are_one_clear_line(arguments, word, file, tmp_path):
    result = command(*[str(file()) if one == "FILE" else one for one in arguments], code=2, cwd=tmp_path)
    assert len(said(result)) == 1 and word in result.stderr


def test_cases_that_do_not_converge_are_named(file):
    bridge = ROOT / "examples" / "footbridge.msh"
    result = command(
        "cases",
        bridge,
        "--preset",
        "balanced",
        "-snes_max_it",
        4,
        "-snes_latin_newton",
        "never",
        "-snes_stol",
        1e-8,
        code=1,
    )
    assert said(result)[-1].startswith("latinpc: not converged: crowd alone: DIVERGED_MAX_IT; half a crowd more: ")
    assert result.stdout.count("DIVERGED_MAX_IT") == 6 and "highest" in result.stdout


def test_the_page_names_every_key_of_cases():
    from latinpc.files.cases import KEYS, TABLES

    page = (ROOT / "docs" / "cases.md").read_text()
    for key in (*KEYS, *(key for keys in TABLES.values() for key in keys), *COLUMNS):
        assert key in page
