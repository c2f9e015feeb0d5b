"""Getters in C: what setters and options have set, and defaults."""

import pytest
from test_rankfailure import LINKED


@pytest.mark.parametrize("ranks", [1, 2])
def test_getters_return_what_is_set(compile_c, mpirun, ranks):
    assert mpirun(ranks, compile_c("getters.c", *LINKED)).stdout == "all getters are called\n"
