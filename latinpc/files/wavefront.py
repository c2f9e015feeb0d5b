"""Read Wavefront OBJ files: lines ``l``, edges of faces ``f``, straight curves ``curv``, and points ``p``.

Groups (``g``) and objects (``o``) of the file are groups of its lines, ``lines`` where it has none. Its points ``p``
are the group ``points`` of nodes. Curves of a degree above 1 are refused.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from .lines import Lines
from .text import numbered_lines, wrong

#: What has nothing to do with lines
IGNORED = {
    "vt", "vn", "vp", "s", "mg", "mtllib", "usemtl", "cstype", "parm", "end", "bevel", "c_interp", "d_interp", "lod",
    "shadow_obj", "trace_obj", "usemap", "maplib",
}  # fmt: skip
FORMATS = {
    "v": "v x y z",
    "l": "l i j ..., numbers of vertices",
    "f": "f i j k ..., numbers of vertices",
    "p": "p i ..., numbers of vertices",
    "curv": "curv u0 u1 i j ..., numbers of vertices, of degree 1",
}


def read_obj(path):
    """Read a Wavefront OBJ file; return `Lines`. Raises ValueError with the line of the file."""
    reader = _Reader(path)
    for row, text in numbered_lines(path, continued="\\"):
        words = text.split("#", 1)[0].split()
        if words:
            reader.take(row, words)
    return reader.lines()


class _Reader:
    """What has been read so far of an OBJ file."""

    def __init__(self, path):
        self.path, self.points, self.ends, self.rows, self.marked = path, [], [], [], []
        self.degree, self.names, self.groups, self.drawn = 1, ("lines",), {}, set()

    def take(self, row, words):
        """Read a statement."""
        head, rest = words[0], words[1:]
        if head == "v":
            self.points.append(self._numbers(row, head, rest[:3], 3))
        elif head in ("g", "o"):
            self.names = tuple(dict.fromkeys(rest)) or ("lines",)
        elif head == "deg":
            self.degree = rest[0] if rest else 1
        elif head == "p":
            self.marked += self._vertices(row, head, rest, 1)
        elif head in ("l", "f", "curv"):
            if head == "curv":
                if str(self.degree) != "1":
                    wrong(self.path, row, f"a curve of degree {self.degree}", FORMATS[head])
                rest = rest[2:]
            numbers = self._vertices(row, head, rest, 2)
            pairs = list(pairwise(numbers))
            if head == "f":  # its edges are shared with other faces
                pairs = [pair for pair in [*pairs, (numbers[-1], numbers[0])] if frozenset(pair) not in self.drawn]
                self.drawn.update(map(frozenset, pairs))
            self._join(row, pairs)
        elif head not in IGNORED:
            wrong(self.path, row, f"'{head}' is no line, face or vertex", "; ".join(FORMATS.values()))

    def _join(self, row, pairs):
        for pair in pairs:
            for name in self.names:
                self.groups.setdefault(name, []).append(len(self.ends))
            self.ends.append(pair)
            self.rows.append(row)

    def _numbers(self, row, head, words, count):
        try:
            numbers = [float(word) for word in words]
        except ValueError:
            numbers = []
        if len(numbers) < count or not np.isfinite(numbers).all():
            wrong(self.path, row, f"'{' '.join([head, *words])}'", FORMATS[head])
        return numbers

    def _vertices(self, row, head, words, count):
        """Return vertices, counted from 0; negative numbers count back from the last one."""
        try:
            numbers = [int(word.split("/")[0]) for word in words]
        except ValueError:
            numbers = []
        if len(numbers) < count:
            wrong(self.path, row, f"'{' '.join([head, *words])}'", FORMATS[head])
        n = len(self.points)
        for number in numbers:
            if not (number >= 1 or -n <= number <= -1):
                wrong(self.path, row, f"vertex {number}, with {n} vertices so far", FORMATS[head])
        return [number - 1 if number > 0 else n + number for number in numbers]

    def lines(self):
        """Return what has been read."""
        n = len(self.points)
        for pair, row in zip(self.ends, self.rows):
            if max(pair) >= n:
                wrong(self.path, row, f"vertex {max(pair) + 1}, but the file has {n}", "numbers of vertices")
        if not self.ends:
            wrong(self.path, None, "holds no line", "; ".join(FORMATS[head] for head in ("v", "l", "f", "curv")))
        if max(self.marked, default=0) >= n:
            wrong(self.path, None, f"marks vertex {max(self.marked) + 1}, but has {n}", FORMATS["p"])
        return Lines(
            self.path, self.points, self.ends,
            {name: np.array(chosen) for name, chosen in self.groups.items()},
            {"points": np.unique(self.marked)} if self.marked else {},
            rows=self.rows, drawing=True,
        )  # fmt: skip
