"""Members and nodes of a result as tables: structured arrays and CSV files."""

from __future__ import annotations

import csv
import pathlib
from typing import TYPE_CHECKING

import numpy as np

from latinpc.laws import Law

from .atomic import atomic, check_writable
from .mechanics import gaps, slack, stretches

if TYPE_CHECKING:
    from latinpc.runs.motion import Motion
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
        "slack": _with_contact(structure, result.slack),
    }
    for name in ("gap", "stress", "utilisation"):
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


def motion_members(motion: Motion) -> np.ndarray:
    """Return a row per link and state of a motion, in the order of time; see `latinpc.runs.motion.Motion.members`."""
    scene, links = motion.scene, motion.scene.links
    tensions = np.array([frame.tensions for frame in motion.frames])
    columns = {"link": np.arange(len(links)), "start": links[:, 0], "end": links[:, 1]} | link_columns(scene)
    found = {"tension": tensions, "slack": _with_contact(scene, slack(scene, tensions))}
    left = [gaps(scene, frame.displacements, frame.initial_elongation) for frame in motion.frames]
    return _over_time(motion, columns, found if left[0] is None else found | {"gap": np.array(left)})


def _with_contact(scene, loose):
    """Return which links are slack (..., m), of tangential parts whether their contact is."""
    first = np.where(scene.law == Law.TANGENT, 0, np.arange(len(scene.law)))
    return loose[..., np.maximum.accumulate(first)]


def motion_nodes(motion: Motion) -> np.ndarray:
    """Return a row per node and state of a motion, in the order of time; see `latinpc.runs.motion.Motion.nodes`."""
    found = {}
    for prefix, name in (("displacement", "displacements"), ("velocity", "velocities")):
        states = np.array([getattr(frame, name) for frame in motion.frames])
        found |= {f"{prefix}_{axis}": column for axis, column in zip(AXES, np.moveaxis(states, 2, 0))}
    return _over_time(motion, {"node": np.arange(len(motion.scene.nodes))} | node_columns(motion.scene), found)


def _over_time(motion: Motion, columns: dict[str, np.ndarray], found: dict[str, np.ndarray]) -> np.ndarray:
    """Make a table of step and time of each state, of columns that repeat, and of arrays (states, rows)."""
    rows = len(next(iter(columns.values())))
    state = {name: np.repeat([getattr(frame, name) for frame in motion.frames], rows) for name in ("step", "time")}
    again = {name: np.tile(column, len(motion.frames)) for name, column in columns.items()}
    return table(state | again | {name: array.ravel() for name, array in found.items()})


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

    check_writable(path, (".csv",))
    with atomic(path) as temporary, open(temporary, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(table.dtype.names)
        writer.writerows(map(text, row) for row in table.tolist())
