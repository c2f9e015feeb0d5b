"""Start processes that solve a scene, one after the other, and bring back what they found."""

from __future__ import annotations

import contextlib
import json
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import threading

from latinpc.files.npz import save_scene

#: One core for each process: no thread but its own. CHOLMOD starts four whatever OMP_NUM_THREADS says, which takes
#: twice the time; the limit holds for it as well.
THREADS = dict.fromkeys(
    ("OMP_NUM_THREADS", "OMP_THREAD_LIMIT", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "RAYON_NUM_THREADS"), "1"
)

#: What Open MPI wants for as many ranks as are asked for, of root in a container as well, on the cores that there are.
RANKS = dict.fromkeys(
    ("OMPI_ALLOW_RUN_AS_ROOT", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "OMPI_MCA_rmaps_base_oversubscribe"), "1"
) | {"OMPI_MCA_hwloc_base_binding_policy": "none"}


class Failed(RuntimeError):
    """A process that gave no result; its sentence says why."""


class Bench:
    """A scene on disk and the processes that solve it.

    Parameters
    ----------
    scene : Scene
    ranks : int
        How many ranks the PETSc methods run on.
    timeout : float
        How long one process may take (s).
    user_options : sequence of (str, str or None)
        PETSc options that replace those of the methods.
    """

    def __init__(self, scene, ranks=1, timeout=600.0, user_options=()):
        self.ranks = ranks
        self.timeout = timeout
        self._handler = None
        self.user_options = list(user_options)
        self._folder = tempfile.TemporaryDirectory(prefix="latinpc-")
        self.folder = pathlib.Path(self._folder.name)
        self.scene = str(self.folder / "scene.npz")
        self.reference = str(self.folder / "reference.npy")
        self.large = scene.geometry == "large"
        save_scene(self.scene, scene)

    def __enter__(self):
        if threading.current_thread() is threading.main_thread():  # a polite kill ends the process under way too
            self._handler = signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))
        return self

    def __exit__(self, *what):
        if self._handler is not None:
            signal.signal(signal.SIGTERM, self._handler)
        self._folder.cleanup()

    def add_scene(self, name, scene):
        """Put another scene on disk, for `run` with ``scene=``; return its path."""
        path = self.folder / f"{name}.npz"
        save_scene(path, scene)
        return str(path)

    def make_reference(self, accuracy, how="auto"):
        """Solve the scene at least 100 times more accurately.

        Parameters
        ----------
        accuracy : float
        how : {'auto', 'newton', 'latin'}
            'auto' turns to latin when Newton's method fails or takes too long; with large displacements, where it may
            end in another equilibrium, at once.

        Returns
        -------
        dict
            method, steps, accuracy, seconds.
        """
        reasons = []
        both = ("latin",) if self.large else ("newton", "latin")
        for method in both if how == "auto" else (how,):
            try:
                return self.run(do="reference", method=method, accuracy=accuracy, ranks=1, user_options=[])
            except Failed as error:
                reasons.append(f"{method}: {error}")
        raise RuntimeError(f"no reference ({'; '.join(reasons)})")

    def run(self, ranks=None, **task):
        """Perform a task in a process of its own; see `latinpc.bench.peers.worker.perform`.

        Raises
        ------
        Failed
            When it fails or takes too long.
        """
        ranks = self.ranks if ranks is None else ranks
        answer, file = self.folder / "answer.json", self.folder / "task.json"
        answer.unlink(missing_ok=True)
        task = {"user_options": self.user_options, "scene": self.scene, **task}
        task |= {"reference": self.reference, "answer": str(answer)}
        file.write_text(json.dumps(task), encoding="utf-8")
        command = [sys.executable, "-P", "-m", "latinpc.bench.peers.worker", str(file)]
        if ranks > 1:
            command = ["mpirun", "-n", str(ranks), *command]
        said = _run(command, self.timeout)
        if not answer.exists():
            raise Failed(said)
        outcome = json.loads(answer.read_text(encoding="utf-8"))
        if "error" in outcome:
            raise Failed(outcome["error"])
        return outcome["result"]


def _run(command, timeout):
    """Run a command to its end; return a sentence for when it leaves no answer."""
    package = str(pathlib.Path(__file__).resolve().parents[3])
    path = os.pathsep.join(filter(None, (package, os.environ.get("PYTHONPATH"))))
    process = subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env={**RANKS, **os.environ, **THREADS, "PYTHONPATH": path},
        start_new_session=True,
    )
    try:
        _, errors = process.communicate(timeout=timeout)
    except subprocess.TimeoutExpired:
        raise Failed(f"no result after {timeout:g} s") from None
    finally:  # also when the user interrupts: nothing is left behind
        if process.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
    if process.returncode < 0:
        name = signal.Signals(-process.returncode).name
        return f"ended by {name}" + (": out of memory?" if name == "SIGKILL" else "")
    lines = [line for line in errors.splitlines() if line.strip()]
    return lines[-1] if lines else f"ended with code {process.returncode}"
