"""Two halves of the ranks, each with a communicator of its own, solve different structures different numbers of times.

``mpirun -n 4 halves_program.py``; returns what rank 0 has gathered: for each rank its half and what it has found.
"""

import sys

import petsc4py

if __name__ == "__main__":
    petsc4py.init([sys.argv[0], "-skip_petscrc"])

from mpi4py import MPI
from petsc4py import PETSc

import latinpc
from latinpc.scenes import make


def scene(half):
    """What a half solves."""
    return make("network", nodes=60 + 50 * half, seed=half)


def linear(structure, kind):
    """Iterations of CG with PC latin, or of KSP latin, on the tangent stiffness as drawn."""
    matrix, u = structure.dm.createMat(), structure.create_vec()
    structure.jacobian(u, matrix)
    ksp = PETSc.KSP().create(structure.comm)
    ksp.setOperators(matrix)
    structure.attach(ksp)
    ksp.setType(kind)
    if kind == "cg":
        ksp.getPC().setType("latin")
    b = u.duplicate()
    b.set(1.0)
    ksp.solve(b, u)
    return ksp.getConvergedReason()


def job():
    """Solve on either half, of ranks in reverse; one has an error, and goes on."""
    world = MPI.COMM_WORLD
    half = int(2 * world.rank >= world.size)
    comm = world.Split(half, -world.rank)
    structure = latinpc.Structure.from_scene(scene(half), comm)
    largest = [float(abs(structure.solve().displacements).max()) for _ in range(1 + 2 * half)]
    told = ""
    if half:
        try:
            latinpc.Structure([[0, 0], [1, 0]], [[0, 1]], "bar", 1.0, comm=comm).solve()
        except latinpc.SolveError as error:
            told = str(error)
        largest.append(float(abs(structure.solve().displacements).max()))
    reasons = [linear(structure, kind) for kind in ("cg", "latin")]
    return {"ranks": world.gather((half, comm.size, largest, told, reasons))}


if __name__ == "__main__":
    job()
