"""Draw motions as animations: all frames seen from one place, coloured on one scale, with supports and masses."""

from __future__ import annotations

import numpy as np
from matplotlib.lines import Line2D
from PIL import Image

from .atomic import atomic
from .drawing import (
    STAMP_COLOUR,
    axes_for,
    draw_symbols,
    force_bar,
    label_axes,
    new_figure,
    plane_points,
    symbol_keys,
)
from .look import Scale, force_keys, force_look
from .mechanics import slack
from .pictures import amplification_of, at_one_place, draw_forces, drawn_links
from .symbols import supports
from .units import number, quantity

FEW_NODES = 600  # up to here, the nodes of a motion are drawn as dots
HEAVY = 10.0  # times the middle mass: nodes drawn as bodies
MASS_COLOUR = "#111111"
GAPS = (32.0, 32.0, 46.0)  # points: labels of the axes from their edges


def draw_motion(motion, path, amplification=None, seconds=0.06):
    """Draw the frames of a motion as an animation, seen from one place and coloured on one scale.

    Nodes that are much heavier than the others, such as a falling mass, are drawn as bodies.

    Parameters
    ----------
    motion : latinpc.runs.motion.Motion
    path : str or path-like
        A ``.gif`` file, replaced only once it is complete.
    amplification : float, optional
        Of the displacements; by default a round number, 1 or more, that makes them visible.
    seconds : float
        That each frame is shown for.
    """
    scene, seen = motion.scene, drawn_links(motion.scene)
    nodes = plane_points(scene.nodes)
    largest = max(np.linalg.norm(frame.displacements, axis=1).max() for frame in motion.frames)
    least = 1.0 if amplification is None else -np.inf
    amplification = max(amplification_of(nodes, largest, amplification), least)
    shapes = [nodes + amplification * plane_points(frame.displacements) for frame in motion.frames]
    scale = Scale(*(frame.tensions[seen] for frame in motion.frames))
    stands = supports(scene.fixed, nodes, scene.links[seen])
    points = np.vstack([*shapes, *(one.triangles.reshape(-1, nodes.shape[1]) for one in stands)])
    bodies = _bodies(scene.mass)
    early = "" if motion.converged else f"ended early: {motion.report['reason']}"
    drawn = [
        _frame(scene, seen, frame, shape, points, scale, stands, bodies, amplification, early)
        for frame, shape in zip(motion.frames, shapes)
    ]
    with atomic(path) as temporary:
        drawn[0].save(temporary, save_all=True, append_images=drawn[1:], duration=int(1000 * seconds), loop=0)


def _bodies(mass):
    """Return the nodes that are much heavier than most."""
    moving = mass[mass > 0.0]
    return np.flatnonzero(mass > HEAVY * np.median(moving)) if len(moving) else np.zeros(0, dtype=int)


def _frame(scene, seen, frame, shape, points, scale, stands, bodies, amplification, early):
    """Draw a state; return it as an image with a palette."""
    figure = new_figure(8.0, 4.8)
    figure.set_dpi(100)
    rectangle = [0.0, 0.02, 0.72, 0.90] if shape.shape[1] == 3 else [0.09, 0.11, 0.58, 0.78]
    axes = axes_for(figure, rectangle, points, gaps=GAPS)
    label_axes(figure, axes, gaps=GAPS)
    law, force = scene.law[seen], frame.tensions[seen]
    loose = slack(scene, frame.tensions)[seen]
    discs = at_one_place(scene, np.flatnonzero(seen))
    draw_forces(axes, shape[scene.links[seen]], force_look(law, force, loose, scale), loose, discs)
    draw_symbols(axes, stands)
    if len(shape) <= FEW_NODES:
        axes.plot(*np.delete(shape, bodies, axis=0).T, "o", color="#333333", markersize=2.0, clip_on=False)
    keys = force_keys(law, loose, film=True, discs=discs) + symbol_keys(stands)
    if len(bodies):
        axes.plot(*shape[bodies].T, "o", color=MASS_COLOUR, markersize=9.0, clip_on=False, zorder=7)
        text = f"mass {quantity(1e3 * scene.mass[bodies].max(), 'g')}"
        keys.append(Line2D([], [], marker="o", color=MASS_COLOUR, markersize=7, linestyle="none", label=text))
    force_bar(figure, [0.80, 0.52, 0.018, 0.36], scale)
    figure.legend(handles=keys, loc="upper left", bbox_to_anchor=(0.73, 0.48), fontsize=8, frameon=False)
    figure.text(0.02, 0.945, scene.name, fontsize=11, weight="bold", parse_math=False)
    figure.text(
        0.98, 0.945, f"t = {quantity(frame.time, 's', 4)}, drawn × {number(amplification)}", fontsize=10, ha="right"
    )
    if early:
        figure.text(0.02, 0.895, early, fontsize=9, color=STAMP_COLOUR)
    figure.canvas.draw()
    image = Image.fromarray(np.asarray(figure.canvas.buffer_rgba())[..., :3])
    return image.quantize(255, Image.Quantize.FASTOCTREE)  # the median cut makes bands of the colours of forces
