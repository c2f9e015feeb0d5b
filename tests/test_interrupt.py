"""Signals during a solve: Ctrl-C ends it, and the structure solves again as if nothing had been."""

import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from petsc4py import PETSc

import latinpc

NEWTON = {"snes_type": "newtonls", "ksp_type": "preonly", "pc_type": "cholesky"}
SCENES = {
    "linear stages": ("net", {"side": 24, "law": "cable"}, {"snes_latin_newton": "never"}),
    "interior-point method": ("net", {"side": 40}, {}),
    "Newton's method": ("tensegrity-grid", {"modules": 16}, NEWTON),
    "large displacements": ("saddle", {"side": 60}, {}),
    "a path with descents": ("mast", {"wind": 2000.0}, {}),
}


class Stop(Exception):
    pass


def stop(*_):
    raise Stop


@pytest.fixture
def alarm():
    """A function that lets a signal come after some seconds."""
    before = signal.signal(signal.SIGALRM, stop)
    yield lambda seconds: signal.setitimer(signal.ITIMER_REAL, seconds)
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    signal.signal(signal.SIGALRM, before)


@pytest.mark.filterwarnings("ignore::latinpc.LatinWarning")
@pytest.mark.parametrize("name", SCENES)
def test_a_signal_at_any_time_ends_a_solve_and_changes_no_later_one(name, alarm):
    scene, parameters, options = SCENES[name]
    structure = latinpc.Structure.from_scene(latinpc.scenes.make(scene, **parameters), comm=PETSc.COMM_SELF)
    start = time.perf_counter()
    first = structure.solve(options=options)
    whole = time.perf_counter() - start
    ended = 0
    for part in np.linspace(0.02, 0.9, 8):
        alarm(part * whole)
        try:
            structure.solve(options=options)
        except Stop:
            ended += 1
        alarm(0.0)
        again = structure.solve(options=options)
        assert again.iterations == first.iterations and (again.displacements == first.displacements).all()
    assert ended >= 4


def test_a_function_in_c_is_called_while_a_solve_lasts():
    """Without it the signal waits for the end of the solve."""
    code = (
        "import signal, sys, time, latinpc\n"
        "structure = latinpc.Structure.from_scene(latinpc.scenes.make('net', side=100))\n"
        "print('ready', flush=True)\n"
        "try:\n"
        "    structure.solve()\n"
        "except KeyboardInterrupt:\n"
        "    print('interrupted')\n"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "ready\n"
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        assert process.stdout.read() == "interrupted\n"
