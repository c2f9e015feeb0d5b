"""Checks of the arrays that a structure is made of: ValueError names the first nodes or links that do not fit."""

import numpy as np

from latinpc.arrays import REAL, integers, refuse, shaped
from latinpc.laws import Law, law_numbers
from latinpc.library import _latin

__all__ = ["Checks"]


class Checks:
    """The shapes of a structure, and what its arrays must satisfy.

    Parameters
    ----------
    shape : tuple of int
        Of the nodes, (n, dim).
    count : int
        Number of links.
    """

    def __init__(self, shape, count):
        self.shape = shape
        self.count = count

    def geometry(self, nodes, links, direction):
        """Check nodes and links; return the directions as an array, None without any."""
        refuse(~np.isfinite(nodes).all(axis=1), "node", "has a coordinate that is not finite", nodes)
        refuse(
            ((links < 0) | (links >= len(nodes))).any(axis=1),
            "link",
            f"joins a node that does not exist (nodes are numbered from 0 to {len(nodes) - 1})",
            links,
        )
        refuse(links[:, 0] == links[:, 1], "link", "joins a node to itself", links)
        length = np.linalg.norm(nodes[links[:, 1]] - nodes[links[:, 0]], axis=1)
        if direction is not None:
            direction = shaped("direction", direction, (self.count, nodes.shape[1]), REAL, "a row per link")
            refuse(~np.isfinite(direction).all(axis=1), "link", "has a direction that is not finite", direction)
            length = np.where(direction.any(axis=1), 1.0, length)
        refuse(length == 0, "link", "has no length: its two nodes are at one place and no direction is given", links)
        return direction

    def constitution(self, law, stiffness, friction):
        """Check laws, stiffnesses and coefficients of friction; return them as arrays."""
        law = self.link_array("law", integers("law", law_numbers(law)), np.int64)
        names = _latin.law_names()
        known = ", ".join(f"{number} {name}" for number, name in enumerate(names))
        refuse((law < 0) | (law >= len(names)), "link", f"has an unknown law ({known})", law)
        stiffness = self.link_array("stiffness", stiffness)
        wrong = ~((stiffness > 0) & np.isfinite(stiffness)) & ~((stiffness == 0) & (law > Law.COMPRESSION_ONLY))
        refuse(wrong, "link", "needs a positive stiffness", stiffness)
        if friction is not None:
            friction = self.link_array("friction", friction)
            refuse(~((friction >= 0) & np.isfinite(friction)), "link", "has a friction that is negative", friction)
        return law, stiffness, friction

    def supports(self, fixed, prescribed):
        """Check supports; return them as arrays."""
        fixed = np.zeros(self.shape, bool) if fixed is None else self.node_array("fixed", fixed, bool)
        prescribed = self.node_array("prescribed", 0.0 if prescribed is None else prescribed)
        wrong = ((prescribed != 0) & ~fixed).any(axis=1)
        refuse(wrong, "node", "has a prescribed displacement in a direction that is not fixed", prescribed)
        return fixed, prescribed

    def prestress(self, values, law):
        """Check tensions of links by their laws."""
        values = self.link_array("prestress", values)
        bears = np.where(law == Law.BAR, np.isfinite(values), values == 0)
        bears |= np.isfinite(values) & np.where(
            law == Law.CABLE, values > 0, (law == Law.COMPRESSION_ONLY) & (values < 0)
        )
        refuse(~bears, "link", "has a prestress that its law cannot bear (a rigid law takes none)", values)
        return values

    def link_array(self, name, values, dtype=REAL):
        """Make an array of a value per link."""
        return shaped(name, values, (self.count,), dtype, "a value per link")

    def node_array(self, name, values, dtype=REAL):
        """Make a finite array of a row per node."""
        given = shaped(name, values, self.shape, None, "a row per node, a column per direction")
        values = given.astype(dtype)
        if dtype is bool:
            refuse(~np.isin(given, (0, 1)).all(axis=1), "node", f"has a {name} that is neither true nor false", given)
        else:
            refuse(~np.isfinite(values).all(axis=1), "node", f"has a {name} that is not finite", values)
        return values

    def initial_elongation(self, values):
        """Check initial elongations."""
        values = self.link_array("initial_elongation", values)
        refuse(~np.isfinite(values), "link", "has an initial elongation that is not finite", values)
        return values
