"""Ready-made structures: one generator a file, numpy only, deterministic."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from numbers import Integral, Real

from .arch import arch
from .bridge import bridge
from .case import Case
from .chain import chain
from .hung_truss import hung_truss
from .hypar import hypar
from .impact import bouncing_chain, impact_grid, impact_tower
from .lattice import lattice
from .mast import mast
from .net import net
from .network import network
from .packing import packing
from .saddle import saddle
from .scene import Law, Scene
from .tensegrity_grid import tensegrity_grid, truss_grid
from .tower import tower

#: Generators by name, in the order in which they are listed.
SCENES: dict[str, Callable[..., Scene]] = {
    "tensegrity-grid": tensegrity_grid,
    "truss-grid": truss_grid,
    "network": network,
    "lattice": lattice,
    "hung-truss": hung_truss,
    "chain": chain,
    "net": net,
    "arch": arch,
    "packing": packing,
    "saddle": saddle,
    "hypar": hypar,
    "mast": mast,
    "tower": tower,
    "bridge": bridge,
    "impact-grid": impact_grid,
    "impact-tower": impact_tower,
    "bouncing-chain": bouncing_chain,
}


#: What options of scenes take: the name of a type -> numbers or texts, and their words
KINDS = {"int": (Integral, "a whole number"), "float": (Real, "a number"), "str": (str, "a text")}


def make(name: str, **options) -> Scene:
    """Make the scene of that name.

    Parameters
    ----------
    name : str
        A key of `SCENES`.
    **options
        Keyword arguments of the generator.

    Raises
    ------
    ValueError
        For an unknown scene, an unknown option, or a value that the generator refuses.
    """
    if name not in SCENES:
        raise ValueError(f"unknown scene {name!r}: choose from {', '.join(SCENES)}")
    known = inspect.signature(SCENES[name]).parameters
    unknown = [option for option in options if option not in known]
    if unknown:
        raise ValueError(f"scene {name!r} has no option {unknown[0]!r}: choose from {', '.join(known)}")
    for option, value in options.items():
        kind, *others = str(known[option].annotation).split(" | ")
        if kind in KINDS and not isinstance(value, KINDS[kind][0]) and not (value is None and "None" in others):
            raise ValueError(f"scene {name!r}: {option} must be {KINDS[kind][1]}, not {value!r}")
    return SCENES[name](**options)


__all__ = [
    "SCENES",
    "Case",
    "Law",
    "Scene",
    "arch",
    "bouncing_chain",
    "bridge",
    "chain",
    "hung_truss",
    "hypar",
    "impact_grid",
    "impact_tower",
    "lattice",
    "make",
    "mast",
    "net",
    "network",
    "packing",
    "saddle",
    "tensegrity_grid",
    "tower",
    "truss_grid",
]
