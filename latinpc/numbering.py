"""What messages, tables and pictures call nodes and links: as the file counts them that they were read from."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

__all__ = ["Numbered", "Numbering", "grouped"]

OF_ALL = ("edges", "lines", "members", "truss")  #: what readers call all lines of a file that does not group them
_ONE = r"\d+\b(?: \([-\[\d][^)]*\))?"  # with a value, as `latinpc.arrays.refuse` writes it: "3 (-500.)"
#: What errors of the library say of nodes and links, counted from 0: "Nodes that move (counted from 0): 3, 4", "Link 5"
_SAID = re.compile(
    r"\b(nodes?|links?)( that move(?: most in its mode)?:?)?(?: \(counted from 0\):)? "
    + "(ONE(?:(?:, | and )ONE)*)(?! more)".replace("ONE", _ONE),
    re.I,
)


def place(nodes: np.ndarray, node: int) -> np.ndarray:
    """Return the coordinates of a node, with 0 for what is rounding beside the largest coordinate."""
    return np.where(np.abs(nodes[node]) < 1e-12 * np.abs(nodes).max(), 0.0, nodes[node])


def place_digits(nodes: np.ndarray, of_extent: int) -> int:
    """Return the digits of coordinates that have so many of the extent, which tell neighbours apart far from zero."""
    extent = np.ptp(nodes, axis=0).max()
    beyond = np.log10(np.abs(nodes).max() / extent) if extent > 0.0 else 0.0
    return of_extent + max(0, int(np.ceil(beyond)))


def place_name(nodes: np.ndarray, node: int) -> str:
    """Return the coordinates of a node as text, with six digits of the extent."""
    digits = place_digits(nodes, 6)
    return f"({', '.join(f'{x:.{digits}g}' for x in place(nodes, node))})"


@dataclass(frozen=True)
class Numbering:
    """How a file counts its nodes and links.

    Parameters
    ----------
    nodes : (n,) array of int or str
        Number or name of each node; empty where a drawing has none, and the place of the node (m) stands for it.
    links : (m,) array of int or str, optional
        The same of the links; not given, they go by their nodes.
    node_groups, link_groups : array of str, optional
        Groups of each node and each link, such as layers of a drawing, with "; " between several.
    """

    nodes: np.ndarray
    links: np.ndarray | None = None
    node_groups: np.ndarray | None = None
    link_groups: np.ndarray | None = None


def grouped(groups: Mapping[str, np.ndarray], count: int) -> np.ndarray | None:
    """Return the groups of each of so many nodes or links, (count,) of str; None without any."""
    found = np.full(count, "", dtype=object)
    for name, rows in groups.items():
        rows = np.unique(rows)
        if len(rows) < count or name not in OF_ALL:
            found[rows] += np.where(found[rows] == "", name, f"; {name}").astype(object)
    return found.astype(str) if found.any() else None


class Numbered:
    """The names of nodes and links: their numbers from 0, or those of a file."""

    nodes: np.ndarray
    links: np.ndarray
    numbering: Numbering | None = None  #: of the file that the structure was read from

    def node_name(self, node: int) -> str:
        """Return what messages call a node: its number, as the file counts if the structure was read from one."""
        if self.numbering is None:
            return str(node)
        name = str(self.numbering.nodes[node])
        return name or place_name(self.nodes, node)

    @property
    def links_named(self) -> bool:
        """Whether links have names or numbers of their own, not those of their two nodes."""
        return self.numbering is None or self.numbering.links is not None

    def link_name(self, link: int) -> str:
        """Return what messages call a link: as `node_name`, or by its two nodes where the file has no name for it."""
        if not self.links_named:
            return "-".join(map(self.node_name, self.links[link]))
        return str(link if self.numbering is None else self.numbering.links[link])

    def node_names(self, nodes: Iterable[int], more: bool = False) -> str:
        """Return several `node_name` in a row, `more` adds that there are others."""
        return ", ".join(map(self.node_name, nodes)) + (" and others" if more else "")

    def link_names(self, links: Iterable[int], more: bool = False) -> str:
        """Return several `link_name` in a row, `more` adds that there are others."""
        return ", ".join(map(self.link_name, links)) + (" and others" if more else "")

    def some_nodes(self, nodes: Sequence[int], more: bool = False) -> str:
        """Return `node_names` with their noun, ``"node 3"`` or ``"nodes 3, 4"``."""
        return f"node{'s' if more or len(nodes) > 1 else ''} {self.node_names(nodes, more)}"

    def some_links(self, links: Sequence[int], more: bool = False) -> str:
        """Return `link_names` with their noun, ``"link 3"`` or ``"links 3, 4"``."""
        return f"link{'s' if more or len(links) > 1 else ''} {self.link_names(links, more)}"

    def counted_as_given(self, text: str) -> str:
        """Return an error of the library with nodes and links called by their names."""
        if self.numbering is None:
            return text

        def named(found):
            name = self.node_name if found[1].lower().startswith("node") else self.link_name
            numbers = re.sub(r"(\d+)\b( \(.*?\))?", lambda one: name(int(one[1])) + (one[2] or ""), found[3])
            return f"{found[1]}{found[2].rstrip(':') + ':' if found[2] else ''} {numbers}"

        return _SAID.sub(named, text)
