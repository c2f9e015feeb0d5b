"""Read Gmsh files: each line of the mesh is a link, physical groups are groups of lines and of nodes."""

from __future__ import annotations

import contextlib
import resource

import numpy as np

from .gmshnodes import node_tags
from .lines import Lines

ROOM, ROOM_PER_BYTE = 2**28, 200  # bytes that a mesh may take, beside and for each of those of its file


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


def read_gmsh(path):
    """Read a Gmsh file, format 2.2, 4.0 or 4.1; return `Lines`. Raises ValueError."""
    import meshio  # takes as long to load as all else

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
    return Lines(
        path, points, np.concatenate(lines),
        {name: np.concatenate(parts) for name, parts in line_groups.items()},
        {name: np.unique(np.concatenate(parts)) for name, parts in node_groups.items()},
        point_names=node_tags(path, len(points)),
    )  # fmt: skip
