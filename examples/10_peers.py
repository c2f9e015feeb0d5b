"""Peers side by side: latin, BDDC, FETI-DP, GAMG, hypre and MUMPS on one matrix, plane elasticity in a MATIS.

    mpirun -n 4 python examples/10_peers.py
    mpirun -n 2 python examples/10_peers.py -cells 16 -contrast 1e3

A square of `-cells` x `-cells` bilinear elements is held on its left side and pulled down. Every rank assembles the
cells of its own block, which is its subdomain; `-contrast` makes some of the cells stiffer. Each method solves for the
same right-hand side to a relative residual of 1e-8, with the coordinates or the rigid motions where it takes them;
those that work on an assembled matrix get it. Times in seconds, the slowest rank; memory is what the resident set of
all ranks grew by.
"""

import resource
import sys
import time

import numpy as np
import petsc4py

petsc4py.init(sys.argv)

from petsc4py import PETSc

import latinpc

# averages over edges must be unknowns of their own: one corner does not hold a subdomain, and BDDC breaks down
BDDC = {"pc_bddc_use_change_of_basis": True}
FETIDP = {f"fetidp_bddc_{key}": value for key, value in BDDC.items()}
METHODS = {  # (options, works on the MATIS itself)
    "CG, PC latin": ({"ksp_type": "cg", "pc_type": "latin"}, True),
    "KSP latin": ({"ksp_type": "latin"}, True),
    "CG, BDDC": ({"ksp_type": "cg", "pc_type": "bddc", **BDDC}, True),
    "FETI-DP": ({"ksp_type": "fetidp", "fetidp_ksp_type": "cg", **FETIDP}, True),
    "CG, GAMG": ({"ksp_type": "cg", "pc_type": "gamg"}, False),
    "CG, hypre": ({"ksp_type": "cg", "pc_type": "hypre", "pc_hypre_boomeramg_numfunctions": 2}, False),
    "MUMPS": ({"ksp_type": "preonly", "pc_type": "cholesky", "pc_factor_mat_solver_type": "mumps"}, False),
}  # fmt: skip
PACKAGES = {"CG, hypre": "hypre", "MUMPS": "mumps"}


def element(nu=0.3):
    """Stiffness of a square bilinear element in plane strain, unit modulus; unknowns node by node."""
    corners = np.array([(0, 0), (1, 0), (0, 1), (1, 1)])
    elastic = np.array([[1 - nu, nu, 0], [nu, 1 - nu, 0], [0, 0, 0.5 - nu]]) / (1 + nu) / (1 - 2 * nu)
    stiffness = np.zeros((8, 8))
    for point in 0.5 + np.array([(-1, -1), (1, -1), (-1, 1), (1, 1)]) / np.sqrt(12):
        along = np.where(corners, point, 1 - point)
        slope = np.where(corners, 1.0, -1.0) * along[:, ::-1]
        strain = np.zeros((3, 8))
        strain[0, ::2] = strain[2, 1::2] = slope[:, 0]
        strain[1, 1::2] = strain[2, ::2] = slope[:, 1]
        stiffness += strain.T @ elastic @ strain / 4
    return stiffness


def elasticity(cells, contrast=1.0, comm=PETSc.COMM_WORLD):
    """Return the matrix, the load and the coordinates of this rank's nodes; the rigid motions are near its kernel."""
    rows = next(n for n in range(int(comm.size**0.5), 0, -1) if comm.size % n == 0)
    columns = comm.size // rows
    at = np.stack(np.meshgrid(np.arange(cells), np.arange(cells), indexing="ij"), -1).reshape(-1, 2)
    mine = at[at[:, 0] * columns // cells * rows + at[:, 1] * rows // cells == comm.rank]
    # nodes by columns; those of the first one are held, and no unknowns
    corners = mine[:, None] + np.array([(0, 0), (1, 0), (0, 1), (1, 1)])
    node = (corners[..., 0] - 1) * (cells + 1) + corners[..., 1]
    here = np.unique(node[corners[..., 0] > 0])
    local = np.where(corners[..., 0] > 0, np.searchsorted(here, node), -1).astype(PETSc.IntType)
    size = 2 * cells * (cells + 1)
    a = PETSc.Mat().create(comm)
    a.setSizes(((None, size), (None, size)), bsize=2)
    a.setType("is")
    a.setLGMap(PETSc.LGMap().create(here.astype(PETSc.IntType), bsize=2, comm=comm))
    a.setPreallocationNNZ((18, 18))
    stiff = np.where((mine // 3).sum(axis=1) % 2, contrast, 1.0)
    for place, k in zip(local, stiff):
        a.setValuesBlockedLocal(place, place, k * STIFFNESS, addv=True)
    a.assemble()
    a.setOption(PETSc.Mat.Option.SPD, True)
    b = a.createVecRight()
    b.setBlockSize(2)
    first, last = (n // 2 for n in b.getOwnershipRange())
    x = np.column_stack([np.arange(first, last) // (cells + 1) + 1.0, np.arange(first, last) % (cells + 1)])
    b.setArray(np.tile([0.0, -1.0], last - first))
    place = b.duplicate()
    place.setBlockSize(2)
    place.setArray(x.ravel())
    a.setNearNullSpace(PETSc.NullSpace().createRigidBody(place))
    return a, b, x


STIFFNESS = element()


def resident():
    """Return the bytes that this process holds."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize()


def solve(name, a, b, x):
    """Return iterations, seconds of set-up and solve, memory, solution; or the reason why there is none."""
    options, database, comm = METHODS[name][0], PETSc.Options(), a.getComm().tompi4py()
    if name in PACKAGES and not PETSc.Sys.hasExternalPackage(PACKAGES[name]):
        return f"needs {PACKAGES[name]}"
    for key, value in options.items():
        database.setValue(key, value)
    ksp, u, before, start = PETSc.KSP().create(a.getComm()), b.duplicate(), resident(), time.perf_counter()
    try:
        ksp.setOperators(a)
        ksp.setTolerances(rtol=1e-8, max_it=500)
        ksp.setFromOptions()
        if "latin" in name:
            ksp.getPC().setCoordinates(x)
        ksp.setUp()
        comm.barrier()
        middle = time.perf_counter()
        ksp.solve(b, u)
        comm.barrier()
        end = time.perf_counter()
    except PETSc.Error as error:
        return latinpc.error_message(error)
    finally:
        for key in options:
            database.delValue(key)
    if ksp.getConvergedReason() <= 0:
        return f"did not converge (reason {ksp.getConvergedReason()})"
    return ksp.getIterationNumber(), middle - start, end - middle, comm.allreduce(resident() - before), u


def main():
    options = PETSc.Options()
    cells, contrast = options.getInt("cells", 48), options.getReal("contrast", 1.0)
    a, b, x = elasticity(cells, contrast)
    assembled = a.convert("aij", PETSc.Mat())
    assembled.setNearNullSpace(a.getNearNullSpace())
    assembled.setOption(PETSc.Mat.Option.SPD, True)
    PETSc.Sys.Print(f"{a.getSize()[0]} unknowns, {a.getComm().size} subdomains, contrast {contrast:g}")
    PETSc.Sys.Print(f"{'':14}{'iterations':>11}{'set-up':>9}{'solve':>9}{'memory':>10}{'residual':>10}")
    found = {}
    for name, (_, on_matis) in METHODS.items():
        found[name] = result = solve(name, a if on_matis else assembled, b, x)
        if isinstance(result, str):
            PETSc.Sys.Print(f"{name:14} {result}")
            continue
        iterations, setup, seconds, memory, u = result
        residual = (b - a * u).norm() / b.norm()
        PETSc.Sys.Print(f"{name:14}{iterations:11}{setup:9.3f}{seconds:9.3f}{memory / 1e6:7.1f} MB{residual:10.1e}")
    for name in ("CG, PC latin", "KSP latin"):
        assert not isinstance(found[name], str) and found[name][0] <= 30, name
    difference = found["KSP latin"][4] - found["CG, PC latin"][4]
    assert difference.norm() < 1e-5 * found["KSP latin"][4].norm()


if __name__ == "__main__":
    main()
