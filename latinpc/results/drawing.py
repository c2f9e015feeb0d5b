"""Draw in two and three dimensions: figures, axes, links, symbols, scales, stamps."""

from __future__ import annotations

import io

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, MaxNLocator
from mpl_toolkits.mplot3d import proj3d
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

from .atomic import atomic
from .units import quantity

STEPS = [1, 2, 2.5, 5, 10]  # between ticks, times a power of ten
GAPS = (50.0, 50.0, 58.0)  # points: labels of the axes in perspective from their edges
LABEL = 15.0  # points: half of the room of such a label, and of those of ticks beside the box
SHORT, FARTHER = 90.0, 22.0  # points: level edges so short have their label farther from their ticks
SUPPORT_COLOUR, LOAD_COLOUR, STAMP_COLOUR = "#333333", "#1b7837", "#d7191c"


class Picture(Figure):
    """A matplotlib figure that notebooks show without pyplot."""

    def _repr_png_(self):
        memory = io.BytesIO()
        self.savefig(memory, format="png", dpi=90)
        return memory.getvalue()


def new_figure(width, height):
    """Make a white figure; width and height in inches."""
    figure = Picture(figsize=(width, height), dpi=150, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def save(figure, path):
    """Write a figure, whole or not at all; the suffix of the path chooses the format."""
    with atomic(path) as temporary:
        figure.savefig(temporary)


def axes_2d(figure, rectangle, points):
    """Return plane axes around points (n, 2), with one scale for both directions."""
    axes = figure.add_axes(rectangle)
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.04 * (high - low).max()
    axes.set_xlim(low[0] - margin, high[0] + margin)
    axes.set_ylim(low[1] - margin, high[1] + margin)
    axes.set_aspect("equal")
    for axis, share in zip((axes.xaxis, axes.yaxis), (high - low) / (high - low).max()):
        room = int(9 * share)  # for labels that do not overlap
        axis.set_major_locator(MaxNLocator(room, steps=STEPS) if room else FixedLocator([]))
    axes.tick_params(labelsize=8)
    axes.grid(color="#e8e8ec", linewidth=0.5)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    return axes


def axes_3d(figure, rectangle, points, elevation=22.0, azimuth=-58.0, aspect=None, fill=0.97, gaps=GAPS):
    """Return axes in perspective that fill that share of the rectangle with labels so far away; panes are pale."""
    axes = figure.add_axes(rectangle, projection="3d", proj_type="persp", focal_length=0.55)
    axes.computed_zorder = False  # symbols lie above links, whatever is nearer
    low, high = points.min(axis=0), points.max(axis=0)
    extent = np.maximum(high - low, 0.04 * (high - low).max())
    middle = (low + high) / 2
    aspect = np.asarray(extent if aspect is None else aspect, dtype=float)
    for axis, name in enumerate("xyz"):
        getattr(axes, f"set_{name}lim")(middle[axis] - extent[axis] / 2, middle[axis] + extent[axis] / 2)
        pane = getattr(axes, f"{name}axis")
        pane.set_pane_color((0.975, 0.975, 0.985, 1.0))
        pane._axinfo["grid"].update(color=(0.88, 0.88, 0.9, 1.0), linewidth=0.5)
        pane.set_major_locator(MaxNLocator(int(np.clip(7 * aspect[axis] / aspect.max(), 1, 7)), steps=STEPS))
    axes.view_init(elev=elevation, azim=azimuth)
    axes.tick_params(labelsize=8, pad=1)
    corners = np.array(list(np.ndindex(2, 2, 2))) * extent + middle - extent / 2
    _fill(figure, axes, np.array(rectangle), corners, aspect, fill, gaps)
    return axes


def _fill(figure, axes, rectangle, corners, aspect, fill, gaps):
    """Zoom and shift axes in perspective until the corners of their box, and the labels, fill the rectangle."""
    zoom, unit = 1.0, figure.dpi / 72.0
    for _ in range(4):  # perspective is not quite proportional to the zoom
        axes.set_box_aspect(aspect, zoom=zoom)
        box = _pixels(axes, corners)
        written = np.vstack([box, *(place for place, _ in _label_places(figure, axes, gaps))]) if len(gaps) else box
        seen = np.vstack([written - LABEL * unit, written + LABEL * unit]) if len(gaps) else box
        size, room = np.ptp(box, axis=0), fill * rectangle[2:] * figure.bbox.size
        zoom *= max(((room - np.ptp(seen, axis=0) + size) / size).min(), 0.1)
    middle = figure.transFigure.inverted().transform((seen.min(axis=0) + seen.max(axis=0)) / 2)
    axes.set_position([*(2.0 * rectangle[:2] + rectangle[2:] / 2 - middle), *rectangle[2:]])


def axes_for(figure, rectangle, points, **three):
    """Return axes of the dimension of the points (n, 2 or 3); `three` goes to those in perspective."""
    if points.shape[1] == 3:
        return axes_3d(figure, rectangle, points, **three)
    return axes_2d(figure, rectangle, points)


def draw_links(axes, segments, colours, widths, styles="solid", zorder=2):
    """Add segments (m, 2, 2 or 3) to axes of either dimension; of one zorder depth decides what hides what."""
    if segments.shape[2] == 3:
        # one collection for all links, so that they hide each other according to their depth
        lines = Line3DCollection(segments, colors=colours, linewidths=widths, linestyles=styles, zorder=zorder)
        lines.set_clip_on(False)  # the axes' own square frame is smaller than the room they have
        axes.add_collection3d(lines)
    else:
        lines = LineCollection(segments, colors=colours, linewidths=widths, linestyles=styles, zorder=zorder)
        lines.set_capstyle("round")
        axes.add_collection(lines)


def draw_discs(axes, points, colours, diameters, zorder=3):
    """Add discs (m,) at points (m, 2 or 3) to axes of either dimension, above the links; diameters in points."""
    depth = {"depthshade": False} if points.shape[1] == 3 else {}
    axes.scatter(*points.T, s=diameters**2, c=colours, linewidths=0.0, zorder=zorder, clip_on=False, **depth)


def draw_symbols(axes, symbols, colour=SUPPORT_COLOUR):
    """Add the triangles and lines of `latinpc.results.symbols.Symbol` to axes of either dimension, above the links."""
    for symbol in symbols:
        face = colour if symbol.filled else "white"
        collection = Poly3DCollection if symbol.triangles.shape[2] == 3 else PolyCollection
        edge = "#bbbbbb" if symbol.filled and symbol.triangles.shape[2] == 3 else colour
        shapes = collection(symbol.triangles, facecolors=face, edgecolors=edge, linewidths=0.5, zorder=5)
        shapes.set_clip_on(False)
        add = axes.add_collection3d if symbol.triangles.shape[2] == 3 else axes.add_collection
        add(shapes)
        if len(symbol.lines):
            draw_links(axes, symbol.lines, colour, 0.9, zorder=5)


def draw_arrows(axes, lines, colour=LOAD_COLOUR):
    """Add arrows of `latinpc.results.symbols.arrows` to axes of either dimension, above all else."""
    if len(lines):
        draw_links(axes, lines, colour, 0.9, zorder=6)


def symbol_keys(symbols):
    """Return the keys of a legend for supports: how many nodes have which."""
    keys = []
    for symbol in symbols:
        face = SUPPORT_COLOUR if symbol.filled else "white"
        style = {"marker": "^", "markersize": 6, "markeredgecolor": SUPPORT_COLOUR, "markerfacecolor": face}
        count = len(np.unique(symbol.nodes))
        keys.append(Line2D([], [], linestyle="none", label=f"{symbol.label} ({count:,})", **style))
    return keys


def load_keys(count, largest, shown):
    """Return the key of a legend for the loads on so many nodes, the largest in N; none without loads."""
    if not count:
        return []
    marker = {"marker": r"$\rightarrow$", "markersize": 11} if shown else {}
    text = f"load ({count:,}), largest {quantity(largest, 'N')}" + ("" if shown else "\n(not drawn)")
    return [Line2D([], [], color=LOAD_COLOUR, linestyle="none", label=text, **marker)]


def stamp(figure, word, reason=""):
    """Write across a figure what must not be overlooked, and why in a line below its title."""
    style = {"color": STAMP_COLOUR, "alpha": 0.28, "weight": "bold", "rotation": 22.0, "ha": "center", "va": "center"}
    figure.text(0.40, 0.47, word, fontsize=40.0 if len(word) > 14 else 56.0, zorder=20, **style)
    if reason:
        figure.text(0.02, 0.915, reason, fontsize=10, color=STAMP_COLOUR, parse_math=False)


def colour_bar(figure, rectangle, colours, low, high, label):
    """Add a colour bar from low to high at a rectangle of the figure."""
    axes = figure.add_axes(rectangle)
    bar = figure.colorbar(ScalarMappable(Normalize(low, high), colours), cax=axes)
    bar.set_label(label, fontsize=9)
    bar.ax.tick_params(labelsize=8)
    bar.outline.set_linewidth(0.4)


def force_bar(figure, rectangle, scale):
    """Add the colour bar of a `Scale` of forces, unless all of them are zero."""
    if scale.largest > 0.0:
        colour_bar(figure, rectangle, scale.map(), scale.low / scale.divisor, scale.high / scale.divisor, scale.label)


def plane_points(points):
    """Return points as (n, 2) or (n, 3): a chain in one dimension is drawn along x."""
    if points.shape[1] > 1:
        return points
    return np.column_stack([points[:, 0], np.zeros(len(points))])


def label_axes(figure, axes, vertical="z (m)", gaps=GAPS):
    """Name the axes; in perspective along the edges that carry the ticks, that many points away from them."""
    labels = ("x (m)", "y (m)", vertical)
    if axes.name != "3d":
        axes.set_xlabel(labels[0], fontsize=9)
        axes.set_ylabel(labels[1], fontsize=9)
        return
    for label, (place, angle) in zip(labels, _label_places(figure, axes, gaps)):
        place = figure.transFigure.inverted().transform(place)
        figure.text(*place, label, fontsize=9, ha="center", va="center", rotation=(angle + 90.0) % 180.0 - 90.0)


def _label_places(figure, axes, gaps):
    """Return for each axis in perspective where its label stands (pixels), and the direction of its edge (degrees)."""
    (x0, x1), (y0, y1), (z0, z1) = axes.get_xlim3d(), axes.get_ylim3d(), axes.get_zlim3d()
    # seen from azimuths between -90 and 0 degrees, matplotlib puts the ticks on these three edges
    edges = (((x0, y0, z0), (x1, y0, z0)), ((x1, y0, z0), (x1, y1, z0)), ((x1, y1, z0), (x1, y1, z1)))
    middle = _pixels(axes, [((x0 + x1) / 2, (y0 + y1) / 2, (z0 + z1) / 2)])[0]
    places = []
    for axis, (edge, points) in enumerate(zip(edges, gaps)):
        start, end = _pixels(axes, edge)
        length = np.linalg.norm(end - start)
        along = (end - start) / length
        points += FARTHER if axis < 2 and length * 72.0 / figure.dpi < SHORT else 0.0
        outward = np.array([along[1], -along[0]])
        outward *= np.sign(outward @ ((start + end) / 2 - middle)) or 1.0
        place = (start + end) / 2 + outward * points * figure.dpi / 72.0
        places.append((place, np.degrees(np.arctan2(along[1], along[0]))))
    return places


def _pixels(axes, points):
    """Return the place on the canvas of points in perspective."""
    axes.apply_aspect()
    x, y, _ = proj3d.proj_transform(*np.asarray(points, dtype=float).T, axes.get_proj())
    return axes.transData.transform(np.column_stack([x, y]))
