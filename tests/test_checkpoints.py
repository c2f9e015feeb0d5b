"""Checkpoints of the command line: a run that is killed or interrupted goes on to the bit."""

import contextlib
import json
import os
import random
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from conftest import environment, run
from petsc4py import PETSc
from support import STATES

import latinpc
from latinpc.runs.checkpoint import Keeper
from latinpc.runs.motion import move
from latinpc.scenes import make

LONG = {
    "ramp": ["tensegrity-grid", "--modules", 8, "--subdomains", 4, "--increments", 60],
    "motion": ["impact-grid", "--modules", 8, "--num-steps", 200],
}
NEVER_THE_SAME = ("seconds", "first_step_seconds", "setup_seconds", "solve_seconds", "peak_memory_bytes", "cost")


def launch(*words, ranks=1):
    words = [sys.executable, "-c", "from latinpc.cli import main; main()", "solve", *map(str, words)]
    return (["mpirun", "-n", str(ranks)] if ranks > 1 else []) + words


def result(folder, words, name, ranks=1):
    """Displacements and tensions as written, and the report without what no two runs have in common."""
    run([*launch(*words, "--quiet", "--output", f"{name}.vtu", "--json", f"{name}.json", ranks=ranks)], cwd=folder)
    report = json.loads((folder / f"{name}.json").read_text())
    return (folder / f"{name}.vtu").read_bytes(), {k: v for k, v in report.items() if k not in NEVER_THE_SAME}


def begin(folder, words, ranks=1, file="state"):
    """Start a run that keeps its state; wait for the first one."""
    words = launch(*words, "--quiet", "--checkpoint", file, ranks=ranks)
    state = folder / file
    before = state.stat().st_mtime_ns if state.exists() else 0
    process = subprocess.Popen(
        words, cwd=folder, env=environment(), stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    deadline = time.monotonic() + 60
    while not state.exists() or state.stat().st_mtime_ns == before:
        assert time.monotonic() < deadline
        if process.poll() is not None:
            break
        time.sleep(0.001)
    return process


def killed(folder, words, times, ranks, seed, file="state"):
    """Kill a run at random moments, go on each time, and return its result."""
    rng, restart = random.Random(seed), []
    for _ in range(times):
        process = begin(folder, [*words, *restart], ranks, file)
        time.sleep(rng.random() * 0.3)
        with contextlib.suppress(ProcessLookupError):  # it has been quicker
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        restart = ["--restart", file]
    return result(folder, [*words, *restart], "pieces", ranks)


@pytest.mark.slow
@pytest.mark.parametrize("kind", LONG)
def test_a_run_that_is_killed_goes_on_to_the_bit(kind, tmp_path):
    assert killed(tmp_path, LONG[kind], 2, 1, 0) == result(tmp_path, LONG[kind], "whole")


@pytest.mark.slow
@pytest.mark.parametrize("file", STATES)
@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("kind", LONG)
def test_a_run_that_is_killed_often_goes_on_to_the_bit(kind, ranks, file, tmp_path):
    whole = result(
        tmp_path, [*LONG[kind], "--checkpoint", "whole.state"], "whole", ranks
    )  # with the options of such a run
    for seed in range(4):
        (tmp_path / file).unlink(missing_ok=True)
        assert killed(tmp_path, LONG[kind], 5, ranks, seed, file) == whole, seed


@pytest.mark.parametrize(
    ("number", "code"), [pytest.param(signal.SIGINT, 130, marks=pytest.mark.slow), (signal.SIGTERM, 143)]
)
def test_an_interrupted_run_says_where_its_state_is(number, code, tmp_path):
    process = begin(tmp_path, LONG["motion"])
    process.send_signal(number)
    said = process.communicate(timeout=60)[1]
    assert process.returncode == code, said
    assert "continue with --restart state" in said
    assert result(tmp_path, [*LONG["motion"], "--restart", "state"], "end")[1]["steps"] == 200


@pytest.mark.slow  # mpirun leaves its ranks a second to say it, which a busy machine may not give them
def test_a_run_on_two_ranks_says_where_its_state_is(tmp_path):
    process = begin(tmp_path, [*LONG["motion"][:-1], 10**6], 2)  # mpirun takes its time to pass the signal on
    try:
        process.send_signal(signal.SIGTERM)
        said = process.communicate(timeout=60)[1]
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode
    assert "continue with --restart state" in said


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["lattice", "--checkpoint", "s"], "need --increments or --num-steps"),
        (["lattice", "--restart", "s"], "need --increments or --num-steps"),
        (["lattice", "--increments", 2, "--num-steps", 2], "--increments is for statics"),
        (["lattice", "--increments", 2, "--checkpoint-every", 2], "needs the name of a file"),
        (["lattice", "--increments", 2, "--checkpoint", "s", "--checkpoint-every", 0], "at least 1, not 0"),
        (["lattice", "--increments", 0], "at least one increment"),
        (["lattice", "--increments", 2, "--checkpoint", "nowhere/s"], "does not exist"),
        (["lattice", "--increments", 2, "--restart", "nothing"], "No such file"),
        (["lattice", "--increments", 3, "--restart", "state"], "number of increments differs"),
        (["lattice", "--nx", 12, "--increments", 2, "--restart", "state"], "another structure"),
    ],
)
def test_misuse_on_the_command_line(words, sentence, tmp_path, capsys, monkeypatch):
    from latinpc.cli import main

    def call(words):
        with pytest.raises(SystemExit) as end:
            main(["solve", *map(str, words), "--quiet"])
        return end.value.code

    monkeypatch.chdir(tmp_path)
    if "state" in words:
        assert call(["lattice", "--increments", 2, "--checkpoint", "state"]) == 0
    assert call(words) == 2
    assert sentence in " ".join(capsys.readouterr().err.split())


def test_a_table_with_other_points_is_another_structure(tmp_path):
    """Two programs give their first table the same number: a run does not go on with other tensions."""
    (tmp_path / "rod").mkdir()
    (tmp_path / "rod/nodes.csv").write_text("x,fix,Fx\n0,x,\n1,,2\n")
    (tmp_path / "rod/members.csv").write_text("start,end,group\n1,2,spring\n")

    def solve(last, *words):
        table = f"[[0.0, 0.0], [1.0, 5.0], [2.0, {last}]]"
        (tmp_path / "rod.toml").write_text(f'[laws.spring]\nlaw = "table"\ntable = {table}\n')
        call = launch("rod", "--increments", 2, *words)
        return subprocess.run(call, cwd=tmp_path, env=environment(), capture_output=True, text=True, check=False)

    assert solve(6.0, "--checkpoint", "state").returncode == 0
    assert solve(6.0, "--restart", "state").returncode == 0
    changed = solve(7.0, "--restart", "state")
    assert changed.returncode == 2
    assert "another structure" in " ".join(changed.stderr.split())


@pytest.mark.parametrize("note", [b"", b"[1]", b"{}", b"\xff", b'{"about": 1, "number": 2, "past": {}}'])
def test_states_of_other_programs_are_no_checkpoints(note, tmp_path):
    structure = latinpc.Structure([[0.0], [1.0]], [[0, 1]], "bar", 1.0, fixed=[[1], [0]], load=[[0], [1e-3]])
    snes, u, path = structure.create_snes(), structure.create_vec(), tmp_path / "state"
    snes.solve(None, u)
    latinpc.save_state(snes, path, u, note)
    with pytest.raises(ValueError, match="state is not a checkpoint of latinpc solve"):
        Keeper(structure.comm.tompi4py(), restart=path).resume(snes, u)


def test_a_motion_without_a_step_left(tmp_path):
    """A state beyond the steps or the time asked for is an error, one at their end is said: both passed unnoticed."""
    chain, state = make("bouncing-chain", links=4), tmp_path / "state"
    whole = move(chain, 6, every=0, keeper=Keeper(PETSc.COMM_WORLD.tompi4py(), state))

    def again(steps, options=None):
        return move(chain, steps, options=options, every=0, keeper=Keeper(PETSc.COMM_WORLD.tompi4py(), restart=state))

    for options in (None, {"ts_max_time": 6e-3}):
        over = again(6 if options is None else 9, options)
        assert over.notices == ["no step is left: the state is that after step 6, the last one"]
        assert np.array_equal(over.frames[-1].displacements, whole.frames[-1].displacements)
    with pytest.raises(ValueError, match=r"after step 6, and the motion has 4 in all: .*--num-steps"):
        again(4)
    with pytest.raises(ValueError, match=r"from 0\.006 s to 0\.004 s has no step: check -ts_max_time"):
        again(9, {"ts_max_time": 4e-3})
    assert not again(7).notices
