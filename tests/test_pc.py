"""PC latin: one linear stage as a symmetric positive definite preconditioner for conjugate gradients."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import oracle
import pytest
from petsc4py import PETSc
from support import ALL_VARIANTS, VARIANTS, chain, far, grid, irregular, lattice, network, settled

import latinpc
from latinpc.options import default_options
from latinpc.scenes import make


def bars(scene):
    """Make the same structure of bars only."""
    return replace(scene, law=np.zeros_like(scene.law))


def preconditioned(scene, pc_type="latin", **options):
    """Structure, tangent stiffness, load vector and preconditioner; options without `-pc_latin_`."""
    structure = latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF)
    matrix, u, b = structure.dm.createMat(), structure.create_vec(), structure.create_vec()
    structure.jacobian(u, matrix)
    structure.residual(u, b)
    b.scale(-1.0)
    pc = PETSc.PC().create(comm=PETSc.COMM_SELF)
    pc.setOperators(matrix)
    pc.setType(pc_type)
    if pc_type == "shell":
        latinpc.pcshell_set_latin(pc)
    else:
        structure.attach(pc)
    with default_options({f"pc_latin_{key}": value for key, value in options.items()}):
        pc.setFromOptions()
        pc.setUp()
    return SimpleNamespace(structure=structure, matrix=matrix, b=b, pc=pc)


def dense(matrix):
    """Entries of a matrix."""
    return matrix.convert("dense", PETSc.Mat()).getDenseArray().copy()


def explicit(system):
    """Preconditioner as a matrix: its effect on unit vectors, column by column."""
    x, y = system.structure.create_vec(), system.structure.create_vec()
    columns = np.zeros((x.getSize(),) * 2)
    for j in range(len(columns)):
        x.set(0.0)
        x.setValue(j, 1.0)
        x.assemble()
        system.pc.apply(x, y)
        columns[:, j] = y.getArray()
    return columns


def preconditioned_spectrum(system):
    """Eigenvalues of the preconditioned matrix, and how far the preconditioner is from symmetric."""
    m, lower = explicit(system), np.linalg.cholesky(dense(system.matrix))
    asymmetry = abs(m - m.T).max() / abs(m).max()
    return np.linalg.eigvalsh(lower.T @ (m + m.T) @ lower / 2), asymmetry


SCENES = {
    "grid": lambda: grid("truss"),
    "irregular": lambda: irregular("truss"),
    "network": lambda: bars(settled(network())),
    "many subdomains": lambda: bars(network(parts=30)),
    "lattice": lambda: bars(lattice()),
}


@pytest.mark.parametrize(("direction", "value", "least"), [("schur", 0.0, 0.35), ("diagonal", 1e-3, 0.9)])
@pytest.mark.parametrize("variant", ALL_VARIANTS)
@pytest.mark.parametrize("name", SCENES)
def test_symmetric_and_positive_definite(name, variant, direction, value, least):
    """What conjugate gradients ask for; the least eigenvalue is one, as weights sum to one, less what springs take."""
    system = preconditioned(SCENES[name](), variant=variant)
    latinpc.set_direction(system.pc, direction, value)
    eigenvalues, asymmetry = preconditioned_spectrum(system)
    assert asymmetry < 1e-10
    assert least < eigenvalues[0] < 1.0 + 1e-8
    if name in ("grid", "lattice"):
        assert eigenvalues[-1] < 20.0


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("name", SCENES)
def test_interiors_are_eliminated(name, variant):
    """After one application nothing is left of the residual inside subdomains, whatever it was."""
    scene = SCENES[name]()
    system = preconditioned(scene, variant=variant)
    x, y = system.structure.create_vec(), system.structure.create_vec()
    given = np.where(scene.fixed, 0.0, np.random.default_rng(0).normal(size=scene.nodes.shape))
    system.structure.set_displacements(given, x)
    system.pc.apply(x, y)
    left = system.structure.create_vec()
    system.structure.set_displacements(np.zeros_like(given), left)
    residual = x - system.matrix * y
    values = system.structure.displacements(residual) - system.structure.displacements(left)
    inside = np.array([len(parts) == 1 for parts in oracle.node_subdomains(scene)])
    shared = ~inside & ~scene.fixed.all(axis=1)
    assert abs(values[inside & ~scene.fixed.all(axis=1)]).max() < 1e-9
    if variant != "corner" or name not in ("lattice", "many subdomains"):  # there the corners hold everything
        assert abs(values[shared]).max() > 1e-3


def test_one_subdomain_is_solved_exactly():
    """Without interface the preconditioner is the inverse."""
    scene = grid("truss")
    scene.subdomain[:] = 0
    system = preconditioned(scene)
    error = explicit(system) @ dense(system.matrix) - np.eye(system.structure.sizes.free_dofs)
    assert abs(error).max() < 1e-8


def test_chain_is_solved_exactly():
    """In one dimension the coarse problem does it all."""
    eigenvalues, _ = preconditioned_spectrum(preconditioned(chain()))
    assert eigenvalues == pytest.approx(1.0, abs=1e-8)


def energy_errors(system, max_it=100):
    """Energy error of every iterate of conjugate gradients, relative to the solution's energy."""
    direct = PETSc.KSP().create(comm=PETSc.COMM_SELF)
    direct.setOperators(system.matrix)
    direct.setType("preonly")
    direct.getPC().setType("cholesky")
    direct.getPC().setFactorSolverType("cholmod")
    solution = system.structure.create_vec()
    direct.solve(system.b, solution)
    energy, errors = solution.dot(system.matrix * solution), []

    def monitor(ksp, _it, _norm):
        difference = ksp.buildSolution() - solution
        errors.append(np.sqrt(difference.dot(system.matrix * difference) / energy))

    ksp = PETSc.KSP().create(comm=PETSc.COMM_SELF)
    ksp.setOperators(system.matrix)
    ksp.setType("cg")
    ksp.setPC(system.pc)
    ksp.setTolerances(rtol=1e-11, max_it=max_it)
    ksp.setMonitor(monitor)
    ksp.solve(system.b, system.structure.create_vec())
    assert ksp.getConvergedReason() > 0
    return np.array(errors)


def iterations_to(errors, accuracy):
    """Return the number of the first iterate with the error below."""
    return int(np.argmax(errors <= accuracy))


@pytest.mark.parametrize("subdomains", [16, 64, 144])
def test_conjugate_gradients_on_the_truss(subdomains):
    """The article's truss: energy error 1e-4 in at most 14 iterations, 1e-8 in at most 28, at every size."""
    modules = 4 * round(subdomains**0.5)
    scene = make("truss-grid", modules=modules, subdomains=subdomains)
    errors = energy_errors(preconditioned(scene, variant="corner"))
    assert iterations_to(errors, 1e-4) <= 14
    assert iterations_to(errors, 1e-8) <= 28


@pytest.mark.parametrize("variant", VARIANTS)
def test_iterations_hardly_grow_with_the_number_of_subdomains(variant):
    """Four times the blocks: a third more iterations at the most, where without coarse problem it were twice."""
    systems = (preconditioned(grid("truss", 2 * k, k * k), variant=variant) for k in (5, 10))
    few, many = (iterations_to(energy_errors(system), 1e-8) for system in systems)
    assert many <= 4 / 3 * few


@pytest.mark.parametrize("direction", ["schur", "diagonal"])
def test_weights_take_contrast(direction):
    """Stiffnesses that jump by a million between blocks cost a few iterations, whatever the weights are made of."""
    scene = grid("truss")
    jumps = np.where(np.isin(scene.subdomain, [0, 2, 4, 6, 8]), 1e6, 1.0)
    contrast = replace(scene, stiffness=scene.stiffness * jumps)
    rough, smooth = (
        iterations_to(energy_errors(preconditioned(each, direction=direction)), 1e-8) for each in (contrast, scene)
    )
    assert rough <= smooth + 5


@pytest.mark.parametrize("make_scene", [grid, irregular, lattice])
def test_tangent_of_slack_cables(make_scene):
    """With slack cables the matrix is another one: the preconditioner follows, symmetric and positive definite."""
    scene = make_scene()
    reference = oracle.newton(scene)
    system = preconditioned(scene)
    u, count = system.structure.create_vec(), []
    for state in (np.zeros_like(reference), reference):
        system.structure.set_displacements(np.where(scene.fixed, 0.0, state), u)
        system.structure.jacobian(u, system.matrix)
        system.pc.setOperators(system.matrix)
        system.pc.setUp()
        eigenvalues, asymmetry = preconditioned_spectrum(system)
        assert asymmetry < 1e-8
        assert eigenvalues[0] > 0.5
        count.append(eigenvalues[-1])
    assert count[0] != count[1]


def test_another_matrix_is_another_preconditioner():
    """Twice the stiffness is half the displacement, after a change of laws as well as at the start."""
    scene = grid("truss")
    one, twice = (explicit(preconditioned(replace(scene, stiffness=k * scene.stiffness))) for k in (1.0, 2.0))
    assert abs(one - 2.0 * twice).max() < 1e-11 * abs(one).max()


@pytest.mark.parametrize("variant", VARIANTS)
def test_shell_gives_identical_vectors(variant):
    """The door for programs that insist on PCSHELL leads to the same preconditioner, to the bit."""
    scene = irregular("truss")
    by_type, by_shell = (preconditioned(scene, kind, variant=variant) for kind in ("latin", "shell"))
    x = by_type.structure.create_vec()
    x.setRandom()
    y, z = by_type.structure.create_vec(), by_type.structure.create_vec()
    by_type.pc.apply(x, y)
    by_shell.pc.apply(x, z)
    assert y.norm() > 0.0
    assert np.array_equal(y.getArray(), z.getArray())


def test_application_is_linear_and_leaves_its_argument():
    """Nothing of an application stays behind in the next one."""
    system = preconditioned(irregular("truss"))
    x, z = system.structure.create_vec(), system.structure.create_vec()
    x.setRandom()
    z.setArray(np.cos(np.arange(z.getSize())))
    before = x.copy()
    results = [system.structure.create_vec() for _ in range(4)]
    for argument, result in zip((x, z, x + 3.0 * z, x), results):
        system.pc.apply(argument, result)
    assert (x - before).norm() == 0.0
    assert np.array_equal(results[0].getArray(), results[3].getArray())
    assert (results[0] + 3.0 * results[1] - results[2]).norm() < 1e-10 * results[2].norm()


SOLVERS = {
    "petsc": dict.fromkeys(("local_pc_factor_mat_solver_type", "interior_pc_factor_mat_solver_type"), "petsc"),
    "coarse lu": {"coarse_pc_type": "lu"},
    "coarse redundant": {"coarse_pc_type": "redundant"},
    "scalar direction": {"direction": "scalar"},
    "schur direction": {"direction": "schur"},
}


@pytest.mark.parametrize("solver", SOLVERS)
def test_options_of_the_preconditioner(solver):
    """Inner solvers and direction by option, under -pc_latin_: as good a preconditioner."""
    scene = grid("truss")
    default, other = (iterations_to(energy_errors(preconditioned(scene, **o)), 1e-8) for o in ({}, SOLVERS[solver]))
    assert abs(default - other) <= (3 if solver.endswith("direction") else 0)


def test_solution_in_the_callers_numbering():
    """ksponly with cg and latin is the displacement of the structure, supports that have moved included."""
    scene = bars(settled(irregular()))
    structure = latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF)
    with default_options({"snes_type": "ksponly", "ksp_type": "cg", "pc_type": "latin", "ksp_rtol": 1e-12}):
        snes = structure.create_snes()
        snes.setFromOptions()
        u = structure.create_vec()
        snes.solve(None, u)
    assert snes.getConvergedReason() > 0
    assert far(structure.displacements(u), oracle.newton(scene)) < 1e-8


def test_view_says_what_it_is(mpirun):
    """-ksp_view names variant, weights, subdomains and the three inner solvers with their prefixes."""
    program = """
import sys
import petsc4py
petsc4py.init(sys.argv)
import latinpc
from latinpc.scenes import make

structure = latinpc.Structure.from_scene(make("truss-grid", modules=6, subdomains=9))
snes = structure.create_snes()
snes.setType("ksponly")
snes.setFromOptions()
snes.solve(None, structure.create_vec())
"""
    words = "-ksp_type cg -pc_type latin -pc_latin_variant macro -ksp_view -options_left"
    out = mpirun(1, program, *words.split()).stdout
    for text in (
        "type: latin",
        "variant macro",
        "weights of the copies of a node: stiffness",
        "subdomains: 9",
        "local solver",
        "coarse solver",
    ):
        assert text in out
    assert "There are no unused options" in out
