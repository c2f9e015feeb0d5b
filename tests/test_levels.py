"""The coarse problem as another level's: what its operator carries, and the solvers that use it; solvers by choice."""

import json

import numpy as np
import pytest
from petsc4py import PETSc
from support import cut, far, grid, latin, lattice, network, settled, solve

import latinpc
from latinpc.options import default_options
from latinpc.scenes import Law, make


def bars(scene):
    """Make the same structure of bars alone."""
    scene.law[:] = Law.BAR
    return scene


def plane(side=12):
    """Make a lattice of bars in side x side subdomains."""
    return bars(lattice(nx=4 * side, ny=4 * side, subdomains=side * side))


def precondition(scene, ksp_type="cg", _structure=None, **options):
    """Solve with PC latin; gives (iterations, reason, solution, the PC's statistics, coarse KSP's type and PC)."""
    structure = _structure or latinpc.Structure.from_scene(scene, comm=PETSc.COMM_SELF)
    matrix, u, b = structure.dm.createMat(), structure.create_vec(), structure.create_vec()
    structure.jacobian(u, matrix)
    structure.residual(u, b)
    b.scale(-1.0)
    with default_options({"pc_latin_" + key: value for key, value in options.items()}):
        ksp = PETSc.KSP().create(PETSc.COMM_SELF)
        ksp.setOperators(matrix)
        ksp.setType(ksp_type)
        ksp.setTolerances(rtol=1e-8, max_it=300)
        ksp.getPC().setType("latin")
        ksp.setFromOptions()
        ksp.solve(b, u)
        coarse = latinpc.coarse_ksp(ksp.getPC())
        return ksp.getIterationNumber(), ksp.getConvergedReason(), u, latinpc.statistics(ksp.getPC()), coarse, ksp


def explicit(pc, n):
    """The preconditioner as a dense matrix."""
    x, y = PETSc.Vec().createSeq(n), PETSc.Vec().createSeq(n)
    m = np.zeros((n, n))
    for j in range(n):
        x.set(0.0)
        x[j] = 1.0
        x.assemble()
        pc.apply(x, y)
        m[:, j] = y.getArray()
    return m


# ---- what the operator carries ---------------------------------------------------------------
@pytest.mark.parametrize(
    ("make_scene", "variant"),
    [
        (plane, "none"),
        (plane, "macro"),
        (plane, "corner"),
        (lambda: bars(grid("truss", 8, 16)), "none"),
        (lambda: bars(grid("truss", 8, 16)), "corner"),
        (lambda: bars(cut(lattice(16, 16, 16), 20)), "corner"),  # elsewhere dependent modes are left out
    ],
    ids=["lattice none", "lattice macro", "lattice corner", "truss none", "truss corner", "cut corner"],
)
def test_near_null_space_is_that_of_rigid_motions(make_scene, variant):
    """Subdomains that nothing holds move rigidly without energy: the coarse matrix makes no force of such motions."""
    scene = make_scene()
    held = np.unique(scene.links[scene.subdomain == 0])
    scene.fixed[:] = False
    scene.fixed[held] = True
    with latin(scene, variant=variant, coarse_pc_type="jacobi") as run:
        run.snes.setUp()
        a = latinpc.coarse_ksp(run.snes).getOperators()[0]
        fields = a.getNearNullSpace().getVecs()
        dense = a.convert("dense", PETSc.Mat()).getDenseArray()
    assert len(fields) == scene.dim * (scene.dim + 1) // 2
    columns = np.column_stack([v.getArray(readonly=True) for v in fields])
    assert columns.T @ columns == pytest.approx(np.eye(len(fields)), abs=1e-12)
    quiet = abs(dense @ columns).max(axis=1) < 1e-9 * abs(dense).max()
    assert quiet.mean() > 0.5  # all but the unknowns of subdomains next to the held one


# ---- solvers ---------------------------------------------------------------------------------
MOST = {"jacobi": 250, "gamg": 30, "latin": 8}


@pytest.mark.parametrize("kind", MOST)
def test_coarse_preconditioners_applied_once(kind):
    """Symmetric, so that conjugate gradients outside converge; a level of our own costs next to no iterations."""
    exact = precondition(plane())
    iterations, reason, u, statistics, coarse, _ = precondition(plane(), coarse_pc_type=kind)
    assert coarse.getType() == "preonly" and coarse.getPC().getType() == kind
    assert reason > 0 and exact[0] <= 6 and iterations <= MOST[kind]
    assert statistics["coarse_levels"] == 0
    assert far(u.getArray(), exact[2].getArray()) < 1e-6


def test_one_rank_is_exact():
    """A coarse solver of type latin has a subdomain a rank: with one alone it is a direct one."""
    exact, level = precondition(plane(3)), precondition(plane(3), coarse_pc_type="latin")
    assert latinpc.statistics(level[4].getPC())["subdomains"] == 1
    assert level[0] == exact[0]
    assert far(level[2].getArray(), exact[2].getArray()) < 1e-12


@pytest.mark.parametrize("kind", ["gamg", "latin"])
@pytest.mark.parametrize("family", ["snes", "ksp"])
def test_exact_iterations_get_conjugate_gradients(kind, family):
    """An iteration that takes its linear stages to be exact gets them to a small residual, without being told.

    Where each stage corrects the one before they need a tolerance to be as accurate (test_coarse_ranks.py).
    """
    if family == "snes":
        scene = network()
        tight = {"coarse_pc_type": kind, "coarse_ksp_rtol": 1e-10}
        default, other = (solve(scene, max_it=4, stol=0, **o) for o in ({}, tight))
        assert far(other.u, default.u) < 1e-7
        return
    structure = latinpc.Structure.from_scene(plane(6), comm=PETSc.COMM_SELF)
    matrix, u, b = structure.dm.createMat(), structure.create_vec(), structure.create_vec()
    structure.jacobian(u, matrix)
    b.setArray(np.sin(1.0 + np.arange(b.getSize())))
    with default_options({"ksp_latin_coarse_pc_type": kind}):
        ksp = PETSc.KSP().create(PETSc.COMM_SELF)
        ksp.setOperators(matrix)
        ksp.setType("latin")
        ksp.setTolerances(rtol=1e-9)
        ksp.setFromOptions()
        ksp.solve(b, u)
    assert ksp.getConvergedReason() > 0
    assert (b - matrix * u).norm() < 1e-6 * b.norm()


# ---- solvers of the subdomains ---------------------------------------------------------------
@pytest.mark.parametrize("kind", ["icc", "gamg"])
def test_subdomains_by_conjugate_gradients(kind):
    """A preconditioner that is no factorisation: solved to a small residual, so that no iteration is added."""
    scene = make("truss-grid", modules=8, subdomains=16)
    exact = precondition(scene)
    iterations, reason, u, _, _, ksp = precondition(scene, local_pc_type=kind)
    assert reason > 0 and iterations <= exact[0] + 1
    assert far(u.getArray(), exact[2].getArray()) < 1e-6
    m = explicit(ksp.getPC(), u.getSize())
    assert abs(m - m.T).max() < 1e-6 * abs(m).max()
    assert np.linalg.eigvalsh((m + m.T) / 2)[0] > 0.0


@pytest.mark.parametrize("kind", ["icc", "gamg"])
def test_approximate_interiors(kind):
    """Applied once: few iterations are added; grids with mechanisms inside subdomains."""
    scene = make("truss-grid", modules=8, subdomains=16)
    exact = precondition(scene, direction="diagonal")
    iterations, reason, u, _, _, ksp = precondition(scene, direction="diagonal", interior_pc_type=kind)
    assert reason > 0 and iterations <= exact[0] + 16
    assert far(u.getArray(), exact[2].getArray()) < 1e-5
    m = explicit(ksp.getPC(), u.getSize())
    assert abs(m - m.T).max() < 1e-9 * abs(m).max()
    assert np.linalg.eigvalsh((m + m.T) / 2)[0] > 0.0


def test_an_accurate_iteration_is_the_factorisation():
    """To its tolerance."""
    scene = bars(settled(lattice()))
    options = {"local_ksp_type": "cg", "local_pc_type": "jacobi", "local_ksp_rtol": 1e-13}
    exact, other = (solve(scene, max_it=3, stol=0, **o) for o in ({}, options))
    assert far(other.u, exact.u) < 1e-8


def test_exact_iterations_solve_subdomains_by_conjugate_gradients():
    """Without a type given, to a small residual."""
    exact, other = (solve(network(), max_it=4, stol=0, **o) for o in ({}, {"local_pc_type": "icc"}))
    assert far(other.u, exact.u) < 1e-6


@pytest.mark.parametrize("outer", ["fcg", "fgmres"])
def test_inner_iterations_under_a_flexible_method(outer):
    """A preconditioner that changes from application to application."""
    options = {"coarse_pc_type": "jacobi", "coarse_ksp_type": "cg", "coarse_ksp_rtol": 0.1}
    iterations, reason, *_ = precondition(plane(6), outer, **options)
    assert reason > 0 and iterations < 30


# ---- several ranks ---------------------------------------------------------------------------
RANKS = {
    "gamg": ["-pc_latin_coarse_pc_type", "gamg"],
    "latin": ["-pc_latin_coarse_pc_type", "latin"],
    "latin over gamg": ["-pc_latin_coarse_pc_type", "latin", "-pc_latin_coarse_pc_latin_coarse_pc_type", "gamg"],
    "bddc": ["--problem", "poisson", "-pc_latin_coarse_pc_type", "bddc"],  # on elasticity its own problems are singular
    "telescope": [
        *("-pc_latin_coarse_pc_type", "telescope", "-pc_latin_coarse_pc_telescope_reduction_factor", "2"),
        *("-pc_latin_coarse_telescope_pc_type", "cholesky"),
    ],
}


@pytest.mark.parametrize("kind", RANKS)
def test_on_several_ranks(ranks_for, kind):
    """A matrix of finite elements whose local matrices fall into parts: the coarse operator spreads over the ranks."""
    words = ["--problem", "elasticity", "--cells", "16", "--blocks", "4,4", "--colours"]
    found = ranks_for(4, "matis_program", *words, *RANKS[kind])
    assert not found["unused"]
    assert found["reason"] > 0 and found["residual"] < 1e-6 and found["subdomains"] == 16
    assert found["iterations"] <= {"telescope": 8, "latin": 8}.get(kind, 20)


def test_two_levels_are_symmetric_positive_definite(ranks_for):
    """What conjugate gradients ask of the whole."""
    words = ["--problem", "elasticity", "--cells", "16", "--blocks", "4,4", "--colours", "--spectrum"]
    found = ranks_for(4, "matis_program", *words, *RANKS["latin"])
    assert found["asymmetry"] < 1e-8 and found["least"] > 0.0


LEVELS = """
import json, sys, petsc4py
petsc4py.init([sys.argv[0], "-skip_petscrc", *sys.argv[1:]])
from petsc4py import PETSc
import latinpc
from latinpc.scenes import make

structure = latinpc.Structure.from_scene(make("truss-grid", modules=24, subdomains=144))
a, u, b = structure.dm.createMat(), structure.create_vec(), structure.create_vec()
structure.jacobian(u, a)
structure.residual(u, b)
ksp = PETSc.KSP().create()
ksp.setOperators(a)
ksp.setType("cg")
ksp.setTolerances(rtol=1e-8)
ksp.getPC().setType("latin")
ksp.setFromOptions()
ksp.solve(b, u)
found = {"iterations": ksp.getIterationNumber(), "reason": ksp.getConvergedReason()}
found["subdomains"] = latinpc.statistics(ksp.getPC())["subdomains"]
coarse = latinpc.coarse_ksp(ksp.getPC()).getPC()
found["above"] = latinpc.statistics(coarse)["subdomains"] if coarse.getType() == "latin" else 0
PETSc.Sys.Print(json.dumps(found))
"""


def test_levels_of_structures_on_several_ranks(mpirun):
    """Local fields make up for jumps between the parts of the ranks: hardly more iterations than a direct solver."""
    exact, level = (json.loads(mpirun(4, LEVELS, *words).stdout) for words in ([], RANKS["latin"]))
    assert exact["subdomains"] == level["subdomains"] == 144
    assert level["above"] == 4
    assert exact["reason"] > 0 and level["reason"] > 0
    assert level["iterations"] <= exact["iterations"] + 4


PARTS = """
import json, sys, petsc4py
petsc4py.init([sys.argv[0], "-skip_petscrc", *sys.argv[1:]])
from petsc4py import PETSc
import latinpc

structure = latinpc.local_scene("tensegrity-grid", modules=32, partition="metis")
snes, u = structure.create_snes(), structure.create_vec()
snes.setFromOptions()
snes.setUp()
coarse, steps = latinpc.coarse_ksp(snes), []
coarse.setMonitor(lambda ksp, step, norm: steps.append(step))
snes.solve(None, u)
found = {"stages": steps.count(0), "steps": sum(step > 0 for step in steps), "reason": snes.getConvergedReason()}
found["coarse"] = latinpc.statistics(snes)["coarse_size"]
found["above"] = latinpc.statistics(coarse.getPC())["coarse_size"]
found["factors"] = latinpc.local_ksp(coarse.getPC()).handle != 0
PETSc.Sys.Print(json.dumps(found))
"""


def test_second_level_of_substructures(mpirun):
    """Blocks of the operators share forces, and interfaces have a few fields: two or three steps leave a tenth."""
    found = json.loads(mpirun(8, PARTS, "-snes_latin_coarse_pc_type", "latin").stdout)
    assert found["reason"] > 0
    assert found["steps"] <= 3 * found["stages"]
    assert 4 * found["above"] < found["coarse"]


@pytest.mark.parametrize("ranks", [2, 4])
def test_local_solvers_of_substructures_are_their_inverses(mpirun, ranks):
    """Fields of interfaces need them: no factor is made, unless options choose one, and the steps are the same."""
    words = ["-snes_latin_coarse_pc_type", "latin"]
    inverse, factor = (
        json.loads(mpirun(ranks, PARTS, *words, *more).stdout)
        for more in ([], ["-snes_latin_coarse_pc_latin_local_pc_type", "cholesky"])
    )
    assert not inverse.pop("factors") and factor.pop("factors")
    assert inverse["reason"] > 0 and inverse == factor


HANGING = """
import json, sys
import petsc4py
petsc4py.init([sys.argv[0], "-skip_petscrc", "-pc_latin_variant", "primal", "-pc_latin_coarse_pc_type", "latin"])
from petsc4py import PETSc
import numpy as np
import latinpc

comm, bs, n, ends = PETSc.COMM_WORLD, 3, 12, 4  # nodes of a ring; chains of each rank that hang on one of them


def solve(rng):
    edges, nodes = [(i, (i + 1) % n, i * comm.size // n) for i in range(n)], n
    for k in range(ends * comm.size):
        on = int(rng.integers(n))
        edges += [(on, nodes, k % comm.size), (nodes, nodes + 1, k % comm.size), (on, nodes + 1, k % comm.size)]
        nodes += 2
    local = np.zeros((bs * nodes,) * 2)
    for a, b, owner in edges:
        root = rng.normal(size=(bs, bs))
        rows = np.ravel([bs * np.array([a, b])[:, None] + np.arange(bs)])
        if owner == comm.rank:
            local[np.ix_(rows, rows)] += np.kron([[1, -1], [-1, 1]], root @ root.T + 0.1 * np.eye(bs))
    local = local[bs:, bs:]  # the first node is held
    mine = np.flatnonzero(local.any(axis=0))
    a = PETSc.Mat().create(comm)
    a.setSizes(len(local))
    a.setType("is")
    a.setLGMap(*2 * [PETSc.LGMap().create(mine.astype(PETSc.IntType), comm=comm)])
    part = PETSc.Mat().createDense((len(mine),) * 2, array=local[np.ix_(mine, mine)], comm=PETSc.COMM_SELF)
    part.assemble()
    a.setISLocalMat(part.convert("seqaij"))
    a.assemble()
    ksp = PETSc.KSP().create(comm)
    ksp.setOperators(a)
    ksp.setType("cg")
    ksp.setTolerances(rtol=1e-8)
    ksp.getPC().setType("latin")
    ksp.setFromOptions()
    x, b = a.createVecs()
    b.set(1.0)
    ksp.solve(b, x)
    return ksp.getConvergedReason(), ksp.getIterationNumber(), (b - a * x).norm() / b.norm()


found = [solve(np.random.default_rng(seed)) for seed in range(8)]
PETSc.Sys.Print(json.dumps(found))
"""


def test_pieces_that_hang_on_a_node_leave_the_second_level_rounding_alone(mpirun):
    """Their condensed stiffness is zero but for rounding, which need not be positive semidefinite."""
    for reason, iterations, residual in json.loads(mpirun(3, HANGING).stdout.splitlines()[-1]):
        assert reason > 0 and iterations <= 10 and residual < 1e-6


LOOSE = """
import sys, petsc4py
petsc4py.init([sys.argv[0], "-skip_petscrc", "-pc_latin_coarse_pc_type", "latin"])
from petsc4py import PETSc
import numpy as np
import latinpc
from latinpc.scenes import make

scene = make("truss-grid", modules=12, subdomains=16)
held = np.zeros_like(scene.fixed)
held[scene.fixed.any(axis=1).argmax()] = True
scene.fixed = held
structure = latinpc.Structure.from_scene(scene)
a, u = structure.dm.createMat(), structure.create_vec()
structure.jacobian(u, a)
pc = PETSc.PC().create()
pc.setOperators(a)
pc.setType("latin")
pc.setFromOptions()
structure.attach(pc)
try:
    pc.setUp()
except PETSc.Error as error:
    PETSc.Sys.Print(latinpc.error_message(error))
"""


def test_the_second_level_hides_no_mechanism(mpirun):
    """A truss held at one node turns about it."""
    assert "The structure has a mechanism" in mpirun(4, LOOSE, leaks=False).stdout
