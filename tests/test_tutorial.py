"""The tutorial: each job takes at most fifteen lines of code, which run as they are on the page."""

import contextlib
import os
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import matplotlib
import numpy as np
import pytest
from conftest import ROOT
from petsc4py import PETSc

TUTORIAL = ROOT / "docs" / "tutorial"
JOBS = ("demo", "truss", "net", "mast", "import", "accuracy", "drop", "mistakes", "contact", "notebook")
CELL = re.compile(r"^```\{code-cell\}[^\n]*\n(.*?)^```$", re.DOTALL | re.MULTILINE)
MOST = 15
#: A part of what each page prints, from the mathematics of its structure
SAYS = {
    "demo": ["7% of the links are slack"],
    "truss": ["[    0. 20000.]"],
    "net": ["saddle"],
    "mast": ["wind 330", "N pulled at "],
    "import": ["tables 24 links", "DXF    24 links", "OBJ    24 links", "compas 24 links"],
    "accuracy": ["{'error': 1e-08}", "rounding does not allow the accuracy"],
    "drop": ["iterations a step"],
    "contact": [
        "30000 N: displacements [0.   1.25 1.   0.  ] mm",
        "False no stable equilibrium was found: the displacements grow without end",
    ],
    "notebook": ["newtonls", "indicator"],
}
MISTAKES = [
    "join a node that does not exist",
    "load must have the shape (3, 2)",
    "unknown law 'rope'",
    "Nothing is supported",
    "The structure has a mechanism",
    "If its prestress is to hold it",
    "slack links no longer hold node 2",
    "look at units, stiffnesses and supports",
    "links join the same two nodes by the same law: 1 and 2",
    "do you mean -snes_latin_variant?",
]


def cells(job):
    """Return the cells of a page: code, and whether an error is expected."""
    found = []
    for text in CELL.findall((TUTORIAL / f"{job}.md").read_text()):
        lines = text.splitlines()
        tags = [line for line in lines if line.startswith(":")]
        found.append(("\n".join(lines[len(tags) :]), any("raises-exception" in tag for tag in tags)))
    return found


def test_every_page_is_a_job():
    assert {path.stem for path in TUTORIAL.glob("*.md")} == {*JOBS, "index"}


@pytest.mark.parametrize("job", JOBS)
def test_a_job_takes_few_lines(job):
    lines = [line.strip() for code, _ in cells(job) for line in code.splitlines()]
    count = len([line for line in lines if line and not line.startswith("#")])
    assert 1 <= count <= MOST, f"{job}.md has {count} lines of code"


def shown(path):
    """Take the place of IPython's Image."""
    assert Path(path).stat().st_size > 10000
    return path


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with the files of the tutorial, to which pages write theirs."""
    for path in TUTORIAL.iterdir():
        if path.suffix not in (".md", ".py", ".png", ".gif"):
            (tmp_path / path.name).symlink_to(path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]))
    ipython = ModuleType("IPython")  # notebooks have it, the tests need not
    ipython.get_ipython = lambda: None
    monkeypatch.setitem(sys.modules, "IPython", ipython)
    monkeypatch.setitem(sys.modules, "IPython.display", SimpleNamespace(Image=shown))
    matplotlib.use("Agg")
    before = PETSc.Options().getAll()
    yield tmp_path
    assert PETSc.Options().getAll() == before


def run_cell(code, names):
    """Run a cell as a notebook does: `!` begins a line for the shell, a last expression is shown."""
    commands = [line[1:] for line in code.splitlines() if line.startswith("!")]
    for command in commands:
        done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, timeout=100)
        assert done.returncode == 0, done.stderr
        print(done.stdout)
    if not commands:
        exec(compile(code, "cell", "exec"), names)


# `make docs` runs the film as well
RUN = [pytest.param(job, marks=pytest.mark.slow if job == "drop" else ()) for job in JOBS if job != "mistakes"]


@pytest.mark.parametrize("job", RUN)
def test_a_page_runs_and_says(job, folder, capsys):
    names = {}
    for code, _ in cells(job):
        run_cell(code, names)
    printed = capsys.readouterr().out
    for text in SAYS[job]:
        assert text in printed, printed
    if "result" in names:
        assert names["result"].converged == (job != "accuracy")  # its last one asks for too much
    if job == "drop":
        energy = np.add(names["report"]["kinetic_energy"], names["report"]["potential_energy"])
        assert (np.diff(energy) <= 1e-3 * energy[0]).all() and energy[-1] < 0.9 * energy[0]
    if job == "net":  # under three times the load some cables slacken
        assert names["result"].slack.sum() == 0 < names["net"].solve().slack.mean() < 0.1


def test_mistakes_print_what_the_page_is_about(folder):
    names, said = {}, []
    first, *others = cells("mistakes")
    run_cell(first[0], names)
    for code, fails in others:
        with pytest.warns() if not fails else contextlib.nullcontext() as warned:
            if fails:
                with pytest.raises(Exception) as error:
                    run_cell(code, names)
                said.append(str(error.value))
            else:
                run_cell(code, names)
                said.append(" ".join(str(w.message) for w in warned))
    assert len(said) == len(MISTAKES)
    for text, expected in zip(said, MISTAKES):
        assert expected in text


def test_files_are_those_that_the_script_writes(tmp_path, monkeypatch):
    import runpy

    written = runpy.run_path(str(TUTORIAL / "files.py"))
    monkeypatch.setitem(written["write_dome"].__globals__, "HERE", tmp_path)
    written["write_dome"]()
    written["write_mast"]()
    files = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert len(files) == 7
    for path in files:
        assert path.read_text() == (TUTORIAL / path.relative_to(tmp_path)).read_text()
