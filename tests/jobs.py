"""The loop of ranks that take one job after another: ``mpirun -n 4 jobs.py FOLDER``, begun by `conftest.Ranks`.

A job is a module of this folder with a function ``job(*words)``, called on all ranks with the words of the job; what it
returns on rank 0 is the result. Or it is the path of a script, run as by ``python SCRIPT WORDS``. Options of PETSc's
among the words count for the job alone. What a rank prints meanwhile goes to files of its own.
"""

import ctypes
import gc
import importlib
import json
import os
import runpy
import sys
import traceback
import warnings
from pathlib import Path

import petsc4py


def split(words):
    """Return our words, which come first, and PETSc's options by name; a flag has the value None."""
    first = next((i for i, word in enumerate(words) if word[:1] == "-" != word[1:2]), len(words))
    options, names = {}, []
    for word in words[first:]:
        if word[:1] == "-" and word[1:2].isalpha():
            names.append(word[1:])
            options[names[-1]] = None
        elif options[names[-1]] is None:  # PETSc overlooks what comes after a value
            options[names[-1]] = word
    return words[:first], options


def run_module(program, words):
    """Call the job of a module."""
    from latinpc import _latin
    from latinpc.options import default_options

    words, options = split(words)
    with default_options(options):
        result = importlib.import_module(program).job(*words)
        unused = [name for name in options if not _latin.option_used(name)]
    return {"unused": unused, **(result or {})}


def run_script(path, words):
    """Run a script; its options stand in PETSc's database, as those of a program of its own do."""
    from petsc4py import PETSc

    database = PETSc.Options()
    before = database.getAll()

    def init(args=None, **_):
        for name, value in split(list(args or [])[1:])[1].items():
            database.insertFile(value) if name == "options_file" else database.setValue(name, value)

    begin, argv, code = petsc4py.init, sys.argv, 0
    petsc4py.init, sys.argv = init, [path, *words]
    sys.path.insert(0, str(Path(path).parent))
    try:
        with warnings.catch_warnings():  # what a script changes of them is its own
            runpy.run_path(path, run_name="__main__")
    except SystemExit as ended:
        code = ended.code or 0
    finally:
        petsc4py.init, sys.argv = begin, argv
        sys.path.pop(0)
        gc.collect()
        for name in database.getAll().keys() - before.keys():
            database.delValue(name)
    return {"code": code}


def main(folder):
    """Take jobs until there are no more."""
    from petsc4py import PETSc

    comm, flush = PETSc.COMM_WORLD.tompi4py(), ctypes.CDLL(None).fflush
    with open(Path(folder, str(comm.rank))) as jobs, open(Path(folder, "results"), "w") as results:
        for line in iter(jobs.readline, "null\n"):
            program, *words = json.loads(line)
            for number, name in ((1, "out"), (2, "err")):
                with open(Path(folder, f"{name}{comm.rank}.txt"), "w") as file:
                    os.dup2(file.fileno(), number)
            try:
                result = (run_script if program.endswith(".py") else run_module)(program, words)
            except Exception:
                traceback.print_exc()
                sys.stderr.flush()
                os._exit(1)  # others may wait for this rank: mpirun ends them
            sys.stdout.flush()
            flush(None)
            comm.Barrier()
            if comm.rank == 0:
                print(json.dumps(result), file=results, flush=True)


if __name__ == "__main__":
    petsc4py.init([sys.argv[0], "-skip_petscrc"])
    main(*sys.argv[1:])
