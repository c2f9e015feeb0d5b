"""The command line: what it passes on, prints, writes and returns, on one rank and on several."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import meshio
import numpy as np
import pytest
from command import latinpc, said
from conftest import ROOT
from test_drawings import grid_of_lines
from test_files import MSH, TOML

import latinpc as package
from latinpc import blas, cli
from latinpc.cli.arguments import split_arguments
from latinpc.options import INNER_PREFIXES, OPTIONS, unknown_options
from latinpc.scenes import make

KEYS = [
    "scene", "dofs", "links", "ranks", "subdomains", "strong_interfaces", "weak_interfaces",
    "strong_macro_dofs", "weak_dofs", "iterations", "converged", "reason", "indicator", "residual",
    "slack_fraction", "error_l2", "error_energy", "error_tension", "largest_unbalance", "setup_seconds",
    "solve_seconds", "peak_memory_bytes", "versions", "options",
]  # fmt: skip
TOWER = str(ROOT / "examples" / "tower.msh")


# ---- arguments -------------------------------------------------------------------------------


def test_single_dash_is_petscs_and_double_dash_ours():
    line = "solve grid --load -3.5 -snes_rtol 1e-8 -snes_monitor --json r.json -a -1e-3 -b .5 -c -d x"
    ours, petsc = split_arguments(line.split())
    assert ours == ["solve", "grid", "--load", "-3.5", "--json", "r.json"]
    assert petsc == [
        ("snes_rtol", "1e-8"), ("snes_monitor", None), ("a", "-1e-3"), ("b", ".5"), ("c", None), ("d", "x"),
    ]  # fmt: skip


def test_scenes_and_info():
    text = latinpc("scenes").stdout
    for word in ("tensegrity-grid", "truss-grid", "network", "lattice", "--modules", "--seed"):
        assert word in text
    text = latinpc("info").stdout
    library = re.search(r"-dll_append (\S+)", text).group(1)
    assert Path(library).is_file()
    assert "MUMPS" in text and "CHOLMOD" in text


def test_info_names_the_kernels_of_openblas():
    """Sandy Bridge's run on all processors with AVX; nobody is to set what is set."""
    free = {name: value for name, value in os.environ.items() if name != "OPENBLAS_CORETYPE"}
    found = json.loads(latinpc("info", "--json", "-", env=free).stdout)["blas"]
    if found is None:
        assert "BLAS           not OpenBLAS" in latinpc("info").stdout
        return
    assert ("OPENBLAS_CORETYPE" in latinpc("info", env=free).stdout) == bool(found["wider"])
    text = latinpc("info", env={**free, "OPENBLAS_CORETYPE": found["wider"] or "SANDYBRIDGE"}).stdout
    kernels = found["wider"] or f"Sandybridge|{found['kernels']}"  # one that has no choice keeps its own
    assert re.search(rf"BLAS +OpenBLAS [\d.]+, kernels ({kernels})$", text, re.MULTILINE | re.IGNORECASE)


@pytest.mark.parametrize(
    ("chosen", "instructions", "wider"),
    [
        ("Prescott", "sse3 avx2 fma avx512f avx512dq", "SKYLAKEX"),
        ("Haswell", "sse3 avx2 fma avx512f avx512dq", "SKYLAKEX"),
        ("Prescott", "sse3 avx2 fma", "HASWELL"),
        ("Cooperlake", "sse3 avx2 fma avx512f avx512dq", None),
        ("Zen", "sse3 avx2 fma", None),
        ("Prescott", "sse3", None),
        ("NEOVERSEN1", "", None),
    ],
)
def test_kernels_wider_than_those_chosen(chosen, instructions, wider):
    assert blas._wider(chosen, set(instructions.split())) == wider


def test_a_long_solve_names_wider_kernels(monkeypatch):
    narrow = {"version": "0.3.21", "kernels": "Prescott", "wider": "HASWELL"}
    monkeypatch.setattr("latinpc.results.solve.kernels", lambda: narrow)
    monkeypatch.setattr("latinpc.results.solve.LONG", 1e3)
    said = "OpenBLAS runs its kernels for Prescott: export OPENBLAS_CORETYPE=HASWELL makes factors faster"
    assert said in make("truss-grid", modules=4).solve().notices
    monkeypatch.undo()
    assert said not in make("truss-grid", modules=4).solve().notices


def test_help_of_cases_has_no_options_of_scenes_nor_of_one_case():
    assert "--modules" in latinpc("form", "--help").stdout
    text = latinpc("cases", "--help").stdout
    assert "--self-weight" in text and "--subdomains" in text and "--modules" not in text
    assert "--case" not in text and "--case" in latinpc("solve", "--help").stdout


def test_the_module_is_the_command():
    """`python3 -m latinpc`, for who has no script on the path."""
    said = subprocess.run(
        [sys.executable, "-P", "-m", "latinpc", "--version"], capture_output=True, text=True, timeout=60
    )
    assert (said.returncode, said.stdout) == (0, f"latinpc, version {package.__version__}\n")


def test_help_lists_every_option_of_ours_and_no_other():
    text = latinpc("solve", TOWER, "--subdomains", 4, "--quiet", "-help").stdout
    found = set(re.findall(r"-snes_latin_(\w+)", text))
    assert set(OPTIONS) == {name for name in found if not name.startswith(INNER_PREFIXES)}


def test_a_closed_output_and_one_in_ascii(tmp_path):
    """What is not printed is written; a character without a sign becomes another."""
    words = [sys.executable, "-m", "latinpc", "solve", "lattice"]
    closed = f"{' '.join(words)} --json r.json >&- && {' '.join(words)} --json - >&- 2>&-"
    subprocess.run(["sh", "-c", closed], cwd=tmp_path, check=True)
    assert json.loads((tmp_path / "r.json").read_text())["converged"]
    ascii_only = os.environ | {"PYTHONIOENCODING": "ascii"}
    said = subprocess.run(
        [*words, "-v"], cwd=tmp_path, check=True, env=ascii_only, capture_output=True, text=True
    ).stdout
    assert re.search(r" [\d.]+ (\?|m)s", said)


# ---- a solve ---------------------------------------------------------------------------------


def test_solve_writes_everything(tmp_path):
    names = {"--json": "r.json", "--output": "r.vtu", "--picture": "r.png"}
    files = [word for name, file in names.items() for word in (name, file)]
    result = latinpc("solve", TOWER, "-v", "--subdomains", 4, "--reference", *files, cwd=tmp_path)
    report = json.loads((tmp_path / "r.json").read_text())
    assert set(KEYS) <= set(report)
    assert report["scene"] == "tower" and report["subdomains"] == 4 and report["ranks"] == 1
    assert report["converged"] and report["reason"].startswith("CONVERGED")
    assert report["dofs"] == 102 and report["free_dofs"] == 96 and report["links"] == 144
    assert report["error_l2"] < 1e-3 and report["error_energy"] < 1e-3 and report["error_tension"] < 1e-3
    assert ", of the tensions " in result.stdout.partition("  error  ")[2].splitlines()[0]
    assert 0 < report["slack_fraction"] < 1
    assert min(report[key] for key in ("setup_seconds", "solve_seconds", "peak_memory_bytes")) > 0
    mesh = meshio.read(tmp_path / "r.vtu")
    assert mesh.cell_data["slack"][0].sum() == round(64 * report["slack_fraction"])
    assert len(np.unique(mesh.cell_data["subdomain"][0])) == 4
    assert mesh.point_data["displacement"][:, 1].min() < -0.005  # the settled foot, at least
    assert (tmp_path / "r.png").stat().st_size > 10000
    for word in ("tower", "51 nodes", "144 links", "4 subdomains", "CONVERGED", "largest", "slack", "r.vtu"):
        assert word in result.stdout
    assert "\x1b" not in result.stdout and not result.stderr  # plain and quiet in a pipe


def test_a_drawing_is_imported_braced_and_solved_by_one_command(tmp_path):
    (tmp_path / "plan.obj").write_text(grid_of_lines(6)[0])
    rim = [word for where in ("x=min", "x=max", "y=min", "y=max") for word in ("--support", where)]
    vault = ["--raise", "0.2", "--brace", "0.8", "--EA", "6e7", "--EA", "braces=1e7", "--prestress", "braces=1e3"]
    loads = ["--load", "z=-100", "--load", "x=20:y>=3", "--self-weight", "10", "--self-weight", "posts=5"]
    result = latinpc("solve", tmp_path / "plan.obj", *vault, *rim, *loads, "--json", tmp_path / "r.json")
    report = json.loads((tmp_path / "r.json").read_text())
    assert report["converged"] and report["links"] == 4 * 84 + 49 and report["free_dofs"] == 3 * 2 * 25
    assert "plan.obj: 129 points merged; 5 lines left out" in result.stdout
    assert "217 bars, 168 cables" in result.stdout


def test_summary_is_in_plain_words_and_verbose_in_those_of_petsc():
    text = latinpc("solve", TOWER, "--subdomains", 1).stdout
    for word in ("CONVERGED", "DIVERGED", "indicator", "subdomain", "e-0", "e+0"):
        assert word not in text, word
    for word in ("converged in", "iterations", "27 of 64 cables", "at node 51 (8, 48) m",
                 "worst member   link 1-2: 387 kN in tension",
                 "estimated error of the displacements", "% of the loads"):  # fmt: skip
        assert word in text, word
    text = latinpc("solve", "-v", TOWER, "--subdomains", 1).stdout
    for word in ("CONVERGED_SNORM_RELATIVE", "1 subdomain,", "strong and", "indicator", "96 free of 102, on 1 rank"):
        assert word in text, word


def test_preset_is_that_of_the_file_and_the_users_options_come_before_it():
    grid = ["solve", "tensegrity-grid", "--modules", "12", "--json", "-"]
    preset = json.loads(latinpc(*grid, "--preset", "fast").stdout)
    file = json.loads(latinpc(*grid, "-options_file", ROOT / "options" / "fast.opts").stdout)
    mine = json.loads(latinpc(*grid, "--preset", "fast", "-snes_stol", "1e-6").stdout)
    assert preset["options"] == {key: value for key, value in file["options"].items() if key != "options_file"}
    assert preset["iterations"] == file["iterations"] < mine["iterations"] and mine["options"]["snes_stol"] == "1e-6"
    moves = ["solve", "bouncing-chain", "--num-steps", "3", "--preset", "accurate", "--json", "-"]
    assert json.loads(latinpc(*moves).stdout)["options"]["snes_stol"] == "5e-9"
    assert "balanced" in latinpc("solve", "net", "--preset", "fat", code=2).stderr


def test_number_and_length_of_time_steps():
    report = json.loads(latinpc("solve", "bouncing-chain", "--json", "-", "--num-steps", 4, "--time-step", 2e-3).stdout)
    assert report["step"] == 2e-3 and report["steps"] == 4


def test_json_alone_and_quiet():
    report = json.loads(latinpc("solve", TOWER, "--subdomains", 2, "--json", "-").stdout)
    assert report["error_l2"] is None and report["converged"]
    assert not latinpc("solve", TOWER, "--subdomains", 2, "--quiet").stdout


def test_two_ranks_print_once_and_agree(tmp_path):
    arguments = ["solve", TOWER, "--subdomains", "4", "--output"]
    lattice = ["solve", "lattice", "--nx", "16", "--ny", "8", "--subdomains", "8", "--output"]
    for case in (arguments, lattice):
        one = latinpc(*case, tmp_path / "one.vtu", "-snes_stol", "1e-10", "-snes_max_it", 500)
        two = latinpc(*case, tmp_path / "two.vtu", "-snes_stol", "1e-10", "-snes_max_it", 500, ranks=2)
        assert two.stdout.count("displacement") == one.stdout.count("displacement") == 1
        a, b = (meshio.read(tmp_path / name).point_data["displacement"] for name in ("one.vtu", "two.vtu"))
        assert np.abs(a - b).max() <= 1e-7 * np.abs(a).max()


def test_not_converged_keeps_the_last_iterate(tmp_path):
    files = ["--json", tmp_path / "r.json", "--output", tmp_path / "r.vtu"]
    result = latinpc("solve", TOWER, "--subdomains", 4, *files, "-snes_max_it", 1, "-snes_stol", 1e-12, code=1)
    words = "the iterations that -snes_max_it allows were not enough"
    assert said(result)[-1] == f"latinpc: not converged: {words} (DIVERGED_MAX_IT)"
    assert f"  not converged  {words}" in result.stdout
    report = json.loads((tmp_path / "r.json").read_text())
    assert report["converged"] is False and report["reason"] == "DIVERGED_MAX_IT"
    assert np.abs(meshio.read(tmp_path / "r.vtu").point_data["displacement"]).max() > 0


def test_other_solvers_of_petsc(tmp_path):
    truss = ["solve", "truss-grid", "--modules", "16", "--json", "-"]
    options = ["-snes_type", "ksponly", "-ksp_type", "cg", "-ksp_rtol", "1e-8", "-pc_type", "latin"]
    cg = json.loads(latinpc(*truss, "--reference", *options).stdout)
    assert cg["converged"] and cg["solver"] == "ksponly + cg + latin" and cg["subdomains"] == 16
    assert cg["iterations"] < 40 and cg["error_energy"] < 1e-5 and cg["indicator"] is None
    newton = ["-snes_type", "newtonls", "-snes_linesearch_type", "none", "-pc_type", "cholesky"]
    report = json.loads(latinpc("solve", TOWER, "--json", "-", "--reference", *newton).stdout)
    assert report["converged"] and report["error_l2"] < 1e-7 and report["strong_interfaces"] is None


def test_ksponly_on_cables_says_what_it_is_not():
    result = latinpc("solve", TOWER, "--quiet", "-snes_type", "ksponly", "-pc_type", "lu")
    assert "one linear step" in said(result)[0]
    lattice = latinpc("solve", "lattice", "--quiet", "-snes_type", "ksponly", "-pc_type", "lu")
    assert said(lattice)[-1].endswith("% of them")  # a smaller error does not help
    loose = ["-snes_type", "ksponly", "-ksp_type", "cg", "-pc_type", "latin", "-ksp_rtol", "0.1"]
    assert said(latinpc("solve", "truss-grid", "--modules", "12", "--quiet", *loose))[-1].endswith("smaller -ksp_rtol")


@pytest.mark.parametrize("file", sorted((ROOT / "options").glob("*.opts")), ids=lambda path: path.stem)
def test_options_files_leave_no_option_unused(file):
    scene = ["truss-grid" if file.stem == "cg" else "tensegrity-grid", "--modules", "12"]
    result = latinpc("solve", *scene, "--quiet", "-options_file", file, "-options_left")
    left = re.findall(r"Option left: name:(-\S+)", result.stdout)
    assert left == [], result.stdout
    assert "There are no unused options" in result.stdout


# ---- bad input -------------------------------------------------------------------------------

BAD = [
    (["solve", "tensegrity"], "unknown scene 'tensegrity'"),
    (["solve", "nowhere.msh"], "nowhere.msh: no such file"),
    (["solve", "network", "--modules", "3"], "--modules has no meaning for the scene network"),
    (["solve", TOWER, "--slack", "0.1"], "--slack has no meaning for a file, which takes --scale, --merge, --raise"),
    (["solve", TOWER, "--EA", "stiff"], "--EA stiff: write a number, or GROUP=number"),
    (["solve", TOWER, "--EA", "1", "--EA", "2"], "--EA 2: given twice"),
    (["solve", TOWER, "--EA", "1"], "--EA: no line is left that needs it: tower.msh or tower.toml"),
    (["solve", "network", "--EA", "1"], "--EA has no meaning for the scene network"),
    (["solve", "network", "--load", "z=1"], "--load z=1: a scene takes one number"),
    (["solve", "network", "--load", "1", "--load", "2"], "--load 1 2: a scene takes one number"),
    (["solve", TOWER, "--subdomains", "145"], "144 links"),
    (["solve", TOWER, "--subdomains", "0"], "--subdomains 0"),
    (["solve", "tensegrity-grid", "--modules", "12", "--subdomains", "7"], "7 subdomains"),
    (["solve", "tensegrity-grid", "--modules", "12", "--partition", "random"], "partition must be"),
    (["solve", TOWER, "--output", "r.stl"], "r.stl"),
    (["solve", "net", "--subdomains", "-1"], "--subdomains -1: give 1 or more"),
    (["cases", TOWER, "--subdomains", "0"], "--subdomains 0: give 1 or more"),
    (["solve", TOWER, "--num-steps", "1", "--output-every", "2"], "--output-every is for the states of a motion: give"),
    (
        ["solve", TOWER, "--num-steps", "1", "--output-every", "-2", "--csv", "a.csv", "b.csv"],
        "--output-every -2: every",
    ),
    (["solve", TOWER, "--json", "a", "--quiet", "--json", "b"], "--json is given twice; keep one"),
    (["info", "--json", "a", "--json", "a"], "--json is given twice; keep one"),
    (["form", TOWER, "--picture", "a.png", "--picture", "b.png"], "--picture is given twice; keep one"),
    (["paper", "4", "--outer", "anderson", "--outer", "richardson"], "--outer is given twice; keep one"),
    (["modes", TOWER, "--node-mass", "-5"], "--node-mass -5: a mass is a finite number of kg, not negative"),
    (["solve", TOWER, "--num-steps", "1", "--node-mass", "inf"], "--node-mass inf: a mass is a finite number"),
    (["modes", TOWER, "--mode", "2"], "--mode is for animations: give --gif"),
    (["solve", TOWER, "--json", "nowhere/r.json"], "the folder nowhere does not exist"),
    (["solve", TOWER, "-options_file", "nowhere.opts"], "no such file"),
    (["solve", TOWER, "-fp_trap"], 'PETSc reads -fp_trap only when it starts: set PETSC_OPTIONS="-fp_trap"'),
    (["solve", TOWER, "--subdomains", "4", "-snes_latin_variant", "edges"], "edges"),
    (["solve", TOWER, "--subdomains", "4", "-snes_type", "latn"], "latn"),
    (["paper", "4", "--subdomains", "10"], "10 subdomains"),
    (["extremes", "--family", "large"], "--family and --seed are of random structures: add --random N"),
]


def test_info_of_petsc():
    """PETSc reads it when it starts, from the environment."""
    result = latinpc("solve", "packing", "--side", "20", "--law", "friction", env={"PETSC_OPTIONS": "-info :latin"})
    assert "[0] <latin> LatinCoulombDone_Private(): length" in result.stdout


@pytest.mark.parametrize(("arguments", "word"), BAD, ids=[" ".join(map(str, case[0][1:]))[-40:] for case in BAD])
def test_bad_input_is_one_clear_line(arguments, word, tmp_path, monkeypatch, capsys, options):
    options()  # takes the options out of the database again
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as caught:
        cli.main(arguments)
    result = capsys.readouterr()
    assert caught.value.code == 2, result.out + result.err
    assert result.err.count("\n") == 1 and result.err.startswith("latinpc: ") and word in result.err
    assert not result.out
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("case", [1, 4, 11], ids=["missing file", "too many subdomains", "unknown value"])
def test_bad_input_on_two_ranks_ends_both(case, tmp_path):
    arguments, word = BAD[case]
    result = latinpc(*arguments, ranks=2, code=2, cwd=tmp_path, timeout=30)
    assert len(said(result)) == 1 and word in result.stderr


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_mechanism_names_the_nodes_that_move(tmp_path, ranks):
    (tmp_path / "frame.msh").write_text(MSH)
    (tmp_path / "frame.toml").write_text(
        TOML.replace("[supports.feet]", "[supports.top]").replace("[loads.top]", "[loads.feet]")
    )
    result = latinpc("solve", tmp_path / "frame.msh", "--subdomains", 1, ranks=ranks, code=2, timeout=30)
    assert re.search(r"mechanism.*Nodes that move.*: 10, 20\.", result.stderr), result.stderr


def test_a_failure_of_one_rank_ends_the_others(mpirun):
    script = """
import sys
from mpi4py import MPI
import latinpc as package
from latinpc import blas, cli

def fails(options):
    raise ValueError("only here")

if MPI.COMM_WORLD.rank == 1:
    cli.insert_petsc_options = fails
cli.ranks.GATHERING_SECONDS = 0.5
cli.main(["solve", sys.argv[1], "--subdomains", "2"])
"""
    result = mpirun(2, script, TOWER, check=False, timeout=30)
    assert result.returncode == 2
    assert "latinpc: rank 1: only here" in result.stderr


def test_a_folder_with_the_name_of_a_scene_and_files_without_their_suffix(tmp_path):
    (tmp_path / "mast").mkdir()
    (tmp_path / "mast" / "nodes.csv").write_text("node,x,fix\na,0,x\nb,1,\n")
    (tmp_path / "mast" / "members.csv").write_text("start,end,EA\na,b,1\n")
    said = "latinpc: mast is the built-in scene; the folder of that name is ./mast"
    assert said in latinpc("solve", "mast", cwd=tmp_path).stderr.splitlines()
    assert "2 nodes, 1 link" in latinpc("solve", "./mast", cwd=tmp_path).stdout
    (tmp_path / "hall-nodes.csv").write_text("")
    (tmp_path / "halls.msh").write_text("")
    assert "; here is hall-nodes.csv" in latinpc("solve", "hall", cwd=tmp_path, code=2).stderr


def test_missing_scene_after_a_flag_of_petsc():
    result = latinpc("solve", "-snes_monitor", TOWER, code=2)
    assert "put SCENE before" in result.stderr


def test_one_dash_for_two_is_noticed():
    (text,) = said(latinpc("solve", TOWER, "--subdomains", 1, "--quiet", "-pictur", "t.png", code=2))
    assert text.startswith("latinpc: no solver has read -pictur: ")
    assert text.endswith("; with two dashes there is --picture")


def test_misspelt_option_of_ours_names_the_nearest():
    result = latinpc("solve", TOWER, "--subdomains", 2, "--quiet", "-snes_latin_varant", "macro", code=2)
    text = "latinpc: unknown option -snes_latin_varant: do you mean -snes_latin_variant?"
    assert said(result) == [f"{text} (--any-option goes on)"]
    how = ("solve", TOWER, "--subdomains", 2, "--quiet", "-snes_latin_varant", "macro", "--any-option")
    assert said(latinpc(*how)) == [
        text,
        "latinpc: no solver has read -snes_latin_varant: misspelt, or of no use to this solver",
    ]


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (["-snes_latn_error", 1], "snes_latin_error"),
        (["-sens_latin_error", 1], "snes_latin_error"),
        (["-snes_lattin_eror", 1], "snes_latin_error"),
        (["-pc_latin_varaint", "macro"], "pc_latin_variant"),
        (["-snes_latn_newton_ksp_rtol", 0.1], "snes_latin_newton_ksp_rtol"),
        (["-ts_latin_moniter"], "ts_latin_monitor"),
    ],
)
@pytest.mark.parametrize("way", ["words", "file", "environment"])
def test_misspelt_options_stop_the_command(words, meant, way, tmp_path):
    """Before any work, whichever way they come."""
    text = " ".join(map(str, words))
    (tmp_path / "a.opts").write_text(text)
    how = {"words": words, "file": ["-options_file", tmp_path / "a.opts"], "environment": []}[way]
    env = {"PETSC_OPTIONS": text} if way == "environment" else {}
    result = latinpc("solve", TOWER, *how, env=env, code=2)
    assert f"unknown option {words[0]}: do you mean -{meant}? (--any-option goes on)" in result.stderr
    assert not result.stdout


@pytest.mark.parametrize("ranks", [1, 2])
def test_what_no_solver_has_read_is_bad_input(ranks):
    """Options of PETSc are known only once they are read: the results are there all the same."""
    how = ("solve", TOWER, "--subdomains", 2, "-snes_montior", "-snes_rtoll", "1e-9", "-log_view", "-snes_view")
    result = latinpc(*how, ranks=ranks, code=2)
    assert "no solver has read -snes_montior, -snes_rtoll: misspelt, or of no use to this solver" in result.stderr
    assert "converged in" in result.stdout
    latinpc(*how, "--any-option", ranks=ranks)


def test_options_of_petsc_are_no_misspelt_ones_of_ours():
    """All that -help lists."""
    listed = latinpc("solve", TOWER, "-help", "-pc_type", "latin", "--any-option").stdout
    names = re.findall(r"^ +-(\w+):? ", listed, re.MULTILINE)
    assert len(names) > 200 and not unknown_options(names)


def test_ranks_print_whole_lines_without_escapes():
    """Open MPI gives ranks a terminal of its own: what they print into a file is that of one process into a pipe."""
    printed = latinpc("solve", "mast", ranks=2, alone=True).stdout
    assert "\033" not in printed and "  accuracy       estimated error" in printed
    assert [line.split()[0] for line in printed.splitlines()[:3]] == ["mast", "structure", "solve"]
