"""Print quantities with readable units."""

from __future__ import annotations

import numpy as np


def scaled(largest, unit):
    """Return (divisor, unit with prefix) that make `largest` readable, such as (1e3, 'kN')."""
    for divisor, prefix in ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n")):
        if largest >= divisor:
            return divisor, prefix + unit
    return 1.0, unit


def quantity(value, unit, digits=3):
    """Return a number with its unit, scaled to be readable, such as '12.3 kN'; '0 N' for zero."""
    if value is None or not np.isfinite(value):
        return "not known"
    divisor, scaled_unit = scaled(abs(value), unit) if abs(value) >= 1e-12 else (1.0, unit)
    return f"{value / divisor if abs(value) >= 1e-12 else 0.0:.{digits}g} {scaled_unit}"
