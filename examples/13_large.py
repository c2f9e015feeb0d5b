"""Cable nets and tensegrities, which prestress alone holds, under loads that move them far.

    python examples/13_large.py
    python examples/13_large.py -snes_latin_monitor -snes_latin_variant macro
    mpirun -n 2 python examples/13_large.py

A saddle of cables over a square of 8 m, clamped at its rim, and a simplex: three struts and nine cables. With small
displacements both are refused as mechanisms; with `geometry="large"` equilibrium is that of the displaced structure.
And the saddle of cables that do not stretch, 2 % longer than drawn.
"""

import sys

import petsc4py

petsc4py.init(sys.argv)

import numpy as np
from petsc4py import PETSc

import latinpc


def solve(structure):
    """Solve, and return the displacements and the solver."""
    snes, u = structure.create_snes(), structure.create_vec()
    snes.setFromOptions()
    snes.solve(None, u)
    assert snes.getConvergedReason() > 0
    return structure.displacements(u), snes


# a saddle: cables between the points of a grid, 1000 N in each as drawn, 400 N of snow on each node
N, EA, T = 8, 1e6, 1000.0
i, j = (a.ravel() for a in np.meshgrid(np.arange(N + 1), np.arange(N + 1), indexing="ij"))
nodes = np.column_stack([i, j, 1.6 * ((i / N - 0.5) ** 2 - (j / N - 0.5) ** 2)])
rim = (i % N == 0) | (j % N == 0)
pairs = [(a, a + d) for a in range(len(nodes)) for d in (1, N + 1) if a + d < len(nodes) and (d > 1 or j[a] < N)]
links = np.array([(a, b) for a, b in pairs if not (rim[a] and rim[b])])
corners = np.setdiff1d(np.arange(len(nodes)), links)  # no cable reaches them
number = np.cumsum(~np.isin(np.arange(len(nodes)), corners)) - 1
nodes, rim, links = np.delete(nodes, corners, axis=0), np.delete(rim, corners), number[links]
length = np.linalg.norm(nodes[links[:, 1]] - nodes[links[:, 0]], axis=1)
saddle = latinpc.Structure(
    nodes,
    links,
    law="cable",
    stiffness=EA / (length / (1.0 + T / EA)),
    prestress=T,
    fixed=np.repeat(rim[:, None], 3, axis=1),
    load=np.where(rim[:, None], 0.0, [0.0, 0.0, -400.0]),
    geometry="large",
)
u, snes = solve(saddle)
slack = int((latinpc.tensions(snes) <= 0.0).sum())
PETSc.Sys.Print(f"saddle: sags by {-u[:, 2].min():.4f} m; {slack} of {len(links)} cables are slack")
sag = -u[:, 2].min()

# the same saddle of cables that do not stretch, 2 % longer than drawn: no stiffness, none is longer than it is
inextensible = latinpc.Structure(
    nodes,
    links,
    law="inextensible",
    stiffness=0.0,
    initial_elongation=-0.02 * length,
    fixed=saddle.fixed,
    load=saddle.load,
    geometry="large",
)
v, snes = solve(inextensible)
tensions = latinpc.tensions(snes)
longest = np.linalg.norm(np.diff((nodes + v)[links], axis=1)[:, 0], axis=1) / length
PETSc.Sys.Print(
    f"without stretch: sags by {-v[:, 2].min():.4f} m; {(tensions <= 0.0).sum()} of {len(links)} cables are slack,"
    f" the others bear {tensions.max():.0f} N at most"
)
assert abs(longest.max() - 1.02) < 1e-5

# a simplex: its prestress is the one state of tensions that balances; a moment of 300 Nm turns the upper triangle
angle = np.arange(3) * 2.0 * np.pi / 3.0 + np.array([[0.0], [np.deg2rad(150.0)]])
points = np.column_stack([np.cos(angle).ravel(), np.sin(angle).ravel(), np.repeat([0.0, 1.0], 3)])
ring = [(k, (k + 1) % 3) for k in range(3)]
cables = ring + [(3 + a, 3 + b) for a, b in ring] + [(a, 3 + b) for b, a in ring]
links = np.array(cables + [(k, 3 + k) for k in range(3)])
span = points[links[:, 1]] - points[links[:, 0]]
B = np.zeros((6, 3, 12))
for m, (a, b) in enumerate(links):
    B[a, :, m], B[b, :, m] = -span[m], span[m]
stress = np.linalg.svd(B.reshape(18, 12))[2][-1] * np.linalg.norm(span, axis=1)
simplex = latinpc.Structure(
    points,
    links,
    law=["cable"] * 9 + ["bar"] * 3,
    stiffness=1e5,
    prestress=1000.0 * stress / stress[0],
    fixed=np.repeat([[True], [False]], 3, axis=0).repeat(3, axis=1),
    load=np.where(np.arange(6)[:, None] < 3, 0.0, 100.0 * np.cross([0.0, 0.0, 1.0], points)),
    geometry="large",
)
u, snes = solve(simplex)
upper = (points + u)[3:]
turned = np.degrees(np.arctan2(upper[0, 1], upper[0, 0])) - 150.0
borne = latinpc.path(snes)["borne"]
PETSc.Sys.Print(f"simplex: turns by {turned:.3f} degrees and sinks by {-u[3, 2]:.4f} m under {borne:.0%} of the loads")
assert abs(sag - 0.1342) < 1e-4
assert abs(turned - 3.183) < 1e-3
