"""A structure that no one here made: the lines of a drawing, raised to a vault of two layers and braced by cables.

The drawing is `lines_bigger.obj` of compas (pip install compas==2.15.1, as `make bench` does): 23,040 lines of a floor
plan in one plane. Its copy one bay above is the upper layer. Posts join the layers, and in every bay two crossed cables
brace what is between them. The self-stress of the cables is as of the scene `network`, and so is the load.
"""

from importlib.resources import files

import numpy as np

from latinpc.scenes import Scene
from latinpc.scenes.network import EA_BAR, EA_CABLE, MAX_CABLE_TENSION, Balance
from latinpc.scenes.scene import Law

RISE = 0.2  # of the vault, in spans
SLACK = 0.09  # share of cables that slacken


def lines(text):
    """Return points (n, 3) and lines (m, 2) of a Wavefront drawing whose lines are curves through vertices."""
    words = [line.split() for line in text.splitlines() if line.strip()]
    points = np.array([[float(x) for x in row[1:4]] for row in words if row[0] == "v"])
    ends = np.array([[int(k) - 1 for k in row[3:5]] for row in words if row[0] == "curv"])
    points, of = np.unique(np.round(points, 6), axis=0, return_inverse=True)
    ends = np.unique(np.sort(of.ravel()[ends], axis=1), axis=0)
    return points, ends[ends[:, 0] != ends[:, 1]]


def vault(points, ends):
    """Return nodes, links, which of these are cables, and which nodes are held: those of the rim."""
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    at = 2.0 * (points[:, :2] - low) / (high - low) - 1.0
    bay = np.linalg.norm(points[ends[:, 1]] - points[ends[:, 0]], axis=1).min()
    below = points + np.outer(RISE * (high - low).max() * np.prod(1.0 - at**2, axis=1), [0.0, 0.0, 1.0])
    n = len(points)
    nodes = np.concatenate([below, below + [0.0, 0.0, bay]])
    posts = np.column_stack([np.arange(n), np.arange(n) + n])
    braces = np.concatenate([ends + [0, n], ends + [n, 0]])
    links = np.concatenate([ends, ends + n, posts, braces])
    cable = np.arange(len(links)) >= len(links) - len(braces)
    rim = np.any(np.abs(at) > 1.0 - 1e-9, axis=1)
    return nodes, links, cable, np.concatenate([rim, rim])


def drawn():
    """Return the scene."""
    nodes, links, cable, held = vault(*lines((files("compas") / "data/samples/lines_bigger.obj").read_text()))
    fixed = np.repeat(held[:, None], 3, axis=1)
    free = ~(held[links[:, 0]] & held[links[:, 1]])  # links between supports would do nothing
    links, cable = links[free], cable[free]
    span = nodes[links[:, 1]] - nodes[links[:, 0]]
    length = np.linalg.norm(span, axis=1)
    rng = np.random.default_rng(0)
    balance = Balance(span / length[:, None], links, fixed)
    tension = balance.self_stress(np.where(cable, rng.uniform(0.5, 1.5, len(links)), -2.0))
    cable &= tension > 0.0  # what the self-stress compresses is a bar
    tension *= MAX_CABLE_TENSION / tension[cable].max()
    stiffness = np.where(cable, EA_CABLE, EA_BAR) / length
    force = np.where(fixed, 0.0, rng.normal(scale=0.3, size=nodes.shape) - [0.0, 0.0, 1.0])
    load = balance.load_for_slack(force, stiffness, tension, cable, SLACK)
    return Scene(
        name="drawn", nodes=nodes, links=links, law=np.where(cable, Law.CABLE, Law.BAR), stiffness=stiffness,
        initial_elongation=tension / stiffness, fixed=fixed, load=load * force, metadata={"partition": "metis"},
    )  # fmt: skip
