"""PETSc options of a run: defaults for its duration, and unknown ones of ours."""

from __future__ import annotations

import contextlib
import difflib

from petsc4py import PETSc

#: Options of our own, after ``-snes_latin_``, ``-ksp_latin_``, ``-pc_latin_``; the last are prefixes of inner solvers.
OPTIONS = (
    "variant", "modes", "modes_local", "subdomains", "direction", "direction_value", "precision", "monitor", "stop",
    "error", "balance", "warm_start", "newton",
)  # fmt: skip
INNER_PREFIXES = ("local_", "interior_", "coarse_", "outer_", "newton_")


@contextlib.contextmanager
def default_options(options):
    """Set options in PETSc's database for the duration of a block, where the user has not set them.

    Parameters
    ----------
    options : dict
        Names without the leading dash; a value of None makes a flag.
    """
    database = PETSc.Options()
    ours = {name: value for name, value in (options or {}).items() if not database.hasName(name)}
    for name, value in ours.items():
        database.setValue(name, str(value).lower() if isinstance(value, bool) else value)
    try:
        yield
    finally:
        for name in ours:
            database.delValue(name)


def unknown_options():
    """Return a sentence for each unknown option with a prefix of ours."""
    sentences = []
    for name in PETSc.Options().getAll():
        for prefix in ("snes_latin_", "ksp_latin_", "pc_latin_"):
            start = name.find(prefix)  # after the user's own prefix, if any
            key = name[start + len(prefix) :]
            if start >= 0 and key not in OPTIONS and not key.startswith(INNER_PREFIXES):
                near = difflib.get_close_matches(key, OPTIONS, n=1, cutoff=0.5)
                cure = f"do you mean -{name[:start]}{prefix}{near[0]}?" if near else "see -help"
                sentences.append(f"unknown option -{name}: {cure}")
    return sentences
