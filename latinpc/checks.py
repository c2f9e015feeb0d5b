"""Checks of the arrays that a structure is made of: ValueError names the first nodes or links that do not fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from latinpc.arrays import REAL, agreed, integers, partition, real, refuse, shaped
from latinpc.laws import Law, law_numbers

__all__ = [
    "ARRAYS",
    "INSTEAD",
    "Agreed",
    "Checks",
    "check_assigned",
    "check_scene",
    "checked",
    "checked_name",
    "checked_shapes",
]

#: Arrays of a structure; those from `subdomain` on are None where not given.
ARRAYS = (
    "nodes", "links", "law", "stiffness", "initial_elongation", "fixed", "prescribed", "load",
    "subdomain", "direction", "friction", "mass", "area", "strength",
)  # fmt: skip
COPIED = ARRAYS[:-2]  #: those of which the library has a copy
KEPT = ("name", "comm", "notices")  #: other attributes of a structure
INSTEAD = ("EA", "prestress")  #: in place of stiffness and initial_elongation
_LINKS_AT_ONCE = 8192  # their vectors in 3D take 200 kB


def check_assigned(kind: type, name: str) -> None:
    """Refuse to assign what solvers would not see, and unknown attributes, which nothing reads."""
    setter = hasattr(kind, f"set_{name}")
    if name in COPIED or setter:
        other = f"call set_{name}()" if setter else "make another structure"
        raise AttributeError(f"the {name} of a structure cannot be assigned, its solvers would not see it: {other}")
    if not name.startswith("_") and name not in (*ARRAYS, *KEPT) and not hasattr(kind, name):
        raise AttributeError(f"a structure has no attribute {name!r}: its arrays are {', '.join(ARRAYS)}")


def check_scene(scene: Any) -> None:
    """Refuse what is no scene, such as the name of one."""
    if not hasattr(scene, "metadata"):
        raise TypeError(
            "scene must be a latinpc.scenes.Scene, as latinpc.scenes.make(name) and latinpc.read(path) return,"
            f" not {scene!r:.40}"
        )


def checked_name(name: Any) -> None:
    """Refuse what is no name."""
    if not isinstance(name, str):
        raise ValueError(f"name must be a string, not {name!r:.40}")


def checked_shapes(given: Mapping[str, Any], dtype=REAL, least: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Check shapes, and that coordinates are finite, of at least so many nodes and links; return them as arrays."""
    nodes = real("nodes", given["nodes"], dtype)
    if nodes.ndim != 2 or nodes.shape[1] not in (1, 2, 3) or len(nodes) < least:
        raise ValueError(f"nodes must be an (n, dim) array with dim 1, 2 or 3, not of shape {nodes.shape}")
    refuse(~np.isfinite(nodes), "node", "has a coordinate that is not finite", nodes)
    links = integers("links", given["links"]).astype(np.int64, copy=False)
    if links.ndim != 2 or links.shape[1] != 2 or len(links) < least:
        raise ValueError(f"links must be an (m, 2) array of node numbers, not of shape {links.shape}")
    return nodes, links


def checked(
    given: Mapping[str, Any], laws: Sequence[str], dtype=REAL, around: tuple[np.ndarray, np.ndarray] | None = None
) -> dict[str, np.ndarray | None]:
    """Check all arrays of a structure; not collective.

    Parameters
    ----------
    given : mapping
        A name, `ARRAYS` by name, and `INSTEAD` where they may be given, as `latinpc.Structure` takes them.
    laws : sequence of str
        Names of the known laws, by number.
    dtype : numpy.dtype
        Of real numbers.
    around : (nodes, links), optional
        Of a part of a structure: its nodes and those of other ranks at its links, and the links by their places there.

    Returns
    -------
    dict
        Whole arrays by name; an array of `given` that has its type already is not copied.
    """
    checked_name(given["name"])
    nodes, links = checked_shapes(given, dtype, 1 if around is None else 0)
    checks = Checks(nodes.shape, len(links), dtype)
    ends = around or (nodes, links)
    found = {"nodes": nodes, "links": links, "direction": checks.geometry(*ends, given["direction"], links)}
    found["law"] = law = checks.law(given["law"], laws)
    stiffness, elongation, EA = given["stiffness"], given["initial_elongation"], given.get("EA")
    if "EA" in given and stiffness is EA is None and (law > Law.COMPRESSION_ONLY).all():
        stiffness = 0.0
    if "EA" in given and (stiffness is None) == (EA is None):
        raise ValueError("give either stiffness, EA / length of each link (N/m), or EA (N)")
    if elongation is not None and given.get("prestress") is not None:
        raise ValueError("initial_elongation and prestress both give the self-stress: leave out one of the two")
    stiffness = stiffness if EA is None else checks.axial_stiffness(EA, law, lengths(*ends))
    found["stiffness"] = checks.stiffness(stiffness, law)
    found["initial_elongation"] = checks.initial_elongation(0.0 if elongation is None else elongation)
    found["fixed"], found["prescribed"] = checks.supports(given["fixed"], given["prescribed"])
    found["load"] = checks.node_array("load", 0.0 if given["load"] is None else given["load"])
    optional = {
        "subdomain": checks.subdomain if around else lambda values: partition("subdomain", values, len(links)),
        "friction": checks.friction,
        "mass": checks.mass,
        "area": lambda values: checks.positive("area", values),
        "strength": lambda values: checks.positive("strength", values),
    }
    for name, check in optional.items():
        found[name] = None if given[name] is None else check(given[name])
    new = "EA" in given and around is None  # scenes may change their laws; a part of a structure may have no contact
    if new and found["friction"] is not None and found["friction"].any() and not (law == Law.FRICTION).any():
        raise ValueError("friction is given, and no link has the law friction: give it, or leave friction out")
    if found["strength"] is not None and found["area"] is None:
        raise ValueError("strength is a stress, which needs the area of the links: give area")
    return found


def lengths(nodes, links):
    """Return the lengths of the links, some at a time, so that what is between stays in a cache."""
    length = np.empty(len(links), nodes.dtype)
    for first in range(0, len(links), _LINKS_AT_ONCE):
        some = slice(first, first + _LINKS_AT_ONCE)
        vector = nodes.take(links[some, 1], axis=0) - nodes.take(links[some, 0], axis=0)
        length[some] = np.sqrt(np.einsum("ij,ij->i", vector, vector))
    return length


class Checks:
    """The shapes of a structure, and what its arrays must satisfy.

    Parameters
    ----------
    shape : tuple of int
        Of the nodes, (n, dim).
    count : int
        Number of links.
    dtype : numpy.dtype
        Of real numbers.
    """

    def __init__(self, shape, count, dtype=REAL):
        self.shape = shape
        self.count = count
        self.dtype = dtype

    def geometry(self, nodes, links, direction, named):
        """Check nodes and links, which messages name; return the directions as an array, None without any."""
        refuse(
            (links < 0) | (links >= len(nodes)),
            "link",
            f"joins a node that does not exist (nodes are numbered from 0 to {len(nodes) - 1})",
            named,
        )
        refuse(links[:, 0] == links[:, 1], "link", "joins a node to itself", named)
        length = lengths(nodes, links)
        if direction is not None:
            direction = shaped("direction", direction, (self.count, nodes.shape[1]), self.dtype, "a row per link")
            refuse(~np.isfinite(direction), "link", "has a direction that is not finite", direction)
            length = np.where(direction.any(axis=1), 1.0, length)
        refuse(length == 0, "link", "has no length: its two nodes are at one place and no direction is given", named)
        return direction

    def subdomain(self, values):
        """Check the subdomains of a part of the links: the library checks that none is missing."""
        values = self.link_array("subdomain", integers("subdomain", values), np.int64)
        refuse(values < 0, "link", "has a negative subdomain", values)
        return values

    def law(self, values, names):
        """Check laws, numbers or names; return numbers."""
        law = self.link_array("law", integers("law", law_numbers(values)), np.int64)
        known = ", ".join(f"{number} {name}" for number, name in enumerate(names))
        refuse((law < 0) | (law >= len(names)), "link", f"has an unknown law ({known})", law)
        return law

    def stiffness(self, values, law):
        """Check stiffnesses by their laws."""
        values = self.link_array("stiffness", values)
        wrong = ~((values > 0) & np.isfinite(values)) & ~((values == 0) & (law > Law.COMPRESSION_ONLY))
        refuse(wrong, "link", "needs a positive stiffness", values)
        return values

    def axial_stiffness(self, values, law, length):
        """Check axial stiffnesses by their laws; return them over the lengths of the links."""
        values = self.link_array("EA", values)
        own = law > Law.COMPRESSION_ONLY  # a stiffness is found, or the table's own
        wrong = ~((values > 0) & np.isfinite(values)) & ~((values == 0) & own)
        refuse(wrong, "link", "needs a positive EA (0 where its law has no stiffness)", values)
        refuse((length == 0) & (values > 0), "link", "has no length to divide EA by: give stiffness", values)
        return np.divide(values, length, out=np.zeros(self.count, self.dtype), where=values > 0)

    def supports(self, fixed, prescribed):
        """Check supports; return them as arrays."""
        fixed = np.zeros(self.shape, bool) if fixed is None else self.node_array("fixed", fixed, bool)
        prescribed = self.node_array("prescribed", 0.0 if prescribed is None else prescribed)
        wrong = (prescribed != 0) & ~fixed
        refuse(wrong, "node", "has a prescribed displacement in a direction that is not fixed", prescribed)
        return fixed, prescribed

    def prestress(self, values, law):
        """Check tensions of links by their laws."""
        values = self.link_array("prestress", values)
        bears = np.where(law == Law.BAR, np.isfinite(values), values == 0)
        bears |= np.isfinite(values) & np.where(
            law == Law.CABLE, values > 0, (law == Law.COMPRESSION_ONLY) & (values < 0)
        )
        refuse(
            ~bears,
            "link",
            "has a prestress that its law cannot bear (a rigid law takes none, a cable is pulled)",
            values,
        )
        return values

    def mass(self, values):
        """Check masses."""
        values = shaped("mass", values, self.shape[:1], self.dtype, "a value per node")
        refuse(~((values >= 0) & np.isfinite(values)), "node", "has a mass that is negative or not finite", values)
        return values

    def friction(self, values):
        """Check coefficients of friction."""
        values = self.link_array("friction", values)
        refuse(~((values >= 0) & np.isfinite(values)), "link", "has a friction that is negative or not finite", values)
        return values

    def positive(self, name, values):
        """Check a positive value per link, NaN where it is not known."""
        values = self.link_array(name, values)
        wrong = ~((values > 0) & np.isfinite(values) | np.isnan(values))
        refuse(wrong, "link", f"has {name} that is not positive and finite (NaN: not known)", values)
        return values

    def link_array(self, name, values, dtype=None):
        """Make an array of a value per link."""
        return shaped(name, values, (self.count,), self.dtype if dtype is None else dtype, "a value per link")

    def node_array(self, name, values, dtype=None):
        """Make a finite array of a row per node."""
        meaning = "a row per node, a column per direction"
        given = shaped(name, values, self.shape, None, meaning)
        if self.shape[1] > 1 and np.ndim(values) == 0 and values:
            raise ValueError(f"{name} must have the shape {self.shape}, {meaning}: one number does not say which")
        values = given.astype(self.dtype if dtype is None else dtype, copy=False)
        if dtype is bool:
            refuse(~np.isin(given, (0, 1)), "node", f"has an entry of {name} that is neither true nor false", given)
        else:
            refuse(~np.isfinite(values), "node", f"has an entry of {name} that is not finite", values)
        return values

    def initial_elongation(self, values):
        """Check initial elongations."""
        values = self.link_array("initial_elongation", values)
        refuse(~np.isfinite(values), "link", "has an initial elongation that is not finite", values)
        return values


class Agreed:
    """Checks of each rank's arrays; what one rank refuses is an error on all."""

    def __init__(self, comm, checks):
        self._comm, self._of = comm, checks

    def __getattr__(self, name):
        """Return a check that all ranks make together, or a number."""
        found = getattr(self._of, name)
        return (lambda *arguments: agreed(self._comm, found, *arguments)) if callable(found) else found
