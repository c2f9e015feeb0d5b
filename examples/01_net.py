"""A net of three cables from numpy arrays.

    python examples/01_net.py
    mpirun -n 2 python examples/01_net.py -snes_latin_subdomains 3 -snes_latin_monitor

A weight hangs from two cables at right angles; a third one ties it to the ground. The weight sinks, the tie
becomes slack and carries nothing, so each of the other two carries F / sqrt(2) and the weight sinks by F / k:
1 mm here. Were the tie a bar, it would be half of that.

The same in C: 01_net.c.
"""

import sys

import numpy as np
import petsc4py

petsc4py.init(sys.argv)

from petsc4py import PETSc

import latinpc

net = latinpc.Structure(
    nodes=[[-1, 1], [1, 1], [0, -1], [0, 0]],
    links=[[0, 3], [1, 3], [2, 3]],
    law=latinpc.Law.CABLE,
    stiffness=1e4,  # N/m
    fixed=[[1, 1], [1, 1], [1, 1], [0, 0]],
    load=[[0, 0], [0, 0], [0, 0], [0, -10]],  # N
)
snes = net.create_snes()
snes.setFromOptions()
u = net.create_vec()
snes.solve(None, u)

displacement, tension = net.displacements(u), latinpc.tensions(snes)  # the whole arrays, on every rank
PETSc.Sys.Print(f"the weight moves by {np.round(1e3 * displacement[3], 4) + 0} mm")
PETSc.Sys.Print(f"tensions {np.round(tension, 2)} N after {snes.getIterationNumber()} iterations")
assert abs(displacement[3, 1] + 1e-3) < 1e-7
