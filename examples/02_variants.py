"""The article's tensegrity grid with the three variants, and PETSc options from the command line.

    python examples/02_variants.py
    mpirun -n 2 python examples/02_variants.py -modules 16 -slack 0.05
    python examples/02_variants.py -snes_latin_outer_snes_type nrichardson -snes_latin_direction_value 0.5
    python examples/02_variants.py -options_file options/article.opts

The variants differ in what the coarse problem makes of weak interfaces, those that a few nodes make: nothing
(`none`, section 4.1 of the article), their whole displacement (`macro`, 4.2), or one displacement for each of
their nodes (`corner`, 4.4 and 5), the smallest coarse problem of the two that glue them. All find the same solution.
"""

import sys

import numpy as np
import petsc4py

petsc4py.init(sys.argv)

from petsc4py import PETSc

import latinpc
from latinpc.scenes import make

options = PETSc.Options()
scene = make("tensegrity-grid", modules=options.getInt("modules", 12), slack=options.getReal("slack", 0.09))
grid = latinpc.Structure.from_scene(scene)
PETSc.Sys.Print(grid)

found = {}
for variant in ("none", "macro", "corner"):
    options["snes_latin_variant"] = variant
    snes = grid.create_snes()
    snes.setFromOptions()
    u = grid.create_vec()
    snes.solve(None, u)
    size = latinpc.statistics(snes)
    slack = np.mean(grid.tensions(u)[scene.law != latinpc.Law.BAR] == 0)
    found[variant] = np.abs(grid.displacements(u)[:, 2]).max()
    PETSc.Sys.Print(
        f"{variant:7}{snes.getIterationNumber():4} iterations, coarse problem {size['strong_macro_dofs']} + "
        f"{size['weak_dofs']:<3}, sinks by {1e3 * found[variant]:.3f} mm, {slack:.1%} of the cables slack"
    )
    snes.destroy()

assert np.ptp(list(found.values())) < 1e-3 * found["corner"]
