"""A PETSc without CHOLMOD and MUMPS: other factorisations step in, with a notice, and the answer is the same."""

import json

import pytest
from command import latinpc
from conftest import ROOT

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


def test_load_cases_without_packages(compile_c, tmp_path):
    """They are solved one after the other, with the same results."""
    shim, found = compile_c("no_packages.c", "-shared", "-fPIC"), []
    for name, how in (("with", {}), ("without", {"env": {"LD_PRELOAD": str(shim)}})):
        file = tmp_path / name
        latinpc("cases", ROOT / "examples" / "footbridge.msh", "--json", file, "-snes_latin_error", 1e-8, **how)
        found.append(json.loads(file.read_text())["cases"])
    ours, others = found
    assert all(case["converged"] for case in others)
    assert any(case["together"] for case in ours) and not any(case["together"] for case in others)
    for key in ("displacement", "lowest", "highest"):
        assert [case[key] for case in others] == pytest.approx([case[key] for case in ours], rel=1e-6)
