"""Structures of cables as they are built, drawn at random: bridges, roofs, and what guys or crossed cables brace."""

from __future__ import annotations

from dataclasses import replace

from .cablebridges import BRIDGES
from .cableroofs import ROOFS
from .guyed import GUYED
from .turning import grown, shaken

KINDS = {**BRIDGES, **ROOFS, **GUYED}
FAINT = 1e-6  # of the weights: loads that only draw them out of nothing
DRAWN = 0.3  # of the structures bear the loads that their tensions as drawn balance, or less


def structure(rng):
    """Make a structure and its loads, as those of `turning.structure`.

    Parameters
    ----------
    rng : numpy.random.Generator

    Returns
    -------
    topology : str
        One of `KINDS`.
    scene : Scene
    """
    name, factor = str(rng.choice(list(KINDS))), 0.0
    while factor < FAINT:
        scene = shaken(rng, KINDS[name](rng))
        factor = grown(rng, scene)
    if rng.random() < DRAWN:
        factor = min(factor, 1.0)
    return name, replace(scene, load=factor * scene.load)
