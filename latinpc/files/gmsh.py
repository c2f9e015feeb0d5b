"""Read structures from Gmsh files.

A structure comes as a pair of files with the same stem::

    bridge.msh     nodes and lines, sorted into physical groups
    bridge.toml    what each physical group is: laws, supports, loads

Every line of the mesh is one link. In the TOML file, SI units throughout::

    dim = 3                              # optional; a flat mesh is 2D, a mesh along x is 1D

    [laws.chords]                        # physical group of curves
    law = "bar"                          # bar | cable | compression_only | inextensible | contact | friction | table
    EA = 2.1e8                           # N, stiffness EA / length;  or: stiffness = 1e7 (N/m)
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

from __future__ import annotations

import contextlib
import pathlib
import resource

import meshio
import numpy as np

from latinpc.scenes.scene import Scene

from .description import AXES, read_description, read_loads, read_masses, read_supports, read_velocities
from .linklaws import read_laws

ROOM, ROOM_PER_BYTE = 2**28, 200  # bytes that a mesh may take, beside and for each of those of its file


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
    settings = read_description(path, description)
    points, lines, line_groups, node_groups = _read_mesh(path)
    dim = _dimension(settings, points[lines.ravel()], description, path)
    laws = read_laws(settings, points[:, :dim], lines, line_groups, description, path)
    lines = lines[laws.pop("line")]

    used, links = np.unique(lines.ravel(), return_inverse=True)
    number = np.full(len(points), -1)
    number[used] = np.arange(len(used))
    nodes = points[used, :dim]
    node_groups = {name: number[group] for name, group in node_groups.items()}
    node_groups = {name: group[group >= 0] for name, group in node_groups.items()}
    fixed, prescribed = read_supports(settings, nodes, node_groups, description)
    return Scene(
        name=str(settings.get("title", path.stem)),
        nodes=np.ascontiguousarray(nodes),
        links=links.reshape(-1, 2).astype(np.int64),
        **laws,
        fixed=fixed,
        prescribed=prescribed,
        load=read_loads(settings, nodes, node_groups, description),
        subdomain=None,
        mass=read_masses(settings, nodes, links.reshape(-1, 2), line_groups, node_groups, description),
        velocity=read_velocities(settings, nodes, node_groups, fixed, description),
        metadata={"file": path.name, "nodes_without_link": int(len(points) - len(used))},
    )


@contextlib.contextmanager
def _bounded(size):
    """Limit the growth of this process to so many bytes: meshio allocates whatever size a file announces."""
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
    """Return the space dimension: the key `dim`, or the last coordinate that varies."""
    extent = np.ptp(points, axis=0)
    varies = [axis for axis in range(3) if extent[axis] > 1e-12 * max(extent.max(), 1e-300)]
    found = max(varies, default=0) + 1
    dim = settings.get("dim", found)
    if isinstance(dim, bool) or not isinstance(dim, int) or dim not in (1, 2, 3):
        raise ValueError(f"{description}: dim = {dim!r}; it must be 1, 2 or 3")
    if dim < found:
        raise ValueError(f"{description}: dim = {dim}, but the coordinate {AXES[found - 1]} varies in {path.name}")
    return dim
