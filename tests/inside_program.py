"""Solvers of PETSc's with latin inside, chosen by options, on any number of ranks: jobs of `test_inside.py`."""

import argparse

import numpy as np
from matis_program import Grid, matis
from petsc4py import PETSc

import latinpc
from latinpc.scenes import make


def job(kind):
    """Solve a structure by a SNES, or a MATIS of two fields by a KSP."""
    return {"structure": structure, "fields": fields}[kind]()


def structure():
    """Solve a tensegrity grid; return its displacements, too."""
    grid = latinpc.Structure.from_scene(make("tensegrity-grid", modules=8, subdomains=16))
    snes, u = grid.create_snes(), grid.create_vec()
    snes.setFromOptions()
    snes.solve(None, u)
    found = {"reason": snes.getConvergedReason(), "iterations": snes.getIterationNumber()}
    return found | {"u": grid.displacements(u).tolist()}


def fields():
    """Solve a plate of finite elements."""
    args = argparse.Namespace(problem="elasticity", dim=2, cells=12, blocks="2,2", dirichlet="zeroed", jump="none",
                              local_type="aij", scalar_map=False, asymmetric=False, owned=False)  # fmt: skip
    a, _, _ = matis(Grid(args), args, PETSc.COMM_WORLD)
    b, u = a.createVecs()
    first, last = b.getOwnershipRange()
    b.setArray(np.sin(1.0 + 7.3 * np.arange(first, last)))
    ksp = PETSc.KSP().create()
    ksp.setOperators(a)
    ksp.setTolerances(rtol=1e-8, max_it=200)
    ksp.setFromOptions()
    ksp.solve(b, u)
    found = {"reason": ksp.getConvergedReason(), "iterations": ksp.getIterationNumber()}
    return found | {"residual": (b - a * u).norm() / b.norm()}
