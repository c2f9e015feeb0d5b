"""Write a scene to an .npz file, and read it again."""

from __future__ import annotations

import json

import numpy as np

from latinpc.numbering import Numbering
from latinpc.results.atomic import atomic
from latinpc.scenes.case import PARTS, Case
from latinpc.scenes.scene import Scene

_ARRAYS = ("nodes", "links", "law", "stiffness", "initial_elongation", "fixed", "prescribed", "load")
_OPTIONAL = ("subdomain", "direction", "friction", "mass", "velocity", "area", "strength")
_NUMBERING, _CASE = "numbering_", "case_"


def save_scene(path, scene):
    """Write a scene to an uncompressed .npz file."""
    arrays = {name: getattr(scene, name) for name in _ARRAYS}
    arrays |= {name: getattr(scene, name) for name in _OPTIONAL if getattr(scene, name) is not None}
    for name, values in vars(scene.numbering).items() if scene.numbering is not None else ():
        arrays |= {} if values is None else {f"{_NUMBERING}{name}": values}
    tables = [[part.tolist() for part in table] for table in scene.tables]
    cases = [{"name": case.name, "part": case.part} for case in scene.cases]
    for number, case in enumerate(scene.cases):
        parts = zip(PARTS, case.parts)
        arrays |= {f"{_CASE}{number}_{name}": part for name, part in parts if part is not None}
    about = {"name": scene.name, "metadata": scene.metadata, "time_step": scene.time_step, "tables": tables}
    about |= {} if scene.geometry == "linear" else {"geometry": scene.geometry}
    text = json.dumps(about | ({"cases": cases} if cases else {}))
    with atomic(path) as temporary, open(temporary, "wb") as file:
        np.savez(file, text=np.frombuffer(text.encode(), np.uint8), **arrays)


def load_scene(path):
    """Read what `save_scene` wrote."""
    with np.load(path) as file:
        text = json.loads(bytes(file["text"]))
        arrays = {name: file[name] for name in file.files if name != "text"}
    names = {name.removeprefix(_NUMBERING): arrays.pop(name) for name in list(arrays) if name.startswith(_NUMBERING)}
    acts = {name.removeprefix(_CASE): arrays.pop(name) for name in list(arrays) if name.startswith(_CASE)}
    cases = []
    for number, about in enumerate(text.pop("cases", ())):
        cases.append(Case(**about, **{name: acts[f"{number}_{name}"] for name in PARTS if f"{number}_{name}" in acts}))
    return Scene(**text, **arrays, cases=tuple(cases), numbering=Numbering(**names) if names else None)
