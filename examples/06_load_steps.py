"""A load that grows: the operators are built once, and each solve may start from the last one.

    python examples/06_load_steps.py
    mpirun -n 2 python examples/06_load_steps.py -modules 16 -steps 12
    python examples/06_load_steps.py -log_view :profile.txt

A new load or a new initial_elongation leaves the subdomains' factors and the coarse factor alone: only right-hand sides
change, and one more load case costs its iterations. With -snes_latin_warm_start last they start from the state (forces
and displacements on the interfaces, slack or taut links) that the last converged solve has left; with extrapolate, one
step further in the same direction.
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
grid = latinpc.Structure.from_scene(scene)


def path(warm):
    """Solve for each step; returns the iterations of all steps and the last tensions."""
    options["snes_latin_warm_start"] = warm
    snes = grid.create_snes()
    snes.setFromOptions()
    u, count = grid.create_vec(), []
    start = time.perf_counter()
    snes.setUp()
    built = time.perf_counter() - start
    for factor in np.linspace(0.5, 1, steps):
        grid.set_load(factor * scene.load)
        if warm == "none":
            u.set(0)  # the initial guess, as of any SNES
        snes.solve(None, u)
        count.append(snes.getIterationNumber())
    total = time.perf_counter() - start
    PETSc.Sys.Print(f"warm start {warm}: iterations {count}, set-up {built:.3f} s of {total:.3f} s")
    return sum(count), grid.tensions(u)


cold, cold_tension = path("none")
warm, warm_tension = path("last")
further, _ = path("extrapolate")
difference = np.abs(warm_tension - cold_tension).max() / np.abs(cold_tension).max()
PETSc.Sys.Print(f"{cold}, {warm} and {further} iterations, tensions within {difference:.0e} of the largest")
assert further < cold and warm < cold
