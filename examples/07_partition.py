"""A partition of one's own, and the index sets of the subdomains.

    python examples/07_partition.py
    mpirun -n 2 python examples/07_partition.py

Without a word one rank takes the structure whole, and METIS shares its links out to more ranks. Here the cantilever is
cut across its length instead, in two ways: with `latinpc.set_partition` for one solver, and with an array for all
solvers on the structure, a number per link in the caller's order. The index sets of the subdomains then go to another
preconditioner, PETSc's additive Schwarz method, on the same subdomains.
"""

import sys

import numpy as np
import petsc4py

petsc4py.init(sys.argv)

from petsc4py import PETSc

import latinpc
from latinpc.scenes import make

PARTS = 6
scene = make("lattice", nx=24, ny=6, partition="metis")  # that is, none given
length = scene.nodes[:, 0].max()


def slice_of(x):
    return np.minimum((x / length * PARTS).astype(int), PARTS - 1)


def solve(structure, subdomain=None):
    snes = structure.create_snes()
    snes.setFromOptions()
    if subdomain is not None:
        latinpc.set_partition(snes, subdomain)
    u = structure.create_vec()
    snes.solve(None, u)
    PETSc.Sys.Print(
        f"{latinpc.statistics(snes)['subdomains']} subdomains, {snes.getIterationNumber()} iterations, "
        f"the end sinks by {-1e3 * structure.displacements(u)[:, 1].min():.4f} mm"
    )
    return snes


middle = scene.nodes[scene.links].mean(axis=1)[:, 0]
structure = latinpc.Structure.from_scene(scene)
of_solver = solve(structure, slice_of(middle))
scene.subdomain = slice_of(middle)
of_structure = solve(latinpc.Structure.from_scene(scene))
assert (latinpc.subdomain_of_links(of_solver) == latinpc.subdomain_of_links(of_structure)).all()

# the same subdomains for -pc_type asm: free degrees of freedom of each subdomain of this rank, as PETSc index sets
ksp = PETSc.KSP().create(structure.comm)
K, u, b = structure.dm.createMat(), structure.create_vec(), structure.create_vec()
structure.jacobian(u, K)
structure.residual(u, b)
b.scale(-1)
ksp.setOperators(K)
ksp.setType("cg")
ksp.setTolerances(rtol=1e-8)
count, _ = latinpc.subdomains(of_solver)
sets = [latinpc.subdomain_is(of_solver, i) for i in range(count)]
ksp.getPC().setType("asm")
ksp.getPC().setASMType(PETSc.PC.ASMType.BASIC)
ksp.getPC().setASMOverlap(0)  # beyond the nodes that the subdomains share
ksp.getPC().setASMLocalSubdomains(count, sets)
ksp.solve(b, u)
asm = ksp.getIterationNumber()
u.set(0)
ksp.getPC().setType("latin")
latinpc.set_partition(ksp.getPC(), slice_of(middle))
ksp.solve(b, u)
PETSc.Sys.Print(f"CG on the taut structure: {asm} iterations with asm, {ksp.getIterationNumber()} with latin")
