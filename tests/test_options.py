"""The tables of options/README.md, `-help` and the files in options/ say the same; the pages' commands run."""

import importlib
import os
import re
import shlex
import sys
from pathlib import Path

import pytest
from conftest import ROOT, run

from latinpc import options
from latinpc.scenes import make

sys.path.insert(0, str(ROOT / "docs" / "_ext"))
TYPES = importlib.import_module("c_pages").solver_types()
README = (ROOT / "README.md").read_text()
SOLVING = (ROOT / "docs" / "solving.md").read_text()
WITH_COMMANDS = ["README.md", *(f"docs/{name}.md" for name in ("checkpoints", "commands", "diagnostics", "motions"))]
OPTIONS = (ROOT / "options" / "README.md").read_text()
COMMAND = [Path(sys.executable).parent / "latinpc", "solve"]
HELP_OF = {
    "snes": ["tensegrity-grid", "--modules", "6", "--subdomains", "9", "-snes_latin_stop", "error", "-help"],
    "pc": ["truss-grid", "--modules", "6", "--subdomains", "9", "-snes_type", "ksponly", "-ksp_type", "cg",
           "-pc_type", "latin", "-help"],
    "ksp": ["truss-grid", "--modules", "6", "--subdomains", "9", "-snes_type", "ksponly",
            "-ksp_type", "latin", "-help"],
    "ts": ["impact-grid", "--modules", "4", "--num-steps", "1", "-help"],
}  # fmt: skip
RUBS = [
    "packing",
    "--side",
    "10",
    "--law",
    "friction",
    "-help",
]  # the same family: its solver is made where it is needed
ROW = re.compile(r"^\| `-((?:snes|ksp|pc|ts|latin)_\w+?)(\*?)` \|([^|]*)\|([^|]*)\|([^|]*)\|([^|]*)\|$", re.MULTILINE)
LINE = re.compile(r"^ +-(\w+):? ?(?:<(?:now )?(.*?) : (?:formerly )?(.*?)>)?:? ?(.*)$")


def rows(family):
    """Rows of the tables: key -> (values, default); and the inner prefixes."""
    table, prefixes = {}, []
    for key, star, values, default, _, _ in ROW.findall(OPTIONS):
        if key.startswith(family + "_"):
            if star:
                prefixes.append(key)
            else:
                assert key not in table, f"-{key} stands twice in options/README.md"
                table[key] = (re.findall(r"`([^`]+)`", values), default.strip().strip("`"))
    return table, prefixes


@pytest.fixture(scope="module", params=HELP_OF)
def described(request):
    """For a family of options: rows and prefixes of the tables, and what -help prints: key -> (default, rest)."""
    family = request.param
    printed = {}
    scenes = (HELP_OF[family], RUBS) if family == "snes" else (HELP_OF[family],)
    for line in "".join(run([*COMMAND, *scene]).stdout for scene in scenes).splitlines():
        match = LINE.match(line)
        if match:
            now, before, rest = match.groups()[1:]
            printed.setdefault(match[1], (now if before == "(null)" else before, rest))
    return family, *rows(family), printed


def same(written, printed):
    """Compare a default of the tables with that of -help, as numbers where they are."""
    try:
        return float(written) == float(printed)
    except ValueError:
        return written.lower() == printed.lower()


def test_every_key_of_ours_is_in_the_readme(described):
    family, table, prefixes, printed = described
    ours = {key for key in printed if key.startswith(f"{family}_latin_") and not key.startswith(tuple(prefixes))}
    assert ours <= table.keys(), ours - table.keys()
    assert len(ours) == {"snes": 17, "pc": 6, "ksp": 5, "ts": 1}[family]


def test_the_manual_pages_of_the_types_list_every_key(described):
    family, table, prefixes, printed = described
    (page,) = (text for name, (_, text) in TYPES.items() if name == f"{family.upper()}LATIN")
    listed = dict(re.findall(r"^[+.-] -(\w+) (?:<(.*?)>)? *- ", page, re.MULTILINE))
    ours = {key for key in printed if key.startswith(f"{family}_latin_") and not key.startswith(tuple(prefixes))}
    assert ours <= listed.keys(), ours - listed.keys()
    unknown = {key for key in listed if key.startswith(f"{family}_latin_")} - table.keys() - set(prefixes)
    assert not unknown, unknown
    for key in listed.keys() & table.keys():
        assert not listed[key] or same(table[key][1], listed[key]), key


def test_help_lists_no_key_that_nobody_should_set(described):
    printed = described[-1]
    assert not [
        key
        for key in printed
        if "latin_" in key and not key.startswith(("snes_latin_", "ksp_latin_", "pc_latin_", "ts_latin_"))
    ]


def test_every_key_of_the_readme_is_in_help(described):
    _, table, prefixes, printed = described
    assert table.keys() <= printed.keys(), table.keys() - printed.keys()
    for prefix in prefixes:
        assert any(key.startswith(prefix) for key in printed), prefix


def test_defaults_and_choices_are_those_of_help(described):
    _, table, _, printed = described
    for key, (values, default) in table.items():
        told, rest = printed[key]
        if told is not None:
            assert same(default, told), f"-{key}: table {default}, -help {told}"
        choices = re.search(r"\(choose one of\) (.*) \(\w+\)$", rest)
        if choices:
            assert values == choices[1].split(), key


def test_every_line_says_what_it_is_for():
    """A meaning, and a scene where it wins or what it is for; no more lines than can be read."""
    table = ROW.findall(OPTIONS)
    assert len(table) == len(re.findall(r"^\| `-", OPTIONS, re.MULTILINE))
    assert len(table) <= 55
    assert [key for key, *_, meaning, wins in table if not (meaning.strip() and wins.strip())] == []


def test_options_name_their_setters(described):
    """Whoever reads -help finds the function that does the same in code."""
    family, table, prefixes, printed = described
    ours = [key for key in table if key.startswith(f"{family}_latin_") and not key.startswith(tuple(prefixes))]
    header = (ROOT / "latinpc" / "include" / "latinpc.h").read_text()
    for key in ours:
        setter = re.search(r"\((\w+)\)$", printed[key][1])
        if not key.endswith("_monitor"):  # a viewer, which only options make
            assert setter and f" {setter[1]}(" in header, (key, printed[key][1])


def test_command_line_knows_the_same_options():
    inner = tuple(options.INNER_PREFIXES)
    for family, known in (
        ("snes", set(options.OPTIONS)),
        ("ksp", set(options.OPTIONS)),
        ("pc", set(options.OPTIONS)),
    ):
        table, prefixes = rows(family)
        keys = {key.split("_latin_")[1] for key in table if "_latin_" in key}
        ours = {key for key in keys if not key.startswith(inner)}
        assert ours == known if family == "snes" else ours <= known
        assert {prefix.split("_latin_")[1] for prefix in prefixes} <= set(inner)


@pytest.mark.parametrize("path", sorted((ROOT / "options").glob("*.opts")), ids=lambda path: path.name)
def test_options_file_is_used_to_the_last_line(path):
    lines = re.findall(r"^#\s+latinpc solve (.*)$", path.read_text(), re.MULTILINE)
    assert lines, "an options file opens with the command that uses it"
    for line in lines:
        result = run([*COMMAND, *shlex.split(line), "-options_left"], cwd=ROOT)
        assert "There are no unused options" in result.stdout
        assert "unknown option" not in result.stderr
    assert f"options/{path.name}" in OPTIONS


@pytest.mark.parametrize("page", sorted(ROOT.glob("[!.]*/**/*.md")) + [ROOT / "README.md"], ids=lambda page: page.name)
def test_pages_name_what_exists(page):
    text = page.read_text()
    for target, section in re.findall(r"\]\(([^)#:]*)#?([^)#:]*)\)", text):
        there = page.parent / target if target else page
        assert there.exists(), target
        if section and there.suffix == ".md":
            titles = re.findall(r"^#+ (.*)$", there.read_text(), re.MULTILINE)
            assert section in {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}, section
    for path in re.findall(r"`((?:options|examples|latinpc|benchmarks)/[\w./]+)`", text):
        assert (ROOT / path).exists() or path.endswith((".so", ".F90")), path  # builds make these


def test_readme_program_runs(tmp_path, monkeypatch, capsys):
    """The one of ten lines, what goes on from it with petsc4py, and the ways to solve it."""
    monkeypatch.chdir(tmp_path)
    program = re.compile(r"```python\n(.*?)```", re.DOTALL)
    (first,), (solves, second) = program.findall(README), program.findall(SOLVING)
    names = {}
    exec(first, names)
    assert "largest 1 mm" in capsys.readouterr().out
    assert names["result"].displacements[3, 1] == pytest.approx(-1e-3)
    assert (tmp_path / "net.png").stat().st_size > 10000
    assert len(first.splitlines()) <= 11
    exec(second, names)
    assert names["snes"].reason > 0
    exec(solves, names)
    assert names["result"].converged


def commands():
    """Lines of pages that begin with a command of ours, each once."""
    lines = re.compile(r"^((?:latinpc|mpirun -n \d latinpc) .*)$", re.MULTILINE)
    found = [line for page in WITH_COMMANDS for line in lines.findall((ROOT / page).read_text())]
    found = [line for line in found if " roof.dxf" not in line]  # a drawing of the reader's
    return list(dict.fromkeys(line.split(" #")[0].strip() for line in found))


@pytest.mark.slow
@pytest.mark.parametrize("line", commands())
def test_command_of_a_page_runs(line, tmp_path):
    if line == "latinpc extremes":
        line += " --group slack"  # the whole catalogue is for test_extremes.py
    line = line.replace("steps 5000", "steps 100")  # minutes
    before, restart, _ = line.partition(" --restart ")
    if restart:  # from the state of a run that ended early
        line = f"{before.replace('steps 100', 'steps 50')} && {line}"
    for name in ("docs", "examples", "options"):
        (tmp_path / name).symlink_to(ROOT / name)
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    assert run(["bash", "-c", line], cwd=tmp_path, env={"PATH": path}).stdout


def test_equation_map_names_functions_of_the_file():
    section = (ROOT / "docs" / "developers.md").read_text().split("## Where the equations are")[1].split("\n## ")[0]
    named = re.findall(r"`([\w/]+\.[ch])`: ((?:`\w+`(?:, )?)+)", section)
    assert len(named) > 30
    for file, functions in named:
        source = (ROOT / "latinpc" / "src" / file).read_text()
        for function in re.findall(r"`(\w+)`", functions):
            assert re.search(rf"^[\w ]+\*?\b{function}\(.*\)\n{{", source, re.MULTILINE), f"{file}: {function}"


def test_steps_start_warm():
    printed = run([*COMMAND, "impact-tower", "--levels", "2", "--num-steps", "1", "-help"]).stdout
    assert re.search("-snes_latin_warm_start:? <(now )?extrapolate", printed)


def test_flags_of_petsc_are_true_in_python(capfd):
    """A value "true" would be the name of a viewer."""
    found = make("tensegrity-grid", modules=4).solve(options={"snes_monitor": True, "snes_view": True})
    assert found.converged and "SNES Function norm" in capfd.readouterr().out
