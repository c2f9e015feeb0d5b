"""Every door leads in: import, -dll_append, a PCSHELL; and a door that is shut says so."""

import shutil

import pytest
from conftest import run
from petsc4py import PETSc

import latinpc

LIBRARY = latinpc.get_library()


def test_import_registers_all_types():
    snes = PETSc.SNES().create()
    snes.setType("latin")
    assert snes.getType() == "latin"
    pc = PETSc.PC().create()
    pc.setType("latin")
    assert pc.getType() == "latin"
    ksp = PETSc.KSP().create()
    ksp.setType("latin")
    assert ksp.getType() == "latin"


def test_import_leaves_the_options_alone(mpirun):
    out = mpirun(
        1,
        """
from petsc4py import PETSc
before = PETSc.Options().getAll()
import latinpc
assert PETSc.Options().getAll() == before
print("same")
""",
    ).stdout
    assert out == "same\n"


def test_library_and_petsc4py_share_one_petsc():
    from latinpc import _latin

    assert _latin.initialized()
    assert PETSc.Sys.getVersion() == _latin.PETSC_VERSION
    assert ".".join(map(str, _latin.VERSION)) == latinpc.__version__


def test_library_has_no_undefined_symbol():
    listing = run(["ldd", "-r", LIBRARY])
    assert "undefined symbol" not in listing.stdout + listing.stderr


@pytest.mark.parametrize("ranks", [1, 2])
def test_appended_library_registers_all_types(mpirun, compile_c, ranks):
    # -help lists the registered types of a solver that is there
    append = ["-dll_append", LIBRARY, "-help"]
    pcs = mpirun(ranks, compile_c("plain_ksp.c"), *append, "-pc_type", "jacobi").stdout
    listed = next(line for line in pcs.splitlines() if "-pc_type" in line)
    assert "latin" in listed
    if ranks == 1:  # mpirun cuts the long line of the KSP types
        listed = next(line for line in pcs.splitlines() if "-ksp_type" in line)
        assert "latin" in listed
        snes = mpirun(1, compile_c("plain_snes.c"), *append).stdout
        listed = next(line for line in snes.splitlines() if "-snes_type" in line)
        assert "latin" in listed
        ts = mpirun(1, compile_c("plain_ts.c"), *append).stdout
        listed = next(line for line in ts.splitlines() if "-ts_type" in line)
        assert "latin" in listed


def test_appended_library_is_not_in_the_way(mpirun, compile_c):
    assert "CONVERGED" in mpirun(2, compile_c("plain_ksp.c"), "-dll_append", LIBRARY).stdout


def test_appended_snes_says_what_it_needs(mpirun, compile_c):
    result = mpirun(1, compile_c("plain_snes.c"), "-dll_append", LIBRARY, "-snes_type", "latin", check=False)
    assert result.returncode
    assert "-snes_type latin has no structure" in result.stderr
    assert "Unknown type" not in result.stderr


def test_appended_pc_says_what_it_needs(mpirun, compile_c):
    result = mpirun(1, compile_c("plain_ksp.c"), "-dll_append", LIBRARY, "-pc_type", "latin", check=False)
    assert result.returncode
    assert "-pc_type latin has no structure" in result.stderr
    assert "Unknown type" not in result.stderr


def test_appended_ksp_says_what_it_needs(mpirun, compile_c):
    result = mpirun(1, compile_c("plain_ksp.c"), "-dll_append", LIBRARY, "-ksp_type", "latin", check=False)
    assert result.returncode
    assert "-ksp_type latin has no structure" in result.stderr
    assert "Unknown type" not in result.stderr


def test_appended_ts_says_what_it_needs(mpirun, compile_c):
    result = mpirun(1, compile_c("plain_ts.c"), "-dll_append", LIBRARY, "-ts_type", "latin", check=False)
    assert result.returncode
    assert "-ts_type latin has no structure" in result.stderr
    assert "Unknown type" not in result.stderr


@pytest.mark.parametrize("name", ["libother.so", "latin.so", "liblatinpc_old.so"])
def test_renamed_library_says_so(mpirun, compile_c, tmp_path, name):
    renamed = shutil.copy(LIBRARY, tmp_path / name)
    result = mpirun(2, compile_c("plain_ksp.c"), "-dll_append", renamed)
    assert result.stderr.count("liblatinpc:") == 1
    assert str(renamed) in result.stderr
    assert "must be called liblatinpc.so" in result.stderr


@pytest.mark.parametrize("name", ["liblatinpc.so", "liblatinpc.so.0.1"])
def test_link_under_the_right_name_opens(mpirun, compile_c, tmp_path, name):
    renamed = shutil.copy(LIBRARY, tmp_path / "libother.so")
    (tmp_path / name).symlink_to(renamed)
    result = mpirun(1, compile_c("plain_ksp.c"), "-dll_append", tmp_path / name, "-help")
    assert "liblatinpc:" not in result.stderr
    assert "latin" in next(line for line in result.stdout.splitlines() if "-pc_type" in line)


CHAIN = """
import sys
import petsc4py
petsc4py.init(sys.argv)
from petsc4py import PETSc
import numpy as np
import latinpc

n = 24
chain = latinpc.Structure(
    nodes=np.arange(n + 1.0)[:, None], links=np.column_stack([np.arange(n), np.arange(1, n + 1)]), law=0,
    stiffness=1.0, fixed=np.isin(np.arange(n + 1), [0, n])[:, None], load=np.ones((n + 1, 1)),
    subdomain=np.arange(n) // 6,
)
snes = chain.create_snes()
snes.setType("ksponly")
u = chain.create_vec()
pc = snes.getKSP().getPC()
snes.getKSP().setType("cg")
"""

CLOSE = """
snes.setFromOptions()
snes.solve(None, u)
assert snes.reason > 0, snes.reason
x = np.arange(n + 1.0)
assert np.allclose(chain.displacements(u)[:, 0], x * (n - x) / 2, rtol=1e-4)
if PETSc.COMM_WORLD.rank == 0:
    print(pc.getType(), snes.getKSP().getIterationNumber())
"""


@pytest.mark.parametrize("ranks", [1, 2])
def test_pcshell_is_the_same_preconditioner(mpirun, ranks):
    by_type = mpirun(ranks, CHAIN + 'pc.setType("latin")\n' + CLOSE).stdout.split()
    by_shell = mpirun(ranks, CHAIN + 'pc.setType("shell")\nlatinpc.pcshell_set_latin(pc)\n' + CLOSE).stdout.split()
    assert by_type[0] == "latin"
    assert by_shell == ["shell", by_type[1]]


NET = """
import sys
import petsc4py
petsc4py.init(sys.argv)
from petsc4py import PETSc
import numpy as np
import latinpc

def chain(n):
    x = np.arange(n + 1.0)
    return x, latinpc.Structure(
        nodes=x[:, None], links=np.column_stack([np.arange(n), np.arange(1, n + 1)]), law=0, stiffness=1.0,
        fixed=np.isin(x, [0, n])[:, None], load=np.ones((n + 1, 1)))

def solves(snes, x, structure):
    u = structure.create_vec()
    snes.solve(None, u)
    assert snes.getConvergedReason() > 0
    assert np.allclose(structure.displacements(u)[:, 0], x * (x[-1] - x) / 2, rtol=1e-4)
    r = structure.create_vec()
    structure.residual(u, r)
    assert abs(snes.getFunctionNorm() - r.norm()) < 1e-6

snes = PETSc.SNES().create()
snes.setType("latin")
"""


@pytest.mark.parametrize("ranks", [1, 2])
def test_pcshell_takes_a_matrix_of_another_size(mpirun, ranks):
    """After KSPReset(), of which a PCSHELL hears nothing."""
    mpirun(
        ranks,
        NET
        + """
ksp = PETSc.KSP().create()
ksp.setType("cg")
ksp.getPC().setType("shell")
latinpc.pcshell_set_latin(ksp.getPC())
for n in (24, 9):
    x, structure = chain(n)
    K, u, b = structure.dm.createMat(), structure.create_vec(), structure.create_vec()
    structure.jacobian(u, K)
    structure.residual(u, b)
    ksp.setOperators(K)
    ksp.solve(-b, u)
    assert ksp.getConvergedReason() > 0
    assert np.allclose(structure.displacements(u)[:, 0], x * (n - x) / 2, rtol=1e-4)
    ksp.reset()
""",
    )


@pytest.mark.parametrize("ranks", [1, 2])
def test_the_dm_of_a_structure_is_enough(mpirun, ranks):
    """Another DM, or another structure, takes the place of the first one; nobody has called attach()."""
    mpirun(
        ranks,
        NET
        + """
for n in (24, 9, 24):
    x, structure = chain(n)
    snes.setDM(structure.dm)
    solves(snes, x, structure)
    snes.reset()
first = chain(24)
snes.setDM(first[1].dm)
solves(snes, *first)
second = chain(9)
second[1].attach(snes)
solves(snes, *second)
""",
    )


@pytest.mark.parametrize("make", ["SNES", "KSP", "PC", "TS"])
def test_communicators_that_differ_are_named(mpirun, make):
    result = mpirun(
        2,
        NET
        + f"""
x, structure = chain(24)
solver = PETSc.{make}().create(PETSc.COMM_SELF)
solver.setType("latin")
try:
    structure.attach(solver)
except PETSc.Error as error:
    PETSc.Sys.syncPrint(latinpc.error_message(error), flush=True)
""",
    )
    assert result.stdout.count(f"The communicator of the {make} has 1 ranks, that of the structure 2") == 2
