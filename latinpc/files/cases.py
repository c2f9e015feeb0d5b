"""Read load cases, the tables ``[[case]]`` of a TOML file.

What stands outside of the cases, loads and settlements included, acts in every case. In SI units::

    [[case]]
    name = "dead"
    part = true                          # optional: for combinations alone, not solved by itself
    [case.loads.chords]                  # as outside of cases
    line = [0.0, 0.0, -785.0]

    [[case]]
    name = "settlement"
    [case.settlements.abutment]          # group of held nodes, or box or where
    displacement = [0.0, 0.0, -0.01]     # m

    [[case]]
    name = "summer"
    [case.elongations.chords]            # group of lines, or lines = "all"
    temperature = 30.0                   # K, warmer than when it was built
    expansion = 1.2e-5                   # 1/K

    [[case]]
    name = "tightened"
    [case.elongations.stays]
    shortening = 0.02                    # m, of each line by its turnbuckle; or strain = 1e-4

    [[case]]
    name = "storm"
    combine = { dead = 1.35, settlement = 1.0, summer = 0.6 }   # of cases above, besides loads of its own
"""

from __future__ import annotations

import numpy as np

from latinpc.laws import Law
from latinpc.scenes.case import Case

from .description import LOAD_KEYS, assign, check_keys, lines_of, nodes_of, number, one_of, read_loads, vector
from .text import nearest

KEYS = ("name", "part", "combine", "loads", "settlements", "elongations")
TABLES = {
    "loads": LOAD_KEYS,
    "settlements": ("displacement", "box", "where"),
    "elongations": ("temperature", "expansion", "shortening", "strain", "lines"),
}


def read_cases(settings, scene, ends, line, line_groups, node_groups, description):
    """Return the cases of a TOML file.

    Parameters
    ----------
    settings : dict
    scene : Scene
        What acts in every case.
    ends : (k, 2) array of int
        The nodes of each line.
    line : (m,) array of int
        The line of each link.
    line_groups, node_groups : dict of str to array of int
    description : Path
        The TOML file, for messages.

    Returns
    -------
    tuple of Case

    Raises
    ------
    ValueError
        With the file, the case and the key.
    """
    tables = settings.get("case", [])
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        raise ValueError(f"{description}: 'case' must be tables, written [[case]]")
    cases = {}
    for index, table in enumerate(tables):
        name = table.get("name", f"case {index + 1}")
        where = f"{description}: [[case]] '{name}': "
        check_keys(table, KEYS, TABLES, where, "case.")
        if not isinstance(name, str) or name in cases:
            raise ValueError(f"{where}a case needs a name of its own, a text")
        if not isinstance(table.get("part", False), bool):
            raise ValueError(f"{where}part must be true or false, not {table['part']!r}")
        place = where.removesuffix(": ")
        _refuse_chosen_above(table, settings, node_groups, place)
        case = Case(
            name,
            read_loads(table, scene.nodes, ends, line_groups, node_groups, place, "case.")[0],
            _settlements(table, scene, node_groups, place),
            _elongations(table, scene, ends, line, line_groups, place),
            table.get("part", False),
        )
        case = sum((factor * cases[part] for part, factor in _combined(table, cases, place)), case)
        cases[name] = Case(name, *(part if part.any() else None for part in case.parts), table.get("part", False))
    return tuple(cases.values())


def _combined(table, cases, where):
    """Return the cases that a case combines, with their factors."""
    combine = table.get("combine", {})
    if not isinstance(combine, dict) or (not combine and "combine" in table):
        raise ValueError(f"{where}: combine must be factors of cases, such as {{ dead = 1.35, snow = 1.5 }}")
    for part, factor in combine.items():
        if part not in cases:
            raise ValueError(f"{where}: combine: no case above has the name '{part}'{nearest(part, cases)}")
        number(factor, f"{where}: combine: the factor of {part}")
        if all(action is None for action in cases[part].parts):
            raise ValueError(
                f"{where}: combine: '{part}' has no actions of its own, a factor changes nothing; what stands"
                " outside of cases acts in every case, without a factor"
            )
    return combine.items()


def _refuse_chosen_above(table, settings, node_groups, where):
    """Refuse the name of a table outside of cases that is no group: its box or its conditions hold there alone."""
    for key, outside in (("loads", "loads"), ("settlements", "supports")):
        for group, entries in table.get(key, {}).items():
            above = settings.get(outside, {}).get(group, {})
            chosen = next((choice for choice in ("box", "where") if choice in above), None)
            if chosen and group not in set(node_groups) and not entries.keys() & {"box", "where", "line"}:
                raise ValueError(
                    f"{where}: [case.{key}.{group}]: no group or node has this name, and the {chosen} of"
                    f" [{outside}.{group}] holds there alone: give {chosen} here as well"
                )


def _settlements(table, scene, node_groups, where):
    """Return the displacements (n, dim) of held nodes."""
    moved, taken = np.zeros(scene.nodes.shape), np.zeros(len(scene.nodes), bool)
    for group, entries in table.get("settlements", {}).items():
        place = f"{where}: [case.settlements.{group}]"
        chosen = nodes_of(group, entries, scene.nodes, node_groups, place)
        if "displacement" not in entries:
            raise ValueError(f"{place}: key 'displacement' is missing; give displacement = [ux, ..] in m")
        value = vector(entries["displacement"], scene.dim, f"{place}: displacement")
        if (value[None] * ~scene.fixed[chosen]).any():
            raise ValueError(f"{place}: a displacement in a direction in which a node is not held")
        assign(moved, taken, chosen, value, f"{place}: displacement")
    return moved


def _elongations(table, scene, ends, line, line_groups, where):
    """Return the changes of the initial elongations (m,)."""
    length = np.linalg.norm(scene.nodes[ends[:, 1]] - scene.nodes[ends[:, 0]], axis=1)
    change = np.zeros(len(ends))
    for group, entries in table.get("elongations", {}).items():
        place = f"{where}: [case.elongations.{group}]"
        chosen = lines_of(group, entries, line_groups, len(ends), place)
        key = one_of(entries, ("temperature", "shortening", "strain"), place)
        if key is None:
            raise ValueError(f"{place}: give temperature (K) with expansion (1/K), shortening (m), or strain")
        if (key == "temperature") != ("expansion" in entries):
            raise ValueError(f"{place}: temperature (K) and expansion (1/K) go together")
        value = number(entries[key], f"{place}: {key}")
        if key == "temperature":
            value *= -number(entries["expansion"], f"{place}: expansion")
        change[chosen] += value if key == "shortening" else value * length[chosen]
    return np.where(scene.law == Law.TANGENT, 0.0, change[line])
