"""A failure of one rank alone ends in an error on all ranks, or ends the program: within seconds, no deadlock."""

import re
import sys

import pytest
from conftest import run

PROGRAM = """
import ctypes
import sys
import petsc4py
petsc4py.init(sys.argv)
from petsc4py import PETSc
import latinpc
from latinpc.scenes import make

fail_from = ctypes.CDLL(None).FailFrom
fail_from.argtypes, fail_from.restype = [ctypes.c_long], ctypes.c_long
scene = make("tensegrity-grid", modules=8, subdomains=4)
if "metis" in sys.argv:
    scene.subdomain = None
links = latinpc.Links.from_scene(scene)
snes = links.create_snes()
snes.setFromOptions()
u = links.create_vec()
fail_from(int(sys.argv[1]))
try:
    snes.solve(None, u)
    print(f"solved after {fail_from(0)} allocations\\n", end="", flush=True)
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

    def launch(rank, what="", at=0, ranks=2):
        env = {"LD_PRELOAD": str(shim), "LATINPC_FAIL_RANK": str(rank), "LATINPC_FAIL": what}
        return run(["mpirun", "-n", ranks, sys.executable, program, at, what], env=env, check=False, timeout=60)

    return launch


@pytest.mark.parametrize(
    ("what", "rank", "message"),
    [
        ("metis", 0, "METIS could not partition 1024 links into"),
        ("gesvd", 1, "LAPACK gesvd failed on the modes of an interface"),
        ("local", 1, "a local factorisation fails"),
    ],
)
def test_every_rank_raises_what_one_has_met(solve, what, rank, message):
    result = solve(rank, what)
    said = re.findall(r"^error (\d+): (.*)$", result.stdout, re.MULTILINE)
    assert [int(code) for code, _ in said] == 2 * [LIBRARY], result.stdout + result.stderr
    assert all(message in sentence for _, sentence in said)
    assert result.returncode == 0


def ended(result):
    return result.returncode != 0 and "latin: an error of one rank, and the others wait for it" in result.stderr


def test_a_failure_inside_a_collective_call_ends_the_program(solve):
    result = solve(1, "coarse")
    assert ended(result)
    assert "the coarse factorisation fails" in result.stderr


@pytest.mark.slow
def test_memory_that_runs_out_on_one_rank_is_no_deadlock(solve):
    solved = solve(1, at=10**9)
    count = max(int(n) for n in re.findall(r"solved after (\d+) allocations", solved.stdout))
    assert count > 1000
    for part in (0.0, 0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 0.98):
        result = solve(1, at=1 + int(part * count))
        said = re.findall(r"^error (\d+)", result.stdout, re.MULTILINE)
        assert ended(result) or said == 2 * [str(MEMORY)], (part, result.stdout, result.stderr)
