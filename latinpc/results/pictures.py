"""Draw structures: forces in the links on the deformed shape.

Compression has warm colours and tension cool ones, in bars and cables alike. Bars are thick, cables thin, and slack
cables and compression-only links have a colour of their own.
"""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.lines import Line2D
from PIL import Image

from latinpc.laws import Law

from .atomic import atomic
from .drawing import (
    COMPRESSION,
    TENSION,
    axes_2d,
    axes_3d,
    colour_bar,
    draw_links,
    label_axes,
    new_figure,
    plane_points,
    save,
)
from .mechanics import slack
from .units import scaled

SLACK_COLOUR = "#c800a1"
GHOST_COLOUR = (0.75, 0.75, 0.75, 0.8)
MANY_LINKS = 4000  # beyond, the undeformed shape and the supports only blur the picture
FEW_NODES = 600  # up to here, the nodes of a motion are drawn as dots


def round_factor(value):
    """Return the largest of 1, 2, 5, 10, .. (and their fractions) that is not above `value`."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(digit for digit in (1, 2, 5) if digit * power <= value * (1 + 1e-12)))


def draw_structure(scene, displacements, tensions, subdomain=None, path="structure.png", amplification=None):
    """Draw a `structure_figure` into a ``.png``, ``.pdf`` or ``.svg`` file, replaced only once it is complete."""
    save(structure_figure(scene, displacements, tensions, subdomain, amplification), path)


def structure_figure(scene, displacements, tensions, subdomain=None, amplification=None, figure=None):
    """Draw the deformed structure with the forces in its links, and its subdomains.

    Parameters
    ----------
    scene : Scene or Structure
    displacements : (n, dim) array
        In m.
    tensions : (m,) array
        In N, compression negative.
    subdomain : (m,) array of int, optional
        Subdomain of each link, drawn in a corner.
    amplification : float, optional
        Of the displacements; by default a round number that makes them visible.
    figure : matplotlib.figure.Figure, optional
        To draw into; a new one when not given.

    Returns
    -------
    matplotlib.figure.Figure
    """
    tensions = np.asarray(tensions, dtype=float)
    seen = _along(scene)  # what acts across the line between its nodes is no line to draw
    law, ends, loose = scene.law[seen], scene.links[seen], slack(scene, tensions)[seen]
    tensions, subdomain = tensions[seen], None if subdomain is None else np.asarray(subdomain)[seen]
    nodes, moved = plane_points(scene.nodes), plane_points(np.asarray(displacements, dtype=float))
    if scene.dim == 1:
        moved[:, 1] = 0.0
    span = np.ptp(nodes, axis=0).max()
    largest = np.linalg.norm(moved, axis=1).max(initial=0.0)
    if amplification is None:
        amplification = round_factor(0.08 * span / largest) if largest > 0 else 1.0
    shape = nodes + amplification * moved
    three, few = nodes.shape[1] == 3, len(law) <= MANY_LINKS

    figure = new_figure(12.0, 7.2) if figure is None else figure
    both = np.vstack([nodes, shape])
    if three:
        axes = axes_3d(figure, [0.0, 0.0, 0.80, 0.93], both)
    else:
        axes = axes_2d(figure, [0.07, 0.08, 0.66, 0.83], both)
    label_axes(figure, axes)
    if few:
        draw_links(axes, nodes[ends], [GHOST_COLOUR], 0.5, zorder=1)
        _draw_supports(axes, scene, shape)
    _draw_forces(figure, axes, law, loose, shape[ends], tensions)
    if subdomain is not None and np.max(subdomain) > 0:
        _draw_subdomains(figure, nodes[ends], subdomain, three)
    divisor, unit = scaled(largest, "m")
    figure.text(0.02, 0.955, scene.name, fontsize=14, weight="bold")
    figure.text(
        0.98, 0.958,
        f"{len(law):,} links · largest displacement {largest / divisor:.3g} {unit}"
        + (f", drawn × {amplification:g}" if largest > 0 else ""),
        fontsize=10, ha="right",
    )  # fmt: skip
    return figure


def draw_motion(motion, path, amplification=1.0, seconds=0.06):
    """Draw the frames of a motion as an animation, seen from one place and coloured on one scale.

    Parameters
    ----------
    motion : latinpc.runs.motion.Motion
    path : str or path-like
        A ``.gif`` file, replaced only once it is complete.
    amplification : float
        Of the displacements.
    seconds : float
        That each frame is shown for.
    """
    scene = motion.scene
    shapes = [plane_points(scene.nodes + amplification * frame.displacements) for frame in motion.frames]
    push = max(max(np.max(-frame.tensions), 0.0) for frame in motion.frames)
    pull = max(max(np.max(frame.tensions), 0.0) for frame in motion.frames)
    points = np.vstack(shapes)
    thin = float(np.clip(45.0 / np.sqrt(len(scene.links)), 0.28, 1.3))
    drawn = ~np.isin(scene.law, (Law.CONTACT, Law.FRICTION, Law.TANGENT))  # what touches is no line
    images = []
    for frame, shape in zip(motion.frames, shapes):
        figure = new_figure(6.4, 4.8)
        figure.set_dpi(100)
        if shape.shape[1] == 3:
            axes = axes_3d(figure, [0.0, 0.0, 1.0, 0.93], points)
        else:
            axes = axes_2d(figure, [0.1, 0.08, 0.86, 0.83], points)
        force = frame.tensions
        colours = np.where(
            (force < 0)[:, None],
            COMPRESSION(np.maximum(-force, 0.0) / max(push, 1e-300)),
            TENSION(np.maximum(force, 0.0) / max(pull, 1e-300)),
        )
        colours[slack(scene, force)] = matplotlib.colors.to_rgba(SLACK_COLOUR)
        widths = np.where(scene.law == Law.BAR, 2.0 * thin, thin)
        draw_links(axes, shape[scene.links][drawn], colours[drawn], widths[drawn])
        if len(shape) <= FEW_NODES:
            axes.plot(*shape.T, "o", color="#333333", markersize=2.5)
        figure.text(0.02, 0.95, f"{scene.name}   t = {frame.time:.4g} s", fontsize=10)
        figure.canvas.draw()
        images.append(Image.fromarray(np.asarray(figure.canvas.buffer_rgba())[..., :3]).quantize(128))
    with atomic(path) as temporary:
        images[0].save(temporary, save_all=True, append_images=images[1:], duration=int(1000 * seconds), loop=0)


def _along(scene):
    """Return which links act along the line between their nodes, or between nodes at one place."""
    if scene.direction is None:
        return np.ones(len(scene.links), bool)
    line = scene.nodes[scene.links[:, 1]] - scene.nodes[scene.links[:, 0]]
    along = np.abs(np.einsum("ij,ij->i", line, scene.directions))
    return (scene.law != Law.TANGENT) & (along >= 0.5 * np.linalg.norm(line, axis=1))


def _draw_supports(axes, scene, shape):
    held = shape[scene.fixed.any(axis=1)]
    style = {"color": "#333333", "s": 18, "marker": "^", "linewidths": 0}
    if shape.shape[1] == 3:
        axes.scatter(*held.T, depthshade=False, **style)
    else:
        axes.scatter(*held.T, zorder=3, **style)


def _draw_forces(figure, axes, law, loose, segments, tensions):
    """Draw the links coloured by force, with the colour bars and the legend."""
    bar = law == Law.BAR
    push, pull = np.maximum(-tensions, 0.0), np.maximum(tensions, 0.0)
    divisor, unit = scaled(max(push.max(), pull.max()), "N")
    colours = np.where(
        (tensions < 0)[:, None],
        COMPRESSION(push / max(push.max(), 1e-300)),
        TENSION(pull / max(pull.max(), 1e-300)),
    )
    colours[loose] = matplotlib.colors.to_rgba(SLACK_COLOUR)
    thin = float(np.clip(45.0 / np.sqrt(len(tensions)), 0.28, 1.3))
    widths = np.where(bar, 2.0 * thin, thin)
    widths[loose] = 1.25 * thin
    touch = np.isin(law, (Law.CONTACT, Law.FRICTION))  # chains of force: as wide as they are strong
    widths[touch] = 6.0 * thin * push[touch] / max(push.max(), 1e-300)
    dashed = len(tensions) <= MANY_LINKS
    wide = widths > 0.0  # dashes are as long as lines are wide: PDF and SVG know none of no length
    styles = [(0, (2.0, 1.6)) if dashed and free else (0, None) for free in loose & wide]
    order = np.argsort(loose, kind="stable")  # slack links last: on top where depth does not decide
    draw_links(axes, segments[order], colours[order], widths[order], [styles[link] for link in order])

    bars = [("Compression", COMPRESSION, push), ("Tension", TENSION, pull)]
    shown = [entry for entry in bars if entry[2].max() > 0]
    for index, (label, colour, force) in enumerate(shown):
        rectangle = [0.84 + 0.078 * index, 0.50, 0.014, 0.36]
        colour_bar(figure, rectangle, colour, 0.0, force.max() / divisor, f"{label} ({unit})")
    keys = []
    if bar.any():
        keys.append(Line2D([], [], color="#555555", linewidth=2.6, label="bar"))
    for kind, name in (
        (Law.CABLE, "cable"),
        (Law.COMPRESSION_ONLY, "compression-only link"),
        (Law.INEXTENSIBLE, "inextensible cable"),
    ):
        chosen = law == kind
        if chosen.any():
            keys.append(Line2D([], [], color="#555555", linewidth=1.1, label=name))
            share = 100.0 * loose[chosen].mean()
            text = f"slack {name.removeprefix('inextensible ')} ({share:.3g} %)"
            keys.append(Line2D([], [], color=SLACK_COLOUR, linewidth=1.6, linestyle=(0, (2.0, 1.6)), label=text))
    if touch.any():
        text = f"contact, wide as its force\n({100.0 * loose[touch].mean():.3g} % are open)"
        keys.append(Line2D([], [], color="#555555", linewidth=3.0, label=text))
    figure.legend(handles=keys, loc="upper left", bbox_to_anchor=(0.82, 0.47), fontsize=9, frameon=False)


def _draw_subdomains(figure, segments, subdomain, three):
    """Draw the links coloured by subdomain, small, seen as the structure is."""
    palette = matplotlib.colormaps["tab20"].colors
    colours = np.array([palette[(7 * number) % 20] for number in range(subdomain.max() + 1)])[subdomain]
    points = segments.reshape(-1, segments.shape[2])
    rectangle = [0.79, 0.04, 0.205, 0.27]
    if three:
        axes = axes_3d(figure, rectangle, points, elevation=40.0, fill=0.95)
    else:
        axes = axes_2d(figure, rectangle, points)
    axes.set_axis_off()
    axes.patch.set_alpha(0.0)
    draw_links(axes, segments, colours, float(np.clip(30.0 / np.sqrt(len(segments)), 0.25, 1.0)))
    figure.text(0.8925, 0.025, f"{len(np.unique(subdomain))} subdomains", fontsize=9, ha="center")
