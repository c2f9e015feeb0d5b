"""What solved load cases give in Python: results by name, stresses and utilisations, tables, notices."""

import csv
import warnings

import numpy as np
import pytest
from command import latinpc as command

import latinpc
from latinpc import Case
from latinpc.scenes.scene import Scene

pytestmark = pytest.mark.filterwarnings("ignore::latinpc.LatinWarning")


def corner(**more):
    """A node that two cables hold, of 1 cm2 and strengths of 50 and 100 kPa; forces pull it, and push it."""
    given = {"area": 1e-4, "strength": [5e4, 1e5]} | more
    fixed = [[1, 1], [0, 0], [1, 1]]
    structure = latinpc.Structure([[0, 0], [1, 0], [1, -1]], [[0, 1], [2, 1]], "cable", 1e3, fixed=fixed, **given)
    forces = {"weak": [1.0, 2.0], "strong": [6.0, 5.0], "push": [-1.0, -1.0]}
    return structure, [Case(name, load=[[0, 0], force, [0, 0]]) for name, force in forces.items()]


def test_a_case_is_a_result_by_its_name():
    structure, cases = corner()
    found = latinpc.solve_cases(structure, cases)
    assert (len(found), list(found)) == (3, ["weak", "strong", "push"]) and "strong" in found and "no" not in found
    one, alone = found["strong"], cases[1].applied(Scene.from_structure(structure)).solve()
    assert one.converged and one.tensions == pytest.approx(alone.tensions) and one.utilisation.max() > 1.0
    assert one.reactions == pytest.approx(alone.reactions) and one.largest_unbalance < 1e-9
    for line in str(alone).splitlines():
        if line.split()[0] in ("forces", "worst", "reactions", "stress", "utilisation"):
            assert line in str(one)
    said = str(found["push"])
    assert "not converged" in said and "no equilibrium: slack links no longer hold node 1" in said
    with pytest.raises(KeyError, match="no load case has the name 'snow'; there are weak, strong, push"):
        found["snow"]


def test_the_result_of_a_case_bears_its_part_of_the_loads():
    """A truss of two bars that snaps through."""
    nodes, fixed = [[-1.0, 0.0], [1.0, 0.0], [0.0, 0.1]], [[1, 1], [1, 1], [0, 0]]
    truss = latinpc.Structure(nodes, [[0, 2], [1, 2]], "bar", fixed=fixed, EA=1e6, geometry="large")
    found = latinpc.solve_cases(truss, [Case("snap", load=[[0, 0], [0, 0], [0, -2000.0]])])
    one, factor = found["snap"], found.report["cases"][0]["load_factor"]
    assert 0.0 < factor < 1.0 and not one.converged
    assert one.load[2] == pytest.approx([0.0, -2000.0 * factor]) and one.largest_unbalance < 1e-3 * 2000.0
    assert one.reactions == pytest.approx(found.reactions[0])


def test_cases_without_results_have_no_numbers(tmp_path):
    structure, cases = corner()
    found = latinpc.solve_cases(structure, cases)
    for values in (found.tensions, found.displacements, found.reactions[:, [0, 2]], found.stress, found.utilisation):
        assert np.isnan(values[2]).all() and np.isfinite(values[:2]).all()
    row = found.report["cases"][2]
    assert row["lowest"] is row["displacement"] is row["slack"] is row["largest_stress"] is None
    found.to_csv(tmp_path / "e.csv", tmp_path / "r.csv")
    with open(tmp_path / "r.csv", encoding="utf-8") as file:
        assert {line["push (N)"] for line in csv.DictReader(file)} == {""}


def test_stresses_and_utilisations(tmp_path):
    structure, cases = corner()
    found = latinpc.solve_cases(structure, cases)
    assert found.stress[:2] == pytest.approx(1e4 * np.array([[1.0, 2.0], [6.0, 5.0]]))
    assert found.utilisation[:2] == pytest.approx(np.array([[0.2, 0.2], [1.2, 0.5]]))
    assert [row["largest_utilisation"] for row in found.report["cases"][:2]] == pytest.approx([0.2, 1.2])
    assert "utilisation  largest 120 % in case strong: link 0; above 100 % in 1 link" in str(found)
    assert "stress       largest 60 kPa in case strong: link 0" in str(found)
    found.to_csv(tmp_path / "e.csv")
    with open(tmp_path / "e.csv", encoding="utf-8") as file:
        first, second = csv.DictReader(file)
    assert float(first["stress (Pa)"]) == pytest.approx(6e4) and float(first["utilisation"]) == pytest.approx(1.2)
    assert first["worst_case"] == second["worst_case"] == "strong" and float(second["highest (N)"]) == pytest.approx(5)
    plain = latinpc.solve_cases(*corner(area=None, strength=None))
    assert plain.stress is None and plain.utilisation is None and "stress" not in str(plain)
    plain.to_csv(tmp_path / "e.csv")
    assert "stress" not in (tmp_path / "e.csv").read_text()


def test_the_largest_stress_may_be_compression():
    bar = latinpc.Structure([[0.0], [1.0]], [[0, 1]], "bar", 1e3, fixed=[[1], [0]], area=1e-4)
    found = latinpc.solve_cases(bar, [Case("pull", load=[[0], [1.0]]), Case("push", load=[[0], [-2.0]])])
    assert "largest -20 kPa in case push: link 0" in str(found)


def test_the_command_names_the_worst_link(tmp_path):
    (tmp_path / "nodes.csv").write_text("node,x,fix\na,0,x\nb,1,\n")
    (tmp_path / "members.csv").write_text("member,start,end,EA,area,strength\ntie,a,b,1e3,1e-4,1e5\n")
    (tmp_path / "tie.toml").write_text("[[case]]\nname = 'wind'\n[case.loads.all]\nforce = [8.0]\n")
    said = command("cases", tmp_path, "--csv", tmp_path / "e.csv").stdout
    assert "  utilisation    largest 80 % in case wind: link tie\n" in said
    assert ",0.8" in (tmp_path / "e.csv").read_text()


def test_tables_of_pandas_and_notebooks():
    pandas = pytest.importorskip("pandas")
    structure, cases = corner()
    found = latinpc.solve_cases(structure, cases)
    assert "<td" in found._repr_html_() and "strong" in found._repr_html_() and "utilisation" in found._repr_html_()
    envelope, reactions = found.to_pandas()
    assert isinstance(envelope, pandas.DataFrame) and envelope.loc[0, "utilisation"] == pytest.approx(1.2)
    assert reactions.loc[(0, "x"), "strong (N)"] == pytest.approx(-6.0)


def test_a_case_says_what_acts_in_it():
    case = Case("snow", load=[[0, 0], [1.0, 0], [0, 2.0]], initial_elongation=[0.0, 1e-3])
    assert repr(case) == "Case('snow': loads on 2 nodes, elongations of 1 link)"
    assert repr(Case("none")) == "Case('none': nothing acts)"


def test_sums_and_single_cases():
    structure, (weak, strong, _) = corner()
    assert sum([weak, strong]).load[1].tolist() == [7.0, 7.0]
    with pytest.raises(TypeError):
        1 + weak
    with pytest.raises(TypeError, match=r"cases must be a list, such as \[weak\], not a single latinpc.Case"):
        latinpc.solve_cases(structure, weak)


def test_cases_that_shorten_a_link_to_nothing_say_so():
    """As a single solve does, once for alike cases, and not again what is so in every case."""
    structure, (weak, strong, _) = corner()
    short = Case("short", initial_elongation=[1.5, 0.0])
    found = latinpc.solve_cases(structure, [weak, (weak + short).named("one"), (strong + short).named("two")])
    (said,) = (notice for notice in found.notices if "larger than" in notice)
    assert said.startswith("cases one, two: the initial elongation of link 0 is larger than it is long")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        always = latinpc.solve_cases(corner(initial_elongation=[1.5, 0.0])[0], [weak, (weak + short).named("more")])
    assert len([text for text in always.notices if "larger than" in text]) == 1 and caught
