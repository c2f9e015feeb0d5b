"""PC and KSP latin on a MATIS with a kernel: free bodies."""

import pytest


@pytest.mark.parametrize("method", ["cg", "gmres", "minres"])
@pytest.mark.parametrize("problem", ["poisson", "elasticity"])
@pytest.mark.parametrize("ranks", [1, 4])
def test_loads_of_a_free_body_with_a_resultant(ranks_for, problem, ranks, method):
    """PETSc leaves the resultant in the loads. No displacements bear it; those that bear all else are found."""
    words = ["--problem", problem, "--blocks", {1: "1,1", 4: "2,2"}[ranks], "--dirichlet", "none", "--unbalanced"]
    result = ranks_for(ranks, "matis_program", *words, "-ksp_type", method)
    assert result["reason"] > 0 and result["iterations"] <= 8 and result["residual"] < 1e-6
    assert result["resultant"] > 1e-3
