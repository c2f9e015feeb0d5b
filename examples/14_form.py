"""Find the form of a canopy of cables, load it, and compute its modes.

    python examples/14_form.py
    python examples/14_form.py -form_ksp_type cg -form_pc_type latin -form_ksp_converged_reason
    mpirun -n 2 python examples/14_form.py

The drawing is a square net over 16 m, flat but for two high corners, hung at its four corners alone. Force densities,
tension over length, say how taut its cables are; the form in which they balance is one linear system per coordinate.
Snow moves it by large displacements. Frequencies and buckling factors need SLEPc, and are left out without it. The mast
under it is a strut: a negative force density. Last, the edges get a force instead of a force density.
"""

import sys

import petsc4py

petsc4py.init(sys.argv)

import numpy as np
from petsc4py import PETSc

import latinpc

# the drawing: points 2 m apart, cables between neighbours, those of the edges ten times as taut
N = 8
i, j = (a.ravel() for a in np.meshgrid(np.arange(N + 1), np.arange(N + 1), indexing="ij"))
nodes = np.column_stack([2.0 * i, 2.0 * j, 5.0 * ((i % N == 0) & (i == j))])
links = np.array([(a, a + d) for a in range(len(nodes)) for d in (1, N + 1) if (j[a] < N if d == 1 else i[a] < N)])
edge = ((i[links] % N == 0).all(axis=1) & (i[links[:, 0]] == i[links[:, 1]])) | (
    (j[links] % N == 0).all(axis=1) & (j[links[:, 0]] == j[links[:, 1]])
)
corner = (i % N == 0) & (j % N == 0)
fixed = np.repeat(corner[:, None], 3, axis=1)
density = np.where(edge, 20e3, 2e3)  # N/m

form = latinpc.form_find(nodes, links, fixed, density, EA=np.where(edge, 3e7, 5e6), mass=8.0, name="canopy")
PETSc.Sys.Print(form)
middle = form.nodes[N // 2 * (N + 2)]
assert form.unbalance < 1e-9
assert np.allclose(middle, [8.0, 8.0, 2.5])  # by symmetry

# at rest in its own form, and under snow
at_rest = form.structure.solve()
assert at_rest.converged and abs(at_rest.displacements).max() < 1e-9
form.structure.set_load(np.where(fixed, 0.0, [0.0, 0.0, -500.0]))
snow = form.structure.solve()
assert snow.converged
PETSc.Sys.Print(f"under snow the canopy sags by {-snow.displacements[:, 2].min():.4f} m")
assert abs(-snow.displacements[:, 2].min() - 0.7949) < 1e-3

# a mast pushes the middle up: a strut with a negative force density, from a foot below
up = latinpc.form_find(
    np.vstack([nodes, [8.0, 8.0, -3.0]]),
    np.vstack([links, [N // 2 * (N + 2), len(nodes)]]),
    np.vstack([fixed, [True, True, True]]),
    np.append(density, -1000.0),
    EA=np.append(np.where(edge, 3e7, 5e6), 2e8),
)
PETSc.Sys.Print(f"a mast lifts its middle by {up.nodes[N // 2 * (N + 2), 2] - middle[2]:.3f} m")
assert up.tensions[-1] < 0.0 and up.unbalance < 1e-9

# all pieces of the edges bear 60 kN, as if they were jacked: to which lengths are they cut?
force = np.where(edge, 60e3, np.nan)  # N; nan: the force density of the net
jacked = latinpc.form_find(nodes, links, fixed, density, force=force, EA=np.where(edge, 3e7, 5e6), name="jacked")
PETSc.Sys.Print(f"edges of 60 kN are {jacked.natural_lengths[edge].sum() / 4:.4f} m long each, without tension")
assert np.allclose(jacked.tensions[edge], 60e3) and np.allclose(jacked.densities[~edge], 2e3)
assert jacked.unbalance < 1e-8 and abs(jacked.structure.solve().displacements).max() < 1e-6

try:
    at_rest = at_rest.modes(3)
    loaded = snow.modes(3)
except ImportError as error:
    PETSc.Sys.Print(f"no modes: {error}")
else:
    PETSc.Sys.Print(
        f"frequencies: {at_rest.frequencies.round(4)} Hz at rest, {loaded.frequencies.round(4)} Hz under snow"
    )
    assert loaded.frequencies[0] > at_rest.frequencies[0]  # its cables are more taut
