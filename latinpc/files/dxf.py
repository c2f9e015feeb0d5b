"""Read the lines of DXF drawings, with ezdxf (the extra ``import``).

Lines, polylines, and the edges of 3D faces and meshes are links, in blocks as well; layers are groups. A point puts
the node there into the group of its layer. Other entities, and those of layers that are off or frozen, are left out.
Lengths are in the unit that the drawing names, in m where it names none.
"""

from __future__ import annotations

from collections import Counter

import numpy as np

from .lines import Lines
from .text import wrong

DEEPEST = 16  # blocks inside blocks
FORMAT = "a DXF drawing with LINE, LWPOLYLINE, POLYLINE, 3DFACE or MESH entities in the model space"


def read_dxf(path):
    """Read a DXF file; return `Lines`. Raises ValueError with the line or the entity of the file."""
    try:
        import ezdxf
    except ImportError:
        raise ValueError(f"{path}: DXF files need ezdxf: pip install ezdxf") from None
    try:
        document = ezdxf.readfile(path)
        shown = {layer.dxf.name.lower(): not (layer.is_off() or layer.is_frozen()) for layer in document.layers}
        reader = _Reader(path, shown)
        for entity in document.modelspace():
            reader.take(entity, entity.dxf.layer)
        unit = document.units
        scale = ezdxf.units.conversion_factor(unit, ezdxf.units.M) if unit else None
    except (ValueError, MemoryError) as error:
        raise ValueError(_said(path, error)) from None
    except Exception as error:  # ezdxf raises whatever its parser trips over
        wrong(path, None, f"not readable as DXF ({str(error) or type(error).__name__})", FORMAT)
    lines = reader.lines()
    lines.unit = scale
    return lines


def _said(path, error):
    """Return the text of an error, with the name of the file."""
    return str(error) if str(path) in str(error) else f"{path}: not readable as DXF ({error}); expected {FORMAT}"


class _Reader:
    """What has been found so far in the drawing."""

    def __init__(self, path, shown):
        self.path, self.shown = path, shown
        self.points, self.ends, self.groups, self.node_groups = [], [], {}, {}
        self.left_out, self.hidden, self.arcs = Counter(), 0, 0

    def take(self, entity, layer, depth=0):
        """Read an entity on a layer, or what is in a block."""
        kind = entity.dxftype()
        if not self.shown.get(layer.lower(), True):
            self.hidden += 1
        elif kind == "LINE":
            self._polyline(entity, layer, [entity.dxf.start, entity.dxf.end])
        elif kind == "LWPOLYLINE":
            self.arcs += sum(abs(point[4]) > 0.0 for point in entity)
            self._polyline(entity, layer, list(entity.vertices_in_wcs()), entity.closed)
        elif kind == "POLYLINE" and not (entity.is_poly_face_mesh or entity.is_polygon_mesh):
            self.arcs += sum(abs(vertex.dxf.bulge) > 0.0 for vertex in entity.vertices)
            self._polyline(entity, layer, list(entity.points_in_wcs()), entity.is_closed)
        elif kind == "3DFACE":
            self._polyline(entity, layer, list(entity.wcs_vertices()), True)
        elif kind == "MESH":
            for face in entity.faces:
                self._polyline(entity, layer, [entity.vertices[corner] for corner in face], True)
        elif kind == "POINT":
            self.node_groups.setdefault(layer, []).append(self._point(entity, entity.dxf.location))
        elif kind in ("INSERT", "POLYLINE") and depth < DEEPEST:
            for part in entity.virtual_entities():
                self.take(part, layer if part.dxf.layer == "0" else part.dxf.layer, depth + 1)
        else:
            self.left_out[kind] += 1

    def _point(self, entity, point):
        place = [float(x) for x in point]
        if not np.isfinite(place).all():
            wrong(self.path, self._row(entity), f"{entity.dxftype()} at {place}", "finite coordinates")
        self.points.append([*place, 0.0][:3])
        return len(self.points) - 1

    def _polyline(self, entity, layer, points, closed=False):
        numbers = [self._point(entity, point) for point in points]
        for pair in zip(numbers, numbers[1:] + (numbers[:1] if closed and len(numbers) > 2 else [])):
            self.groups.setdefault(layer, []).append(len(self.ends))
            self.ends.append(pair)

    def _row(self, entity):
        """Return the line of the file that an entity begins on, by its handle; None where that is not known."""
        handle = entity.dxf.handle
        with open(self.path, errors="replace") as file:
            lines = [line.strip() for line in file]
        rows = [row for row in range(1, len(lines)) if lines[row] == handle and lines[row - 1] == "5"]
        return rows[0] - 1 if rows and handle else None

    def lines(self):
        """Return what has been read."""
        if not self.ends:
            found = ", ".join(f"{count} {kind}" for kind, count in sorted(self.left_out.items())) or "no entity"
            hidden = f", and {self.hidden} on layers that are off or frozen" if self.hidden else ""
            wrong(self.path, None, f"holds no line ({found}{hidden})", FORMAT)
        notes = [f"left out: {', '.join(f'{n:,} {kind}' for kind, n in sorted(self.left_out.items()))}"]
        notes = notes if self.left_out else []
        notes += [f"{self.hidden:,} entities of layers that are off or frozen left out"] if self.hidden else []
        notes += [f"{self.arcs:,} arcs of polylines taken as straight"] if self.arcs else []
        return Lines(
            self.path, self.points, self.ends,
            {name: np.array(chosen) for name, chosen in self.groups.items()},
            {name: np.array(chosen) for name, chosen in self.node_groups.items()},
            drawing=True, notes=notes, point_names=np.full(len(self.points), ""),
        )  # fmt: skip
