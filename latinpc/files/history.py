"""Read how loads vary with time: a CSV file with the columns ``time`` and ``factor``."""

from __future__ import annotations

import pathlib

import numpy as np

from .tables import Table
from .text import wrong

COLUMNS = ("time", "factor")


def read_history(path):
    """Read factors of loads over time.

    Parameters
    ----------
    path : str or path-like
        A table as those of structures: a head, ``time,factor``, then a row for each time, which grows. ``time [ms]`` is
        in milliseconds, else in s.

    Returns
    -------
    times, factors : (k,) array of float

    Raises
    ------
    FileNotFoundError, ValueError
        With the file, its line, and what was expected.
    """
    path = pathlib.Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"{path}: no such file; expected a table with the columns time and factor")
    table = Table(path, COLUMNS, COLUMNS)
    times, factors = (table.numbers(name) for name in COLUMNS)
    back = np.flatnonzero(np.diff(times) <= 0.0)
    if back.size:
        row = back[0] + 1
        wrong(path, table.rows[row], f"time {times[row]:g} s is not after {times[row - 1]:g} s", "times that grow")
    return times, factors
