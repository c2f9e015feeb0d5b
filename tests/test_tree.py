"""Coarse matrices of several ranks by fronts that ranks join in pairs: the factorisation, and when it is taken."""

import json
import re
from pathlib import Path

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

def parts(n, reach, seed):
    "Rows of each rank: its own, and any of `reach` other ranks; in any order"
    rng = np.random.default_rng(seed)
    start = np.linspace(0, n, comm.size + 1).astype(int)
    rows = []
    for r in range(comm.size):
        own = np.arange(start[r], start[r + 1])
        others = np.setdiff1d(np.arange(n), own)
        taken = rng.choice(others, min(reach, len(others)), replace=False)
        rows.append(rng.permutation(np.concatenate([own, taken])))
    return start, rows

found = []
for n, reach, kind in ((40, 0, "aij"), (40, 9, "aij"), (40, 40, "dense"), (500, 120, "aij"), (500, 120, "dense"),
                       (40, 9, "indefinite"), (40, 0, "indefinite"), (500, 120, "indefinite")):
    start, rows = parts(n, reach, n + reach)
    whole, local = np.zeros((n, n)), []
    for r, row in enumerate(rows):
        rng = np.random.default_rng(r)
        k = rng.standard_normal((len(row), len(row)))
        k = k @ k.T + np.eye(len(row))
        if kind == "indefinite" and r == comm.size - 1:
            k[0, 0] = -1e6
        whole[np.ix_(row, row)] += k
        local.append(k)
    own = int(start[comm.rank + 1] - start[comm.rank])
    row, k = rows[comm.rank].astype(PETSc.IntType), local[comm.rank]
    lg = PETSc.LGMap().create(row)
    A = PETSc.Mat().createIS(((own, n), (own, n)), lgmapr=lg, lgmapc=lg)
    K = PETSc.Mat().createDense(k.shape, array=k.copy(order="F"), comm=PETSc.COMM_SELF)
    K.assemble()
    if kind != "dense":
        K.convert("seqaij")
    A.setISLocalMat(K)
    A.assemble()
    ksp = PETSc.KSP().create()
    ksp.setType("preonly")
    ksp.getPC().setType("cholesky")
    ksp.getPC().setFactorSolverType("latintree")
    x, b = A.createVecs()
    runs = []
    for scale in (1.0, 3.0):  # the second time without a symbolic phase
        A.scale(scale)
        whole *= scale
        ksp.setOperators(A)
        b.setArray(np.random.default_rng(7).standard_normal(n)[start[comm.rank]:start[comm.rank + 1]])
        ksp.solve(b, x)
        u, load = (np.concatenate(comm.allgather(v.array)) for v in (x, b))
        reason = ksp.getConvergedReason()  # without a factor there is no number in u
        runs.append([reason, float(abs(whole @ u - load).max() / abs(load).max()) if reason > 0 else None])
    found.append([kind, runs])
found = comm.gather(found)
if not comm.rank:
    json.dump(found, open(sys.argv[1], "w"))
"""


@pytest.mark.parametrize("ranks", [1, 2, 4, 5])
def test_solutions_are_those_of_dense_algebra(mpirun, tmp_path, ranks):
    """Parts with and without rows of their own, in any order, twice; an indefinite one is refused by all ranks."""
    mpirun(ranks, FACTOR, tmp_path / "found.json")
    found = json.loads((tmp_path / "found.json").read_text())
    assert all(one == found[0] for one in found)
    for kind, runs in found[0]:
        for reason, error in runs:
            assert (reason == -11) == (kind == "indefinite")  # KSP_DIVERGED_PC_FAILED
            assert kind == "indefinite" or error < 1e-8


MISUSE = """
import sys
import petsc4py
petsc4py.init(["p", "-skip_petscrc"])
from petsc4py import PETSc
import latinpc
comm = PETSc.COMM_WORLD
rows = [0]
lg = PETSc.LGMap().create(rows)
A = PETSc.Mat().createIS(((1, comm.size), (1, comm.size)), lgmapr=lg, lgmapc=lg)
K = PETSc.Mat().createAIJ((len(rows), len(rows)), nnz=1, comm=PETSc.COMM_SELF)
for i in range(len(rows)):
    K.setValue(i, i, 1.0)
K.assemble()
A.setISLocalMat(K)
A.assemble()
pc = PETSc.PC().create()
pc.setType("cholesky")
pc.setFactorSolverType("latintree")
pc.setOperators(A)
pc.setUp()
"""


def test_a_matrix_that_it_cannot_factor_is_an_error(mpirun):
    """A row that its owner's local matrix lacks: an error on all ranks."""
    result = mpirun(2, MISUSE, check=False)
    assert result.returncode
    assert "owns rows that its local matrix does not have" in result.stderr and "use another solver" in result.stderr


COARSE = """
import json, sys
sys.path.insert(0, sys.argv[2])
import petsc4py
petsc4py.init(["p", "-skip_petscrc", "-snes_type", "latin", "-snes_stol", "0", "-snes_max_it", "6",
               "-snes_latin_newton", "never", "-snes_latin_variant", "primal", *sys.argv[5:]])
from petsc4py import PETSc
import latinpc
from support import irregular
structure = latinpc.Structure.from_scene(irregular(modules=int(sys.argv[4]), parts=int(sys.argv[3])))
snes = structure.create_snes()
snes.setFromOptions()
u = structure.create_vec()
snes.solve(None, u)
A, pc = latinpc.coarse_ksp(snes).getOperators()[0], latinpc.coarse_ksp(snes).getPC()
info = pc.getFactorMatrix().getInfo() if pc.getType() == "cholesky" else {"memory": 0.0, "nz_used": 0.0}
found = {"type": A.getType(), "solver": pc.getType() == "cholesky" and pc.getFactorSolverType(), "rows": A.getSize()[0],
         "bytes": info["memory"] / max(1, info["nz_used"]),
         "spent": A.getType() == "is" and A.getISLocalMat().getType() == "shell",
         "u": structure.displacements(u).ravel().tolist()}
try:
    A.mult(*A.createVecs())
except PETSc.Error as error:
    found["product"] = latinpc.error_message(error)
if not structure.comm.rank:
    json.dump(found, open(sys.argv[1], "w"))
"""


@pytest.mark.parametrize(("ranks", "parts"), [(2, 16), (4, 16)])
def test_it_is_the_default_of_large_coarse_problems(mpirun, tmp_path, ranks, parts):
    """Taken where there are too many unknowns for every rank; an option chooses another one: the same iterates."""

    def found(name, *options):
        mpirun(ranks, COARSE, tmp_path / name, Path(__file__).parent, parts, 40, *options)
        return json.loads((tmp_path / name).read_text())

    tree = found("tree.json", "-snes_view", f":{tmp_path / 'view'}")
    single = found("single.json", "-snes_latin_precision", "single")
    other = found("other.json", "-snes_latin_coarse_pc_factor_mat_solver_type", "mumps")
    assert tree["rows"] > 1500
    assert (tree["type"], tree["solver"]) == ("is", "latintree")
    assert (other["type"], other["solver"]) == ("mpisbaij", "mumps")
    view = (tmp_path / "view").read_text()
    assert "fronts of the ranks" in view and "by a factorisation that all ranks share" in view
    assert int(re.search(r"at most (\d+)\.? messages of a rank", view)[1]) <= 4  # those of its part and of one joint
    assert tree["spent"] and not other["spent"]
    assert "choose -snes_latin_coarse_pc_factor_mat_solver_type mumps" in tree["product"] and "product" not in other
    assert tree["bytes"] == 8  # an entry
    assert single["bytes"] < 8  # fronts are rounded as subdomains are, what comes before them is not
    one = solve(irregular(modules=40, parts=parts), variant="primal", stol=0.0, max_it=6, newton="never").u
    for each in (tree, other):
        assert far(np.array(each["u"]).reshape(one.shape), one) < 1e-9
    assert far(np.array(single["u"]).reshape(one.shape), one) < 1e-6


@pytest.mark.parametrize(("ranks", "parts"), [(2, 2), (2, 4), (4, 4)])
def test_full_matrices_of_any_size_are_factored_once(mpirun, tmp_path, ranks, parts):
    """Few subdomains have as many entries as the whole matrix: no rank factors it alone; the iterates of one rank."""
    mpirun(ranks, COARSE, tmp_path / "full.json", Path(__file__).parent, parts, 12)
    full = json.loads((tmp_path / "full.json").read_text())
    assert full["rows"] < 1500
    assert (full["type"], full["solver"]) == ("is", "latintree")
    one = solve(irregular(modules=12, parts=parts), variant="primal", stol=0.0, max_it=6, newton="never").u
    assert far(np.array(full["u"]).reshape(one.shape), one) < 1e-9


def test_small_sparse_matrices_are_joined_as_well(mpirun, tmp_path):
    """Many subdomains, each of which touches a small part of the unknowns."""
    mpirun(2, COARSE, tmp_path / "many.json", Path(__file__).parent, 30, 12)
    assert json.loads((tmp_path / "many.json").read_text())["type"] == "is"


APART = """
import json, sys
import petsc4py
petsc4py.init(["p", "-skip_petscrc", "-snes_type", "latin", "-snes_stol", "0", "-snes_max_it", "3",
               "-snes_latin_newton", "never"])
import numpy as np
from petsc4py import PETSc
import latinpc
from latinpc.scenes import make
scene = make("network", nodes=3000, subdomains=1)
middle = scene.nodes[scene.links].mean(axis=1)
place = (middle - middle.min(axis=0)) / np.ptp(middle, axis=0)
scene.subdomain = np.ravel_multi_index(np.minimum(4 * place, 3).astype(int).T, (4, 4, 4))
if sys.argv[2] == "apart":
    scene.subdomain = np.random.default_rng(0).permutation(64)[scene.subdomain]
structure = latinpc.Structure.from_scene(scene)
snes, u = structure.create_snes(), structure.create_vec()
snes.setFromOptions()
snes.solve(None, u)
found = {"solver": latinpc.coarse_ksp(snes).getPC().getFactorSolverType(),
         "u": structure.displacements(u).ravel().tolist()}
if not structure.comm.rank:
    json.dump(found, open(sys.argv[1], "w"))
"""


def test_ranks_whose_subdomains_lie_apart_share_the_factorisation(mpirun, tmp_path):
    """Cubes numbered at random leave a rank no unknowns of its own: its fronts take ten times the operations."""
    found = {}
    for how in ("together", "apart"):
        mpirun(4, APART, tmp_path / how, how)
        found[how] = json.loads((tmp_path / how).read_text())
    assert {how: one["solver"] for how, one in found.items()} == {"together": "latintree", "apart": "mumps"}
    assert far(np.array(found["apart"]["u"])[None], np.array(found["together"]["u"])[None]) < 1e-6
