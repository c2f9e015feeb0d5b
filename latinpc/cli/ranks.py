"""Run the command line on several ranks: rank 0 reads, writes and prints; errors end all ranks."""

from __future__ import annotations

import contextlib
import os
import sys
import time

import latinpc

NOT_CONVERGED, BAD_INPUT = 1, 2  # exit codes
GATHERING_SECONDS = 10.0  # how long a rank that failed waits for the others to fail too


def on_root(comm, function, *arguments, **named):
    """Call a function on rank 0; return its result on every rank, or raise its error there; collective."""
    outcome = None
    if comm.rank == 0:
        try:
            outcome = (function(*arguments, **named), None)
        except Exception as error:  # whatever it is, the other ranks must not wait for a result
            outcome = (None, error)
    value, error = comm.bcast(outcome)
    if error is not None:
        raise error
    return value


def gather_or_abort(comm, sentence):
    """Wait until every rank has failed as this one has; end the run when some have not."""
    if comm.size == 1:
        return
    request, deadline = comm.Ibarrier(), time.monotonic() + GATHERING_SECONDS
    while not request.Test():
        if time.monotonic() > deadline:
            print(f"latinpc: rank {comm.rank}: {sentence}", file=sys.__stderr__, flush=True)
            comm.Abort(BAD_INPUT)
        time.sleep(0.01)


@contextlib.contextmanager
def printing_on(root):
    """Silence Python's output on the other ranks."""
    if root:
        yield
        return
    with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere), contextlib.redirect_stderr(nowhere):
        yield


def sentence(error):
    """Return one readable line for an error; not collective."""
    text = latinpc.error_message(error)
    if isinstance(error, OSError) and error.filename:
        text = f"{error.filename}: {error.strerror}"
    return " ".join(text.split()) or type(error).__name__
