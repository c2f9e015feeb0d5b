"""Elasticity assembled by dolfinx into a MATIS, meshes with a hole cut by SCOTCH: iterations of PC latin.

    mpirun -n 8 python benchmarks/finite_elements.py

needs dolfinx 0.5 (Debian: python3-dolfinx) beside Debian's petsc4py. Conjugate gradients to a relative residual of 1e-8
in the natural norm, with the defaults of PC latin and without local low-energy fields.
"""

import sys

import petsc4py

petsc4py.init(sys.argv)

# ruff: noqa: E402 - PETSc is initialised first
import numpy as np
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI
from petsc4py import PETSc

import latinpc  # noqa: F401 - registers the types

#: Title: lengths, cells along the first of them, degree, Poisson's ratio, ratio of stiffnesses in a chequered pattern
CASES = {
    "cube": ((1, 1, 1), 18, 1, 0.3, 1),
    "cube, degree 2": ((1, 1, 1), 8, 2, 0.3, 1),
    "plate, thickness 1/40": ((1, 1, 1 / 40), 40, 1, 0.3, 1),
    "plate, thickness 1/80": ((1, 1, 1 / 80), 80, 1, 0.3, 1),
    "plane, degree 2, nu 0.499": ((1, 1), 48, 2, 0.499, 1),
    "cube, nu 0.499": ((1, 1, 1), 16, 1, 0.499, 1),
    "cube, degree 2, nu 0.499": ((1, 1, 1), 8, 2, 0.499, 1),
    "cube, stiffnesses 1 and 1e6": ((1, 1, 1), 16, 1, 0.3, 1e6),
    "plane, stiffnesses 1 and 1e6": ((1, 1), 96, 1, 0.3, 1e6),
}
METHODS = {"PC latin": {}, "without local fields": {"pc_latin_modes_local": "0"}}


def holed(comm, lengths, cells):
    """Return a box of simplices with a round hole through it, cut into one part a rank."""
    dim = len(lengths)
    x, connect = np.zeros((0, dim)), np.zeros((0, dim + 1), np.int64)
    if comm.rank == 0:
        shape = [max(1, round(cells * length)) for length in lengths]
        make = mesh.create_box if dim == 3 else mesh.create_rectangle
        box = make(MPI.COMM_SELF, [np.zeros(dim), np.array(lengths, float)], shape)
        x, connect = box.geometry.x[:, :dim], box.geometry.dofmap.array.reshape(-1, dim + 1)
        middle = x[connect].mean(axis=1)
        connect = connect[np.linalg.norm(middle[:, :2] - 0.5, axis=1) > 0.2]
        used, connect = np.unique(connect, return_inverse=True)
        x, connect = x[used].copy(), connect.reshape(-1, dim + 1).astype(np.int64)
    cell = "tetrahedron" if dim == 3 else "triangle"
    domain = ufl.Mesh(ufl.VectorElement("Lagrange", cell, 1))
    return mesh.create_mesh(comm, connect, x, domain, mesh.GhostMode.none)


def assemble(comm, lengths, cells, degree, nu, ratio):
    """Return the MATIS, its load, and the places of the nodes of this rank; the side x = 0 is held."""
    domain = holed(comm, lengths, cells)
    space, dim = fem.VectorFunctionSpace(domain, ("CG", degree)), len(lengths)
    stiffness = fem.Function(fem.FunctionSpace(domain, ("DG", 0)))
    odd = np.floor(4 * stiffness.function_space.tabulate_dof_coordinates()).sum(axis=1) % 2
    stiffness.x.array[:] = np.where(odd, ratio, 1.0)
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    strain = ufl.sym(ufl.grad(u))
    stress = stiffness / (1 + nu) * (strain + nu / (1 - 2 * nu) * ufl.tr(strain) * ufl.Identity(dim))
    form = fem.form(ufl.inner(stress, ufl.sym(ufl.grad(v))) * ufl.dx)
    weight = fem.form(ufl.inner(fem.Constant(domain, PETSc.ScalarType((0,) * (dim - 1) + (-1,))), v) * ufl.dx)
    side = mesh.locate_entities_boundary(domain, dim - 1, lambda x: np.isclose(x[0], 0))
    nodes, bs = space.dofmap.index_map, space.dofmap.index_map_bs
    numbers = np.concatenate([np.arange(*nodes.local_range), nodes.ghosts]).astype(PETSc.IntType)
    lgmap = PETSc.LGMap().create(numbers, bsize=bs, comm=comm)
    a = PETSc.Mat().create(comm)  # dolfinx adds to the local matrices: nothing is sent
    a.setSizes(2 * ((bs * nodes.size_local, bs * nodes.size_global),), bsize=bs)
    a.setType("is")
    a.setLGMap(lgmap, lgmap)
    a.setPreallocationNNZ(min(100 * degree**2, bs * len(numbers)))
    a.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, False)
    fem.petsc.assemble_matrix(a, form)
    a.assemble()
    b = fem.petsc.assemble_vector(weight)
    b.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)
    held = numbers[fem.locate_dofs_topological(space, dim - 1, side)]
    rows = (bs * held[:, None] + np.arange(bs)).ravel().astype(PETSc.IntType)
    a.zeroRowsColumns(rows, 1.0, a.createVecRight(), b)
    return a, b, space.tabulate_dof_coordinates()[: nodes.size_local, :dim]


def iterations(a, b, x, options):
    """Return how many iterations conjugate gradients take, in words."""
    ksp, database = PETSc.KSP().create(a.comm), PETSc.Options()
    ksp.setOperators(a)
    ksp.setType("cg")
    ksp.setNormType(PETSc.KSP.NormType.NATURAL)
    ksp.setTolerances(rtol=1e-8, max_it=500)
    ksp.getPC().setType("latin")
    ksp.getPC().setCoordinates(x)
    for key, value in options.items():
        database.setValue(key, value)
    ksp.setFromOptions()
    ksp.solve(b, a.createVecRight())
    for key in options:
        database.delValue(key)
    return str(ksp.getIterationNumber()) if ksp.getConvergedReason() > 0 else "none"


def main():
    """Print the table."""
    comm = MPI.COMM_WORLD
    PETSc.Sys.Print(f"| | unknowns | {' | '.join(METHODS)} |\n| --- | ---: | {' | '.join(len(METHODS) * ['---:'])} |")
    for title, case in CASES.items():
        a, b, x = assemble(comm, *case)
        counts = [iterations(a, b, x, options) for options in METHODS.values()]
        PETSc.Sys.Print(f"| {title} | {a.getSize()[0]:,} | {' | '.join(counts)} |")


if __name__ == "__main__":
    main()
