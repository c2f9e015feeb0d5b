"""The constitutive laws of links, by number and by name."""

from __future__ import annotations

import difflib
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike

__all__ = ["RIGID", "UNILATERAL", "Law", "law_numbers"]


class Law(IntEnum):
    """Constitutive law of a link, eqs. (2) to (5); numbers are those of ``LatinLawType``.

    Larger numbers are the piecewise linear laws of a `Scene`, and the laws that the user registers.
    """

    BAR = 0  #: tau = k (e + e0)
    CABLE = 1  #: tau = k max(e + e0, 0)
    COMPRESSION_ONLY = 2  #: tau = k min(e + e0, 0); an elastic contact with gap e0
    INEXTENSIBLE = 3  #: 0 <= -(e + e0), tau >= 0, one of them zero
    CONTACT = 4  #: 0 <= e + e0, tau <= 0, one of them zero: a rigid contact with gap e0
    FRICTION = 5  #: the same with Coulomb friction: the normal part, before dim - 1 tangential ones
    TANGENT = 6  #: tangential part of the contact before it

    @property
    def plural(self) -> str:
        """Name of several links of the law."""
        names = {
            "COMPRESSION_ONLY": "compression-only links",
            "INEXTENSIBLE": "inextensible cables",
            "FRICTION": "contacts with friction",
        }
        return names.get(self.name, self.name.lower() + "s")

    @property
    def noun(self) -> str:
        """Name of one link of the law."""
        return "contact with friction" if self.name == "FRICTION" else self.plural.removesuffix("s")


#: Laws whose tension is no function of the elongation: their stiffness is a search parameter, 0: automatic.
RIGID = (Law.INEXTENSIBLE, Law.CONTACT, Law.FRICTION, Law.TANGENT)

#: Words of other programs for a cable, whose letters are those of compression_only.
PULLED = ("TENSION_ONLY", "NO_COMPRESSION")

#: Laws of links that may carry nothing.
UNILATERAL = (Law.CABLE, Law.COMPRESSION_ONLY, Law.INEXTENSIBLE, Law.CONTACT, Law.FRICTION)


def law_numbers(law: ArrayLike) -> np.ndarray:
    """Replace names of laws by their numbers; not collective.

    Parameters
    ----------
    law : array_like of str or int
        Names of `Law` in any case, such as ``"cable"`` or ``"compression_only"``. Numbers are returned as they are;
        both may be mixed.

    Returns
    -------
    array
        Of the same shape; of int where names were given.

    Raises
    ------
    ValueError
        For an unknown name; the message lists those that exist.

    Examples
    --------
    >>> law_numbers(["bar", "cable"])
    array([0, 1])
    """
    law = np.asarray(law)
    if law.dtype.kind == "O":  # a column of pandas
        law = law.astype(str)
    if law.dtype.kind != "U":
        return law
    names, index = np.unique(law, return_inverse=True)
    return np.array([_number(str(name)) for name in names], dtype=int)[index].reshape(law.shape)


def _number(name: str) -> int:
    key = name.strip().upper().replace("-", "_").replace(" ", "_")
    if key in Law.__members__:
        return Law[key]
    if key.isdecimal():  # numpy has made a text of a number beside names
        return int(key)
    near = ["CABLE"] if key in PULLED else difflib.get_close_matches(key, Law.__members__, n=1)
    known = ", ".join(law.name.lower() for law in Law)
    meant = f"do you mean {near[0].lower()!r}? " if near else ""
    raise ValueError(f"unknown law {name!r}: {meant}choose from {known}")
