"""The preconditioner behind a PCSHELL, for a program that insists on one.

    python examples/05_shell.py
    mpirun -n 2 python examples/05_shell.py -pc_latin_subdomains 24 -ksp_monitor

Some codes use no preconditioner but one they set up themselves. A PC of type shell does the same as -pc_type latin
and reads the same options. In C: PCSetType(pc, PCSHELL); PCShellSetLatin(pc).
"""

import sys

import petsc4py

petsc4py.init(sys.argv)

from petsc4py import PETSc

import latinpc
from latinpc.scenes import make

truss = latinpc.Structure.from_scene(make("truss-grid", modules=12, partition="metis"))
K, u, b = truss.dm.createMat(), truss.create_vec(), truss.create_vec()
truss.jacobian(u, K)
truss.residual(u, b)
b.scale(-1)


def iterations(prepare):
    ksp = PETSc.KSP().create(truss.comm)
    ksp.setOperators(K)
    ksp.setType("cg")
    prepare(ksp.getPC())
    ksp.setFromOptions()
    u.set(0)
    ksp.solve(b, u)
    PETSc.Sys.Print(f"{ksp.getPC().getType()}: {ksp.getIterationNumber()} iterations")
    return ksp.getIterationNumber()


def shell(pc):
    pc.setType("shell")
    latinpc.pcshell_set_latin(pc)


assert iterations(shell) == iterations(lambda pc: pc.setType("latin"))
