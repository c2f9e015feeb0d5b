"""Make the laws of the links from what files and options say of their lines."""

from __future__ import annotations

import numpy as np

from latinpc.laws import RIGID, Law

from .description import number, one_of, vector

ONLY_FOR = {
    "gap": ("contact", "friction"),
    "coefficient": ("friction",),
    "normal": ("contact", "friction"),
    "table": ("table",),
}


def read_laws(lines, dim, assignments):
    """Return the arrays of the links for a Scene, and the line of each link.

    A contact with friction is one line and several links.

    Parameters
    ----------
    lines : Lines
    dim : int
    assignments : list of (str, array of int, dict)
        Place for messages, lines, and their law as in ``[laws.NAME]``; each line has one law.
    """
    points, length, ends = lines.points[:, :dim], lines.lengths, lines.ends
    law = np.full(len(ends), -1)
    stiffness, initial_elongation, friction = np.zeros(len(ends)), np.zeros(len(ends)), np.zeros(len(ends))
    direction, tables = np.zeros(points[ends[:, 0]].shape), []
    sections = {"area": np.full(len(ends), np.nan), "strength": np.full(len(ends), np.nan)}
    for where, chosen, entries in assignments:
        kinds = [kind.name.lower() for kind in Law if kind != Law.TANGENT] + ["table"]
        kind = entries.get("law")
        if kind not in kinds:
            said = "key 'law' is missing" if kind is None else f"unknown law {kind!r}"
            raise ValueError(f"{where}: {said}; use {', '.join(kinds)}")
        for key, laws in ONLY_FOR.items():
            if key in entries and kind not in laws:
                raise ValueError(f"{where}: {key} is of no use to the law {kind}, only to {' and '.join(laws)}")
        law[chosen] = len(Law) + len(tables) if kind == "table" else Law[kind.upper()]
        if kind == "table":
            tables.append(_table(entries, where))
        free = kind == "table" or Law[kind.upper()] in RIGID
        stiffness[chosen] = _stiffness(entries, length[chosen], where, free)
        initial_elongation[chosen] = _initial_elongation(entries, length[chosen], stiffness[chosen], where)
        for key in sections.keys() & entries.keys():
            sections[key][chosen] = number(entries[key], f"{where}: {key}", positive=True)
        if "strength" in entries and "area" not in entries:
            raise ValueError(f"{where}: strength is a stress (Pa), which needs the area (m2)")
        if kind == "friction":
            if "coefficient" not in entries:
                raise ValueError(f"{where}: the law friction needs its coefficient, such as 0.3")
            friction[chosen] = number(entries["coefficient"], f"{where}: coefficient")
            if friction[chosen[0]] < 0:
                raise ValueError(f"{where}: coefficient must not be negative, as {entries['coefficient']} is")
        if "normal" in entries:
            direction[chosen] = vector(entries["normal"], dim, f"{where}: normal")
            if not direction[chosen[0]].any():
                raise ValueError(f"{where}: normal has no length; leave it out for the direction of the line")
    arrays = _contacts(points, ends, law, stiffness, initial_elongation, direction, friction)
    known = {key: values[arrays["line"]] for key, values in sections.items() if not np.isnan(values).all()}
    return arrays | known | {"tables": tuple(tables)}


def _contacts(points, lines, law, stiffness, initial_elongation, direction, friction):
    """Add the tangential links of contacts with friction, at right angles to the normal."""
    dim = points.shape[1]
    rows = np.where(law == Law.FRICTION, dim, 1)
    line = np.repeat(np.arange(len(law)), rows)
    first = np.append(True, line[1:] != line[:-1])
    law, direction, friction = law[line], direction[line], friction[line]
    for link in np.flatnonzero((law == Law.FRICTION) & first):
        normal = direction[link]
        if not normal.any():
            normal = np.subtract(*points[lines[line[link]]][::-1])
        # the normal first, perhaps with the opposite sign
        frame = np.linalg.qr(np.column_stack([normal, np.eye(dim)]))[0].T
        direction[link : link + dim] = [normal, *frame[1:dim]]
        law[link + 1 : link + dim] = Law.TANGENT
    arrays = {
        "law": law,
        "stiffness": stiffness[line],
        "initial_elongation": np.where(first, initial_elongation[line], 0.0),
        "line": line,
    }
    if direction.any():
        arrays["direction"] = direction
    if (law == Law.FRICTION).any():
        arrays["friction"] = friction
    return arrays


def _table(entries, where):
    """Return elongations and tensions of a piecewise linear law."""
    table = entries.get("table")
    pairs = isinstance(table, list) and all(isinstance(pair, list) and len(pair) == 2 for pair in table)
    if not pairs or len(table) < 2:
        said = "missing, give it in [laws.GROUP] of the TOML file" if table is None else f"not {table!r}"
        raise ValueError(f"{where}: table must be a list of two or more pairs [e + e0 (m), tension (N)]; it is {said}")
    elongation, tension = np.array([vector(pair, 2, f"{where}: table") for pair in table]).T
    if (np.diff(elongation) <= 0).any() or (np.diff(tension) < 0).any() or tension[0] == tension[-1]:
        raise ValueError(f"{where}: the elongations of the table must increase, and the tensions must not decrease")
    return elongation, tension


def _stiffness(entries, length, where, free):
    key = one_of(entries, ("EA", "stiffness"), where)
    if key is None and free:
        return np.zeros(len(length))
    if free and key == "EA":
        raise ValueError(f"{where}: the law {entries['law']} takes no EA; leave it out, or give stiffness (N/m)")
    if key is None:
        raise ValueError(f"{where}: no stiffness; give EA (N) or stiffness (N/m)")
    automatic = free and entries[key] == 0
    value = number(entries[key], f"{where}: {key}", positive=not automatic)
    return value / length if key == "EA" else np.full(len(length), value)


def _initial_elongation(entries, length, stiffness, where):
    key = one_of(entries, ("initial_elongation", "strain", "prestress", "gap"), where)
    if key is None:
        return np.zeros(len(length))
    value = number(entries[key], f"{where}: {key}")
    if key == "prestress":
        if entries["law"] not in ("bar", "cable", "compression_only"):
            raise ValueError(f"{where}: the law {entries['law']} takes no prestress; give initial_elongation (m)")
        if value * {"bar": 0, "cable": -1, "compression_only": 1}[entries["law"]] > 0:
            raise ValueError(
                f"{where}: the law {entries['law']} bears no prestress of {value:g} N;"
                " give initial_elongation (m) for a link that is slack as drawn"
            )
        return value / stiffness
    return value * length if key == "strain" else value + 0 * length
