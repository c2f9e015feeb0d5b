"""The same again: the same bits on one rank, and no more memory."""

import re

import pytest

BITS = """
import hashlib
import sys
import petsc4py
petsc4py.init(sys.argv)
from petsc4py import PETSc
import latinpc
from latinpc.scenes import make

structure = latinpc.Structure.from_scene(make("network", nodes=300, subdomains=9))
snes = structure.create_snes()
snes.setFromOptions()
u = structure.create_vec()
snes.solve(None, u)
whole = structure.displacements(u).tobytes() + latinpc.history(snes)["indicator"].tobytes()
PETSc.Sys.Print(snes.getIterationNumber(), hashlib.sha256(whole).hexdigest())
"""

LIVES = """
import sys
import petsc4py
petsc4py.init(sys.argv)
from petsc4py import PETSc
import latinpc
from latinpc.scenes import make

structure = latinpc.Structure.from_scene(make("tensegrity-grid", modules=4, subdomains=4))
u, b = structure.create_vec(), structure.create_vec()
b.set(1.0)
A = structure.dm.createMat()
structure.jacobian(u, A)
moving = latinpc.Structure.from_scene(make("impact-grid", modules=4, subdomains=4))


def live():
    snes = structure.create_snes()
    snes.setFromOptions()
    snes.setUp()
    snes.solve(None, u)
    snes.reset()
    snes.setUp()
    snes.destroy()
    for outer, inner in (("cg", "latin"), ("latin", "none")):
        ksp = PETSc.KSP().create()
        ksp.setType(outer)
        ksp.getPC().setType(inner)
        ksp.setOperators(A)
        ksp.setUp()
        ksp.solve(b, u)
        ksp.reset()
        ksp.destroy()
    ts = moving.create_ts()
    ts.setTimeStep(1e-4)
    ts.setMaxSteps(1)
    ts.setUp()
    ts.solve(ts.getSolution2()[0])
    ts.reset()
    ts.destroy()


def pages():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1])


for life in range(1001):
    if life in (200, 600, 1000):
        print(f"pages {life} {pages()}\\n", end="", flush=True)  # in one piece
    live()
"""


def test_the_same_input_gives_the_same_bits_on_one_rank(mpirun):
    first, second = (mpirun(1, BITS).stdout for _ in range(2))
    assert first == second and first


@pytest.mark.slow
@pytest.mark.timeout(1000)
@pytest.mark.parametrize("ranks", [1, 2])
def test_a_thousand_lives_leave_nothing_behind(mpirun, ranks):
    result = mpirun(ranks, LIVES, timeout=900)
    pages = {life: [int(n) for n in re.findall(rf"pages {life} (\d+)", result.stdout)] for life in (200, 600, 1000)}
    assert all(len(counts) == ranks for counts in pages.values())
    # 400 lives: a leak of a kilobyte each would be 100 pages
    for count in range(ranks):
        growth = sorted(pages[1000])[count] - sorted(pages[600])[count]
        assert growth < 100, pages
