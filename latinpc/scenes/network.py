"""A random tensegrity-like network in 3D, whose partition is irregular."""

from __future__ import annotations

import numpy as np

from .scene import Law, Scene

SPACING = 1.0  # mean distance between neighbours (m)
EA_BAR = 6.5e7  # axial stiffness of bars (N), times a random factor between 1/2 and 2
EA_CABLE = 1.0e7  # axial stiffness of cables (N), likewise
MAX_CABLE_TENSION = 1000.0  # self-stress of the most tensioned cable (N)
JITTER = 0.3  # displacement of the points from a cubic lattice, in spacings
CABLE_SHARE = 0.7  # share of the links that the random self-stress tries to put in tension
TAUT = 0.05  # links above this share of the greatest tension become cables


def network(
    nodes: int = 400,
    neighbours: int = 8,
    seed: int = 0,
    supports: int = 1,
    slack: float = 0.09,
    load: float | None = None,
    subdomains: int | None = None,
) -> Scene:
    """Jittered points, each joined to its nearest neighbours by bars and prestressed cables.

    A random self-stress in the kernel of B^t decides the laws: what it puts in tension is a cable,
    the rest are bars. So the self-stress is balanced exactly, and every cable is taut before loading.
    The lowest layer of nodes is clamped. With all links present there is no global mechanism.

    Parameters
    ----------
    nodes : int
        Approximate number of nodes. The generator makes a box of the nearest size.
    neighbours : int
        Links from each node to its nearest neighbours, at least 6.
    seed : int
        Seed of the random numbers.
    supports : {1, 2}
        Clamped layers, 1 for the lowest, 2 for the lowest and the highest.
    slack : float
        Share of slack cables, 0 to 0.3. It sets the load from the tensions of the linear structure, and is met within
        a few per cent of the cables.
    load : float, optional
        Force on each free node (N). Downwards with a random part; overrides `slack`.
    subdomains : int, optional
        Number of subdomains. METIS makes them, in the solver.

    Returns
    -------
    Scene
    """
    if nodes < 24 or neighbours < 6:
        raise ValueError(f"a network needs at least 24 nodes and 6 neighbours, not {nodes} and {neighbours}")
    if supports not in (1, 2):
        raise ValueError(f"supports must be 1 (lowest layer) or 2 (lowest and highest), not {supports}")
    if not 0.0 <= slack <= 0.3:
        raise ValueError(f"slack must lie between 0 and 0.3, not {slack}: give load, the force per node")
    rng = np.random.default_rng(seed)
    x, layer = _points(nodes, rng)
    links = _nearest(x, neighbours)
    clamped = (layer == 0) | ((layer == layer.max()) & (supports == 2))
    fixed = np.repeat(clamped[:, None], 3, axis=1)
    links = links[~(clamped[links[:, 0]] & clamped[links[:, 1]])]  # links between supports would do nothing
    direction = x[links[:, 1]] - x[links[:, 0]]
    length = np.linalg.norm(direction, axis=1)
    balance = Balance(direction / length[:, None], links, fixed)

    wanted = np.where(rng.random(len(links)) < CABLE_SHARE, 1.0, -2.0)
    tension = balance.self_stress(wanted)
    is_cable = tension > TAUT * tension.max()
    tension *= MAX_CABLE_TENSION / tension.max()
    stiffness = np.where(is_cable, EA_CABLE, EA_BAR) * 2.0 ** rng.uniform(-1.0, 1.0, len(links)) / length

    force = rng.normal(scale=0.3, size=x.shape) - [0.0, 0.0, 1.0]
    force = np.where(fixed, 0.0, force / np.linalg.norm(force, axis=1)[:, None])
    if load is None:
        load = balance.load_for_slack(force, stiffness, tension, is_cable, slack)
    return Scene(
        name="network",
        nodes=x,
        links=links,
        law=np.where(is_cable, Law.CABLE, Law.BAR),
        stiffness=stiffness,
        initial_elongation=tension / stiffness,
        fixed=fixed,
        load=load * force,
        metadata={
            "seed": int(seed),
            "neighbours": int(neighbours),
            "supports": int(supports),
            "partition": "metis",
            "subdomains": subdomains,
            "slack_target": float(slack),
            "load_per_node": float(load),
        },
    )


class Balance:
    """B and B^t of a structure as index sums, and what is solved with them by conjugate gradients."""

    def __init__(self, direction, links, fixed):
        self.along = np.ascontiguousarray(direction.T)  # one row a component: numpy is twice as fast as by columns
        self.start, self.end = np.ascontiguousarray(links.T)
        self.free = ~fixed

    def elongations(self, u):
        """e = B U."""
        return sum(along * (values[self.end] - values[self.start]) for along, values in zip(self.along, u.T))

    def forces(self, tension):
        """F = B^t tau on the free dofs, zero elsewhere."""
        n = len(self.free)
        rows = [
            np.bincount(self.end, tension * along, n) - np.bincount(self.start, tension * along, n)
            for along in self.along
        ]
        return np.where(self.free, np.array(rows).T, 0.0)

    def displacements(self, force, stiffness, rtol=1e-8, max_it=20000):
        """Solve B^t k B U = F; preconditioned by the diagonal."""
        n, square = len(self.free), stiffness * self.along**2
        diagonal = np.array([np.bincount(self.start, s, n) + np.bincount(self.end, s, n) for s in square]).T
        inverse = np.where(self.free & (diagonal > 0.0), 1.0 / np.where(diagonal > 0.0, diagonal, 1.0), 0.0)
        u, r = np.zeros_like(force, order="F"), force.copy(order="F")
        p = z = inverse * r
        rho = start = np.sum(r * z)
        for _ in range(max_it):
            if rho <= rtol**2 * start:
                break
            q = self.forces(stiffness * self.elongations(p))
            step = rho / np.sum(p * q)
            u, r = u + step * p, r - step * q
            z = inverse * r
            rho, old = np.sum(r * z), rho
            p = z + rho / old * p
        return u

    def self_stress(self, wanted):
        """Project tensions on the kernel of B^t; the second pass removes what the first has left."""
        ones = np.ones(len(wanted))
        for _ in range(2):
            wanted = wanted - self.elongations(self.displacements(self.forces(wanted), ones))
        return wanted

    def load_for_slack(self, force, stiffness, tension, is_cable, slack):
        """Return the factor of `force` at which that share of the cables would slacken in the linear structure."""
        change = stiffness * self.elongations(self.displacements(force, stiffness))
        slackening = np.where(change < 0.0, tension / np.where(change < 0.0, -change, 1.0), np.inf)[is_cable]
        found = np.quantile(slackening, slack, method="lower")
        if not np.isfinite(found):
            raise ValueError(f"this load never slackens {100 * slack:g} % of the cables: give load, the force per node")
        return float(found)


def _points(count, rng):
    """Jittered cubic lattice in a box about twice as long as it is high; also the layer of each point."""
    side = (count / 4.0) ** (1.0 / 3.0)  # a box of 2 x 2 x 1 sides
    nz = max(2, round(side))
    ny = max(3, round((count / nz) ** 0.5))
    nx = max(3, round(count / (ny * nz)))
    z, y, x = (axis.ravel() for axis in np.meshgrid(*map(np.arange, (nz, ny, nx)), indexing="ij"))
    points = np.column_stack([x, y, z]) + rng.uniform(-JITTER, JITTER, (len(x), 3))
    return points * SPACING, z


def _nearest(x, neighbours):
    """Pairs of nodes of which one is among the nearest neighbours of the other; cells keep it linear in n."""
    cell = np.floor(x / (1.5 * SPACING)).astype(np.int64)
    cell -= cell.min(axis=0)
    shape = cell.max(axis=0) + 3  # a border of empty cells, so that no neighbour cell wraps round
    key = np.ravel_multi_index((cell + 1).T, shape)
    order = np.argsort(key, kind="stable")
    first = np.searchsorted(key[order], np.arange(np.prod(shape) + 1))
    room = int(np.diff(first).max())
    steps = np.array([np.ravel_multi_index(s, shape) for s in np.ndindex(3, 3, 3)])
    steps -= steps[13]  # the middle of the 27
    at = first[key[:, None] + steps][:, :, None] + np.arange(room)
    found = at < first[key[:, None] + steps + 1][:, :, None]
    candidates = np.where(found, order[np.minimum(at, len(x) - 1)], -1).reshape(len(x), -1)
    distance = np.sum((x[candidates] - x[:, None]) ** 2, axis=2)
    distance[(candidates < 0) | (candidates == np.arange(len(x))[:, None])] = np.inf
    near = np.argsort(distance, axis=1, kind="stable")[:, :neighbours]
    rows = np.arange(len(x))[:, None]
    real = np.isfinite(distance[rows, near])
    pairs = np.column_stack([np.broadcast_to(rows, near.shape)[real], candidates[rows, near][real]])
    return np.unique(np.sort(pairs, axis=1), axis=0)
