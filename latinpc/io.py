"""Structures read from Gmsh files, results written for ParaView.

A structure comes as a pair of files with the same stem::

    bridge.msh     nodes and lines, sorted into physical groups
    bridge.toml    what each physical group is: laws, supports, loads

Every line of the mesh is one link. In the TOML file, SI units throughout::

    dim = 3                              # optional; a flat mesh is 2D, a mesh along x is 1D

    [laws.chords]                        # physical group of curves
    law = "bar"                          # bar | cable | strut | inextensible | contact | friction | table
    EA = 2.1e8                           # N, stiffness EA / length;  or: stiffness = 1e7 (N/m)

    [laws.bracing]
    law = "cable"
    EA = 2.3e7
    tension = 5e3                        # N, before loading;  or: prestrain = 1e-3 (m),
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

    [supports.abutments]                 # physical group of points or curves
    fix = ["x", "y", "z"]
    displacement = [0.0, 0.0, -0.01]     # m, optional

    [loads.deck]
    force = [0.0, 0.0, -1e4]             # N on each node

    [loads.crowd]                        # or the nodes in a box
    box = [[0, 0, 0], [8, 2, 0]]
    force = [0.0, 0.0, -5e3]

    [masses.deck]                        # for motions: kg on each node
    mass = 50.0
    [masses.chords]                      # or kg/m along each line, half of it to either end
    line = 12.0

    [velocities.deck]
    velocity = [0.0, 0.0, -1.0]          # m/s of each node at the start

Loads and masses add up; a node may belong to several groups. Nodes that no link touches are left out.
"""

import contextlib
import difflib
import os
import pathlib
import resource
import shutil
import sys
import tempfile
import tomllib

import meshio
import numpy as np

from .scenes.scene import RIGID, Law, Scene

AXES = "xyz"
ROOM, ROOM_PER_BYTE = 2**28, 200  # bytes that a mesh may take, beside and for each of those of its file
LAW_KEYS = ("law", "EA", "stiffness", "prestrain", "strain", "tension", "gap", "coefficient", "normal", "table")
ONLY_FOR = {
    "gap": ("contact", "friction"),
    "coefficient": ("friction",),
    "normal": ("contact", "friction"),
    "table": ("table",),
}
SUPPORT_KEYS = ("fix", "displacement", "box")
LOAD_KEYS = ("force", "box")
MASS_KEYS = ("mass", "line", "box")
VELOCITY_KEYS = ("velocity", "box")
TOP_KEYS = ("title", "dim", "laws", "supports", "loads", "masses", "velocities")


# ---- writing whole files or none -------------------------------------------------------------


@contextlib.contextmanager
def atomic(path):
    """Yield a temporary name beside `path` that replaces it once the block has succeeded.

    Parameters
    ----------
    path : str or path-like
        The file to write. An interrupted write leaves the former file as it was.
    """
    path = pathlib.Path(path).resolve()  # through a link to the file it names
    device = path.exists() and not path.is_file()  # /dev/stdout and the like are written to, not replaced
    folder = None if device else path.parent
    handle, temporary = tempfile.mkstemp(prefix="." + path.stem + "-", suffix=path.suffix, dir=folder)
    os.close(handle)
    try:
        yield temporary
        if device:
            with open(temporary, "rb") as source, open(path, "wb") as sink:
                shutil.copyfileobj(source, sink)
            return
        mask = os.umask(0)  # mkstemp makes private files; the user's own mask decides
        os.umask(mask)
        os.chmod(temporary, 0o666 & ~mask)
        os.replace(temporary, path)
    finally:
        with contextlib.suppress(FileNotFoundError):
            os.unlink(temporary)


def check_writable(path, suffixes=None):
    """Refuse a result file that could not be written, before any work is done.

    Raises
    ------
    ValueError
        With an unknown suffix.
    OSError
        When the folder does not exist or may not be written to.
    """
    path = pathlib.Path(path)
    if suffixes and path.suffix.lower() not in suffixes:
        raise ValueError(f"{path}: cannot write '{path.suffix}' files here; use {' or '.join(suffixes)}")
    folder = path.parent
    if not folder.is_dir():
        raise FileNotFoundError(f"{path}: the folder {folder} does not exist; create it first")
    if path.is_dir() or not os.access(folder, os.W_OK):
        raise PermissionError(f"{path}: cannot be written; choose another place")


# ---- Gmsh in ---------------------------------------------------------------------------------


def read_scene(path, description=None):
    """Read a structure from a Gmsh file and the TOML file beside it.

    Not collective: call it on one rank and broadcast.

    Parameters
    ----------
    path : str or path-like
        The ``.msh`` file (format 2.2, 4.0 or 4.1).
    description : str or path-like, optional
        The TOML file, by default the same stem with ``.toml``.

    Returns
    -------
    Scene

    Raises
    ------
    FileNotFoundError, ValueError
        With the file, the group, the key, and the cure.
    """
    path = pathlib.Path(path)
    description = path.with_suffix(".toml") if description is None else pathlib.Path(description)
    settings = _read_description(path, description)
    points, lines, line_groups, node_groups = _read_mesh(path)
    dim = _dimension(settings, points[lines.ravel()], description, path)
    laws = _laws(settings, points[:, :dim], lines, line_groups, description, path)
    lines = lines[laws.pop("line")]

    used, links = np.unique(lines.ravel(), return_inverse=True)
    number = np.full(len(points), -1)
    number[used] = np.arange(len(used))
    nodes = points[used, :dim]
    node_groups = {name: number[group] for name, group in node_groups.items()}
    node_groups = {name: group[group >= 0] for name, group in node_groups.items()}
    fixed, prescribed = _supports(settings, nodes, node_groups, description)
    return Scene(
        name=str(settings.get("title", path.stem)),
        nodes=np.ascontiguousarray(nodes),
        links=links.reshape(-1, 2).astype(np.int64),
        **laws,
        fixed=fixed,
        prescribed=prescribed,
        load=_loads(settings, nodes, node_groups, description),
        subdomain=None,
        mass=_masses(settings, nodes, links.reshape(-1, 2), line_groups, node_groups, description),
        velocity=_velocities(settings, nodes, node_groups, fixed, description),
        metadata={"file": path.name, "nodes_without_link": int(len(points) - len(used))},
    )


def _nearest(word, known):
    """Return the words to add to a message about an unknown key."""
    close = difflib.get_close_matches(word, list(known), n=1, cutoff=0.5)
    return f" (do you mean '{close[0]}'?)" if close else f"; known: {', '.join(sorted(known)) or 'none'}"


def _read_description(path, description):
    if not path.is_file():
        raise FileNotFoundError(f"{path}: no such file")
    if not description.is_file():
        raise FileNotFoundError(
            f"{description}: no such file; {path.name} needs it beside it to name the laws, supports and loads"
        )
    with open(description, "rb") as file:
        try:
            settings = tomllib.load(file)
        except (
            ValueError,
            RecursionError,
        ) as error:  # TOMLDecodeError is a ValueError, as are numbers too long to read
            raise ValueError(f"{description}: not a TOML file: {error}") from None
    tables = {"laws": LAW_KEYS, "supports": SUPPORT_KEYS, "loads": LOAD_KEYS}
    tables |= {"masses": MASS_KEYS, "velocities": VELOCITY_KEYS}
    for key, value in settings.items():
        if key not in TOP_KEYS:
            raise ValueError(f"{description}: unknown key '{key}'{_nearest(key, TOP_KEYS)}")
        if key not in tables:
            continue
        for group, entries in value.items() if isinstance(value, dict) else [(key, None)]:
            if not isinstance(entries, dict):
                raise ValueError(f"{description}: [{key}] needs one table a group, written [{key}.NAME]")
            for entry in entries:
                if entry not in tables[key]:
                    hint = _nearest(entry, tables[key])
                    raise ValueError(f"{description}: [{key}.{group}]: unknown key '{entry}'{hint}")
    if not settings.get("laws"):
        raise ValueError(f"{description}: no law; write [laws.NAME] for each physical group of {path.name}")
    return settings


@contextlib.contextmanager
def _bounded(size):
    """Let the memory of this process grow by so many bytes at most, for readers that believe what a file announces."""
    before = resource.getrlimit(resource.RLIMIT_AS)
    try:
        with open("/proc/self/statm") as file:
            limit = int(file.read().split()[0]) * resource.getpagesize() + size
    except OSError:  # not Linux
        limit = resource.RLIM_INFINITY
    if before[1] != resource.RLIM_INFINITY:
        limit = before[1] if limit == resource.RLIM_INFINITY else min(limit, before[1])
    resource.setrlimit(resource.RLIMIT_AS, (limit, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


def _read_mesh(path):
    """Return points (n, 3), lines (m, 2), and the physical groups of lines and of nodes."""
    try:
        with _bounded(ROOM + ROOM_PER_BYTE * path.stat().st_size):
            mesh = meshio.gmsh.read(path)
    except Exception as error:  # meshio raises whatever its parser trips over
        reason = str(error) or type(error).__name__
        raise ValueError(
            f"{path}: not readable as a Gmsh mesh ({reason}); save it again from Gmsh, with every curve in a"
            " physical group"
        ) from None
    for block in mesh.cells:
        if block.type not in ("line", "vertex") and len(block.data):
            cure = "set Mesh.ElementOrder = 1" if block.type.startswith("line") else "save the curves only"
            raise ValueError(
                f"{path}: holds {len(block.data)} cells of type '{block.type}', but a link is a two-node"
                f" 'line'; in Gmsh, {cure}"
            )
    names = {(int(dim), int(tag)): name for name, (tag, dim) in mesh.field_data.items()}
    lines, line_groups, node_groups = [], {}, {}
    physical = mesh.cell_data.get("gmsh:physical")
    for index, block in enumerate(mesh.cells):
        cells = np.asarray(block.data, dtype=np.int64)
        if cells.size and cells.shape[1:] != ((1,) if block.type == "vertex" else (2,)):
            raise ValueError(f"{path}: a {block.type} has {cells.shape[-1]} nodes; save the mesh again")
        if cells.size and (cells.min() < 0 or cells.max() >= len(mesh.points)):
            raise ValueError(f"{path}: a {block.type} names a node that does not exist; save the mesh again")
        dim = 0 if block.type == "vertex" else 1
        groups = {}  # name -> which cells of the block
        for (group_dim, _), name in names.items():
            if group_dim == dim and name in mesh.cell_sets:  # format 4.1: an entity in several groups
                groups[name] = np.asarray(mesh.cell_sets[name][index], dtype=np.int64)
        if not any(len(chosen) for chosen in groups.values()) and physical is not None:
            for tag in np.unique(physical[index]):
                name = names.get((dim, int(tag)), str(tag))
                groups[name] = np.flatnonzero(physical[index] == tag)
        first = sum(map(len, lines))
        for name, chosen in groups.items():
            if len(chosen):
                node_groups.setdefault(name, []).append(cells[chosen].ravel())
                if dim == 1:
                    line_groups.setdefault(name, []).append(first + chosen)
        if dim == 1:
            lines.append(cells)
    if not sum(map(len, lines)):
        raise ValueError(f"{path}: holds no line; in Gmsh, mesh the curves (Mesh 1) before saving")
    points = np.zeros((len(mesh.points), 3))
    points[:, : mesh.points.shape[1]] = mesh.points
    return (
        points,
        np.concatenate(lines),
        {name: np.concatenate(parts) for name, parts in line_groups.items()},
        {name: np.unique(np.concatenate(parts)) for name, parts in node_groups.items()},
    )


def _dimension(settings, points, description, path):
    """Return the space dimension: told, or the last coordinate that varies."""
    extent = np.ptp(points, axis=0)
    varies = [axis for axis in range(3) if extent[axis] > 1e-12 * max(extent.max(), 1e-300)]
    found = max(varies, default=0) + 1
    dim = settings.get("dim", found)
    if isinstance(dim, bool) or not isinstance(dim, int) or dim not in (1, 2, 3):
        raise ValueError(f"{description}: dim = {dim!r}; it must be 1, 2 or 3")
    if dim < found:
        raise ValueError(f"{description}: dim = {dim}, but the coordinate {AXES[found - 1]} varies in {path.name}")
    return dim


def _number(value, where, positive=False):
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) <= sys.float_info.max:
        raise ValueError(f"{where} must be a finite number, not {value!r}")
    if positive and value <= 0:
        raise ValueError(f"{where} must be positive, not {value!r}")
    return float(value)


def _vector(value, dim, where):
    if not isinstance(value, list) or len(value) != dim:
        raise ValueError(f"{where} must be a list of {dim} numbers, not {value!r}")
    return np.array([_number(item, where) for item in value])


def _laws(settings, points, lines, line_groups, description, path):
    """Return what a Scene is told of the links, and the line of each: a contact with friction makes several links."""
    length = np.linalg.norm(points[lines[:, 1]] - points[lines[:, 0]], axis=1)
    null = np.flatnonzero(length <= 1e-12 * max(np.ptp(points, axis=0).max(), 1e-300))
    if len(null):
        a, b = lines[null[0]]
        raise ValueError(
            f"{path}: {len(null)} link(s) of zero length, the first between nodes {a + 1} and {b + 1}"
            " (counted in the order of the file); remove them, or merge the points in Gmsh (Coherence)"
        )
    law = np.full(len(lines), -1)
    stiffness, prestrain, friction = np.zeros(len(lines)), np.zeros(len(lines)), np.zeros(len(lines))
    direction, tables = np.zeros(points[lines[:, 0]].shape), []
    for group, entries in settings["laws"].items():
        where = f"{description}: [laws.{group}]"
        if group not in line_groups:
            raise ValueError(f"{where}: no physical group of lines has this name{_nearest(group, line_groups)}")
        chosen = line_groups[group]
        if (law[chosen] >= 0).any():
            raise ValueError(f"{where}: some of its lines have a law already; keep one law for a line")
        kinds = [kind.name.lower() for kind in Law if kind != Law.TANGENT] + ["table"]
        kind = entries.get("law")
        if kind not in kinds:
            said = "key 'law' is missing" if kind is None else f"unknown law {kind!r}"
            raise ValueError(f"{where}: {said}; use {', '.join(kinds)}")
        for key, laws in ONLY_FOR.items():
            if key in entries and kind not in laws:
                raise ValueError(f"{where}: {key} is of no use to the law {kind}, only to {' and '.join(laws)}")
        law[chosen] = len(Law) + len(tables) if kind == "table" else Law[kind.upper()]
        if kind == "table":
            tables.append(_table(entries, where))
        free = kind == "table" or Law[kind.upper()] in RIGID
        stiffness[chosen] = _stiffness(entries, length[chosen], where, free)
        prestrain[chosen] = _prestrain(entries, length[chosen], stiffness[chosen], where)
        if kind == "friction":
            friction[chosen] = _number(entries.get("coefficient"), f"{where}: coefficient")
            if friction[chosen[0]] < 0:
                raise ValueError(f"{where}: coefficient must not be negative, as {entries['coefficient']} is")
        if "normal" in entries:
            direction[chosen] = _vector(entries["normal"], points.shape[1], f"{where}: normal")
            if not direction[chosen[0]].any():
                raise ValueError(f"{where}: normal has no length; leave it out for the direction of the line")
    if (law < 0).any():
        without = [name for name, chosen in line_groups.items() if (law[chosen] < 0).any()]
        cure = f"write [laws.{without[0]}]" if without else "put every curve in a physical group in Gmsh"
        raise ValueError(f"{description}: {(law < 0).sum()} lines of {path.name} have no law; {cure}")
    return _contacts(points, lines, law, stiffness, prestrain, direction, friction) | {"tables": tuple(tables)}


def _contacts(points, lines, law, stiffness, prestrain, direction, friction):
    """Give each contact with friction its tangential links, along directions at right angles to the normal."""
    dim = points.shape[1]
    rows = np.where(law == Law.FRICTION, dim, 1)
    line = np.repeat(np.arange(len(law)), rows)
    first = np.append(True, line[1:] != line[:-1])
    law, direction, friction = law[line], direction[line], friction[line]
    for link in np.flatnonzero((law == Law.FRICTION) & first):
        normal = direction[link]
        if not normal.any():
            normal = np.subtract(*points[lines[line[link]]][::-1])
        frame = np.linalg.qr(np.column_stack([normal, np.eye(dim)]))[
            0
        ].T  # the normal first, perhaps with its sign turned
        direction[link : link + dim] = [normal, *frame[1:dim]]
        law[link + 1 : link + dim] = Law.TANGENT
    told = {"law": law, "stiffness": stiffness[line], "prestrain": np.where(first, prestrain[line], 0.0), "line": line}
    if direction.any():
        told["direction"] = direction
    if (law == Law.FRICTION).any():
        told["friction"] = friction
    return told


def _table(entries, where):
    """Return strains and tensions of a piecewise linear law."""
    table = entries.get("table")
    if not isinstance(table, list) or len(table) < 2:
        raise ValueError(f"{where}: table must be a list of two or more pairs [e + e0 (m), tension (N)], not {table!r}")
    strain, tension = np.array([_vector(pair, 2, f"{where}: table") for pair in table]).T
    if (np.diff(strain) <= 0).any() or (np.diff(tension) < 0).any() or tension[0] == tension[-1]:
        raise ValueError(f"{where}: the strains of the table must increase, and the tensions must not decrease")
    return strain, tension


def _one_of(entries, keys, where):
    given = [key for key in keys if key in entries]
    if len(given) > 1:
        raise ValueError(f"{where}: give only one of {', '.join(given)}")
    return given[0] if given else None


def _stiffness(entries, length, where, free):
    key = _one_of(entries, ("EA", "stiffness"), where)
    if key is None and free:
        return np.zeros(len(length))
    if free and key == "EA":
        raise ValueError(f"{where}: the law {entries['law']} takes no EA; leave it out, or give stiffness (N/m)")
    if key is None:
        raise ValueError(f"{where}: no stiffness; give EA (N) or stiffness (N/m)")
    value = _number(entries[key], f"{where}: {key}", positive=True)
    return value / length if key == "EA" else np.full(len(length), value)


def _prestrain(entries, length, stiffness, where):
    key = _one_of(entries, ("prestrain", "strain", "tension", "gap"), where)
    if key is None:
        return np.zeros(len(length))
    value = _number(entries[key], f"{where}: {key}")
    if key == "tension":
        if entries["law"] not in ("bar", "cable", "strut"):
            raise ValueError(f"{where}: the law {entries['law']} takes no tension before loading; give prestrain (m)")
        return value / stiffness
    return value * length if key == "strain" else value + 0 * length


def _nodes_of(group, entries, nodes, node_groups, where):
    """Return the nodes of a physical group, or those in a box."""
    if "box" not in entries:
        if group not in node_groups:
            hint = _nearest(group, node_groups)
            raise ValueError(f"{where}: no physical group has this name, and no box is given{hint}")
        chosen = node_groups[group]
    else:
        box = entries["box"]
        if not isinstance(box, list) or len(box) != 2:
            raise ValueError(f"{where}: box must be [[xmin, ..], [xmax, ..]], not {box!r}")
        low, high = (_vector(corner, nodes.shape[1], f"{where}: box") for corner in box)
        if (low > high).any():
            raise ValueError(f"{where}: the first corner of the box must be the lower one")
        slack = 1e-9 * max(np.ptp(nodes, axis=0).max(), 1e-300)  # a box of no thickness still holds its nodes
        chosen = np.flatnonzero(((nodes >= low - slack) & (nodes <= high + slack)).all(axis=1))
    if not len(chosen):
        raise ValueError(f"{where}: holds no node of a link")
    return chosen


def _supports(settings, nodes, node_groups, description):
    dim = nodes.shape[1]
    fixed, prescribed = np.zeros(nodes.shape, dtype=bool), np.zeros(nodes.shape)
    for group, entries in settings.get("supports", {}).items():
        where = f"{description}: [supports.{group}]"
        chosen = _nodes_of(group, entries, nodes, node_groups, where)
        fix = entries.get("fix", list(AXES[:dim]))
        if not isinstance(fix, list) or not fix or any(axis not in list(AXES[:dim]) for axis in fix):
            raise ValueError(f"{where}: fix must be a list out of {list(AXES[:dim])}, not {fix!r}")
        value = np.zeros(dim)
        if "displacement" in entries:
            value = _vector(entries["displacement"], dim, f"{where}: displacement")
        for axis in range(dim):
            if AXES[axis] not in fix:
                if value[axis]:
                    raise ValueError(f"{where}: displacement along {AXES[axis]}, which is not in fix")
                continue
            clash = fixed[chosen, axis] & (prescribed[chosen, axis] != value[axis])
            if clash.any():
                raise ValueError(f"{where}: a node has another displacement along {AXES[axis]} in another group")
            fixed[chosen, axis] = True
            prescribed[chosen, axis] = value[axis]
    if not fixed.any() and not settings.get("masses"):
        raise ValueError(f"{description}: nothing is held; write [supports.NAME] with fix = [...]")
    return fixed, prescribed


def _loads(settings, nodes, node_groups, description):
    load = np.zeros(nodes.shape)
    for group, entries in settings.get("loads", {}).items():
        where = f"{description}: [loads.{group}]"
        chosen = _nodes_of(group, entries, nodes, node_groups, where)
        if "force" not in entries:
            raise ValueError(f"{where}: key 'force' is missing; give force = [fx, ..] in N on each node")
        load[chosen] += _vector(entries["force"], nodes.shape[1], f"{where}: force")
    return load


def _masses(settings, nodes, links, line_groups, node_groups, description):
    """Return the masses of the nodes (kg), None without any."""
    if not settings.get("masses"):
        return None
    mass = np.zeros(len(nodes))
    for group, entries in settings["masses"].items():
        where = f"{description}: [masses.{group}]"
        key = _one_of(entries, ("mass", "line"), where)
        if key is None:
            raise ValueError(f"{where}: no mass; give mass (kg on each node) or line (kg/m along each line)")
        value = _number(entries[key], f"{where}: {key}", positive=True)
        if key == "mass":
            mass[_nodes_of(group, entries, nodes, node_groups, where)] += value
            continue
        if group not in line_groups or "box" in entries:
            raise ValueError(f"{where}: 'line' is for a physical group of lines{_nearest(group, line_groups)}")
        ends = links[line_groups[group]]
        length = np.linalg.norm(nodes[ends[:, 1]] - nodes[ends[:, 0]], axis=1)
        mass += np.bincount(ends.ravel(), np.repeat(value * length / 2.0, 2), len(nodes))
    return mass


def _velocities(settings, nodes, node_groups, fixed, description):
    """Return the velocities at the start (m/s), zero where held, None without any."""
    if not settings.get("velocities"):
        return None
    velocity = np.zeros(nodes.shape)
    for group, entries in settings["velocities"].items():
        where = f"{description}: [velocities.{group}]"
        chosen = _nodes_of(group, entries, nodes, node_groups, where)
        if "velocity" not in entries:
            raise ValueError(f"{where}: key 'velocity' is missing; give velocity = [vx, ..] in m/s of each node")
        velocity[chosen] = _vector(entries["velocity"], nodes.shape[1], f"{where}: velocity")
    return np.where(fixed, 0.0, velocity)


# ---- derived fields --------------------------------------------------------------------------


def elongations(scene, displacements):
    """Return the elongation (m) of each link, e = n.(U_b - U_a), shape (m,)."""
    a, b = scene.links.T
    return np.einsum("ij,ij->i", scene.directions, displacements[b] - displacements[a])


def slack(scene, tensions):
    """Tell which links are slack: cables, struts and contacts that carry nothing, shape (m,) of bool.

    A tension of rounding size counts as nothing: its scale is that of the largest tension.
    """
    threshold = 1e-12 * np.abs(tensions).max(initial=0.0)
    cable = np.isin(scene.law, (Law.CABLE, Law.INEXTENSIBLE)) & (tensions <= threshold)
    return cable | (np.isin(scene.law, (Law.STRUT, Law.CONTACT, Law.FRICTION)) & (tensions >= -threshold))


# ---- VTU out ---------------------------------------------------------------------------------


def write_vtu(path, scene, displacements, tensions, subdomain=None, node_class=None, velocities=None):
    """Write a solved structure for ParaView.

    Not collective: call it on one rank, with whole arrays in the scene's numbering.

    Parameters
    ----------
    path : str or path-like
        A ``.vtu`` file; it is replaced only once it is completely written.
    scene : Scene
    displacements : (n, dim) array
        In m.
    tensions : (m,) array
        In N.
    subdomain : (m,) array of int, optional
        Subdomain of each link; -1 where not given.
    node_class : (n,) array of int, optional
        0 interior, 1 strong interface, 2 weak interface, 3 corner; -1 where not given.
    velocities : (n, dim) array, optional
        In m/s.
    """
    n, m = len(scene.nodes), len(scene.links)

    def in_space(array):
        whole = np.zeros((n, 3))
        whole[:, : np.shape(array)[1]] = array
        return whole

    def whole_numbers(array, size):
        return np.full(size, -1, dtype=np.int64) if array is None else np.asarray(array, dtype=np.int64)

    mesh = meshio.Mesh(
        in_space(scene.nodes),
        [("line", np.asarray(scene.links, dtype=np.int64))],
        point_data={
            "displacement": in_space(displacements),
            "load": in_space(scene.load),
            "fixed": in_space(scene.fixed),
            "interface_class": whole_numbers(node_class, n),
            **({} if velocities is None else {"velocity": in_space(velocities)}),
        },
        cell_data={
            "tension": [np.asarray(tensions, dtype=float)],
            "elongation": [elongations(scene, displacements)],
            "slack": [slack(scene, tensions).astype(np.int64)],
            "law": [whole_numbers(scene.law, m)],
            "subdomain": [whole_numbers(subdomain, m)],
        },
    )
    with atomic(path) as temporary:
        meshio.vtu.write(temporary, mesh)


def write_pvd(path, motion):
    """Write a motion for ParaView: a file for each frame, in a folder of the same name, and an index with the times.

    Not collective: call it on one rank.

    Parameters
    ----------
    path : str or path-like
        A ``.pvd`` file; it is replaced only once all is written.
    motion : latinpc.motion.Motion
        With its frames.
    """
    path = pathlib.Path(path)
    folder = path.with_suffix("")
    folder.mkdir(exist_ok=True)
    entries = []
    for frame in motion.frames:
        name = f"{folder.name}/{frame.step:06d}.vtu"
        arrays = (frame.displacements, frame.tensions, motion.subdomain, motion.node_class, frame.velocities)
        write_vtu(path.parent / name, motion.scene, *arrays)
        entries.append(f'    <DataSet timestep="{frame.time!r}" part="0" file="{name}"/>\n')
    with atomic(path) as temporary:
        pathlib.Path(temporary).write_text(
            '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">\n'
            f"  <Collection>\n{''.join(entries)}  </Collection>\n</VTKFile>\n"
        )
