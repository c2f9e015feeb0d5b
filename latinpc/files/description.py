"""Read the TOML file beside a structure's: supports, loads, masses and velocities.

`latinpc.files.reading` describes the format.
"""

from __future__ import annotations

import re
import sys
import tomllib
from numbers import Real

import numpy as np

from .selection import AXES, select
from .text import lookalike, nearest, points, read_text

LAW_KEYS = (
    "law", "EA", "stiffness", "initial_elongation", "strain", "prestress", "gap", "coefficient", "normal", "table",
    "area", "strength",
)  # fmt: skip
SUPPORT_KEYS = ("fix", "displacement", "box", "where")
LOAD_KEYS = ("force", "line", "lines", "box", "where")
MASS_KEYS = ("mass", "line", "lines", "box", "where")
VELOCITY_KEYS = ("velocity", "box", "where")
TOP_KEYS = ("title", "dim", "geometry", "laws", "supports", "loads", "masses", "velocities", "case")


def place(description, table, group):
    """Return the place of a table in the file, for messages; what options have made bears their words."""
    return group if group.startswith("--") else f"{description}: [{table}.{group}]"


def read_description(description):
    """Read the TOML file; refuse unknown keys."""
    text = read_text(description)
    try:
        settings = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # TOMLDecodeError is a ValueError, as are numbers too long to read
        at = re.search(r"at line (\d+)", str(error))
        line = text.split("\n")[int(at[1]) - 1] if at else ""
        raise ValueError(f"{description}: not a TOML file: {error}{lookalike(line)}{points(line)}") from None
    tables = {"laws": LAW_KEYS, "supports": SUPPORT_KEYS, "loads": LOAD_KEYS}
    check_keys(settings, TOP_KEYS, tables | {"masses": MASS_KEYS, "velocities": VELOCITY_KEYS}, f"{description}: ", "")
    return settings


def check_keys(settings, keys, tables, where, prefix):
    """Refuse keys that are not known, and those of tables, of which there is one a group.

    Parameters
    ----------
    settings : dict
    keys : sequence of str
    tables : dict of str to tuple of str
        Of the keys that are tables, the keys of each group.
    where, prefix : str
        What messages open with; what stands before the names of tables in the file.
    """
    for key, value in settings.items():
        if key not in keys:
            raise ValueError(f"{where}unknown key '{key}'{nearest(key, keys, 0.7)}")
        if key not in tables:
            continue
        for group, entries in value.items() if isinstance(value, dict) else [(key, None)]:
            if not isinstance(entries, dict):
                raise ValueError(f"{where}[{prefix}{key}] needs one table a group, written [{prefix}{key}.NAME]")
            for entry in entries:
                if entry not in tables[key]:
                    hint = nearest(entry, tables[key], 0.7)
                    raise ValueError(f"{where}[{prefix}{key}.{group}]: unknown key '{entry}'{hint}")


def number(value, where, positive=False):
    """Return a finite number of the file, or raise with its place."""
    if isinstance(value, bool) or not isinstance(value, Real) or not abs(value) <= sys.float_info.max:
        raise ValueError(f"{where} must be a finite number, not {value!r}")
    if positive and value <= 0:
        raise ValueError(f"{where} must be positive, not {value!r}")
    return float(value)


def vector(value, dim, where):
    """Return a list of numbers of the file as an array (dim,), or raise with its place."""
    if not isinstance(value, list) or len(value) != dim:
        more = _more_axes(len(value), dim) if isinstance(value, list) else ""
        raise ValueError(f"{where} must be a list of {dim} number{'s' * (dim > 1)}, not {value!r}{more}")
    return np.array([number(item, where) for item in value])


def _more_axes(needed, dim):
    """Return what a message adds where a file names more axes than the structure has."""
    lies = f"; the structure lies in {', '.join(AXES[:dim])}, unless dim = {needed} stands at the top of the TOML file"
    return lies if dim < needed <= len(AXES) else ""


def one_of(entries, keys, where):
    """Return the one key that is given, None without any."""
    given = [key for key in keys if key in entries]
    if len(given) > 1:
        raise ValueError(f"{where}: give only one of {', '.join(given)}")
    return given[0] if given else None


def nodes_of(group, entries, nodes, node_groups, where):
    """Return the nodes of a group, those in a box, or those where conditions hold."""
    if one_of(entries, ("box", "where"), where) is None:
        if group == "all" and "all" not in node_groups:
            return np.arange(len(nodes))
        if group not in node_groups:
            hint = nearest(group, node_groups)
            raise ValueError(f"{where}: no group or node has this name, and neither box nor where is given{hint}")
        chosen = node_groups[group]
    elif "where" in entries:
        if not isinstance(entries["where"], str):
            raise ValueError(f"{where}: where must be a text such as 'z=min', not {entries['where']!r}")
        chosen = select(entries["where"], nodes, node_groups, where)
    else:
        box = entries["box"]
        if not isinstance(box, list) or len(box) != 2:
            raise ValueError(f"{where}: box must be [[xmin, ..], [xmax, ..]], not {box!r}")
        low, high = (vector(corner, nodes.shape[1], f"{where}: box") for corner in box)
        if (low > high).any():
            raise ValueError(f"{where}: the first corner of the box must be the lower one")
        slack = 1e-9 * max(np.ptp(nodes, axis=0).max(), 1e-300)  # a box of no thickness still holds its nodes
        chosen = np.flatnonzero(((nodes >= low - slack) & (nodes <= high + slack)).all(axis=1))
    if not len(chosen):
        raise ValueError(
            f"{where}: holds no node of a link{_extents(nodes) if {'box', 'where'} & set(entries) else ''}"
        )
    return chosen


def _extents(nodes):
    """Return what a message says of the extents of the nodes."""
    ends = zip(AXES, nodes.min(axis=0), nodes.max(axis=0), strict=False)
    return "; " + ", ".join(f"{axis} goes from {low:.4g} to {high:.4g} m" for axis, low, high in ends)


def lines_of(group, entries, line_groups, count, where):
    """Return the lines of a group, or of all, but for groups that options give something else."""
    name = entries.get("lines", group)
    if name == "all" and entries.get("but"):
        return ~np.isin(np.arange(count), np.concatenate([line_groups[other] for other in entries["but"]]))
    if name == "all":
        return slice(None)
    of_nodes = [key for key in ("box", "where") if key in entries]
    if of_nodes:
        raise ValueError(f'{where}: {of_nodes[0]} is for nodes; name lines by lines = "GROUP", or lines = "all"')
    if not isinstance(name, str) or name not in line_groups:
        hint = nearest(str(name), line_groups)
        raise ValueError(
            f'{where}: no line or group of lines is {name!r}; give lines = "GROUP", or lines = "all"{hint}'
        )
    return line_groups[name]


def assign(values, taken, chosen, value, where):
    """Give the rows of chosen nodes a value, in place; refuse another one than that of a group before."""
    if (taken[chosen] & (values[chosen] != value).any(axis=1)).any():
        raise ValueError(f"{where}: a group above gives one of its nodes another value; give each node one value")
    values[chosen], taken[chosen] = value, True


def lumped(along, lengths, links, count):
    """Return the sums at the nodes of what acts along links, (k,) or (k, dim) per m, half of each at either end."""
    halves = np.repeat((along.T * lengths).T / 2.0, 2, axis=0)
    if halves.ndim == 1:
        return np.bincount(links.ravel(), halves, count)
    return np.column_stack([np.bincount(links.ravel(), column, count) for column in halves.T])


def _lengths(nodes, links):
    return np.linalg.norm(nodes[links[:, 1]] - nodes[links[:, 0]], axis=1)


def read_supports(settings, nodes, node_groups, description, fixed, prescribed):
    """Add the supports of the settings to the fixed components (n, dim) and their displacements (m) of a file."""
    dim, given = nodes.shape[1], prescribed != 0.0  # a file that holds a node may leave its settlement to the settings
    for group, entries in settings.get("supports", {}).items():
        where = place(description, "supports", group)
        chosen = nodes_of(group, entries, nodes, node_groups, where)
        fix = entries.get("fix", list(AXES[:dim]))
        if not isinstance(fix, (list, str)) or not fix or any(axis not in list(AXES[:dim]) for axis in fix):
            known = f"a list out of {list(AXES[:dim])}, or a text such as 'xy'"
            named = [
                number for number, axis in enumerate(AXES, start=1) if isinstance(fix, (list, str)) and axis in fix
            ]
            raise ValueError(f"{where}: fix must be {known}, not {fix!r}{_more_axes(max(named, default=0), dim)}")
        value = np.zeros(dim)
        if "displacement" in entries:
            value = vector(entries["displacement"], dim, f"{where}: displacement")
        for axis in range(dim):
            if AXES[axis] not in fix:
                if value[axis]:
                    raise ValueError(f"{where}: displacement along {AXES[axis]}, which is not in fix")
                continue
            fixed[chosen, axis] = True
            if "displacement" not in entries:  # what is held stays where others have moved it
                continue
            clash = given[chosen, axis] & (prescribed[chosen, axis] != value[axis])
            if clash.any():
                raise ValueError(f"{where}: a node has another displacement along {AXES[axis]} already")
            given[chosen, axis] = True
            prescribed[chosen, axis] = value[axis]
    return fixed, prescribed


def read_loads(settings, nodes, links, line_groups, node_groups, description, prefix=""):
    """Return the nodal forces (n, dim) in N, and the part (k, dim) in N/m of them that acts along lines.

    The prefix is that of the table in the file.
    """
    load, along = np.zeros(nodes.shape), np.zeros((len(links), nodes.shape[1]))
    for group, entries in settings.get("loads", {}).items():
        where = place(description, f"{prefix}loads", group)
        key = one_of(entries, ("force", "line"), where)
        if key is None:
            raise ValueError(
                f"{where}: key 'force' is missing; give force = [fx, ..] in N on each node, or line = [fx, ..] in N/m"
                " along each line"
            )
        value = vector(entries[key], nodes.shape[1], f"{where}: {key}")
        if key == "force":
            load[nodes_of(group, entries, nodes, node_groups, where)] += value
        else:
            along[lines_of(group, entries, line_groups, len(links), where)] += value
    return load + lumped(along, _lengths(nodes, links), links, len(nodes)), along


def read_masses(settings, nodes, links, line_groups, node_groups, description, mass):
    """Add the masses of the settings to those (n,) of a file, in kg; return them and their part along lines (kg/m)."""
    mass, along = mass.copy(), np.zeros(len(links))
    for group, entries in settings.get("masses", {}).items():
        where = place(description, "masses", group)
        key = one_of(entries, ("mass", "line"), where)
        if key is None:
            raise ValueError(f"{where}: no mass; give mass (kg on each node) or line (kg/m along each line)")
        value = number(entries[key], f"{where}: {key}", positive=True)
        if key == "mass":
            mass[nodes_of(group, entries, nodes, node_groups, where)] += value
        else:
            along[lines_of(group, entries, line_groups, len(links), where)] += value
    mass += lumped(along, _lengths(nodes, links), links, len(nodes))
    return mass if mass.any() else None, along


def read_velocities(settings, nodes, node_groups, fixed, description):
    """Return the initial velocities (n, dim) in m/s, zero where fixed, None without any."""
    if not settings.get("velocities"):
        return None
    velocity, taken = np.zeros(nodes.shape), np.zeros(len(nodes), bool)
    for group, entries in settings["velocities"].items():
        where = place(description, "velocities", group)
        chosen = nodes_of(group, entries, nodes, node_groups, where)
        if "velocity" not in entries:
            raise ValueError(f"{where}: key 'velocity' is missing; give velocity = [vx, ..] in m/s of each node")
        value = vector(entries["velocity"], nodes.shape[1], f"{where}: velocity")
        if (fixed[chosen] | (value == 0.0)).all() and value.any():
            raise ValueError(f"{where}: all its nodes are held along the velocity, and do not move")
        assign(velocity, taken, chosen, value, f"{where}: velocity")
    return np.where(fixed, 0.0, velocity)
