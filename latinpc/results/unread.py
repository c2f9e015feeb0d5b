"""Options that were given, and that nothing has read."""

from __future__ import annotations

from petsc4py import PETSc

from latinpc.library import _latin

__all__ = ["unread"]


def unread(comm: PETSc.Comm, names: list[str]) -> list[str]:
    """Return a sentence on options that no rank has read; collective.

    One that PETSc has given its new name is no longer there, and has been read.
    """
    there = PETSc.Options().getAll()
    read = comm.tompi4py().allgather([_latin.option_used(name) or name not in there for name in names])
    unread = [name for name, *used in zip(names, *read) if not any(used)]
    named = ", ".join(f"-{name}" for name in unread)
    return [f"no solver has read {named}: misspelt, or of no use to this solver"] if unread else []
