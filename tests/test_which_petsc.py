"""The PETSc that latinpc is built with, and the one that runs: what does not fit is refused, with the cure."""

import sys

import numpy as np
import pytest
from conftest import ROOT, run
from petsc4py import PETSc

import latinpc

LIBRARY = latinpc.get_library()
KINDS = {
    "int64": "PetscInt of 64 bits",
    "single": "PetscReal FLOAT and PetscScalar FLOAT",
    "complex": "PetscScalar COMPLEX",
    "newer": f"PETSc {PETSc.Sys.getVersion()[0]}.{PETSc.Sys.getVersion()[1] + 1} with",
    "development": "in development with",
}


def other(compile_c, kind):
    """Environment in which liblatinpc sees another PETSc."""
    return {"LD_PRELOAD": str(compile_c("other_petsc.c", "-shared", "-fPIC", "-ldl")), "LATINPC_PETSC": kind}


def refused(result, kind):
    """Whether a program has ended with an error that names both PETSc and the cure."""
    assert result.returncode
    assert "liblatinpc was compiled for PETSc" in result.stderr
    assert KINDS[kind] in result.stderr.split("but runs with")[1]
    assert "build it again" in result.stderr


@pytest.mark.skipif(PETSc.IntType().itemsize == 8, reason="the indices of this PETSc have 64 bits")
def test_appended_where_indices_have_64_bits(mpirun, compile_c):
    refused(
        mpirun(1, compile_c("plain_ksp.c"), "-dll_append", LIBRARY, check=False, env=other(compile_c, "int64")), "int64"
    )


@pytest.mark.slow
@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize(
    "kind", [kind for kind in KINDS if kind != "int64" and (kind != "single" or PETSc.RealType is not np.float32)]
)
def test_appended_to_another_petsc(mpirun, compile_c, kind, ranks):
    refused(
        mpirun(ranks, compile_c("plain_ksp.c"), "-dll_append", LIBRARY, check=False, env=other(compile_c, kind)), kind
    )


@pytest.mark.slow
@pytest.mark.parametrize("ranks", [1, 2])
def test_imported_with_another_petsc(mpirun, compile_c, ranks):
    program = """
try:
    import latinpc
except Exception as error:
    print("refused" if "build it again" in str(error) and "PetscScalar COMPLEX" in str(error) else error)
"""
    result = mpirun(ranks, program, env=other(compile_c, "complex"))
    assert result.stdout.count("refused") == ranks  # their lines may run into each other


@pytest.mark.slow
def test_numbers_that_the_build_refuses(tmp_path):
    """CMake reads petscconf.h of the PETSc that petsc4py names: here one that has nothing else."""
    headers = tmp_path / "petsc" / "include"
    (headers / "petsc" / "private").mkdir(parents=True)
    (headers / "petsc" / "private" / "snesimpl.h").touch()
    packages = tmp_path / "petsc" / "lib" / "pkgconfig"
    packages.mkdir(parents=True)
    (packages / "PETSc.pc").write_text(f"Name: PETSc\nDescription: no library\nVersion: 3.18\nCflags: -I{headers}\n")
    package = tmp_path / "python" / "petsc4py"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text(
        f"__version__ = '3.18'\ndef get_include(): return '{headers}'\n"
        f"def get_config(): return {{'PETSC_DIR': '{tmp_path / 'petsc'}', 'PETSC_ARCH': ''}}\n"
    )
    command = ["cmake", "-S", ROOT / "latinpc", "-B", tmp_path / "build", f"-DPython_EXECUTABLE={sys.executable}"]
    for numbers in ("REAL___FLOAT128", "REAL___FP16", "COMPLEX"):
        double = "#define PETSC_USE_REAL_DOUBLE 1\n" if numbers == "COMPLEX" else ""
        (headers / "petscconf.h").write_text(f"{double}#define PETSC_USE_{numbers} 1\n")
        result = run(command, check=False, env={"PYTHONPATH": str(package.parent)})
        assert result.returncode
        assert "needs a PETSc of real numbers in double or single precision" in result.stderr
        assert f"PETSC_USE_{numbers}" in result.stderr
