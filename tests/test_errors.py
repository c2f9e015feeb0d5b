"""Bad input: the same clear sentence on every rank, no deadlock, and the process goes on.

Each case runs here on one rank; all of them run on two ranks in one `mpirun` of this very file.
"""

import json
import pickle
import re
import sys
from pathlib import Path

import mistakes_in_data
import mistakes_in_use
import numpy as np
import pytest
from conftest import run
from mistakes_in_data import FIXED, LINKS, LOAD, NODES, square
from mistakes_in_use import grid, solve
from petsc4py import PETSc

import latinpc

CASES = mistakes_in_data.CASES | mistakes_in_use.CASES
TIMEOUT = 90  # seconds, after which two ranks are taken to wait for each other


def the_process_goes_on():
    """Solve the square right: what a mistake leaves behind must not be in the way."""
    structure = square()
    snes, u = solve(structure, snes_latin_subdomains=2)
    assert snes.reason > 0
    axis = np.diff(NODES[LINKS], axis=1)[:, 0]
    axis /= np.linalg.norm(axis, axis=1)[:, None]
    B = np.zeros((8, 5, 2))
    for row, (a, b) in enumerate(LINKS):
        B[row, a], B[row, b] = -axis[row], axis[row]
    B = B.reshape(8, 10)[:, ~FIXED.ravel()]
    assert np.allclose(structure.displacements(u)[~FIXED], np.linalg.solve(1e3 * B.T @ B, LOAD[~FIXED]), rtol=1e-3)


def outcome(name):
    """The kind and the sentence of what a case raises."""
    try:
        CASES[name][1]()
    except Exception as error:
        return [type(error).__name__, latinpc.error_message(error)]
    return ["nothing", ""]


def check(name, found):
    kind, sentence = found
    assert kind in ("ValueError", "TypeError", "Error", "LatinError"), found
    assert re.search(CASES[name][0], sentence), sentence
    assert "\n" not in sentence


def test_the_text_of_an_error_is_its_sentence():
    """No C functions in it; they are in the trace, which PETSc's next error leaves as it is."""
    with pytest.raises(latinpc.LatinError) as caught:
        latinpc.Structure(NODES, LINKS, law="friction", fixed=FIXED, load=LOAD, stiffness=0.0)
    error = caught.value
    assert str(error).startswith("Link 0 is not part of a complete contact with friction")
    with pytest.raises(PETSc.Error, match="foo"):
        PETSc.Mat().create().setType("foo")
    assert "\n" not in str(error)
    assert "LatinStructureSetUp()" in error.trace and isinstance(error, PETSc.Error)
    same = pickle.loads(pickle.dumps(error))
    assert (str(same), same.ierr, same.trace) == (str(error), error.ierr, error.trace)


def no_convergence_is_no_error():
    """A reason instead; the last iterate is there, better than the ones before, and more iterations end it."""
    structure = grid()
    exact = solve(structure, snes_stol=1e-9)[1]
    errors = []
    for iterations in (1, 3, 9):
        snes, u = solve(structure, exact, snes_max_it=iterations)
        assert snes.reason == PETSc.SNES.ConvergedReason.DIVERGED_MAX_IT
        assert snes.getIterationNumber() == iterations == len(latinpc.history(snes)["indicator"])
        errors.append(structure.errors(u, exact)[0])
        assert np.isclose(latinpc.history(snes)["error_l2"][-1], errors[-1], rtol=0.5)  # copies there, means here
    assert errors[0] > 2 * errors[1] > 4 * errors[2] > 0
    snes.setTolerances(max_it=200)
    snes.solve(None, u)
    assert snes.reason > 0


def test_no_convergence_is_no_error():
    no_convergence_is_no_error()


@pytest.mark.parametrize("name", CASES)
def test_one_rank(name):
    check(name, outcome(name))
    the_process_goes_on()


@pytest.fixture(scope="module")
def two_ranks(tmp_path_factory):
    """Outcomes of all cases on each of two ranks; a deadlock shows the last case begun."""
    folder = tmp_path_factory.mktemp("errors")
    run(["mpirun", "-n", 2, sys.executable, __file__, folder], timeout=TIMEOUT, leaks=False)
    return [json.loads((folder / f"{rank}.json").read_text()) for rank in range(2)]


@pytest.mark.parametrize("name", CASES)
def test_two_ranks(name, two_ranks):
    check(name, two_ranks[0][name])
    assert two_ranks[0][name] == two_ranks[1][name]


if __name__ == "__main__":
    outcomes = {}
    for case in CASES:
        print(case, flush=True)
        outcomes[case] = outcome(case)
        the_process_goes_on()
    no_convergence_is_no_error()
    Path(sys.argv[1], f"{PETSc.COMM_WORLD.rank}.json").write_text(json.dumps(outcomes))
