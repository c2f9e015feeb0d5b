"""The command line as tests run it."""

import contextlib
import io
import re
import signal
import sys
from pathlib import Path
from types import SimpleNamespace

from conftest import OF_A_PROCESS, run
from petsc4py import PETSc

BAD_INPUT = 2
JOB = Path(__file__).with_name("command_job.py")


def latinpc(*arguments, ranks=1, code=0, alone=False, **how):
    """Run the command and check its exit code.

    What it is to refuse, on one rank, needs no process of its own; what it is to solve, goes to ranks that are there,
    unless it is to be `alone`, or PETSc has something to say when it ends.
    """
    known = how.keys() <= {"cwd", "timeout"} and not any(str(word).startswith(OF_A_PROCESS) for word in arguments)
    if known and code < BAD_INPUT and not alone and latinpc.ranks_for is not None:
        words = [how.pop("cwd", "."), *arguments]
        done = latinpc.ranks_for(ranks, JOB, Path(words[0]).absolute(), *words[1:], **how)
        assert done["code"] == code, done["out"] + done["err"]
        assert not re.search(r"\bnan\b", done["out"], re.IGNORECASE)
        return SimpleNamespace(returncode=code, stdout=done["out"], stderr=done["err"])
    script = Path(sys.executable).with_name("latinpc")
    command = [script] if script.exists() else [sys.executable, "-P", "-c", "from latinpc.cli import main; main()"]
    if ranks > 1:
        command = ["mpirun", "-n", ranks, *command]
    here = code == BAD_INPUT and ranks == 1 and how.keys() <= {"cwd"}
    result = run_here(*arguments, **how) if here else run([*command, *arguments], check=False, **how)
    assert result.returncode == code, result.stdout + result.stderr
    assert not re.search(r"\bnan\b", result.stdout, re.IGNORECASE)
    return result


latinpc.ranks_for = None  # set by `conftest.command_on_ranks`


def run_here(*arguments, cwd="."):
    """Run the command in this process, and leave PETSc's options and the signals as they were."""
    from latinpc import cli  # ranks that import tests have no use for it

    out, err, code = io.StringIO(), io.StringIO(), None
    options, pipe = PETSc.Options().getAll(), signal.getsignal(signal.SIGPIPE)
    with contextlib.chdir(cwd), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            cli.main([str(word) for word in arguments])
        except SystemExit as ended:
            code = ended.code
    signal.signal(signal.SIGPIPE, pipe or signal.SIG_DFL)
    for name in PETSc.Options().getAll().keys() - options.keys():
        PETSc.Options().delValue(name)
    return SimpleNamespace(returncode=code, stdout=out.getvalue(), stderr=err.getvalue())


def said(result):
    """Return what we said on stderr, without mpirun's own lines."""
    return [line for line in result.stderr.splitlines() if line.startswith("latinpc: ")]
