"""A second PCSetUp() of PC latin keeps what depends on the pattern alone, and makes what a fresh one would."""

import json
from pathlib import Path

import pytest

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


def result(mpirun, ranks, problem, *more):
    """Run the program; what it prints. Newer PETSc also says that one rank has not used its options."""
    blocks = ("--blocks", BLOCKS[ranks]) if "matis" in problem else ()
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
    assert found["apart"] < 1e-11


@pytest.mark.parametrize("problem", ["matis", "links"])
@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_another_pattern_is_noticed(mpirun, ranks, problem):
    """An entry that becomes zero, or a link without stiffness: nothing of the old pattern is left."""
    found = result(mpirun, ranks, problem, "--patterns")
    if problem == "matis":
        assert found["second"]["LatinInterface"] == 1
        assert found["second"]["MatCholFctrSym"] > 0
    assert found["apart"] < 1e-11


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
