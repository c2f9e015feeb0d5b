"""A trampoline: a mass falls on a net of cables and bounces. Every step is solved with the operators of the first one.

    python examples/11_dynamics.py
    mpirun -n 2 python examples/11_dynamics.py -side 10 -snes_latin_subdomains 4
    python examples/11_dynamics.py -ts_latin_monitor
    python examples/11_dynamics.py -contact elastic -snes_type newtonls -pc_type cholesky

The masses are lumped in the nodes. TS latin is the implicit Euler scheme in velocities and impulses of the article's
section 2.2: a rigid contact closes in a shock, after which the mass and the node that it meets have one velocity; that
takes energy. An elastic contact is a compression-only link. Energy never grows.
"""

import sys

import numpy as np
import petsc4py

petsc4py.init(sys.argv)

from petsc4py import PETSc

import latinpc
from latinpc import Law

options = PETSc.Options()
side = options.getInt("side", 8)
elastic = options.getString("contact", "rigid") == "elastic"
steps, h, mass, speed, gap, gravity = 300, 1e-3, 20.0, 4.0, 0.05, 9.81

# a net of square meshes in the plane, its rim held, and a mass above its middle
n = side + 1
x, y = (c.ravel() / side for c in np.meshgrid(np.arange(n), np.arange(n), indexing="xy"))
number = np.arange(n * n).reshape(n, n)
rows = np.stack([number[:, :-1], number[:, 1:]], axis=-1).reshape(-1, 2)
columns = np.stack([number[:-1], number[1:]], axis=-1).reshape(-1, 2)
across = np.vstack([rows, columns])
middle, ball = number[n // 2, n // 2], n * n
nodes = np.vstack([np.column_stack([4 * x, 4 * y, 0 * x]), [4 * x[middle], 4 * y[middle], gap]])
rim = (x == 0) | (x == 1) | (y == 0) | (y == 1)

# a taut cable resists a deflection across it by its tension over its length: a bar along z of that stiffness
tension, length = 2e3, 4.0 / side
links = np.vstack([across, across, [[middle, ball]]])
m = len(across)
law = np.r_[np.full(m, Law.CABLE), np.full(m, Law.BAR), Law.COMPRESSION_ONLY if elastic else Law.CONTACT]
stiffness = np.r_[np.full(m, 5e5 / length), np.full(m, tension / length), 1e6 if elastic else 0.0]
initial_elongation = np.r_[np.full(m, tension * length / 5e5), np.zeros(m), gap]
direction = np.vstack([np.zeros((m, 3)), np.tile([0.0, 0.0, 1.0], (m + 1, 1))])
masses = np.append(np.full(n * n, 0.5), mass)

net = latinpc.Structure(
    nodes, links, law, stiffness, initial_elongation, fixed=np.append(rim, False)[:, None] & np.ones(3, bool),
    load=-gravity * masses[:, None] * [0, 0, 1], direction=direction, mass=masses,
)  # fmt: skip
u, v = net.create_vec(), net.create_vec()
start = np.zeros(nodes.shape)
start[ball, 2] = -speed
net.set_displacements(start, v)

ts = net.create_ts(u, v)
ts.setTimeStep(h)
ts.setMaxSteps(steps)
ts.setFromOptions()
energy, height, iterations, impulse = [], [], [], 0.0


def after_step(ts, k, t, u):
    """Note energy, height of the mass, iterations, and the impulse of the contact."""
    global impulse
    energy.append(net.energy(u) + net.kinetic_energy(v))
    height.append(net.displacements(u)[ball, 2])
    if k:
        iterations.append(ts.getSNES().getIterationNumber())
        impulse -= h * latinpc.step_tensions(ts)[-1]


ts.setMonitor(after_step)
ts.solve(u)
change = mass * (net.displacements(v)[ball, 2] + speed + gravity * h * steps)
if net.comm.getRank() == 0:
    print(f"{ts.getSNES().getType()}: {np.mean(iterations):.1f} iterations a step, at most {max(iterations)}")
    print(f"the mass sinks by {-1e3 * min(height):.0f} mm and is {1e3 * height[-1]:.0f} mm above its start in the end")
    print(f"impulse of the contact {impulse:.3f} Ns, change of momentum {change:.3f} Ns")
    print(f"energy from {energy[0]:.1f} J to {energy[-1]:.1f} J")
assert abs(impulse - change) < 1e-3 * change
assert np.diff(energy).max() < 1e-4 * energy[0]
assert height[-1] > min(height) + 0.1
