"""Structures in motion: a tensegrity grid and a tower that a falling mass hits, and a chain that bounces."""

from __future__ import annotations

import numpy as np

from .scene import Law, Scene
from .tensegrity_grid import EA_BAR, EA_CABLE, self_stress, tensegrity_grid

DENSITY = 7850.0  # of steel (kg/m3)
E_BAR, E_CABLE = 2.1e11, 1.6e11  # Young's moduli of steel bars and ropes (Pa): with EA they give the sections
GRAVITY = 9.81  # m/s2
ELASTIC_CONTACT = 1.0e7  # stiffness of an elastic contact (N/m)


def impact_grid(
    modules: int = 48,
    subdomains: int | None = None,
    partition: str | None = None,
    mass: float = 200.0,
    speed: float = 5.0,
    contact: str = "rigid",
) -> Scene:
    """Tensegrity grid in its self-stress, hit in the middle by a falling mass.

    The grid of the article without load; the masses of its nodes are those of half the links there, of steel.

    Parameters
    ----------
    modules : int
        Modules along a side of the grid.
    subdomains : int, optional
        Number of subdomains; by default blocks of 4 x 4 modules.
    partition : {'regular', 'metis'}, optional
        Equal blocks (default if they fit), or METIS: the solver then makes the partition.
    mass : float
        Falling mass (kg).
    speed : float
        Initial speed of the mass (m/s), just above an upper node.
    contact : {'rigid', 'elastic'}
        Contact with the mass. Rigid: an inelastic shock; elastic: a contact of 1e7 N/m.

    Returns
    -------
    Scene
    """
    grid = tensegrity_grid(modules, subdomains, partition, load=0.0)
    upper = np.flatnonzero(grid.nodes[:, 2] > 0.0)
    middle = np.append(grid.nodes[:, :2].max(axis=0) / 2, grid.nodes[:, 2].max())
    target = upper[np.argmin(np.linalg.norm(grid.nodes[upper] - middle, axis=1))]
    chosen = {key: grid.metadata[key] for key in ("modules", "partition", "subdomains")}
    return _hit("impact-grid", grid, [target], mass, speed, contact, chosen)


def impact_tower(
    levels: int = 24, subdomains: int | None = None, mass: float = 200.0, speed: float = 5.0, contact: str = "rigid"
) -> Scene:
    """Tensegrity tower of twisted triangular prisms, hit on its top by a falling mass.

    Each level has three bars that do not touch, and twelve cables; its self-stress stretches all of them. The lowest
    triangle is clamped. The cables between two levels are those of both.

    Parameters
    ----------
    levels : int
        Levels of 1.5 m.
    subdomains : int, optional
        Number of subdomains; by default one for four levels.
    mass : float
        Falling mass (kg); it meets the three nodes at the top.
    speed : float
        Initial speed of the mass (m/s).
    contact : {'rigid', 'elastic'}
        Contact with the mass. Rigid: an inelastic shock; elastic: contacts of 1e7 N/m.

    Returns
    -------
    Scene
    """
    if levels < 1:
        raise ValueError(f"levels must be at least 1, not {levels}")
    subdomains = max(levels // 4, 1) if subdomains is None else subdomains
    if not 1 <= subdomains <= levels:
        raise ValueError(f"subdomains must be from 1 to the number of levels, not {subdomains}")
    height, twist = 1.5, np.radians(45.0)
    level, corner = np.divmod(np.arange(3 * (levels + 1)), 3)
    angle = 2.0 * np.pi / 3.0 * corner + twist * level
    nodes = np.column_stack([np.cos(angle), np.sin(angle), height * level])
    turn = [(i, (i + 1) % 3) for i in range(3)]
    prism = turn + [(3 + a, 3 + b) for a, b in turn]  # both triangles, then cables and bars from one to the other
    prism += [(i, 3 + i) for i in range(3)] + [(i, 3 + (i + 2) % 3) for i in range(3)]
    prism += [(i, 3 + (i + 1) % 3) for i in range(3)]
    links = (3 * np.arange(levels)[:, None, None] + np.array(prism)).reshape(-1, 2)
    kinds = np.repeat([0, 1, 2, 3, 4], 3)
    law = np.tile(np.where(kinds == 4, Law.BAR, Law.CABLE), levels)
    tension = self_stress(nodes[:6], np.array(prism), kinds)
    length = np.linalg.norm(nodes[links[:, 1]] - nodes[links[:, 0]], axis=1)
    stiffness = np.where(law == Law.BAR, EA_BAR, EA_CABLE) / length
    tower = Scene(
        name="tower",
        nodes=nodes,
        links=links,
        law=law,
        stiffness=stiffness,
        initial_elongation=np.tile(tension, levels) / stiffness,
        fixed=np.repeat((level == 0)[:, None], 3, axis=1),
        subdomain=np.repeat(np.arange(levels) * subdomains // levels, len(prism)),
    )
    chosen = {"levels": int(levels), "subdomains": int(subdomains)}
    return _hit("impact-tower", tower, np.arange(3 * levels, 3 * levels + 3), mass, speed, contact, chosen)


def bouncing_chain(links: int = 20, drop: float = 0.5, subdomains: int | None = None) -> Scene:
    """Chain of masses on elastic bars, upright, that falls on a rigid table and bounces.

    Parameters
    ----------
    links : int
        Number of bars.
    drop : float
        Height of fall (m).
    subdomains : int, optional
        Number of subdomains; by default one for five bars.

    Returns
    -------
    Scene
    """
    subdomains = max(links // 5, 1) if subdomains is None else subdomains
    if links < 1 or not 1 <= subdomains <= links:
        raise ValueError("there must be at least one link, and a link for each subdomain")
    if drop <= 0.0:
        raise ValueError(f"drop must be positive, not {drop}")
    piece, ea, mass = 0.1, 1.0e5, 1.0
    z = np.append(0.0, drop + piece * np.arange(links + 1))
    chain = np.column_stack([np.arange(1, links + 1), np.arange(2, links + 2)])
    fixed = np.zeros((links + 2, 2), bool)
    fixed[0] = True
    masses = np.append(0.0, np.full(links + 1, mass))
    return Scene(
        name="bouncing-chain",
        nodes=np.column_stack([np.zeros(links + 2), z]),
        links=np.vstack([[[0, 1]], chain]),
        law=np.append(Law.CONTACT, np.full(links, Law.BAR)),
        stiffness=np.append(0.0, np.full(links, ea / piece)),
        initial_elongation=np.append(drop, np.zeros(links)),
        fixed=fixed,
        load=np.column_stack([np.zeros(links + 2), -GRAVITY * masses]),
        subdomain=np.append(0, np.arange(links) * subdomains // links),
        mass=masses,
        time_step=1e-3,
        metadata={"links": int(links), "drop": float(drop), "subdomains": int(subdomains)},
    )


def _hit(name, scene, targets, mass, speed, contact, chosen):
    """Add the masses of the links, and a mass above some nodes that falls on them."""
    if contact not in ("rigid", "elastic"):
        raise ValueError(f"contact must be 'rigid' or 'elastic', not {contact!r}")
    if not (mass > 0.0 and speed > 0.0):
        raise ValueError(f"mass and speed must be positive, not {mass} and {speed}")
    section = np.where(scene.law == Law.BAR, EA_BAR / E_BAR, EA_CABLE / E_CABLE)
    masses = np.bincount(scene.links.ravel(), np.repeat(DENSITY * section * scene.lengths / 2.0, 2))
    masses = np.round(masses, 9)  # equal modules have equal masses, whatever the order of the sums
    gap, count, ball = 0.01, len(targets), len(scene.nodes)
    place = scene.nodes[targets].mean(axis=0) + [0.0, 0.0, gap]
    still = np.zeros((ball, 3))
    up = np.zeros((len(scene.links) + count, 3))
    up[-count:, 2] = 1.0
    parts = scene.subdomain
    if parts is not None:
        parts = np.append(parts, np.full(count, parts[np.isin(scene.links, targets).any(axis=1)][-1]))
    elastic = contact == "elastic"
    return Scene(
        name=name,
        nodes=np.vstack([scene.nodes, place]),
        links=np.vstack([scene.links, np.column_stack([targets, np.full(count, ball)])]),
        law=np.append(scene.law, np.full(count, Law.COMPRESSION_ONLY if elastic else Law.CONTACT)),
        stiffness=np.append(scene.stiffness, np.full(count, ELASTIC_CONTACT if elastic else 0.0)),
        initial_elongation=np.append(scene.initial_elongation, np.full(count, gap)),
        fixed=np.vstack([scene.fixed, [False] * 3]),
        subdomain=parts,
        direction=up,
        mass=np.append(masses, mass),
        velocity=np.vstack([still, [0.0, 0.0, -speed]]),
        time_step=2e-4,
        metadata=chosen | {"mass": float(mass), "speed": float(speed), "contact": contact},
    )
