"""A failure of one rank alone ends in an error on all ranks, or ends the program: within seconds, no deadlock."""

import re
import sys
import time
from pathlib import Path

import pytest
from conftest import run

import latinpc

SHARED = Path(latinpc.get_library())
LINKED = [f"-I{latinpc.get_include()}", SHARED, f"-Wl,-rpath,{SHARED.parent}"]

PROGRAM = """
import ctypes
import sys
import numpy
import petsc4py
petsc4py.init(sys.argv)
from petsc4py import PETSc
import latinpc
from latinpc.scenes import Scene, make

door, at = sys.argv[1], int(sys.argv[2])
fail_from = ctypes.CDLL(None).FailFrom
fail_from.argtypes, fail_from.restype = [ctypes.c_long], ctypes.c_long
bars = door in ("pc", "ksp", "matis")
moves = door in ("attach", "ts")
scene = make("impact-grid" if moves else "truss-grid" if bars else "tensegrity-grid", modules=8, subdomains=4)
if "metis" in sys.argv:
    scene.subdomain = None
if "halves" in sys.argv:  # a row of bars whose places tell nothing: METIS makes them
    places = numpy.random.default_rng(1).permutation(300)[:, None]
    scene = Scene("row", places, numpy.arange(299)[:, None] + [0, 1], "bar", 1.0, fixed=places < 1)


def linear(structure, u):
    if door == "matis":
        structure.dm.setMatType("is")
    A, b = structure.dm.createMat(), u.duplicate()
    structure.jacobian(u, A)
    b.set(1.0)
    if door == "matis":
        A.compose("__PETSc_dm", None)  # it knows of no structure
    ksp = PETSc.KSP().create()
    ksp.setType("latin" if door == "ksp" else "cg")
    ksp.getPC().setType("none" if door == "ksp" else "latin")
    ksp.setOperators(A)
    ksp.setFromOptions()
    y = u.duplicate()  # PETSc's own vectors are there before the failure
    fail_from(at)
    if door == "ksp":
        ksp.setUp()
        ksp.solve(b, u)
    else:
        ksp.getPC().setUp()
        ksp.getPC().apply(b, y)


def motion(structure):
    if door == "attach":
        ts = PETSc.TS().create()
        fail_from(at)
        return structure.attach(ts)
    ts = structure.create_ts()
    u, v = ts.getSolution2()
    ts.setTimeStep(1e-3)
    ts.setMaxSteps(3)
    ts.setFromOptions()
    ts.setUp()
    ts.step()  # PETSc notes what is to be cited before anything is ours
    fail_from(at)
    ts.solve(u)


def static(structure, u):
    snes = structure.create_snes()
    snes.setFromOptions()
    if door == "snes":
        fail_from(10**9)
        u.duplicate()
        own = fail_from(0)  # SNESSolve() duplicates u before anything is ours
        fail_from(at and own + at)
    snes.solve(None, u)
    if door == "digits":
        u.duplicate(), u.duplicate()
        fail_from(at)
        latinpc.digits(snes)


try:
    if door == "links":
        fail_from(at)
    structure = latinpc.Structure.from_scene(scene)
    count = fail_from(0) if door == "links" else 0  # vectors are made by PETSc
    u = structure.create_vec()
    if bars:
        linear(structure, u)
    elif moves:
        motion(structure)
    elif door == "results":
        J = structure.dm.createMat()
        fail_from(at)
        structure.jacobian(u, J)
        structure.energy(u), structure.errors(u, u), structure.tensions(u), structure.displacements(u)
    elif door in ("snes", "digits"):
        static(structure, u)
    print(f"solved after {count or fail_from(0)} allocations\\n", end="", flush=True)
except PETSc.Error as error:
    print(f"error {error.ierr}: {latinpc.error_message(error)}\\n", end="", flush=True)
"""
MEMORY, LIBRARY = 55, 76  # PETSc's codes


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    path = tmp_path_factory.mktemp("program") / "solve.py"
    path.write_text(PROGRAM)
    return path


@pytest.fixture
def solve(program, compile_c):
    """Solve on two ranks, of which `rank` fails alone: in what is named, or at that allocation."""
    shim = compile_c("fail_alone.c", "-shared", "-fPIC", "-lmetis", "-ldl")

    def launch(rank, what="", *options, at=0, door="snes"):
        env = {"LD_PRELOAD": str(shim), "LATINPC_FAIL_RANK": str(rank), "LATINPC_FAIL": what}
        return run(
            ["mpirun", "-n", 2, sys.executable, program, door, at, what, *options],
            env=env,
            check=False,
            timeout=120,
            leaks=False,
        )

    return launch


@pytest.mark.parametrize(
    ("what", "rank", "door", "message"),
    [
        ("metis", 0, "snes", "METIS could not partition 1024 links into"),
        ("halves", 0, "snes", "METIS could not partition 299 links into 2 subdomains"),
        ("gesvd", 1, "snes", "LAPACK gesvd failed on the modes of an interface"),
        ("local", 1, "snes", "Setting up the local solver failed"),
        ("local", 1, "ksp", "Setting up the local solver failed"),
        ("local", 0, "matis", "Setting up the local solver failed"),
        pytest.param("local", 0, "pc", "Setting up the local solver failed", marks=pytest.mark.slow),
        pytest.param("local", 1, "ts", "Setting up the local solver failed", marks=pytest.mark.slow),
    ],
)
def test_every_rank_raises_what_one_has_met(solve, what, rank, door, message):
    more = {
        "gesvd": ["-snes_latin_variant", "corner"],
        "metis": ["-snes_latin_subdomains", "5"],
    }  # the former has macro modes
    result = solve(rank, what, *more.get(what, []), door=door)
    said = re.findall(r"^error (\d+): (.*)$", result.stdout, re.MULTILINE)
    assert [int(code) for code, _ in said] == 2 * [LIBRARY], result.stdout + result.stderr
    assert all(message in sentence for _, sentence in said), said
    assert result.returncode == 0


def ended(result):
    return (
        result.returncode != 0
        and "latin: error on one rank while the others wait in a collective call" in result.stderr
    )


@pytest.mark.parametrize(
    "door", ["snes", *(pytest.param(door, marks=pytest.mark.slow) for door in ("pc", "ksp", "matis", "ts"))]
)
def test_a_failure_inside_a_collective_call_ends_the_program(solve, door):
    family = {"matis": "pc", "ts": "snes"}.get(door, door)
    result = solve(1, "coarse", f"-{family}_latin_coarse_pc_type", "cholesky", door=door)  # all ranks at one factor
    assert ended(result)
    assert "the coarse factorisation fails" in result.stderr


@pytest.mark.slow
@pytest.mark.parametrize("door", ["links", "results", "snes", "digits", "pc", "ksp", "matis", "attach", "ts"])
@pytest.mark.parametrize("rank", [0, 1])
def test_memory_that_runs_out_on_one_rank_is_no_deadlock(solve, door, rank):
    solved = solve(rank, at=10**9, door=door)
    counts = [int(n) for n in re.findall(r"solved after (\d+) allocations", solved.stdout)]
    assert len(counts) == 2 and max(counts) > 50, solved.stdout + solved.stderr
    for part in (0.0, 0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 0.98):
        result = solve(rank, at=1 + int(part * max(counts)), door=door)
        said = re.findall(r"^error (\d+)", result.stdout, re.MULTILINE)
        # the header of an object gives no code of its own
        assert ended(result) or said in (2 * [str(MEMORY)], 2 * ["1"]), (part, result.stdout, result.stderr)


MONITOR = """
import petsc4py
petsc4py.init()
from petsc4py import PETSc
import latinpc
from latinpc.scenes import make

snes = latinpc.Structure.from_scene(make("tensegrity-grid", modules=8, subdomains=4)).create_snes()
def fail(snes, its, norm):
    if its == 1 and PETSc.COMM_WORLD.rank == 0:
        raise ValueError("mine")
snes.setMonitor(fail)
snes.solve(None, snes.getDM().createGlobalVec())
"""


def test_an_exception_of_one_rank_is_named(mpirun):
    """Its text is lost with the rank, its kind is not; newer PETSc has a name for it."""
    result = mpirun(2, MONITOR, alone=True, check=False, leaks=False, timeout=120)
    assert ended(result) and re.search("Unhandled Python Exception|exception in a Python function", result.stderr)


@pytest.mark.parametrize("on", [-1, 1])
@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ("dimension", "A structure has 1, 2 or 3 dimensions, not 7"),
        ("apart", "A rank gives 2 dimensions, and the first rank 1"),
        ("link", "joins node"),
        ("k", "has stiffness -1"),
        ("elongation", "initial elongation that is not a finite number"),
        ("types", "needs a law, but the array is NULL"),
        ("force", "needs a load, but the array is NULL"),
        ("save", "The state no/such/folder/state cannot be written"),
        ("note", "The note of a state has -3 bytes: give its length, 0 for none"),
        ("read", "The state no such state cannot be read"),
    ],
)
def test_an_error_of_all_ranks_ends_a_c_program_at_once(compile_c, wrong, said, on):
    """With PETSc's traceback of the first rank, its handler lets the other ranks sleep ten seconds."""
    program = compile_c("wrong_on_ranks.c", *LINKED)
    start = time.monotonic()
    result = run(
        ["mpirun", "-n", 2, program, "-wrong", wrong, "-on", str(on)], check=False, timeout=60, leaks=False, env={}
    )
    assert time.monotonic() - start < 8.0
    assert result.returncode != 0
    assert said in result.stderr and "main() at" in result.stderr
    assert "on one rank while the others wait" not in result.stderr


def test_the_program_without_a_mistake(compile_c, mpirun):
    program = compile_c("wrong_on_ranks.c", *LINKED)
    assert "nothing is wrong" in mpirun(2, program).stdout
