"""Print quantities with readable units, and counts with their nouns."""

from __future__ import annotations

import numpy as np

ALIKE = 1e-4  # of the largest value: the error of a solve by default; values that are nearer than that are alike
_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))


def scaled(largest, unit, digits=3):
    """Return (divisor, unit with prefix) that make `largest` readable, such as (1e3, 'kN'), printed with `digits`."""
    shown = float(f"{largest:.{digits}g}")  # 999.7 N are 1 kN, not 1e+03 N
    for divisor, prefix in _PREFIXES:
        if shown >= divisor:
            return divisor, prefix + unit
    return 1.0, unit


def first_largest(values):
    """Return the place of the largest value in an array, NaN left out: the first one of those alike.

    Which of these is the largest, as of the links of a symmetric structure, is a matter of rounding, and so of ranks.
    """
    return int(np.argmax(values >= np.nanmax(values) - ALIKE * np.nanmax(np.abs(values))))


def quantity(value, unit, digits=3):
    """Return a number with its unit, scaled to be readable, such as '12.3 kN'; '0 N' for zero."""
    if value is None or not np.isfinite(value):
        return "not known"
    divisor, scaled_unit = scaled(abs(value), unit, digits) if abs(value) >= 1e-12 else (1.0, unit)
    return f"{value / divisor if abs(value) >= 1e-12 else 0.0:.{digits}g} {scaled_unit}"


def counted(number, noun, plural=None):
    """Return a number with its noun, such as '1 subdomain' or '2,500 subdomains'."""
    return f"{number:,} {noun if number == 1 else plural or noun + 's'}"


def number(value, digits=3):
    """Return a number with so many digits and no exponent, such as '123,000' or '0.00012'."""
    rounded = float(f"{value:.{digits}g}")
    return f"{rounded:,.0f}" if rounded == int(rounded) else np.format_float_positional(rounded, trim="-")


def share(part):
    """Return a part of a whole in per cent, with two digits; 'less than 0.0001 %' where nobody would count them."""
    if part == 0.0:
        return "0 %"
    return f"{number(100.0 * part, 2)} %" if part >= 1e-6 else "less than 0.0001 %"
