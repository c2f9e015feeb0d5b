"""The coarse problem of several ranks: half a matrix for a factorisation, an iteration that stages correct."""

import json

import pytest
from conftest import ROOT

SCRIPT = """
import json
import sys
import petsc4py
petsc4py.init([sys.argv[0], "-skip_petscrc"])
sys.path.insert(0, "TESTS")
import numpy as np
from petsc4py import PETSc
from support import irregular, latin, network
import latinpc

make, variant, options = sys.argv[1], sys.argv[2], json.loads(sys.argv[3])
scene = {"irregular": irregular, "network": network}[make]()
structure = latinpc.Structure.from_scene(scene)
with latin(scene, structure, variant=variant, stol=1e-9, max_it=500, newton="never", **options) as run:
    u = structure.create_vec()
    run.snes.solve(None, u)
    ksp = latinpc.coarse_ksp(run.snes)
    a = ksp.getOperators()[0]
    found = {
        "reason": int(run.snes.getConvergedReason()),
        "iterations": run.snes.getIterationNumber(),
        "type": a.getType(),
        "inner": ksp.getIterationNumber(),
        "u": structure.displacements(u).ravel().tolist(),
        "diagonal": PETSc.Scatter.toAll(a.getDiagonal())[1].getSize(),
    }
    x, y = a.createVecs()
    start, end = x.getOwnershipRange()
    x.setArray(np.sin(1.0 + np.arange(start, end)))
    a.mult(x, y)
    found["product"] = [y.norm(), y.dot(x)]
PETSc.Sys.Print(json.dumps(found))
""".replace("TESTS", str(ROOT / "tests"))


def run(mpirun, ranks, make, variant, **options):
    """Solve; what the solver and its coarse problem are."""
    return json.loads(mpirun(ranks, SCRIPT, make, variant, json.dumps(options)).stdout)


def apart(a, b):
    """Return the largest difference, relative."""
    return max(abs(x - y) for x, y in zip(a, b, strict=True)) / max(map(abs, b))


@pytest.mark.parametrize("ranks", [2, 4])
@pytest.mark.parametrize("variant", ["primal", "corner"])
def test_a_factorisation_has_half_the_matrix(mpirun, ranks, variant):
    """Cholesky by MUMPS gets the upper triangle, which is the matrix that others get, and finds the same."""
    half = run(mpirun, ranks, "irregular", variant, coarse_pc_type="cholesky")
    whole = run(mpirun, ranks, "irregular", variant, coarse_pc_type="lu", coarse_pc_factor_mat_solver_type="mumps")
    assert (half["type"], whole["type"]) == ("mpisbaij", "mpiaij")
    assert half["product"] == pytest.approx(whole["product"], rel=1e-12)
    assert half["iterations"] == whole["iterations"]
    assert apart(half["u"], whole["u"]) < 1e-10


@pytest.mark.parametrize("ranks", [2, 4])
def test_a_mechanism_is_found_with_half_a_matrix(mpirun, ranks):
    """A structure that nothing supports: the error names it, on all ranks."""
    script = """
import sys
sys.path.insert(0, "TESTS")
import pytest
from support import irregular, latin
import latinpc

scene = irregular()
held = scene.fixed.all(axis=1)
scene.fixed[:] = False
scene.fixed[held.argmax()] = True
structure = latinpc.Structure.from_scene(scene)
with latin(scene, structure, variant="primal", coarse_pc_type="cholesky", newton="never") as run:
    with pytest.raises(Exception, match="mechanism.*Nodes that move"):
        run.snes.setUp()
""".replace("TESTS", str(ROOT / "tests"))
    mpirun(ranks, script)


@pytest.mark.parametrize("ranks", [2, 4])
@pytest.mark.parametrize("make", ["irregular", "network"])
def test_stages_correct_an_iteration_that_ends_early(mpirun, ranks, make):
    """An iteration in the coarse problem takes few steps a stage, and few stages more; a tolerance given counts."""
    exact = run(mpirun, ranks, make, "primal")
    early = run(mpirun, ranks, make, "primal", coarse_pc_type="latin")
    tight = run(mpirun, ranks, make, "primal", coarse_pc_type="latin", coarse_ksp_rtol=1e-12)
    assert min(exact["reason"], early["reason"], tight["reason"]) > 0
    assert early["inner"] <= tight["inner"] / 2
    assert early["iterations"] <= 1.3 * exact["iterations"] + 2
    assert apart(early["u"], exact["u"]) < 1e-7
    assert apart(tight["u"], exact["u"]) < 1e-7


COUNTED = """
import json, sys, petsc4py
petsc4py.init([sys.argv[0], "-skip_petscrc"])
sys.path.insert(0, "TESTS")
import numpy as np
from petsc4py import PETSc
from support import latin
import latinpc

options = json.loads(sys.argv[1])
structure = latinpc.local_scene("tensegrity-grid", modules=24, partition="metis")
with latin(None, structure, **options) as run:
    run.snes.setUp()
    steps = [0]
    coarse = latinpc.coarse_ksp(run.snes)
    coarse.setMonitor(lambda ksp, it, norm: steps.__setitem__(0, steps[0] + bool(it)))
    u = structure.create_vec()
    run.snes.solve(None, u)
    found = {"reason": int(run.snes.getConvergedReason()), "iterations": run.snes.getIterationNumber()}
    found |= {"norm": u.norm(), "steps": steps[0]}
    x, y = coarse.getOperators()[0].createVecs()
    if coarse.getPC().getType() == "latin":
        m = []
        for j in range(x.getSize()):
            x.set(0.0)
            x.setValue(j, 1.0)
            x.assemble()
            coarse.getPC().apply(x, y)
            scatter, whole = PETSc.Scatter.toAll(y)
            scatter.scatter(y, whole, mode=PETSc.ScatterMode.FORWARD)
            m.append(whole.getArray().copy())
        m = np.array(m)
        found["asymmetry"] = float(abs(m - m.T).max() / abs(m).max())
        found["least"] = float(np.linalg.eigvalsh(m + m.T).min() / abs(m).max())
PETSc.Sys.Print(json.dumps(found))
""".replace("TESTS", str(ROOT / "tests"))


@pytest.mark.parametrize("ranks", [2, 4])
def test_newton_corrects_an_iteration_that_ends_early(mpirun, ranks):
    """Conjugate gradients of Newton's method take as many iterations, and find the same.

    Ranks share all unknowns of the coarse iteration: one linear stage preconditions it, symmetric positive definite.
    """
    exact, early, tight = (
        json.loads(mpirun(ranks, COUNTED, json.dumps(options)).stdout)
        for options in ({}, {"coarse_pc_type": "latin"}, {"coarse_pc_type": "latin", "coarse_ksp_rtol": 1e-10})
    )
    assert min(exact["reason"], early["reason"], tight["reason"]) > 0
    assert early["steps"] <= tight["steps"] / 2
    assert early["iterations"] <= exact["iterations"] + 2
    assert early["norm"] == pytest.approx(exact["norm"], rel=1e-5)
    assert early["asymmetry"] < 1e-8
    assert early["least"] > 0.0


UNEVEN = """
import sys, petsc4py
petsc4py.init([sys.argv[0], "-skip_petscrc", "-snes_latin_variant", "primal", "-snes_latin_subdomains", sys.argv[1]])
from petsc4py import PETSc
import latinpc

structure = latinpc.local_scene("tensegrity-grid", modules=100, partition="metis")
snes, u = structure.create_snes(), structure.create_vec()
snes.setFromOptions()
snes.solve(None, u)
assert snes.getConvergedReason() > 0
tree = latinpc.coarse_ksp(snes).getPC().getFactorSolverType()
PETSc.Sys.Print(u.norm(), tree)
"""


def test_ranks_with_one_subdomain_beside_ranks_with_several(mpirun):
    """The parts of the coarse matrix are dense on all ranks or on none: the same displacements either way."""
    even, uneven = (mpirun(4, UNEVEN, n).stdout.split() for n in ("8", "6"))
    assert even[1] == uneven[1] == "latintree"
    assert float(uneven[0]) == pytest.approx(float(even[0]), rel=1e-5)


def test_a_coarse_iteration_that_fails_is_named(mpirun):
    """Too few steps end the solve on all ranks, and the message says which solver has failed."""
    script = """
import sys, petsc4py
petsc4py.init([sys.argv[0], "-skip_petscrc", "-snes_latin_variant", "primal", "-snes_latin_coarse_pc_type", "jacobi"])
from petsc4py import PETSc
import latinpc
from latinpc.results.report import snes_reason

PETSc.Options()["snes_latin_coarse_ksp_max_it"] = 3
structure = latinpc.local_scene("tensegrity-grid", modules=24, partition="metis")
snes, u = structure.create_snes(), structure.create_vec()
snes.setFromOptions()
snes.solve(None, u)
PETSc.Sys.Print(snes_reason(snes))
"""
    words = "the coarse problem after 3 iterations, -snes_latin_coarse_: DIVERGED_MAX_IT"
    assert mpirun(2, script).stdout.strip() == f"DIVERGED_LINEAR_SOLVE ({words})"


MONITORED = """
import sys
import petsc4py
petsc4py.init([sys.argv[0], "-skip_petscrc"])
from petsc4py import PETSc
import latinpc
from latinpc.scenes import make

structure = latinpc.Structure.from_scene(make("tensegrity-grid", modules=60, partition="metis"))
snes, u = structure.create_snes(), structure.create_vec()
snes.setFromOptions()
snes.setUp()
ksp, left = latinpc.coarse_ksp(snes), []
ksp.setMonitor(lambda ksp, iteration, norm: left.append(norm))
snes.solve(None, u)
PETSc.Sys.Print(int(snes.getConvergedReason()), left[1] / left[0])
"""


def test_a_monitor_sees_residuals(mpirun):
    """Beside factors in single precision the matrix of two ranks is still there: it is small."""
    reason, left = mpirun(2, MONITORED).stdout.split()
    assert int(reason) > 0
    assert float(left) < 1e-6
