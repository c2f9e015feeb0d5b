"""Draw modes: shapes beside each other, one as an animation."""

from __future__ import annotations

import matplotlib
import numpy as np
from PIL import Image

from .atomic import atomic
from .drawing import axes_for, draw_links, new_figure, plane_points
from .look import GHOST_COLOUR
from .mechanics import slack

MOST = 9  # modes in a figure
FAR = 0.12  # of the size of the structure: the largest displacement that is drawn
FRAMES, SECONDS = 24, 0.05  # of an animation: in a period, each
COLOURS, BRIGHTEST = "viridis", 0.9  # the last tenth is too bright on white
KEY = 0.35  # inches below the modes


def modes_figure(modes, count=None):
    """Draw the lowest modes beside each other, each on the state (grey), coloured by how far links move.

    Parameters
    ----------
    modes : Modes
    count : int, optional
        How many, at most nine.

    Returns
    -------
    matplotlib.figure.Figure
    """
    count = min(len(modes), MOST, MOST if count is None else count)
    columns = min(count, 3) if count != 4 else 2
    rows = -(-count // max(columns, 1))
    figure = new_figure(4.2 * max(columns, 1), 0.5 + KEY + 3.2 * max(rows, 1))
    kind = "buckling" if modes.buckling else "vibration"
    inches = figure.get_size_inches()[1]
    title, top, key = f"{modes.structure.name}: modes of {kind}", 1.0 - 0.3 / inches, KEY / inches
    figure.text(0.02, top, title, fontsize=13, parse_math=False)
    width, height = 1.0 / max(columns, 1), (top - key) / max(rows, 1)
    for mode in range(count):
        left, bottom = mode % columns * width, top - (mode // columns + 1) * height
        rectangle = [left + 0.02 * width, bottom + 0.04 * height, 0.96 * width, 0.84 * height]
        _panel(figure, rectangle, modes, mode, 1.0)
        figure.text(left + 0.5 * width, bottom + 0.92 * height, f"{mode + 1}: {modes.label(mode)}", ha="center")
    _key(figure, 0.5 * key)
    return figure


def _key(figure, height):
    """Say what the colours are, at a height of the figure."""
    inches = figure.get_size_inches()
    axes = figure.add_axes([0.5 - 0.6 / inches[0], height - 0.05 / inches[1], 1.2 / inches[0], 0.1 / inches[1]])
    axes.imshow(BRIGHTEST * np.linspace(0.0, 1.0, 64)[None], cmap=COLOURS, vmin=0.0, vmax=1.0, aspect="auto")
    axes.set_axis_off()
    for side, text, place in ((-1, "does not move", "right"), (1, "moves most", "left")):
        figure.text(0.5 + side * 0.68 / inches[0], height, text, fontsize=9, ha=place, va="center")


def animate_mode(modes, path, mode=0):
    """Write a period of a mode as a ``.gif``, replaced only once it is complete; not collective.

    Parameters
    ----------
    modes : Modes
    path : str or path-like
    mode : int
        Counted from 0.
    """
    images = []
    for phase in np.arange(FRAMES) * 2.0 * np.pi / FRAMES:
        figure = new_figure(6.4, 4.8)
        figure.set_dpi(100)
        _panel(figure, [0.04, 0.03, 0.92, 0.88], modes, mode, np.sin(phase))
        title = f"{modes.structure.name}, mode {mode + 1}: {modes.label(mode)}"
        figure.text(0.02, 0.95, title, fontsize=10, parse_math=False)
        figure.canvas.draw()
        images.append(Image.fromarray(np.asarray(figure.canvas.buffer_rgba())[..., :3]).quantize(128))
    with atomic(path) as temporary:
        images[0].save(temporary, save_all=True, append_images=images[1:], duration=int(1000 * SECONDS), loop=0)


def _panel(figure, rectangle, modes, mode, amplitude):
    """Draw one mode at a part of its amplitude into a rectangle of a figure."""
    structure, shape = modes.structure, modes.shapes[mode]
    links, size = structure.links, np.linalg.norm(shape, axis=1)
    state = plane_points(structure.nodes + modes.displacements)
    if structure.dim == 1:
        shape = np.column_stack([shape, np.zeros(len(shape))])
    far = FAR * np.ptp(state, axis=0).max()
    moved = state + amplitude * far * shape
    points = np.vstack([state + far * shape, state - far * shape])  # one place for all frames
    axes = axes_for(figure, rectangle, points, fill=1.0, gaps=())
    axes.set_axis_off()
    thin = float(np.clip(30.0 / np.sqrt(len(links)), 0.3, 1.3))
    loose = slack(structure, modes.tensions)
    most = size[links].mean(axis=1)
    colours = matplotlib.colormaps[COLOURS](BRIGHTEST * most / max(most.max(), np.finfo(float).tiny))
    draw_links(axes, state[links], [GHOST_COLOUR], 0.5 * thin, zorder=1)
    draw_links(axes, moved[links], colours, np.where(loose, 0.5, 1.0) * thin)
