"""A scene as arrays on disk, and the mechanics of its arrays: no PETSc, no solver."""

from __future__ import annotations

import json

import numpy as np

from latinpc.scenes.scene import Law, Scene

_ARRAYS = ("nodes", "links", "law", "stiffness", "prestrain", "fixed", "prescribed", "load")
_OPTIONAL = ("subdomain", "direction", "friction", "mass", "velocity")


def save_scene(path, scene):
    """Write a scene to an uncompressed .npz file."""
    arrays = {name: getattr(scene, name) for name in _ARRAYS}
    arrays |= {name: getattr(scene, name) for name in _OPTIONAL if getattr(scene, name) is not None}
    tables = [[part.tolist() for part in table] for table in scene.tables]
    text = json.dumps({"name": scene.name, "metadata": scene.metadata, "time_step": scene.time_step, "tables": tables})
    np.savez(path, text=np.frombuffer(text.encode(), np.uint8), **arrays)


def load_scene(path):
    """Read what `save_scene` wrote."""
    with np.load(path) as file:
        text = json.loads(bytes(file["text"]))
        arrays = {name: file[name] for name in file.files if name != "text"}
    return Scene(**text, **arrays)


def elongations(scene, displacement):
    """Return e = B U (m), of displacements that hold the prescribed ones too."""
    relative = displacement[scene.links[:, 1]] - displacement[scene.links[:, 0]]
    return np.einsum("ij,ij->i", relative, scene.directions)


def tensions(scene, displacement):
    """Return the tension of each link by its law (N), equations (2), (4), (5)."""
    tau = scene.stiffness * (elongations(scene, displacement) + scene.prestrain)
    tau = np.where(scene.law == Law.CABLE, np.maximum(tau, 0.0), tau)
    return np.where(scene.law == Law.STRUT, np.minimum(tau, 0.0), tau)


def errors(scene, displacement, reference):
    """Compare two displacements as `latinpc.Links.errors` does.

    Returns
    -------
    l2, energy : float
        Relative; of the free components, and in the norm sum k e^2. Infinite when a value is not finite.
    """
    difference = np.where(scene.fixed, 0.0, displacement - reference)
    if not np.isfinite(difference).all():
        return np.inf, np.inf
    l2 = np.linalg.norm(difference), np.linalg.norm(np.where(scene.fixed, 0.0, reference))
    root = np.sqrt(scene.stiffness)
    energy = [np.linalg.norm(root * elongations(scene, field)) for field in (difference, reference)]
    return tuple(float(a / b) if b > 0 else float(a) for a, b in (l2, energy))
