"""Natural frequencies and linear buckling factors of a state, by SLEPc."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from mpi4py import MPI
from numpy.typing import ArrayLike
from petsc4py import PETSc

from latinpc import errors
from latinpc.arrays import Slices, alike, refuse, same_arrays
from latinpc.laws import RIGID
from latinpc.options import default_options, given_options

from .eigen import Eigenpairs, below, lowest, slepc, solved, solver
from .limit import moving, slackening
from .mechanics import slack, stretches
from .notices import SolveError, warn
from .unread import unread

if TYPE_CHECKING:
    from latinpc.structure import Structure

    from .result import Result

__all__ = ["Modes", "modes", "tangent"]

IDLE = 1e-10  # of the length of a link: what is shorter counts as no elongation
MECHANISM = 1e-12  # of its own diagonal: what is below is zero; rounding leaves some 1e-15
FLAT = 1e-6  # of the largest -1/mu of either sign: loads with smaller ones do not buckle a state
LOOSE = 1e-2  # relative tolerance of that largest one
EPS = np.finfo(float).eps  # of the largest eigenvalue: the same, that of nodes that nothing holds
NO_FACTOR = "no positive factor: multiples of these loads do not buckle the state"
INERTIA = {"modes_st_mat_mumps_icntl_24": 1}  # MUMPS counts negative pivots only so
_NAMED = 5


@dataclass(repr=False, eq=False)
class Modes:
    """Modes of a state, lowest first; arrays are whole, the same on every rank. Nothing here is collective."""

    structure: Structure  #: whose modes they are
    displacements: np.ndarray  #: (n, dim), the state (m)
    tensions: np.ndarray  #: (m,), at the state (N)
    buckling: bool  #: values are load factors, not squares of angular frequencies (1/s2)
    values: np.ndarray  #: (k,), eigenvalues, increasing
    shapes: np.ndarray  #: (k, n, dim), the largest displacement of a node is one
    mechanisms: np.ndarray  #: (k,) of bool: zero stiffness, as far as rounding shows
    residuals: np.ndarray  #: (k,), of the eigenproblem, relative to its matrices
    notices: list[str] = field(default_factory=list)  #: sentences to read
    complete: bool = True  #: all modes that there are, or that were asked for, have converged

    @property
    def frequencies(self) -> np.ndarray:
        """(k,) array: natural frequencies (Hz), zero of mechanisms.

        Negative where a state is unstable: minus the rate of growth (1/s) over 2 pi.

        Raises
        ------
        ValueError
            Of buckling modes.
        """
        if self.buckling:
            raise ValueError("buckling modes have factors, not frequencies")
        size = np.where(self.mechanisms, 0.0, self.values)
        return np.sign(size) * np.sqrt(np.abs(size)) / (2.0 * np.pi)

    @property
    def slack(self) -> np.ndarray:
        """(m,) array of bool: links that have no part in the stiffness.

        Cables and links in compression only that bear nothing at their natural length are taut.
        """
        return slack(self.structure, self.tensions) & ~self._idle()

    def _idle(self):
        """Return which links are neither taut nor slack, as far as rounding of lengths and coordinates shows."""
        s = self.structure
        strain = stretches(s, self.displacements) + s.initial_elongation
        same = IDLE * s.lengths + 4.0 * EPS * np.abs(s.nodes).max()
        return slack(s, self.tensions) & (np.abs(strain) <= same)

    @property
    def factors(self) -> np.ndarray:
        """(k,) array: what the loads are multiplied by where the tangent stiffness is singular.

        Raises
        ------
        ValueError
            Of vibration modes.
        """
        if not self.buckling:
            raise ValueError("modes of vibration have frequencies, not factors: take buckling=True")
        return self.values

    def movers(self, mode: int) -> list[int]:
        """Return the nodes that move most in a mode, at least half as far as the farthest."""
        return moving(self.shapes[mode])[:_NAMED].tolist()

    def label(self, mode: int) -> str:
        """Return the frequency or factor of a mode in words."""
        if self.buckling:
            return f"factor {self.values[mode]:.5g}"
        if self.mechanisms[mode]:
            return "0 Hz, mechanism"
        frequency = self.frequencies[mode]
        if frequency <= 0.0:
            return f"unstable, rate {-2.0 * np.pi * frequency:.3g} 1/s"
        return f"{frequency:#.5g}".rstrip(".") + " Hz"

    def plot(self, count: int | None = None) -> Any:
        """Draw the modes, at most nine, beside each other.

        Parameters
        ----------
        count : int, optional
            How many of the lowest.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from .modepictures import modes_figure

        return modes_figure(self, count)

    def animate(self, path: Any, mode: int = 0) -> None:
        """Write a period of a mode as a ``.gif``; call it on one rank."""
        from .modepictures import animate_mode

        animate_mode(self, path, mode)

    def to_dict(self) -> dict[str, Any]:
        """Return values, labels, residuals and notices, fit for JSON."""
        key = "factors" if self.buckling else "frequencies"
        return {
            "scene": self.structure.name,
            "kind": "buckling" if self.buckling else "vibration",
            key: getattr(self, key).tolist(),
            "mechanisms": self.mechanisms.tolist(),
            "nodes": [self.movers(mode) for mode in range(len(self.values))],
            "residuals": self.residuals.tolist(),
            "notices": list(self.notices),
        }

    def __len__(self) -> int:
        return len(self.values)

    def __repr__(self) -> str:
        kind = "buckling" if self.buckling else "vibration"
        lines = [f"{self.structure.name}: modes of {kind}"]
        for mode in range(len(self)):
            named = self.structure.some_nodes(self.movers(mode))
            lines.append(f"  {mode + 1:>3}  {self.label(mode):<28} most at {named}")
        return "\n".join(lines + [f"  notice: {text}" for text in self.notices])


def tangent(structure: Structure, displacements: ArrayLike) -> PETSc.Mat:
    """Make the tangent stiffness at a state; collective.

    Parameters
    ----------
    structure : Structure
        Without rigid laws.
    displacements : (n, dim) array_like of float
        Of all nodes (m).

    Returns
    -------
    petsc4py.PETSc.Mat
        K (N/m) of the free degrees of freedom, AIJ unless ``-dm_mat_type`` says otherwise. Where the geometry is
        ``"prestress"`` or ``"large"`` it has the geometric stiffness in it.
    """
    u = structure.create_vec()
    structure.set_displacements(displacements, u)
    K = structure.dm.createMat()
    structure.jacobian(u, K)
    u.destroy()
    return K


def modes(
    state: Result | Structure,
    number: int = 6,
    *,
    buckling: bool = False,
    load: ArrayLike | None = None,
    options: Mapping[str, Any] | None = None,
) -> Modes:
    """Compute natural frequencies, or linear buckling factors, at a state; collective.

    Frequencies: K v = omega^2 M v, K the tangent stiffness at the state and M the masses of the nodes. Slack links have
    no stiffness. Factors: (K + mu G) v = 0, G the geometric stiffness of the tensions that the loads add, linearised at
    the state: Delta tau = k_t n . K^-1 P.

    Parameters
    ----------
    state : Result or Structure
        What a solve has found; of a structure, the state as drawn, without loads.
    number : int
        How many modes, the lowest ones.
    buckling : bool
        Factors in place of frequencies. Only for the geometry ``"large"``.
    load : (n, dim) array_like of float, optional
        For buckling: forces (N) whose multiples are added to the state; the factors are mu. By default the loads of
        the result or structure, whose multiples as a whole are the factors: 1 + mu of a result, mu of the state as
        drawn.
    options : mapping, optional
        PETSc options by name, of the EPS of SLEPc, whose prefix is ``modes_``, as ``{"modes_eps_tol": 1e-12}``.

    Returns
    -------
    Modes
        Fewer than asked for where there are no more: without mass no degree of freedom vibrates, and a load that pulls
        has no positive factors.

    Warns
    -----
    latinpc.LatinWarning
        Of mechanisms, states that are not stable, modes that have not converged, links that slacken before the least
        factor.

    Raises
    ------
    ImportError
        Without SLEPc; the message says what to install.
    ValueError
        Without masses, or without loads; of a result whose structure has changed since, other than in loads and masses;
        of what no rank has whole, and of the arrays that were gathered from it.
    latinpc.SolveError
        For rigid links, and for the factors of a state that is not stable.
    """
    slepc()
    drawn = not hasattr(state, "structure")
    structure = state if drawn else state.structure
    if not isinstance(getattr(structure, "_slices", None), Slices):
        raise ValueError(
            "modes need a latinpc.Structure, whole on every rank, or its Result: make one by"
            " latinpc.Structure.from_scene(scene), or of the arrays of gather()"
        )
    comm = structure.comm.tompi4py()
    alike(comm, number=number, buckling=buckling, options=options)
    same_arrays(comm, load=None if load is None else np.asarray(load, dtype=float))
    if number < 1:
        raise ValueError(f"at least one mode is asked for, not {number}")
    if load is not None and not buckling:
        raise ValueError("load is for buckling: frequencies are those of the state, whose loads are its own")
    rigid = [law for law in RIGID if (structure.law == law).any()]
    if rigid:
        raise SolveError(
            f"modes need the tangent stiffness, which links of the rigid law {rigid[0].name.lower()} do not have: take"
            " cable or compression_only with a large stiffness"
        )
    displacements = np.array(structure.prescribed) if drawn else state.displacements
    given, problem = given_options(options), _Problem(structure, displacements)
    try:
        with contextlib.nullcontext() if drawn else state.as_solved(), default_options(given | INERTIA) as ours:
            if buckling:
                base = 0.0 if drawn or load is not None else 1.0
                forces = load if load is not None else structure.load if drawn else state.load
                found = _factors(problem, number, np.asarray(forces, dtype=float), base)
            else:
                found = _frequencies(problem, number)
            found.notices += _idle(found) + unread(structure.comm, [name for name in ours if name in given])
    except PETSc.Error as reported:
        raise SolveError(errors.error_message(reported), reported.ierr) from None
    finally:
        problem.destroy()
    for notice in found.notices:
        warn(structure.comm, notice)
    return found


class _Problem:
    """Tangent stiffness and state as PETSc's objects."""

    def __init__(self, structure, displacements):
        self.structure, self.displacements = structure, np.asarray(displacements)
        self.u = structure.create_vec()
        structure.set_displacements(self.displacements, self.u)
        self.K = None

    def stiffness(self):
        """Make K, once; collective."""
        if self.K is None:
            self.K = tangent(self.structure, self.displacements)
        return self.K

    def diagonal(self, values):
        """Return a diagonal matrix of nodal values (n, dim), and the vector; collective."""
        vector = self.structure.create_vec()
        self.structure.set_displacements(values, vector)
        sizes = vector.getSizes()
        M = PETSc.Mat().createAIJ((sizes, sizes), nnz=1, comm=self.structure.comm)
        M.setDiagonal(vector)
        M.assemble()
        return M, vector

    def modes(self, buckling, pairs, mechanisms):
        """Make `Modes` of eigenvalues and eigenvectors; collective."""
        structure, values = self.structure, np.array(pairs.values)
        order = np.argsort(values, kind="stable")
        shapes = np.zeros((len(values), *structure.nodes.shape))
        for row, index in enumerate(order):
            shape = np.where(structure.fixed, 0.0, structure.displacements(pairs.vectors[index]))
            size = np.linalg.norm(shape, axis=1)
            node = int(np.argmax(size > size.max() * (1.0 - 1e-6)))  # the first of those that move most
            sign = np.sign(shape[node][np.argmax(np.abs(shape[node]))]) or 1.0
            shapes[row] = sign * shape / (size[node] or 1.0)
        return Modes(
            structure, self.displacements, structure.tensions(self.u), buckling, values[order], shapes,
            mechanisms[order], np.array(pairs.residuals)[order], complete=not pairs.notices,
        )  # fmt: skip

    def destroy(self):
        """Free what PETSc holds; collective."""
        for thing in (self.u, self.K):
            if thing is not None:
                thing.destroy()


def _lowest(problem, number, mass, elsewhere=False):
    """Find the lowest eigenvalues of K v = lambda M v, and which of them are zero but for rounding; collective."""
    structure, K = problem.structure, problem.stiffness()
    M, masses = problem.diagonal(np.broadcast_to(np.asarray(mass, dtype=float)[:, None], structure.nodes.shape))
    moving = structure.comm.tompi4py().allreduce(int(np.count_nonzero(masses.array)))
    if not moving:
        raise ValueError("no node that is free has a mass: give mass, in kg (on the command line --node-mass)")
    diagonal = K.getDiagonal()
    diagonal.abs()
    ratio = np.divide(diagonal.array, masses.array, out=np.zeros(masses.getLocalSize()), where=masses.array > 0)
    largest = structure.comm.tompi4py().allreduce(float(ratio.max(initial=0.0)), op=MPI.MAX) or 1.0
    found = lowest(K, M, number, moving, largest, elsewhere=elsewhere)
    square, zero = diagonal.duplicate(), []
    for value, vector in zip(found.values, found.vectors):  # beside stiffer parts a soft mode is none of these
        square.pointwiseMult(vector, vector)
        own = diagonal.dot(square) / (masses.dot(square) or 1.0)
        zero.append(abs(value) <= max(MECHANISM * own, EPS * largest))
    for thing in (M, masses, diagonal, square):
        thing.destroy()
    return found, np.array(zero, dtype=bool)


def _frequencies(problem, number):
    """Modes of vibration; collective."""
    structure = problem.structure
    if structure.mass is None:
        raise ValueError("frequencies need masses: give mass, in kg (on the command line --node-mass)")
    pairs, zero = _lowest(problem, number, structure.mass, elsewhere=True)
    found = problem.modes(False, pairs, mechanisms=zero)
    found.notices = pairs.notices + _mechanisms(found)
    negative = max(pairs.negative, int(((found.values < 0.0) & ~found.mechanisms).sum()))
    if negative:
        modes = "1 mode has" if negative == 1 else f"{negative} modes have"
        found.notices.append(f"the state is not stable: {modes} a negative stiffness")
    return found


def _mechanisms(found):
    """Return a sentence on mechanisms, if there are any."""
    loose = np.flatnonzero(found.mechanisms)
    if not loose.size:
        return []
    nodes = sorted({node for mode in loose for node in found.movers(mode)})
    named = found.structure.some_nodes(nodes[: 2 * _NAMED], len(nodes) > 2 * _NAMED)
    cure = "" if found.structure.geometry != "linear" else "; prestress holds them with the geometry prestress or large"
    least = "at least " if loose.size == len(found.mechanisms) < np.count_nonzero(~found.structure.fixed) else ""
    return [f"{least}{loose.size} mechanism{'s' if loose.size > 1 else ''}, modes of no stiffness, at {named}{cure}"]


def _idle(found):
    """Return a sentence on links whose stiffness a change of length would add or take away, if there are any."""
    links = np.flatnonzero(found._idle())
    if not links.size:
        return []
    named = found.structure.some_links(links[:_NAMED], links.size > _NAMED)
    one = links.size == 1
    said = f"{named} {'bears' if one else 'bear'} nothing and {'is' if one else 'are'} neither taut nor slack"
    return [f"{said}: the stiffness is that of taut links, but for rounding; a prestress makes sure of it"]


def _factors(problem, number, load, base):
    """Modes of buckling; collective."""
    structure = problem.structure
    if structure.geometry != "large":
        raise ValueError(
            f"buckling needs links that turn, and the geometry is {structure.geometry}: take geometry='large'"
            " (-snes_latin_geometry large)"
        )
    if load.shape != structure.nodes.shape:
        raise ValueError(f"load must have the shape {structure.nodes.shape}, a row per node, not {load.shape}")
    refuse(~np.isfinite(load), "node", "has an entry of load that is not finite", load)
    if not load[~structure.fixed].any():
        raise ValueError("there are no loads for a factor to multiply: give load, in N")
    _refuse_unstable(problem)
    K, G = problem.stiffness(), structure.dm.createMat()
    f, moved = structure.create_vec(), structure.create_vec()
    structure.set_displacements(load, f)
    structure.geometric_stiffness(problem.u, np.zeros(len(structure.links)), G)
    eps = solver(G, K, 1, False)  # G v = nu K v, nu = -1/mu
    eps.setTolerances(tol=LOOSE)
    eps.setWhichEigenpairs(slepc().EPS.Which.LARGEST_MAGNITUDE)
    eps.setUp()
    eps.getST().getKSP().solve(f, moved)
    rates = structure.tension_rates(problem.u, moved)
    structure.geometric_stiffness(problem.u, rates, G)
    eps.setOperators(G, K)
    largest = max((abs(value) for value, *_ in solved(eps, 1)), default=0.0) or 1.0
    G.scale(1.0 / largest)  # then rounding of the many values that are zero is an absolute one
    eps.destroy()
    count = below(G, K, -FLAT)  # the others buckle under the reversed loads, or not at all
    pairs = lowest(G, K, number, count, 1.0, 2.0 * FLAT) if count else Eigenpairs([], [], [], 0, [NO_FACTOR])
    pairs.values = [base - 1.0 / (largest * value) for value in pairs.values]
    found = problem.modes(True, pairs, mechanisms=np.zeros(len(pairs.values), bool))
    found.complete = not (count and pairs.notices)
    found.notices = pairs.notices
    found.notices += slackening(found, rates, base)
    for thing in (G, f, moved):
        thing.destroy()
    return found


def _refuse_unstable(problem):
    """Refuse a state whose tangent stiffness is not positive definite; collective."""
    pairs, zero = _lowest(problem, 1, np.ones(len(problem.structure.nodes)))
    if not (zero.any() or pairs.negative or min(pairs.values) < 0.0):
        return
    found = problem.modes(False, pairs, mechanisms=zero)
    kind = "is a mechanism" if zero.any() else "is not stable"
    raise SolveError(
        f"no factors: the state {kind}, most at {found.structure.some_nodes(found.movers(0))}; solve for a stable"
        " one first",
        errors.MAT_CH_ZRPVT if zero.any() else 0,
    )
