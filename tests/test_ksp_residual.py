"""KSP latin claims convergence only where b - A x meets the tolerances: ill-conditioned matrices, random structures."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from petsc4py import PETSc
from random_structures import Draw
from support import ALL_VARIANTS, grid
from test_ksp import linear_system, solved
from test_properties import ALIKE, EXAMPLES

import latinpc

DIRECTIONS = ("scalar", "diagonal", "block", "schur")
NORMS = (PETSc.KSP.NormType.PRECONDITIONED, PETSc.KSP.NormType.UNPRECONDITIONED)
REASONS = PETSc.KSP.ConvergedReason
WITHOUT = (REASONS.DIVERGED_MAX_IT, REASONS.DIVERGED_BREAKDOWN, REASONS.DIVERGED_DTOL)  # what may end a solve


def residual(system, x):
    """Norm of b - A x, relative to that of b."""
    return (system.b - system.matrix * x).norm() / system.b.norm()


def rounding(matrix, x):
    """Norm of |A| |x|, times what KSP latin takes rounding to be: no x is told from the solution by less."""
    rows, columns, values = matrix.getValuesCSR()
    size = np.zeros(len(rows) - 1)
    np.add.at(size, np.repeat(np.arange(len(size)), np.diff(rows)), np.abs(values * x.getArray()[columns]))
    return 16 * np.finfo(float).eps * np.linalg.norm(size)


# ---- structures ------------------------------------------------------------------------------
@settings(max_examples=EXAMPLES // 2, derandomize=True, **ALIKE)
@given(st.builds(Draw, dim=st.integers(1, 3), nodes=st.integers(4, 40), extra=st.integers(4, 80),
                 parts=st.integers(2, 8), cut=st.sampled_from(["blocks", "random"]), slack=st.just(0.0),
                 rails=st.booleans(), seed=st.integers(0, 2**32 - 1)),
       st.sampled_from((*ALL_VARIANTS, "primal")), st.sampled_from(DIRECTIONS), st.sampled_from(NORMS),
       st.sampled_from(("gmres", "fgmres", "bcgs")), st.floats(2.0, 14.0), st.floats(0.0, 6.0),
       st.booleans())  # fmt: skip
def test_structures(draw, variant, direction, norm, outer, digits, contrast, guess):
    """Stiffnesses that differ by up to 1e12, every variant, direction and norm, with and without a guess."""
    scene, rng = draw.scene(), np.random.default_rng(draw.seed)
    scene = replace(scene, stiffness=scene.stiffness * 10.0 ** rng.uniform(-contrast, contrast, len(scene.links)))
    rtol = 10.0**-digits
    try:
        system = linear_system(scene, rtol=rtol, variant=variant, direction=direction, outer_ksp_type=outer)
    except PETSc.Error as error:  # so soft that nothing holds it, as far as numbers show
        assert "has a mechanism" in latinpc.error_message(error)
        return
    system.ksp.setNormType(norm)
    x = system.structure.create_vec()
    if guess:
        x.setRandom()
        system.ksp.setInitialGuessNonzero(True)
    system.ksp.solve(system.b, x)
    if system.ksp.getConvergedReason() > 0:
        named = norm == PETSc.KSP.NormType.UNPRECONDITIONED  # then it is the promise, to the letter
        least = 0.0 if named else rounding(system.matrix, x) / system.b.norm()
        assert residual(system, x) <= max(rtol * (1 + 1e-12), least)
    else:
        assert system.ksp.getConvergedReason() in WITHOUT


# ---- matrices --------------------------------------------------------------------------------
PROGRAM = """
import json
import sys
import petsc4py
petsc4py.init(sys.argv[:1])
from petsc4py import PETSc
import numpy as np
import scipy.sparse as sp
import latinpc

comm = PETSc.COMM_WORLD
rank, size = comm.rank, comm.size


def matrix(rng):
    '''A graph whose edges have coefficients that differ by orders, shared out among the ranks; some nodes are held.'''
    n, bs = int(rng.integers(20, 250)), int(rng.choice([1, 1, 2, 3]))
    edges = [(int(rng.integers(max(0, i - 10), i)), i) for i in range(1, n)]
    edges += [tuple(map(int, rng.choice(n, 2, replace=False))) for _ in range(2 * n)]
    jump, part = rng.choice([1.0, 2.0, 4.0]), {}
    cut = rng.choice(["strips", "random", "blocks"])
    seeds = rng.choice(n, size, replace=False)
    blocks, triples, near = [], ([], [], []), []
    for k, (a, b) in enumerate(edges):
        root = rng.normal(size=(bs, bs))
        blocks.append(10 ** rng.uniform(-jump, jump) * np.kron([[1, -1], [-1, 1]], root @ root.T + 0.1 * np.eye(bs)))
        of = {"strips": a * size // n, "random": rng.integers(size), "blocks": np.abs(seeds - a).argmin()}[cut]
        if of == rank:
            near.append(k)
    held = rng.random(n * bs) < 0.05
    held[:bs] = True
    numbers = np.cumsum(~held) - 1
    dofs = [(np.array(edge)[:, None] * bs + np.arange(bs)).ravel() for edge in edges]
    mine = np.unique(np.concatenate([dofs[k] for k in near])) if near else np.zeros(0, int)
    mine = mine[~held[mine]]
    local = sp.lil_matrix((n * bs, n * bs))
    for k in near:
        local[np.ix_(dofs[k], dofs[k])] += blocks[k]
    local = local.tocsr()[mine][:, mine].tocsr()
    whole = int((~held).sum())
    a = PETSc.Mat().create(comm)
    a.setSizes(((whole * (rank + 1) // size - whole * rank // size, whole),) * 2)
    a.setType("is")
    to = PETSc.LGMap().create(numbers[mine].astype(PETSc.IntType), comm=comm)
    a.setLGMap(to, to)
    arrays = (local.indptr.astype(PETSc.IntType), local.indices.astype(PETSc.IntType), local.data)
    a.setISLocalMat(PETSc.Mat().createAIJ(local.shape, csr=arrays, comm=PETSc.COMM_SELF))
    a.assemble()
    return a


results = []
for seed in range(*map(int, sys.argv[1:3])):
    rng = np.random.default_rng([seed, size])
    a = matrix(rng)
    x, b = a.createVecs()
    whole = rng.normal(size=x.getSize())
    x.setArray(whole[slice(*x.getOwnershipRange())])
    a.mult(x, b)
    rtol = 10.0 ** -rng.uniform(3, 13)
    ksp = PETSc.KSP().create(comm)
    ksp.setOperators(a)
    ksp.setType("latin")
    latinpc.set_variant(ksp, str(rng.choice(["none", "macro", "corner", "primal"])))
    latinpc.set_modes(ksp, str(rng.choice(["affine", "rigid"])))
    latinpc.set_direction(ksp, str(rng.choice(["scalar", "diagonal", "block", "schur", "auto"])))
    ksp.setTolerances(rtol=rtol, max_it=400)
    named = bool(rng.integers(2))
    if named:
        ksp.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
    ksp.setConvergenceHistory(length=1000)
    ksp.solve(b, x)
    seen = ksp.getConvergenceHistory()
    results.append(dict(seed=seed, named=named, reason=ksp.getConvergedReason(), rtol=rtol,
                        left=(b - a * x).norm() / b.norm(), early=bool((seen[:-1] <= rtol * seen[:1].sum()).any())))
    ksp.destroy()
    a.destroy()
PETSc.Sys.Print(json.dumps(results))
"""


@pytest.mark.parametrize("ranks", [2, 4])
def test_matrices(mpirun, ranks):
    """All variants and directions of a MATIS whose coefficients differ by up to 1e8, on some ranks."""
    found = json.loads(mpirun(ranks, PROGRAM, 0, EXAMPLES // (4 * ranks)).stdout.splitlines()[-1])
    claims = [one for one in found if one["reason"] > 0]
    assert [one for one in claims if one["left"] > one["rtol"] * (1 + 1e-12)] == []
    assert {one["reason"] for one in found if one["reason"] < 0} <= set(WITHOUT)
    assert len(claims) > 0.8 * len(found)  # a refusal of everything would be no answer
    assert sum(one["early"] for one in claims) > 0.05 * len(
        found
    )  # where the interface residual alone would have claimed


# ---- what becomes of a claim that does not hold --------------------------------------------------
@pytest.mark.parametrize("norm", NORMS)
def test_more_digits_than_there_are(norm, tmp_path):
    """Rounding ends the solve. Of the interface residual that is convergence; of b - A x, where named, it is none."""
    system = linear_system(grid("truss"), rtol=1e-17)
    system.ksp.setNormType(norm)
    x, exact = solved(system)
    assert residual(system, x) * system.b.norm() <= rounding(system.matrix, x)
    assert (x - exact).norm() < 1e-11 * exact.norm()
    if norm == PETSc.KSP.NormType.PRECONDITIONED:
        assert system.ksp.getConvergedReason() > 0
        return
    assert system.ksp.getConvergedReason() == REASONS.DIVERGED_BREAKDOWN
    viewer = PETSc.Viewer().createASCII(str(tmp_path / "view"), comm=PETSc.COMM_SELF)
    system.ksp.view(viewer)
    viewer.destroy()
    told = re.search(r"last solve: \|b - A x\| stagnates at (\S+) by rounding, the tolerances allow (\S+)",
                     (tmp_path / "view").read_text())  # fmt: skip
    assert float(told[1]) == pytest.approx(residual(system, x) * system.b.norm(), rel=1e-5)
    assert float(told[2]) == pytest.approx(1e-17 * system.b.norm(), rel=1e-5)


def test_a_test_of_the_users_decides():
    """It sees the norm that the KSP names, and no claim of its own is questioned."""
    system, seen = linear_system(grid("truss")), []

    def loose(_ksp, _it, norm):
        seen.append(norm)
        return REASONS.CONVERGED_RTOL if norm <= 1e-3 * seen[0] else REASONS.CONVERGED_ITERATING

    system.ksp.setConvergenceTest(loose)
    x, _ = solved(system)
    assert system.ksp.getConvergedReason() == REASONS.CONVERGED_RTOL
    assert system.ksp.getIterationNumber() == len(seen) - 1
    assert residual(system, x) > 1e-3


def test_a_claim_counts_no_iteration_twice():
    """Iterations, history and monitors go on where a claim did not hold, and where the solve starts again."""
    for rtol in (1e-8, 1e-17):
        system, seen = linear_system(grid("truss", modules=12, subdomains=16), rtol=rtol), []
        system.ksp.setMonitor(lambda _ksp, it, _norm, seen=seen: seen.append(it))
        system.ksp.setConvergenceHistory()
        solved(system)
        assert seen == list(range(system.ksp.getIterationNumber() + 1))
        assert len(system.ksp.getConvergenceHistory()) == len(seen)


def test_no_load():
    """Zero is the solution of no load, at once; with a guess, as far as tolerances relative to its residual ask for."""
    system = linear_system(grid("truss"), rtol=1e-8)
    system.b.set(0.0)
    x = system.structure.create_vec()
    system.ksp.solve(system.b, x)
    assert system.ksp.getConvergedReason() > 0 and x.norm() == 0.0
    x.setRandom()
    before = (system.matrix * x).norm()
    system.ksp.setInitialGuessNonzero(True)
    system.ksp.solve(system.b, x)
    assert system.ksp.getConvergedReason() > 0 and (system.matrix * x).norm() <= 1e-8 * before
