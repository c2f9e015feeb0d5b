"""Read a structure from a file of an engineer: Gmsh, CSV, DXF, OBJ, compas, OpenSees.

A TOML file of the same stem beside it says what its groups are, in SI units throughout. A group is a physical group
of Gmsh, a layer of a DXF file, a ``g`` or ``o`` of an OBJ file, a name in the column ``group`` of a CSV file. All
lines are the group ``lines`` of an OBJ file without groups, ``edges`` of a compas file, ``members`` of CSV files,
``truss`` of OpenSees::

    title = "Canopy"                     # optional; the name of the structure, else that of the file
    dim = 3                              # optional; a flat structure is 2D, one along x is 1D
    geometry = "large"                   # optional; how displacements turn links: linear (not), prestress, large

    [laws.chords]                        # group of lines
    law = "bar"                          # bar | cable | compression_only | inextensible | contact | friction | table
    EA = 2.1e8                           # N, stiffness EA / length as drawn;  or: stiffness = 1e7 (N/m)
    area = 1e-3                          # m2, optional: results have stresses
    strength = 235e6                     # Pa, optional, with area: results have utilisations

    [laws.bracing]
    law = "cable"
    EA = 2.3e7
    prestress = 5e3                      # N, before loading;  or: initial_elongation = 1e-3 (m),
                                         # the elongation e0;  or: strain = 1e-4
    [laws.hangers]
    law = "inextensible"                 # rigid laws have no EA; stiffness is then the search parameter, optional
    [laws.bearings]
    law = "friction"                     # contact with Coulomb friction; law = "contact": without
    coefficient = 0.3
    gap = 1e-3                           # m, optional
    normal = [0.0, 1.0, 0.0]             # optional; by default along the line
    [laws.dampers]
    law = "table"                        # piecewise linear: pairs of e + e0 (m) and tension (N)
    table = [[-0.1, -5e3], [0.0, 0.0], [0.1, 5e3], [0.2, 5e3]]

    [supports.abutments]                 # group of points or lines
    fix = ["x", "y", "z"]                # or "xyz"; optional: all directions
    displacement = [0.0, 0.0, -0.01]     # m, optional; without it that of the file, or none

    [loads.deck]
    force = [0.0, 0.0, -1e4]             # N on each node

    [loads.chords]
    line = [0.0, 0.0, -785.0]            # N/m along each line, half of it to either end: the weight of the chords

    [loads.crowd]                        # or the nodes in a box
    box = [[0, 0, 0], [8, 2, 0]]
    force = [0.0, 0.0, -5e3]

    [loads.wind]                         # or those where conditions hold
    where = "x=min,z>0"
    force = [2e3, 0.0, 0.0]

    [masses.deck]                        # for motions: kg on each node
    mass = 50.0
    [masses.chords]                      # or kg/m along each line, half of it to either end
    line = 12.0

    [velocities.deck]
    velocity = [0.0, 0.0, -1.0]          # m/s of each node at the start

Loads and masses add up; a node may belong to several groups. A table of nodes with the name ``all``, such as
``[loads.all]``, is for all of them. A name that no group has is that of one node or line: ``[loads.17]``,
``[laws.strut3]``. ``lines = "NAME"``, or ``"all"``, names the lines of a load or a mass of another name. Nodes that no
link touches are left out; with a load, a mass or a displacement they are refused. Load cases are tables ``[[case]]``,
see `latinpc.files.cases`.
"""

from __future__ import annotations

import importlib
import os
import pathlib
import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from latinpc.geometry import GEOMETRIES
from latinpc.laws import Law
from latinpc.numbering import Numbering, grouped
from latinpc.scenes.scene import Scene

from .cases import read_cases
from .description import number, read_description, read_loads, read_masses, read_supports, read_velocities
from .given import ALIKE, Given, add_options, by_group, in_space
from .groups import Groups
from .linklaws import read_laws
from .selection import AXES
from .tables import pair
from .text import nearest

#: Suffix -> module and function; a folder has the suffix "".
READERS = {
    ".msh": ("gmsh", "read_gmsh"),
    ".csv": ("tables", "read_tables"),
    "": ("tables", "read_tables"),
    ".dxf": ("dxf", "read_dxf"),
    ".obj": ("wavefront", "read_obj"),
    ".json": ("compas", "read_compas"),
    ".tcl": ("opensees", "read_opensees"),
    ".py": ("opensees", "read_opensees"),
}
OPTIONS = "--law, --EA, --prestress"
FORMATS = ".msh (Gmsh), .csv, .dxf, .obj, .json (compas), .tcl or .py (OpenSees), or a folder of CSV files"


def read(
    path: str | os.PathLike,
    description: str | os.PathLike | None = None,
    *,
    scale: float | None = None,
    merge: float | None = None,
    rise: float | None = None,
    brace: float | None = None,
    law: str | Law | dict[str | None, str | Law] | None = None,
    EA: float | dict[str | None, float] | None = None,
    prestress: float | dict[str | None, float] | None = None,
    support: str | Sequence[str] = (),
    load: str | Sequence[str] = (),
    self_weight: float | dict[str | None, float] | None = None,
    case: str | None = None,
    geometry: str | None = None,
) -> Scene:
    """Read a structure from a file.

    Not collective: call it on one rank and broadcast. What acts on all lines or on those of a group is one value, or a
    dict of group to value, where None stands for all other groups.

    Parameters
    ----------
    path : str or path-like
        Gmsh ``.msh``; ``.csv``, or a folder with nodes.csv and members.csv; ``.dxf``; ``.obj``; ``.json`` of compas;
        ``.tcl`` or ``.py`` of OpenSees. The suffix says which.
    description : str or path-like, optional
        The TOML file, by default the same stem with ``.toml`` where there is one, with or without ``-nodes`` and
        ``-members`` of CSV files, beside a folder or in it; see the module.
    scale : float, optional
        A unit of length of the file (m); of a DXF file its own unit by default, else 1.
    merge : float, optional
        Distance (m) below which points are one node; in drawings (DXF, OBJ, compas) 1e-6 of the largest extent of
        the lines by default, elsewhere none.
    rise : float, optional
        Raise a flat drawing to a vault, its crown so many longer sides above its rim.
    brace : float, optional
        Make two layers, so far apart along z (m), with posts, group ``posts``, and crossed braces, group ``braces``,
        which are cables unless something else is said.
    law, EA, prestress : str or Law, float, float, or dict, optional
        A `latinpc.Law` or its name, axial stiffness (N) and tension before loading (N) of the lines that the files give
        none; ``bar`` is the default law.
    support : str or sequence of str
        Held nodes, as ``WHERE`` or ``WHERE:AXES``, for instance ``"z=min"`` or ``"x=max:yz"``; WHERE is a group, a node
        by its name in the file, ``all``, or conditions on coordinates joined by commas.
    load : str or sequence of str
        Forces on each node (N), as ``z=-1000`` or ``x=50,z=-1000:WHERE``.
    self_weight : float or dict, optional
        Weight (N/m) along the lines, against the last axis.
    case : str, optional
        Name of a load case of the TOML file, whose actions the scene gets.
    geometry : {'linear', 'prestress', 'large'}, optional
        How displacements turn links; by default what the TOML file says, or a file of corotTruss elements alone
        (large), else linear.

    Returns
    -------
    Scene
        With the load cases of the TOML file, unless one is chosen. Its metadata has the name of the file and
        ``notes``, a list of sentences on what was left out.

    Raises
    ------
    FileNotFoundError, ValueError
        With the file, its line or its table, and what was expected.
    """
    path = _named(path)
    for name, value in (("scale", scale), ("merge", merge), ("rise", rise), ("brace", brace)):
        if value is not None:
            number(value, name)
    lines = _reader(path)(path).in_metres(scale).merged(merge)
    if rise is not None:
        lines = lines.raised(rise)
    if brace is not None:
        lines = lines.braced(brace)
    given = Given(*map(by_group, (law, EA, prestress)), {} if brace is None else {"braces": "cable"}, geometry)
    settings, description = _settings(path, description, lines, given)
    add_options(settings, given, support, load, by_group(self_weight))
    scene = _scene(path, lines, settings, description, given)
    if case is None:
        return scene
    cases = {item.name: item for item in scene.cases}
    if case not in cases:
        raise ValueError(f"{description}: no [[case]] has the name '{case}'{nearest(case, cases)}")
    return cases[case].applied(scene)


def sources(path: str | os.PathLike) -> list[pathlib.Path]:
    """Return the files that `read` reads of a structure: its own, both tables, the TOML file where there is one."""
    path = _named(path)
    beside = [file for file in (_beside(path),) if file.is_file()]
    return (pair(path) if path.is_dir() or path.suffix.lower() == ".csv" else [path]) + beside


def _named(path):
    """Return a path that ends with a name, which ``.`` does not."""
    path = pathlib.Path(path)
    return path.resolve() if path.name in ("", "..") else path


def _stem(path):
    """Return the name without the suffix, which a folder has none of: br.v2 is no br."""
    return path.name if path.is_dir() else path.stem


def _reader(path):
    """Return the function that reads a file."""
    if not path.exists():
        raise FileNotFoundError(f"{path}: no such file")
    suffix = "" if path.is_dir() else path.suffix.lower()
    if suffix not in READERS or (path.is_file() and not suffix):
        raise ValueError(f"{path}: no known kind of file; expected {FORMATS}")
    module, function = READERS[suffix]
    return getattr(importlib.import_module(f"latinpc.files.{module}"), function)


def _settings(path, description, lines, given):
    """Read the TOML file, where there is one; refuse a file that says nothing of its lines without one."""
    beside = _beside(path) if description is None else pathlib.Path(description)
    if beside.is_file():
        return read_description(beside), beside
    if description is not None:
        raise FileNotFoundError(f"{beside}: no such file")
    if not lines.laws and not given.EA and not any(map(given.rigid, given.law.values())):
        raise FileNotFoundError(
            f"{beside}: no such file; {path.name} needs it beside it to name the laws, supports and loads, or the"
            " options --EA, --support and --load"
        )
    return {}, beside


def _beside(path):
    """Return the TOML file of a file or a folder: that which is there, or else the name that it should have."""
    stem = _stem(path)
    names = [path.with_name(f"{stem}.toml")]
    word = re.fullmatch(r"(?:(.+)[-_ ])?(nodes|members)", stem)
    if path.is_dir():
        names += sorted(path.glob("*.toml"))
    elif word:
        other = stem.removesuffix(word[2]) + ("members" if word[2] == "nodes" else "nodes")
        names = [path.with_name(f"{name}.toml") for name in (word[1], other, stem) if name]
    there = [name for name in names if name.is_file()]
    if len(there) > 1:
        raise ValueError(
            f"{path}: it has several TOML files, {', '.join(map(str, there))}; keep one, or give description="
        )
    return (there or names)[0]


def _assignments(settings, description, lines, given):
    """Return the laws of all lines: of the file, of the TOML file, of options, in this order."""
    found, options_of = [], _options_of(lines, given)
    for where, chosen, entries, law in _of_files(settings, description, lines):
        for which in np.unique(options_of[chosen]):
            part, named = chosen[options_of[chosen] == which], given.named(which)
            group = next(filter(None, named.values()), "")
            options, full = OPTIONS + (f" of '{group}'" if group else ""), given.completed(entries, named, law)
            if not where and "EA" not in full and not given.rigid(full["law"]):
                without = [name for name, lines_of in lines.groups.items() if np.isin(part, lines_of).any()]
                cure = f"write [laws.{without[0]}]" if without else "put every line in a group"
                raise ValueError(
                    f"{lines.path}: {len(part)} lines have no law; {cure} in {description.name}, or give --EA"
                )
            filled = full.keys() - entries.keys() - {"law"}
            found.append((f"{where}, with {options}" if where and filled else where or options, part, full))
    if (useless := given.useless()) is not None:
        of, more = f" of '{useless[1]}'" if useless[1] else "", "" if useless[0] == "law" else ", or the laws take none"
        files = " or ".join(file.name for file in (lines.path, description) if file.is_file())
        raise ValueError(
            f"--{useless[0]}{of}: no line is left that needs it: {files}, or options of other groups, have it already"
            f"{more}"
        )
    return found


def _options_of(lines, given):
    """Return which options each line takes, for `Given.named`: of its name, else of its group, else of all lines."""
    groups = given.groups()
    for group in groups[:-1]:
        if group not in lines.groups:
            raise ValueError(f"{OPTIONS}: no line or group of lines is '{group}'{nearest(group, lines.groups)}")
        _refuse_empty(f"{OPTIONS} of '{group}'", lines, group)
    singles_last = sorted(enumerate(groups[:-1]), key=lambda one: (lines.groups.single(one[1]), -one[0]))
    number = np.full((len(ALIKE), len(lines.ends)), len(groups) - 1)
    for key, row in zip(ALIKE, number, strict=True):
        for index, group in singles_last:
            if group in getattr(given, key):
                row[lines.groups[group]] = index
    return np.ravel_multi_index(number, len(ALIKE) * [len(groups)])


def _of_files(settings, description, lines):
    """Return (place, lines, entries, default law) of what files give; the last are the lines that they give none."""
    tables = list(settings.get("laws", {}).items())
    table = _tables_of_lines(tables, lines, description)
    left, found = np.ones(len(lines.ends), bool), []
    for where, chosen, entries in lines.laws:
        for index in np.unique(table[chosen]):
            part = chosen[table[chosen] == index]
            of_file = (where, entries) if index < 0 else _together(where, entries, description, *tables[index])
            found.append((of_file[0], part, of_file[1], "bar"))
            left[part] = False
    for index, (group, entries) in enumerate(tables):
        found.append((f"{description}: [laws.{group}]", np.flatnonzero(left & (table == index)), entries, None))
    return [*found, ("", np.flatnonzero(left & (table < 0)), {}, "bar")]


def _tables_of_lines(tables, lines, description):
    """Return which table of laws of the TOML file each line has, -1 without one."""
    table = np.full(len(lines.ends), -1)
    singles_last = sorted(enumerate(tables), key=lambda one: lines.groups.single(one[1][0]))
    for index, (group, _) in singles_last:
        where, single = f"{description}: [laws.{group}]", lines.groups.single(group)
        if group not in lines.groups:
            raise ValueError(f"{where}: no line or group of lines has this name{nearest(group, lines.groups)}")
        _refuse_empty(where, lines, group)
        if (table[lines.groups[group]] >= 0).any() and not single:
            raise ValueError(f"{where}: some of its lines have a law already; keep one law for a line")
        table[lines.groups[group]] = index
    return table


def _together(where, entries, description, group, more):
    """Return the place and the law of lines that have part of it in the file, the rest in the TOML file."""
    both = sorted(entries.keys() & more.keys())
    if both:
        raise ValueError(f"{where}: it gives {both[0]}, as {description}: [laws.{group}] does; keep one of the two")
    return f"{where}, with {description}: [laws.{group}]", {**more, **entries}


def _refuse_empty(where, lines, group):
    """Refuse a law for a group without lines, which merging points leaves of one that others repeat."""
    if not len(lines.groups[group]):
        raise ValueError(f"{where}: no line is left of the group, each repeats one of another group; leave it out")


def _dimension(settings, lines, description):
    """Return the space dimension: the key `dim`, that of the file, or the last coordinate or load that is not zero."""
    extent = np.ptp(lines.points[lines.ends.ravel()], axis=0)
    varies = [axis for axis in range(3) if extent[axis] > 1e-12 * max(extent.max(), 1e-300)]
    found = max(varies, default=0) + 1
    moved = [axis for axis in range(3) if lines.load[:, axis].any() or lines.prescribed[:, axis].any()]
    dim = settings.get("dim", lines.dim or max(found, max(moved, default=0) + 1))
    if isinstance(dim, bool) or not isinstance(dim, int) or dim not in (1, 2, 3):
        raise ValueError(f"{description}: dim = {dim!r}; it must be 1, 2 or 3")
    for needed, what in (
        (found, "the coordinate {} varies"),
        (max(moved, default=0) + 1, "a node has a load or a displacement along {}"),
    ):
        if dim < needed:
            said = f"{what.format(AXES[needed - 1])} in {lines.nodes_path.name}"
            raise ValueError(f"{description}: dim = {dim}, but {said}")
    return dim


def _geometry(settings, lines, description, given, assignments):
    """Return how displacements turn links; refuse laws and directions that do not turn."""
    geometry = given.geometry or settings.get("geometry", lines.geometry)
    if geometry not in GEOMETRIES:
        where = "geometry" if given.geometry else f"{description}: geometry"
        raise ValueError(f"{where} = {geometry!r}; use {', '.join(GEOMETRIES)}")
    for where, _, entries in assignments if geometry != "linear" else ():
        law, normal = entries["law"], geometry == "prestress" and "normal" in entries
        if law == "friction" or (geometry == "prestress" and given.rigid(law)) or normal:
            what = "a link with a normal of its own" if normal else f"the law {law}"
            raise ValueError(f"{where}: {what} does not turn with displacements, as geometry = '{geometry}' asks for")
    return geometry


def _scene(path, lines, settings, description, given):
    """Return the scene that lines, TOML file and options make."""
    _refuse_short(lines)
    dim = _dimension(settings, lines, description)
    assignments = _assignments(settings, description, lines, given)
    laws = read_laws(lines, dim, assignments)
    geometry = _geometry(settings, lines, description, given, assignments)
    used, ends = np.unique(lines.ends.ravel(), return_inverse=True)
    notes = lines.notes + _left_out(lines, used)
    ends, line = ends.reshape(-1, 2), laws.pop("line")
    number = np.full(len(lines.points), -1)
    number[used] = np.arange(len(used))
    nodes = np.ascontiguousarray(lines.points[used, :dim])
    groups = {name: number[chosen] for name, chosen in lines.node_groups.items()}
    for name, chosen in lines.groups.items():
        groups[name] = np.union1d(groups.get(name, np.zeros(0, np.int64)), ends[chosen])
    groups = Groups({name: chosen[chosen >= 0] for name, chosen in groups.items()}, lines.point_names[used])
    drawn = {name: np.flatnonzero(np.isin(line, chosen)) for name, chosen in lines.groups.items()}
    points = {name: number[chosen][number[chosen] >= 0] for name, chosen in lines.node_groups.items()}
    notes = notes + in_space(settings, dim, description)
    fixed, prescribed = read_supports(
        settings, nodes, groups, description, lines.fixed[used, :dim].copy(), lines.prescribed[used, :dim].copy()
    )
    mass, line_mass = read_masses(settings, nodes, ends, lines.groups, groups, description, lines.mass[used])
    load, line_load = read_loads(settings, nodes, ends, lines.groups, groups, description)
    of_line = np.bincount(line, minlength=len(ends))[line]  # a contact with friction is several links
    if not fixed.any() and mass is None:
        raise ValueError(
            f"{path}: nothing is held; write [supports.NAME] with fix = [...] in {description.name}, or give --support,"
            " such as z=min"
        )
    scene = Scene(
        name=str(settings.get("title", re.sub(r"[-_ ](nodes|members)$", "", _stem(path)))),
        nodes=nodes,
        links=ends[line].astype(np.int64),
        **laws,
        fixed=fixed,
        prescribed=prescribed,
        load=lines.load[used, :dim] + load,
        mass=mass,
        line_load=line_load[line] / of_line[:, None] if line_load.any() else None,
        line_mass=line_mass[line] / of_line if line_mass.any() else None,
        velocity=read_velocities(settings, nodes, groups, fixed, description),
        geometry=geometry,
        numbering=Numbering(
            lines.point_names[used], None if lines.line_names is None else lines.line_names[line],
            grouped(points, len(used)), grouped(drawn, len(line)),
        ),
        metadata={
            "file": path.name, "nodes_without_link": int(len(lines.points) - len(used)), "notes": notes,
        },
    )  # fmt: skip
    return replace(scene, cases=read_cases(settings, scene, ends, line, lines.groups, groups, description))


def _left_out(lines, used):
    """Return a note on nodes that no link touches; refuse those that something acts on."""
    alone = np.ones(len(lines.points), bool)
    alone[used] = False
    for what, values in (("load", lines.load), ("mass", lines.mass[:, None]), ("displacement", lines.prescribed)):
        acted = np.flatnonzero(alone & values.any(axis=1))
        if acted.size:
            raise ValueError(
                f"{lines.nodes_path}: no link touches node {lines.point_name(acted[0])}, one of {acted.size} such with"
                f" a {what}; join it by a link, or take its {what} away"
            )
    held, count = np.flatnonzero(alone & lines.fixed.any(axis=1)), int(alone.sum())
    more = f", {held.size:,} of them held, such as {lines.point_name(held[0])}" if held.size else ""
    groups = [name for name, chosen in lines.node_groups.items() if alone[chosen].any()]
    more += f"; of the group{'s' * (len(groups) > 1)} {', '.join(groups)}" if groups else ""
    return [f"{count:,} node{'s' * (count > 1)} that no link touches left out{more}"] if count else []


def _refuse_short(lines):
    """Refuse lines without a length."""
    short = np.flatnonzero(lines.lengths <= 1e-12 * max(lines.extent, 1e-300))
    if short.size:
        a, b = map(lines.point_name, lines.ends[short[0]])
        cure = "in Gmsh, merge the points (Coherence)" if lines.path.suffix == ".msh" else "remove it"
        raise ValueError(
            f"{lines.place(short[0])}: a link of zero length, one of {short.size}, between nodes {a} and {b}; {cure}"
        )
