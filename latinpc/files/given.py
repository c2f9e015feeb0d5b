"""What options say of a file: laws by group, supports and loads."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from latinpc.laws import RIGID, Law

from .description import number
from .selection import AXES
from .text import finite


def by_group(value):
    """Return a dict of group to value; None stands for all other groups."""
    return value if isinstance(value, dict) else {} if value is None else {None: value}


#: What options give of a law, and the entries of a file that say the same
ALIKE = {"law": ("law",), "EA": ("EA", "stiffness"), "prestress": ("prestress", "strain", "initial_elongation")}


@dataclass
class Given:
    """What options say of the laws, by group; `usual` is the law of groups that need none said."""

    law: dict = field(default_factory=dict)
    EA: dict = field(default_factory=dict)
    prestress: dict = field(default_factory=dict)
    usual: dict = field(default_factory=dict)
    geometry: str | None = None
    taken: set = field(default_factory=set)

    def __post_init__(self):
        names = {group: kind.name if isinstance(kind, Law) else str(kind) for group, kind in self.law.items()}
        names = {group: name.lower().replace("-", "_").replace(" ", "_") for group, name in names.items()}
        self.law, self.taken = self.usual | names, {("law", group) for group in self.usual}

    def groups(self):
        """Return the groups that options name, and None, for all other lines."""
        return [*sorted({**self.law, **self.EA, **self.prestress}.keys() - {None}), None]

    def named(self, which):
        """Return the group of which a line takes each option, None for all lines; `which` counts the combinations."""
        groups = self.groups()
        return {
            key: groups[i] for key, i in zip(ALIKE, np.unravel_index(which, len(ALIKE) * [len(groups)]), strict=True)
        }

    @staticmethod
    def rigid(kind):
        """Return whether a law takes neither EA nor prestress."""
        return kind in ["table", *(law.name.lower() for law in RIGID)]

    def completed(self, entries, named, law):
        """Return the law of lines with what a file leaves out of it, by the options of `named`; note what they give.

        Laws that take none are left out of what is for all lines. `law` is the default, None without any.
        """
        found = {"law": law} | entries if law else dict(entries)
        for key, alike in ALIKE.items():
            values = getattr(self, key)
            of = named[key]
            useless = key != "law" and of is None and (entries or any(named.values())) and self.rigid(found.get("law"))
            if of in values and not useless and not entries.keys() & set(alike):
                found[key] = values[of]
                self.taken.add((key, of))
        return found

    def useless(self):
        """Return the first option that no line has taken, as (name, group); None without any."""
        given = [(key, group) for key in ALIKE for group in getattr(self, key)]
        return next((option for option in given if option not in self.taken), None)


def add_options(settings, given, support, load, self_weight):
    """Add supports and loads of options to those of the TOML file, under their own words."""
    for text in _texts(support, "support", "z=min"):
        where, _, axes = text.rpartition(":") if ":" in text else (text, "", "")
        entries = {"where": where.strip()} | ({"fix": list(axes.strip())} if axes else {})
        settings.setdefault("supports", {})[f"--support {text}"] = entries
    for text in _texts(load, "load", "z=-1000:deck"):
        if f"--load {text}" in settings.get("loads", {}):
            raise ValueError(f"--load {text}: given twice; loads add up, give the sum")
        settings.setdefault("loads", {})[f"--load {text}"] = _force(text)
    for group, value in sorted(self_weight.items(), key=lambda given: given[0] is None):  # that of all others last
        value = number(value, "--self-weight" if group is None else f"--self-weight of '{group}'")
        words = f"--self-weight {value:g}" if group is None else f"--self-weight {group}={value:g}"
        entries = {"lines": "all", "but": [name for name in self_weight if name]} if group is None else {"lines": group}
        settings.setdefault("loads", {})[words] = {"down": value} | entries


def _texts(given, name, example):
    """Return the texts of a parameter, one or several."""
    texts = [given] if isinstance(given, str) else given
    if not isinstance(texts, Iterable) or not all(isinstance(text, str) for text in texts):
        raise ValueError(f"{name} must be a text such as {example!r}, or a list of such, not {given!r}")
    return texts


def _force(text):
    """Return the entries of a load such as x=50,z=-1000:WHERE; its components come as a dict."""
    components, _, where = text.partition(":")
    force = {}
    for part in components.split(","):
        axis, _, value = part.partition("=")
        number = finite(value)
        if axis.strip() not in AXES or not axis.strip() or number is None or axis.strip() in force:
            raise ValueError(f"--load {text}: '{part}' is no force; write z=-1000 or x=50,z=-1000, then :WHERE or not")
        force[axis.strip()] = number
    return {"components": force, "where": where.strip() or "all"}


def in_space(settings, dim, description):
    """Give the loads of options, which name axes, the form of those of the TOML file; return notes on them."""
    notes = []
    for where, entries in settings.get("loads", {}).items():
        if "down" in entries:
            entries["line"] = [0.0] * (dim - 1) + [-entries.pop("down")]
            if dim < 3 and "dim" not in settings:
                notes = [
                    f"self-weight acts along -{AXES[dim - 1]}, within the structure; for a plan, which it acts across,"
                    f" write dim = 3 in {description.name}"
                ]
        elif "components" in entries:
            force = entries.pop("components")
            beyond = [axis for axis in force if axis not in AXES[:dim]]
            if beyond:
                needed = 1 + max(map(AXES.index, beyond))
                raise ValueError(
                    f"{where}: there is no {beyond[0]}, the structure lies in {', '.join(AXES[:dim])}; for loads across"
                    f" it write dim = {needed} in {description.name}"
                )
            entries["force"] = [force.get(axis, 0.0) for axis in AXES[:dim]]
    return notes
