"""Random structures for tests of properties: drawn by hypothesis, or from a number."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import oracle
from hypothesis import strategies as st

from latinpc.scenes import Law, Scene

LAWS = (Law.BAR, Law.CABLE, Law.COMPRESSION_ONLY)
OPTIONS = {
    "variant": ("corner", "macro", "none", "published"),
    "direction": ("schur", "scalar", "diagonal", "block"),
    "modes": ("affine", "rigid"),
    "outer_snes_type": ("anderson", "ngmres", "nrichardson"),
}


@dataclass(frozen=True)
class Draw:
    """What makes a structure: sizes that shrink to the simplest, and a number for what has no size."""

    dim: int = 2
    nodes: int = 4  #: beside the `dim` that are held
    extra: int = 3  #: links beyond those that fix every node
    parts: int = 2  #: subdomains
    cut: str = "blocks"  #: how links are shared out: by place, or at random
    slack: float = 0.3  #: share of cables and compression-only links among the extra links
    skeleton: bool = True  #: every node is fixed by bars
    settled: bool = False  #: supports move
    prestressed: bool = False
    rails: bool = False  #: some components of some more nodes are held
    length: int = 0  #: powers of ten of the units
    force: int = 0
    seed: int = 0

    def scene(self):
        """Make the structure: each node joined to `dim` of those before it, and links between any two."""
        rng = np.random.default_rng(self.seed)
        dim, held = self.dim, self.dim
        n = held + self.nodes
        nodes = _spread(rng, n, dim)
        links = [(int(a), i) for i in range(held, n) for a in rng.choice(i, dim, replace=False)]
        laws = [Law.BAR if self.skeleton else rng.choice(LAWS)] * len(links)
        for _ in range(self.extra):
            links.append(tuple(rng.choice(n, 2, replace=False)))
            laws.append(rng.choice(LAWS[1:]) if rng.random() < self.slack else Law.BAR)
        links, laws = np.array(links), np.array(laws)
        fixed = np.zeros((n, dim), bool)
        fixed[:held] = True
        if self.rails:
            fixed |= rng.random((n, dim)) < 0.1
        size = np.linalg.norm(nodes[links[:, 1]] - nodes[links[:, 0]], axis=1)
        scene = Scene(
            name="random",
            nodes=nodes,
            links=links,
            law=laws,
            stiffness=10.0 ** rng.uniform(-1, 1, len(links)) / size,
            initial_elongation=rng.normal(0, 0.02, len(links)) * size if self.prestressed else None,
            fixed=fixed,
            prescribed=np.where(fixed, rng.normal(0, 0.01, (n, dim)), 0.0) if self.settled else None,
            load=np.where(fixed, 0.0, rng.normal(0, 0.05, (n, dim))),
            subdomain=self._partition(rng, nodes[links].mean(axis=1)),
        )
        return in_units(scene, 10.0**self.length, 10.0**self.force)

    def _partition(self, rng, middle):
        parts = min(self.parts, len(middle))
        if self.cut == "random":
            part = rng.integers(parts, size=len(middle))
        else:
            seeds = middle[rng.choice(len(middle), parts, replace=False)]
            part = np.linalg.norm(middle[:, None] - seeds, axis=2).argmin(axis=1)
        return np.unique(part, return_inverse=True)[1]


def _spread(rng, n, dim):
    """Points that are not too close to each other: on a grid that is shaken."""
    side = int(np.ceil(n ** (1 / dim)))
    grid = np.stack(np.meshgrid(*[np.arange(side)] * dim, indexing="ij"), axis=-1).reshape(-1, dim)
    return rng.permutation(grid)[:n] + rng.uniform(-0.3, 0.3, (n, dim))


def draws(**given):
    """Strategy for `Draw`; what is given is not drawn."""
    parts = {
        "dim": st.integers(1, 3),
        "nodes": st.integers(1, 12),
        "extra": st.integers(0, 20),
        "parts": st.integers(1, 6),
        "cut": st.sampled_from(["blocks", "random"]),
        "slack": st.sampled_from([0.0, 0.3, 1.0]),
        "settled": st.booleans(),
        "prestressed": st.booleans(),
        "rails": st.booleans(),
        "length": st.integers(-3, 3),
        "force": st.integers(-3, 3),
        "seed": st.integers(0, 2**32 - 1),
    }
    return st.builds(Draw, **(parts | {key: st.just(value) for key, value in given.items()}))


def options():
    """Strategy for options of SNES latin."""
    return st.fixed_dictionaries({key: st.sampled_from(values) for key, values in OPTIONS.items()})


# ---- what must not matter --------------------------------------------------------------------
def in_units(scene, length, force):
    """Measure lengths and forces in other units."""
    lengths = {name: getattr(scene, name) * length for name in ("nodes", "initial_elongation", "prescribed")}
    return replace(scene, **lengths, stiffness=scene.stiffness * force / length, load=scene.load * force)


def renumbered(scene, rng):
    """Number nodes, links and subdomains in another order, and turn some links round; and the way back."""
    to = rng.permutation(len(scene.nodes))  # new number of each node
    order, links = np.argsort(to), rng.permutation(len(scene.links))
    ends = to[scene.links][links]
    ends = np.where(rng.random(len(ends))[:, None] < 0.5, ends, ends[:, ::-1])
    data = {name: getattr(scene, name)[order] for name in ("nodes", "fixed", "prescribed", "load")}
    data |= {name: getattr(scene, name)[links] for name in ("law", "stiffness", "initial_elongation")}
    part = rng.permutation(scene.n_subdomains)[scene.subdomain][links]
    return replace(scene, links=ends, subdomain=part, **data), lambda u: u[to]


# ---- the truth -------------------------------------------------------------------------------
def held(scene):
    """Does the structure resist all loads without its cables and compression-only links? Returns a condition number."""
    b, _ = oracle.kinematics(scene)
    free = np.flatnonzero(~scene.fixed.ravel())
    if not len(free):
        return 1.0
    bars = b.toarray()[:, free][scene.law == Law.BAR]
    matrix = bars.T @ (scene.stiffness[scene.law == Law.BAR, None] * bars)
    values = np.linalg.eigvalsh(matrix)
    return values[-1] / values[0] if values[0] > 0.0 else np.inf
