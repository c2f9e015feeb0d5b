"""Arguments in C that a PETSc with its own checks finds, in functions of ours as in PETSc's: make test PETSC=debug."""

import pytest
from conftest import MALLOC_DUMP, run
from test_rankfailure import LINKED

pytestmark = pytest.mark.skipif(not MALLOC_DUMP, reason="a PETSc without checks of its own")


@pytest.mark.parametrize("ranks", [2, 3])
def test_values_that_differ_are_refused(compile_c, ranks):
    """Ranks would wait for each other: in the next set-up, the next solve, or at once."""
    program = compile_c("checked_arguments.c", *LINKED)
    found = run(["mpirun", "-n", ranks, program], timeout=60, leaks=False)
    assert found.stdout == "18 calls refused\n"


def test_what_is_not_there_is_refused(compile_c):
    """No handle, no array, no room for a result: an error in place of a crash."""
    found = run([compile_c("checked_arguments.c", *LINKED)], leaks=False)
    assert found.stdout == "80 calls refused\n"
