"""Peers side by side: the mechanics of the arrays, the quadratic program, the harness, the two commands."""

import importlib.util
import json
from dataclasses import fields, replace

import numpy as np
import pytest
from conftest import ROOT
from support import chain, grid, settled
from test_cli import latinpc

from latinpc import Structure
from latinpc.bench import compare, tradeoff
from latinpc.bench.peers import DEFAULT, LINEAR, METHODS, qp, run
from latinpc.bench.peers.launch import RANKS, Bench, Failed
from latinpc.bench.peers.reference import by_latin, by_newton
from latinpc.files import npz
from latinpc.results import mechanics
from latinpc.scenes import Law, make
from latinpc.solvers import has_package

INTERIOR = [name for name in ("piqp", "clarabel") if importlib.util.find_spec(name)]
THERE = [name for name in METHODS if not METHODS[name].package or has_package(METHODS[name].package)]
HERE = [name for name in DEFAULT if METHODS[name].kind != "qp" and name in THERE] + INTERIOR
interior = pytest.mark.parametrize("name", [
    pytest.param(name, marks=pytest.mark.skipif(name not in INTERIOR, reason=f"{name} is absent: make bench"))
    for name in ("piqp", "clarabel")
])  # fmt: skip


def struts():
    """A chain of which the struts part where it is pulled, held by bars; supports that move."""
    scene = chain(links=9, parts=3)
    law = np.where(np.arange(9) % 3 == 0, Law.COMPRESSION_ONLY, Law.BAR)
    twice = np.vstack([scene.links, scene.links])  # a bar beside each, so that nothing is a mechanism
    both = {name: np.tile(getattr(scene, name), 2) for name in ("stiffness", "initial_elongation", "subdomain")}
    return replace(scene, links=twice, law=np.concatenate([law, np.full(9, Law.BAR)]), **both)


SCENES = {"grid": lambda: grid(), "supports": lambda: settled(grid()), "struts": struts, "bars": lambda: grid("truss")}


@pytest.fixture(params=SCENES)
def scene(request):
    return SCENES[request.param]()


# ---- mechanics of the arrays -----------------------------------------------------------------


def full(scene):
    """The same scene with all that a scene may have."""
    n, m = scene.nodes.shape, len(scene.links)
    return replace(
        scene, subdomain=np.arange(m) % 2, direction=np.ones((m, n[1])), friction=np.full(m, 0.3), mass=np.ones(n[0]),
        velocity=np.where(scene.fixed, 0.0, 1.0), time_step=1e-3, law=np.where(np.arange(m) == 0, len(Law), scene.law),
        tables=[([-1.0, 0.0, 2.0], [-3.0, 0.0, 4.0])],
    )  # fmt: skip


@pytest.mark.parametrize("change", [lambda scene: scene, full], ids=["as it is", "full"])
def test_scene_on_disk_is_the_same(scene, change, tmp_path):
    scene = change(scene)
    npz.save_scene(tmp_path / "scene.npz", scene)
    read = npz.load_scene(tmp_path / "scene.npz")
    for item in fields(scene):
        was, found = getattr(scene, item.name), getattr(read, item.name)
        assert (was is None) == (found is None), item.name
        assert was is None or np.array_equal(was, found), item.name


def test_errors_and_tensions_are_those_of_the_library(scene):
    structure = Structure.from_scene(scene)
    u, v = structure.create_vec(), structure.create_vec()
    u.setRandom()
    u.scale(1e-3)
    v.setRandom()
    v.scale(2e-3)
    a, b = structure.displacements(u), structure.displacements(v)
    assert mechanics.errors(scene, a, b)[0] == pytest.approx(structure.errors(u, v)[0])
    assert mechanics.tensions(scene, a) == pytest.approx(
        structure.tensions(u), abs=1e-9 * np.abs(structure.tensions(u)).max()
    )
    if not scene.prescribed.any():
        assert mechanics.errors(scene, a, b)[1] == pytest.approx(structure.errors(u, v)[1])
    assert mechanics.errors(scene, a * np.nan, b) == (np.inf, np.inf)


def test_references_agree(scene):
    a, about = by_newton(scene, 1e-8)
    assert about["accuracy"] <= 1e-10
    b, about = by_latin(scene, 1e-4)
    assert mechanics.errors(scene, b, a)[0] <= 1e-6 and about["method"] == "latin"


# ---- the quadratic program -------------------------------------------------------------------


@interior
def test_the_program_has_the_solution_of_newton(scene, name):
    reference, _ = by_newton(scene, 1e-8)
    outcome = run.solve(name, scene, 1e-10)
    assert outcome.converged, outcome.reason
    assert mechanics.errors(scene, outcome.displacements, reference)[0] < 1e-6
    tau, expected = (mechanics.tensions(scene, u) for u in (outcome.displacements, reference))
    assert np.abs(tau - expected).max() <= 1e-5 * np.abs(expected).max()


def test_the_program_has_the_energy_of_the_structure():
    """At any u, with the best v, the program is the energy up to a constant; units of length and force drop out."""
    pytest.importorskip("scipy")
    scene = settled(struts())
    problem = qp.program(scene)
    structure = Structure.from_scene(scene)
    B, e_d = qp.kinematics(scene)
    u = structure.create_vec()
    values = []
    for seed in range(3):
        displacement = scene.prescribed.copy()
        displacement[problem.free] = np.random.default_rng(seed).uniform(-1e-2, 1e-2, problem.free.sum())
        structure.set_displacements(displacement, u)
        taut = mechanics.tensions(scene, displacement) / scene.stiffness
        x = np.concatenate([displacement[problem.free], taut[scene.law != Law.BAR]]) / problem.length
        assert (problem.G @ x <= problem.h + 1e-12).all()
        unit = scene.stiffness.max() * problem.length**2
        values.append(structure.energy(u) - (0.5 * x @ (problem.P @ x) + problem.c @ x) * unit)
    assert values == pytest.approx([values[0]] * 3, rel=1e-9, abs=1e-12)


# ---- the stop --------------------------------------------------------------------------------


def test_the_loosest_stop():
    history = [(1e2, 0.3), (1e3, 5e-3), (0.5, 1e-3), (1e-9, 1e-12)]
    assert 0.5 < run.loosest(history, 1e-2) < 1e2  # not at the second iterate, whose measure has risen
    assert 1e-9 < run.loosest(history, 1e-6) < 0.5
    assert run.loosest(history, 1e-13) is None
    assert run.loosest([], 1e-2) is None


def test_newtons_method_ends_where_the_unbalance_is_not_a_number():
    stop = run._stop(None, None, 1e-6, None, None, [])
    assert stop(None, 3, (1.0, 1.0, np.nan)) == -4  # DIVERGED_FUNCTION_NANORINF; its name in Python changes


@pytest.mark.parametrize("name", [name for name in HERE if METHODS[name].kind != "qp"])
def test_calibrated_runs_reach_their_accuracy(name):
    scene = grid()
    reference, _ = by_newton(scene, 1e-8)
    accuracies = [1e-2, 1e-5]
    tolerances = run.calibrate(name, scene, accuracies, reference)
    outcomes = [run.solve(name, scene, tolerance) for tolerance in tolerances]
    for accuracy, outcome in zip(accuracies, outcomes):
        assert outcome.converged, outcome.reason
        assert mechanics.errors(scene, outcome.displacements, reference)[0] <= 1.5 * accuracy
        assert outcome.peak_memory_bytes > 1e7
    assert outcomes[0].iterations <= outcomes[1].iterations


def test_a_stop_is_one_of_the_iterates_that_were_calibrated():
    """Newton's method would take over on the way to one tolerance, and not on that to another."""
    scene = make("tower")
    reference, _ = by_newton(scene, 1e-4)
    (tolerance,) = run.calibrate("latin", scene, [1e-4], reference)
    found = run.solve("latin", scene, tolerance)
    assert found.converged and mechanics.errors(scene, found.displacements, reference)[0] <= 1e-4
    own = run.solve("latin", scene, None, accuracy=1e-4)
    assert own.converged and mechanics.errors(scene, own.displacements, reference)[0] <= 1e-4


def test_the_geometry_of_an_option_is_that_of_all_methods_and_of_the_reference():
    net = ("saddle", "--side", 6, "--height", 0, "-snes_latin_geometry", "large")
    ended = latinpc("compare", *net, "--methods", "latin,newton-cholmod", "--repeat", 1, "--json", "-")
    assert all(row["converged"] for row in json.loads(ended.stdout)["rows"])


def test_large_displacements_are_compared_with_latin_on_its_path():
    """Newton's method from the drawing finds no equilibrium of a mast in the wind: it is no reference."""
    mast = make("mast", wind=200.0)
    document = compare.compare(mast, ["latin", "newton-mumps"], repeat=1)
    latin, newton = document["rows"]
    assert document["reference"]["method"] == "latin"
    assert latin["converged"] and latin["error_l2"] < 1e-4
    assert not newton["converged"] and compare.layout(document)[1][1][4] == "-"
    with pytest.raises(ValueError, match="clarabel solves structures in linear geometry alone"):
        compare.compare(mast, ["clarabel"])


# ---- processes -------------------------------------------------------------------------------


def test_rows_are_complete_and_honest():
    scene = grid()
    said = []
    document = compare.compare(scene, ["latin", "newton-mumps"], repeat=2, progress=said.append)
    assert [text.split(": ")[1].split(",")[0] for text in said] == [f"{k} of 7" for k in range(1, 8)]
    assert "latin, run 1 of 2" in said[3] and "newton-mumps, run 2 of 2" in said[6]
    assert json.loads(json.dumps(document, allow_nan=False)) == document
    assert [row["method"] for row in document["rows"]] == ["latin", "newton-mumps"]
    for row in document["rows"]:
        assert tuple(row) == compare.KEYS
        assert row["converged"] and row["error_l2"] <= 1e-4 and row["reason"].startswith("CONVERGED")
        assert row["setup_seconds"] > 0 and row["solve_seconds"] > 0 and row["peak_memory_bytes"] > 1e7
    assert len(document["runs"]) == 4
    assert document["reference"]["accuracy"] <= 1e-6
    header, table = compare.layout(document)
    assert all(len(row) == len(header) for row in table) and table[0][4] == "1.0"


def test_a_method_that_fails_keeps_its_row():
    options = [("newton_nothing", "1"), ("pc_factor_mat_solver_type", "nothing")]
    document = compare.compare(grid(), ["latin", "newton-mumps"], repeat=1, user_options=options)
    latin, mumps = document["rows"]
    assert latin["converged"]
    assert not mumps["converged"] and mumps["solve_seconds"] is None and "nothing" in mumps["reason"]
    assert compare.layout(document)[1][1][-1] == mumps["reason"]


def test_a_method_that_does_not_get_there_says_so():
    document = compare.compare(grid(), ["latin"], repeat=1, user_options=[("snes_max_it", "2")])
    row = document["rows"][0]
    assert not row["converged"] and row["reason"].startswith("DIVERGED_MAX_IT") and row["error_l2"] > 1e-4


def test_newtons_method_takes_over_where_the_iteration_alone_takes_longer():
    """The default of SNES latin is compared, not an iteration that no user would wait for."""
    row = compare.compare(make("net", side=20, law="cable"), ["latin"], repeat=1)["rows"][0]
    assert row["converged"] and row["iterations"] < 250  # alone: 1,375


def test_a_slow_process_is_stopped():
    with Bench(grid(), timeout=0.05) as bench, pytest.raises(Failed, match=r"no result after 0\.05 s"):
        bench.run(do="calibrate", method="latin", accuracies=[1e-2])


def test_memory_is_that_of_the_process_not_of_its_parent():
    ballast = np.ones(60_000_000)  # a parent of half a gigabyte
    document = compare.compare(grid(), ["latin"], repeat=1)
    assert document["rows"][0]["peak_memory_bytes"] < ballast.nbytes


def test_bad_requests_name_the_cure():
    with pytest.raises(ValueError, match="unknown method 'newton': choose from latin"):
        compare.compare(grid(), ["newton"])
    with pytest.raises(ValueError, match="between 0 and 1"):
        compare.compare(grid(), ["latin"], accuracy=2)
    with pytest.raises(ValueError, match="unknown knob 'size': choose from methods"):
        tradeoff.tradeoff(grid(), ["size"])


def test_the_front():
    points = [{"setup_seconds": 0, "solve_seconds": t, "error_l2": e} for t, e in ((1, 1e-2), (2, 1e-2), (3, 1e-4))]
    tradeoff.mark_front([{"points": points}])
    assert [point["front"] for point in points] == [True, False, True]


def test_knobs_of_other_scenes():
    scene = make("network", nodes=100)
    assert scene.subdomain is None
    choices = tradeoff.knobs_of(scene, ["subdomain size"])["subdomain size"]
    assert choices[0] == tradeoff.DEFAULT
    assert choices[1].options == {"snes_latin_subdomains": -(-len(scene.links) // 64)}
    assert "subdomain size" not in tradeoff.knobs_of(chain())


# ---- the commands ----------------------------------------------------------------------------

GRID = ["tensegrity-grid", "--modules", "8"]


@pytest.mark.slow
def test_compare_command(tmp_path):
    wanted = ["latin", "newton-cholmod", *INTERIOR]
    files = ["--json", tmp_path / "c.json", "--picture", tmp_path / "c.png"]
    result = latinpc("compare", *GRID, "--methods", ",".join(wanted), "--repeat", 1, *files)
    document = json.loads((tmp_path / "c.json").read_text())
    assert [row["method"] for row in document["rows"]] == wanted
    assert all(row["converged"] for row in document["rows"])
    assert (tmp_path / "c.png").stat().st_size > 5000
    for word in (*wanted, "x latin", "Errors are against newton-cholmod"):
        assert word in result.stdout
    assert not result.stderr
    latinpc("compare", *GRID, "--methods", "nothing", code=2)
    latinpc("compare", *GRID, ranks=2, code=2)


@pytest.mark.slow
def test_compare_on_two_ranks():
    document = json.loads(
        latinpc(
            "compare", *GRID, "--methods", "latin,newton-cholmod", "--ranks", 2, "--repeat", 1, "--json", "-"
        ).stdout
    )
    latin, cholmod = document["rows"]
    assert latin["converged"] and document["ranks"] == 2
    assert not cholmod["converged"] and "one rank only" in cholmod["reason"]


def test_tradeoff_of_large_displacements_takes_the_stop_of_latin():
    """It had timed the iteration without Newton's method, which no solve with large displacements is."""
    net = make("saddle", side=6)
    with Bench(net) as bench:
        bench.make_reference(1e-8)
        points = bench.run(do="sweep", method="latin", options={}, repeat=1, accuracies=[1e-2, 1e-8])["points"]
    own = [net.solve(error=accuracy).iterations for accuracy in (1e-2, 1e-8)]
    assert [point["runs"][0]["iterations"] for point in points] == own
    assert all(point["runs"][0]["error_l2"] <= point["accuracy"] for point in points)


def test_tradeoff_of_large_displacements_down_to_rounding():
    """The reference had been asked for more than rounding allows; methods of small displacements were listed."""
    result = latinpc(
        "tradeoff", "saddle", "--knobs", "methods,newton-latin", "--repeat", 1, "--accuracies", "1e-4,1e-10"
    )
    rows = result.stdout.splitlines()[2:-1]
    assert [row.split()[1] for row in rows] == [
        "latin", "latin-one", "newton-cholmod", "newton-mumps", "newton-gamg", "newton-hypre",
    ]  # fmt: skip
    assert all(" - " not in row for row in rows[:2])  # a PETSc may lack the solvers of others
    assert "Forces" not in result.stdout


@pytest.mark.slow
def test_tradeoff_command(tmp_path):
    files = ["--json", tmp_path / "t.json", "--picture", tmp_path / "t.png"]
    chosen = ["--knobs", "variant,subdomain size", "--accuracies", "1e-2,1e-4", "--repeat", 1]
    result = latinpc("tradeoff", *GRID, *chosen, *files)
    document = json.loads((tmp_path / "t.json").read_text())
    assert [curve["label"] for curve in document["curves"]][:2] == ["default", "macro"]
    for curve in document["curves"]:
        assert curve["reason"] is None and len(curve["points"]) == 2
        assert all(point["error_l2"] <= 1.5 * point["accuracy"] for point in curve["points"])
    assert any(point["front"] for curve in document["curves"] for point in curve["points"])
    assert (tmp_path / "t.png").stat().st_size > 10000
    assert "2 × 2 modules" in result.stdout
    coarse, fine = document["curves"][0]["points"]
    assert 1e-4 < coarse["error_tension"] < 1 and fine["error_tension"] < 1e-2
    assert fine["largest_unbalance"] < coarse["largest_unbalance"]
    lines = [line for line in result.stdout.splitlines() if line.startswith(("error of the tensions", "largest unb"))]
    assert len(lines) == 2 and f"{fine['error_tension']:.0e}" in lines[0] and lines[1].endswith("N")


def test_presets_are_described():
    for name, accuracy in (("fast", "1e-2"), ("balanced", "1e-4"), ("accurate", "1e-8")):
        text = (ROOT / "options" / f"{name}.opts").read_text()
        assert accuracy in text and "latinpc solve" in text and "unbalanced forces of up to" in text


# ---- linear structures -----------------------------------------------------------------------
@pytest.mark.parametrize("name", [name for name in LINEAR if name in THERE])
def test_linear_methods_stop_at_the_accuracy(name):
    """Calibrated, then timed: the first iterate below the accuracy, and the same displacements."""
    scene = grid("truss")
    reference, _ = by_newton(scene, 1e-6)
    (tolerance,) = run.calibrate(name, scene, [1e-6], reference)
    outcome = run.solve(name, scene, tolerance)
    error = mechanics.errors(scene, outcome.displacements, reference)[0]
    assert outcome.converged and error <= 1e-6
    if (METHODS[name].options["ksp_type"] == "cg" and METHODS[name].matrix != "is") or name == "ksp-latin":
        assert error > 1e-12 and outcome.iterations > 1


def test_linear_methods_want_bars():
    with pytest.raises(ValueError, match="structures of bars alone"):
        compare.compare(grid(), ["ksp-latin"])
    with pytest.raises(ValueError, match="structures of bars alone"):
        run.solve("cg-latin", grid(), 1e-6)


@pytest.mark.slow
def test_linear_scene_side_by_side_on_two_ranks(monkeypatch):
    """By default the methods for scenes of bars; ratios are to KSP latin. Nobody tells Open MPI about root or cores."""
    for name in RANKS:
        monkeypatch.delenv(name, raising=False)
    document = compare.compare(grid("truss"), ("ksp-latin", "cg-latin", "fetidp"), repeat=1, ranks=2)
    rows = {row["method"]: row for row in document["rows"]}
    assert rows["ksp-latin"]["converged"] and rows["cg-latin"]["converged"]
    assert rows["ksp-latin"]["error_l2"] <= 1e-4 and rows["ksp-latin"]["iterations"] > 1
    header, table = compare.layout(document)
    assert "x ksp-latin" in header and table[0][header.index("x ksp-latin")] == "1.0"
