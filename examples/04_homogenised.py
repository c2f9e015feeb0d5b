"""The homogenised behaviour of a subdomain as a PETSc matrix.

    python examples/04_homogenised.py
    mpirun -n 2 python examples/04_homogenised.py -snes_latin_variant none

Seen from the coarse problem, a subdomain is a stiffness H between the macro displacements of its strong interfaces
and the displacements of its corners, equations (29) and (51) of the article. The assembled H of all subdomains is
the homogenised structure. H is symmetric and positive semidefinite; the subdomain in the middle of the grid is held
by nothing but its neighbours, so its kernel holds the 6 rigid motions.
"""

import sys

import numpy as np
import petsc4py

petsc4py.init(sys.argv)

import latinpc
from latinpc.scenes import make

MIDDLE = 4  # of 3 x 3 subdomains

grid = latinpc.Structure.from_scene(make("tensegrity-grid", modules=12))
snes = grid.create_snes()
latinpc.set_variant(snes, "corner")  # by default, interfaces of so few subdomains are all in the coarse problem
snes.setFromOptions()
snes.setUp()
count, first = latinpc.subdomains(snes)  # a rank may look into its own subdomains
if first <= MIDDLE < first + count:
    H = latinpc.macro_stiffness(snes, MIDDLE - first)
    a = H.getDenseArray()
    stiffness = np.linalg.eigvalsh(a)
    rigid = np.count_nonzero(np.abs(stiffness) < 1e-12 * stiffness[-1])
    print(f"H has {a.shape[0]} rows and {rigid} zero eigenvalues; the next are {stiffness[rigid : rigid + 3].round(3)}")
    print(f"symmetric to {np.abs(a - a.T).max():.0e}")
    assert rigid == 6
