"""Save and restart long runs: ``--checkpoint FILE``, ``--restart FILE``, and interruptions."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import signal
from dataclasses import fields

import numpy as np
from mpi4py import MPI

from latinpc import solvers

SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Interrupted(Exception):
    """A signal has ended a run; the message names the last state."""

    def __init__(self, sentence, code):
        super().__init__(sentence)
        self.code = code  #: exit code, as a shell has it


class Keeper:
    """Saves the state of a run between its steps; methods are collective.

    Parameters
    ----------
    comm : mpi4py communicator
    path : str or path-like, optional
        File of the state; None: do not save.
    every : int
        Save after each so many steps.
    restart : str or path-like, optional
        State to continue from.
    """

    def __init__(self, comm, path=None, every=1, restart=None):
        if every < 1:
            raise ValueError(f"states are saved every N steps, N at least 1, not {every}")
        self._comm, self._path, self._every, self._restart = comm, path, every, restart
        self._about, self._kept = {}, None
        self._signal, self._ends = 0, 0  # of this rank; of all ranks

    @property
    def options(self):
        """PETSc options for a restart that continues bit by bit; those of the user come first."""
        if self._comm.size == 1 or (self._path is None and self._restart is None):
            return {}
        parts = ("coarse", "newton_pc_latin_coarse", "friction")
        return {f"snes_latin_{part}_pc_type": "redundant" for part in parts}

    @property
    def restarts(self):
        """Whether the run continues from a state."""
        return self._restart is not None

    def about(self, scene, **run):
        """Describe the run: a state of another run is refused."""
        self._about = {"the scene": digest(scene), **{key.replace("_", " "): value for key, value in run.items()}}

    def resume(self, solver, u=None):
        """Load the state to restart from; return its number of steps and its records.

        Returns
        -------
        (int, dict)
            0 and nothing without a state.
        """
        if self._restart is None:
            return 0, {}
        note = _note(solvers.load_state(solver, self._restart, u), self._restart)
        for key, value in self._about.items():
            if note["about"].get(key) != value:
                raise ValueError(f"{self._restart} is the state of another run: {key} differs; give what the run had")
        self._kept = (note["number"], self._restart)
        return note["number"], note["past"]

    def step(self, solver, number, past, u=None):
        """Save the state when it is due or the run is interrupted.

        Parameters
        ----------
        solver : petsc4py.PETSc.SNES or petsc4py.PETSc.TS
        number : int
            Steps that are done.
        past : dict
            Records of the run, fit for JSON.
        u : petsc4py.PETSc.Vec, optional
            Solution of a SNES.

        Returns
        -------
        bool
            True when the run must end.
        """
        if self._path is None:
            return False
        self._ends = self._comm.allreduce(self._signal, op=MPI.MAX)
        if self._ends or number % self._every == 0:
            note = {"about": self._about, "number": number, "past": past}
            solvers.save_state(solver, self._path, u, json.dumps(note).encode())
            self._kept = (number, self._path)
        return bool(self._ends)

    def check(self):
        """Raise `Interrupted` when a signal has ended the run."""
        if self._ends:
            raise Interrupted(self.sentence(), 128 + self._ends)

    def sentence(self):
        """Return a sentence that names the last state."""
        if self._kept is None:
            return "interrupted: no state has been saved before this step"
        number, path = self._kept
        return f"interrupted: the state after step {number} is in {path}; continue with --restart {path}"

    @contextlib.contextmanager
    def watching(self, snes):
        """End the run after the current step at Ctrl-C or SIGTERM, and at once at the second signal."""
        if self._path is None:
            yield
            return

        def handle(number, _):
            if self._comm.rank == 0:
                os.write(2, f"\nlatinpc: {self.sentence()}\n".encode())
            if self._signal:
                os._exit(128 + number)
            self._signal = number

        # Python handles signals when it is its turn: once an iteration
        solvers.iterating(snes).setMonitor(lambda *_: None)
        before = {number: signal.signal(number, handle) for number in SIGNALS}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)


def _note(data, path):
    """Read the note of a state, which another program may have written."""
    with contextlib.suppress(ValueError, TypeError, KeyError):
        note = json.loads(data)
        if [type(note[key]) for key in ("about", "number", "past")] == [dict, int, dict]:
            return note
    raise ValueError(f"{path} is not a checkpoint of latinpc solve")


def digest(scene):
    """Return a hash of all numbers of a scene."""
    found = hashlib.sha256()
    for item in fields(scene):
        value = getattr(scene, item.name)
        if isinstance(value, np.ndarray):
            found.update(f"{item.name} {value.dtype} {value.shape}".encode())
            found.update(np.ascontiguousarray(value).tobytes())
    return found.hexdigest()[:16]
