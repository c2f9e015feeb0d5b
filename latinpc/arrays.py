"""Check the arrays of the caller, and distribute them over the ranks."""

import re
import zlib
from collections.abc import Mapping

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from latinpc.laws import Law

__all__ = [
    "REAL", "Parts", "Slices", "Solver", "agreed", "alike", "block", "communicator", "index_set", "integers",
    "native", "partition", "real", "refuse", "same_arrays", "shaped", "slices_of",
]  # fmt: skip

REAL = np.dtype(PETSc.RealType)
Solver = PETSc.SNES | PETSc.KSP | PETSc.PC  #: what may be of type latin and has subdomains
_MAX_NAMED = 5
_PLURAL = {"has": "have", "joins": "join", "needs": "need"}  # verbs of `refuse`


class Slices:
    """Which nodes and links of the caller's arrays this rank has handed to the library.

    Both go in consecutive blocks, so that the library counts them as the caller does.
    """

    def __init__(self, comm, nodes, law):
        self.comm = comm.tompi4py()
        self.nodes = nodes
        self.links = len(law)
        self.node_start, self.node_end = self._block(nodes)
        starts = np.r_[0, 1 + np.flatnonzero(law[1:] != Law.TANGENT), self.links]  # a contact stays on one rank
        self.my_links = range(*starts[np.searchsorted(starts, self._block(self.links))])

    def mine(self, values):
        """Return this rank's rows of an array over the links."""
        return values[self.my_links.start : self.my_links.stop]

    def _block(self, n):
        return block(n, self.comm.rank, self.comm.size)

    def gather_nodes(self, mine):
        """Assemble an array over nodes or links; collective."""
        return np.concatenate(self.comm.allgather(mine), axis=0)

    gather_links = gather_nodes

    def partition(self, name, values):
        """Make an array of the subdomains of this rank's links from that of all."""
        values = agreed(self.comm, partition, name, values, self.links)
        same_arrays(self.comm, **{name: values})
        return self.mine(values)


class Parts:
    """Nodes and links of which each rank has given its own: arrays of results are those of this rank."""

    def __init__(self, comm, nodes, links):
        self.comm = comm.tompi4py()
        self.nodes, self.links = PETSc.DETERMINE, links
        self.node_start, self.node_end = 0, nodes
        self.my_links = range(links)

    def gather_nodes(self, mine):
        """Leave a nodal array where it is; not collective."""
        return mine

    gather_links = mine = gather_nodes

    def partition(self, name, values):
        """Make an array of the subdomains of this rank's links; the library checks the rest."""
        return agreed(self.comm, shaped, name, integers(name, values), (self.links,), np.int64, "a value per link")


def communicator(comm):
    """Make a petsc4py communicator of what the caller has, the default one of None."""
    if comm is None:
        comm = PETSc.Sys.getDefaultComm()
    return comm if isinstance(comm, PETSc.Comm) else PETSc.Comm(comm)


def block(n, rank, size):
    """Return the first and the last but one of n entries that a rank has, as PetscSplitOwnership splits them."""
    return tuple(n // size * r + min(r, n % size) for r in (rank, rank + 1))


def agreed(comm, function, *arguments):
    """Call a function on each rank; what it refuses on one is an error on all; collective."""
    error, value = None, None
    try:
        value = function(*arguments)
    except (ValueError, TypeError) as refused:
        error = refused
    first = comm.allreduce(comm.size if error is None else comm.rank, op=MPI.MIN)
    if first == comm.size:
        return value
    said = comm.bcast(str(error), root=first)
    if comm.allreduce(error is not None and str(error) == said, op=MPI.LAND):
        raise error
    raise ValueError(f"rank {first}: {said}") from error


def alike(comm, **arguments):
    """Refuse arguments that are not the same on every rank, whose calls would wait for each other; collective."""
    if comm.size == 1:
        return
    mine = {name: _words(value) for name, value in arguments.items()}
    if comm.allreduce(mine == comm.bcast(mine), op=MPI.LAND):
        return
    said = comm.allgather(mine)
    name = next(name for one in said for name in one if any(one[name] != other.get(name) for other in said))
    first, *others = (one.get(name, "not given") for one in said)
    rank, other = next((rank, text) for rank, text in enumerate(others, 1) if text != first)
    raise ValueError(f"ranks differ in {name}: {first} on rank 0, {other} on rank {rank}; give every rank the same")


def same_arrays(comm, **arrays):
    """Refuse arrays that are not the same on every rank, of which each would take its part; collective."""
    if comm.size > 1:
        known = {name: np.ascontiguousarray(values) for name, values in arrays.items() if values is not None}
        alike(comm, **{name: f"shape {v.shape}, checksum {zlib.crc32(v.data):x}" for name, v in known.items()})


def _words(value):
    """Return an argument as text, a mapping in an order of its own."""
    return repr(dict(sorted(value.items(), key=str)) if isinstance(value, Mapping) else value)


def index_set(comm, numbers):
    """Make an IS of the numbers of this rank; where one rank fails, as without memory, all do; collective."""
    found, code = PETSc.IS(), 0
    try:
        found.createGeneral(native(numbers, PETSc.IntType), comm=PETSc.COMM_SELF)  # no rank waits for another
    except PETSc.Error as error:
        code = error.ierr
    code = comm.allreduce(code, op=MPI.MAX)
    if code:
        raise PETSc.Error(code)
    return found


def native(values, dtype=REAL):
    """Make an array that C reads as it is."""
    return np.require(values, dtype=dtype, requirements=["C", "A"])


def _array(name, values):
    """Make an array of what has its shape."""
    if np.ma.is_masked(values):
        raise ValueError(f"{name} has masked entries, which have no value: fill them")
    try:
        return np.asarray(values)
    except ValueError:
        raise ValueError(f"{name} must be an array: its rows are not of one length") from None


def real(name, values, dtype):
    """Make an array; numpy itself drops imaginary parts."""
    values = _array(name, values)
    if np.iscomplexobj(values):
        raise ValueError(f"{name} must be real numbers, not complex ones")
    try:
        return values.astype(dtype, copy=False)
    except (ValueError, TypeError) as error:
        raise ValueError(f"{name} must be numbers: {error}") from None


def integers(name, values):
    """Make an array of integers of numbers that are such, whatever their type."""
    values = _array(name, values)
    if np.iscomplexobj(values):
        raise ValueError(f"{name} must be integers, not complex numbers")
    if values.dtype.kind not in "buif":
        raise ValueError(f"{name} must be integers, not {values.dtype}")
    if not np.issubdtype(values.dtype, np.integer):
        if values.size and not (values == np.floor(values)).all():
            raise ValueError(f"{name} must be integers, not {values.dtype}")
        values = values.astype(np.int64)
    return values


def shaped(name, values, shape, dtype, meaning):
    """Make an array of a shape, of one for all or of what has it already."""
    values = real(name, values, dtype)
    if values.ndim and values.shape != shape:
        raise ValueError(f"{name} must have the shape {shape}, {meaning}, not {values.shape}")
    return np.broadcast_to(values, shape)


def partition(name, values, links):
    """Make an array of the subdomain of each link, numbered from 0 without gaps."""
    values = shaped(name, integers(name, values), (links,), np.int64, "a value per link")
    refuse(values < 0, "link", "has a negative subdomain", values)
    count = int(values.max()) + 1
    if count > links:
        raise ValueError(f"{count} subdomains for {links} links: at most one a link")
    empty = np.flatnonzero(np.bincount(values, minlength=count) == 0)
    if empty.size:
        raise ValueError(f"subdomain {empty[0]} has no link; subdomains are numbered from 0 without gaps")
    return values


def refuse(wrong, what, why, values):
    """Raise a ValueError that names the first culprits, rows of which any entry is wrong.

    Parameters
    ----------
    wrong : array of bool
    what : str
        A link or a node, in the singular.
    why : str
        A verb of `_PLURAL` in the singular, and what follows.
    values : array
        Of each culprit.
    """
    if not wrong.any():
        return
    culprits = np.flatnonzero(wrong if wrong.ndim == 1 else wrong.any(axis=1))
    named = ", ".join(f"{i} ({np.array2string(values[i])})" for i in culprits[:_MAX_NAMED])
    more = f" and {culprits.size - _MAX_NAMED} more" if culprits.size > _MAX_NAMED else ""
    if culprits.size > 1:
        verb, _, rest = why.partition(" ")
        rest = re.sub(r"\bits\b", "their", rest)
        what, why = f"{what}s", f"{_PLURAL[verb]} {rest}"
    raise ValueError(f"{what} {named}{more} {why}")


def slices_of(solver):
    """Find the caller's numbering, where the C library finds the structure: solver, its DM, that of its matrix."""
    if not isinstance(solver, (PETSc.SNES, PETSc.KSP, PETSc.PC, PETSc.TS)):
        raise TypeError(
            f"expected a petsc4py solver, got {type(solver).__name__}; results of solve() are its attributes"
        )
    places = [solver, solver.getDM()]
    if isinstance(solver, (PETSc.KSP, PETSc.PC)):
        matrix = solver.getOperators()[1]
        places += [matrix.getDM()] if matrix else []
    for place in places:
        slices = place.getAttr("latinpc_slices") if place else None
        if slices is not None:
            return slices
    raise ValueError("the solver works on a matrix, not on links: attach a latinpc.Structure to it first")
