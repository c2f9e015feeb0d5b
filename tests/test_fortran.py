"""The Fortran module: every function of the header, compiled without warnings, and called."""

import os
import re
import shutil
from pathlib import Path

import pytest
from conftest import PETSC_FOLDERS, ROOT, run

import latinpc

MODULE = Path(latinpc.get_include()) / "latinpc.F90"
SHARED = Path(latinpc.get_library())


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    """The program of tests/fortran_module.F90."""
    if not shutil.which("mpif90") or not list(PETSC_FOLDERS[1].glob("**/petscsnes.mod")):
        pytest.skip("no Fortran compiler, or a PETSc without Fortran modules")
    folder = tmp_path_factory.mktemp("fortran")
    path = os.pathsep.join(str(petsc / "lib" / "pkgconfig") for petsc in PETSC_FOLDERS)
    flags = run(["pkg-config", "--cflags", "--libs", "PETSc"], env={"PKG_CONFIG_PATH": path}).stdout.split()
    rpath = [f"-Wl,-rpath,{word[2:]}" for word in (*flags, f"-L{SHARED.parent}") if word.startswith("-L")]
    checks = ["-Wall", "-Wextra", "-Werror", "-Wno-c-binding-type", "-fcheck=all", "-ffree-line-length-0"]
    compiler = ["mpif90", "-g", f"-J{folder}"]
    for source, warnings in ((MODULE, checks), (ROOT / "tests" / "fortran_module.F90", checks[4:])):
        run([*compiler, *warnings, "-c", source, "-o", folder / f"{source.stem}.o", *flags[:-1]], timeout=100)
    objects = [folder / "latinpc.o", folder / "fortran_module.o"]
    run([*compiler, *objects, "-o", folder / "program", SHARED, *flags, *rpath])
    return folder / "program"


def test_the_module_has_all_of_the_header():
    header, module = (ROOT / "latinpc" / "include" / "latinpc.h").read_text(), MODULE.read_text()
    functions = set(re.findall(r"PETSC_EXTERN PetscErrorCode (\w+)\(", header)) - {"LatinGetStatisticsOfSize"}
    assert len(functions) > 70
    assert functions | {"LatinGetStatistics"} <= set(re.findall(r"(?:subroutine|interface) (\w+)", module))
    constants = set(re.findall(r"^  (LATIN_\w+)", header, re.MULTILINE))
    assert len(constants) > 30
    assert constants == set(re.findall(r"\b(LATIN_\w+) = \d+", module))


def test_functions_that_fortran_cannot_call_end_the_build(monkeypatch):
    """A new kind of argument is not left out."""
    monkeypatch.syspath_prepend(ROOT / "packaging")
    from fortran_module import subroutine

    assert "  subroutine LatinNew(structure, x, ierr)" in subroutine("LatinNew", "LatinStructure, PetscReal x", set())
    with pytest.raises(ValueError, match="LatinNew: no counterpart in Fortran of size_t room"):
        subroutine("LatinNew", "LatinStructure, size_t room", set())


@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_every_kind_of_argument(program, tmp_path, ranks):
    result = run(["mpirun", "-n", ranks, program], cwd=tmp_path)
    assert result.stdout == "all right\n", result.stdout


@pytest.mark.parametrize("option, text", [
    ("-without_laws", "Link 0 has no stiffness: call LatinStructureSetLaws() before LatinStructureSetUp()"),
    ("-one_load", "SNESLatinSolveCases(): an array has fewer columns than there are load cases"),
])  # fmt: skip
def test_an_error_names_the_line_in_fortran(program, tmp_path, option, text):
    result = run([program, option], cwd=tmp_path, check=False)
    assert result.returncode
    assert text in result.stderr
    assert re.search(r"fortran_module\.F90:\d+", result.stderr)
