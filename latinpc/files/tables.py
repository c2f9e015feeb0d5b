"""Read nodes and members from two CSV files with named columns.

The files are ``nodes.csv`` and ``members.csv`` of a folder, or two files beside each other whose names differ by these
words: ``roof-nodes.csv`` and ``roof-members.csv``. Columns come in any order; those in brackets may be missing::

    node,  x, [y, z], [fix], [Fx, Fy, Fz], [ux, uy, uz], [mass], [group]
    [member], start, end, [law], [EA or stiffness], [prestress, strain, initial_elongation or gap], [coefficient],
    [area, strength], [group]

``group`` takes several names with ``;`` between them. ``fix`` is a word such as ``xyz`` or ``z``: the held directions,
by ``ux`` etc. if those are given. ``law`` and the columns after it are as in the TOML file, which gives by groups what
they leave out. A unit in a heading, ``x [mm]`` or ``EA (kN)``, converts the column; without one it is in m, N and kg.
Without ``node``, nodes are numbered from 1. Commas, semicolons or tabs separate; where commas do not, the decimal mark
is a comma or a point, the same in both files. Empty lines and columns, and lines that begin with ``#``, are left out.
"""

from __future__ import annotations

import csv
import pathlib
import re

import numpy as np

from .lines import Lines
from .text import finite, nearest, read_text, wrong

LENGTH = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
FORCE = {"N": 1.0, "kN": 1e3, "MN": 1e6}
UNITS = (
    {axis: LENGTH for axis in ("x", "y", "z", "ux", "uy", "uz", "initial_elongation", "gap")}
    | {name: FORCE for name in ("Fx", "Fy", "Fz", "EA", "prestress")}
    | {
        "stiffness": {"N/m": 1.0, "kN/m": 1e3, "MN/m": 1e6},
        "mass": {"kg": 1.0, "t": 1e3},
        "strain": {"": 1.0},
        "coefficient": {"": 1.0},
    }
    | {"time": {"s": 1.0, "ms": 1e-3}}
    | {"area": {"m2": 1.0, "m²": 1.0, "cm2": 1e-4, "cm²": 1e-4, "mm2": 1e-6, "mm²": 1e-6}}
    | {"strength": {"Pa": 1.0, "MPa": 1e6, "N/mm2": 1e6, "N/mm²": 1e6, "GPa": 1e9}}
)
NODES = ("node", "x", "y", "z", "fix", "Fx", "Fy", "Fz", "ux", "uy", "uz", "mass", "group")
MEMBERS = (
    "member", "start", "end", "law", "EA", "stiffness", "prestress", "strain", "initial_elongation", "gap",
    "coefficient", "area", "strength", "group",
)  # fmt: skip
LAW = MEMBERS[3:-1]
LENGTHS = ("x", "y", "z", "ux", "uy", "uz", "initial_elongation", "gap")
NEEDED = ("x", "y", "z", "time", "factor")  # no cell of theirs may be empty
HEADING = re.compile(r"\s*([^\[(]*?)\s*(?:[\[(]\s*([^\])]*?)\s*[\])])?\s*")


def read_tables(path):
    """Read nodes.csv and members.csv; return `Lines`. Raises ValueError with the file and its line."""
    nodes_file, members_file = pair(pathlib.Path(path))
    nodes = Table(nodes_file, NODES, ("x",))
    names = nodes.columns.get("node", [str(number + 1) for number in range(len(nodes.rows))])
    number = {}
    for row, name in zip(nodes.rows, names):
        if name in number:
            wrong(
                nodes_file, row, f"node '{name}' is there already, on line {nodes.rows[number[name]]}", "one line each"
            )
        number[name] = len(number)
    members = Table(members_file, MEMBERS, ("start", "end"), nodes)
    ends = np.column_stack([_ends(members, key, number, nodes_file) for key in ("start", "end")])
    named = {}
    for row, name in zip(members.rows, members.columns.get("member", [])):
        if name and named.setdefault(name, row) != row:
            wrong(members_file, row, f"member '{name}' is there already, on line {named[name]}", "one line each")
    same = np.flatnonzero(ends[:, 0] == ends[:, 1])
    if same.size:
        wrong(members_file, members.rows[same[0]], f"joins node '{members.columns['start'][same[0]]}' to itself",
              "two nodes")  # fmt: skip

    def vectors(names):
        return np.column_stack([nodes.numbers(name) for name in names])

    fixed, prescribed = _supports(nodes), vectors(("ux", "uy", "uz"))
    loose = np.flatnonzero(((prescribed != 0.0) & ~fixed).any(axis=1))
    if loose.size:
        wrong(
            nodes_file, nodes.rows[loose[0]], "a displacement in a direction that fix does not hold", "fix such as xyz"
        )
    return Lines(
        members_file, vectors("xyz"), ends, {"members": np.arange(len(ends))} | members.groups(), nodes.groups(),
        rows=np.array(members.rows), laws=_laws(members), fixed=fixed, prescribed=prescribed,
        heading=next(filter(None, (table.length_unit() for table in (nodes, members))), ""), nodes_path=nodes_file,
        load=vectors(("Fx", "Fy", "Fz")), mass=nodes.numbers("mass"), point_names=np.array(names),
        line_names=[name or str(row + 1) for row, name in enumerate(members.columns.get("member", [""] * len(ends)))],
    )  # fmt: skip


def pair(path):
    """Return the files of nodes and of members."""
    expected = "a folder with nodes.csv and members.csv, or NAME-nodes.csv and NAME-members.csv"
    if path.is_dir():
        pair = [path / "nodes.csv", path / "members.csv"]
    else:
        name = path.name.replace("members", "nodes")
        if "nodes" not in name:
            wrong(path, None, "the name does not say whether these are nodes or members", expected)
        pair = [path.with_name(name), path.with_name(name.replace("nodes", "members"))]
    for file in pair:
        if not file.is_file():
            raise FileNotFoundError(f"{file}: no such file; expected {expected}")
    return pair


class Table:
    """A CSV file: its columns by name, and the line of the file of each row.

    Parameters
    ----------
    path : Path
    known, needed : tuple of str
        Names of columns.
    beside : Table, optional
        Another of the same structure, which has the same decimal mark.
    """

    def __init__(self, path, known, needed, beside=None):
        self.path, self.known = path, known
        text = read_text(path)
        head = next((line for line in text.split("\n") if line.strip() and not line.lstrip().startswith("#")), "")
        delimiter = max(",;\t", key=head.count)
        self.decimal, self.marks = "." if delimiter == "," else ",", beside.marks if beside else {}
        rows, self.comments = [], []
        reader = csv.reader(text.split("\n"), delimiter=delimiter, skipinitialspace=True)
        try:
            for cells in reader:
                cells = [cell.strip() for cell in cells]
                if any(cells):
                    (self.comments if cells[0].startswith("#") else rows).append((reader.line_num, cells))
        except csv.Error as error:
            wrong(path, reader.line_num, f"not readable: {error}", self._format())
        if len(rows) < 2:
            wrong(path, None, "holds no row", f"{self._format()}, and rows of numbers")
        self.head, cells = rows[0]
        empty = {at for at in range(len(cells)) if not any(at < len(row) and row[at] for _, row in rows)}
        self._headings(cells, needed, empty)
        for row, cells in rows[1:]:
            if len(cells) != len(rows[0][1]):
                wrong(path, row, f"{len(cells)} cells", f"{len(rows[0][1])}, as in the head on line {self.head}")
        self.rows = [row for row, _ in rows[1:]]
        self.columns = {
            name: [cells[at] for _, cells in rows[1:]] for at, name in enumerate(self.names) if name is not None
        }

    def _format(self):
        return f"a head out of {', '.join(self.known)}"

    def _headings(self, cells, needed, empty):
        """Find the names and the units of the columns; leave out empty ones, which spreadsheets write."""
        self._refuse_hidden(cells, needed)
        lower = {name.lower(): name for name in self.known}
        self.names, self.scale = [], {}
        for at, cell in enumerate(cells):
            if at in empty:
                self.names.append(None)
                continue
            if not cell:
                wrong(self.path, self.head, f"column {at + 1} has no name", self._format())
            name, unit = HEADING.fullmatch(cell).groups() if HEADING.fullmatch(cell) else (cell, None)
            found = lower.get(name.lower().replace(" ", "_"))
            if found is None and not name.startswith("#"):
                hint = nearest(name, self.known)
                wrong(self.path, self.head, f"unknown column '{name}'{hint}", "'#' before a column to leave out")
            if found in self.names and found is not None:
                wrong(self.path, self.head, f"column '{found}' is there twice", "one of each")
            self.names.append(found)
            units = UNITS.get(found, {})
            if unit is not None and found is not None:
                if unit not in units:
                    wrong(
                        self.path, self.head, f"'{cell}' is in '{unit}'", f"a unit out of {', '.join(units) or 'none'}"
                    )
                self.scale[found] = units[unit]
        for name in needed:
            if name not in self.names:
                wrong(self.path, self.head, f"no column '{name}'", self._format())

    def _refuse_hidden(self, cells, needed):
        """Refuse a head that is a comment, as its first column is one to leave out."""

        def all_in(cells):
            return set(needed) <= {HEADING.sub(r"\1", cell).lower() for cell in cells}

        hidden = [(row, comment) for row, comment in self.comments if row < self.head and all_in(comment)]
        if hidden and not all_in(cells):
            row, comment = hidden[0]
            wrong(
                self.path, row, f"the head begins with '{comment[0]}', which makes it a comment",
                "the columns to leave out behind others",
            )  # fmt: skip

    def numbers(self, name):
        """Return a column of numbers in SI units, zero where a cell is empty."""
        if name not in self.columns:
            return np.zeros(len(self.rows))
        values = np.zeros(len(self.rows))
        for index, cell in enumerate(self.columns[name]):
            values[index] = self.number(index, name) if cell or name in NEEDED else 0.0
        return values

    def number(self, index, name):
        """Return the number in a row of a column, in SI units; refuse decimal points beside decimal commas."""
        cell, row = self.columns[name][index], self.rows[index]
        number = finite(cell.replace(self.decimal, "."))
        if number is None:
            wrong(self.path, row, f"{name} is '{cell}'", "a finite number")
        for mark in self.decimal + "." if self.decimal == "," else "":
            if mark in cell:
                self.marks.setdefault(mark, (self.path, row, f"{name} is '{cell}'"))
        if len(self.marks) > 1:  # 42.000 is 42 thousand where 1,5 is one and a half
            (path, row, said), (other, there, before) = self.marks["."], self.marks[","]
            wrong(path, row, f"{said}, but {before} in {other.name}, line {there}", "one decimal mark")
        return number * self.scale.get(name, 1.0)

    def length_unit(self):
        """Return the first column of lengths whose heading has a unit, and the file; None without one."""
        return next((f"'{name}' in {self.path}" for name in LENGTHS if name in self.scale), None)

    def groups(self):
        """Return the rows of each name in the column group."""
        found = {}
        for index, names in enumerate(self.columns.get("group", [])):
            for name in dict.fromkeys(filter(None, map(str.strip, names.split(";")))):
                found.setdefault(name, []).append(index)
        return {name: np.array(rows) for name, rows in found.items()}


def _ends(members, key, number, nodes_file):
    """Return the nodes that a column names."""
    result = np.empty(len(members.rows), np.int64)
    for index, name in enumerate(members.columns[key]):
        if name not in number:
            hint = nearest(name, number) if len(number) < 1000 else ""
            wrong(members.path, members.rows[index], f"{key} is '{name}'", f"a node of {nodes_file.name}{hint}")
        result[index] = number[name]
    return result


def _supports(nodes):
    """Return the fixed directions (n, 3)."""
    fixed = np.zeros((len(nodes.rows), 3), bool)
    for index, word in enumerate(nodes.columns.get("fix", [])):
        if not set(word.lower()) <= set("xyz"):
            wrong(nodes.path, nodes.rows[index], f"fix is '{word}'", "the held directions, such as xyz, or nothing")
        fixed[index] = [axis in word.lower() for axis in "xyz"]
    return fixed


def _laws(members):
    """Return the laws of the rows, alike ones as one; rows without any are left out."""
    columns = [(name, members.columns[name]) for name in LAW if name in members.columns]
    found = {}
    for index in range(len(members.rows)):
        entries = tuple((name, column[index]) for name, column in columns if column[index])
        if entries:
            found.setdefault(entries, []).append(index)
    laws = []
    for entries, rows in found.items():
        table, where = {}, f"{members.path}, line {members.rows[rows[0]]}"
        for name, cell in entries:
            if name == "law":
                table[name] = cell.lower().replace("-", "_").replace(" ", "_")
                continue
            table[name] = members.number(rows[0], name)
        laws.append((where, np.array(rows), table))
    return laws
