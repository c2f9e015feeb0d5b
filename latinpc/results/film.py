"""Draw motions as animations: all frames seen from one place, coloured on one scale, with supports and masses."""

from __future__ import annotations

import numpy as np
from matplotlib.lines import Line2D
from PIL import Image

from .atomic import atomic
from .drawing import (
    STAMP_COLOUR,
    axes_for,
    draw_arrows,
    draw_symbols,
    force_bar,
    label_axes,
    load_keys,
    new_figure,
    plane_points,
    symbol_keys,
)
from .look import Scale, force_keys, force_look
from .mechanics import slack
from .pictures import amplification_of, at_one_place, draw_forces, drawn_links, in_plane
from .symbols import MANY_SYMBOLS, arrows, supports
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
    film = Film(motion, amplification)
    drawn = [film.image(film.add(frame)) for frame in motion.frames]
    with atomic(path) as temporary:
        drawn[0].save(temporary, save_all=True, append_images=drawn[1:], duration=int(1000 * seconds), loop=0)


class Film:
    """The figure of all frames: what stays is drawn once, what moves is drawn upon it.

    Parameters are those of `draw_motion`.
    """

    def __init__(self, motion, amplification=None):
        self.scene, self.seen = motion.scene, drawn_links(motion.scene)
        self.nodes = plane_points(self.scene.nodes)
        largest = max(np.linalg.norm(frame.displacements, axis=1).max() for frame in motion.frames)
        least = 1.0 if amplification is None else -np.inf
        self.amplification = max(amplification_of(self.nodes, largest, amplification), least)
        self.scale = Scale(*(frame.tensions[self.seen] for frame in motion.frames))
        self.bodies = _bodies(self.scene.mass)
        self.discs = at_one_place(self.scene, np.flatnonzero(self.seen))
        self.stands = supports(self.scene.fixed, self.nodes, self.scene.links[self.seen])
        loads = np.array([in_plane(frame.load) for frame in motion.frames])
        self.loaded = np.flatnonzero(loads.any(axis=(0, 2)))
        self.largest = np.linalg.norm(loads, axis=2).max()
        seen = [self._shape(frame) for frame in motion.frames] + [self.arrows(frame) for frame in motion.frames]
        seen += [one.triangles for one in self.stands]
        self._stage(np.vstack([points.reshape(-1, self.nodes.shape[1]) for points in seen]))
        if not motion.converged:
            self.figure.text(0.02, 0.895, f"ended early: {motion.report['reason']}", fontsize=9, color=STAMP_COLOUR)
        self._lines = (
            [] if self.axes.name == "3d" else [line for line in self.axes.spines.values() if line.get_visible()]
        )
        for line in self._lines:  # lie above links
            line.set_visible(False)
        self.figure.canvas.draw()
        self._still = self.figure.canvas.copy_from_bbox(self.figure.bbox)
        for line in self._lines:
            line.set_visible(True)

    def _stage(self, points):
        """Make the figure with what stays: axes around all points, scale, title."""
        self.figure = figure = new_figure(8.0, 4.8)
        figure.set_dpi(100)
        rectangle = [0.0, 0.02, 0.72, 0.90] if points.shape[1] == 3 else [0.09, 0.11, 0.58, 0.78]
        self.axes = axes_for(figure, rectangle, points, gaps=GAPS)
        label_axes(figure, self.axes, gaps=GAPS)
        force_bar(figure, [0.80, 0.52, 0.018, 0.36], self.scale)
        figure.text(0.02, 0.945, self.scene.name, fontsize=11, weight="bold", parse_math=False)

    def _shape(self, frame):
        return self.nodes + self.amplification * plane_points(frame.displacements)

    def arrows(self, frame):
        """Return the lines of arrows for the loads, long as the largest of all frames lets them be."""
        load, ends = in_plane(frame.load), self.scene.links[self.seen]
        if not 0 < len(self.loaded) <= MANY_SYMBOLS:
            load = np.zeros_like(load)
        return arrows(load, self.nodes, ends, self._shape(frame), self.largest)[0]

    def add(self, frame):
        """Add what moves to the figure; return it in the order in which it is drawn."""
        scene, axes, shape, law = self.scene, self.axes, self._shape(frame), self.scene.law[self.seen]
        still = {*axes.get_children(), *self.figure.get_children()} - {*self._lines}
        force, loose = frame.tensions[self.seen], slack(scene, frame.tensions)[self.seen]
        draw_forces(axes, shape[scene.links[self.seen]], force_look(law, force, loose, self.scale), loose, self.discs)
        draw_symbols(axes, self.stands)
        if len(shape) <= FEW_NODES:
            plain = np.delete(shape, self.bodies, axis=0)
            axes.plot(*plain.T, "o", color="#333333", markersize=2.0, clip_on=False)
        draw_arrows(axes, self.arrows(frame))
        keys = force_keys(law, loose, film=True, discs=self.discs) + symbol_keys(self.stands)
        keys += load_keys(len(self.loaded), self.largest, len(self.loaded) <= MANY_SYMBOLS)
        if len(self.bodies):
            axes.plot(*shape[self.bodies].T, "o", color=MASS_COLOUR, markersize=9.0, clip_on=False, zorder=7)
            text = f"mass {quantity(1e3 * scene.mass[self.bodies].max(), 'g')}"
            keys.append(Line2D([], [], marker="o", color=MASS_COLOUR, markersize=7, linestyle="none", label=text))
        self.figure.legend(handles=keys, loc="upper left", bbox_to_anchor=(0.73, 0.48), fontsize=8, frameon=False)
        time = f"t = {quantity(frame.time, 's', 4)}, drawn × {number(self.amplification)}"
        self.figure.text(0.98, 0.945, time, fontsize=10, ha="right")
        order = sorted(axes.get_children(), key=lambda one: one.zorder) + self.figure.get_children()
        return [one for one in order if one not in still]

    def image(self, moves):
        """Draw what `add` has returned upon what stays, and remove it; return an image with a palette."""
        canvas = self.figure.canvas
        canvas.restore_region(self._still)
        for one in moves:
            if self.axes.name == "3d" and hasattr(one, "do_3d_projection"):
                one.do_3d_projection()
            one.draw(canvas.get_renderer())
            if one not in self._lines:
                one.remove()
        image = Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3])
        return image.quantize(255, Image.Quantize.FASTOCTREE)  # the median cut makes bands of the colours of forces


def _bodies(mass):
    """Return the nodes that are much heavier than most."""
    moving = mass[mass > 0.0]
    return np.flatnonzero(mass > HEAVY * np.median(moving)) if len(moving) else np.zeros(0, dtype=int)
