"""The linear stage (26)-(30), (42)-(52): a constrained minimum, by whatever solver of the subdomains."""

from pathlib import Path

import numpy as np
import oracle
import pytest
from petsc4py import PETSc
from support import (
    ALL_VARIANTS,
    PLAIN,
    far,
    grid,
    irregular,
    latin,
    lattice,
    network,
    oracle_options,
    settled,
    solve,
)

import latinpc
from latinpc.runs.reference import reference_solution
from latinpc.scenes import make


def operators(model, i):
    """K_E with its springs, and the rows A of its macro displacements, densely."""
    part = model.parts[i]
    k, a = part.stiffness.copy(), [np.zeros((0, len(part.dofs)))]
    for side in (s for s in model.sides if i in s.pair):
        at = side.local[side.pair.index(i)]
        k[np.ix_(at, at)] += side.d
        a.append(np.zeros((side.r.shape[1], len(part.dofs))))
        a[-1][:, at] = (side.d @ side.r).T
    return k, np.vstack(a)


def forces(model, x):
    """Forces g on the subdomains for the state x."""
    s = model.scene.stiffness * model.scene.initial_elongation
    s[model.nonsmooth] = x[model.n_z :]
    s = s + model.scene.stiffness * model.e_d
    g = [part.load - part.b.T @ s[part.links] for part in model.parts]
    for side in model.sides:
        for i, at, z in zip(side.pair, side.local, side.z):
            g[i][at] += x[z]
    return g


def constraints(model, start):
    """Rows that make macro displacements and primal nodes the same for all their subdomains."""
    rows, total = [], start[-1]
    for side in model.sides:
        row = np.zeros((side.r.shape[1], total))
        for sign, i, at in zip((1.0, -1.0), side.pair, side.local):
            row[:, start[i] + at] = sign * (side.d @ side.r).T / np.sqrt(side.d.diagonal().mean())
        rows.append(row)
    for node, groups in model.primal.items():
        for group in groups:
            for dof in oracle.free_dofs(model, [node]):
                places = [start[i] + np.searchsorted(model.parts[i].dofs, dof) for i in group]
                for other in places[1:]:
                    row = np.zeros((1, total))
                    row[0, places[0]], row[0, other] = 1.0, -1.0
                    rows.append(row)
    return np.vstack(rows)


def minimum(model, x):
    """Displacements of all subdomains: least energy under the constraints, one dense saddle point problem."""
    start = np.concatenate([[0], np.cumsum([len(part.dofs) for part in model.parts])])
    c = constraints(model, start)
    n, m = start[-1], len(c)
    system, unit = np.zeros((n + m, n + m)), model.scene.stiffness.mean()
    for i in range(len(model.parts)):
        k, a = operators(model, i)
        system[start[i] : start[i + 1], start[i] : start[i + 1]] = (k - a.T @ a) / unit
    system[n:, :n], system[:n, n:] = c, c.T
    rhs = np.concatenate([*forces(model, x), np.zeros(m)]) / unit
    u = np.linalg.solve(system, rhs)
    return [u[start[i] : start[i + 1]] for i in range(len(model.parts))]


SMALL = {
    "grid": lambda: grid(modules=4, subdomains=4),
    "irregular": lambda: irregular(modules=4, parts=4),
    "network": lambda: settled(network(nodes=60, parts=4)),
    "lattice": lattice,
}


@pytest.mark.parametrize("direction", ["diagonal", "schur"])
@pytest.mark.parametrize("variant", ALL_VARIANTS)
@pytest.mark.parametrize("name", SMALL)
def test_linear_stage_is_a_constrained_minimum(name, variant, direction):
    """Least energy with micro springs, macro displacements and corners common: the solver and the oracle meet it."""
    scene, options = SMALL[name](), {"variant": variant, "direction": direction}
    model = oracle.build(scene, **oracle_options(options))
    first = oracle.average(model, minimum(model, oracle.start(model)))
    assert far(solve(scene, max_it=1, **options).u, first) < 1e-9
    x = np.random.default_rng(0).normal(size=model.n_z + len(model.nonsmooth)) * 100.0
    for side in model.sides:  # micro: without macro part
        for z in side.z:
            x[z] -= side.d @ (side.r @ (side.r.T @ x[z]))
    for mine, theirs in zip(oracle.linear_stage(model, x), minimum(model, x)):
        assert mine == pytest.approx(theirs, abs=1e-9 * abs(theirs).max())


@pytest.mark.parametrize("direction", ["diagonal", "block", "schur"])
@pytest.mark.parametrize("variant", ALL_VARIANTS)
def test_matrix_of_the_subdomains(variant, direction):
    """K_E with its springs, the identity where displacements are prescribed or coarse."""
    scene = settled(irregular(modules=4, parts=4))
    options = {"variant": variant, "direction": direction}
    model = oracle.build(scene, **oracle_options(options))
    blocks = []
    for i, part in enumerate(model.parts):
        nodes = np.unique(scene.links[part.links])
        whole = (nodes[:, None] * scene.dim + np.arange(scene.dim)).ravel()
        kept = np.isin(whole, part.dofs[part.r])
        block = np.eye(len(whole))
        block[np.ix_(kept, kept)] = operators(model, i)[0][np.ix_(part.r, part.r)]
        blocks.append(block)
    with latin(scene, **options) as run:
        run.snes.setUp()
        for i, block in enumerate(blocks):
            matrix = latinpc.local_ksp(run.snes, i).getOperators()[0]
            assert matrix.isSymmetric()
            dense = matrix.convert("dense", PETSc.Mat()).getDenseArray()
            assert dense == pytest.approx(block, abs=1e-12 * block.max())


LOCAL = {
    "petsc": {"local_pc_factor_mat_solver_type": "petsc"},
    "lu": {"local_pc_type": "lu", "local_pc_factor_mat_solver_type": "petsc"},
    "mumps": {"local_pc_factor_mat_solver_type": "mumps"},
    "cg": {"local_ksp_type": "cg", "local_pc_type": "icc", "local_ksp_rtol": 1e-14, "local_ksp_max_it": 5000},
    "gmres": {
        "local_ksp_type": "gmres",
        "local_pc_type": "ilu",
        "local_ksp_rtol": 1e-14,
        "local_ksp_gmres_restart": 200,
    },
}


@pytest.mark.parametrize("solver", LOCAL)
def test_any_solver_of_the_subdomains(solver):
    """Another factorisation, or Krylov iterations to rounding, by option: the same iterates."""
    scene = irregular(modules=4, parts=4)
    default, other = (solve(scene, max_it=4, stol=0, **options, **PLAIN) for options in ({}, LOCAL[solver]))
    assert other.reason == default.reason == PETSc.SNES.ConvergedReason.DIVERGED_MAX_IT
    assert far(other.u, default.u) < 1e-9


def test_default_solver_of_the_subdomains():
    """Ours of CHOLMOD's kernels, under a prefix of its own."""
    with latin(grid()) as run:
        run.snes.setUp()
        ksp = latinpc.local_ksp(run.snes)
        assert ksp.getOptionsPrefix() == "snes_latin_local_"
        assert ksp.getType() == "preonly"
        assert ksp.getPC().getType() == "cholesky"
        assert ksp.getPC().getFactorSolverType() == "latin"
        assert ksp.getComm().getSize() == 1


COUNT = """
import sys
import petsc4py
petsc4py.init(sys.argv[:1] + ["-skip_petscrc"])
from petsc4py import PETSc
sys.path.insert(0, sys.argv[1])
import support

PETSc.Log.begin()
events = [PETSc.Log.Event(name) for name in ("LatinSetUp", "MatCholFctrNum", "MatLUFactorNum")]


def count():
    print(*(event.getPerfInfo()["count"] for event in events))


scene = support.grid()
with support.latin(scene, stol=1e-9) as run:
    run.snes.setUp()
    count()
    u = run.structure.create_vec()
    run.snes.solve(None, u)
    run.structure.set_load(2 * scene.load)
    run.structure.set_initial_elongation(1.1 * scene.initial_elongation)
    run.snes.solve(None, u)
    count()
"""


def test_operators_are_factored_once(mpirun):
    """Iterations, new loads and new initial elongations only solve: one set-up, and no factorisation after it."""
    after_setup, at_the_end = mpirun(1, COUNT, Path(__file__).parent).stdout.splitlines()
    assert after_setup == at_the_end
    assert after_setup.split()[0] == "1"


@pytest.mark.parametrize("limit", [{"local_ksp_max_it": 2}, {"local_ksp_divtol": 1e-3}])
def test_solver_that_gives_up_is_reported(limit):
    """A local solver that fails ends in its reason, or in an error that names it; never in success."""
    options = {"local_ksp_type": "cg", "local_pc_type": "none", "local_ksp_rtol": 1e-12, **limit}
    try:
        result = solve(lattice(), **options)
    except PETSc.Error as error:
        assert "local solver" in latinpc.error_message(error)
    else:
        assert result.reason == PETSc.SNES.ConvergedReason.DIVERGED_LINEAR_SOLVE


def test_a_reference_of_a_long_chain():
    """Rounding leaves 1e-8 of the loads unbalanced: the last full step says that this is all."""
    links, k = 20000, 1.0 / 3.0
    nodes, number = np.arange(links + 1.0)[:, None], np.arange(links)
    chain = latinpc.Structure(
        nodes, np.column_stack([number, number + 1]), "bar", k, fixed=nodes == 0, load=np.full((links + 1, 1), 0.1)
    )
    exact = np.concatenate([[0.0], np.cumsum(0.1 * (links - number) / k)])
    u = reference_solution(chain)
    left = chain.create_vec()
    chain.residual(u, left)
    assert left.norm() > 1e-9 * 0.1 * np.sqrt(links)
    assert np.linalg.norm(chain.displacements(u)[:, 0] - exact) < 1e-9 * np.linalg.norm(exact)


# ---- rounding, inexact solvers ---------------------------------------------------------------
def test_rounding_does_not_pile_up():
    """Each linear stage solves for a change: what the coarse operator rounds is small with the last one."""
    scene = make("tensegrity-grid", modules=24)
    structure = latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF)
    reference = structure.displacements(reference_solution(structure))
    run = solve(scene, stol=1e-13, max_it=100, _reference=reference)
    assert run.reason > 0
    assert run.history.error_l2[-1] < 3e-12


@pytest.mark.parametrize("make_scene", [grid, network])
def test_a_rough_coarse_solver_is_enough(make_scene):
    """Two digits of the coarse problem a stage: the displacements are exact all the same, after hardly more stages."""
    scene, rough = make_scene(), {"coarse_ksp_type": "cg", "coarse_pc_type": "jacobi", "coarse_ksp_rtol": 1e-2}
    exact, inexact = (solve(scene, stol=1e-11, **options) for options in ({}, rough))
    assert inexact.reason > 0
    assert far(inexact.u, oracle.newton(scene)) < 1e-9
    assert inexact.iterations <= 1.25 * exact.iterations
