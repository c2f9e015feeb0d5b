"""A second PCSetUp() of PC latin keeps what depends on the pattern alone, and makes what a fresh one would."""

import json
from pathlib import Path

import pytest
from petsc4py import PETSc

PROGRAM = Path(__file__).with_name("renewal_program.py")
SYMBOLIC = ("MatCholFctrSym", "MatLUFactorSym", "LatinPartition", "LatinInterface")
BLOCKS = {1: "1,1", 2: "2,1", 4: "2,2"}
PROBLEMS = {
    "matis": ("matis", "--cells", 8),
    "matis, one kind": ("matis", "--cells", 8, "-pc_latin_variant", "primal"),
    "matis, MUMPS": ("matis", "--cells", 8, "-pc_latin_coarse_pc_factor_mat_solver_type", "mumps"),
    "matis, levels": ("matis", "--cells", 8, "-pc_latin_coarse_pc_type", "latin"),
    "links": ("links", "--cells", 8, "-pc_latin_subdomains", 6),
    "links, primal": ("links", "--cells", 8, "-pc_latin_variant", "primal"),
}

if hasattr(PETSc.Mat, "setISAllowRepeated"):
    PROBLEMS["matis, pieces"] = ("matis", "--repeated", "--cells", 8, "--blocks", "4,4", "-pc_latin_subdomains", 6)


def result(mpirun, ranks, problem, *more):
    """Run the program; what it prints. Newer PETSc also says that one rank has not used its options."""
    blocks = ("--blocks", BLOCKS[ranks]) if "matis" in problem and "pieces" not in problem else ()
    kind, *words = PROBLEMS[problem]
    run = mpirun(ranks, PROGRAM, kind, *blocks, *more, *map(str, words))
    return json.loads(next(line for line in run.stdout.splitlines() if line.startswith("{")))


@pytest.mark.parametrize("problem", PROBLEMS)
@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_new_values_take_no_symbolic_phase(mpirun, ranks, problem):
    """No partition, interface, order or analysis is made again; the preconditioner is a fresh one's, to rounding."""
    found = result(mpirun, ranks, problem)
    assert found["first"]["MatCholFctrSym"] > 0
    assert [found["second"][name] for name in SYMBOLIC] == [0] * len(SYMBOLIC)
    assert found["second"]["MatCholFctrNum"] == found["fresh"]["MatCholFctrNum"]
    assert found["apart"] < 1e-10  # rounding of pieces that are joined: up to 1.5e-11


@pytest.mark.parametrize("problem", [name for name in PROBLEMS if name in ("matis", "matis, pieces", "links")])
@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_another_pattern_is_noticed(mpirun, ranks, problem):
    """An entry that becomes zero, or a link without stiffness: nothing of the old pattern is left."""
    found = result(mpirun, ranks, problem, "--patterns")
    if problem != "links":
        assert found["second"]["LatinInterface"] == 1
        assert found["second"]["MatCholFctrSym"] > 0
    assert found["apart"] < 1e-11


WRONG = """
import sys, argparse
sys.path.insert(0, sys.argv[1])
import numpy as np
from petsc4py import PETSc
from renewal_program import grid_of, preconditioner
import latinpc

comm = PETSc.COMM_WORLD
args = argparse.Namespace(dim=2, cells=8, blocks=sys.argv[2], contrast=10.0, patterns=False)
for value in (np.nan, np.inf, 2.0):
    a, _, tell = grid_of(args, comm)
    pc = preconditioner(a, tell)
    pc.setUp()
    k = a.getISLocalMat()
    i, j, v = k.getValuesCSR()
    if comm.getRank() == comm.getSize() - 1:
        r = int(np.argmax(np.diff(i)))
        v = v.copy()
        row = slice(i[r], i[r + 1])
        v[i[r] + np.argmax(np.where(j[row] == r, 0.0, abs(v[row])))] *= value
    k.setValuesCSR(i, j, v)
    k.assemble()
    a.assemble()
    try:
        pc.setUp()
        PETSc.Sys.Print("nothing")
    except PETSc.Error as error:
        PETSc.Sys.Print("finite" if error.ierr == 72 else "symmetric" if error.ierr == 56 else error.ierr)
"""


@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_new_values_are_looked_at(mpirun, ranks):
    """An entry that is not a number, infinite, or not that of its exchange: the error of a first set-up."""
    printed = mpirun(ranks, WRONG, Path(__file__).parent, BLOCKS[ranks], leaks=False).stdout.split()
    assert printed == ["finite", "finite", "symmetric"]


@pytest.mark.parametrize("ranks", [2, 4])
def test_search_directions_and_local_modes_share_an_elimination(mpirun, ranks):
    """Coefficients that jump: the modes of a subdomain cost no factorisation of their own."""
    words = ("matis", "--cells", 40, "--contrast", 1e4, "--blocks", BLOCKS[ranks], "--twice")
    count = {}
    for modes in ("-2", "0"):
        run = mpirun(ranks, PROGRAM, *map(str, words), "-pc_latin_modes_local", modes)
        count[modes] = json.loads(next(line for line in run.stdout.splitlines() if line.startswith("{")))
    assert count["-2"]["first"]["LatinSpectral"] > count["0"]["first"]["LatinSpectral"] == 0
    for which in ("first", "second"):
        assert count["-2"][which]["MatCholFctrNum"] == count["0"][which]["MatCholFctrNum"]
