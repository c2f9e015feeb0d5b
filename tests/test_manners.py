"""What an experienced user of PETSc meets: errors of all ranks, presets on several ranks, logged operations."""

import sys
from pathlib import Path

import pytest
from conftest import ROOT
from petsc4py import PETSc
from support import irregular, logged, solve

import latinpc

EVENTS = ("Direction", "Spectral", "Macro", "Linear", "Condense", "Estimate", "Coarse", "Local")
COMMAND = Path(sys.executable).parent / "latinpc"


def test_an_error_of_all_ranks_is_petscs_own_and_ends_at_once(mpirun, compile_c):
    """PETSc's traceback on the first rank; the others sleep in its handler, and none is taken for lost."""
    words = ("-dll_append", latinpc.get_library(), "-pc_type", "latin")
    result = mpirun(3, compile_c("plain_ksp.c"), *words, check=False)
    assert result.returncode
    assert "[0]PETSC ERROR: #1 Latin" in result.stderr
    assert "main()" in result.stderr
    assert "an error of one rank" not in result.stderr


@pytest.mark.parametrize("preset", sorted(path.name for path in (ROOT / "options").glob("*.opts")))
def test_presets_run_on_two_ranks(mpirun, preset):
    """No package of theirs is for one rank alone."""
    words = ("solve", "tensegrity-grid", "--modules", 8, "-options_file", ROOT / "options" / preset)
    result = mpirun(2, COMMAND, *words, check=False)
    assert result.returncode == 0, result.stdout + result.stderr
    assert "converged in" in result.stdout


def test_operations_of_all_events_are_logged():
    """Of those that calculate; a partition, lists of nodes and their exchange take none."""
    with logged():
        before = {name: PETSc.Log.Event("Latin" + name).getPerfInfo()["flops"] for name in EVENTS}
        found = solve(irregular(), variant="corner", modes_local=1e-2, stop="error", error=1e-4, newton="never")
        assert found.reason > 0
        after = {name: PETSc.Log.Event("Latin" + name).getPerfInfo()["flops"] for name in EVENTS}
    assert [name for name in EVENTS if not after[name] > before[name]] == []
