"""Lines between points, as files give them, and what is made of them: merged, raised, braced."""

from __future__ import annotations

import pathlib
from dataclasses import dataclass, field, replace

import numpy as np

from latinpc.numbering import place_name

from .groups import Groups

MERGE = 1e-6  # of the largest extent: the least distance of two points of a drawing that are not one node
LENGTHS = ("initial_elongation", "gap")  # entries of laws that are in the unit of the file
GENERIC = np.array([0.5773, 0.7071, 0.4082])  # a direction along which the points of a regular drawing are apart


@dataclass
class Lines:
    """Points and lines of a file, and what the file says of them.

    Parameters
    ----------
    path : path-like
        The file, for messages.
    points : (n, 3) array of float
        In units of the file.
    ends : (m, 2) array of int
        The two points of each line.
    groups, node_groups : dict of str to array of int
        Lines and points by name: physical groups, layers, columns of a table.
    rows : (m,) array of int, optional
        Line of the file that each line comes from, for messages; 0 where not known.
    dim : int, optional
        Dimension of the space, where the file gives it.
    drawing : bool
        Points have no names of their own: those near each other are one node, and a line drawn twice is one link.
    laws : list of (str, array of int, dict)
        Place in the file, lines, and their law as in ``[laws.NAME]``.
    unit : float, optional
        Unit of length (m), None where a drawing should name one and does not.
    heading : str
        A column of lengths whose heading has a unit of its own, with its file, if there is one.
    fixed, prescribed, load : (n, 3) array, optional
        Of the points, in units of the file and N.
    mass : (n,) array of float, optional
        In kg.
    notes : list of str
        What the reader left out or took for granted.
    geometry : str
        How displacements turn links, as of a Scene.
    point_names : (n,) array of int or str, optional
        What the file calls its points, empty where it has no name; by default they are counted from 1.
    line_names : (m,) array of int or str, optional
        What it calls its lines; by default they go by their points.
    nodes_path : path-like, optional
        The file of the points, where that is another one, for messages.
    """

    path: pathlib.Path
    points: np.ndarray
    ends: np.ndarray
    groups: dict = field(default_factory=dict)
    node_groups: dict = field(default_factory=dict)
    rows: np.ndarray | None = None
    dim: int | None = None
    drawing: bool = False
    laws: list = field(default_factory=list)
    unit: float | None = 1.0
    heading: str = ""
    fixed: np.ndarray | None = None
    prescribed: np.ndarray | None = None
    load: np.ndarray | None = None
    mass: np.ndarray | None = None
    notes: list = field(default_factory=list)
    geometry: str = "linear"
    point_names: np.ndarray | None = None
    line_names: np.ndarray | None = None
    nodes_path: pathlib.Path | None = None

    def __post_init__(self):
        self.path = pathlib.Path(self.path)
        self.nodes_path = self.nodes_path or self.path
        self.points = np.asarray(self.points, dtype=float).reshape(-1, 3)
        self.ends = np.asarray(self.ends, dtype=np.int64).reshape(-1, 2)
        n = len(self.points)
        self.rows = np.zeros(len(self.ends), np.int64) if self.rows is None else np.asarray(self.rows)
        self.fixed = np.zeros((n, 3), bool) if self.fixed is None else self.fixed
        self.prescribed = np.zeros((n, 3)) if self.prescribed is None else self.prescribed
        self.load = np.zeros((n, 3)) if self.load is None else self.load
        self.mass = np.zeros(n) if self.mass is None else self.mass
        self.point_names = np.arange(1, n + 1) if self.point_names is None else np.asarray(self.point_names)
        self.line_names = None if self.line_names is None else np.asarray(self.line_names)
        self.groups = Groups(self.groups, self.line_names)

    @property
    def extent(self):
        """Largest extent of the lines (m); points without lines may be anywhere."""
        return float(np.ptp(self.points[self.ends.ravel()], axis=0).max()) if len(self.ends) else 0.0

    @property
    def lengths(self):
        """Length of each line (m)."""
        return np.linalg.norm(self.points[self.ends[:, 1]] - self.points[self.ends[:, 0]], axis=1)

    def point_name(self, point):
        """Return what messages call a point: its name in the file, or its place where it has none."""
        return str(self.point_names[point]) or place_name(self.points, point)

    def place(self, line):
        """Return the place of a line in the file, for messages."""
        row = self.rows[line]
        a, b = map(self.point_name, self.ends[line])
        return f"{self.path}, line {row}" if row else f"{self.path}: the line between nodes {a} and {b} of the file"

    def in_metres(self, scale=None):
        """Return the lines with coordinates, displacements, initial elongations and gaps in m.

        Parameters
        ----------
        scale : float, optional
            A unit of length of the file (m); by default what the file says.
        """
        if scale is not None and self.heading:
            raise ValueError(f"--scale {scale:g}: there is a unit already, in the heading of {self.heading}")
        notes = ["the drawing has no unit: coordinates are taken as m (--scale)"] if scale is self.unit is None else []
        scale = (self.unit or 1.0) if scale is None else scale
        if not 0.0 < scale < np.inf:
            raise ValueError(f"--scale {scale:g}: it must be positive, such as 0.001 for a file in mm")
        notes += [] if scale == 1.0 else [f"a unit of length is {scale:g} m"]
        laws = [
            (where, chosen, {key: value * scale if key in LENGTHS else value for key, value in entries.items()})
            for where, chosen, entries in self.laws
        ]
        return replace(
            self, points=self.points * scale, prescribed=self.prescribed * scale, laws=laws, unit=1.0,
            notes=self.notes + notes,
        )  # fmt: skip

    def merged(self, tolerance=None):
        """Return the lines with points nearer to each other than a tolerance made one.

        Points in a row, each within the tolerance of the next, all become the first of them in the file.

        Parameters
        ----------
        tolerance : float, optional
            In m. By default 1e-6 of the largest extent in a drawing, none in other files.
        """
        if tolerance is None:
            if not self.drawing:
                return self
            tolerance = MERGE * self.extent
        elif not 0.0 <= tolerance <= self.extent / 20.0:
            raise ValueError(
                f"--merge {tolerance:g}: it must be between 0 and {self.extent / 20.0:g} m, a twentieth of the extent"
            )
        first, of = near_points(self.points, tolerance)
        self._refuse_contradictions(tolerance, of)
        ends = of[self.ends]
        keep = self._kept(ends) if self.drawing else np.arange(len(ends))
        if not len(keep):
            raise ValueError(f"{self.path}: holds no line longer than {tolerance:g} m, the distance of --merge")
        new = np.full(len(ends), -1)
        new[keep] = np.arange(len(keep))
        points, left = len(self.points) - len(first), len(ends) - len(keep)
        notes = [f"{points:,} point{'s' * (points > 1)} merged"] if points else []
        one = "line left out that is" if left == 1 else "lines left out that are"
        notes += [f"{left:,} {one} drawn twice or shorter than the tolerance"] if left else []
        return replace(
            self,
            points=self.points[first],
            ends=ends[keep],
            rows=self.rows[keep],
            groups={name: new[chosen][new[chosen] >= 0] for name, chosen in self.groups.items()},
            node_groups={name: np.unique(of[chosen]) for name, chosen in self.node_groups.items()},
            laws=[(where, new[chosen][new[chosen] >= 0], entries) for where, chosen, entries in self.laws],
            fixed=_gathered(np.logical_or, self.fixed, of),
            prescribed=_gathered(lambda a, b: np.where(a == 0.0, b, a), self.prescribed, of),
            load=_gathered(np.add, self.load, of),
            mass=_gathered(np.add, self.mass, of),
            point_names=self.point_names[first],
            line_names=None if self.line_names is None else self.line_names[keep],
            notes=self.notes + notes,
        )

    def _refuse_contradictions(self, tolerance, of):
        """Refuse points of one node that are held with different displacements."""
        for axis in range(3):
            held = np.flatnonzero(self.fixed[:, axis])
            first = held[np.unique(of[held], return_index=True)[1]]  # of the held points of each node
            first = first[np.searchsorted(of[first], of[held])]
            other = np.flatnonzero(self.prescribed[held, axis] != self.prescribed[first, axis])
            if other.size:
                raise ValueError(
                    f"{self.nodes_path}: --merge {tolerance:g} joins nodes {self.point_name(first[other[0]])} and"
                    f" {self.point_name(held[other[0]])} of the file, which have different prescribed displacements"
                )

    @staticmethod
    def _kept(ends):
        """Return the lines of a drawing that are links: not of no length, and not drawn before."""
        pairs = np.sort(ends, axis=1)
        first = np.unique(pairs, axis=0, return_index=True)[1]
        first.sort()
        return first[pairs[first, 0] != pairs[first, 1]]

    def raised(self, rise):
        """Return a flat drawing as a vault over its rectangle.

        Parameters
        ----------
        rise : float
            Height of the crown over the rim, in longer sides of the rectangle. Heights in between are the product of
            a parabola over each side.
        """
        if not np.isfinite(rise):
            raise ValueError(f"--raise {rise:g}: it must be a finite number")
        joined = self.points[self.ends.ravel()]
        low, high = joined.min(axis=0), joined.max(axis=0)
        side = (high - low)[:2]
        if high[2] - low[2] > MERGE * self.extent:
            raise ValueError(
                f"{self.path}: --raise is for a flat drawing, z the same everywhere; here z goes from"
                f" {low[2]:g} to {high[2]:g} m"
            )
        at = 2.0 * (self.points[:, :2] - low[:2]) / np.where(side > 0.0, side, 1.0) - 1.0
        height = rise * side.max() * np.prod(np.where(side > 0.0, 1.0 - at**2, 1.0), axis=1)
        return replace(self, points=self.points + np.outer(height, [0.0, 0.0, 1.0]))

    def braced(self, depth):
        """Return two layers of the lines, one above the other, with posts between them and crossed braces.

        There is a post at each point, and in each bay, between a line and its copy, two braces. Posts are the group
        ``posts``, braces the group ``braces``; groups of the drawing hold both layers.

        Parameters
        ----------
        depth : float
            Distance of the layers (m), along z.
        """
        if not 0.0 < depth < np.inf:
            raise ValueError(f"--brace {depth:g}: it must be positive, the distance of the two layers in m")
        n, m = len(self.points), len(self.ends)
        span = self.points[self.ends[:, 1]] - self.points[self.ends[:, 0]]
        upright = np.flatnonzero(np.abs(span[:, :2]).max(axis=1, initial=0.0) <= MERGE * self.extent)
        if upright.size:
            raise ValueError(f"{self.place(upright[0])}: --brace puts posts along z, where this line is already")
        clash = {"posts", "braces"} & (set(self.groups) | set(self.node_groups))
        if clash:
            raise ValueError(f"{self.path}: --brace makes a group '{clash.pop()}', which the file has already")
        posts = np.column_stack([np.arange(n), np.arange(n) + n])
        braces = np.concatenate([self.ends + [0, n], self.ends + [n, 0]])
        two = {name: np.concatenate([chosen, chosen + m]) for name, chosen in self.groups.items()}
        return replace(
            self,
            points=np.concatenate([self.points, self.points + [0.0, 0.0, depth]]),
            ends=np.concatenate([self.ends, self.ends + n, posts, braces]),
            rows=np.concatenate([self.rows, self.rows, np.zeros(n, np.int64), self.rows, self.rows]),
            groups=two | {"posts": 2 * m + np.arange(n), "braces": 2 * m + n + np.arange(2 * m)},
            node_groups={name: np.concatenate([chosen, chosen + n]) for name, chosen in self.node_groups.items()},
            laws=[(where, np.concatenate([chosen, chosen + m]), entries) for where, chosen, entries in self.laws],
            point_names=np.concatenate([self.point_names.astype(str), _upper(self.point_names)]),
            line_names=None,
            **{name: np.concatenate([getattr(self, name)] * 2) for name in ("fixed", "prescribed", "load", "mass")},
        )


def _upper(names):
    """Return what the points of a second layer are called; those without a name go by their place."""
    return np.array([f"{name} upper" if name else "" for name in names.astype(str)])


def near_points(points, tolerance):
    """Find points nearer to each other than a tolerance, directly or through others.

    Returns
    -------
    first : (k,) array of int
        The first point of each of the k nodes, increasing.
    of : (n,) array of int
        The node of each point.
    """
    along = points @ GENERIC
    order = np.argsort(along, kind="stable")
    along, sorted_points = along[order], points[order]
    width = tolerance * np.linalg.norm(GENERIC) + 1e-14 * np.abs(along).max(initial=0.0)
    pairs, active, step = [np.zeros((0, 2), np.int64)], np.arange(len(points)), 1
    while active.size:
        active = active[active < len(points) - step]
        active = active[along[active + step] - along[active] <= width]
        near = np.linalg.norm(sorted_points[active + step] - sorted_points[active], axis=1) <= tolerance
        pairs.append(np.column_stack([order[active[near]], order[active[near] + step]]))
        step += 1
    return np.unique(connected(len(points), *np.concatenate(pairs).T), return_inverse=True)


def connected(n, a, b):
    """Return for each of n points the first of those that pairs (a, b) connect it with."""
    label = np.arange(n)
    while True:
        new, least = label.copy(), np.minimum(label[a], label[b])
        np.minimum.at(new, a, least)
        np.minimum.at(new, b, least)
        new = new[new]
        if (new == label).all():
            return label
        label = new


def _gathered(join, values, of):
    """Return values of points as those of nodes, joined in the order of the points."""
    result = np.zeros((of.max(initial=-1) + 1, *values.shape[1:]), values.dtype)
    left = np.arange(len(of))
    while left.size:  # each pass takes one point of each node
        node, chosen = np.unique(of[left], return_index=True)
        result[node] = join(result[node], values[left[chosen]])
        left = np.delete(left, chosen)
    return result
