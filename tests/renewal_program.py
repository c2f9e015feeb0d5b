"""A second PCSetUp() of PC latin: new values of the same pattern, or another pattern, beside a fresh preconditioner.

``mpirun -n 4 renewal_program.py matis``, ``links``; ``--patterns``: the second matrix has another pattern. PETSc's
options are those after the first of one dash. Prints one line of JSON: how far apart the preconditioners are, and
how often each event of a set-up has happened.
"""

import argparse
import json
import sys

import petsc4py

if __name__ == "__main__":  # ours first, then PETSc's
    ours = next((i for i, word in enumerate(sys.argv) if word[:1] == "-" != word[1:2]), len(sys.argv))
    petsc4py.init([sys.argv[0], "-skip_petscrc", *sys.argv[ours:]])

import numpy as np
from matis_program import Grid, matis
from mpi4py import MPI
from petsc4py import PETSc

import latinpc
from latinpc.scenes import make

EVENTS = (
    "MatCholFctrSym", "MatLUFactorSym", "MatCholFctrNum", "LatinPartition", "LatinInterface", "LatinDirection",
    "LatinSubdomains", "LatinSpectral",
)  # fmt: skip


def counts():
    """How often each event of a set-up has happened, on this rank."""
    return np.array([PETSc.Log.Event(name).getPerfInfo()["count"] for name in EVENTS])


def grid_of(args, comm):
    """Elasticity, with the values of a random number a cell and another one."""
    how = argparse.Namespace(
        dim=args.dim, cells=args.cells, blocks=args.blocks, problem="elasticity", owned=False, jump="random",
        contrast=args.contrast, dirichlet="zeroed", scalar_map=False, local_type="aij", asymmetric=False,
        repeated=getattr(args, "repeated", False),
    )  # fmt: skip
    problem = Grid(how)
    a, x, _ = matis(problem, how, comm)
    problem.scale = problem.scale * (1.0 + np.random.default_rng(7).random(len(problem.scale)))
    b, _, _ = matis(problem, how, comm)
    if args.patterns:  # a spring of its own in place of one between two unknowns, in the second matrix alone
        k = b.getISLocalMat()
        r = int(np.argmax(np.diff(k.getRowIJ()[0])))
        columns, values = k.getRow(r)
        c = int(columns[np.argmax(np.where(columns == r, 0.0, abs(values)))])
        pull = k.getValue(r, c)
        for i, j, v in ((r, r, abs(pull)), (c, c, abs(pull)), (r, c, -pull), (c, r, -pull)):
            k.setValue(i, j, v, PETSc.InsertMode.ADD_VALUES)
        k.assemble()
    return a, b, lambda pc: pc.setCoordinates(x[:: problem.bs])


def take_grid(a, b):
    """Write the values of one MATIS into another."""
    k = a.getISLocalMat()
    k.setValuesCSR(*b.getISLocalMat().getValuesCSR())
    k.assemble()
    a.assemble()


def links_of(args, comm):
    """Tangents of a structure with other stiffnesses of all links; slack links change the pattern."""
    scene = make("tensegrity-grid", modules=args.cells, partition="metis")
    structure = latinpc.Structure.from_scene(scene, comm=comm)
    u, matrices = structure.create_vec(), []
    for seed in range(2):
        j = structure.dm.createMat()
        structure.jacobian(u, j)
        tangent = j.query("LatinTangent")
        k = tangent.getArray()
        first = tangent.getOwnershipRange()[0]
        k *= 1.0 + (np.sin(1.0 + first + np.arange(len(k)) + seed)) ** 2
        if seed and args.patterns and comm.getRank() == comm.getSize() - 1:
            k[len(k) // 2] = 0.0
        j.stateIncrease()
        matrices.append(j)
    return (*matrices, structure.attach)


def take_links(a, b):
    """The same for the tangents of a structure."""
    b.query("LatinTangent").copy(a.query("LatinTangent"))
    a.stateIncrease()


def preconditioner(a, tell):
    """PC latin on a matrix."""
    pc = PETSc.PC().create(a.getComm())
    pc.setOperators(a)
    pc.setType("latin")
    tell(pc)
    pc.setFromOptions()
    return pc


def set_up(pc):
    """Set a preconditioner up; return the counts of the events and the seconds, the largest of a rank."""
    before, start = counts(), PETSc.Log.Event("PCSetUp").getPerfInfo()["time"]
    pc.setUp()
    most = np.append(counts() - before, PETSc.Log.Event("PCSetUp").getPerfInfo()["time"] - start)
    pc.getComm().tompi4py().Allreduce(MPI.IN_PLACE, most, MPI.MAX)
    return {**dict(zip(EVENTS, most.astype(int).tolist(), strict=False)), "seconds": most[-1]}


def main():
    """Set up, change the matrix, set up again; compare with a preconditioner that has seen the second matrix alone."""
    parser = argparse.ArgumentParser()
    parser.add_argument("problem", choices=("matis", "links"))
    parser.add_argument("--cells", type=int, default=6)
    parser.add_argument("--dim", type=int, default=2)
    parser.add_argument("--blocks", default="1,1")
    parser.add_argument("--contrast", type=float, default=10.0)
    parser.add_argument("--patterns", action="store_true")
    parser.add_argument("--repeated", action="store_true", help="a rank has several blocks, each with rows of its own")
    parser.add_argument("--twice", action="store_true", help="nothing but the two set-ups")
    args, _ = parser.parse_known_args()
    PETSc.Log.begin()
    comm = PETSc.COMM_WORLD
    a, b, tell = (grid_of if args.problem == "matis" else links_of)(args, comm)
    take = take_grid if args.problem == "matis" else take_links
    pc = preconditioner(a, tell)
    result = {"first": set_up(pc)}
    first = latinpc.statistics(pc)["subdomains"]
    take(a, b)
    result["second"] = set_up(pc)
    if not args.twice:
        fresh = preconditioner(b, tell)
        result["fresh"] = set_up(fresh)
        x, y = a.createVecs()
        z = y.duplicate()
        start, end = x.getOwnershipRange()
        x.setArray(np.sin(1.0 + 7.3 * np.arange(start, end)))
        pc.apply(x, y)
        fresh.apply(x, z)
        size = z.norm()
        z.axpy(-1.0, y)
        result["apart"] = z.norm() / size
    result["subdomains"] = first
    PETSc.Sys.Print(json.dumps(result))


if __name__ == "__main__":
    main()
