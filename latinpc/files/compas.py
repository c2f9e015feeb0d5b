"""Read JSON files of compas: graphs, networks and meshes, lists of lines. compas itself is not needed.

A graph or network is read as its edges, a mesh as the edges of its faces; in a list each item counts. Nodes and edges
with an attribute that is true, such as ``is_support``, are a group of that name.
"""

from __future__ import annotations

import json

import numpy as np

from .lines import Lines
from .text import read_text, wrong

FORMAT = "JSON of a compas Graph, Network, Mesh or CellNetwork, of Lines or Polylines, or a list of lines"


def read_compas(path):
    """Read a JSON file of compas; return `Lines`. Raises ValueError with the line or the key of the file."""
    try:
        document = json.loads(read_text(path))
    except json.JSONDecodeError as error:
        wrong(path, error.lineno, f"not JSON: {error.msg}", FORMAT)
    except (RecursionError, ValueError) as error:  # a number too long to read is a ValueError
        wrong(path, None, f"not JSON: {error}", FORMAT)
    reader = _Reader(path)
    try:
        reader.take(document, "the file")
    except RecursionError:
        wrong(path, None, "nested too deeply", FORMAT)
    if not reader.ends:
        wrong(path, None, "holds no edge or line", FORMAT)
    return Lines(
        path, reader.points, reader.ends,
        {"edges": np.arange(len(reader.ends))} | {name: np.array(found) for name, found in reader.groups.items()},
        {name: np.array(found) for name, found in reader.node_groups.items()}, drawing=True,
        point_names=reader.names,
    )  # fmt: skip


class _Reader:
    """What has been found so far in the document."""

    def __init__(self, path):
        self.path, self.points, self.names, self.ends = path, [], [], []
        self.groups, self.node_groups = {}, {}

    def take(self, item, where):
        """Read an object or a list of them."""
        if isinstance(item, list):
            if self._is_point(item[:1] and item[0]):
                self._polyline(item, where)
            else:
                for number, part in enumerate(item):
                    self.take(part, f"{where}, item {number}" if len(item) > 1 else where)
            return
        if not isinstance(item, dict):
            wrong(self.path, None, f"{where} is {str(item)[:40]!r}", FORMAT)
        if "dtype" in item:
            inside = item.get("data", item.get("value"))
            self.take(inside, f"{where} ({str(item['dtype']).rpartition('/')[2]})")
        elif "start" in item and "end" in item:
            self._polyline([self._coordinates(item[key], f"{where}: {key}") for key in ("start", "end")], where)
        elif isinstance(item.get("points"), list):
            self._polyline([self._coordinates(point, where) for point in item["points"]], where)
        elif "node" in item or "vertex" in item:
            self._graph(item, where)
        else:
            wrong(self.path, None, f"{where} has the keys {', '.join(map(str, list(item)[:6])) or 'none'}", FORMAT)

    @staticmethod
    def _is_point(item):
        return (
            isinstance(item, list)
            and len(item) in (2, 3)
            and all(isinstance(x, (int, float)) and not isinstance(x, bool) for x in item)
        )

    def _coordinates(self, item, where):
        """Return the three coordinates of a point: a list, or an object with x, y and z."""
        if isinstance(item, dict):
            item = item.get("data", item.get("value", item))
        if isinstance(item, dict):
            item = [item.get(axis, 0.0) for axis in "xyz"]
        if not self._is_point(item) or not np.isfinite(np.array(item, dtype=float)).all():
            wrong(self.path, None, f"{where}: {str(item)[:40]!r} is no point", "three finite coordinates")
        return [*map(float, item), 0.0][:3]

    def _polyline(self, points, where):
        if len(points) < 2:
            wrong(self.path, None, f"{where} has {len(points)} point", "two points or more")
        first = len(self.points)
        self.points += [self._coordinates(point, where) for point in points]
        self.names += [""] * len(points)
        self.ends += [(first + i, first + i + 1) for i in range(len(points) - 1)]

    def _graph(self, item, where):
        """Read nodes and edges, or vertices, edges and faces."""
        nodes = item.get("node") or item.get("vertex")
        edges, faces = item.get("edge") or {}, item.get("face") or {}
        if not all(isinstance(part, dict) for part in (nodes, edges, faces)):
            wrong(self.path, None, f"{where}: nodes, edges or faces are no table", FORMAT)
        defaults = item.get("default_node_attributes") or item.get("default_vertex_attributes")
        defaults = defaults if isinstance(defaults, dict) else {}
        number, drawn = {}, set()  # edges of faces are shared by two of them
        for key, entries in nodes.items():
            entries = {**defaults, **entries} if isinstance(entries, dict) else entries
            number[key] = len(self.points)
            self._mark(self.node_groups, entries, len(self.points))
            self.points.append(self._coordinates(entries, f"{where}: node {key}"))
            self.names.append(str(key))
        for start, others in edges.items():
            for end, entries in others.items() if isinstance(others, dict) else []:
                self._mark(self.groups, entries, len(self.ends))
                self._edge(number, start, end, f"{where}: edge {start}, {end}")
        for face, corners in faces.items():
            for start, end in self._around(corners, f"{where}: face {face}"):
                pair = frozenset((str(start), str(end)))
                if pair not in drawn:
                    drawn.add(pair)
                    self._edge(number, start, end, f"{where}: face {face}")

    def _around(self, corners, where):
        """Return the edges of a face: a list of its vertices, or of each vertex the next one."""
        if isinstance(corners, dict):
            return list(corners.items())
        if not isinstance(corners, list) or len(corners) < 2:
            wrong(self.path, None, f"{where} is {str(corners)[:40]!r}", "a list of vertices")
        return list(zip(corners, corners[1:] + corners[:1]))

    def _edge(self, number, start, end, where):
        for key in (start, end):
            if str(key) not in number:
                wrong(self.path, None, f"{where} names {key!r}", "a key of a node of the same object")
        if str(start) != str(end):
            self.ends.append((number[str(start)], number[str(end)]))

    @staticmethod
    def _mark(groups, entries, index):
        """Add a node or an edge to the groups of its attributes that are true."""
        for name, value in entries.items() if isinstance(entries, dict) else []:
            if value is True:
                groups.setdefault(str(name), []).append(index)
