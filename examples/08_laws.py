"""Laws beyond bars and cables: a block with friction, and a cable that hardens, given by points.

    python examples/08_laws.py
    mpirun -n 2 python examples/08_laws.py -snes_monitor

A block of 100 N lies on a floor and is pulled sideways by 20 N, away from a wall that a rope ties it to. The floor is a
contact with Coulomb friction: two links between the same two nodes, at one place, the normal one first; its coefficient
is 0.15, so that the floor bears 15 N and the rope the rest. The rope carries nothing up to an elongation of 2 mm and is
then stiffer and stiffer: points of its law, tension over elongation. So the block slides until the rope carries 5 N, by
3.5 mm.

A law of one's own may also be functions in C: latinpc.register_law, and 08_laws.c.
"""

import sys

import petsc4py

petsc4py.init(sys.argv)

from petsc4py import PETSc

import latinpc
from latinpc import Law

rope = latinpc.register_table(
    elongation=[-1.0, 2e-3, 3e-3, 4e-3, 5e-3],  # m
    tension=[0.0, 0.0, 2.0, 8.0, 20.0],  # N
    name="rope",
)
floor, block, wall = range(3)
scene = latinpc.Structure(
    nodes=[[0, 0], [0, 0], [-1, 0]],
    links=[[floor, block], [floor, block], [wall, block]],
    law=[Law.FRICTION, Law.TANGENT, rope],
    stiffness=0.0,  # the solver's choice for rigid laws, the table's own for the rope
    direction=[[0, 1], [1, 0], [0, 0]],  # normal, tangent, and along the nodes
    friction=0.15,
    fixed=[[1, 1], [0, 0], [1, 1]],
    load=[[0, 0], [20.0, -100.0], [0, 0]],
)
snes = scene.create_snes()
snes.setTolerances(stol=1e-12)
snes.setFromOptions()
u = scene.create_vec()
snes.solve(None, u)

moved, (normal, tangent, pull) = scene.displacements(u)[block], latinpc.tensions(snes)
PETSc.Sys.Print(f"the block slides by {1e3 * moved[0]:.3f} mm and sinks by {abs(1e3 * moved[1]):.3f} mm")
PETSc.Sys.Print(f"the floor bears {-normal:.3f} N and rubs with {abs(tangent):.3f} N, the rope carries {pull:.3f} N")
assert abs(moved[0] - 3.5e-3) < 1e-9
assert abs(pull - 5.0) < 1e-6
