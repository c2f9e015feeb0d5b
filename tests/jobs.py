"""The loop of ranks that take one job after another: ``mpirun -n 4 jobs.py PROGRAM FOLDER``, begun by `conftest.Ranks`.

PROGRAM is a module of this folder with a function ``job(*words)``, called on all ranks with the words of each job; what
it returns on rank 0 is the result. Options of PETSc's among the words count for the job alone.
"""

import importlib
import json
import sys
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
        else:
            options[names[-1]] = word
    return words[:first], options


def main(program, folder):
    """Take jobs until there are no more."""
    from petsc4py import PETSc

    from latinpc import _latin
    from latinpc.options import default_options

    job, rank = importlib.import_module(program).job, PETSc.COMM_WORLD.rank
    with open(Path(folder, str(rank))) as jobs, open(Path(folder, "results"), "w") as results:
        for line in iter(jobs.readline, "null\n"):
            words, options = split(json.loads(line))
            with default_options(options):
                result = job(*words)
                unused = [name for name in options if not _latin.option_used(name)]
            if rank == 0:
                print(json.dumps({"unused": unused, **result}), file=results, flush=True)


if __name__ == "__main__":
    petsc4py.init([sys.argv[0], "-skip_petscrc"])
    main(*sys.argv[1:])
