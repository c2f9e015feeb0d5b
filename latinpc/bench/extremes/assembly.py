"""Structures of cables and bars, assembled node by node: what generators of random ones share."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from latinpc.laws import Law
from latinpc.scenes import Scene
from latinpc.scenes.prestress import taut

BARS = 10.0  # bars bear so many times as much as cables of what balances prestress and weights


class Assembly:
    """Nodes and links, and what they bear as drawn.

    Parameters
    ----------
    rng : numpy.random.Generator
        Draws the units: of length (m), of force (N), strains of cables, and how much stiffer bars are.
    """

    def __init__(self, rng):
        self.rng = rng
        self.length, self.force = 10.0 ** rng.uniform(0, 1.5), 10.0 ** rng.uniform(3, 6)
        self.strain, self.stiffer = 10.0 ** rng.uniform(-3.5, -2.3), 10.0 ** rng.uniform(0.3, 2)
        self.places, self.held, self.weights, self.links = [], [], [], []

    def node(self, *place, held=False, weight=0.0):
        """Add a node and return its number; `held` for all directions or each, weights in units of force."""
        self.places.append(place)
        self.held.append(np.broadcast_to(held, len(place)))
        self.weights.append(weight)
        return len(self.places) - 1

    def row(self, places, **kind):
        """Add nodes and return their numbers."""
        return [self.node(*place, **kind) for place in places]

    def cable(self, a, b, tension=1.0):
        """Add a cable with a tension to aim at, in units of force."""
        self.links.append((a, b, Law.CABLE, tension, max(tension, 0.1) / self.strain))

    def bar(self, a, b):
        """Add a bar."""
        self.links.append((a, b, Law.BAR, 0.0, self.stiffer / self.strain))

    def chain(self, nodes, link, *tension):
        """Join nodes in a row by links of one kind, `self.cable` or `self.bar`."""
        for a, b in pairwise(nodes):
            link(a, b, *tension)

    def ring(self, nodes, link, *tension):
        """Join nodes in a ring."""
        self.chain([*nodes, nodes[0]], link, *tension)

    def form(self, *held):
        """Move nodes to where cables balance the weights, with forces per length as drawn; these nodes stay."""
        first, second, law, tension, _ = (np.array(column) for column in zip(*self.links, strict=True))
        places, free = np.array(self.places, float), ~np.array(self.held).all(axis=1)
        free[list(held)] = False
        span = np.zeros((len(first), len(places)))
        span[np.arange(len(first)), first], span[np.arange(len(first)), second] = -1.0, 1.0
        density = np.where(law == Law.CABLE, tension / np.linalg.norm(span @ places, axis=1), 0.0)
        whole, load = span.T @ (density[:, None] * span), np.zeros(places.shape)
        load[:, -1] = -np.array(self.weights)
        places[free] = np.linalg.solve(
            whole[np.ix_(free, free)], load[free] - whole[np.ix_(free, ~free)] @ places[~free]
        )
        self.places = list(map(tuple, places))

    def scene(self, name, prestressed=True):
        """Return the scene: its weights and tensions as drawn are in balance as far as links can bear them.

        Parameters
        ----------
        name : str
        prestressed : bool
            Else nothing is tight as drawn.
        """
        first, second, law, tension, EA = (np.array(column) for column in zip(*self.links, strict=True))
        nodes, held = self.length * np.array(self.places, float), np.array(self.held)
        weight = np.zeros(nodes.shape)
        weight[:, -1] = -np.array(self.weights)
        weight[held] = 0.0
        links = np.column_stack([first, second])
        tension = self.force * _balanced(nodes, links, law, tension, ~held, weight) if prestressed else 0.0 * tension
        stiffness, elongation = taut(nodes, links, tension, self.force * EA)
        return Scene(
            name=name, nodes=nodes, links=links, law=law, stiffness=stiffness, initial_elongation=elongation,
            fixed=held, load=self.force * (weight + self._live(nodes, held)), geometry="large",
        )  # fmt: skip

    def _live(self, nodes, held):
        """Return loads beside the weights, in units of force: on all nodes with weights, a half, or one; wind."""
        rng, load, bears = self.rng, np.zeros(nodes.shape), np.array(self.weights) > 0
        if not bears.any():
            bears = ~held.all(axis=1)
        size = rng.choice([0.0, 0.3, 3.0]) * max(self.weights + [0.1])
        part = [
            bears,
            bears & (nodes[:, 0] <= np.median(nodes[bears, 0])),
            np.arange(len(nodes)) == rng.choice(np.flatnonzero(bears)),
        ]
        load[part[rng.integers(3)], -1] = -size
        wind = rng.normal(0, 1, nodes.shape[1]) * rng.choice([0.0, 0.2, 2.0]) * max(self.weights + [0.1])
        wind[-1] *= 0.3
        return np.where(held, 0.0, load + wind)


def _balanced(nodes, links, law, tension, free, weight):
    """Return the tensions next to those given that balance the weights; least squares where none do."""
    span = nodes[links[:, 1]] - nodes[links[:, 0]]
    span /= np.linalg.norm(span, axis=1)[:, None]
    pull = np.zeros((*nodes.shape, len(links)))
    every = np.arange(len(links))
    pull[links[:, 0], :, every] += span
    pull[links[:, 1], :, every] -= span
    pull, scale = pull[free], np.where(law == Law.BAR, BARS, 1.0)
    return tension - scale * np.linalg.lstsq(pull * scale, pull @ tension + weight[free], rcond=1e-9)[0]
