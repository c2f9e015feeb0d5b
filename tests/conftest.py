"""What every test shares: one PETSc without stray options, and a way to run programs under MPI."""

import json
import os
import re
import select
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ENVIRONMENT = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "OMPI_MCA_hwloc_base_binding_policy": "none",
    "OMPI_MCA_mpi_yield_when_idle": "1",
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MPLBACKEND": "Agg",
}
# AddressSanitizer has to begin before the libraries of PETSc do, or the end of a program waits forever for a lock of
# libp11-kit's: it does where it is part of the program
SANITIZED = "libasan" in os.environ.get("LD_PRELOAD", "")
if SANITIZED:
    ENVIRONMENT |= {"OMPI_CC": "gcc -fsanitize=address", "OMPI_FC": "gfortran -fsanitize=address"}
# under valgrind each process writes a log into this folder
LOGS = os.environ.get("VALGRIND_LOGS")
PATIENCE = 60 if LOGS else 1  # as many times slower
# a worker of pytest-xdist is born of a process that has started MPI: what that one was told is not for this one
if os.environ.pop("PYTEST_XDIST_WORKER", None):
    for name in [name for name in os.environ if name.startswith(("OMPI_", "PMIX_", "ORTE_", "OPAL_"))]:
        del os.environ[name]
os.environ.update(ENVIRONMENT)
# neither the options of pytest nor those of the person who runs the tests are PETSc's business
os.environ.pop("PETSC_OPTIONS", None)

import petsc4py  # noqa: E402

petsc4py.init([sys.argv[0], "-skip_petscrc"])

import pytest  # noqa: E402
from petsc4py import PETSc  # noqa: E402
from valgrind_reports import reports, reports_in  # noqa: E402

ROOT = Path(__file__).resolve().parent.parent
CONFIG = petsc4py.get_config()
PETSC_FOLDERS = [Path(CONFIG["PETSC_DIR"], CONFIG["PETSC_ARCH"]), Path(CONFIG["PETSC_DIR"])]
# a PETSc with its own checks can also list what a program has allocated and not freed
MALLOC_DUMP = "PETSC_USE_DEBUG 1" in (PETSC_FOLDERS[0] / "include" / "petscconf.h").read_text()
LEAK = re.compile(r"^\[ *\d+\] ?(Total space allocated )?\d+ bytes", re.MULTILINE)
# what PETSc does when it begins or ends, or once for all
OF_A_PROCESS = ("-help", "-log", "-options_left", "-malloc", "-memory", "-citations", "-info", "-version")
# where each process is judged by what it leaves behind, programs of tests have processes of their own
APART = bool(SANITIZED or LOGS or MALLOC_DUMP)
# what AddressSanitizer and UBSan write of our library: a test that expects an error must not take theirs for it. They
# also report on Open MPI's daemons, which are none of ours
SANITIZER = re.compile(
    r"latinpc/src/\S*: runtime error: |ERROR: AddressSanitizer.*?^\s*#\d+ 0x[^\n]*latinpc", re.DOTALL | re.MULTILINE
)


def environment(LD_PRELOAD="", **changes):
    """Our environment with changes; the sanitizers' library, where there is one, goes before others, but for None."""
    preloaded = ":".join(filter(None, (os.environ.get("LD_PRELOAD"), LD_PRELOAD))) if LD_PRELOAD is not None else ""
    if MALLOC_DUMP:
        changes.setdefault("PETSC_OPTIONS", "-malloc_dump")
    return {**os.environ, **changes, "LD_PRELOAD": preloaded}


def run(command, timeout=120, check=True, cwd=None, env=None, leaks=True):
    """Run a program with its own process group, and leave nothing behind when it hangs.

    Without `leaks` it goes on after errors, and what functions leave that return one is no loss.
    Returns a subprocess.CompletedProcess with text in stdout and stderr.
    """
    if not leaks:
        env = {"PETSC_OPTIONS": "", **(env or {})}  # no list of it
    process = begin(command, cwd, env, subprocess.PIPE, subprocess.PIPE)
    try:
        out, err = process.communicate(timeout=timeout * PATIENCE)
    except subprocess.TimeoutExpired:
        end(process)
        out, err = process.communicate()
        pytest.fail(f"{' '.join(process.args)}: not over after {timeout} s\n{out}\n{err}")
    return judged(process, out, err, check, leaks)


def begin(command, cwd, env, stdout, stderr):
    """Begin a program with its own process group; returns a subprocess.Popen."""
    env = environment(**(env or {}))
    if LOGS:
        env["VALGRIND_LOGS"] = tempfile.mkdtemp(dir=LOGS)
    process = subprocess.Popen(
        [str(word) for word in command],
        stdin=subprocess.DEVNULL,
        stdout=stdout,
        stderr=stderr,
        text=True,
        cwd=cwd,
        env=env,
        start_new_session=True,
    )
    process.logs = env.get("VALGRIND_LOGS")
    return process


def end(process):
    """End a program that goes on: mpirun ends its ranks, which are in groups of their own."""
    os.killpg(process.pid, signal.SIGTERM)
    try:
        process.wait(timeout=10)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)


def judged(process, out, err, check, leaks):
    """Return what a program has done, or fail with what it was reported for."""
    command = " ".join(process.args)
    if SANITIZER.search(err):
        pytest.fail(f"{command}: reported by a sanitizer\n{out}\n{err}")
    if LOGS and (found := reports_in(process.logs, leaks=leaks and process.returncode == 0)):
        pytest.fail("\n\n".join([f"{command}: reported by valgrind", *found]))
    if check and process.returncode:
        pytest.fail(f"{command}: exit code {process.returncode}\n{out}\n{err}")
    if check and MALLOC_DUMP and LEAK.search(out):
        pytest.fail(f"{command}: memory left\n{out}\n{err}")
    return subprocess.CompletedProcess(process.args, process.returncode, out, err)


if LOGS:

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(config, items):
        """With VALGRIND=first, keep the first case of each test."""
        if os.environ.get("VALGRIND") != "first":
            return
        seen = set()
        first = [item for item in items if not (item.function in seen or seen.add(item.function))]
        config.hook.pytest_deselected(items=[item for item in items if item not in first])
        items[:] = first

    @pytest.fixture(autouse=True)
    def valgrind():
        """Fail the test during which valgrind reports on our library in pytest's own process."""
        log = Path(LOGS, f"{os.getpid()}.log")
        end = log.stat().st_size
        yield
        if found := reports(log, end)[0]:
            pytest.fail("\n\n".join(["reported by valgrind", *found]))


@pytest.fixture
def mpirun(tmp_path, ranks_for):
    """Run a program on some ranks: ``mpirun(2, "script.py", "-option", ...)``.

    The program is a Python file, a Python source (any text with a line break), or an executable. Python that is to
    succeed runs on ranks that are there already, unless it is to be `alone`, or something of the process is changed.
    Without `leaks` it may leave memory, as what returns an error does.
    """

    def launch(ranks, program, *args, alone=APART, leaks=True, **how):
        program = str(program)
        if "\n" in program:
            script = tmp_path / f"script{len(list(tmp_path.glob('script*.py')))}.py"
            script.write_text(program)
            program = str(script)
        alone = alone or any(str(word).startswith(OF_A_PROCESS) for word in args)
        if program.endswith(".py") and not alone and how.keys() <= {"timeout"}:
            done = ranks_for(ranks, program, *args, **how)
            if done["code"]:
                pytest.fail(f"{program}: exit code {done['code']}\n{done['out']}\n{done['err']}")
            return subprocess.CompletedProcess([program, *map(str, args)], 0, done["out"], done["err"])
        command, how["env"] = on_ranks(ranks, program, *args, env=how.get("env", {}))
        return run(command, leaks=leaks, **how)

    return launch


def on_ranks(ranks, program, *args, env):
    """Return the command that runs a program on some ranks, and its environment."""
    command = [program, *args]
    if str(program).endswith(".py"):
        command.insert(0, sys.executable)
    if ranks > 1 and SANITIZED:  # mpirun itself has faults of its own to report
        preloaded = environment(**env)["LD_PRELOAD"]
        env = {**env, "LD_PRELOAD": None}
        command = ["-x", f"LD_PRELOAD={preloaded}", *command]
    if ranks > 1:
        command = ["mpirun", "-n", ranks, *command]
    return command, env


class Ranks:
    """Ranks that take one job after another (`jobs.py`): what they share is begun once, and a job costs its work alone.

    Jobs and results go through pipes with names, at which ranks wait without using a core.
    """

    def __init__(self, ranks, folder):
        self.ranks, self.folder = ranks, folder
        for name in ("results", *range(ranks)):
            os.mkfifo(folder / str(name))
        # open for both directions: that does not wait for the other end
        self.jobs = [os.open(folder / str(rank), os.O_RDWR) for rank in range(ranks)]
        self.results = os.open(folder / "results", os.O_RDWR)
        self.printed = [folder / "out", folder / "err"]
        command, env = on_ranks(ranks, ROOT / "tests" / "jobs.py", folder, env={})
        with self.printed[0].open("w") as out, self.printed[1].open("w") as err:
            self.process = begin(command, None, env, out, err)

    def tell(self, words):
        """Send all ranks a line."""
        for pipe in self.jobs:
            os.write(pipe, (json.dumps(words) + "\n").encode())

    def do(self, words, timeout=120):
        """Do a job; fail where it does not end, or ends the ranks."""
        self.tell([str(word) for word in words])
        result, last = b"", time.monotonic() + timeout * PATIENCE
        while not result.endswith(b"\n"):
            if select.select([self.results], [], [], 0.5)[0]:
                result += os.read(self.results, 1 << 16)
            elif (ended := self.process.poll() is not None) or time.monotonic() > last:
                if not ended:
                    end(self.process)
                files = [*self.printed, *sorted(self.folder.glob("*.txt"))]
                pytest.fail(f"{words}: no result\n" + "\n".join(file.read_text() for file in files))
        printed = {name: [self.folder / f"{name}{rank}.txt" for rank in range(self.ranks)] for name in ("out", "err")}
        return json.loads(result) | {name: "".join(map(Path.read_text, files)) for name, files in printed.items()}

    def close(self):
        """End the ranks, and judge what they have left."""
        if self.process.poll() is None:
            self.tell(None)
            try:
                self.process.wait(timeout=60 * PATIENCE)
            except subprocess.TimeoutExpired:
                end(self.process)
                self.process.wait()
            judged(self.process, *(file.read_text() for file in self.printed), check=True, leaks=True)
        for pipe in (self.results, *self.jobs):
            os.close(pipe)


@pytest.fixture(scope="module" if APART else "session")
def ranks_for(tmp_path_factory):
    """Give jobs to ranks that stay for all tests: ``ranks_for(4, "matis_program", "--cells", 8)``.

    A job is a module of this folder with a function ``job(*words)``, or the path of a script.
    """
    begun = {}

    def do(ranks, program, *words, **how):
        if ranks not in begun or begun[ranks].process.poll() is not None:
            begun[ranks] = Ranks(ranks, tmp_path_factory.mktemp("ranks"))
        return begun[ranks].do([program, *words], **how)

    yield do
    for one in begun.values():
        one.close()


@pytest.fixture(scope="module" if APART else "session", autouse=True)
def command_on_ranks(ranks_for):
    """Let the command line of tests run on the ranks that are there."""
    import command

    command.latinpc.ranks_for = None if APART else ranks_for
    yield
    command.latinpc.ranks_for = None


@pytest.fixture
def options():
    """PETSc's options database, put back as it was after the test: ``options("-snes_rtol", 1e-8)``."""
    database = PETSc.Options()
    before = database.getAll()

    def put(*words):
        database.insertString(" ".join(str(word) for word in words))
        return database

    yield put
    for name in database.getAll():
        if name not in before:
            database.delValue(name)
    for name, value in before.items():
        database.setValue(name, value)


@pytest.fixture(scope="session")
def compile_c(tmp_path_factory):
    """Compile a C program of tests/ that knows nothing of latinpc, or a library to preload; returns it."""
    folder = tmp_path_factory.mktemp("c")
    pkgconfig = os.pathsep.join(str(path / "lib" / "pkgconfig") for path in PETSC_FOLDERS)
    flags = run(["pkg-config", "--cflags", "--libs", "PETSc"], env={"PKG_CONFIG_PATH": pkgconfig}).stdout.split()
    folders = [word[2:] for word in flags if word.startswith("-L")]

    def build(name, *more):
        if SANITIZED and "-shared" in more:
            pytest.skip("a library preloaded beside AddressSanitizer's lets it start within glibc's lock of locales")
        program = folder / Path(name).stem
        if not program.exists():
            source = ROOT / "tests" / name
            rpath = [f"-Wl,-rpath,{path}" for path in folders]
            run(["mpicc", "-O1", source, "-o", program, *flags, *more, *rpath, "-lm"])
        return program

    return build
