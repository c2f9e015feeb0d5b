"""The same input, options and ranks give the same bits twice."""

import json
from pathlib import Path

import pytest

PROGRAM = """
import hashlib
import json
import random
import sys
import time
import petsc4py
petsc4py.init(sys.argv[:1] + ["-skip_petscrc"])
from petsc4py import PETSc
sys.path.insert(0, sys.argv[1])
import latinpc
from latinpc.scenes import make
from latinpc.options import default_options
from support import grid, irregular, lattice, network

CASES = {
    "grid": (grid, {}),
    "irregular": (irregular, {}),
    "metis": (lambda: make("lattice", nx=12, ny=6, partition="metis"), {"subdomains": 7, "modes_local": 0.5}),
    "network": (network, {"variant": "macro", "stop": "error"}),
    "newton": (irregular, {"stop": "error"}),
    "rigid": (lambda: make("net", side=8), {}),
    "friction": (lambda: make("packing", law="friction", side=24), {}),
}
world = PETSc.COMM_WORLD.tompi4py()
order = random.Random(world.rank)  # ranks are late in another order each time


def bits(scene, options):
    with default_options({f"snes_latin_{key}": value for key, value in options.items()}):
        structure = latinpc.Structure.from_scene(scene)
        snes = structure.create_snes()
        snes.setFromOptions()
        u = structure.create_vec()
        late = order.random() * 0.002
        snes.setMonitor(lambda *_: time.sleep(late))
        time.sleep(late)
        snes.solve(None, u)
        assert snes.getConvergedReason() > 0
        found = hashlib.sha256(u.getArray().tobytes() + latinpc.history(snes)["indicator"].tobytes())
        snes.destroy()
        return "".join(world.allgather(found.hexdigest()))


found = {}
for name, (scene, options) in CASES.items():
    options = options | (dict.fromkeys(("coarse_pc_type", "friction_pc_type"), "redundant") if world.size > 1 else {})
    found[name] = len({bits(scene(), options) for _ in range(int(sys.argv[2]))})
if world.rank == 0:
    print(json.dumps(found))
"""


@pytest.mark.parametrize(("ranks", "times"), [(1, 2), (3, 3)])
def test_the_same_bits_twice(mpirun, ranks, times):
    """On several ranks with a coarse problem that every rank solves: MUMPS adds what arrives first."""
    found = json.loads(mpirun(ranks, PROGRAM, Path(__file__).parent, times).stdout)
    assert set(found.values()) == {1}, found


@pytest.mark.slow
@pytest.mark.parametrize("ranks", [2, 3, 4, 7])
def test_the_same_bits_many_times(mpirun, ranks):
    found = json.loads(mpirun(ranks, PROGRAM, Path(__file__).parent, 20, timeout=600).stdout)
    assert set(found.values()) == {1}, found
