"""Dense coarse matrices of several ranks: what they hold, their factorisation `latindense`, and when they are taken."""

import json
import sys

import numpy as np
import pytest
from support import far, irregular, solve

FACTOR = """
import json, sys
import petsc4py
petsc4py.init(["p", "-skip_petscrc"])
import numpy as np
from petsc4py import PETSc
import latinpc  # registers the solver
comm = PETSc.COMM_WORLD.tompi4py()
found = []
for n, rank in ((1, 0), (3, None), (130, None), (517, 1), (700, None)):
    mine = PETSc.DECIDE if rank is None else n * (comm.rank == rank)
    rng = np.random.default_rng(n)
    dense = rng.standard_normal((n, n))
    dense = dense @ dense.T + np.eye(n)
    if n == 3:
        dense[2, 2] = -1.0
    A = PETSc.Mat().createDense(((mine, n),) * 2)
    A.setUp()
    start, end = A.getOwnershipRange()
    A.setValues(range(start, end), range(n), dense[start:end])
    A.assemble()
    ksp = PETSc.KSP().create()
    ksp.setType("preonly")
    ksp.getPC().setType("cholesky")
    ksp.getPC().setFactorSolverType("latindense")
    x, b = A.createVecs()
    errors = []
    for scale in (1.0, 3.0):  # the second time without a symbolic phase
        A.scale(scale)
        dense *= scale
        ksp.setOperators(A)
        b.setArray(rng.standard_normal(n)[start:end])
        ksp.solve(b, x)
        whole, load = (np.concatenate(comm.allgather(v.array)) for v in (x, b))
        with np.errstate(invalid="ignore"):  # BLAS may set the flag; no number among the errors would be found below
            errors.append([ksp.getConvergedReason(), float(abs(dense @ whole - load).max() / abs(load).max())])
    found.append(errors)
found = comm.gather(found)
if not comm.rank:
    json.dump(found, open(sys.argv[1], "w"))
"""


@pytest.mark.parametrize("ranks", [2, 4])
def test_solutions_are_those_of_dense_algebra(mpirun, tmp_path, ranks):
    """Rows shared out in any way, twice; one that is not positive definite is refused, by all ranks."""
    mpirun(ranks, FACTOR, tmp_path / "found.json")
    found = json.loads((tmp_path / "found.json").read_text())
    assert all(one == found[0] for one in found)
    for number, runs in enumerate(found[0]):
        for reason, error in runs:
            assert (reason == -11) == (number == 1)  # KSP_DIVERGED_PC_FAILED
            assert number == 1 or error < 1e-9


COARSE = """
import json, sys
sys.path.insert(0, sys.argv[2])
import petsc4py
petsc4py.init(["p", "-skip_petscrc", "-snes_type", "latin", "-snes_stol", "0", "-snes_max_it", "5", *sys.argv[4:]])
import numpy as np
from petsc4py import PETSc
import latinpc
from support import irregular
scene = irregular(modules=12, parts=int(sys.argv[3]))
structure = latinpc.Structure.from_scene(scene)
snes = structure.create_snes()
snes.setFromOptions()
u = structure.create_vec()
snes.solve(None, u)
ksp = latinpc.coarse_ksp(snes)
A = ksp.getOperators()[0]
b, r = A.createVecs()
start, end = b.getOwnershipRange()
b.setArray(np.sin(1.0 + np.arange(start, end)))
A.mult(b, r)
pc = ksp.getPC()
found = {"type": A.getType(), "norm": r.norm(), "solver": pc.getType() == "cholesky" and pc.getFactorSolverType(),
         "u": structure.displacements(u).ravel().tolist()}
if not structure.comm.rank:
    json.dump(found, open(sys.argv[1], "w"))
"""


@pytest.mark.parametrize(("ranks", "parts"), [(2, 2), (2, 4), (4, 4)])
def test_the_matrix_is_that_of_a_sparse_solver(mpirun, tmp_path, ranks, parts):
    """Full matrices are dense by default; an option chooses another solver of the same matrix: the same iterates."""

    def found(name, *options):
        mpirun(ranks, COARSE, tmp_path / name, sys.path[0], parts, "-snes_latin_variant", "primal", *options)
        return json.loads((tmp_path / name).read_text())

    dense = found("dense.json")
    sparse = found("sparse.json", "-snes_latin_coarse_pc_factor_mat_solver_type", "mumps")
    assert (dense["type"], dense["solver"]) == ("mpidense", "latindense")
    assert (sparse["type"], sparse["solver"]) == ("mpisbaij", "mumps")
    assert dense["norm"] == pytest.approx(sparse["norm"], rel=1e-10)
    one = solve(irregular(modules=12, parts=parts), variant="primal", stol=0.0, max_it=5).u
    assert far(np.array(dense["u"]).reshape(one.shape), one) < 1e-9
    assert far(np.array(sparse["u"]).reshape(one.shape), one) < 1e-9


def test_a_matrix_that_is_not_full_is_sparse(mpirun, tmp_path):
    """Many subdomains, each of which touches a small part of the unknowns."""
    mpirun(2, COARSE, tmp_path / "many.json", sys.path[0], 40, "-snes_latin_variant", "primal")
    assert json.loads((tmp_path / "many.json").read_text())["type"] == "mpiaij"
