"""Lowest eigenvalues of symmetric matrices by SLEPc, and a count that proves that none of them is missing.

The Krylov space of a start vector holds one vector of each eigenspace: repeated eigenvalues are found by rounding, or
not at all. The factor of A - sigma B has as many negative pivots as there are eigenvalues below sigma (Sylvester).
Where more lie below the largest that was found, the space of those found is deflated, and the others follow.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from petsc4py import PETSc

from latinpc import solvers

from .notices import SolveError

SHIFT = 1e-10  # of the largest eigenvalue: shift below zero, so that mechanisms leave a regular matrix
LOWEST = 1e3  # of the largest eigenvalue: what is below minus that is of no mass
SAME = (1e-10, 1e-6)  # of the distance to the target: eigenvalues that count as one; where they are less accurate
ROUNDING = 1e-12  # of the largest eigenvalue: the same where these are less accurate
NOISE = 1e-14  # of it: values that differ by more are not known to be one
INSTALL = (
    "modes need SLEPc with slepc4py: with Debian's PETSc apt install python3-slepc4py libslepc-real-dev; with another"
    " one, and PETSC_DIR and PETSC_ARCH set, pip install slepc slepc4py of the same version as PETSc"
)
UNPROVED = "whether modes are missing between these is not known, as they were not counted:"
ALIKE = f"{UNPROVED} they are alike to rounding"


@dataclass
class Eigenpairs:
    """What `lowest` finds."""

    values: list[float]
    vectors: list[PETSc.Vec]
    residuals: list[float]  #: relative to the matrices
    negative: int  #: eigenvalues below zero, but for those that a shift hides
    notices: list[str]  #: sentences on eigenvalues that are missing; none where all that were asked for are proved


def slepc():
    """Return SLEPc, or say what to install. That of another PETSc is not loaded: two of these in one process crash."""
    try:
        import slepc4py

        ours = ".".join(map(str, PETSc.Sys.getVersion()[:2]))
        if slepc4py.__version__.split(".")[:2] != ours.split("."):
            raise ImportError(f"slepc4py {slepc4py.__version__} is there, PETSc is {ours}")
        from slepc4py import SLEPc
    except ImportError as error:
        raise ImportError(f"{INSTALL} ({error})") from error
    return SLEPc


def solver(A, B, number, sinvert):
    """Make an EPS for symmetric A v = lambda B v, B positive, with a direct factor unless options say otherwise."""
    SLEPc = slepc()
    eps = SLEPc.EPS().create(A.getComm())
    eps.setOptionsPrefix("modes_")
    eps.setOperators(A, B)
    eps.setProblemType(SLEPc.EPS.ProblemType.GHEP)
    eps.setDimensions(number)
    st = eps.getST()
    st.setType("sinvert" if sinvert else "shift")
    ksp = st.getKSP()
    ksp.setType("preonly")
    solvers.symmetric_factor(ksp.getPC())
    return eps


def solved(eps, wanted):
    """Solve; return (value, vector, residual) of each eigenvalue that converged, most `wanted` of them; collective."""
    SLEPc = slepc()
    eps.solve()
    pairs, (A, B) = [], eps.getOperators()
    for i in range(min(eps.getConverged(), wanted)):
        vector, image = A.createVecs()
        value = eps.getEigenpair(i, vector).real
        A.mult(vector, image)
        energy = image.dot(vector)
        B.mult(vector, image)
        weight = image.dot(vector)  # beside mechanisms Rayleigh's quotient has twice the digits
        residual = eps.computeError(i, SLEPc.EPS.ErrorType.BACKWARD)  # also of values that are zero
        pairs.append((energy / weight if weight > 0.0 else value, vector, float(np.nan_to_num(residual))))  # all slack
        image.destroy()
    if not np.isfinite([value for value, *_ in pairs]).all():
        raise SolveError("no modes: the matrix is singular beyond what a shift cures; a node without mass is not held")
    return pairs


def below(A, B, value):
    """Count the eigenvalues of A v = lambda B v below a value, by the inertia of a factor; collective.

    Where B is singular, negative eigenvalues of A where it is zero count as well.
    """
    shifted = A.copy()
    shifted.axpy(-value, B, PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
    count = solvers.negative_pivots(shifted, "modes_st_")
    shifted.destroy()
    return count


def _below_target(eps, target):
    """Count as `below`, by the factor of the EPS itself if it is one at the target; collective."""
    eps.setUp()
    st, pc = eps.getST(), eps.getST().getKSP().getPC()
    direct = pc.getType() == "cholesky" and pc.getFactorSolverType() in ("mumps", "petsc")
    if direct and st.getType() == "sinvert" and st.getShift() == target:
        return pc.getFactorMatrix().getInertia()[0]
    return below(*eps.getOperators(), target)


def lowest(A, B, number, there, size, edge=None, elsewhere=False):
    """Find the lowest eigenvalues of A v = lambda B v; collective.

    Parameters
    ----------
    A, B : petsc4py.PETSc.Mat
        Symmetric, B positive semidefinite.
    number, there : int
        How many, and how many there are.
    size : float
        Of the largest eigenvalue, roughly: rounding is relative to it.
    edge : float, optional
        Eigenvalues above -edge are next to zero; of rounding when not given.
    elsewhere : bool
        Options may choose another target, of which the nearest are found.

    Returns
    -------
    Eigenpairs
    """
    number, start = min(number, there), -SHIFT * size if edge is None else -edge
    eps = solver(A, B, number, True)
    eps.setTarget(start)
    eps.setWhichEigenpairs(slepc().EPS.Which.TARGET_MAGNITUDE)
    eps.setFromOptions()
    ours = not elsewhere or eps.getTarget() == start
    hidden = negative = _below_target(eps, start)
    target, reach = start, start
    while hidden and reach > -LOWEST * size:
        reach *= 10.0
        count = below(A, B, reach)
        if count < hidden:
            target, hidden = reach, count
    if ours:  # negative ones, then those that are next to zero, of which a target far away tells nothing apart
        pairs = _grown(eps, [], target, min(number, negative - hidden))
        pairs = _grown(eps, pairs, start, number)
    else:
        target = eps.getTarget()
        pairs = _grown(eps, [], target, number)
    notices = [f"{len(pairs)} of {number} modes have converged: raise -modes_eps_max_it or -modes_eps_ncv"]
    if len(pairs) == there:
        notices = []
    elif len(pairs) == number:
        low = hidden if ours else None
        pairs, notices = _completed(eps, pairs, lambda value: abs(value - target), target, low, there, size)
    eps.destroy()
    values, vectors, residuals = map(list, zip(*pairs)) if pairs else ([], [], [])
    return Eigenpairs(values, vectors, residuals, negative, notices)


def _completed(eps, pairs, away, target, low, there, size):
    """Return the pairs nearest to the target, with those that the first solve has missed; collective.

    Parameters
    ----------
    eps : slepc4py.SLEPc.EPS
        After its solve.
    pairs : list
        Of `solved`.
    away : callable
        Distance of a value from the target.
    target : float
    low : int or None
        How many negative pivots there are at the target, where no eigenvalue is below it.
    there : int
        How many eigenvalues there are.
    size : float
        Of the largest of them.

    Returns
    -------
    tuple
        As many pairs, and a sentence on what is missing, in a list.
    """
    number, (A, B) = len(pairs), eps.getOperators()
    if eps.getWhichEigenpairs() != slepc().EPS.Which.TARGET_MAGNITUDE:
        return pairs, [f"{UNPROVED} options of SLEPc ask for others than the lowest ones"]
    coarse = False  # at first what a light stiff node rounds does not hide the gaps between soft modes
    while True:
        pairs = sorted(pairs, key=lambda pair: away(pair[0]))[:number]
        far = away(pairs[-1][0])
        same = max(SAME[coarse] * far, ROUNDING * size if coarse else 0.0)
        radius = _radius([away(value) for value, *_ in pairs], same)
        inside = sum(away(value) < radius for value, *_ in pairs)
        proved = [] if far - same - radius <= max(SAME[1] * far, NOISE * size) else [ALIKE]
        if radius <= 0.0:
            return pairs, proved
        count = below(A, B, target + radius) - (below(A, B, target - radius) if low is None else low)
        if count == inside:
            return pairs, proved
        more, missing = [], min(count - inside, there - number)
        if missing > 0:
            more = [pair for pair in _grown(eps, pairs, target, number + missing)[number:] if away(pair[0]) < radius]
        if not more and coarse:
            lost = f"{count - inside} mode{'s are' if count - inside > 1 else ' is'} missing between these: lower"
            return pairs, [f"{lost} -modes_eps_tol" if missing > 0 else ALIKE]
        coarse = not more
        pairs += more


def _grown(eps, pairs, target, number):
    """Return the pairs with others next to a target, so many in all, or fewer that converge; collective."""
    while len(pairs) < number:  # a value that is repeated more often than the space is large ends a solve
        if pairs:
            eps.setDeflationSpace([vector for _, vector, _ in pairs])
        eps.setDimensions(number - len(pairs))
        eps.setFromOptions()  # the other dimensions anew
        eps.setTarget(target)
        more = solved(eps, number - len(pairs))
        pairs = pairs + more
        if not more:
            break
    return pairs


def _radius(distances, same):
    """Return a distance just short of the largest of increasing distances, and of those that are alike."""
    k = len(distances) - 1
    while k > 0 and distances[k] - distances[k - 1] <= 2.0 * same:
        k -= 1
    return distances[k] - same
