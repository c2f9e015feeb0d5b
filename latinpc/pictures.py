"""Pictures of structures: forces in the links on the deformed shape, and the article's Figures 8 and 9.

Compression is drawn in warm colours and tension in cool ones, in bars and cables alike; bars are thick,
cables thin, and slack cables and struts stand out in a colour of their own.
"""

from dataclasses import replace

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d import proj3d
from mpl_toolkits.mplot3d.art3d import Line3DCollection
from PIL import Image

from .io import atomic, slack
from .scenes.scene import Law

COMPRESSION = LinearSegmentedColormap.from_list("compression", ["#fdbb84", "#fc8d59", "#d7301f", "#67000d"])
TENSION = LinearSegmentedColormap.from_list("tension", ["#9ecae1", "#4a98c9", "#1764ab", "#08306b"])
SLACK_COLOUR = "#c800a1"
GHOST_COLOUR = (0.75, 0.75, 0.75, 0.8)
MANY_LINKS = 4000  # beyond, the undeformed shape and the supports only blur the picture
FEW_NODES = 600  # up to here, the nodes of a motion are drawn as dots
SUFFIXES = (".png", ".pdf", ".svg")


# ---- shared parts ----------------------------------------------------------------------------


def scaled(largest, unit):
    """Return (divisor, unit with prefix) that make `largest` readable, such as (1e3, 'kN')."""
    for divisor, prefix in ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n")):
        if largest >= divisor:
            return divisor, prefix + unit
    return 1.0, unit


def round_factor(value):
    """Return the largest of 1, 2, 5, 10, .. (and their fractions) that is not above `value`."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(digit for digit in (1, 2, 5) if digit * power <= value * (1 + 1e-12)))


def _figure(width, height):
    figure = Figure(figsize=(width, height), dpi=150, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def _save(figure, path):
    with atomic(path) as temporary:
        figure.savefig(temporary)


def _axes_3d(figure, rectangle, points, elevation=22.0, azimuth=-58.0, aspect=None, fill=0.84):
    """Return axes in perspective whose points fill that share of the rectangle, with pale panes."""
    axes = figure.add_axes(rectangle, projection="3d", proj_type="persp", focal_length=0.55)
    low, high = points.min(axis=0), points.max(axis=0)
    extent = np.maximum(high - low, 0.04 * (high - low).max())
    middle = (low + high) / 2
    aspect = np.asarray(extent if aspect is None else aspect, dtype=float)
    for axis, name in enumerate("xyz"):
        getattr(axes, f"set_{name}lim")(middle[axis] - extent[axis] / 2, middle[axis] + extent[axis] / 2)
        pane = getattr(axes, f"{name}axis")
        pane.set_pane_color((0.975, 0.975, 0.985, 1.0))
        pane._axinfo["grid"].update(color=(0.88, 0.88, 0.9, 1.0), linewidth=0.5)
        pane.set_major_locator(MaxNLocator(int(np.clip(7 * aspect[axis] / aspect.max(), 1, 7))))
    axes.view_init(elev=elevation, azim=azimuth)
    axes.tick_params(labelsize=8, pad=1)
    _fill(figure, axes, rectangle, np.array(list(np.ndindex(2, 2, 2))) * extent + middle - extent / 2, aspect, fill)
    return axes


def _fill(figure, axes, rectangle, corners, aspect, fill):
    """Zoom and shift axes in perspective until the corners of their box fill the rectangle."""
    left, bottom, width, height = rectangle
    zoom = 1.0
    for _ in range(3):  # perspective is not quite proportional to the zoom
        axes.set_box_aspect(aspect, zoom=zoom)
        seen = figure.transFigure.inverted().transform(_pixels(axes, corners))
        size = np.ptp(seen, axis=0)
        zoom *= fill * min(width / size[0], height / size[1])
    axes.set_box_aspect(aspect, zoom=zoom)
    shift = np.array([left + width / 2, bottom + height / 2]) - (seen.min(axis=0) + seen.max(axis=0)) / 2
    axes.set_position([left + shift[0], bottom + shift[1], width, height])


def _draw(axes, segments, colours, widths, styles="solid", zorder=2):
    """Add segments (m, 2, 2 or 3) to axes of either dimension."""
    if segments.shape[2] == 3:
        # one collection for all links, so that they hide each other according to their depth
        lines = Line3DCollection(segments, colors=colours, linewidths=widths, linestyles=styles)
        lines.set_clip_on(False)  # the axes' own square frame is smaller than the room they have
        axes.add_collection3d(lines)
    else:
        lines = LineCollection(segments, colors=colours, linewidths=widths, linestyles=styles, zorder=zorder)
        lines.set_capstyle("round")
        axes.add_collection(lines)


def _colour_bar(figure, rectangle, colours, low, high, label):
    axes = figure.add_axes(rectangle)
    bar = figure.colorbar(ScalarMappable(Normalize(low, high), colours), cax=axes)
    bar.set_label(label, fontsize=9)
    bar.ax.tick_params(labelsize=8)
    bar.outline.set_linewidth(0.4)


def _plane_points(points):
    """Return points as (n, 2) or (n, 3): a chain in one dimension is drawn along x."""
    if points.shape[1] > 1:
        return points
    return np.column_stack([points[:, 0], np.zeros(len(points))])


def _label_axes(figure, axes, vertical="z (m)", gaps=(50.0, 50.0, 58.0)):
    """Name the axes; in perspective along the edges that carry the ticks, that many points away from them."""
    labels = ("x (m)", "y (m)", vertical)
    if axes.name != "3d":
        axes.set_xlabel(labels[0], fontsize=9)
        axes.set_ylabel(labels[1], fontsize=9)
        return
    (x0, x1), (y0, y1), (z0, z1) = axes.get_xlim3d(), axes.get_ylim3d(), axes.get_zlim3d()
    # seen from azimuths between -90 and 0 degrees, matplotlib puts the ticks on these three edges
    edges = (((x0, y0, z0), (x1, y0, z0)), ((x1, y0, z0), (x1, y1, z0)), ((x1, y1, z0), (x1, y1, z1)))
    middle = _pixels(axes, [((x0 + x1) / 2, (y0 + y1) / 2, (z0 + z1) / 2)])[0]
    for label, edge, points in zip(labels, edges, gaps):
        start, end = _pixels(axes, edge)
        along = (end - start) / np.linalg.norm(end - start)
        outward = np.array([along[1], -along[0]])
        outward *= np.sign(outward @ ((start + end) / 2 - middle)) or 1.0
        place = figure.transFigure.inverted().transform((start + end) / 2 + outward * points * figure.dpi / 72.0)
        angle = np.degrees(np.arctan2(along[1], along[0]))
        figure.text(*place, label, fontsize=9, ha="center", va="center", rotation=(angle + 90.0) % 180.0 - 90.0)


def _pixels(axes, points):
    """Return the place on the canvas of points in perspective."""
    axes.apply_aspect()
    x, y, _ = proj3d.proj_transform(*np.asarray(points, dtype=float).T, axes.get_proj())
    return axes.transData.transform(np.column_stack([x, y]))


# ---- any structure ---------------------------------------------------------------------------


def draw_structure(scene, displacements, tensions, subdomain=None, path="structure.png", amplification=None):
    """Draw the deformed structure with the forces in its links, and its subdomains.

    Parameters
    ----------
    scene : Scene
    displacements : (n, dim) array
        In m.
    tensions : (m,) array
        In N, compression negative.
    subdomain : (m,) array of int, optional
        Subdomain of each link, drawn in a corner.
    path : str or path-like
        A ``.png``, ``.pdf`` or ``.svg`` file, replaced only once it is complete.
    amplification : float, optional
        Of the displacements; by default a round number that makes them visible.
    """
    tensions = np.asarray(tensions, dtype=float)
    seen = _along(scene)
    if not seen.all():  # what acts across the line between its nodes is no line to draw
        names = ("links", "law", "stiffness", "prestrain", "direction", "friction", "subdomain")
        given = {name: getattr(scene, name)[seen] for name in names if getattr(scene, name) is not None}
        if scene.subdomain is not None:
            given["subdomain"] = None
        scene = replace(scene, **given)
        tensions = tensions[seen]
        subdomain = None if subdomain is None else np.asarray(subdomain)[seen]
    nodes, moved = _plane_points(scene.nodes), _plane_points(np.asarray(displacements, dtype=float))
    if scene.dim == 1:
        moved[:, 1] = 0.0
    span = np.ptp(nodes, axis=0).max()
    largest = np.linalg.norm(moved, axis=1).max(initial=0.0)
    if amplification is None:
        amplification = round_factor(0.08 * span / largest) if largest > 0 else 1.0
    shape = nodes + amplification * moved
    three, few = nodes.shape[1] == 3, len(scene.links) <= MANY_LINKS

    figure = _figure(12.0, 7.2)
    both = np.vstack([nodes, shape])
    if three:
        axes = _axes_3d(figure, [0.0, 0.0, 0.80, 0.93], both)
    else:
        axes = _axes_2d(figure, [0.07, 0.08, 0.66, 0.83], both)
    _label_axes(figure, axes)
    if few:
        _draw(axes, nodes[scene.links], [GHOST_COLOUR], 0.5, zorder=1)
        _draw_supports(axes, scene, shape)
    _draw_forces(figure, axes, scene, shape[scene.links], tensions)
    if subdomain is not None and np.max(subdomain) > 0:
        _draw_subdomains(figure, nodes[scene.links], np.asarray(subdomain), three)
    divisor, unit = scaled(largest, "m")
    figure.text(0.02, 0.955, scene.name, fontsize=14, weight="bold")
    figure.text(
        0.98, 0.958,
        f"{len(scene.links):,} links · largest displacement {largest / divisor:.3g} {unit}"
        + (f", drawn × {amplification:g}" if largest > 0 else ""),
        fontsize=10, ha="right",
    )  # fmt: skip
    _save(figure, path)


def draw_motion(motion, path, amplification=1.0, seconds=0.06):
    """Draw the frames of a motion as an animation, seen from one place and coloured on one scale.

    Parameters
    ----------
    motion : latinpc.motion.Motion
    path : str or path-like
        A ``.gif`` file, replaced only once it is complete.
    amplification : float
        Of the displacements.
    seconds : float
        That each frame is shown for.
    """
    scene = motion.scene
    shapes = [_plane_points(scene.nodes + amplification * frame.displacements) for frame in motion.frames]
    push = max(max(np.max(-frame.tensions), 0.0) for frame in motion.frames)
    pull = max(max(np.max(frame.tensions), 0.0) for frame in motion.frames)
    points = np.vstack(shapes)
    thin = float(np.clip(45.0 / np.sqrt(len(scene.links)), 0.28, 1.3))
    drawn = ~np.isin(scene.law, (Law.CONTACT, Law.FRICTION, Law.TANGENT))  # what touches is no line
    images = []
    for frame, shape in zip(motion.frames, shapes):
        figure = _figure(6.4, 4.8)
        figure.set_dpi(100)
        if shape.shape[1] == 3:
            axes = _axes_3d(figure, [0.0, 0.0, 1.0, 0.93], points)
        else:
            axes = _axes_2d(figure, [0.1, 0.08, 0.86, 0.83], points)
        force = frame.tensions
        colours = np.where(
            (force < 0)[:, None],
            COMPRESSION(np.maximum(-force, 0.0) / max(push, 1e-300)),
            TENSION(np.maximum(force, 0.0) / max(pull, 1e-300)),
        )
        colours[slack(scene, force)] = matplotlib.colors.to_rgba(SLACK_COLOUR)
        widths = np.where(scene.law == Law.BAR, 2.0 * thin, thin)
        _draw(axes, shape[scene.links][drawn], colours[drawn], widths[drawn])
        if len(shape) <= FEW_NODES:
            axes.plot(*shape.T, "o", color="#333333", markersize=2.5)
        figure.text(0.02, 0.95, f"{scene.name}   t = {frame.time:.4g} s", fontsize=10)
        figure.canvas.draw()
        images.append(Image.fromarray(np.asarray(figure.canvas.buffer_rgba())[..., :3]).quantize(128))
    with atomic(path) as temporary:
        images[0].save(temporary, save_all=True, append_images=images[1:], duration=int(1000 * seconds), loop=0)


def _axes_2d(figure, rectangle, points):
    axes = figure.add_axes(rectangle)
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.04 * (high - low).max()
    axes.set_xlim(low[0] - margin, high[0] + margin)
    axes.set_ylim(low[1] - margin, high[1] + margin)
    axes.set_aspect("equal")
    axes.tick_params(labelsize=8)
    axes.grid(color="#e8e8ec", linewidth=0.5)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    return axes


def _along(scene):
    """Tell which links act along the line between their nodes, or between nodes at one place."""
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


def _draw_forces(figure, axes, scene, segments, tensions):
    """Draw the links coloured by force, with the colour bars and the legend."""
    bar = scene.law == Law.BAR
    loose = slack(scene, tensions)
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
    touch = np.isin(scene.law, (Law.CONTACT, Law.FRICTION))  # chains of force: as wide as they are strong
    widths[touch] = 6.0 * thin * push[touch] / max(push.max(), 1e-300)
    dashed = len(tensions) <= MANY_LINKS
    styles = [(0, (2.0, 1.6)) if dashed and free else (0, None) for free in loose]
    order = np.argsort(loose, kind="stable")  # slack links last: on top where depth does not decide
    _draw(axes, segments[order], colours[order], widths[order], [styles[link] for link in order])

    bars = [("Compression", COMPRESSION, push), ("Tension", TENSION, pull)]
    shown = [entry for entry in bars if entry[2].max() > 0]
    for index, (label, colour, force) in enumerate(shown):
        rectangle = [0.84 + 0.078 * index, 0.50, 0.014, 0.36]
        _colour_bar(figure, rectangle, colour, 0.0, force.max() / divisor, f"{label} ({unit})")
    keys = []
    if bar.any():
        keys.append(Line2D([], [], color="#555555", linewidth=2.6, label="bar"))
    for law, name in (
        (Law.CABLE, "cable"),
        (Law.STRUT, "strut"),
        (Law.INEXTENSIBLE, "inextensible cable"),
    ):
        chosen = scene.law == law
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
        axes = _axes_3d(figure, rectangle, points, elevation=40.0, fill=0.95)
    else:
        axes = _axes_2d(figure, rectangle, points)
    axes.set_axis_off()
    axes.patch.set_alpha(0.0)
    _draw(axes, segments, colours, float(np.clip(30.0 / np.sqrt(len(segments)), 0.25, 1.0)))
    figure.text(0.8925, 0.025, f"{len(np.unique(subdomain))} subdomains", fontsize=9, ha="center")


# ---- Figures 8 and 9 of the article ----------------------------------------------------------


def draw_figure_8(scene, displacements, path, amplification=2.0):
    """Draw the deformed grid coloured by vertical displacement, as in Figure 8."""
    vertical = displacements[:, 2]
    shape = scene.nodes + amplification * np.column_stack([0 * vertical, 0 * vertical, vertical])
    level = vertical[scene.links].mean(axis=1)
    colours = matplotlib.colormaps["turbo"]
    norm = Normalize(level.min(), max(level.max(), level.min() + 1e-300))

    figure = _figure(12.0, 5.6)
    axes = _axes_3d(figure, [0.01, 0.02, 0.87, 0.92], shape, elevation=24.0, azimuth=-52.0, fill=0.84)
    _label_axes(figure, axes, gaps=(58.0, 62.0, 68.0))
    width = float(np.clip(70.0 / np.sqrt(len(level)), 0.3, 1.5))
    _draw(axes, shape[scene.links], colours(norm(level)), width)
    _colour_bar(figure, [0.915, 0.2, 0.014, 0.6], colours, norm.vmin, norm.vmax, "Vertical displacement (m)")
    _title(figure, scene, tensions=None, text=f"Vertical displacement, drawn × {amplification:g}")
    _save(figure, path)


def draw_figure_9(scene, tensions, path):
    """Draw the compressions in the bars and the tensions in the cables as heights, as in Figure 9."""
    figure = _figure(14.0, 5.8)
    panels = (
        (scene.law == Law.BAR, -tensions, "Compression in bars", COMPRESSION),
        (scene.law == Law.CABLE, tensions, "Tension in cables", TENSION),
    )
    for index, (chosen, force, label, colours) in enumerate(panels):
        force = force[chosen]
        divisor, unit = scaled(np.abs(force).max(initial=0.0), "N")
        segments = scene.nodes[scene.links[chosen]].copy()
        segments[:, :, 2] = (force / divisor)[:, None]
        left = 0.5 * index
        points = segments.reshape(-1, 3)
        points = np.vstack([points, [points[0, 0], points[0, 1], 0.0]])  # heights count from zero
        axes = _axes_3d(
            figure, [left, 0.02, 0.42, 0.88], points, elevation=20.0, azimuth=-52.0,
            aspect=(1.0, 1.0, 0.62), fill=0.86,
        )  # fmt: skip
        _label_axes(figure, axes, f"{label} ({unit})", gaps=(44.0, 44.0, 42.0))
        low, high = force.min() / divisor, force.max() / divisor
        shade = (segments[:, 0, 2] - low) / max(high - low, 1e-300)
        _draw(axes, segments, colours(shade), 0.9)
        _colour_bar(figure, [left + 0.455, 0.25, 0.007, 0.5], colours, low, high, unit)
        figure.text(left + 0.22, 0.89, label, fontsize=12, ha="center")
    _title(figure, scene, tensions)
    _save(figure, path)


def _title(figure, scene, tensions, text=None):
    subdomains = "" if scene.subdomain is None else f"{scene.n_subdomains} subdomains, "
    figure.text(0.02, 0.95, f"{scene.name}: {subdomains}{len(scene.links):,} links", fontsize=13, weight="bold")
    if tensions is not None:
        cables = scene.law == Law.CABLE
        text = f"{100.0 * slack(scene, tensions)[cables].mean():.3g} % of the cables slack"
    figure.text(0.98, 0.95, text, fontsize=11, ha="right")
