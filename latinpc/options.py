"""PETSc options of a run: ready-made sets, defaults for its duration, and misspelt ones of ours."""

from __future__ import annotations

import contextlib
import difflib
import pathlib
import re
import shlex
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from petsc4py import PETSc

#: Options of our own, after ``-snes_latin_``, ``-ksp_latin_``, ``-pc_latin_``, ``-ts_latin_``; the last are prefixes of
#: inner solvers.
OPTIONS = (
    "variant", "modes", "modes_local", "subdomains", "partitioner", "direction", "direction_value", "precision",
    "monitor", "stop", "error", "tension_error", "balance", "largest_unbalance",
    "geometry", "warm_start", "newton",
)  # fmt: skip
FAMILIES = {"snes": OPTIONS, "ksp": OPTIONS, "pc": OPTIONS, "ts": ("monitor",)}
INNER_PREFIXES = ("mat_partitioning_", "local_", "interior_", "coarse_", "outer_", "newton_", "friction_")


@contextlib.contextmanager
def default_options(options: Mapping[str, Any] | None) -> Iterator[list[str]]:
    """Set options in PETSc's database for the duration of a block, where the user has not set them.

    Parameters
    ----------
    options : mapping
        Names without the leading dash; a value of None makes a flag.

    Yields
    ------
    list of str
        The options that were set.
    """
    database = PETSc.Options()
    before = database.getAll()
    ours = {name: value for name, value in (options or {}).items() if not database.hasName(name)}
    for name, value in ours.items():
        database.setValue(name, str(value).lower() if isinstance(value, bool) else value)
    given = database.getAll()
    try:
        yield list(ours)
    finally:
        left = database.getAll()
        renamed = [given[name] for name in ours if name not in left]  # PETSc replaces a deprecated name
        for name, value in left.items():
            if name in ours or (name not in before and value in renamed):
                database.delValue(name)


def unknown_options(names: Iterable[str] | None = None) -> list[str]:
    """Return a sentence for each unknown option with a prefix of ours; not collective.

    Parameters
    ----------
    names : iterable of str, optional
        Options without the leading dash; by default those in PETSc's database.

    Returns
    -------
    list of str
        Each names the nearest option that exists.
    """
    sentences = []
    for name in PETSc.Options().getAll() if names is None else names:
        words = name.split("_")
        for at in range(1, len(words) - 1):
            family = difflib.get_close_matches(words[at - 1], FAMILIES, n=1, cutoff=0.6)
            if family and difflib.get_close_matches(words[at], ["latin"], cutoff=0.8):
                prefix = "_".join([*words[: at - 1], family[0], "latin", ""])  # with the user's own before it, if any
                key, known = "_".join(words[at + 1 :]), FAMILIES[family[0]]
                if key not in known and not key.startswith(INNER_PREFIXES):
                    key = next(iter(difflib.get_close_matches(key, known, n=1, cutoff=0.5)), None)
                if f"{prefix}{key}" != name:
                    sentences.append(
                        f"unknown option -{name}: {f'do you mean -{prefix}{key}?' if key else 'see -help'}"
                    )
                break
    return sentences


def given_options(options: Mapping[str, Any] | None) -> dict[str, Any]:
    """Return options of a caller by name without the leading dash; not collective.

    Raises
    ------
    ValueError
        For a misspelt one of ours; the message names the nearest.
    TypeError
        For what is no dictionary.
    """
    if options is not None and not isinstance(options, Mapping):
        raise TypeError(f"options must be a dictionary of names and values, not {type(options).__name__}")
    given = {str(name).removeprefix("-"): value for name, value in (options or {}).items()}
    shows = [name for name, value in given.items() if value is True and re.search("monitor|view|reason", name)]
    given |= dict.fromkeys(shows)  # PETSc would take "true" for the name of a viewer
    misspelt = unknown_options(given)
    if misspelt:
        raise ValueError("; ".join(misspelt))
    return given


def subdomain_options(number: int | None) -> dict[str, int]:
    """Return the options that ask every solver of a structure for so many subdomains; none for None."""
    return {} if number is None else {f"{family}_latin_subdomains": number for family in ("snes", "ksp", "pc")}


def preset_files() -> dict[str, pathlib.Path]:
    """Return the files of ready-made sets by name; not collective."""
    package = pathlib.Path(__file__).resolve().parent
    installed = package / "presets"  # where the package is not run from its sources
    folder = installed if installed.is_dir() else package.parent / "options"
    return {path.stem: path for path in sorted(folder.glob("*.opts"))}


def preset_options(name: str) -> dict[str, str | None]:
    """Return the options of a ready-made set; not collective.

    Parameters
    ----------
    name : str
        Of a file in the folder options, without its suffix.

    Returns
    -------
    dict
        Values by name without the leading dash.

    Raises
    ------
    ValueError
        For an unknown name; the message lists those that exist.
    """
    files = preset_files()
    if name not in files:
        near = difflib.get_close_matches(str(name), files, n=1, cutoff=0.5)
        meant = f"do you mean {near[0]!r}? " if near else ""
        raise ValueError(f"unknown preset {name!r}: {meant}choose from {', '.join(files)}")
    found = {}
    for line in files[name].read_text(encoding="utf-8").splitlines():
        words = shlex.split(line, comments=True)
        if words:
            found[words[0].removeprefix("-")] = " ".join(words[1:]) or None
    return found
