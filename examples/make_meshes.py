"""Write the example meshes `footbridge.msh`, `tower.msh` and `canopy.msh`, as Gmsh would.

Run: python examples/make_meshes.py [FOLDER]

Each is read together with the TOML file of the same stem:
    latinpc solve examples/footbridge.msh --picture footbridge.png
    latinpc solve examples/tower.msh --subdomains 4
    latinpc form examples/canopy.msh --density drawn --picture canopy.png

`footbridge` is a covered truss bridge in 3D, 48 m long: bars, and crossed cables in every panel, which are
tightened when it is built; under the crowd some of them slacken. `tower` is a plane frame braced by crossed
cables, pushed by the wind, one foot of which has settled. `canopy` is a flat drawing of a square net with cables along
its edges, hung from two high and two low corners: its form is to be found.
"""

import pathlib
import sys


class Mesh:
    """Points numbered by place, and lines and vertices in named groups (MSH 2.2, ASCII)."""

    def __init__(self):
        self.points, self.elements, self.groups = {}, [], {}

    def point(self, *place):
        place = tuple(float(value) for value in place) + (0.0,) * (3 - len(place))
        return self.points.setdefault(place, len(self.points) + 1)

    def add(self, group, *places):
        """Add a vertex (one place) or a line (two places) to a group."""
        kind = 15 if len(places) == 1 else 1
        tag = self.groups.setdefault((kind, group), len(self.groups) + 1)
        self.elements.append((kind, tag, [self.point(*place) for place in places]))

    def write(self, path):
        text = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(self.groups))]
        text += [f'{0 if kind == 15 else 1} {tag} "{name}"' for (kind, name), tag in self.groups.items()]
        text += ["$EndPhysicalNames", "$Nodes", str(len(self.points))]
        text += [f"{number} {x:g} {y:g} {z:g}" for (x, y, z), number in self.points.items()]
        text += ["$EndNodes", "$Elements", str(len(self.elements))]
        for number, (kind, tag, nodes) in enumerate(self.elements, start=1):
            text.append(f"{number} {kind} 2 {tag} {tag} " + " ".join(map(str, nodes)))
        text.append("$EndElements")
        pathlib.Path(path).write_text("\n".join(text) + "\n", encoding="ascii")


def footbridge(panels=24, length=2.0, width=2.4, height=2.6):
    """Return a box of bars whose sides, floor, roof and cross-sections are braced by crossed cables."""
    mesh = Mesh()

    def corner(i, side, level):
        return (i * length, side * width, level * height)

    def crossed(a, b, c, d):
        mesh.add("bracing", a, c)
        mesh.add("bracing", b, d)

    for i in range(panels + 1):
        ring = [corner(i, 0, 0), corner(i, 1, 0), corner(i, 1, 1), corner(i, 0, 1)]
        for k in range(4):
            mesh.add("frames", ring[k], ring[(k + 1) % 4])
        crossed(*ring)
        if i == panels:
            break
        following = [corner(i + 1, 0, 0), corner(i + 1, 1, 0), corner(i + 1, 1, 1), corner(i + 1, 0, 1)]
        for k in range(4):
            mesh.add("chords", ring[k], following[k])
            crossed(ring[k], ring[(k + 1) % 4], following[(k + 1) % 4], following[k])
    for side in (0, 1):
        mesh.add("pinned", corner(0, side, 0))
        mesh.add("rolling", corner(panels, side, 0))
        for i in range(1, panels):
            mesh.add("deck", corner(i, side, 0))
    return mesh


def tower(storeys=16, bays=2, height=3.0, width=4.0):
    """Return a plane frame with crossed cables in every panel."""
    mesh = Mesh()

    def node(i, j):
        return (i * width, j * height)

    for j in range(storeys):
        for i in range(bays + 1):
            mesh.add("columns", node(i, j), node(i, j + 1))
        for i in range(bays):
            mesh.add("beams", node(i, j + 1), node(i + 1, j + 1))
            mesh.add("bracing", node(i, j), node(i + 1, j + 1))
            mesh.add("bracing", node(i + 1, j), node(i, j + 1))
        mesh.add("windward", node(0, j + 1))
    for i in range(bays):
        mesh.add("feet", node(i, 0))
    mesh.add("settled", node(bays, 0))
    return mesh


def canopy(meshes=8, mesh_size=2.0, rise=5.0):
    """Return a flat square net, but for its corners, two of which are high."""
    mesh = Mesh()

    def node(i, j):
        high = i % meshes == 0 and j % meshes == 0 and i == j
        return (i * mesh_size, j * mesh_size, rise if high else 0.0)

    for i in range(meshes + 1):
        for j in range(meshes):
            group = "edges" if i % meshes == 0 else "net"
            mesh.add(group, node(i, j), node(i, j + 1))
            mesh.add(group, node(j, i), node(j + 1, i))
    for i in (0, meshes):
        for j in (0, meshes):
            mesh.add("corners", node(i, j))
    return mesh


if __name__ == "__main__":
    folder = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else __file__).resolve()
    folder = folder if folder.is_dir() else folder.parent
    footbridge().write(folder / "footbridge.msh")
    tower().write(folder / "tower.msh")
    canopy().write(folder / "canopy.msh")
