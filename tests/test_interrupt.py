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
    """What the handler of a signal raises."""


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
            alarm(0.0)
        except Stop:
            ended += 1
        again = structure.solve(options=options)
        assert again.iterations == first.iterations and (again.displacements == first.displacements).all()
    assert ended >= 2  # a first solve takes longer than others, and a busy machine comes late


@pytest.mark.parametrize("program", ["solve", "motion"])
def test_ctrl_c_ends_a_command_at_once(program, tmp_path):
    scene = {"solve": ("net", "--side", "250"), "motion": ("impact-grid", "--num-steps", "100000")}[program]
    command = [sys.executable, "-m", "latinpc", "solve", *scene]
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    # a shell may start the tests with Ctrl-C ignored, which they would inherit
    hears = {"preexec_fn": lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)}
    with subprocess.Popen(command, cwd=tmp_path, **streams, **hears) as process:
        time.sleep(4.0)  # imports take one second, the command more than ten
        process.send_signal(signal.SIGINT)
        start = time.perf_counter()
        try:
            _, said = process.communicate(timeout=60.0)
        finally:
            process.kill()
    assert process.returncode == 130 and said.endswith("latinpc: interrupted\n")
    assert time.perf_counter() - start < 5.0


def test_what_later_versions_of_petsc4py_wrap_is_raised():
    with pytest.raises(Stop):
        try:
            raise PETSc.Error(101) from Stop()
        except PETSc.Error as error:
            latinpc.error_message(error)


def test_ctrl_c_ends_a_solver_of_petsc4py():
    """It is the cause of an error of PETSc's in later versions of petsc4py."""
    structure = latinpc.Structure.from_scene(latinpc.scenes.make("net", side=40), comm=PETSc.COMM_SELF)
    snes, u = structure.create_snes(), structure.create_vec()
    snes.setFromOptions()
    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, 0.05)
    try:
        with pytest.raises((Stop, PETSc.Error)) as raised:
            snes.solve(None, u)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    assert Stop in (raised.type, type(raised.value.__cause__))
    snes.destroy()
