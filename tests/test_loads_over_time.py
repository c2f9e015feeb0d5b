"""Motions from equilibrium, and under actions that vary with time: `--from-equilibrium`, `--history`."""

import json
from dataclasses import replace

import numpy as np
import pytest
from command import latinpc, said
from motions import message, one_mass

from latinpc import Case, SolveError
from latinpc.files.history import read_history
from latinpc.runs.history import History
from latinpc.runs.motion import move
from latinpc.scenes import make

LARGE = {"snes_latin_geometry": "large"}
ALPHA = {"ts_type": "alpha2", "snes_type": "newtonls"}
STEPS = ["--num-steps", 20, "--time-step", 1e-3, "--node-mass", 10]
LATTICE = ["lattice", "--nx", 6, "--ny", 3]


@pytest.mark.parametrize("options", [{}, LARGE, ALPHA])
@pytest.mark.parametrize("name", ["lattice", "hypar"])
def test_a_motion_from_equilibrium_stays_there(name, options):
    if name == "hypar" and options == ALPHA:
        options = options | LARGE
    scene = make(name)
    shaken = move(scene, 20, 1e-3, options, mass=10.0)
    still = move(scene, 20, 1e-3, options, mass=10.0, from_equilibrium=True)
    assert still.converged and still.report["from_equilibrium"] and not shaken.report["from_equilibrium"]
    assert np.abs(still.frames[0].displacements).max() > 1e-3 * np.abs(shaken.frames[-1].displacements).max()
    assert max(still.report["kinetic_energy"]) < 1e-10 * max(shaken.report["kinetic_energy"])


def test_no_equilibrium_no_start():
    """A mass that flies has none; one that is not found within the iterations is none either."""
    assert "mechanism" in message(lambda: move(make("impact-grid", modules=4), 2, from_equilibrium=True))
    once = {"snes_max_it": 1, "snes_latin_newton": "never"}
    with pytest.raises(SolveError, match="no equilibrium has been found to start from: .*DIVERGED_MAX_IT"):
        move(make("hypar"), 2, 1e-3, once, mass=1.0, from_equilibrium=True)


def ramp(what):
    """A mass on a spring, and what grows from 0 to F, s or -e in a second; then w = 10/s, and the spring gives F/k."""
    scene = replace(one_mass(stiffness=100.0, mass=1.0, load=1.0 if what == "load" else 0.0), velocity=None)
    case = {
        "load": None,
        "case": Case("pull", load=[[0.0], [1.0]]),
        "support": Case("move", prescribed=[[0.01], [0.0]]),
        "warm": Case("warm", initial_elongation=[-0.01]),
    }[what]
    return scene, History([0.0, 1.0], [0.0, 1.0], case)


@pytest.mark.parametrize("what", ["load", "case", "support", "warm"])
@pytest.mark.parametrize(("options", "order"), [({}, 1), (LARGE, 2), (ALPHA, 2)])
def test_a_ramp_has_the_closed_form_with_the_order_of_the_scheme(what, options, order):
    scene, history = ramp(what)
    w, errors = 10.0, []
    for steps in (200, 400):
        last = move(scene, steps, 1.0 / steps, options, history=history).frames[-1]
        errors.append(abs(last.displacements[1, 0] - 0.01 * (1.0 - np.sin(w) / w)))
        if what == "support":
            assert last.displacements[0, 0] == pytest.approx(0.01)
    assert errors[0] / errors[1] == pytest.approx(2.0**order, rel=0.1)
    assert errors[1] < (2e-4 if order == 1 else 1e-6)


@pytest.mark.parametrize("options", [{}, LARGE, ALPHA])
def test_supports_that_move_have_their_velocity(options):
    """Driven at 1 cm/s for half of the time, then held."""
    scene, _ = ramp("support")
    history = History([0.0, 1.0], [0.0, 1.0], Case("move", prescribed=[[0.01], [0.0]]))
    frames = move(scene, 4, 0.5, options, every=1, history=history).frames
    assert [frame.velocities[0, 0] for frame in frames] == pytest.approx([0.0, 0.01, 0.01, 0.0, 0.0])


def test_a_step_that_fails_leaves_the_supports_where_they_were():
    scene = make("lattice", nx=6, ny=3)
    history = History([0.0, 1.0], [0.0, 1.0], Case("move", prescribed=0.01 * scene.fixed))
    early = {"snes_max_it": 1, "snes_latin_newton": "never"}
    motion = move(scene, 4, 0.5, early, mass=1.0, every=0, history=history)
    assert not motion.converged
    for values in (motion.frames[-1].displacements, motion.frames[-1].velocities):
        assert not values[scene.fixed].any()


def test_factors_stay_before_the_first_time_and_after_the_last():
    history = History([1.0, 2.0], [0.5, 3.0])
    assert [history.factor(time) for time in (0.0, 1.5, 9.0)] == [0.5, 1.75, 3.0]
    scene = replace(one_mass(load=1.0), velocity=None)
    still = move(scene, 5, 1e-2, from_equilibrium=True, history=History([1.0, 2.0], [0.5, 3.0]))
    assert still.frames[-1].displacements[1, 0] == pytest.approx(0.5 / 100.0)


CASES = """
[[case]]
name = "dead"
[case.loads.all]
force = [0.0, 0.0, -100.0]
[[case]]
name = "gust"
[case.loads.all]
force = [50.0, 0.0, 0.0]
[case.settlements.feet]
where = "z=0"
displacement = [1e-4, 0.0, 0.0]
"""


def write(folder):
    (folder / "nodes.csv").write_text(
        "x,y,z,fix,Fz,mass\n0,0,0,xyz,0,0\n1,0,0,xyz,0,0\n0,1,0,xyz,0,0\n0.3,0.3,1,,-200,50\n"
    )
    (folder / "members.csv").write_text("start,end,EA\n1,4,1e5\n2,4,1e5\n3,4,1e5\n")
    (folder.with_suffix(".toml")).write_text(CASES)
    (folder.parent / "h.csv").write_text("# gust\ntime [ms],factor\n0,0\n10,1\n20,0\n")


def reported(folder, *words, ranks=1):
    latinpc("solve", *words, "--quiet", "--json", "r.json", cwd=folder, ranks=ranks)
    return json.loads((folder / "r.json").read_text())


@pytest.mark.parametrize("ranks", [1, 2])
def test_command_varies_a_case_and_goes_on_from_a_checkpoint(tmp_path, ranks):
    """What stands outside of the case stays: with the case at rest, the start is that of the loads of the file."""
    (tmp_path / "tripod").mkdir()
    write(tmp_path / "tripod")
    words = ["tripod", "--case", "gust", "--history", "h.csv", "--from-equilibrium", "--time-step", 1e-3]
    whole = reported(tmp_path, *words, "--num-steps", 20, ranks=ranks)
    assert whole["history"] == [[0.0, 0.01, 0.02], [0.0, 1.0, 0.0]] and whole["from_equilibrium"]
    assert whole["kinetic_energy"][0] == 0.0 and max(whole["kinetic_energy"]) > 0.0
    reported(tmp_path, *words, "--num-steps", 7, "--checkpoint", "state", ranks=ranks)
    again = reported(tmp_path, *words, "--num-steps", 20, "--restart", "state", ranks=ranks)
    assert again["kinetic_energy"] == whole["kinetic_energy"]
    drawn = [word for word in words if word != "--from-equilibrium"]
    refused = latinpc("solve", *drawn, "--num-steps", 20, "--restart", "state", cwd=tmp_path, ranks=ranks, code=2)
    assert "start from equilibrium differs" in said(refused)[0]
    (tmp_path / "h.csv").write_text("time,factor\n0,0\n")
    refused = latinpc("solve", *words, "--num-steps", 20, "--restart", "state", cwd=tmp_path, ranks=ranks, code=2)
    assert "history of loads differs" in said(refused)[0]
    still = reported(tmp_path, *words, "--num-steps", 20, ranks=ranks)
    assert max(still["kinetic_energy"]) < 1e-12 * max(whole["kinetic_energy"])


def test_command_starts_a_scene_from_equilibrium(tmp_path):
    shaken, still = (reported(tmp_path, *LATTICE, *STEPS, *more) for more in ([], ["--from-equilibrium"]))
    assert max(still["kinetic_energy"]) < 1e-10 * max(shaken["kinetic_energy"])


def test_command_refuses(tmp_path):
    (tmp_path / "tripod").mkdir()
    write(tmp_path / "tripod")
    for words, expected in (
        ([*LATTICE, "--from-equilibrium"], "--from-equilibrium is for a motion"),
        ([*LATTICE, "--history", "h.csv"], "--history is for a motion"),
        ([*LATTICE, *STEPS, "--history", "none.csv"], "none.csv: no such file"),
        ([*LATTICE, *STEPS, "--history", "h.csv", "-ts_max_snes_failures", -1], "-ts_max_snes_failures repeats steps"),
        (["tripod", "--num-steps", 2, "--time-step", 1, "--history", "h.csv", "--case", "gusts"], "do you mean 'gust'"),
        (["bouncing-chain", "--num-steps", 2, "--history", "h.csv", "--case", "gust"], "--case gust"),
    ):
        assert expected in said(latinpc("solve", *words, cwd=tmp_path, code=2))[0]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("time,factor\n0,1\n0,2\n", "line 3: time 0 s is not after 0 s"),
        ("time,factor\n0,\n", "line 2: factor is ''"),
        ("time,factor\n0,nan\n", "line 2: factor is 'nan'"),
        ("t,factor\n0,1\n", "unknown column 't'"),
        ("time,factor\n", "holds no row"),
    ],
)
def test_tables_that_are_wrong_name_the_line(tmp_path, text, words):
    (tmp_path / "h.csv").write_text(text)
    assert words in message(read_history, tmp_path / "h.csv")


def test_histories_that_are_wrong():
    assert "as many factors as times" in message(History, [0.0, 1.0], [1.0])
    assert "times must grow" in message(History, [0.0, 0.0], [1.0, 2.0])
    scene = replace(one_mass(), velocity=None)
    assert "no loads that could vary" in message(lambda: move(scene, 1, 1e-2, history=History([0.0], [1.0])))
