"""One linear stage of the method as a preconditioner for conjugate gradients, on a truss.

    python examples/03_preconditioner.py
    mpirun -n 2 python examples/03_preconditioner.py -ksp_monitor -pc_latin_variant macro
    python examples/03_preconditioner.py -pc_type gamg

In a truss all links are bars: the problem is linear, and its stiffness matrix is symmetric positive definite.
Twice the same solve: behind a SNES that makes one linear step, and with a KSP of one's own, whose matrix comes
from the DM of the structure. Both read -ksp_* and -pc_*, so any other preconditioner can take the place.
"""

import sys

import petsc4py

petsc4py.init(sys.argv)

from petsc4py import PETSc

import latinpc
from latinpc.scenes import make

truss = latinpc.Structure.from_scene(make("truss-grid", modules=16))

# behind a SNES, as the options -snes_type ksponly -ksp_type cg -ksp_rtol 1e-8 -pc_type latin would have it
snes = truss.create_snes()
snes.setType("ksponly")
ksp = snes.getKSP()
ksp.setType("cg")
ksp.setTolerances(rtol=1e-8)
ksp.getPC().setType("latin")
snes.setFromOptions()
u = truss.create_vec()
snes.solve(None, u)
PETSc.Sys.Print(f"SNES ksponly: {ksp.getIterationNumber()} iterations with {ksp.getPC().getType()}")

# a KSP of one's own: K v = -r(0)
K, v, b = truss.dm.createMat(), truss.create_vec(), truss.create_vec()
truss.jacobian(v, K)
truss.residual(v, b)
b.scale(-1)
plain = PETSc.KSP().create(truss.comm)
plain.setOperators(K)
plain.setType("cg")
plain.setTolerances(rtol=1e-8)
plain.getPC().setType("latin")
plain.setFromOptions()
plain.solve(b, v)
difference = truss.errors(v, u)[1]
PETSc.Sys.Print(f"KSP: {plain.getIterationNumber()} iterations, {difference:.0e} from the other in energy")
assert difference < 1e-6
