"""KSP latin: the iteration on interface data for linear operators, plain and accelerated."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import oracle
import pytest
from petsc4py import PETSc
from support import ALL_VARIANTS, PLAIN, VARIANTS, chain, far, grid, irregular, lattice, logged, network, solve
from test_pc import bars

import latinpc
from latinpc.options import default_options
from latinpc.scenes import make

OUTER = ("gmres", "richardson", "bcgs")
SCENES = {
    "grid": lambda: grid("truss"),
    "irregular": lambda: irregular("truss"),
    "network": lambda: bars(network()),
    "lattice": lambda: bars(lattice()),
}


def linear_system(scene, rtol=1e-11, variant="corner", **options):
    """Structure, tangent stiffness, load vector and KSP latin; options without `-ksp_latin_`."""
    structure = latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF)
    matrix, u, b = structure.dm.createMat(), structure.create_vec(), structure.create_vec()
    structure.jacobian(u, matrix)
    structure.residual(u, b)
    b.scale(-1.0)
    ksp = PETSc.KSP().create(comm=PETSc.COMM_SELF)
    ksp.setOperators(matrix)
    ksp.setType("latin")
    structure.attach(ksp)
    latinpc.set_variant(ksp, variant)
    ksp.setTolerances(rtol=rtol, max_it=1000)
    with default_options({f"ksp_latin_{key}": value for key, value in options.items()}):
        ksp.setFromOptions()
        ksp.setUp()
    return SimpleNamespace(structure=structure, matrix=matrix, b=b, ksp=ksp)


def solved(system, guess=None):
    """Solution of the system, and what a direct solver finds."""
    x, exact = (system.structure.create_vec() for _ in range(2))
    if guess is not None:
        guess.copy(x)
        system.ksp.setInitialGuessNonzero(True)
    system.ksp.solve(system.b, x)
    direct = PETSc.KSP().create(comm=PETSc.COMM_SELF)
    direct.setOperators(system.matrix)
    direct.setType("preonly")
    direct.getPC().setType("cholesky")
    direct.getPC().setFactorSolverType("cholmod")
    direct.solve(system.b, exact)
    return x, exact


def interface_operator(system):
    """Operator on the interface data as a matrix, column by column."""
    outer = latinpc.outer_ksp(system.ksp)
    system.ksp.setTolerances(max_it=1)
    system.ksp.solve(system.b, system.structure.create_vec())
    operator = outer.getOperators()[0]
    x, y = operator.createVecs()
    columns = np.zeros((x.getSize(),) * 2)
    for j in range(len(columns)):
        x.set(0.0)
        x.setValue(j, 1.0)
        x.assemble()
        operator.mult(x, y)
        columns[:, j] = y.getArray()
    return columns


def test_the_solution_can_be_built_during_and_after_a_solve():
    """Monitors build that of an iterate; afterwards there is the last one, and its residual."""
    system, seen = linear_system(grid("truss")), []
    system.ksp.setMonitor(lambda ksp, it, norm: seen.append(ksp.buildSolution().norm()))
    x = solved(system)[0]
    found = system.ksp.buildSolution()
    assert np.array_equal(found.array, x.array)
    assert system.ksp.buildResidual().norm() < 1e-9 * system.b.norm()
    assert seen[-1] == pytest.approx(x.norm(), rel=1e-9) and seen[0] != pytest.approx(x.norm(), rel=1e-6)


# ---- the operator ----------------------------------------------------------------------------
@pytest.mark.parametrize("direction", ["scalar", "diagonal", "schur"])
@pytest.mark.parametrize("variant", ALL_VARIANTS)
@pytest.mark.parametrize("name", ["grid", "lattice", "irregular"])
def test_two_reflections(name, variant, direction):
    """In the energy norm of the direction 1 - A is a contraction: a reflection of the subdomains, then the exchange."""
    system = linear_system(SCENES[name](), variant=variant, direction=direction)
    operator = interface_operator(system)
    assert np.linalg.norm(operator - np.eye(len(operator)), 2) < 1.0 + 1e-10


@pytest.mark.parametrize("variant", VARIANTS)
def test_solution_is_the_fixed_point(variant):
    """At the solution an iteration changes nothing."""
    system = linear_system(grid("truss"), variant=variant, rtol=1e-12)
    solved(system)
    outer = latinpc.outer_ksp(system.ksp)
    residual = outer.getRhs().duplicate()
    outer.getOperators()[0].mult(outer.getSolution(), residual)
    residual.axpy(-1.0, outer.getRhs())
    assert outer.getRhs().norm() == pytest.approx(1.0)
    assert residual.norm() < 1e-11


# ---- solutions -------------------------------------------------------------------------------
@pytest.mark.parametrize(("name", "variant", "outer"), [
    (name, variant, outer)
    for name in SCENES for variant in VARIANTS for outer in OUTER
    # elsewhere the plain iteration is slow
    if outer != "richardson" or (name in ("grid", "irregular") and variant != "none")
])  # fmt: skip
def test_agrees_with_a_direct_solver(name, variant, outer):
    system = linear_system(SCENES[name](), variant=variant, outer_ksp_type=outer)
    x, exact = solved(system)
    assert system.ksp.getConvergedReason() > 0
    assert (x - exact).norm() < 1e-9 * exact.norm()


def test_richardson_is_the_iteration_of_snes_latin():
    """The same displacements after the same number of linear stages, of which one makes the right-hand side."""
    scene = grid("truss")
    for stages in (1, 2, 5, 9):
        plain = solve(scene, max_it=stages, stol=0.0, variant="corner", **PLAIN)
        system = linear_system(scene, outer_ksp_type="richardson")
        system.ksp.setTolerances(rtol=0.0, max_it=stages - 1)
        x, _ = solved(system)
        assert system.ksp.getIterationNumber() == stages - 1
        assert far(system.structure.displacements(x), plain.u) < 1e-12


@pytest.mark.parametrize(("subdomains", "published", "free"), [(9, 22, 13), (16, 22, 14), (36, 24, 15)])
def test_richardson_counts_of_the_truss(subdomains, published, free):
    """The article's linear table: stages to a displacement error of 1e-4, as SNES latin counts them."""
    scene = make("truss-grid", modules=4 * round(subdomains**0.5), subdomains=subdomains)
    for variant, expected in (("published", published), ("corner", free)):
        system = linear_system(scene, variant=variant, outer_ksp_type="richardson")
        latinpc.set_direction(system.ksp, "scalar", 7e6)
        _, exact = solved(system)
        errors = []
        system.ksp.setMonitor(
            lambda ksp, *_, to=errors, u=exact: to.append((ksp.buildSolution() - u).norm() / u.norm())
        )
        solved(system)
        stages = 1 + int(np.argmax(np.array(errors) <= 1e-4))
        assert abs(stages - expected) <= 1  # here one displacement a node counts, there one a copy


@pytest.mark.parametrize("subdomains", [16, 64, 144])
def test_accelerated_counts_do_not_grow(subdomains):
    """Truss, 1e-8: the interface residual, and some iterations later b - A x, at every size."""
    scene = make("truss-grid", modules=4 * round(subdomains**0.5), subdomains=subdomains)
    system = linear_system(scene, rtol=1e-8)
    system.ksp.setConvergenceHistory()
    x, exact = solved(system)
    norms = system.ksp.getConvergenceHistory()
    assert np.argmax(norms <= 1e-8 * norms[0]) <= 20
    assert system.ksp.getIterationNumber() <= 24
    assert (x - exact).norm() < 1e-8 * exact.norm()


@pytest.mark.parametrize("make_scene", [grid, irregular])
def test_tangents_of_slack_cables(make_scene):
    """Behind Newton's method the operators follow the tangent from step to step."""
    scene = make_scene()
    structure = latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF)
    with default_options({"snes_type": "newtonls", "ksp_type": "latin", "ksp_rtol": 1e-10, "snes_rtol": 1e-10}):
        snes = structure.create_snes()
        snes.setFromOptions()
        u = structure.create_vec()
        snes.solve(None, u)
    assert snes.getConvergedReason() > 0 and snes.getIterationNumber() > 1
    assert far(structure.displacements(u), oracle.newton(scene)) < 1e-8


@pytest.mark.parametrize("scene", [chain(), replace(grid("truss"), subdomain=None)], ids=["chain", "one subdomain"])
def test_nothing_to_iterate(scene):
    """In one dimension the coarse problem does it all, and a single subdomain is solved at once."""
    system = linear_system(scene, subdomains=0 if scene.subdomain is not None else 1)
    x, exact = solved(system)
    assert system.ksp.getConvergedReason() > 0 and system.ksp.getIterationNumber() <= 1
    assert (x - exact).norm() < 1e-11 * exact.norm()


# ---- what a user of a KSP may rely on --------------------------------------------------------
@pytest.mark.parametrize("norm", ["PRECONDITIONED", "UNPRECONDITIONED"])
def test_monitors_and_tests_of_the_user_with_one_subdomain(norm):
    """What has nothing to iterate is monitored and tested once, and the history has its norm."""
    system = linear_system(replace(grid("truss"), subdomain=None), subdomains=1)
    system.ksp.setNormType(getattr(PETSc.KSP.NormType, norm))
    system.ksp.setConvergenceHistory()
    seen, tested = [], []
    system.ksp.setMonitor(lambda _ksp, it, rnorm: seen.append((it, rnorm)))
    x, _ = solved(system)
    left = (system.b - system.matrix * x).norm() if norm == "UNPRECONDITIONED" else 0.0
    assert [it for it, _ in seen] == [0] and seen[0][1] == pytest.approx(left)
    assert list(system.ksp.getConvergenceHistory()) == [seen[0][1]] == [system.ksp.getResidualNorm()]

    def never(_ksp, it, rnorm):
        tested.append((it, rnorm))
        return PETSc.KSP.ConvergedReason.DIVERGED_DTOL

    system.ksp.setConvergenceTest(never)
    system.ksp.solve(system.b, x)
    assert system.ksp.getConvergedReason() == PETSc.KSP.ConvergedReason.DIVERGED_DTOL
    assert [it for it, _ in tested] == [0]


@pytest.mark.parametrize("norm", [PETSc.KSP.NormType.PRECONDITIONED, PETSc.KSP.NormType.UNPRECONDITIONED])
def test_initial_guess(norm):
    """The solution as a guess needs no iteration, a near one fewer than zero, a far one leads there as well."""
    system = linear_system(grid("truss"), rtol=1e-8)
    system.ksp.setNormType(norm)
    x, exact = solved(system)
    zero = system.ksp.getIterationNumber()
    again, _ = solved(system, guess=exact)
    assert system.ksp.getIterationNumber() == 0 and system.ksp.getConvergedReason() > 0
    assert (again - exact).norm() < 1e-11 * exact.norm()
    solved(system, guess=x * (1 + 1e-5))
    assert 0 < system.ksp.getIterationNumber() < zero
    far_off = exact.duplicate()
    far_off.setRandom()
    again, _ = solved(system, guess=far_off * exact.norm())
    assert (again - exact).norm() < 1e-6 * exact.norm()


def test_norms_are_what_they_say():
    """Unpreconditioned is |b - A x| of the displacements, relative to |b|; preconditioned that of the interfaces."""
    system = linear_system(grid("truss"), rtol=1e-8)
    seen = []

    def monitor(ksp, _it, norm):
        x = ksp.buildSolution()
        seen.append((norm, (system.b - system.matrix * x).norm()))

    system.ksp.setMonitor(monitor)
    system.ksp.setConvergenceHistory()
    system.ksp.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
    x, _ = solved(system)
    norms, true = np.array(seen).T
    assert norms == pytest.approx(true)
    assert system.ksp.getConvergenceHistory() == pytest.approx(norms)
    assert len(norms) == system.ksp.getIterationNumber() + 1
    assert norms[-1] <= 1e-8 * system.b.norm() < norms[-2]
    assert (system.b - system.matrix * x).norm() == pytest.approx(norms[-1])
    seen.clear()
    system.ksp.setNormType(PETSc.KSP.NormType.PRECONDITIONED)
    solved(system)
    norms, true = np.array(seen).T
    assert norms[-1] <= 1e-8 * norms[0]
    assert true[-1] <= 1e-8 * system.b.norm()  # a claim meets both
    assert norms != pytest.approx(true)


def test_without_norms_iterations_end_without_a_breakdown():
    """Where nothing is compared with tolerances, nothing can miss them; as inside other solvers."""
    system = linear_system(grid("truss"))
    system.ksp.setNormType(PETSc.KSP.NormType.NONE)
    x, exact = solved(system)
    assert system.ksp.getConvergedReason() > 0 and (x - exact).norm() < 1e-9 * exact.norm()


@pytest.mark.parametrize("outer", OUTER)
def test_without_norms_all_iterations_are_made(outer):
    """Most methods compute none then: the zero in its place had ended the solve before its first iteration."""
    system = linear_system(grid("truss"), outer_ksp_type=outer)
    system.ksp.setNormType(PETSc.KSP.NormType.NONE)
    system.ksp.setTolerances(max_it=6)
    x, exact = solved(system)
    assert system.ksp.getIterationNumber() == 6 and (x - exact).norm() < 1e-3 * exact.norm()


def test_restarts_are_counted_once():
    """A short memory takes longer, and every iteration is monitored once."""
    system = linear_system(grid("truss"), outer_ksp_gmres_restart=4)
    system.ksp.setConvergenceHistory()
    x, exact = solved(system)
    assert len(system.ksp.getConvergenceHistory()) == system.ksp.getIterationNumber() + 1
    assert (x - exact).norm() < 1e-9 * exact.norm()


@pytest.mark.parametrize("outer", OUTER)
def test_iterations_do_not_depend_on_units(outer):
    """kN and mm, or loads of a feather: the same iterations."""
    scene, counts = grid("truss"), []
    for force, length, load in ((1.0, 1.0, 1.0), (1e-3, 1e3, 1.0), (1.0, 1.0, 1e-12)):
        stiffness = scene.stiffness * force / length
        scaled = replace(scene, nodes=scene.nodes * length, load=scene.load * force, stiffness=stiffness)
        system = linear_system(replace(scaled, initial_elongation=np.zeros_like(stiffness)), outer_ksp_type=outer)
        system.b.scale(load)
        x, exact = solved(system)
        assert (x - exact).norm() < 1e-9 * exact.norm()
        counts.append(system.ksp.getIterationNumber())
    assert max(counts) - min(counts) <= 1


def test_operators_are_built_again_only_for_another_matrix():
    """A second right-hand side finds everything there; another tangent, or another option, does not."""
    scene = grid()
    system = linear_system(scene)
    first, _ = solved(system)
    with logged():
        event = PETSc.Log.Event("LatinSetUp")
        before = event.getPerfInfo()["count"]
        system.b.scale(2.0)
        second, _ = solved(system)
        assert (second - 2.0 * first).norm() < 1e-9 * second.norm()
        system.ksp.setOperators(system.matrix)
        solved(system)
        assert event.getPerfInfo()["count"] == before
        u = system.structure.create_vec()
        system.structure.set_displacements(np.where(scene.fixed, 0.0, oracle.newton(scene)), u)
        system.structure.jacobian(u, system.matrix)
        system.ksp.setOperators(system.matrix)
        x, exact = solved(system)
        assert event.getPerfInfo()["count"] == before + 1
        assert (x - exact).norm() < 1e-8 * exact.norm()
        with default_options({"ksp_latin_modes": "rigid"}):
            system.ksp.setFromOptions()
        x, exact = solved(system)
        assert event.getPerfInfo()["count"] == before + 2
        assert (x - exact).norm() < 1e-8 * exact.norm()


PROGRAM = """
import sys
import petsc4py
petsc4py.init(sys.argv)
from petsc4py import PETSc
import numpy as np
import latinpc
from latinpc.scenes import make

structure = latinpc.Structure.from_scene(make("truss-grid", modules=8, subdomains=16))
snes = structure.create_snes()
snes.setType("ksponly")
ksp = snes.getKSP()
ksp.setType("latin")
ksp.setTolerances(rtol=1e-11)
snes.setFromOptions()
u = structure.create_vec()
snes.solve(None, u)
assert snes.getConvergedReason() > 0
whole, statistics = structure.displacements(u), latinpc.statistics(ksp)
if PETSc.COMM_WORLD.rank == 0:
    np.save(sys.argv[1], whole)
    print(ksp.getIterationNumber(), statistics["subdomains"], statistics["state_size"])
"""


@pytest.mark.parametrize("outer", ["gmres", "richardson"])
def test_any_number_of_ranks(mpirun, tmp_path, outer):
    """The same iterations and displacements, and more ranks than some have subdomains."""
    found, told = [], []
    for ranks in (1, 2, 5):
        file = tmp_path / f"u{ranks}.npy"
        told.append(mpirun(ranks, PROGRAM, file, "-ksp_latin_outer_ksp_type", outer).stdout.split())
        found.append(np.load(file))
    assert told[0][1:] == told[1][1:] == told[2][1:]
    assert len({one[0] for one in told}) == 1
    assert far(found[1], found[0]) < 1e-9 and far(found[2], found[0]) < 1e-9


def test_view_says_what_it_is(mpirun, tmp_path):
    words = "-ksp_latin_modes rigid -ksp_latin_outer_ksp_type bcgs -ksp_view -options_left -ksp_monitor_true_residual"
    out = mpirun(2, PROGRAM, tmp_path / "u.npy", *words.split()).stdout
    wanted = (
        "type: latin",
        "variant corner, rigid macro fields",
        "subdomains: 16",
        "solver of the interface data",
        "type: bcgs",
        "coarse solver",
    )
    assert [text for text in wanted if text not in out] == []
    assert "There are no unused options" in out and "true resid norm" in out


# ---- misuse ----------------------------------------------------------------------------------
def message(action):
    with pytest.raises(PETSc.Error) as caught:
        action()
    return latinpc.error_message(caught.value)


def test_no_structure():
    matrix = PETSc.Mat().createAIJ(4, comm=PETSc.COMM_SELF)
    matrix.setUp()
    matrix.assemble()
    ksp = PETSc.KSP().create(comm=PETSc.COMM_SELF)
    ksp.setType("latin")
    ksp.setOperators(matrix)
    assert "-ksp_type latin has no structure to work on: call LatinStructureAttachKSP()" in message(ksp.setUp)


def test_no_matrix():
    """None yet, twice, as PETSc makes an empty one when it is asked for; and none any more, after `KSPReset()`."""
    system = linear_system(grid("truss"))
    x, new = system.structure.create_vec(), PETSc.KSP().create(comm=PETSc.COMM_SELF)
    new.setType("latin")
    system.ksp.reset()
    for ksp in (new, new, system.ksp):
        assert "-ksp_type latin has no matrix yet: call KSPSetOperators()" in message(lambda ksp=ksp: ksp.solve(x, x))
    system.ksp.setOperators(system.matrix)
    system.ksp.solve(system.b, x)
    assert system.ksp.getConvergedReason() > 0


def test_another_matrix():
    """What is not the structure's tangent would be solved wrongly, so it is refused."""
    system = linear_system(grid("truss"))
    system.matrix.shift(1e3)
    system.ksp.setOperators(system.matrix)
    assert "is not the tangent stiffness" in message(system.ksp.setUp)


def test_no_tangent_yet():
    structure = latinpc.Structure.from_scene(grid("truss"), comm=PETSc.COMM_SELF)
    ksp = PETSc.KSP().create(comm=PETSc.COMM_SELF)
    ksp.setType("latin")
    ksp.setOperators(structure.dm.createMat())
    assert "is not the tangent stiffness" in message(ksp.setUp)


@pytest.mark.parametrize("outer", ["cg", "minres"])
def test_methods_for_symmetric_operators_on_the_interfaces(outer):
    system = linear_system(grid("truss"), outer_ksp_type=outer)
    told = message(lambda: system.ksp.solve(system.b, system.structure.create_vec()))
    assert f"not symmetric: instead of {outer} use -ksp_latin_outer_ksp_type gmres" in told


def test_a_preconditioner_has_no_place():
    ksp = PETSc.KSP().create(comm=PETSc.COMM_SELF)
    ksp.setType("latin")
    with default_options({"pc_type": "gamg"}):
        assert "-ksp_type latin takes no preconditioner, but -pc_type is gamg" in message(ksp.setFromOptions)


def test_not_of_the_type():
    ksp = PETSc.KSP().create(comm=PETSc.COMM_SELF)
    ksp.setType("cg")
    assert "not latin: call KSPSetType() first" in message(lambda: latinpc.outer_ksp(ksp))


@pytest.mark.parametrize(("kind", "inside"), [("latin", "none"), ("cg", "latin"), ("cg", "jacobi")])
def test_a_structure_is_attached_before_types_are_chosen(kind, inside):
    """To a KSP whose types options choose, of a matrix that does not come from the DM of the structure."""
    structure = latinpc.Structure.from_scene(grid("truss"), comm=PETSc.COMM_SELF)
    matrix, u, b = structure.dm.createMat(), structure.create_vec(), structure.create_vec()
    structure.jacobian(u, matrix)
    matrix.compose("__PETSc_dm", None)
    b.setRandom()
    ksp = PETSc.KSP().create(comm=PETSc.COMM_SELF)
    structure.attach(ksp)
    ksp.setOperators(matrix)
    ksp.setTolerances(rtol=1e-10)
    with default_options({"ksp_type": kind, "pc_type": inside}):
        ksp.setFromOptions()
    ksp.solve(b, u)
    assert ksp.getType() == kind and ksp.getConvergedReason() > 0 and (matrix * u - b).norm() < 1e-9 * b.norm()
