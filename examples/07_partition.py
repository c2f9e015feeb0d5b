"""A partition of one's own, and the index sets of the subdomains.

    python examples/07_partition.py
    mpirun -n 2 python examples/07_partition.py

Without a word METIS shares out the links. Here the cantilever is cut across its length instead, in two ways: with
an array, one number per link in the caller's order; and with a DMLabel "subdomain" on the links' DMPLEX, from the
place of each cell, as a program would that works on the DM. The index sets of the subdomains then serve another
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


def solve(links):
    snes = links.create_snes()
    snes.setFromOptions()
    u = links.create_vec()
    snes.solve(None, u)
    PETSc.Sys.Print(
        f"{latinpc.statistics(snes)['subdomains']} subdomains, {snes.getIterationNumber()} iterations, "
        f"the end sinks by {-1e3 * links.displacements(u)[:, 1].min():.4f} mm"
    )
    return snes


middle = scene.nodes[scene.links].mean(axis=1)[:, 0]
scene.subdomain = slice_of(middle)
by_array = solve(latinpc.Links.from_scene(scene))

scene.subdomain = None
links = latinpc.Links.from_scene(scene)
dm = links.dm
dm.createLabel("subdomain")
for cell in range(*dm.getHeightStratum(0)):  # the links that this rank keeps
    centre = dm.computeCellGeometryFVM(cell)[1]
    dm.setLabelValue("subdomain", cell, slice_of(centre[0]))
by_label = solve(links)
assert (latinpc.subdomain_of_links(by_array) == latinpc.subdomain_of_links(by_label)).all()

# the same subdomains for -pc_type asm: free degrees of freedom of each subdomain of this rank, as PETSc index sets
ksp = PETSc.KSP().create(links.comm)
K, u, b = dm.createMat(), links.create_vec(), links.create_vec()
links.jacobian(u, K)
links.residual(u, b)
b.scale(-1)
ksp.setOperators(K)
ksp.setType("cg")
ksp.setTolerances(rtol=1e-8)
count, _ = latinpc.subdomains(by_label)
sets = [latinpc.subdomain_is(by_label, i) for i in range(count)]
ksp.getPC().setType("asm")
ksp.getPC().setASMType(PETSc.PC.ASMType.BASIC)
ksp.getPC().setASMOverlap(0)  # beyond the nodes that the subdomains share
ksp.getPC().setASMLocalSubdomains(count, sets)
ksp.solve(b, u)
asm = ksp.getIterationNumber()
u.set(0)
ksp.getPC().setType("latin")
ksp.solve(b, u)
PETSc.Sys.Print(f"CG on the taut structure: {asm} iterations with asm, {ksp.getIterationNumber()} with latin")
