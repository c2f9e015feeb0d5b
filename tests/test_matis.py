"""PC latin on a MATIS, whatever program has made it: finite elements or links, one local matrix a rank."""

import re
from pathlib import Path

import numpy as np
import pytest
from petsc4py import PETSc

import latinpc

PROGRAM = Path(__file__).with_name("matis_program.py")
MECHANISM_FREE = ("poisson", "elasticity")
REPEATED = pytest.mark.skipif(
    not hasattr(PETSc.Mat, "setISAllowRepeated"), reason="PETSc has no MatISSetAllowRepeated()"
)
RUNS = {}  # what has been run with these ranks and words: the same whoever asks


@pytest.fixture
def matis(mpirun, ranks_for):
    """Run the program on some ranks and give what it prints: ``matis(4, ["-ksp_view"], dim=3)``."""

    def launch(ranks, options=(), check=True, **how):
        words = (*(word for key, value in how.items() for word in argument(key, value)), *options)
        if not check:
            return mpirun(ranks, PROGRAM, *words, check=False)
        if (ranks, *words) not in RUNS:
            RUNS[ranks, *words] = ranks_for(ranks, "matis_program", *words)
        assert RUNS[ranks, *words]["unused"] == []
        return RUNS[ranks, *words]

    return launch


def argument(key, value):
    """Write one argument of the program."""
    name = "--" + key.replace("_", "-")
    return [name] if value is True else [name, str(value)]


def converged(result, most):
    """Assert that conjugate gradients have converged in at most so many iterations, to what was asked for."""
    assert result["reason"] > 0
    assert result["iterations"] <= most
    assert result["residual"] < 1e-6


@pytest.mark.parametrize(
    ("problem", "dim", "blocks", "cells", "most"),
    [
        ("poisson", 2, "2,2", 8, 6),
        ("poisson", 3, "2,2,1", 4, 7),
        ("elasticity", 2, "2,2", 8, 8),
        ("elasticity", 3, "2,1,2", 4, 9),
    ],
)
def test_symmetric_positive_definite_and_exact_in_the_mean(matis, problem, dim, blocks, cells, most):
    """What conjugate gradients ask for; eigenvalues from one, less what the springs take, to a small number."""
    result = matis(4, problem=problem, dim=dim, blocks=blocks, cells=cells, spectrum=True)
    converged(result, most)
    assert result["asymmetry"] < 3e-11  # rounding of the factors
    assert 0.95 < result["least"] < 1.0 + 1e-8
    assert result["largest"] < 3.0


@pytest.mark.parametrize(("ranks", "blocks", "colours"), [(2, "2,1", False), (4, "2,2", False), (4, "4,4", True)])
def test_what_is_kept_of_the_condensation_makes_no_difference(matis, ranks, blocks, colours):
    """The default factors of the interiors need it at the interfaces alone, those of another package everywhere."""
    how = {
        "problem": "elasticity",
        "cells": 8,
        "blocks": blocks,
        "spectrum": True,
        **({"colours": True} if colours else {}),
    }
    ours, other = (
        matis(ranks, words, **how) for words in ([], ["-pc_latin_interior_pc_factor_mat_solver_type", "petsc"])
    )
    assert ours["iterations"] == other["iterations"]
    assert ours["residual"] == pytest.approx(
        other["residual"], rel=1e-6, abs=1e-10
    )  # one step may leave rounding alone
    assert [ours["least"], ours["largest"]] == pytest.approx([other["least"], other["largest"]], rel=1e-9)


@pytest.mark.parametrize("variant", ["none", "macro", "corner"])
def test_links_and_their_matrix_give_one_preconditioner(matis, variant):
    """A structure, one subdomain a rank: the local matrices make the same preconditioner as the links, to rounding."""
    cases = [("eliminated", "diagonal"), ("zeroed", "schur")] if variant == "corner" else [("scaled", "schur")]
    for dirichlet, direction in cases:
        options = ["-pc_latin_variant", variant, "-pc_latin_direction", direction]
        result = matis(4, options, problem="truss", blocks=4, dirichlet=dirichlet, links=True, value=0.1)
        assert result["reason"] > 0
        assert result["apart"] < 1e-10


@pytest.mark.slow
def test_truss_grid(matis):
    """Subdomains with mechanisms of their own, on which PCBDDC fails."""
    converged(matis(16, problem="truss", blocks=16, cells=16, dirichlet="eliminated"), 28)


@pytest.mark.parametrize("dirichlet", ["zeroed", "scaled", "eliminated"])
def test_boundary_conditions_as_applications_leave_them(matis, dirichlet):
    """Rows and columns zeroed, with any diagonal that the ranks share, or left out of the maps."""
    for problem in MECHANISM_FREE:
        converged(matis(4, ["-ksp_norm_type", "natural"], problem=problem, dirichlet=dirichlet), 8)


@pytest.mark.parametrize("problem", MECHANISM_FREE)
@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_rows_that_matzerorows_has_left(matis, problem, ranks):
    """Their columns are still there; they belong to no subdomain, as where columns have gone with them."""
    how = {"problem": problem, "blocks": {1: "1,1", 2: "2,1", 4: "2,2"}[ranks]}
    natural = ["-ksp_norm_type", "natural"]
    rows = matis(ranks, natural, dirichlet="rows", **how)
    converged(rows, 8)
    assert rows["coarse"] == matis(ranks, natural, dirichlet="zeroed", **how)["coarse"]


@pytest.mark.parametrize("problem", MECHANISM_FREE)
def test_singular_matrix_with_its_kernel(matis, problem):
    """No boundary condition at all: the kernel is given, on several ranks and on one."""
    few = matis(4, problem=problem, dirichlet="none")
    converged(few, 8)
    converged(matis(1, problem=problem, dirichlet="none", blocks="1,1"), 2)


@pytest.mark.parametrize(("ranks", "blocks"), [(1, "1,1"), (2, "2,1"), (4, "2,2")])
def test_singular_matrix_that_is_soft_on_one_side(matis, ranks, blocks):
    """Where the largest rigid motion is: springs there would let the stiff side move far."""
    options = ["-ksp_norm_type", "unpreconditioned", "-ksp_rtol", "1e-8"]
    converged(matis(ranks, options, problem="elasticity", dirichlet="none", jump="left", cells=24, blocks=blocks), 8)


def test_singular_matrix_without_its_kernel(matis):
    """The message says what to do, on every rank."""
    result = matis(4, check=False, dirichlet="no")
    assert result.returncode
    assert result.stderr.count("MatSetNullSpace") == 4


@pytest.mark.parametrize(
    ("ranks", "how"),
    [
        (1, {"blocks": "1,1"}),  # one subdomain
        pytest.param(16, {"cells": 4, "blocks": "4,4"}, marks=pytest.mark.slow),  # one cell a subdomain
        (4, {"cells": 2, "blocks": "2,2"}),
        pytest.param(8, {"cells": 2, "blocks": "2,2,2", "dim": 3, "problem": "elasticity"}, marks=pytest.mark.slow),
        (6, {"problem": "elasticity"}),  # two ranks have nothing
        (4, {"blocks": "4,1", "cells": 5}),  # slivers
        (4, {"problem": "elasticity", "blocks": "1,4"}),
    ],
)
def test_extreme_decompositions(matis, ranks, how):
    """One rank, as many as cells, more than blocks; slivers."""
    converged(matis(ranks, **how), 12)


def test_what_is_known_of_the_unknowns(matis):
    """Coordinates and near null space serve; without them more iterations, and it converges all the same."""
    how = {"problem": "elasticity", "cells": 12}
    coordinates = matis(4, **how)
    near = matis(4, coordinates=0, near=True, **how)
    nothing = matis(4, coordinates=0, **how)
    for result in (coordinates, near, nothing):
        converged(result, 14)
    assert coordinates["iterations"] <= near["iterations"] <= nothing["iterations"]
    assert nothing["coarse"] < near["coarse"] < coordinates["coarse"]
    assert matis(4, scalar_map=True, **how)["coarse"] == coordinates["coarse"]
    assert matis(4, ["-pc_latin_modes", "rigid"], near=True, **how)["coarse"] == near["coarse"]


@pytest.mark.parametrize("problem", MECHANISM_FREE)
def test_local_matrices_that_fall_into_parts(matis, problem):
    """Every rank has four blocks that touch nowhere: sixteen subdomains, some equal to the bit."""
    result = matis(4, problem=problem, cells=12, blocks="4,4", colours=True)
    converged(result, 8)
    assert result["subdomains"] == 16


@REPEATED
@pytest.mark.parametrize("ranks", [1, 2, 4])
@pytest.mark.parametrize("dirichlet", ["zeroed", "eliminated"])
@pytest.mark.parametrize("problem", MECHANISM_FREE)
def test_pieces_that_are_subdomains(matis, problem, dirichlet, ranks):
    """Blocks with rows of their own: the subdomains of as many ranks."""
    how = {"problem": problem, "dirichlet": dirichlet, "cells": 12, "blocks": "4,2"}
    alone, found = matis(8, **how), matis(ranks, ["-pc_latin_subdomains", "8"], repeated=True, **how)
    converged(found, 12)
    assert found["subdomains"] == alone["subdomains"] == 8
    assert found["coarse"] == alone["coarse"]
    assert abs(found["iterations"] - alone["iterations"]) <= 1
    krylov = matis(ranks, ["-ksp_type", "latin", "-ksp_latin_subdomains", "8"], repeated=True, **how)
    assert krylov["reason"] > 0 and krylov["residual"] < 1e-7


@REPEATED
@pytest.mark.parametrize("ranks", [1, 2, 4])
@pytest.mark.parametrize("problem", MECHANISM_FREE)
def test_matrices_of_elements(matis, problem, ranks):
    """Each cell has rows of its own: one subdomain a rank, as if they were added up, or as many as are asked for."""
    how = {"problem": problem, "cells": 12}
    added = matis(ranks, blocks=f"{ranks},1", **how)
    one = matis(ranks, blocks="12,12", repeated=True, **how)
    converged(one, 12)
    assert one["subdomains"] == ranks and one["coarse"] == added["coarse"]
    assert abs(one["iterations"] - added["iterations"]) <= 1
    many = matis(ranks, ["-pc_latin_subdomains", "12"], blocks="12,12", repeated=True, spectrum=True, **how)
    converged(many, 14)
    assert many["subdomains"] >= 12
    assert many["asymmetry"] < 3e-11 and 0.95 < many["least"] < 1.0 + 1e-8


def test_an_entry_that_comes_where_another_goes():
    """New values have as many entries, elsewhere; local rows are in the order opposite to that of the unknowns."""
    first = 4.0 * np.eye(5) - np.eye(5, k=1) - np.eye(5, k=-1)
    first[0, 3] = first[3, 0] = -1.0
    then = first.copy()
    then[0, 1] = then[1, 0] = 0.0
    then[1, 3] = then[3, 1] = -1.0
    rows = np.arange(5, dtype=PETSc.IntType)
    a = PETSc.Mat().create(PETSc.COMM_SELF)
    a.setSizes(5)
    a.setType("is")
    a.setLGMap(PETSc.LGMap().create(rows[::-1].copy(), comm=PETSc.COMM_SELF))
    local = PETSc.Mat().createAIJ((5, 5), nnz=5, comm=PETSc.COMM_SELF)
    pc = PETSc.PC().create(PETSc.COMM_SELF)
    pc.setType("latin")
    b, u = PETSc.Vec().createSeq(5), PETSc.Vec().createSeq(5)
    b.setArray([1.0, 2.0, 3.0, 4.0, 5.0])
    for values in (first, then):
        local.setValues(rows, rows, values)
        local.assemble()
        a.setISLocalMat(local)
        a.assemble()
        pc.setOperators(a)
        pc.setUp()
        pc.apply(b, u)
        exact = np.linalg.solve(values[::-1, ::-1], b.getArray())  # one subdomain: a direct solver
        np.testing.assert_allclose(u.getArray(), exact, rtol=1e-12)


@REPEATED
def test_springs_to_the_ground_with_rows_of_their_own():
    """A row that nothing couples is a subdomain where another one has its unknown."""
    stiffness = np.diag([2.0, 1.0, 1.0, 3.0, 3.0, 1.0])
    stiffness[1, 2] = stiffness[2, 1] = -1.0
    stiffness[3, 4] = stiffness[4, 3] = -3.0
    numbers = np.array([0, 0, 1, 1, 2, 2], PETSc.IntType)
    a = PETSc.Mat().create(PETSc.COMM_SELF)
    a.setSizes(3)
    a.setType("is")
    a.setISAllowRepeated(True)
    a.setLGMap(PETSc.LGMap().create(numbers, comm=PETSc.COMM_SELF))
    local = PETSc.Mat().createDense(stiffness.shape, array=stiffness, comm=PETSc.COMM_SELF)
    a.setISLocalMat(local.convert("aij"))
    a.assemble()
    ksp = PETSc.KSP().create(PETSc.COMM_SELF)
    ksp.setOperators(a)
    ksp.setType("cg")
    ksp.setTolerances(rtol=1e-12)
    ksp.getPC().setType("latin")
    latinpc.set_subdomains(ksp.getPC(), 2**31 - 1)
    load, u = a.createVecs()
    load.setArray([1.0, 2.0, 3.0])
    ksp.solve(load, u)
    assert latinpc.statistics(ksp.getPC())["subdomains"] == 4
    assembled = np.array([[3.0, -1.0, 0.0], [-1.0, 4.0, -3.0], [0.0, -3.0, 4.0]])
    np.testing.assert_allclose(u.getArray(), np.linalg.solve(assembled, [1.0, 2.0, 3.0]), rtol=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("problem", "dim", "few", "many"),
    [("poisson", 2, 3, 22), ("elasticity", 2, 3, 22), ("poisson", 3, 2, 8), ("elasticity", 3, 2, 8)],
)
def test_iterations_do_not_grow_with_the_number_of_subdomains(matis, problem, dim, few, many):
    """From 8 or 9 subdomains to about 500, of equal size."""
    counts = []
    for blocks in (few, many):
        how = {"cells": 4 * blocks, "blocks": ",".join([str(blocks)] * dim), "dim": dim, "colours": True}
        result = matis(2**dim, ["-ksp_norm_type", "natural"], problem=problem, **how)
        converged(result, 12)
        counts.append(result["iterations"])
    assert counts[1] <= 1.15 * counts[0] + 1


@pytest.mark.parametrize("jump", ["inside", pytest.param("across", marks=pytest.mark.slow), "random"])
def test_coefficients_that_jump_by_a_million(matis, jump):
    """Between subdomains, through their interfaces, and from cell to cell: no more than twice the iterations."""
    how = {"problem": "elasticity", "cells": 12}
    smooth, rough = (matis(4, ["-ksp_norm_type", "natural"], jump=j, **how) for j in ("none", jump))
    converged(smooth, 6)
    assert rough["reason"] > 0
    assert rough["iterations"] <= 2 * smooth["iterations"]
    none = matis(4, ["-ksp_norm_type", "natural", "-pc_latin_modes_local", "0"], jump=jump, **how)
    assert none["coarse"] == smooth["coarse"] <= rough["coarse"]
    assert jump != "random" or none["iterations"] > rough["iterations"]


@pytest.mark.parametrize("ranks", [2, 4])
def test_thin_subdomains(matis, ranks):
    """Where they bend at next to no energy local fields are macro by themselves; a block has none."""
    natural, none = ["-ksp_norm_type", "natural"], ["-pc_latin_modes_local", "0"]
    how = {"problem": "elasticity", "dim": 3, "cells": 40, "layers": 1, "blocks": "2,2,1" if ranks == 4 else "2,1,1"}
    thin, without = matis(ranks, natural, **how), matis(ranks, natural + none, **how)
    converged(thin, 10)
    assert thin["residual"] < 1e-6
    assert without["iterations"] > 2 * thin["iterations"]
    assert without["coarse"] < thin["coarse"]
    how |= {"cells": 8, "layers": 4}
    assert matis(ranks, natural, **how)["coarse"] == matis(ranks, natural + none, **how)["coarse"]


def test_weights_from_schur_complements(matis):
    """The mean that costs least energy: spectrum closer to one than with the diagonal's weights."""
    schur, stiffness = (
        matis(4, ["-pc_latin_direction", direction], problem="elasticity", spectrum=True)
        for direction in ("schur", "diagonal")
    )
    assert schur["largest"] < stiffness["largest"]
    assert schur["asymmetry"] < 1e-10


@pytest.mark.parametrize("ranks", [2, 4])
@pytest.mark.parametrize("jump, precision, most", [("none", "single", 10), ("across", "double", 3)])
def test_large_factors_are_in_single_precision_unless_the_coarse_problem_is_soft(matis, ranks, jump, precision, most):
    """As many iterations as in double precision; soft subdomains beside stiff ones leave no room for rounding."""
    blocks = {2: "2,1,1", 4: "2,2,1"}[ranks]
    result = matis(ranks, ["--view"], problem="elasticity", dim=3, cells=20, blocks=blocks, jump=jump)
    assert f"entries in {precision} precision" in result["view"]
    converged(result, most)


@pytest.mark.parametrize("local_type", ["sbaij", "baij", "dense"])
def test_types_of_local_matrices(matis, local_type):
    """Blocked, symmetric and dense local matrices are the same matrix."""
    aij, other = (matis(4, problem="elasticity", local_type=kind) for kind in ("aij", local_type))
    assert aij["iterations"] == other["iterations"]
    assert aij["coarse"] == other["coarse"]


@pytest.mark.parametrize(("jump", "cells", "whole"), [("none", 16, 0), ("inside", 16, 4), ("none", 4, 4)])
def test_schur_complements_where_they_pay(matis, jump, cells, whole):
    """On the interfaces of subdomains where coefficients jump, and of small ones; diagonal directions elsewhere."""
    how = {"problem": "poisson", "dim": 3, "blocks": "2,2,1", "cells": cells, "jump": jump}
    result = matis(4, ["-ksp_norm_type", "natural"], view=True, **how)
    assert f"a Schur complement on {whole} interfaces, diagonal on the others" in result["view"]
    converged(result, 8)


@pytest.mark.parametrize("direction", ["scalar", "diagonal", "block", "schur"])
def test_directions(matis, direction):
    """Springs of every kind."""
    converged(matis(4, ["-pc_latin_direction", direction], problem="elasticity"), 8)


@pytest.mark.parametrize("options", [["modes_local", "1"], ["coarse_pc_type", "lu"], ["modes", "rigid"]])
def test_options(matis, options):
    """Options of the preconditioner of links are those of a matrix."""
    converged(matis(4, ["-pc_latin_" + options[0], options[1]], problem="elasticity"), 8)


def test_asymmetric_matrix_is_refused(matis):
    """On every rank, though one alone has the entry."""
    result = matis(3, check=False, asymmetric=True, blocks="3,1")
    assert result.returncode
    assert result.stderr.count("is not symmetric") == 3
    assert result.stderr.count("MatZeroRowsColumns") == 3


def test_number_of_subdomains_is_not_ours(matis):
    """The local matrices are the subdomains."""
    result = matis(2, ["-pc_latin_subdomains", "7"], check=False, blocks="2,1")
    assert result.returncode
    assert "remove -pc_latin_subdomains" in result.stderr


def test_small_subdomains_take_schur_complements(matis):
    """Of the search direction, by themselves: on all interfaces here, and on none of large subdomains."""
    small, large = (matis(4, blocks="2,2", cells=cells, view=True)["view"] for cells in (8, 96))
    assert "a Schur complement on 4 interfaces" in small
    assert "a Schur complement on 0 interfaces" in large


@pytest.mark.parametrize("options", [[], ["cholesky"], ["mumps"]])
def test_coarse_solver(matis, options):
    """A full matrix is factored by fronts of the ranks; one word of the options makes it a parallel, sparse one."""
    words = {"cholesky": ["-pc_latin_coarse_pc_type", "cholesky"]}
    words["mumps"] = ["-pc_latin_coarse_pc_factor_mat_solver_type", "mumps"]
    result = matis(4, words[options[0]] if options else [], view=True)
    assert ("latintree" in result["view"]) == (not options)
    converged(result, 8)


def test_view(matis):
    """-ksp_view says that a matrix is behind it, and what is known of it."""
    result = matis(2, ["-ksp_view", "-options_left"], check=False, blocks="2,1", problem="elasticity")
    assert not result.returncode
    for text in (
        "type: latin",
        "162 unknowns in 2 fields",
        "coordinates in 2D",
        "0 near null vectors",
        "subdomains: 2",
    ):
        assert text in result.stdout
    assert "There are no unused options" in result.stdout


def test_coordinates_of_other_nodes_are_refused():
    """On one rank the message speaks of no other one."""
    local = PETSc.Mat().createAIJ((6, 6), nnz=1, comm=PETSc.COMM_SELF)
    for i in range(6):
        local.setValue(i, i, 1.0)
    local.assemble()
    a = PETSc.Mat().create(PETSc.COMM_SELF)
    a.setSizes(6)
    a.setType("is")
    a.setLGMap(*2 * [PETSc.LGMap().create(range(6), comm=PETSc.COMM_SELF)])
    a.setISLocalMat(local)
    a.assemble()
    pc = PETSc.PC().create(PETSc.COMM_SELF)
    pc.setOperators(a)
    pc.setType("latin")
    pc.setCoordinates(np.zeros((4, 2)))
    with pytest.raises(PETSc.Error) as error:
        pc.setUp()
    said = latinpc.error_message(error.value)
    assert "given 4 nodes to a rank of 6 unknowns" in said and "another rank" not in said


def test_program_of_the_documentation(mpirun, tmp_path):
    """It runs as it is written, on any number of ranks."""
    page = (PROGRAM.parent.parent / "docs" / "preconditioner.md").read_text()
    program = re.search(r"```python\n(.*?)```", page, re.DOTALL)[1]
    for ranks, most in ((1, 1), (4, 5)):
        iterations, reason = re.search(r"^(\d+) iterations, reason (\d+)", mpirun(ranks, program).stdout).groups()
        assert int(iterations) <= most and int(reason) == PETSc.KSP.ConvergedReason.CONVERGED_RTOL


CONVERTED = """
import sys
import petsc4py
petsc4py.init(sys.argv)
from petsc4py import PETSc
import latinpc
n = 20
A = PETSc.Mat().createAIJ((n * n, n * n), nnz=5)
for row in range(*A.getOwnershipRange()):
    i, j = divmod(row, n)
    near = [(i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)]
    for k, l in near:
        if 0 <= k < n and 0 <= l < n:
            A.setValue(row, k * n + l, -1.0)
    A.setValue(row, row, 4.0)
A.assemble()
pc = PETSc.PC().create()
pc.setOperators(A.convert("is") if "-as_is" in sys.argv else A)
pc.setType("latin")
pc.setUp()
"""


@pytest.mark.parametrize(
    ("words", "message"), [((), "of type mpiaij, no longer has"), (("-as_is",), "not positive semidefinite")]
)
def test_a_whole_matrix_is_refused(mpirun, words, message):
    """Assembled, or converted: PETSc splits entries between ranks so that local matrices are indefinite."""
    result = mpirun(3, CONVERTED, *words, check=False, timeout=60)
    assert result.returncode and message in result.stderr
