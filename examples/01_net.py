"""A net of three cables from numpy arrays.

    python examples/01_net.py
    mpirun -n 2 python examples/01_net.py

A weight hangs from two cables at right angles; a third one ties it to the ground. The weight sinks, the tie
becomes slack and carries nothing, so each of the other two carries F / sqrt(2) and the weight sinks by F / k:
1 mm here. Were the tie a bar, it would be half of that. The supports above bear F / 2 each.

The same in C: 01_net.c. The solver as a SNES of petsc4py, with options from the command line: 02_variants.py.
"""

from mpi4py import MPI

import latinpc

net = latinpc.Structure(
    nodes=[[-1, 1], [1, 1], [0, -1], [0, 0]],
    links=[[0, 3], [1, 3], [2, 3]],
    law="cable",
    stiffness=1e4,  # N/m
    fixed=[[1, 1], [1, 1], [1, 1], [0, 0]],
    load=[[0, 0], [0, 0], [0, 0], [0, -10]],  # N
    name="net",
)
result = net.solve(options={"snes_latin_subdomains": 3})  # whole results, on every rank

if MPI.COMM_WORLD.rank == 0:
    print(result)
    print(result.members)
assert abs(result.displacements[3, 1] + 1e-3) < 1e-7
assert abs(result.reactions[:, 1] - [5, 5, 0, 0]).max() < 1e-3
