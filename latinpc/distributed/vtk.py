"""Write results of a distributed structure for ParaView: a file of each rank, and an index."""

from __future__ import annotations

import pathlib
from xml.etree import ElementTree

from latinpc.arrays import alike
from latinpc.results.atomic import atomic, follow
from latinpc.results.vtk import write_vtu

__all__ = ["write_pvtu"]


def write_pvtu(path, result):
    """Write a solved structure for ParaView; collective.

    Each rank writes its links and their nodes, those of other ranks too, into a folder beside the index, or beside
    what its name leads to. The index is written last. Ghost nodes stand in the files of several ranks; links in one.

    Parameters
    ----------
    path : str or path-like
        A ``.pvtu`` file. It, and the files of the ranks, are replaced each once it is completely written.
    result : latinpc.LocalResult

    Raises
    ------
    OSError
        On every rank, where one cannot write.
    ValueError
        On every rank: another suffix, or names that differ.
    """
    path, comm = pathlib.Path(path), result.structure.comm.tompi4py()
    alike(comm, path=str(path))
    if path.suffix.lower() != ".pvtu":
        raise ValueError(f"{path}: results of several ranks are written as .pvtu")
    part = _part(result)
    _each(comm, lambda: follow(path))
    folder = pathlib.Path(follow(path)[0]).parent / path.stem
    _each(comm, lambda: comm.rank == 0 and folder.mkdir(exist_ok=True))
    name = f"{folder.name}/{comm.rank:05d}.vtu"
    _each(comm, lambda: write_vtu(folder.parent / name, *part[0], **part[1]))
    names = [f"{folder.name}/{rank:05d}.vtu" for rank in range(comm.size)]
    _each(comm, lambda: comm.rank == 0 and _write_index(path, folder.parent / name, names))


def _part(result):
    """Return the arguments of `write_vtu` for this rank's links; collective."""
    part, spread = result.part(), result.structure.halo.spread
    more = {
        "load": spread(result.load),
        "reactions": spread(result.reactions()),
        "stress": part.stress,
        "utilisation": part.utilisation,
        "loose": result.slack,
    }
    return (part.structure, part.displacements, part.tensions, part.subdomain, part.node_class), more


def _write_index(path, piece, names):
    """Write an index of pieces that have the arrays of one of them."""
    root = ElementTree.Element("VTKFile", type="PUnstructuredGrid", version="0.1", byte_order="LittleEndian")
    grid = ElementTree.SubElement(root, "PUnstructuredGrid", GhostLevel="0")
    whole = ElementTree.parse(piece).getroot().find("UnstructuredGrid/Piece")
    for name in ("Points", "PointData", "CellData"):
        found = ElementTree.SubElement(grid, f"P{name}")
        for array in whole.find(name):
            kept = {key: array.get(key) for key in ("type", "Name", "NumberOfComponents") if array.get(key)}
            ElementTree.SubElement(found, "PDataArray", kept)
    for name in names:
        ElementTree.SubElement(grid, "Piece", Source=name)
    with atomic(path) as temporary:
        ElementTree.ElementTree(root).write(temporary, xml_declaration=True)


def _each(comm, write):
    """Run what each rank writes; an error of one is an error on all; collective."""
    error = None
    try:
        write()
    except OSError as refused:
        error = refused
    failed = [(rank, text) for rank, text in enumerate(comm.allgather(error and str(error))) if text]
    if failed:
        raise OSError(f"rank {failed[0][0]}: {failed[0][1]}")
