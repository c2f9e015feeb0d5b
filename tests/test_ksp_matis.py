"""KSP latin on a MATIS: the solutions of a direct solver, beside FETI-DP and conjugate gradients with PC latin."""

import json
from pathlib import Path

import pytest

PROGRAM = Path(__file__).with_name("ksp_matis_program.py")
RUNS = {}  # what has been run with these ranks and words: the same whoever asks


@pytest.fixture
def solved(ranks_for):
    def run(ranks, *words, **args):
        words = (json.dumps(args), *words)
        if (ranks, *words) not in RUNS:
            RUNS[ranks, *words] = ranks_for(ranks, "ksp_matis_program", *words)
        assert RUNS[ranks, *words]["unused"] == []
        return RUNS[ranks, *words]

    return run


@pytest.mark.parametrize(("ranks", "blocks"), [(2, "2,1"), (4, "2,2"), (8, "4,2")])
@pytest.mark.parametrize("problem", ["poisson", "elasticity"])
def test_plane(solved, problem, ranks, blocks):
    """Few iterations, and the others' solution."""
    found = solved(ranks, problem=problem, blocks=blocks, cells=12)
    assert found["reason"] > 0 and found["subdomains"] == ranks
    assert found["iterations"] <= 16
    assert found["residual"] < 1e-8 and found["cg"] < 1e-7
    assert found["again_reason"] > 0 and found["again"] < 1e-8  # new entries of the matrix
    if problem == "poisson":
        assert found["fetidp"] < 1e-2 and found["iterations"] <= 2 * found["fetidp_iterations"]


@pytest.mark.parametrize("dirichlet", ["zeroed", "scaled", "eliminated", "none"])
@pytest.mark.parametrize("problem", ["poisson", "elasticity"])
def test_supports_as_applications_leave_them(solved, problem, dirichlet):
    """Rows of boundary conditions, none of them, and a kernel that the matrix knows."""
    found = solved(4, problem=problem, dirichlet=dirichlet)
    assert found["reason"] > 0 and found["residual"] < 1e-8 and found["cg"] < 1e-7


def test_cubes(solved):
    found = solved(4, problem="elasticity", dim=3, cells=4, blocks="2,2,1")
    assert found["reason"] > 0 and found["residual"] < 1e-8 and found["cg"] < 1e-7


@pytest.mark.parametrize("words", ["-ksp_latin_outer_ksp_type bcgs", "-ksp_norm_type unpreconditioned",
                                   "-ksp_latin_modes rigid", "-ksp_latin_direction block"])  # fmt: skip
def test_options(solved, words):
    found = solved(4, *words.split(), problem="elasticity")
    assert found["reason"] > 0 and found["residual"] < 1e-8 and found["cg"] < 1e-7


def test_coordinates_are_those_of_the_preconditioner(solved):
    """PCSetCoordinates() on the PC of the solver serves the macro fields."""
    with_them, without = (solved(4, problem="elasticity", cells=16, coordinates=given) for given in (True, False))
    assert with_them["residual"] < 1e-8 and without["residual"] < 1e-8
    assert with_them["iterations"] < without["iterations"]


@pytest.mark.parametrize(("jump", "most"), [("across", 24), ("inside", 40)])
def test_jumps(solved, jump, most):
    """Coefficients that jump by a million."""
    found = solved(4, jump=jump, cells=16, dirichlet="eliminated")
    assert found["reason"] > 0 and found["iterations"] <= most


def test_not_symmetric(mpirun):
    result = mpirun(2, PROGRAM, json.dumps({"asymmetric": True, "blocks": "2,1"}), check=False)
    assert result.returncode and "is not symmetric" in result.stderr


@pytest.mark.parametrize("problem", ["poisson", "elasticity"])
@pytest.mark.parametrize("jump", ["inside", "across", pytest.param("random", marks=pytest.mark.slow)])
def test_jumps_take_at_most_twice_the_iterations(solved, problem, jump):
    """Coefficients that jump by a million inside and across subdomains: at most twice the iterations."""
    smooth, rough = (solved(4, problem=problem, cells=16, jump=name) for name in ("none", jump))
    assert rough["reason"] > 0 and rough["cg"] < 1e-4
    assert rough["iterations"] <= 2 * smooth["iterations"]
