"""A load that grows: the operators are built once, and each solve may start from the last one.

    python examples/06_load_steps.py
    mpirun -n 2 python examples/06_load_steps.py -modules 16 -steps 12
    python examples/06_load_steps.py -log_view :profile.txt

A new load or a new prestrain leaves the subdomains' factors and the coarse factor alone: only right-hand sides
change, and one more load case costs its iterations. With -snes_latin_warm_start they start from the state (forces
and displacements on the interfaces, slack or taut links) that the last converged solve has left; with
-snes_latin_warm_extrapolate, one step further in the same direction.
"""

import sys
import time

import numpy as np
import petsc4py

petsc4py.init(sys.argv)

from petsc4py import PETSc

import latinpc
from latinpc.scenes import make

options = PETSc.Options()
steps = options.getInt("steps", 8)
scene = make("tensegrity-grid", modules=options.getInt("modules", 12))
grid = latinpc.Links.from_scene(scene)


def path(warm, extrapolate=False):
    """Solve for each step; returns the iterations of all steps and the last tensions."""
    options["snes_latin_warm_start"] = warm
    options["snes_latin_warm_extrapolate"] = extrapolate
    snes = grid.create_snes()
    snes.setFromOptions()
    u, count = grid.create_vec(), []
    start = time.perf_counter()
    snes.setUp()
    built = time.perf_counter() - start
    for factor in np.linspace(0.5, 1, steps):
        grid.set_load(factor * scene.load)
        snes.solve(None, u)
        count.append(snes.getIterationNumber())
    total = time.perf_counter() - start
    name = "extrapolated" if extrapolate else "warm" if warm else "cold"
    PETSc.Sys.Print(f"{name}: iterations {count}, set-up {built:.3f} s of {total:.3f} s")
    return sum(count), grid.tensions(u)


cold, cold_tension = path(False)
warm, warm_tension = path(True)
further, _ = path(True, extrapolate=True)
difference = np.abs(warm_tension - cold_tension).max() / np.abs(cold_tension).max()
PETSc.Sys.Print(f"{cold}, {warm} and {further} iterations, tensions within {difference:.0e} of the largest")
assert further < cold and warm < cold
