"""Groups of nodes or lines by name, where each that the file names is a group of its own."""

from __future__ import annotations

import numpy as np


class Groups(dict):
    """Groups of a file. Names of single nodes or lines are found as well, but not listed; groups come first.

    Parameters
    ----------
    groups : dict of str to array of int
    names : sequence of int or str, optional
        What the file calls the nodes or lines, empty where it has no name.
    """

    def __init__(self, groups, names=None):
        super().__init__(groups)
        self._names = () if names is None else names
        self._number = None

    def __contains__(self, name):
        return super().__contains__(name) or name in self._numbers()

    def __missing__(self, name):
        found = self._numbers()[name]
        if len(found) > 1:  # such as a member without a name, which has that of its row
            raise ValueError(f"'{name}' is the name of {len(found)} nodes or members: give them other names, or groups")
        return np.array(found)

    def single(self, name):
        """Return whether a name is that of a single node or line, an exception of its groups."""
        return not super().__contains__(name)

    def _numbers(self):
        """Return the numbers of each name, found when they are first asked for."""
        if self._number is None:
            self._number = {}
            for number, name in enumerate(map(str, self._names)):
                self._number.setdefault(name, []).append(number)
            self._number.pop("", None)
        return self._number
