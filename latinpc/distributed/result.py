"""What a solve of a distributed structure has found, each rank its own part."""

from __future__ import annotations

import pathlib
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from petsc4py import PETSc

from latinpc import solvers
from latinpc.arrays import alike
from latinpc.checks import ARRAYS
from latinpc.geometry import Geometry
from latinpc.laws import UNILATERAL
from latinpc.results.limit import bearing, borne, branches, moving, softest, unstable
from latinpc.results.loose import loose
from latinpc.results.mechanics import slack
from latinpc.results.notices import causes, changed, implausible, limit, magnitudes, strained, turned
from latinpc.results.plots import Plots
from latinpc.results.report import Reported, plain
from latinpc.results.result import Result
from latinpc.results.solve import idle, narrow, report_of
from latinpc.structure import Structure

from .vtk import write_pvtu

if TYPE_CHECKING:
    from .structure import LocalStructure

__all__ = ["LocalResult", "gather_local", "seen"]


@dataclass(repr=False, eq=False)
class LocalResult(Reported):
    """What a solve has found; arrays are of this rank's nodes and links, in the caller's order.

    Nothing here is collective but `reactions`, `part`, `to_vtu` and `gather`.
    """

    structure: LocalStructure  #: what was solved
    displacements: np.ndarray  #: (n, dim), of this rank's nodes, prescribed ones included (m)
    tensions: np.ndarray  #: (m,), of this rank's links, positive in tension (N)
    slack: np.ndarray  #: (m,) bool: cables, compression-only links and contacts that carry nothing
    load: np.ndarray  #: (n, dim), under which it was solved (N)
    report: dict[str, Any]  #: counts, errors and reasons of the whole, the same on every rank, fit for JSON
    subdomain: np.ndarray | None = None  #: (m,), subdomain of each link, among all
    node_class: np.ndarray | None = None  #: (n,), 0 interior, 1 strong, 2 weak interface, 3 corner
    mode: np.ndarray | None = None  #: (n, dim), how the structure moves on where no equilibrium follows; else None
    history: dict[str, np.ndarray] = field(default_factory=dict)  #: per iteration: indicator, errors, estimate
    notices: list[str] = field(default_factory=list)  #: sentences to read, the same on every rank

    def __post_init__(self):
        #: How displacements turned links, ``"linear"``, ``"prestress"`` or ``"large"``.
        self.geometry: str = self.structure.geometry
        self._acted = {name: getattr(self.structure, name) for name in ("prescribed", "initial_elongation")}

    def reactions(self) -> np.ndarray:
        """Return the forces of the supports on this rank's nodes (N), zero where nothing is fixed; collective.

        Returns
        -------
        (n, dim) array
        """
        return self.structure.halo.collect(self.part().reactions)

    def part(self) -> Result:
        """Return the links of this rank as a result by itself, with the nodes of other ranks there; collective.

        Returns
        -------
        latinpc.Result
            Its nodes are those of this rank, then those of `Halo.ghosts`, which have no loads. Its reactions are what
            links of this rank carry, its ``balance`` is that of all ranks, and collective.
        """
        structure, halo = self.structure, self.structure.halo
        arrays = self._arrays() | {"links": halo.links, "load": np.zeros((halo.own + len(halo.ghosts), structure.dim))}
        arrays["load"][: halo.own] = self.load
        nodal = [name for name in ("nodes", "fixed", "prescribed", "mass") if arrays[name] is not None]
        arrays |= {name: halo.spread(arrays[name]) for name in nodal}
        scene = _Arrays(structure.name, self.geometry, structure.sizes, structure.comm, arrays)
        scene.over_ranks = halo
        classes = None if self.node_class is None else halo.spread(self.node_class)
        displacements = halo.spread(self.displacements)
        found = Result(scene, displacements, self.tensions, scene.load, self.report, self.subdomain, classes)
        found.slack = self.slack  # beside the largest tension of all ranks
        return found

    def _arrays(self):
        """Return the arrays of this rank's nodes and links that were solved."""
        return {name: self._acted.get(name, getattr(self.structure, name)) for name in ARRAYS}

    def to_vtu(self, path: str | pathlib.Path) -> None:
        """Write the results for ParaView: an index ``.pvtu`` and a file of each rank beside it; collective."""
        write_pvtu(path, self)

    def gather(self, root: int | None = None) -> Result | None:
        """Bring the parts together; collective.

        Nodes are in the order of their numbers, links rank by rank.

        Parameters
        ----------
        root : int, optional
            The rank that gets the whole; every rank when not given.

        Returns
        -------
        latinpc.Result or None
            None on the other ranks. Its structure is no `latinpc.Structure`, and so it has no ``tangent`` and no
            ``modes``: of its arrays every rank can make one.
        """
        comm, structure = self.structure.comm.tompi4py(), self.structure
        alike(comm, root=root)
        if root is not None and root not in range(comm.size):
            raise ValueError(f"root {root} is none of the ranks 0 to {comm.size - 1}: without it all get the whole")
        arrays = {name: _whole(comm, values, root) for name, values in self._arrays().items()}
        names = ("displacements", "tensions", "load", "subdomain", "node_class", "mode")
        found = {name: _whole(comm, getattr(self, name), root) for name in names}
        if root not in (None, comm.rank):
            return None
        whole = _Arrays(structure.name, self.geometry, structure.sizes, structure.comm, arrays)
        return Result(whole, report=dict(self.report), history=self.history, notices=list(self.notices), **found)

    def __repr__(self) -> str:
        state = "converged" if self.converged else "not converged"
        return f"<LocalResult of {self.structure.name}: {state} in {self.iterations} iterations>"


class _Arrays(Geometry, Plots):
    """Arrays of several ranks."""

    laws = Structure.laws

    def __init__(self, name, geometry, sizes, comm, arrays):
        self.name, self.geometry, self.sizes, self.comm = name, geometry, sizes, comm
        self.__dict__.update(arrays)


def _whole(comm, mine, root):
    """Put the parts of an array one after the other, on one rank or on all; collective."""
    if mine is None:
        return None
    parts = comm.allgather(mine) if root is None else comm.gather(mine, root=root)
    return None if parts is None else np.concatenate(parts)


def gather_local(structure: LocalStructure, snes: PETSc.SNES, core: Any, u: PETSc.Vec) -> LocalResult:
    """Collect what a SNES has found on each rank; collective, after its solve.

    Parameters and report are those of `latinpc.results.solve.gather`.
    """
    factor = borne(snes, structure)
    with bearing(snes, structure, factor) as ends:
        return _gathered_local(structure, snes, core, u, factor, ends)


def _gathered_local(structure, snes, core, u, factor, ends):
    """Collect what a SNES has found under the loads that its displacements bear; collective."""
    comm = structure.comm.tompi4py()
    r = structure.create_vec()
    snes.computeFunction(u, r)
    tensions = solvers.tensions(snes)
    none = slack(structure, tensions, structure.halo.largest(np.abs(tensions).max(initial=0.0)))
    counts = structure.halo.total([none.sum(), np.isin(structure.law, UNILATERAL).sum()])
    mode, kind = softest(structure, u, tensions, factor == 0.0) if ends else (None, "soft")
    is_latin = snes.getType() == "latin"
    past = {key: np.array(values) for key, values in solvers.history(snes).items()} if is_latin else {}
    statistics = solvers.statistics(core) if core is not None else {}
    unbalance = np.linalg.norm(np.where(structure.fixed, 0.0, structure.displacements(r)), axis=1)
    here = (float(unbalance.max(initial=0.0)), structure.first_node + int(unbalance.argmax() if unbalance.size else 0))
    worst, node = max(comm.allgather(here))
    report = report_of(structure, snes, statistics, past, tuple(map(int, counts))) | {
        "residual_norm": r.norm(),
        "largest_unbalance": worst,
        "unbalanced_node": node,
    }
    result = LocalResult(
        structure=structure,
        displacements=structure.displacements(u),
        tensions=tensions,
        slack=none,
        load=structure.load,
        report=plain(report | ({} if factor is None else {"load_factor": factor})),
        subdomain=solvers.subdomain_of_links(core) if core is not None else structure.subdomain,
        node_class=solvers.node_classes(core) if core is not None else None,
        mode=mode,
        history=past,
    )
    said = comm.allgather([*causes(snes, structure, past), *narrow(core)])
    result.notices += dict.fromkeys(text for texts in said for text in texts)
    result.notices += idle(snes)
    result.notices += unstable(structure, u, none) if result.converged else []
    said = result.report | {"branch": branches(snes, factor)}
    nodes = [] if mode is None else moving(mode, structure.over_ranks)
    result.notices += limit(structure, said, nodes, kind)
    r.destroy()
    return result


def seen(result: LocalResult) -> list[str]:
    """Return what displacements and tensions show by themselves, where no solver takes memory any more; collective."""
    part = result.part()
    return [
        *implausible(part.structure),
        *loose(part),
        *(turned(part) or changed(part) or strained(part)),
        *magnitudes(part),
    ]
