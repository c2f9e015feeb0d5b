"""Members and nodes of a result as tables: structured arrays and CSV files."""

from __future__ import annotations

import csv
import pathlib
from typing import TYPE_CHECKING

import numpy as np

from .atomic import atomic
from .mechanics import stretches

if TYPE_CHECKING:
    from latinpc.structure import Structure

    from .result import Result

AXES = "xyz"


def members(result: Result) -> np.ndarray:
    """Return a row per link: ends, law, length, forces; see `latinpc.Result.members`."""
    structure = result.structure
    columns = {
        "link": np.arange(len(structure.links)),
        "start": structure.links[:, 0],
        "end": structure.links[:, 1],
        "law": structure.laws,
        "length": structure.lengths,
        "elongation": stretches(structure, result.displacements, result.geometry),
        "tension": result.tensions,
        "slack": result.slack,
    }
    for name in ("stress", "utilisation"):
        if getattr(result, name) is not None:
            columns[name] = getattr(result, name)
    return table(columns | link_columns(structure))


def nodes(result: Result) -> np.ndarray:
    """Return a row per node: place, displacement, load, reaction; see `latinpc.Result.nodes`."""
    structure = result.structure
    columns = {"node": np.arange(len(structure.nodes))}
    for prefix, array in (
        ("", structure.nodes),
        ("displacement_", result.displacements),
        ("load_", result.load),
        ("reaction_", result.reactions),
    ):
        columns |= {prefix + axis: column for axis, column in zip(AXES, array.T)}
    columns["supported"] = structure.fixed.any(axis=1)
    return table(columns | node_columns(structure))


def node_columns(structure: Structure, nodes: np.ndarray | None = None) -> dict[str, np.ndarray]:
    """Return the columns of names and groups of nodes, all unless some are given; none where no file has given them."""
    if structure.numbering is None:
        return {}
    chosen, groups = np.arange(len(structure.nodes)) if nodes is None else nodes, structure.numbering.node_groups
    names = {"name": np.array([structure.node_name(node) for node in chosen])}
    return names | ({} if groups is None else {"group": groups[chosen]})


def link_columns(structure: Structure) -> dict[str, np.ndarray]:
    """Return the columns of names of links and of their nodes, and of groups; none where no file has given them."""
    if structure.numbering is None:
        return {}
    nodes = node_columns(structure)["name"]
    names = np.array([structure.link_name(link) for link in range(len(structure.links))])
    ends = {"start_name": nodes[structure.links[:, 0]], "end_name": nodes[structure.links[:, 1]]}
    groups = structure.numbering.link_groups
    return {"name": names} | ends | ({} if groups is None else {"group": groups})


def table(columns: dict[str, np.ndarray]) -> np.ndarray:
    """Make a structured array of columns of one length."""
    rows = np.empty(len(next(iter(columns.values()))), [(name, column.dtype) for name, column in columns.items()])
    for name, column in columns.items():
        rows[name] = column
    return rows


def write_csv(path: str | pathlib.Path, table: np.ndarray) -> None:
    """Write a structured array with a header, whole or not at all; numbers have all their digits.

    Truth is written as 0 or 1, NaN as nothing.
    """

    def text(value):
        return str(int(value)) if isinstance(value, bool) else "" if value != value else str(value)

    with atomic(path) as temporary, open(temporary, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(table.dtype.names)
        writer.writerows(map(text, row) for row in table.tolist())
