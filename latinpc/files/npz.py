"""Write a scene to an .npz file, and read it again."""

from __future__ import annotations

import json

import numpy as np

from latinpc.numbering import Numbering
from latinpc.results.atomic import atomic
from latinpc.scenes.scene import Scene

_ARRAYS = ("nodes", "links", "law", "stiffness", "initial_elongation", "fixed", "prescribed", "load")
_OPTIONAL = ("subdomain", "direction", "friction", "mass", "velocity", "area", "strength")
_NUMBERING = "numbering_"


def save_scene(path, scene):
    """Write a scene to an uncompressed .npz file."""
    arrays = {name: getattr(scene, name) for name in _ARRAYS}
    arrays |= {name: getattr(scene, name) for name in _OPTIONAL if getattr(scene, name) is not None}
    for name, values in vars(scene.numbering).items() if scene.numbering is not None else ():
        arrays |= {} if values is None else {f"{_NUMBERING}{name}": values}
    tables = [[part.tolist() for part in table] for table in scene.tables]
    about = {"name": scene.name, "metadata": scene.metadata, "time_step": scene.time_step, "tables": tables}
    text = json.dumps(about if scene.geometry == "linear" else about | {"geometry": scene.geometry})
    with atomic(path) as temporary, open(temporary, "wb") as file:
        np.savez(file, text=np.frombuffer(text.encode(), np.uint8), **arrays)


def load_scene(path):
    """Read what `save_scene` wrote."""
    with np.load(path) as file:
        text = json.loads(bytes(file["text"]))
        arrays = {name: file[name] for name in file.files if name != "text"}
    names = {name.removeprefix(_NUMBERING): arrays.pop(name) for name in list(arrays) if name.startswith(_NUMBERING)}
    return Scene(**text, **arrays, numbering=Numbering(**names) if names else None)
