"""A PETSc without CHOLMOD and MUMPS: other factorisations step in, with a notice, and the answer is the same."""

import pytest

PROGRAM = """
import sys
import petsc4py
petsc4py.init(sys.argv)
from petsc4py import PETSc
import latinpc
from latinpc.scenes import make

structure = latinpc.Structure.from_scene(make("tensegrity-grid", modules=8, subdomains=4))
snes = structure.create_snes()
snes.setFromOptions()
u = structure.create_vec()
snes.solve(None, u)
PETSc.Sys.Print(snes.reason, snes.getIterationNumber(), f"{u.norm():.9e}")
"""


@pytest.mark.parametrize("ranks", [1, 2])
def test_without_packages_others_step_in(mpirun, compile_c, ranks):
    """PETSc's own factors on one rank; on two, where it has no parallel one, each rank factors the coarse problem."""
    shim = compile_c("no_packages.c", "-shared", "-fPIC")
    with_packages = mpirun(ranks, PROGRAM)
    without = mpirun(ranks, PROGRAM, env={"LD_PRELOAD": str(shim)})
    assert without.stdout == with_packages.stdout
    assert with_packages.stderr == ""
    assert without.stderr.count("latin: this PETSc has no") == 1
