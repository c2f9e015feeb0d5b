"""Read the TOML file beside a Gmsh file: supports, loads, masses and velocities.

`latinpc.files.gmsh` describes the format.
"""

from __future__ import annotations

import difflib
import sys
import tomllib

import numpy as np

AXES = "xyz"
LAW_KEYS = (
    "law", "EA", "stiffness", "initial_elongation", "strain", "prestress", "gap", "coefficient", "normal", "table",
    "area", "strength",
)  # fmt: skip
SUPPORT_KEYS = ("fix", "displacement", "box")
LOAD_KEYS = ("force", "box")
MASS_KEYS = ("mass", "line", "box")
VELOCITY_KEYS = ("velocity", "box")
TOP_KEYS = ("title", "dim", "laws", "supports", "loads", "masses", "velocities")


def nearest(word, known):
    """Return what a message on an unknown key says of the known ones."""
    close = difflib.get_close_matches(word, list(known), n=1, cutoff=0.5)
    return f" (do you mean '{close[0]}'?)" if close else f"; known: {', '.join(sorted(known)) or 'none'}"


def read_description(path, description):
    """Read the TOML file; refuse unknown keys."""
    if not path.is_file():
        raise FileNotFoundError(f"{path}: no such file")
    if not description.is_file():
        raise FileNotFoundError(
            f"{description}: no such file; {path.name} needs it beside it to name the laws, supports and loads"
        )
    with open(description, "rb") as file:
        try:
            settings = tomllib.load(file)
        except (
            ValueError,
            RecursionError,
        ) as error:  # TOMLDecodeError is a ValueError, as are numbers too long to read
            raise ValueError(f"{description}: not a TOML file: {error}") from None
    tables = {"laws": LAW_KEYS, "supports": SUPPORT_KEYS, "loads": LOAD_KEYS}
    tables |= {"masses": MASS_KEYS, "velocities": VELOCITY_KEYS}
    for key, value in settings.items():
        if key not in TOP_KEYS:
            raise ValueError(f"{description}: unknown key '{key}'{nearest(key, TOP_KEYS)}")
        if key not in tables:
            continue
        for group, entries in value.items() if isinstance(value, dict) else [(key, None)]:
            if not isinstance(entries, dict):
                raise ValueError(f"{description}: [{key}] needs one table a group, written [{key}.NAME]")
            for entry in entries:
                if entry not in tables[key]:
                    hint = nearest(entry, tables[key])
                    raise ValueError(f"{description}: [{key}.{group}]: unknown key '{entry}'{hint}")
    if not settings.get("laws"):
        raise ValueError(f"{description}: no law; write [laws.NAME] for each physical group of {path.name}")
    return settings


def number(value, where, positive=False):
    """Return a finite number of the file, or raise with its place."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) <= sys.float_info.max:
        raise ValueError(f"{where} must be a finite number, not {value!r}")
    if positive and value <= 0:
        raise ValueError(f"{where} must be positive, not {value!r}")
    return float(value)


def vector(value, dim, where):
    """Return a list of numbers of the file as an array (dim,), or raise with its place."""
    if not isinstance(value, list) or len(value) != dim:
        raise ValueError(f"{where} must be a list of {dim} numbers, not {value!r}")
    return np.array([number(item, where) for item in value])


def one_of(entries, keys, where):
    """Return the one key that is given, None without any."""
    given = [key for key in keys if key in entries]
    if len(given) > 1:
        raise ValueError(f"{where}: give only one of {', '.join(given)}")
    return given[0] if given else None


def _nodes_of(group, entries, nodes, node_groups, where):
    """Return the nodes of a physical group, or those in a box."""
    if "box" not in entries:
        if group not in node_groups:
            hint = nearest(group, node_groups)
            raise ValueError(f"{where}: no physical group has this name, and no box is given{hint}")
        chosen = node_groups[group]
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
        raise ValueError(f"{where}: holds no node of a link")
    return chosen


def read_supports(settings, nodes, node_groups, description):
    """Return the fixed components (n, dim) and their prescribed displacements (m)."""
    dim = nodes.shape[1]
    fixed, prescribed = np.zeros(nodes.shape, dtype=bool), np.zeros(nodes.shape)
    for group, entries in settings.get("supports", {}).items():
        where = f"{description}: [supports.{group}]"
        chosen = _nodes_of(group, entries, nodes, node_groups, where)
        fix = entries.get("fix", list(AXES[:dim]))
        if not isinstance(fix, list) or not fix or any(axis not in list(AXES[:dim]) for axis in fix):
            raise ValueError(f"{where}: fix must be a list out of {list(AXES[:dim])}, not {fix!r}")
        value = np.zeros(dim)
        if "displacement" in entries:
            value = vector(entries["displacement"], dim, f"{where}: displacement")
        for axis in range(dim):
            if AXES[axis] not in fix:
                if value[axis]:
                    raise ValueError(f"{where}: displacement along {AXES[axis]}, which is not in fix")
                continue
            clash = fixed[chosen, axis] & (prescribed[chosen, axis] != value[axis])
            if clash.any():
                raise ValueError(f"{where}: a node has another displacement along {AXES[axis]} in another group")
            fixed[chosen, axis] = True
            prescribed[chosen, axis] = value[axis]
    if not fixed.any() and not settings.get("masses"):
        raise ValueError(f"{description}: nothing is held; write [supports.NAME] with fix = [...]")
    return fixed, prescribed


def read_loads(settings, nodes, node_groups, description):
    """Return the nodal forces (n, dim) in N."""
    load = np.zeros(nodes.shape)
    for group, entries in settings.get("loads", {}).items():
        where = f"{description}: [loads.{group}]"
        chosen = _nodes_of(group, entries, nodes, node_groups, where)
        if "force" not in entries:
            raise ValueError(f"{where}: key 'force' is missing; give force = [fx, ..] in N on each node")
        load[chosen] += vector(entries["force"], nodes.shape[1], f"{where}: force")
    return load


def read_masses(settings, nodes, links, line_groups, node_groups, description):
    """Return the masses (n,) of the nodes in kg, None without any."""
    if not settings.get("masses"):
        return None
    mass = np.zeros(len(nodes))
    for group, entries in settings["masses"].items():
        where = f"{description}: [masses.{group}]"
        key = one_of(entries, ("mass", "line"), where)
        if key is None:
            raise ValueError(f"{where}: no mass; give mass (kg on each node) or line (kg/m along each line)")
        value = number(entries[key], f"{where}: {key}", positive=True)
        if key == "mass":
            mass[_nodes_of(group, entries, nodes, node_groups, where)] += value
            continue
        if group not in line_groups or "box" in entries:
            raise ValueError(f"{where}: 'line' is for a physical group of lines{nearest(group, line_groups)}")
        ends = links[line_groups[group]]
        length = np.linalg.norm(nodes[ends[:, 1]] - nodes[ends[:, 0]], axis=1)
        mass += np.bincount(ends.ravel(), np.repeat(value * length / 2.0, 2), len(nodes))
    return mass


def read_velocities(settings, nodes, node_groups, fixed, description):
    """Return the initial velocities (n, dim) in m/s, zero where fixed, None without any."""
    if not settings.get("velocities"):
        return None
    velocity = np.zeros(nodes.shape)
    for group, entries in settings["velocities"].items():
        where = f"{description}: [velocities.{group}]"
        chosen = _nodes_of(group, entries, nodes, node_groups, where)
        if "velocity" not in entries:
            raise ValueError(f"{where}: key 'velocity' is missing; give velocity = [vx, ..] in m/s of each node")
        velocity[chosen] = vector(entries["velocity"], nodes.shape[1], f"{where}: velocity")
    return np.where(fixed, 0.0, velocity)
