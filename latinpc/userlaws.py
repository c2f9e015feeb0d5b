"""Laws that the user registers: points of a curve, or functions in C."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from latinpc.arrays import REAL, native
from latinpc.laws import Law
from latinpc.library import _latin

__all__ = ["as_tables", "own_stiffness", "own_tensions", "register_law", "register_table", "registered"]


def register_table(elongation: ArrayLike, tension: ArrayLike, name: str = "table") -> int:
    """Make a piecewise linear law from points; not collective, in the same order on every rank.

    Parameters
    ----------
    elongation : (n,) array_like of float
        Increasing values of e + e0 (m), two or more.
    tension : (n,) array_like of float
        The tensions there (N), nowhere decreasing. The first and the last segment go on beyond the points.
    name : str, optional
        For messages.

    Returns
    -------
    int
        For the `law` of `Structure`; the same for the same points. A link of stiffness 0 has these tensions, one of
        another stiffness has them in proportion: the stiffness is the slope where the law is steepest or, where the
        tension is the same everywhere, this tension over the range of the elongations.

    Examples
    --------
    A bar that yields at 10 N in tension and in compression (loaded once: what yields comes back the same way):

    >>> import latinpc
    >>> yields = latinpc.register_table([-2e-3, -1e-3, 1e-3, 2e-3], [-10, -10, 10, 10])

    The cable of a counterweight of 500 N, whose tension does not depend on its length:

    >>> weighted = latinpc.register_table([0, 1], [500, 500])
    """
    x, tau = (native(np.asarray(values, dtype=REAL).ravel()) for values in (elongation, tension))
    if len(x) != len(tau):
        raise ValueError(f"a law needs as many tensions as elongations, not {len(tau)} for {len(x)}")
    law = _latin.register_table(name, x, tau)
    _points.setdefault(law, (x.copy(), tau.copy()))
    return law


_points = {}  # of registered tables


def as_tables(law: np.ndarray) -> tuple[np.ndarray, tuple[tuple[np.ndarray, np.ndarray], ...]]:
    """Return the laws of links as a scene has them, and its tables; not collective.

    Raises
    ------
    ValueError
        For laws of functions, which are no tables.
    """
    own = np.unique(law[law >= len(Law)])
    functions = [_latin.law_names()[number] for number in own if number not in _points]
    if functions:
        raise ValueError(
            f"a scene, and so load cases, cannot have the registered law {functions[0]!r}, which is of functions:"
            " take a table of its points, latinpc.register_table"
        )
    return np.where(law < len(Law), law, len(Law) + np.searchsorted(own, law)), tuple(_points[law] for law in own)


def registered(scene: Any) -> np.ndarray:
    """Return the laws of a scene, or of a structure, by the numbers of the library; not collective.

    Tables of a scene are registered.
    """
    tables = [register_table(*table) for table in getattr(scene, "tables", ())]
    return np.append(np.array(Law), tables).astype(int)[scene.law] if tables else scene.law


def own_tensions(law: np.ndarray, stiffness: np.ndarray, strain: np.ndarray) -> np.ndarray:
    """Return the tensions (N) of links of registered laws at strains e + e0 (m); not collective."""
    found = np.zeros(len(law))
    for number in np.unique(law):
        chosen = law == number
        found[chosen] = _latin.law_tensions(int(number), stiffness[chosen], strain[chosen])
    return found


def own_stiffness(law: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
    """Return the stiffnesses of links (N/m), that of the table where 0 stands for it; not collective."""
    for number in np.unique(law[(stiffness == 0.0) & (law >= len(Law))]):
        stiffness = np.where((law == number) & (stiffness == 0.0), _latin.law_stiffness(int(number)), stiffness)
    return stiffness


def register_law(
    name: str, tension: Any, tangent: Any, energy: Any, local: Any = None, context: int | None = None
) -> int:
    """Make a law of functions in C, which the iteration calls; not collective, in the same order on every rank.

    Parameters
    ----------
    name : str
        For messages.
    tension, tangent, energy : int or object
        Addresses of ``double f(double k, double x, void *context)`` with x = e + e0: the tension, nowhere decreasing
        and hardly steeper than k; an element of its generalised derivative; a potential of it. An address is an
        integer, a function of ctypes, or what has an attribute ``address``, as a cfunc of numba.
    local : int or object, optional
        Of ``double f(double k, double e0, double y, void *context)``: tau - k e where tau + k e = y and the law holds.
        By Newton's method when not given.
    context : int, optional
        Address handed on to the functions.

    Returns
    -------
    int
        For the `law` of `Structure`.

    Notes
    -----
    The functions must live as long as the structures that use them. A law in Python is wrapped by ctypes:
    ``ctypes.CFUNCTYPE(c_double, c_double, c_double, c_void_p)(lambda k, x, context: ...)``. It is called for each link
    in each iteration, which is slow: compile it by numba.cfunc, or give enough of its points to `register_table`.
    """
    if REAL.itemsize != 8:
        raise ValueError(f"a law of functions computes in double precision, this PETSc in {REAL}: take register_table")
    return _latin.register_law(
        name, *(_address(function) for function in (tension, tangent, energy, local)), context or 0
    )


def _address(function):
    if function is None or isinstance(function, int):
        return function or 0
    if hasattr(function, "address"):
        return function.address
    if isinstance(function, ctypes._CFuncPtr):
        return ctypes.cast(function, ctypes.c_void_p).value
    raise TypeError(
        f"a law is made of C functions, given by their addresses, not of {type(function).__name__}: wrap a function of "
        "Python by ctypes.CFUNCTYPE, or compile it by numba.cfunc"
    )
