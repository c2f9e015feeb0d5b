"""Scenes in motion, their files and pictures, and `latinpc solve --num-steps`."""

import json
import xml.etree.ElementTree as ET
from dataclasses import replace

import meshio
import numpy as np
import oracle
import pytest
from motions import EXACT, motion
from petsc4py import PETSc
from PIL import Image
from test_cli import latinpc, said
from test_files import MSH, TOML

from latinpc.files import reading
from latinpc.runs.history import History
from latinpc.runs.motion import move
from latinpc.scenes import Case, Law, Scene, make

STEP = "-ts_time_step" if PETSc.Sys.getVersion() >= (3, 25) else "-ts_dt"
SMALL = {
    "impact-grid": {"modules": 8, "subdomains": 4},
    "impact-tower": {"levels": 6, "subdomains": 3},
    "bouncing-chain": {"links": 8, "subdomains": 2},
}


@pytest.mark.parametrize("name", SMALL)
def test_scenes_start_balanced_and_hold_together(name):
    """The self-stress is balanced; with the masses, every motion has inertia or stiffness."""
    scene = make(name, **SMALL[name])
    b, _ = oracle.kinematics(replace(scene, law=np.zeros_like(scene.law), stiffness=np.maximum(scene.stiffness, 1.0)))
    elastic = ~np.isin(scene.law, (Law.CONTACT, Law.COMPRESSION_ONLY))
    self_stress = np.where(elastic, scene.stiffness * scene.initial_elongation, 0.0)
    unbalance = (b.T @ self_stress)[~scene.fixed.ravel()]
    assert np.abs(unbalance).max() <= 1e-9 * max(np.abs(self_stress).max(), 1.0)
    assert (self_stress[scene.law == Law.CABLE] > 0).all()
    assert (scene.mass[~scene.fixed.all(axis=1)] > 0).all()
    assert json.loads(json.dumps(scene.metadata)) == scene.metadata


@pytest.mark.parametrize("name", ["impact-grid", "impact-tower"])
@pytest.mark.parametrize("contact", ["rigid", "elastic"])
def test_a_blow_is_felt_and_loses_energy(name, contact):
    """The mass flies, hits, and slows down; energy decreases all the way, the structure rings."""
    scene = make(name, **SMALL[name], contact=contact)
    with motion(scene, scene.time_step, snes_stol=1e-8, snes_max_it=3000) as it:
        energy, speeds = [it.energy], []
        for _ in range(40):
            it.step()
            energy.append(it.energy)
            speeds.append(it.v[-1, 2])
        assert (np.diff(energy) <= 1e-6 * energy[0]).all()
        assert speeds[0] == pytest.approx(-5.0) and speeds[-1] > -4.9
        assert np.abs(it.u[:-1]).max() > 1e-3


def test_the_chain_bounces():
    """It falls freely, no bar under force, lands when gravity says, and goes up again as a whole."""
    scene = make("bouncing-chain", **SMALL["bouncing-chain"])
    with motion(scene, 1e-3, **EXACT) as it:
        landing = int(np.sqrt(2 * 0.5 / 9.81) / 1e-3)
        it.step(landing - 2)
        assert np.abs(it.tensions).max() < 1e-6
        momentum, energy = [], []
        for _ in range(150):
            it.step()
            momentum.append((scene.mass[:, None] * it.v)[:, 1].sum())
            energy.append(it.energy)
        assert min(momentum) < 0 < max(momentum)
        assert (np.diff(energy) <= 1e-9 * abs(energy[0])).all()
        assert it.u[:, 1].min() > -0.5 - 1e-2  # the table is not passed by more than a step of the fall


def test_move_reports_what_happened():
    """Counts, energies and frames; the options decide what solves a step."""
    scene = make("impact-grid", **SMALL["impact-grid"], contact="elastic")
    result = move(scene, 12, every=5)
    report = result.report
    assert result.converged and report["reason"] == "CONVERGED_ITS" and report["steps"] == 12
    assert report["time"] == pytest.approx(12 * scene.time_step)
    assert len(report["iterations"]) == len(report["active"]) == 12
    assert len(report["kinetic_energy"]) == len(report["potential_energy"]) == 13
    assert [frame.step for frame in result.frames] == [0, 5, 10, 12]
    assert report["kinetic_energy"][0] == pytest.approx(0.5 * 200 * 25)
    newton = {"snes_type": "newtonls", "ksp_type": "preonly", "pc_type": "cholesky", "snes_rtol": 1e-10}
    other = move(scene, 12, options=newton, every=0)
    assert other.report["solver"] == "latin + newtonls + cholesky" and len(other.frames) == 1
    a, b = result.frames[-1].velocities, other.frames[-1].velocities
    assert np.abs(a - b).max() < 1e-3 * np.abs(b).max()


def test_move_refuses_what_cannot_move():
    """No masses, no length of a step, no steps."""
    grid = make("tensegrity-grid", modules=4)
    for arguments, words in (
        ((grid, 3), "no masses"),
        ((grid, 3, None, None), "no masses"),
        ((replace(grid, mass=np.ones(len(grid.nodes))), 3), "--time-step"),
        ((make("bouncing-chain"), 0), r"at least one step, not 0 \(--num-steps\)"),
        ((make("bouncing-chain"), 10.5), r"steps must be a whole number of steps, not 10\.5"),
        ((make("bouncing-chain"), 1, np.inf), "inf s; it must be positive and finite: change --time-step"),
        ((make("bouncing-chain"), 1, np.nan), "nan s; it must be positive and finite: change --time-step"),
    ):
        with pytest.raises(ValueError, match=words):
            move(*arguments)
    for every, words in ((2.5, "every must be a whole number"), (-1, "every is -1: every Nth state")):
        with pytest.raises(ValueError, match=words):
            move(make("bouncing-chain"), 3, every=every)


def test_nodes_without_mass_that_nothing_holds_are_named():
    """A load pushes one along its two slack cables; there had been a reason of PETSc's alone, or rounding."""
    fixed = np.repeat([[True], [True], [False], [False]], 2, axis=1)
    scene = Scene(
        name="slack", nodes=[[0.0, 1.0], [0.0, -1.0], [1.0, 0.0], [0.0, 0.0]], links=[[0, 2], [1, 2], [0, 3]],
        law=[Law.CABLE, Law.CABLE, Law.BAR], stiffness=[1e3] * 3, fixed=fixed,
        load=[[0.0, 0.0], [0.0, 0.0], [-1.0, 0.0], [0.0, 0.0]], mass=[0.0, 0.0, 0.0, 1.0],
    )  # fmt: skip
    result = move(scene, 3, 1e-2)
    assert not result.converged
    assert "step 1" in result.notices[-1] and "hold node 2 against the loads" in result.notices[-1]
    assert "rounding" not in result.notices[-1]
    held = replace(scene, mass=np.array([0.0, 0.0, 1.0, 1.0]))
    assert move(held, 3, 1e-2).converged


# ---- the command line ------------------------------------------------------------------------------


@pytest.mark.parametrize("ranks", [1, 2])
def test_command_moves_and_writes_everything(tmp_path, ranks):
    files = [
        "--json",
        "r.json",
        "--output",
        "r.pvd",
        "--picture",
        "r.gif",
        "--output-every",
        2,
        "--csv",
        "m.csv",
        "n.csv",
    ]
    scene = ["impact-tower", "--levels", 6, "--subdomains", 3, "--num-steps", 5]
    result = latinpc("solve", *scene, *files, cwd=tmp_path, ranks=ranks)
    for word in (
        "impact-tower",
        "5 steps of 200 µs",
        "iterations a step",
        "energy",
        "taut cables and closed contacts",
        "r.gif",
    ):
        assert result.stdout.count(word) == 1, word
    report = json.loads((tmp_path / "r.json").read_text())
    assert report["converged"] and report["ranks"] == ranks and len(report["iterations"]) == 5
    sets = ET.parse(tmp_path / "r.pvd").getroot().findall("Collection/DataSet")
    assert [float(entry.get("timestep")) for entry in sets] == pytest.approx([0.0, 4e-4, 8e-4, 1e-3])
    mesh = meshio.read(tmp_path / sets[-1].get("file"))
    assert mesh.point_data["velocity"][:, 2].min() == pytest.approx(-5.0, rel=1e-3)
    assert set(mesh.cell_data) >= {"tension", "slack"} and "displacement" in mesh.point_data
    assert Image.open(tmp_path / "r.gif").n_frames == 4
    members, nodes = (np.genfromtxt(tmp_path / name, delimiter=",", names=True) for name in ("m.csv", "n.csv"))
    last = nodes[nodes["time"] == nodes["time"].max()]
    assert list(np.unique(members["step"])) == list(np.unique(nodes["step"])) == [0, 2, 4, 5]
    assert last["displacement_z"] == pytest.approx(mesh.point_data["displacement"][:, 2])
    assert last["velocity_z"] == pytest.approx(mesh.point_data["velocity"][:, 2])
    assert members["tension"][-len(members) // 4 :] == pytest.approx(mesh.cell_data["tension"][0])


def test_a_motion_of_a_file_has_its_names_in_tables(tmp_path):
    """The tables of links and nodes begin with the state; what repeats is that of statics."""
    scene = read(tmp_path, TOML)
    moved, still = move(scene, 4, 1e-3, mass=1.0, every=2), scene.solve()
    for table, other in ((moved.members, still.members), (moved.nodes, still.nodes)):
        shared = [name for name in table.dtype.names if name in other.dtype.names and name not in ("tension", "slack")]
        shared = [name for name in shared if not name.startswith("displacement")]
        assert {"name", "group"} <= set(shared) and table.dtype.names[:2] == ("step", "time")
        for state in np.split(table, len(moved.frames)):
            assert all((state[name] == other[name]).all() for name in shared)
    moved.to_csv(tmp_path / "m.csv")
    assert (tmp_path / "m.csv").read_text().startswith("step,time,link,start,end,name,")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ([STEP, 1e-4], "20 steps of 100 µs, to 2 ms"),
        (["-ts_max_time", 2.5e-3], "3 steps of at most 1 ms, to 2.5 ms"),
    ],
)
def test_command_tells_the_length_that_steps_have(tmp_path, options, words):
    """Not that of the scene, where an option gives another one; the last step may be shorter."""
    result = latinpc("solve", "bouncing-chain", "--num-steps", 20, "--json", "r.json", *options, cwd=tmp_path)
    assert words in result.stdout
    report = json.loads((tmp_path / "r.json").read_text())
    assert report["step"] == pytest.approx(1e-4 if STEP in options else 1e-3)


def test_command_moves_a_scene_of_statics(tmp_path):
    arguments = ["lattice", "--nx", 8, "--ny", 4, "--num-steps", 3, "--time-step", 1e-3, "--node-mass", 10]
    result = latinpc("solve", *arguments, "--output", tmp_path / "end.vtu", "-ts_latin_monitor")
    assert "velocity" in meshio.read(tmp_path / "end.vtu").point_data
    assert result.stdout.count("energy: kinetic") == 4


def test_command_refuses(tmp_path):
    for arguments, words in (
        (["lattice", "--num-steps", 3], "no masses"),
        (["lattice", "--num-steps", 3, "--node-mass", 1], "--time-step"),
        (["lattice", "--num-steps", 3, "--node-mass", 1, "--time-step", "inf"], "change --time-step"),
        (["lattice", "--num-steps", 3, "--node-mass", 1, "--time-step", 1, STEP, "inf"], "inf"),
        (["impact-tower"], "--num-steps"),
        (
            ["bouncing-chain"],
            "If its masses are to move, make time steps (-ts_type latin, on the command line --num-st",
        ),
        (["lattice", "--time-step", 1e-3], "--num-steps"),
        (["lattice", "--picture", tmp_path / "a.gif"], ".gif"),
        (["bouncing-chain", "--num-steps", 3, "--reference"], "statics"),
        (["bouncing-chain", "--num-steps", 3, "-ts_max_time", -1], "from 0 s to -1 s has no step"),
    ):
        assert words in said(latinpc("solve", *arguments, code=2))[0]


MOVING = """
[masses.top]
mass = 5.0
[masses.bars]
line = 2.0
[velocities.top]
velocity = [0.0, -1.5]
"""


def read(tmp_path, text):
    (tmp_path / "a.msh").write_text(MSH)
    (tmp_path / "a.toml").write_text(text)
    return reading.read(tmp_path / "a.msh")


def test_masses_and_velocities_of_a_file(tmp_path):
    """Masses of nodes and of lines add up; a structure with masses need not be held."""
    scene = read(tmp_path, TOML + MOVING)
    assert np.allclose(np.sort(scene.mass), [4.0, 5.0, 14.0])  # bars of 4 m and 5 m, 2 kg/m
    assert np.allclose(scene.velocity[scene.mass == 14.0], [0.0, -1.5]) and np.abs(scene.velocity).sum() == 1.5
    free = read(tmp_path, TOML.replace('[supports.feet]\nfix = ["x", "y"]\ndisplacement = [0.0, -0.01]\n', "") + MOVING)
    assert not free.fixed.any()
    assert read(tmp_path, TOML).mass is None


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[masses.top]\n", "no mass"),
        ("[masses.top]\nmass = -1.0\n", "positive"),
        ("[masses.top]\nline = 1.0\n", "group of lines"),
        ("[masses.top]\nmass = 1.0\nline = 1.0\n", "only one of"),
        ("[masses.tip]\nmass = 1.0\n", "top"),
        ("[masses.top]\nweight = 1.0\n", "unknown key"),
        ("[velocities.top]\nspeed = 1.0\n", "unknown key"),
        ("[velocities.top]\n", "velocity = "),
        ("[velocities.top]\nvelocity = [1.0]\n", "list of 2"),
    ],
)
def test_masses_that_are_wrong_are_told(tmp_path, text, words):
    with pytest.raises(ValueError, match=words):
        read(tmp_path, TOML + text)


def test_tables_have_gaps_of_contacts_and_tangential_parts_follow_them():
    """A node falls beside another that lies still: its gap closes, and until then none of its links bears."""
    rows = ["friction", "tangent"] * 2
    scene = Scene(
        "drop", [[0.0, -1.0], [0.0, 0.0], [1.0, 0.0]], [[0, 1], [0, 1], [0, 2], [0, 2], [1, 2]], [*rows, "bar"],
        [0.0, 0.0, 0.0, 0.0, 1e3], initial_elongation=[0.0, 0.0, 0.1, 0.0, 0.0], friction=0.3,
        fixed=[[1, 1], [1, 1], [0, 0]], direction=[[0, 1], [1, 0]] * 2 + [[0, 0]], load=[[0, 0], [0, 0], [0, -10.0]],
        mass=[0.0, 0.0, 1.0],
    )  # fmt: skip
    moved = move(scene, 20, 1e-2, {"snes_stol": 1e-10}, every=1)
    table = moved.members[moved.members["link"] == 2]
    heights = [frame.displacements[2, 1] for frame in moved.frames]
    assert table["gap"] == pytest.approx(0.1 + np.array(heights), abs=1e-15)
    assert table["gap"][0] == 0.1 and np.ptp(table["gap"][~table["slack"]]) < 1e-9  # a step beyond where it closes
    parts = moved.members[moved.members["link"] == 3]
    assert parts["slack"].tolist() == table["slack"].tolist() and 5 < table["slack"].sum() < 20
    assert np.isnan(parts["gap"]).all() and np.isnan(moved.members[moved.members["link"] == 4]["gap"]).all()
    still = replace(scene, load=None).solve()
    assert still.members["gap"][:4] == pytest.approx([0.0, np.nan, 0.1, np.nan], nan_ok=True)
    assert still.slack[2] and not still.slack[3] and still.members["slack"][3]
    history = History([0.0, 0.1], [0.0, 1.0], Case("wider", initial_elongation=[0.0, 0.0, 0.2, 0.0, 0.0]))
    wider = move(replace(scene, load=None), 10, 1e-2, every=1, history=history).members
    assert wider[wider["link"] == 2]["gap"] == pytest.approx(np.linspace(0.1, 0.3, 11))


def test_masses_on_held_nodes_alone_are_noticed():
    scene = Scene("two", [[0.0], [1.0]], [[0, 1]], "bar", 1.0, fixed=[[1], [0]], mass=[1.0, 0.0], time_step=0.1)
    assert any("masses are on held nodes alone" in text for text in move(scene, 1).notices)


@pytest.mark.parametrize("law", ["contact", "inextensible", "friction"])
def test_gaps_that_count_as_closed_are_noticed(law):
    """A ball 5 cm above a table hung there where a spring pressed a light mass against a stop elsewhere."""
    parts = 2 if law == "friction" else 1
    sign = -1.0 if law == "inextensible" else 1.0
    scene = Scene(
        name="ball", nodes=[[0.0, 0.0], [1.0, 0.0], [5.0, 0.0], [6.0, 0.0], [7.0, 0.0]],
        links=[[2, 3], [3, 4]] + [[0, 1]] * parts, law=["bar", "contact", law, "tangent"][: 2 + parts],
        stiffness=[1e6, 0.0] + [0.0] * parts, initial_elongation=[-0.1, 0.0, 0.05 * sign, 0.0][: 2 + parts],
        direction=[[1.0, 0.0]] * 3 + [[0.0, 1.0]] * (parts - 1), friction=[0.0, 0.0, 0.3, 0.0][: 2 + parts],
        fixed=[[1, 1], [0, 1], [1, 1], [0, 1], [1, 1]], load=np.outer([0.0, -9.81 * sign, 0.0, 0.0, 0.0], [1.0, 0.0]),
        mass=[0.0, 1.0, 0.0, 0.1, 0.0],
    )  # fmt: skip
    said = "the gap of link 2, up to 50 mm, counts as closed in the first step: without rigid links nodes would move by"
    long = move(scene, 1, 0.025)
    assert long.frames[-1].velocities[1] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert [said in text for text in long.notices] == [True]
    short = move(scene, 1, 1e-3)
    assert short.frames[-1].velocities[1] == pytest.approx([-9.81e-3 * sign, 0.0])
    assert not short.notices
    assert not move(make("impact-grid", modules=4), 1).notices


@pytest.mark.parametrize("law", ["contact", "inextensible", "friction"])
def test_a_ball_lands_where_its_gap_ends(law):
    """It falls freely until the step that would overlap; that one ends at the gap, and the next one at rest."""
    parts = 2 if law == "friction" else 1
    sign = -1.0 if law == "inextensible" else 1.0
    scene = Scene(
        name="ball", nodes=[[0.0, 0.0], [1.0, 0.0]], links=[[0, 1]] * parts, law=[law, "tangent"][:parts],
        stiffness=[0.0] * parts, initial_elongation=[0.05 * sign, 0.0][:parts],
        direction=[[1.0, 0.0], [0.0, 1.0]][:parts], friction=[0.3, 0.0][:parts], fixed=[[1, 1], [0, 1]],
        load=[[0.0, 0.0], [-9.81 * sign, 0.0]], mass=[0.0, 1.0],
    )  # fmt: skip
    h = 0.01
    fall = move(scene, 20, h, every=1)
    way = np.minimum(9.81 * h**2 * np.cumsum(np.arange(1, 21)), 0.05)
    assert -sign * np.array([frame.displacements[1, 0] for frame in fall.frames[-20:]]) == pytest.approx(way)
    speed = np.diff(way, prepend=0.0) / h
    assert -sign * np.array([frame.velocities[1, 0] for frame in fall.frames[-20:]]) == pytest.approx(speed, abs=1e-9)


def test_what_overlaps_at_the_start_stays():
    """To push it apart would give it energy; it opens without resistance."""
    scene = Scene(
        name="overlap", nodes=[[0.0], [1.0], [2.0], [3.0]], links=[[0, 1], [2, 3]], law="contact", stiffness=0.0,
        initial_elongation=[-0.01, -0.01], fixed=[[1], [0], [1], [0]], load=[[0.0], [-1.0], [0.0], [1.0]],
        mass=[0.0, 2.0, 0.0, 2.0],
    )  # fmt: skip
    last = move(scene, 5, 0.1).frames[-1]
    assert last.displacements[:, 0] == pytest.approx([0.0, 0.0, 0.0, 0.5 * 0.1**2 * 15], abs=1e-12)
    assert last.tensions == pytest.approx([-1.0, 0.0])


def test_a_motion_prints_its_summary():
    text = str(move(make("bouncing-chain", links=8), 3))
    assert text.startswith("bouncing-chain\n  structure ") and "all steps converged" in text and len(text) < 1000


def test_the_case_of_a_history_is_no_name():
    with pytest.raises(TypeError, match=r"a latinpc\.Case, such as one of scene\.cases, not 'gust'"):
        History([0.0, 1.0], [0.0, 1.0], "gust")


def test_steps_that_do_not_follow_slack_cables_are_noticed():
    """All of them converge, and the energy is wrong."""
    scene, options = make("impact-grid", modules=4, contact="elastic"), {"snes_type": "ksponly", "pc_type": "lu"}
    moved = move(scene, 5, 1e-3, options)
    assert moved.converged and any(text.startswith("ksponly makes one linear step") for text in moved.notices)
    assert not move(scene, 5, 1e-3).notices
