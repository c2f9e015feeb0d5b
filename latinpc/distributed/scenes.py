"""Ready-made structures that each rank makes its own part of, from numbers."""

from __future__ import annotations

from typing import Any

from latinpc.arrays import alike, communicator
from latinpc.scenes.tensegrity_grid import grid_part

from .structure import LocalStructure

__all__ = ["PARTS", "local_scene"]

#: Scenes that can be made in parts
PARTS = {"tensegrity-grid": grid_part, "truss-grid": grid_part}


def local_scene(name: str, comm: Any = None, **options: Any) -> LocalStructure:
    """Make a scene of `latinpc.scenes`, each rank its own nodes and links; collective.

    Parameters
    ----------
    name : {"tensegrity-grid", "truss-grid"}
        The loads of the others follow from a solve of the whole.
    comm : petsc4py or mpi4py communicator, optional
        PETSc's default communicator when not given.
    **options
        Of the scene, the same on every rank.

    Returns
    -------
    LocalStructure
        Its nodes have the numbers of the whole scene; its links lie in blocks of subdomains.
    """
    comm = communicator(comm)
    alike(comm.tompi4py(), name=name, **options)
    if name not in PARTS:
        raise ValueError(f"scene {name!r} is not made in parts: choose from {', '.join(PARTS)}")
    arrays, _ = PARTS[name](name, **options, rank=comm.rank, ranks=comm.size)
    return LocalStructure(**arrays, comm=comm, name=name)
