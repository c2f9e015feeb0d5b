"""Choose nodes by words: groups, and conditions on coordinates such as ``z=min`` or ``x>=2,y<0``."""

from __future__ import annotations

import re

import numpy as np

from .text import meant

AXES = "xyz"
SLACK = 1e-9  # of the largest extent: coordinates nearer to each other are equal
CONDITION = re.compile(r"\s*([xyz])\s*(<=|>=|<|>|=)\s*(min|max|[-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?)\s*")
FORMAT = "a group or a node of the file, all, or conditions such as z=min, z<=0.5 or x>=2,y=max"


def select(text, nodes, groups, where):
    """Return the numbers of the nodes that a text names.

    Parameters
    ----------
    text : str
        A group, a node, ``all``, or conditions joined by commas, which all hold: an axis, one of ``<= >= < > =``, and
        a number (m), ``min`` or ``max``.
    nodes : (n, dim) array of float
        Coordinates (m).
    groups : dict of str to array of int
        With nodes by their names, as in groups.py.
    where : str
        What messages open with.

    Returns
    -------
    array of int
    """
    if text in groups:
        return groups[text]
    slack = SLACK * max(np.ptp(nodes, axis=0).max(), 1e-300)
    chosen = np.ones(len(nodes), bool)
    for part in [] if text.strip() == "all" else text.split(","):
        found = CONDITION.fullmatch(part)
        if not found:
            known = f"; its groups are {', '.join(sorted(groups))}" if groups else ""
            raise ValueError(f"{where}: '{part.strip()}' chooses no nodes{meant(part, groups)}; write {FORMAT}{known}")
        axis, sign, value = found.groups()
        if AXES.index(axis) >= nodes.shape[1]:
            raise ValueError(f"{where}: there is no {axis}, the structure lies in {', '.join(AXES[: nodes.shape[1]])}")
        x = nodes[:, AXES.index(axis)]
        try:
            value = {"min": x.min(), "max": x.max()}.get(value) if value in ("min", "max") else float(value)
        except ValueError:
            raise ValueError(f"{where}: '{value}' is no number; write {FORMAT}") from None
        near = np.abs(x - value) <= slack
        chosen &= {"<": (x < value) & ~near, "<=": (x < value) | near, "=": near}.get(sign, True)
        chosen &= {">": (x > value) & ~near, ">=": (x > value) | near}.get(sign, True)
    return np.flatnonzero(chosen)
