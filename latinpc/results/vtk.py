"""Write results for ParaView: .vtu files of states and modes, and .pvd files of motions."""

from __future__ import annotations

import contextlib
import os
import pathlib
import re
from xml.etree import ElementTree

import numpy as np

from .atomic import atomic, check_writable, follow
from .mechanics import slack, stretches


def write_vtu(
    path, scene, displacements, tensions, subdomain=None, node_class=None, velocities=None, *, load=None,
    reactions=None, stress=None, utilisation=None, loose=None, geometry=None,
):  # fmt: skip
    """Write a solved structure for ParaView.

    Not collective: call it on one rank, with whole arrays in the scene's numbering.

    Parameters
    ----------
    path : str or path-like
        A ``.vtu`` file; it is replaced only once it is completely written.
    scene : Scene or Structure
    displacements : (n, dim) array
        In m.
    tensions : (m,) array
        In N.
    subdomain : (m,) array of int, optional
        Subdomain of each link; -1 where not given.
    node_class : (n,) array of int, optional
        0 interior, 1 strong interface, 2 weak interface, 3 corner; -1 where not given.
    velocities : (n, dim) array, optional
        In m/s.
    load : (n, dim) array, optional
        In N, that of the scene when not given.
    reactions : (n, dim) array, optional
        In N.
    stress, utilisation : (m,) array, optional
        Tension over area (Pa), and its size over the strength.
    loose : (m,) array of bool, optional
        Slack links of a part of a structure.
    geometry : str, optional
        How displacements turned links, that of the scene when not given.
    """
    check_writable(path, (".vtu",))
    of_nodes = {
        "displacement": displacements,
        "load": scene.load if load is None else load,
        "fixed": scene.fixed,
        "interface_class": np.full(len(scene.nodes), -1) if node_class is None else node_class,
        "velocity": velocities,
        "reaction": reactions,
    }
    of_links = {
        "tension": tensions,
        "elongation": stretches(scene, displacements, geometry),
        "slack": slack(scene, tensions) if loose is None else loose,
        "law": scene.law,
        "subdomain": np.full(len(scene.links), -1) if subdomain is None else subdomain,
        "stress": stress,
        "utilisation": utilisation,
    }
    _write(path, scene.nodes, scene.links, of_nodes, of_links)


def write_modes(path, modes):
    """Write the state and the modes for ParaView: a ``.vtu`` file with the fields ``mode_1`` and so on.

    Not collective: call it on one rank.

    Parameters
    ----------
    path : str or path-like
        Replaced only once it is completely written.
    modes : Modes
    """
    structure, of_nodes = modes.structure, {f"mode_{mode + 1}": shape for mode, shape in enumerate(modes.shapes)}
    of_links = {"tension": modes.tensions, "slack": slack(structure, modes.tensions)}
    _write(path, structure.nodes + modes.displacements, structure.links, of_nodes, of_links)


def _write(path, nodes, links, of_nodes, of_links):
    """Write links as lines, and arrays by name, those that are None left out: vectors in space, or numbers."""
    import meshio  # takes as long to load as all else

    def numbers(values):
        values = np.asarray(values)
        if values.ndim == 2:
            return np.pad(values.astype(float), ((0, 0), (0, 3 - values.shape[1])))
        return values.astype(float if values.dtype.kind == "f" else np.int64)

    of_nodes = {name: numbers(values) for name, values in of_nodes.items() if values is not None}
    of_links = {name: [numbers(values)] for name, values in of_links.items() if values is not None}
    mesh = meshio.Mesh(numbers(nodes), [("line", np.asarray(links, dtype=np.int64))], of_nodes, of_links)
    with atomic(path) as temporary:
        meshio.vtu.write(temporary, mesh)


def frames_folder(path):
    """Return the folder of the frames of a ``.pvd`` file, beside the file that the name leads to.

    Raises
    ------
    OSError
        When something else has its name, or it may not be written to.
    """
    folder = pathlib.Path(follow(path)[0]).parent / pathlib.Path(path).stem
    if folder.exists() and not (folder.is_dir() and os.access(folder, os.W_OK | os.X_OK)):
        raise PermissionError(f"{path}: its states cannot be written into {folder}; give another name")
    return folder


def write_pvd(path, motion):
    """Write a motion for ParaView: a file for each frame, in a folder of the same name, and an index with the times.

    Not collective: call it on one rank.

    Parameters
    ----------
    path : str or path-like
        A ``.pvd`` file; it is replaced only once all is written. Then frames go that the former one alone has named.
    motion : latinpc.runs.motion.Motion
        With its frames.
    """
    check_writable(path, (".pvd",))
    folder = frames_folder(path)
    folder.mkdir(exist_ok=True)
    root, names = ElementTree.Element("VTKFile", type="Collection", version="0.1", byte_order="LittleEndian"), set()
    frames = ElementTree.SubElement(root, "Collection")
    for frame in motion.frames:
        name = f"{folder.name}/{frame.step:06d}.vtu"
        arrays = (frame.displacements, frame.tensions, motion.subdomain, motion.node_class, frame.velocities)
        write_vtu(folder.parent / name, motion.scene, *arrays)
        ElementTree.SubElement(frames, "DataSet", timestep=repr(frame.time), part="0", file=name)
        names.add(name)
    former = _frames(path, folder) - names
    ElementTree.indent(root)
    with atomic(path) as temporary:
        ElementTree.ElementTree(root).write(temporary, xml_declaration=True, encoding="utf-8")
    for name in former:
        (folder.parent / name).unlink(missing_ok=True)


def _frames(path, folder):
    """Return the files in a folder that an index names, none where there is no index yet."""
    with contextlib.suppress(OSError, ElementTree.ParseError):
        index = follow(path)[0]
        names = {entry.get("file", "") for entry in ElementTree.parse(index).iter("DataSet")}
        return {name for name in names if re.fullmatch(rf"{re.escape(folder.name)}/\d+\.vtu", name)}
    return set()
