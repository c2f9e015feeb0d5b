"""A mast falls over when a guy breaks: links turn by any angle, and energy stays.

    python examples/15_large_motion.py
    python examples/15_large_motion.py -ts_latin_monitor -ts_dt 0.002
    mpirun -n 2 python examples/15_large_motion.py -snes_latin_subdomains 2

A mast of 8 m, of bars hinged to each other, between cables that meet it at each hinge. At t = 0 the cables of one side
are gone. With `geometry="large"` TS latin is the implicit midpoint rule with the mean forces of a step: the sum of
kinetic and potential energy stays whatever the step, while the mast falls and its cables slacken and jerk taut.
"""

import sys

import petsc4py

petsc4py.init(sys.argv)

import numpy as np
from petsc4py import PETSc

import latinpc

end, parts, height, reach, gravity = 2.0, 4, 8.0, 5.0, 9.81

# the mast, then the feet of the cables that are left; bars take 1e6 N per unit strain, cables 2e5 N
z = np.linspace(0.0, height, parts + 1)
nodes = np.concatenate([np.column_stack([np.zeros(parts + 1), z]), [[-reach, 0.0]]])
mast = [(k, k + 1) for k in range(parts)]
cables = [(k, parts + 1) for k in range(1, parts + 1)]
links = np.array(mast + cables)
length = np.linalg.norm(np.diff(nodes[links], axis=1)[:, 0], axis=1)
fixed = np.zeros(nodes.shape, bool)
fixed[[0, -1]] = True
mass = np.where(fixed[:, 0], 0.0, 50.0)
structure = latinpc.Structure(
    nodes,
    links,
    law=["bar"] * parts + ["cable"] * parts,
    stiffness=np.where(np.arange(len(links)) < parts, 1e6, 2e5) / length,
    prestress=[0.0] * parts + [500.0] * parts,
    fixed=fixed,
    load=-gravity * mass[:, None] * [0.0, 1.0],
    mass=mass,
    geometry="large",
)
u, v = structure.create_vec(), structure.create_vec()
ts = structure.create_ts(u, v)
ts.setTimeStep(5e-3)
ts.setMaxTime(end)
ts.setMaxSteps(10**6)
ts.setFromOptions()
energy, slack, iterations = [], [], []


def after_step(ts, step, time, u):
    """Note the energy, the slack cables and the iterations."""
    energy.append(structure.energy(u) + structure.kinetic_energy(v))
    if step:
        slack.append(int((latinpc.step_tensions(ts)[parts:] == 0.0).sum()))
        iterations.append(ts.getSNES().getIterationNumber())


ts.setMonitor(after_step)
ts.solve(u)
top = (nodes + structure.displacements(u))[parts]
kinetic = structure.kinetic_energy(v)
PETSc.Sys.Print(
    f"after {end} s the top of the mast is at ({top[0]:.2f}, {top[1]:.2f}) m; up to {max(slack)} cables were slack"
)
PETSc.Sys.Print(f"kinetic energy {kinetic:.0f} J; the sum has changed by {np.ptp(energy):.1e} J")
PETSc.Sys.Print(f"{np.mean(iterations):.1f} iterations a step")
assert np.ptp(energy) < 1e-5 * kinetic
