"""Diagrams, tables and exit codes of the commands that measure, from the results that benchmarks/ keeps."""

import json

import pytest
from conftest import ROOT
from test_pictures import drawn  # noqa: F401

from latinpc import cli
from latinpc.bench import compare, extremes, figures, tradeoff
from latinpc.cli import ranks

GRID = ["tensegrity-grid", "--modules", "8", "--subdomains", "4"]


def kept(name):
    """Return the measurements of a benchmark."""
    return json.loads((ROOT / "benchmarks" / "results" / f"{name}.json").read_text())


def run(*arguments):
    """Run the command line in this process and return its exit code."""
    with pytest.raises(SystemExit) as left:
        cli.main([str(argument) for argument in arguments])
    return left.value.code


def test_bars_tell_what_has_failed(tmp_path, drawn):  # noqa: F811
    document = kept("compare-48")
    document["rows"][1]["converged"] = False
    document["rows"][-1]["solve_seconds"] = None
    figures.bars(document, tmp_path / "bars.svg")
    names = [row["method"] for row in document["rows"]]
    assert f"{names[1]} *" in drawn[0] and "* not converged" in drawn[0]
    assert f"no result: {names[-1]}" in drawn[0]
    assert all(name in drawn[0] for name in names) and "1e-4" in drawn[0]


def test_diagrams_have_a_panel_for_each_knob(tmp_path, drawn):  # noqa: F811
    document = kept("tradeoff-48")
    document["curves"][0]["points"] = []
    figures.diagrams(document, tmp_path / "curves.svg")
    assert f"{document['curves'][0]['label']}: none" in drawn[0]
    assert all(curve["knob"] in drawn[0] for curve in document["curves"])


def test_other_diagrams_of_the_benchmarks(tmp_path, drawn):  # noqa: F811
    figures.distributions(kept("effectivity"), tmp_path / "effectivity.svg")
    figures.slackening(kept("slack"), tmp_path / "slack.svg")
    assert "l2: Anderson, METIS" in drawn[0] and "estimate" in drawn[0]
    assert "tensegrity-grid" in drawn[1] and "slack cables (%)" in drawn[1]


@pytest.mark.parametrize("terminal", [False, True])
@pytest.mark.parametrize(("module", "name"), [(compare, "compare"), (tradeoff, "tradeoff")])
def test_measurements_are_printed_written_and_drawn(module, name, terminal, tmp_path, monkeypatch, capsys):
    document, asked = kept(f"{name}-48"), []
    monkeypatch.setattr(module, name, lambda scene, *others: asked.append(scene) or document)
    monkeypatch.setenv("COLUMNS", "400")
    if terminal:
        monkeypatch.setenv("FORCE_COLOR", "1")
    files = {"--json": tmp_path / "d.json", "--picture": tmp_path / "d.png"}
    assert run(name, *GRID, *(word for pair in files.items() for word in pair)) == 0
    assert len(asked[0].links) == 1024
    assert json.loads(files["--json"].read_text()) == document
    assert files["--picture"].stat().st_size > 10000
    told = capsys.readouterr().out
    for row in document.get("rows", document.get("curves")):
        assert row.get("method", row.get("label")) in told
    assert ("\033[" in told) == terminal


def test_what_has_not_converged_is_told_by_the_exit_code(monkeypatch, capsys):
    document = kept("compare-48")
    document["rows"][0] |= {"converged": False, "reason": "DIVERGED_MAX_IT"}
    monkeypatch.setattr(compare, "compare", lambda *others: document)
    assert run("compare", *GRID) == ranks.NOT_CONVERGED
    assert "not converged: DIVERGED_MAX_IT" in capsys.readouterr().out
    assert run("compare", *GRID, "--json", "-") == ranks.NOT_CONVERGED
    assert json.loads(capsys.readouterr().out) == document


def test_defaults_that_reach_nothing_are_told_by_the_exit_code(monkeypatch, capsys):
    document = kept("tradeoff-48")
    monkeypatch.setattr(tradeoff, "tradeoff", lambda *others: document)
    failed = next(curve for curve in document["curves"] if curve["label"] != "default" and curve["points"])
    failed |= {"points": [], "reason": "too late"}
    assert run("tradeoff", *GRID) == 0  # a choice may fail
    failed = next(curve for curve in document["curves"] if curve["label"] == "default")
    failed |= {"points": [], "reason": "DIVERGED_MAX_IT"}
    assert run("tradeoff", *GRID) == ranks.NOT_CONVERGED
    assert "DIVERGED_MAX_IT" in capsys.readouterr().out


def test_extremes_are_told_by_group_and_by_the_exit_code(monkeypatch, tmp_path, capsys):
    document, chosen = kept("extremes"), []
    monkeypatch.setattr(extremes, "run_all", lambda cases, say: chosen.append(cases) or document)
    group = extremes.cases()[0].group
    assert run("extremes", "--group", group, "--json", tmp_path / "e.json") == 0
    assert chosen[0] and all(case.group == group for case in chosen[0])
    assert json.loads((tmp_path / "e.json").read_text()) == document
    told = capsys.readouterr().out
    assert f"{document['counts']['right']} right" in told and document["cases"][-1]["name"] in told
    _, table = extremes.by_group(document)
    assert sum(int(row[1]) for row in table) == len(document["cases"])
    document["counts"]["wrong"] = 1
    assert run("extremes") == ranks.NOT_CONVERGED
    assert len(chosen[1]) == len(extremes.cases())


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["extremes", "--group", "nothing"], "choose from"),
        (["tradeoff", *GRID, "--accuracies", "1e-2,2"], "between 0 and 1"),
        (["tradeoff", *GRID, "--accuracies", "1e-2,small"], "1e-2,1e-4"),
        (["compare", *GRID, "--picture", "c.stl"], "c.stl"),
        (["compare", *GRID, "--methods", "nothing"], "unknown method 'nothing'"),
        (["tradeoff", *GRID, "--knobs", "nothing"], "unknown knob 'nothing'"),
        (["paper", "4", "--picture", "p.png"], "--picture is for fig8 and fig9"),
    ],
)
def test_bad_requests(arguments, word, capsys):
    assert run(*arguments) == 2
    assert word in capsys.readouterr().err


@pytest.mark.parametrize("terminal", [False, True])
def test_a_table_of_the_article(terminal, tmp_path, monkeypatch, capsys):
    """Table 3 of the smallest grid: ours are the article's."""
    monkeypatch.setenv("COLUMNS", "400")
    if terminal:
        monkeypatch.setenv("FORCE_COLOR", "1")
    assert run("paper", "3", "--subdomains", "9", "--json", tmp_path / "t.json") == 0
    assert json.loads((tmp_path / "t.json").read_text())["same"]
    told = capsys.readouterr().out
    assert "Table 3." in told and "article" in told and "1,443" in told.replace("1443", "1,443")


@pytest.mark.parametrize("number", [8, 9])
def test_a_figure_of_the_article(number, tmp_path, capsys, drawn):  # noqa: F811
    picture = tmp_path / "f.png"
    code = run("paper", f"fig{number}", "--subdomains", "9", "--picture", picture, "--json", tmp_path / "f.json")
    assert code == 0 and picture.stat().st_size > 10000
    assert json.loads((tmp_path / "f.json").read_text())["figure"] == number
    assert f"Figure {number}" in capsys.readouterr().out
    assert ("Vertical displacement" if number == 8 else "Tension in cables") in drawn[0]
