"""Drawings of a structure that has not been solved, as methods of it."""

from __future__ import annotations

import pathlib
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Plots"]


class Plots:
    """Pictures of what was given. Nothing here is collective."""

    def plot(self, figure: Figure | None = None, numbers: bool | None = None, mechanism: bool = False) -> Figure:
        """Draw the structure as it is given: laws by colours, supports, loads, numbers of nodes and links.

        Parameters
        ----------
        figure : matplotlib.figure.Figure, optional
            To draw into; one of its own when not given, which notebooks show.
        numbers : bool, optional
            Write the numbers; by default up to 60 nodes.
        mechanism : bool
            Draw the motion that no link resists (`free_motion`), the rest faint.

        Returns
        -------
        matplotlib.figure.Figure
            ``figure.savefig("net.png")`` writes it.

        Raises
        ------
        ValueError
            With `mechanism`, where each motion is resisted.
        """
        from .motionpicture import motion_figure
        from .pictures import plan_figure

        if not mechanism:
            return plan_figure(self, numbers=numbers, figure=figure)
        motion = self.free_motion()
        if motion is None:
            raise ValueError("no mechanism: links resist each motion")
        return motion_figure(self, motion, numbers=numbers, figure=figure)

    def free_motion(self) -> np.ndarray | None:
        """Find a motion that changes the length of no link, slack or taut; of all the one that the loads drive.

        It costs a factorisation on this rank.

        Returns
        -------
        (n, dim) array or None
            Its largest displacement is 1; None where links resist each motion, and where they turn (geometry).
        """
        from .mechanism import free_motion

        return free_motion(self)

    def interactive(self) -> Any:
        """Draw the structure to be turned, zoomed and asked with a mouse; needs plotly (the extra ``interactive``).

        Returns
        -------
        plotly.graph_objects.Figure
            Which notebooks show.

        Raises
        ------
        RuntimeError
            Without plotly.
        """
        from .browser import interactive_figure

        return interactive_figure(self)

    def to_html(self, path: str | pathlib.Path) -> None:
        """Write `interactive` into one file for a browser, which needs no network; call it on one rank."""
        from .browser import write_html

        write_html(self.interactive(), path)
