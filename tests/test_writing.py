"""Files that latinpc writes: what they replace, what they refuse and leave as it was, and what is left after errors."""

import os
import socket
import stat
from contextlib import contextmanager
from pathlib import Path
from xml.etree import ElementTree

import pytest
from petsc4py import PETSc
from support import STATES, chain

import latinpc
from latinpc.files.npz import save_scene
from latinpc.options import default_options
from latinpc.results.atomic import atomic, check_readable, check_writable
from latinpc.results.vtk import write_vtu

NAMES = ("report.json", *STATES)  # results, written in Python; states, written in C, in both formats


def solver(comm=PETSc.COMM_SELF):
    """Give a SNES and its solution vector, whose state is fast to write."""
    structure = latinpc.Structure.from_scene(chain(), comm=comm)
    with default_options({"snes_type": "newtonls", "pc_type": "jacobi"}):
        snes = structure.create_snes()
        snes.setFromOptions()
    return snes, structure.create_vec()


def write(path):
    """Write a result or a state."""
    if not str(path).endswith(".json"):
        snes, u = solver()
        latinpc.save_state(snes, path, u, b"new")
        return
    with atomic(path) as temporary:
        Path(temporary).write_bytes(b"new")


def is_new(path):
    """Whether a file is what `write` writes, whole."""
    if str(path).endswith(".json"):
        return path.read_bytes() == b"new"
    snes, u = solver()
    return latinpc.load_state(snes, path, u) == b"new"


def refused(call, *arguments):
    """Return the message of the error that a call ends with."""
    with pytest.raises((OSError, PETSc.Error)) as error:
        call(*arguments)
    if isinstance(error.value, OSError):
        return f"{error.value.filename or ''} {error.value}"
    return latinpc.error_message(error.value)


# ---- names ---------------------------------------------------------------------------------------
def test_a_name_of_another_kind_of_file_is_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scene = latinpc.scenes.make("mast")
    result, cases = scene.solve(), latinpc.solve_cases(scene, [latinpc.Case("dead")])
    form = latinpc.form_find(
        [[0, 0], [1, 0], [2, 0]], [[0, 1], [1, 2]], [[1, 1], [0, 0], [1, 1]], 5.0, load=[[0, -1]] * 3
    )
    for write_it, name, kinds in (
        (result.to_csv, "a.xlsx", "csv"), (cases.to_csv, "a.txt", "csv"), (form.to_npz, "a.csv", "npz"),
        (result.to_vtu, "a.csv", "vtu"), (form.to_vtu, "a.pvd", "vtu"), (result.to_dxf, "a.dwg", "dxf"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=f"^{name}: cannot write '.*' files here; use .{kinds}"):
            write_it(name)
    assert not list(tmp_path.iterdir())


# ---- what is no regular file ---------------------------------------------------------------------


def make_socket(path):
    """Leave a socket there, which nobody listens on."""
    with socket.socket(socket.AF_UNIX) as end:
        os.chdir(path.parent)  # names of sockets are short
        end.bind(path.name)


THINGS = {"folder": Path.mkdir, "named pipe": os.mkfifo, "socket": make_socket}


@pytest.fixture(params=THINGS)
def thing(request, tmp_path, monkeypatch):
    """Give the name of something that is no regular file, and what it is."""
    monkeypatch.chdir(tmp_path)

    def put(name):
        THINGS[request.param](tmp_path / name)
        return tmp_path / name, request.param

    return put


def identity(path):
    """What must not change, nor what a link leads to."""
    return [(entry.st_ino, entry.st_mode, entry.st_rdev, entry.st_mtime_ns) for entry in (path.lstat(), path.stat())]


@pytest.mark.parametrize("name", NAMES)
def test_what_is_no_regular_file_is_refused_and_left(name, thing, tmp_path):
    path, kind = thing(name)
    link = tmp_path / f"link-{name}"
    link.symlink_to(name)
    for given in (path, link):
        before, there = identity(given), sorted(os.listdir(tmp_path))
        calls = [(write, given), (check_writable, given), (check_readable, given)]
        if name in STATES:
            calls.append((is_new, given))
        for call in calls:
            said = refused(*call)
            assert str(given) in said and kind in said and "give another name" in said, said
        assert identity(given) == before and sorted(os.listdir(tmp_path)) == there


def call(*words):
    """Run the command line in this process: its exit code."""
    from latinpc.cli import main

    with pytest.raises(SystemExit) as end:
        main([*map(str, words)])
    return end.value.code


OPTIONS = {
    "--json": ("report.json", ["lattice"]),
    "--output": ("out.vtu", ["lattice"]),
    "--picture": ("picture.png", ["lattice"]),
    "--checkpoint": ("state", ["lattice", "--increments", 2]),
    "--restart": ("state", ["lattice", "--increments", 2]),
    "frames": ("out.pvd", ["impact-grid", "--modules", 4, "--num-steps", 2]),
}


@pytest.mark.parametrize("option", OPTIONS)
def test_the_command_line_refuses_it_before_it_works(option, thing, tmp_path, monkeypatch, capsys):
    name, words = OPTIONS[option]
    path, kind = thing(name)
    monkeypatch.setattr("latinpc.cli.solve.open_scene", lambda *_: pytest.fail("a scene is made"))
    before = identity(path)
    assert call("solve", *words, option.replace("frames", "--output"), name) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"latinpc: {name}: is a") and kind in said and "give another name" in said
    assert identity(path) == before and os.listdir(tmp_path) == [name]


@pytest.mark.parametrize("words", [["compare", "lattice"], ["tradeoff", "lattice"], ["extremes"], ["paper", 3]])
def test_other_commands_refuse_it_too(words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    os.mkfifo("report.json")
    assert call(*words, "--json", "report.json") == 2
    assert "report.json: is a named pipe, not a regular file" in capsys.readouterr().err
    assert Path("report.json").is_fifo()


def test_other_mistakes_are_found_before_any_work(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("latinpc.cli.solve.open_scene", lambda *_: pytest.fail("a scene is made"))
    Path("film").write_text("of the user's")
    Path("dangling.json").symlink_to("nowhere/report.json")
    for words, sentence in (
        (["--num-steps", 2, "--output", "film.pvd"], "film.pvd: its states cannot be written into film"),
        (["--json", "nowhere/a.json"], "nowhere/a.json: the folder nowhere does not exist; create it first"),
        (["--json", "dangling.json"], "dangling.json: the folder nowhere does not exist; create it first"),
        (["--json", "film/a.json"], "film/a.json: Not a directory"),
        (["--json", "new/"], "'new/': there is no such folder"),
        (["--output", "a.xyz"], "a.xyz: cannot write '.xyz' files here; use .vtu"),
        (["--increments", 2, "--checkpoint", "a.gz"], "--checkpoint a.gz: PETSc takes .gz files for compressed ones"),
        (["--increments", 2, "--restart", "nothing"], "nothing: No such file or directory"),
    ):
        assert call("solve", "impact-grid", *words) == 2
        assert f"latinpc: {sentence}" in capsys.readouterr().err
    assert sorted(os.listdir()) == ["dangling.json", "film"]


BARS = "start,end,EA\n1,2,1e6\n"
ENDS = "x,fix,Fx\n0,x,\n1,,1\n"


@pytest.mark.parametrize(("words", "sentence"), [
    (["solve", "bar-nodes.csv", "--csv", "a.csv", "bar-members.csv"], "bar-members.csv: is read, and cannot be"),
    (["solve", "bar-nodes.csv", "--csv", "./a.csv", "a.csv"], "a.csv: is written already"),
    (["solve", "bar-nodes.csv", "--output", "same.vtu", "--output", "a.vtu"], "a.vtu: is written already"),
    (["solve", "bar-nodes.csv", "--json", "bar.toml"], "bar.toml: is read, and cannot be written too; give another"),
    (["solve", "bar-nodes.csv", "--num-steps", 1, "--history", "a.csv", "--csv", "b.csv", "a.csv"], "a.csv: is read"),
    (["cases", "bar-nodes.csv", "--csv", "bar-members.csv"], "bar-members.csv: is read"),
    (["form", "bar-nodes.csv", "--natural", "--csv", "bar-members.csv", "bar-nodes.csv"], "bar-members.csv: is read"),
    (["modes", "bar-nodes.csv", "--json", "bar.toml"], "bar.toml: is read"),
    (["compare", "bar-nodes.csv", "--json", "bar.toml"], "bar.toml: is read"),
], ids=str)  # fmt: skip
def test_no_file_is_written_twice_or_over_one_that_is_read(words, sentence, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("bar-nodes.csv").write_text(ENDS)
    Path("bar-members.csv").write_text(BARS)
    Path("bar.toml").write_text("dim = 1\n")
    Path("same.vtu").symlink_to("a.vtu")
    assert call(*words) == 2
    assert f"latinpc: {sentence}" in capsys.readouterr().err
    assert Path("bar-members.csv").read_text() == BARS and not Path("a.vtu").exists()


def test_every_output_is_written(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert call("solve", "lattice", "--output", "a.vtu", "--output", "b.vtu") == 0
    assert "written        a.vtu, b.vtu" in capsys.readouterr().out
    assert Path("a.vtu").read_bytes() == Path("b.vtu").read_bytes()
    assert call("solve", "impact-grid", "--modules", 4, "--num-steps", 1, "--output", "c.pvd", "--output", "d.vtu") == 0
    assert Path("c.pvd").exists() and Path("d.vtu").exists()


RANKS = """
import sys
import petsc4py
petsc4py.init(sys.argv[:1] + ["-skip_petscrc"])
from mpi4py import MPI
from petsc4py import PETSc
sys.path.insert(0, sys.argv[1])
import latinpc
from test_writing import solver
snes, u = solver(PETSc.COMM_WORLD)
for call in (lambda path: latinpc.save_state(snes, path, u), lambda path: latinpc.load_state(snes, path, u)):
    for path in sys.argv[2:]:
        try:
            call(path)
            raise SystemExit("no error")
        except PETSc.Error as error:
            print(f"{latinpc.error_message(error)}\\n", end="", flush=True)
from latinpc.cli import main
main(["solve", "lattice", "--increments", "2", "--checkpoint", sys.argv[2]])
"""


@pytest.mark.parametrize("ranks", [2, 4])
def test_every_rank_refuses_it(ranks, mpirun, tmp_path):
    paths = [tmp_path / name for name in STATES]
    for path in paths:
        os.mkfifo(path)
    ended = mpirun(ranks, RANKS, Path(__file__).parent, *paths, check=False)
    assert ended.returncode == 2
    lines = ended.stdout.splitlines()
    for path in paths:
        for words in "cannot be written, an older one is unchanged", "cannot be read":
            whole = f"The state {path} {words}: it is a named pipe, not a regular file; give another name"
            assert sum(whole in line for line in lines) == ranks, ended.stdout
        assert path.is_fifo()
    assert f"latinpc: {paths[0]}: is a named pipe" in ended.stderr


# ---- links and modes --------------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_links_stay_and_their_targets_are_replaced(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for folder in ("store", "other", "store/deep"):
        Path(folder).mkdir()
    links = {  # from one folder to the next, relative to where each is, and by way of a linked folder
        f"first-{name}": f"other/second-{name}",
        f"other/second-{name}": f"../linked/../third-{name}",
        f"store/third-{name}": str(tmp_path / "store" / name),
    }
    Path("linked").symlink_to("store/deep")
    for link, target in links.items():
        Path(link).symlink_to(target)
    for _ in range(2):  # the target is made, then replaced
        write(Path(f"first-{name}"))
        assert is_new(Path("store", name)) and not Path("store", name).is_symlink()
        assert {link: os.readlink(link) for link in links} == links
        Path("store", name).write_text("old")
    files = {str(path) for path in Path(".").rglob("*")} - set(links)
    assert files == {"store", "other", "linked", "store/deep", f"store/{name}"}


@pytest.mark.parametrize("name", NAMES)
def test_links_that_lead_nowhere_are_refused(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path(f"a-{name}").symlink_to(f"b-{name}")
    Path(f"b-{name}").symlink_to(f"a-{name}")
    said = refused(write, f"a-{name}")
    assert f"a-{name}" in said and "Too many levels of symbolic links" in said
    Path(name).symlink_to(f"nowhere/{name}")
    said = refused(write, name)
    assert name in said and "folder" in said and ("create it" in said or "check that" in said)
    assert len(os.listdir()) == 3 and all(Path(entry).is_symlink() for entry in os.listdir())


@contextmanager
def umask(mask):
    """Set the mask of new files for a block."""
    before = os.umask(mask)
    try:
        yield
    finally:
        os.umask(before)


@pytest.mark.parametrize("name", NAMES)
def test_modes_are_kept_and_new_files_follow_the_mask(name, tmp_path):
    path = tmp_path / name
    for mask in (0o022, 0o027, 0o077, 0o000):
        with umask(mask):
            path.unlink(missing_ok=True)
            write(path)
            assert stat.S_IMODE(path.stat().st_mode) == 0o666 & ~mask
            for mode in (0o600, 0o640, 0o664, 0o755):
                path.chmod(mode)
                write(path)
                assert stat.S_IMODE(path.stat().st_mode) == mode


@pytest.mark.parametrize("name", NAMES)
def test_long_names_are_written_and_longer_ones_refused(name, tmp_path):
    path = tmp_path / name.rjust(255, "n")
    write(path)
    assert is_new(path) and os.listdir(tmp_path) == [path.name]
    assert "File name too long" in refused(write, tmp_path / name.rjust(256, "n"))
    assert os.listdir(tmp_path) == [path.name]


# ---- errors while writing -----------------------------------------------------------------------------


def test_an_interrupted_write_leaves_the_former_file(tmp_path):
    path = tmp_path / "report.json"
    path.write_text("former")
    with pytest.raises(RuntimeError), atomic(path) as temporary:
        Path(temporary).write_text("half")
        raise RuntimeError("interrupted")
    assert path.read_text() == "former"
    assert os.listdir(tmp_path) == ["report.json"]


@pytest.mark.parametrize("file", STATES)
def test_what_a_killed_run_has_left_goes_with_the_next_state(file, tmp_path):
    path, left = tmp_path / file, tmp_path / f".{file}.latinpc"
    left.write_bytes(os.urandom(100_000))
    write(path)
    assert is_new(path) and os.listdir(tmp_path) == [file]
    for make in (Path.mkdir, os.mkfifo, lambda name: name.symlink_to("nothing")):  # not of ours
        make(left)
        said = refused(write, path)
        assert f"The state {path} cannot be written, an older one is unchanged: " in said
        assert is_new(path) and os.path.lexists(left)
        left.rmdir() if left.is_dir() else left.unlink()


# every kind of file that latinpc writes, with room on the disk for nothing, for some bytes, for half of it
FULL = """
import os, resource, sys
from pathlib import Path
from xml.etree import ElementTree
sys.path.insert(0, sys.argv[1])
import petsc4py
petsc4py.init(sys.argv[:1] + ["-skip_petscrc"])
from test_writing import every_kind, refused

def everything():
    return {path: path.is_file() and path.read_bytes() for path in Path(".").rglob("*")}


os.chdir(sys.argv[2])
for name, call in every_kind().items():
    call(name)  # fonts and other caches are made now
    good = everything()
    for room in (0, 100, Path(name).stat().st_size // 2):
        resource.setrlimit(resource.RLIMIT_FSIZE, (room, resource.RLIM_INFINITY))
        said = refused(call, name)
        resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
        assert name.replace(".pvd", "/000000.vtu") in said and "None" not in said and ".latinpc-" not in said, said
        assert everything() == good, (name, room)
    call(name)
"""


def test_an_index_of_frames_is_xml_and_forgets_former_frames(tmp_path):
    """Whatever its name; frames of another series and other files stay."""
    from latinpc.results.vtk import write_pvd
    from latinpc.runs.motion import move
    from latinpc.scenes import make

    path, folder = tmp_path / "a&b.pvd", tmp_path / "a&b"
    for steps in (4, 2):
        write_pvd(path, move(make("bouncing-chain"), steps, comm=PETSc.COMM_SELF))
        named = [entry.get("file") for entry in ElementTree.parse(path).getroot().findall("Collection/DataSet")]
        assert named == [f"a&b/{step:06d}.vtu" for step in range(steps + 1)]
        assert sorted(file.name for file in folder.glob("0*.vtu")) == [name[4:] for name in named]
        for other in ("000009.vtu", "mine.vtu"):
            (folder / other).write_text("")
        path.write_text(path.read_text().replace("</Collection>", '<DataSet file="a&amp;b/mine.vtu"/></Collection>'))
        folder.joinpath("000009.vtu").rename(folder / "x9.vtu")
    assert (folder / "mine.vtu").exists() and (folder / "x9.vtu").exists()


def every_kind():
    """Give the functions that write each kind of file."""
    from latinpc.cli.printing import write_json
    from latinpc.results.film import draw_motion
    from latinpc.results.pictures import draw_structure
    from latinpc.results.vtk import write_pvd
    from latinpc.runs.motion import move
    from latinpc.scenes import make

    scene = make("bouncing-chain")
    motion = move(scene, 3, comm=PETSc.COMM_SELF)
    last = motion.frames[-1]

    def draw(path):
        draw_structure(scene, last.displacements, last.tensions, path=path)

    found = {
        "a.json": lambda path: write_json(path, {"numbers": list(range(1000))}),
        "a.npz": lambda path: save_scene(path, scene),
        "a.vtu": lambda path: write_vtu(path, scene, last.displacements, last.tensions),
        "a.pvd": lambda path: write_pvd(path, motion),
        "a.gif": lambda path: draw_motion(motion, path),
    }
    found |= dict.fromkeys(("a.png", "a.pdf", "a.svg"), draw)
    return found | dict.fromkeys(STATES, write)


def test_a_full_disk_is_named_and_loses_nothing(mpirun, tmp_path):
    folder = tmp_path / "disk"
    folder.mkdir()
    mpirun(1, FULL, Path(__file__).parent, folder)


# root may always write, and becomes a user who may not
FORBIDDEN = """
import os, sys
sys.path.insert(0, sys.argv[1])
import petsc4py
petsc4py.init(sys.argv[:1] + ["-skip_petscrc"])
from latinpc.results.atomic import check_writable
from test_writing import NAMES, refused, write

if os.getuid() == 0:
    os.setgroups([])
    os.setgid(65534)
    os.setuid(65534)
for name in NAMES:
    before = sorted(os.listdir())
    for call in (write, check_writable):
        said = refused(call, name)
        assert name in said and ("may not be written" in said or "may be written to" in said), said
    assert sorted(os.listdir()) == before
"""


@pytest.mark.parametrize(("folder_mode", "file_mode"), [(0o555, 0o666), (0o555, None), (0o777, 0o444)])
def test_what_may_not_be_written_is_refused(folder_mode, file_mode, mpirun, tmp_path):
    folder = tmp_path / "folder"
    folder.mkdir()
    for name in NAMES if file_mode else ():
        (folder / name).write_text("of the user's")
        (folder / name).chmod(file_mode)
    folder.chmod(folder_mode)
    mpirun(1, FORBIDDEN, Path(__file__).parent, cwd=folder)
    assert all((folder / name).read_text() == "of the user's" for name in os.listdir(folder))


AT_ONCE = """
import sys
sys.path.insert(0, sys.argv[1])
import petsc4py
petsc4py.init(sys.argv[:1] + ["-skip_petscrc"])
from petsc4py import PETSc
import latinpc
from test_writing import solver
snes, u = solver()
for _ in range(100):
    try:
        latinpc.save_state(snes, sys.argv[2], u, b"new")
    except PETSc.Error as error:
        assert "another run writes it at the same time" in latinpc.error_message(error), latinpc.error_message(error)
"""


def test_two_runs_with_one_file_leave_a_whole_one(mpirun, tmp_path):
    path = tmp_path / "one" / "state"
    path.parent.mkdir()
    mpirun(2, AT_ONCE, Path(__file__).parent, path)
    assert is_new(path) and os.listdir(path.parent) == ["state"]
