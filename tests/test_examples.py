"""The examples are tests: every indented command line at the top of an example is run, and each asserts a number."""

import os
import re
import shlex
import shutil
import sys
from pathlib import Path

import pytest
from conftest import PETSC_FOLDERS, ROOT, run

import latinpc

EXAMPLES = ROOT / "examples"
SOURCES = sorted(path for path in EXAMPLES.iterdir() if path.suffix in (".py", ".c", ".F90"))
COMPILERS = ("mpicc", "mpif90")
COMMANDS = re.compile(r"^(?:!   | {4,})((?:python|latinpc|mpirun|mpicc|mpif90|\./\w+)\b.*)$", re.MULTILINE)


def header(source):
    """The comment or docstring that an example opens with."""
    text = source.read_text()
    if source.suffix == ".py":
        return text.split('"""')[1]
    return text.split("*/")[0] if source.suffix == ".c" else text.split("\n\n")[0]


def commands(source):
    return [command.strip() for command in COMMANDS.findall(header(source))]


def runs():
    for source in SOURCES:
        lines = commands(source)
        build = [line for line in lines if line.startswith(COMPILERS)]
        for line in lines:
            if line not in build:
                yield pytest.param(source, build, line, id=f"{source.name}: {line[:70]}")


@pytest.fixture(scope="module")
def folder_of(tmp_path_factory):
    """For each example a folder that looks like the source tree, for what its commands leave behind."""
    folders = {}

    def make(source):
        if source not in folders:
            folders[source] = tmp_path_factory.mktemp(source.name)
            for name in ("examples", "options"):
                (folders[source] / name).symlink_to(ROOT / name)
            (folders[source] / "latinpc").symlink_to(latinpc.__path__[0])  # in the tree or installed
        return folders[source]

    return make


def environment():
    return {
        "PKG_CONFIG_PATH": os.pathsep.join(str(path / "lib" / "pkgconfig") for path in PETSC_FOLDERS),
        "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]),
        "LD_LIBRARY_PATH": os.pathsep.join(str(path / "lib") for path in PETSC_FOLDERS),
    }


def shell(line, folder):
    return run(["bash", "-c", line], cwd=folder, env=environment(), timeout=100)


def compile_once(line, folder):
    words = shlex.split(line)
    if (folder / words[words.index("-o") + 1]).exists():
        return
    if not shutil.which(words[0]):
        pytest.skip(f"{words[0]} is not installed")
    if words[0] == "mpif90" and not list(PETSC_FOLDERS[1].glob("**/petscsnes.mod")):
        pytest.skip("this PETSc has no Fortran modules")
    shell(line, folder)


@pytest.mark.parametrize("source, build, line", runs())
def test_run_line(source, build, line, folder_of):
    folder = folder_of(source)
    for compilation in build:
        compile_once(compilation, folder)
    result = shell(line, folder)
    print(result.stdout)
    assert result.stdout.strip(), "an example tells what it has found"
    assert "PETSC ERROR" not in result.stderr


def test_every_example_is_run_asserts_and_works_on_two_ranks():
    numbered = [source for source in SOURCES if source.name[:2].isdigit()]
    assert {source.name[:2] for source in numbered} >= {f"{i:02}" for i in range(1, 9)}
    for source in numbered:
        assert any(line.startswith("mpirun -n 2 ") for line in commands(source)), source.name
        checks = {".py": r"^\s*assert ", ".c": r"wrong\s+= ", ".F90": r"error stop"}
        assert re.search(checks[source.suffix], source.read_text(), re.MULTILINE), source.name


def test_ranks_print_the_same_figures(folder_of):
    source = EXAMPLES / "07_partition.py"
    one, three = (shell(f"{launch}python examples/{source.name}", folder_of(source)) for launch in ("", "mpirun -n 3 "))
    assert one.stdout == three.stdout
