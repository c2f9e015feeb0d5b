"""The numbers that a Gmsh file gives its nodes, which meshio counts anew."""

from __future__ import annotations

import numpy as np

__all__ = ["node_tags"]


def node_tags(path, count):
    """Return the tags of the nodes in the order of the file, format 2.2, 4.0 or 4.1, text or binary.

    Parameters
    ----------
    path : path-like
        A file that meshio has read.
    count : int
        Number of its nodes.

    Returns
    -------
    (count,) array of int, or None
        None where the section of the nodes is not as the format says.
    """
    with open(path, "rb") as file:
        data = file.read()
    try:
        version, binary, size = data.split(b"$MeshFormat", 1)[1].split(None, 3)[:3]
        nodes = data[data.index(b"$Nodes") + len(b"$Nodes") :].lstrip(b"\r")[1:]
        if int(binary):
            tags = _binary(nodes, version.decode(), f"u{int(size)}")
        else:
            tags = _text(nodes[: nodes.index(b"$EndNodes")].split(), version.decode())
    except (ValueError, IndexError):
        return None
    return tags if len(tags) == count and len(np.unique(tags)) == count else None


def _text(words, version):
    if version.startswith("2"):
        return np.array(words[1::4], dtype=np.int64)
    blocks, at, found = int(words[0]), 4 if version == "4.1" else 2, []
    for _ in range(blocks):
        parametric, number = int(words[at + 2]), int(words[at + 3])
        dim = int(words[at] if version == "4.1" else words[at + 1])
        width = 3 + (dim if parametric else 0)
        at += 4
        if version == "4.1":
            found += words[at : at + number]
            at += number * (1 + width)
        else:
            found += words[at : at + number * (1 + width) : 1 + width]
            at += number * (1 + width)
    return np.array(found, dtype=np.int64)


def _binary(data, version, whole):
    if version.startswith("2"):
        first, rest = data.split(b"\n", 1)
        return np.frombuffer(rest, [("tag", "i4"), ("x", "f8", 3)], int(first))["tag"].astype(np.int64)
    whole, at, found = np.dtype(whole), 0, []

    def take(kind, number):
        nonlocal at
        values = np.frombuffer(data, kind, number, at)
        at += values.nbytes
        return values

    blocks = int(take(whole, 4 if version == "4.1" else 2)[0])
    for _ in range(blocks):
        one, two, parametric = map(int, take("i4", 3))
        number = int(take(whole, 1)[0])
        width = 3 + ((one if version == "4.1" else two) if parametric else 0)
        if version == "4.1":
            found.append(take(whole, number))
            take("f8", number * width)
        else:
            found.append(take([("tag", "i4"), ("x", "f8", width)], number)["tag"])
    return np.concatenate(found).astype(np.int64)
