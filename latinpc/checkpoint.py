"""States of long runs: ``--checkpoint FILE`` and ``--restart FILE``, and what an interruption leaves behind."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import signal
from dataclasses import fields

import numpy as np
from mpi4py import MPI

import latinpc

SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Interrupted(Exception):
    """A run has been told to end by a signal; its message says where the last state is."""

    def __init__(self, sentence, code):
        super().__init__(sentence)
        self.code = code  #: exit code, as a shell has it


class Keeper:
    """Keeps the state of a run that goes on step by step; methods are collective.

    Parameters
    ----------
    comm : mpi4py communicator
    path : str or path-like, optional
        Where to write the state; None: nowhere.
    every : int
        Write it after so many steps.
    restart : str or path-like, optional
        A state to go on from.
    """

    def __init__(self, comm, path=None, every=1, restart=None):
        if every < 1:
            raise ValueError(f"a state is kept each so many steps, at least 1, not {every}")
        self._comm, self._path, self._every, self._restart = comm, path, every, restart
        self._about, self._kept = {}, None
        self._signal, self._ends = 0, 0  # told to this rank; agreed on

    @property
    def options(self):
        """PETSc options of a run that is to go on to the bit, used where the user has not set them."""
        if self._comm.size == 1 or (self._path is None and self._restart is None):
            return {}
        return {f"snes_latin_{part}coarse_pc_type": "redundant" for part in ("", "rescue_pc_latin_")}

    def about(self, scene, **run):
        """Say what the run is: a state of another one is refused."""
        self._about = {"the scene": digest(scene), **{key.replace("_", " "): value for key, value in run.items()}}

    def resume(self, solver, u=None):
        """Bring a solver where the state to restart from has been left; return its number of steps and its records.

        Returns
        -------
        (int, dict)
            0 and nothing without a state.
        """
        if self._restart is None:
            return 0, {}
        note = json.loads(latinpc.load_state(solver, self._restart, u))
        for key, value in self._about.items():
            if note["about"].get(key) != value:
                raise ValueError(f"{self._restart} is the state of another run: {key} differs; give what the run had")
        self._kept = (note["number"], self._restart)
        return note["number"], note["past"]

    def step(self, solver, number, past, u=None):
        """Write the state when it is time, or when the run has been interrupted, which then ends.

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
            True when the run is to end.
        """
        if self._path is None:
            return False
        self._ends = self._comm.allreduce(self._signal, op=MPI.MAX)
        if self._ends or number % self._every == 0:
            note = {"about": self._about, "number": number, "past": past}
            latinpc.save_state(solver, self._path, u, json.dumps(note).encode())
            self._kept = (number, self._path)
        return bool(self._ends)

    def check(self):
        """Raise `Interrupted` when the run has ended before its time."""
        if self._ends:
            raise Interrupted(self.sentence(), 128 + self._ends)

    def sentence(self):
        """Say where the last state is."""
        if self._kept is None:
            return "interrupted: no state has been written before this step"
        number, path = self._kept
        return f"interrupted: the state after step {number} is in {path}; go on with --restart {path}"

    @contextlib.contextmanager
    def watching(self, snes):
        """End the run at Ctrl-C or SIGTERM after the step that is being made, and at once when told again."""
        if self._path is None:
            yield
            return

        def handle(number, _):
            if self._comm.rank == 0:
                os.write(2, f"\nlatinpc: {self.sentence()}\n".encode())
            if self._signal:
                os._exit(128 + number)
            self._signal = number

        snes.setMonitor(lambda *_: None)  # Python handles signals when it is its turn: once an iteration
        before = {number: signal.signal(number, handle) for number in SIGNALS}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)


def digest(scene):
    """Return a few letters that two scenes share when all their numbers are the same."""
    found = hashlib.sha256()
    for item in fields(scene):
        value = getattr(scene, item.name)
        if isinstance(value, np.ndarray):
            found.update(f"{item.name} {value.dtype} {value.shape}".encode())
            found.update(np.ascontiguousarray(value).tobytes())
    return found.hexdigest()[:16]
