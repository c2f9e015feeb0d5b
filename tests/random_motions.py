"""Random structures in motion, rigid links and friction among them, and what every step of them must meet."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from hypothesis import strategies as st
from random_structures import Draw, draws

from latinpc.scenes import Law

CLOSED = 1e-4  # of the flight of a step: LATIN_STEP_CLOSED, gaps that are none
NOTHING = 1e-10  # of the forces that displacements without strains would make, where all others have died away


@dataclass(frozen=True)
class Throw:
    """How a structure is set in motion; `draw` makes the structure."""

    draw: Draw
    held: bool = True  #: else it flies
    rigid: int = 0  #: inextensible cables and contacts between any two nodes
    rubs: int = 0  #: contacts with friction
    massless: bool = False  #: some nodes have no mass
    speed: int = 0  #: power of ten, beside the initial elongations
    step: int = 0  #: power of ten, beside the slowest of the periods that a spring and a mass make
    seed: int = 0

    def scene(self):
        """Make the structure, with masses and velocities; its `time_step` is the step to make."""
        rng = np.random.default_rng(self.seed)
        scene, dim = self.draw.scene(), self.draw.dim
        length, force = 10.0**self.draw.length, 10.0**self.draw.force
        if not self.held:
            free = np.zeros_like(scene.fixed)
            scene = replace(scene, fixed=free, prescribed=np.zeros(free.shape))
        n = len(scene.nodes)
        mass = 10.0 ** rng.uniform(-1, 1, n)
        if self.massless:
            mass *= rng.random(n) < 0.7
            mass[0] = 1.0
        velocity = rng.normal(0, 0.05 * 10.0**self.speed, (n, dim)) * length
        scene = replace(
            scene, mass=mass * force / length, velocity=np.where(scene.fixed, 0.0, velocity), time_step=10.0**self.step
        )
        for _ in range(self.rigid):
            law = rng.choice([Law.INEXTENSIBLE, Law.CONTACT])
            scene = with_links(scene, rng, [law], rng.normal(0, 0.02) * length * (rng.random() < 0.7))
        for _ in range(self.rubs):
            gap = abs(rng.normal(0, 0.02)) * length * (rng.random() < 0.5)
            scene = with_links(scene, rng, [Law.FRICTION] + [Law.TANGENT] * (dim - 1), gap, rng.uniform(0, 1))
        return scene


def with_links(scene, rng, laws, e0, mu=0.0):
    """Join two nodes by a rigid link, or by the parts of a contact in a frame of its own."""
    m, dim, parts = len(scene.links), scene.dim, len(laws)
    ends = np.tile(rng.choice(len(scene.nodes), 2, replace=False), (parts, 1))
    frame = np.zeros((parts, dim))
    if laws[0] == Law.FRICTION:
        normal = scene.nodes[ends[0, 1]] - scene.nodes[ends[0, 0]]
        frame = np.linalg.qr(np.column_stack([normal, rng.normal(size=(dim, dim - 1))]))[0].T
        frame[0] *= np.sign(frame[0] @ normal)
    known = {"direction": np.zeros((m, dim)), "friction": np.zeros(m)}
    known |= {name: getattr(scene, name) for name in known if getattr(scene, name) is not None}
    return replace(
        scene,
        links=np.vstack([scene.links, ends]),
        law=np.append(scene.law, laws),
        stiffness=np.append(scene.stiffness, np.zeros(parts)),
        initial_elongation=np.append(scene.initial_elongation, [e0] + [0.0] * (parts - 1)),
        subdomain=np.append(scene.subdomain, [rng.integers(scene.n_subdomains)] * parts),
        direction=np.vstack([known["direction"], frame]),
        friction=np.append(known["friction"], [mu] * parts),
    )


def throws(**given):
    """Strategy for `Throw`; what is given is not drawn."""
    parts = {
        "draw": st.one_of(draws(), draws(skeleton=False)),
        "held": st.booleans(),
        "rigid": st.integers(1, 8),
        "rubs": st.integers(0, 4),
        "massless": st.just(False),
        "speed": st.integers(-2, 2),
        "step": st.integers(-2, 2),
        "seed": st.integers(0, 2**32 - 1),
    }
    given = {key: value if isinstance(value, st.SearchStrategy) else st.just(value) for key, value in given.items()}
    return st.builds(Throw, **(parts | given))


# ---- the truth -------------------------------------------------------------------------------
def as_statics(scene, h, u, v):
    """Make the static structure whose displacements are h v+: on springs M / h^2, with strains to start from."""
    n, dim = scene.nodes.shape
    heavy = np.flatnonzero(scene.mass)
    springs = dim * len(heavy)
    axes = np.tile(np.eye(dim), (len(heavy), 1))
    mass = np.repeat(scene.mass[heavy], dim)
    held = np.zeros(scene.nodes.shape)
    return replace(
        scene,
        nodes=np.vstack([scene.nodes, scene.nodes[:1]]),  # the ground
        links=np.vstack([scene.links, np.column_stack([np.full(springs, n), np.repeat(heavy, dim)])]),
        law=np.append(scene.law, np.full(springs, Law.BAR)),
        stiffness=np.append(scene.stiffness, mass / h**2),
        initial_elongation=np.append(scene.initial_elongation + kinematics(scene) @ u.ravel(), np.zeros(springs)),
        direction=np.vstack([scene.directions, axes]),
        fixed=np.vstack([scene.fixed, np.ones((1, dim), bool)]),
        prescribed=np.vstack([held, held[:1]]),
        load=np.vstack([np.where(scene.fixed, 0.0, scene.load + scene.mass[:, None] * v / h), held[:1]]),
        friction=None, subdomain=None, mass=None, velocity=None,
    )  # fmt: skip


# ---- what must hold --------------------------------------------------------------------------
def kinematics(scene):
    """Elongations of displacements as (n, dim) arrays, whatever the laws are: the matrix B of all dofs."""
    rows, b = np.arange(len(scene.links)), np.zeros((len(scene.links), *scene.nodes.shape))
    b[rows, scene.links[:, 1]] = scene.directions
    b[rows, scene.links[:, 0]] = -scene.directions
    return b.reshape(len(scene.links), -1)


def step_errors(scene, h, u, v, new_u, new_v, tension, accuracy=0.0):
    """Return by how much a step from (u, v) misses each condition, relative to the forces and displacements in it.

    Links and masses make unbalance of displacements that are wrong by `accuracy`, relative: so much is none.
    """
    b, free = kinematics(scene), ~scene.fixed.ravel()
    m = np.repeat(scene.mass, scene.dim)
    change = m * (new_v - v).ravel() / h
    w = h * np.where(scene.fixed, 0.0, new_v).ravel()
    inner, rate = b.T @ tension, b @ w
    force = max((abs(b).T @ abs(tension)).max(), abs(change[free]).max(initial=0.0), abs(scene.load).max(), 1e-300)
    force = max(force, NOTHING * (abs(b).T @ (scene.stiffness * (abs(b) @ abs(u.ravel())))).max())
    flown = _flown(scene, h, u, v)
    far = max(abs(flown).max(), abs(w).max(), 1e-300)
    x = b @ u.ravel() + scene.initial_elongation
    rows = abs(b).T @ (scene.stiffness * abs(b).sum(axis=1)) + m / h**2
    balance = np.maximum(abs(change + inner - scene.load.ravel()) - accuracy * np.linalg.norm(w) * rows, 0.0)[free]
    return {
        "balance": balance.max(initial=0.0) / force,
        "displacement": abs(new_u - u - h * np.where(scene.fixed, 0.0, new_v)).max() / max(abs(u).max(), far),
        **{name: value for name, value in _laws(scene, x, rate, tension, CLOSED * abs(flown).max(), force, far)},
    }


def _flown(scene, h, u, v):
    """How far components move in a step under the elastic forces at its start, without rigid links."""
    b, m = kinematics(scene), np.repeat(scene.mass, scene.dim)
    x = b @ u.ravel() + scene.initial_elongation
    taut = (
        (scene.law == Law.BAR)
        | ((scene.law == Law.CABLE) & (x >= 0))
        | ((scene.law == Law.COMPRESSION_ONLY) & (x <= 0))
    )
    stiffness = np.where(taut, scene.stiffness, 0.0)
    left = scene.load.ravel() - b.T @ (stiffness * x)
    flown = h * v.ravel() + h * h * left / np.where(m > 0, m, 1.0)
    return np.where(~scene.fixed.ravel() & (m > 0), flown, 0.0)


def _laws(scene, x, rate, tension, closed, force, far):
    """How far tensions are from what the laws say of the strains x before, and their changes in the step."""
    soft = np.isin(scene.law, (Law.BAR, Law.CABLE, Law.COMPRESSION_ONLY))
    if soft.any():
        stretched = scene.stiffness * (x + rate)
        known = np.where(scene.law == Law.CABLE, np.maximum(stretched, 0.0), stretched)
        known = np.where(scene.law == Law.COMPRESSION_ONLY, np.minimum(stretched, 0.0), known)
        yield "elastic laws", abs(known - tension)[soft].max() / max(abs(stretched)[soft].max(), force)
    sign = np.where(scene.law == Law.INEXTENSIBLE, 1.0, -1.0)
    normal = np.flatnonzero(np.isin(scene.law, (Law.INEXTENSIBLE, Law.CONTACT, Law.FRICTION)))
    for i in normal:
        push, gap = sign[i] * tension[i] / force, -sign[i] * x[i]
        if abs(gap - closed) <= 1e-6 * (abs(x[i]) + closed) and push == 0.0:
            continue
        left = ((gap if gap > closed else 0.0) - sign[i] * rate[i]) / far
        yield f"gap {i}", max(-push, -left, min(abs(push), abs(left)))
        if scene.law[i] != Law.FRICTION:
            continue
        part = slice(i + 1, i + scene.dim)
        t, slip, most = tension[part] / force, rate[part] / far, scene.friction[i] * abs(push)
        size, moved = np.linalg.norm(t), np.linalg.norm(slip)
        yield f"cone {i}", max(size - most, 0.0)
        yield f"slip {i}", min(moved, max(most - size, np.linalg.norm(t - most * slip / moved) if moved else 0.0))


def momenta(scene, v):
    """Return momentum and moment of momentum."""
    p = scene.mass[:, None] * v
    x = scene.nodes - scene.nodes.mean(axis=0)
    turn = [(x[:, i] * p[:, j] - x[:, j] * p[:, i]).sum() for i in range(scene.dim) for j in range(i)]
    return np.append(p.sum(axis=0), turn)
