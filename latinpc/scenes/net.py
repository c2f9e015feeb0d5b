"""A fishing net hung at its rim: inextensible or elastic cables, with their geometric stiffness."""

from __future__ import annotations

import numpy as np

from latinpc.results.units import counted

from .scene import Law, Scene, blocks_or_metis

MESH = 1.0  # side of a mesh in plan (m)
DENSITY = 100.0  # force density: tension over length (N/m)
SAG = 0.1  # greatest sag under the weight alone, over the side
EA = 1.0e6  # of elastic cables (N)
BLOCK = 8  # meshes along a side of a subdomain, by default
LAWS = ("inextensible", "cable")


def net(
    side: int = 32,
    law: str = "inextensible",
    current: float = 1.0,
    catch: float = 4.0,
    subdomains: int | None = None,
    partition: str = "regular",
) -> Scene:
    """Square net of side x side meshes, held at its rim, with its weight, a catch, and a current.

    The shape is that of equilibrium under the weight, by force densities [H.-J. Schek 1974]: tension over length is
    the same in all cables. Each cable is a link along itself, inextensible (3) or elastic (4), and two bars across
    itself with the force density for a stiffness: that is how a taut cable resists to being turned, its geometric
    stiffness. Catch and current are more loads: meshes that they relieve go slack.

    Parameters
    ----------
    side : int
        Meshes along a side.
    law : {'inextensible', 'cable'}
        Law of the cables.
    current : float
        Force along x on each node, over the weight of a node.
    catch : float
        Downward force on each node of the catch, over the weight of a node. The catch is a square in the middle, a
        quarter of the side wide.
    subdomains : int, optional
        Number of subdomains. A square; by default blocks of 8 x 8 meshes.
    partition : {'regular', 'metis'}
        Equal blocks or METIS. With 'metis' the scene has no partition: the solver makes one.

    Returns
    -------
    Scene
    """
    if side < 2:
        raise ValueError(f"side must be at least 2 meshes, not {side}")
    if law not in LAWS:
        raise ValueError(f"law must be one of {', '.join(LAWS)}, not {law!r}")
    partition = blocks_or_metis(partition)
    nodes, cables, rim = _flat(side)
    weight = _hang(nodes, rim, side)
    along = nodes[cables[:, 1]] - nodes[cables[:, 0]]
    length = np.linalg.norm(along, axis=1)
    frames = _frames(along / length[:, None])
    tension = DENSITY * length
    elastic = law == "cable"
    stiffness = np.column_stack([EA / length if elastic else 0.0 * length, *[np.full(len(cables), DENSITY)] * 2])
    initial_elongation = np.zeros_like(stiffness)
    if elastic:
        initial_elongation[:, 0] = tension / stiffness[:, 0]
    load = _load(nodes, rim, side, weight, current, catch)
    parts = None
    if partition == "regular":
        count = max(1, side // BLOCK) if subdomains is None else round(max(subdomains, 0) ** 0.5)
        if subdomains is not None and (count < 1 or count**2 != subdomains):
            raise ValueError(f"{counted(subdomains, 'subdomain')} cannot be squares: choose k**2, or partition metis")
        place = np.minimum(nodes[cables, :2].min(axis=1) / MESH, side - 1)
        block = np.minimum((place * count / side).astype(int), count - 1)
        parts = np.repeat(block[:, 1] * count + block[:, 0], 3)
        subdomains = count**2
    return Scene(
        name="net",
        nodes=nodes,
        links=np.repeat(cables, 3, axis=0),
        law=np.tile([Law.CABLE if elastic else Law.INEXTENSIBLE, Law.BAR, Law.BAR], len(cables)),
        stiffness=stiffness.ravel(),
        initial_elongation=initial_elongation.ravel(),
        fixed=np.repeat(rim[:, None], 3, axis=1),
        load=load,
        subdomain=parts,
        direction=frames.reshape(-1, 3),
        metadata={
            "side": int(side),
            "law": law,
            "current": float(current),
            "catch": float(catch),
            "cables": len(cables),
            "weight_per_node": float(weight),
            "partition": partition,
            "subdomains": subdomains,
        },
    )


def _flat(side):
    """Nodes in the plane, the cables without those of the rim, and which nodes are on the rim."""
    y, x = (axis.ravel() for axis in np.meshgrid(np.arange(side + 1), np.arange(side + 1), indexing="ij"))
    number = np.arange(len(x)).reshape(side + 1, side + 1)
    across = np.stack([number[1:-1, :-1], number[1:-1, 1:]], axis=2).reshape(-1, 2)
    up = np.stack([number[:-1, 1:-1], number[1:, 1:-1]], axis=2).reshape(-1, 2)
    used, cables = np.unique(np.vstack([across, up]), return_inverse=True)  # the corners bear nothing
    rim = (x == 0) | (y == 0) | (x == side) | (y == side)
    nodes = np.column_stack([x, y, np.zeros_like(x)])[used] * MESH
    return nodes.astype(float), cables.reshape(-1, 2), rim[used]


def _hang(nodes, rim, side):
    """Give the nodes their height under the weight, and return the weight of a node that makes the wanted sag.

    The cables of one force density make the five-point Laplacian, which sines diagonalise.
    """
    inner = np.arange(1, side)
    sines = np.sqrt(2.0 / side) * np.sin(np.pi / side * np.outer(inner, inner))
    values = 2.0 - 2.0 * np.cos(np.pi / side * inner)
    right = np.full((side - 1, side - 1), -1.0 / DENSITY)
    height = sines @ ((sines @ right @ sines) / (values[:, None] + values)) @ sines
    weight = SAG * side * MESH / -height.min()
    nodes[~rim, 2] = weight * height.ravel()
    return weight


def _load(nodes, rim, side, weight, current, catch):
    """Return the forces on the nodes (N): weight, current along x, and the catch in the middle."""
    load = np.zeros_like(nodes)
    load[:, 2] = -weight
    load[:, 0] = current * weight
    middle = (np.abs(nodes[:, :2] - side * MESH / 2) <= side * MESH / 8).all(axis=1)
    load[middle, 2] -= catch * weight
    load[rim] = 0.0
    return load


def _frames(along):
    """Return for each cable its direction and two across it, (m, 3, 3)."""
    across = np.cross(along, [0.0, 0.0, 1.0])
    across /= np.linalg.norm(across, axis=1)[:, None]
    return np.stack([along, across, np.cross(along, across)], axis=1)
