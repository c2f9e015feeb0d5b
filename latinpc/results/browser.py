"""Structures to be turned with a mouse, by plotly: in notebooks, and as one file for a browser."""

from __future__ import annotations

import pathlib

import matplotlib
import numpy as np

from .atomic import atomic, check_writable
from .drawing import LOAD_COLOUR, STAMP_COLOUR, SUPPORT_COLOUR, plane_points
from .look import SLACK_COLOUR, Scale, law_colours, law_name
from .mechanics import slack
from .pictures import amplification_of, drawn_links
from .symbols import MANY_SYMBOLS, arrows, supports
from .units import number, quantity, scaled

STOPS = 64  # of a colour scale
WIDTHS = {True: 7.0, False: 3.0}  # of bars, of others, in pixels


def interactive_figure(
    scene, displacements=None, tensions=None, *, amplification=None, load=None, word="", real=True, geometry="linear"
):
    """Draw a structure in a plotly figure: with results its forces on the deformed shape, else its laws.

    Whatever is under the mouse says its number, law, force and displacement. The legend switches parts off and on.

    Parameters
    ----------
    scene : Scene or Structure
    displacements : (n, dim) array, optional
        In m.
    tensions : (m,) array, optional
        In N, compression negative; given with the displacements.
    amplification : float, optional
        Of the displacements; by default a round number that makes them visible.
    load : (n, dim) array, optional
        In N, that of the scene when not given.
    word : str
        A warning in the title.
    real : bool
        False: displacements are a motion of any size.
    geometry : str
        That of the solve: with ``"large"`` displacements are drawn as they are, or larger.

    Returns
    -------
    plotly.graph_objects.Figure

    Raises
    ------
    RuntimeError
        Without plotly.
    """
    graph = _plotly()
    nodes, seen = plane_points(scene.nodes), drawn_links(scene)
    moved = np.zeros(nodes.shape) if displacements is None else plane_points(np.asarray(displacements, dtype=float))
    largest = np.linalg.norm(moved, axis=1).max(initial=0.0)
    amplification = amplification_of(nodes, largest, amplification, geometry)
    shape, ends = nodes + amplification * moved, scene.links[seen]
    traces = []
    if tensions is not None:
        traces.append(_lines(graph, nodes[ends], "#bbbbbb", "undeformed", 1.0, visible="legendonly"))
        traces += _forces(graph, scene, seen, shape, np.asarray(tensions, dtype=float))
    else:
        traces += _laws(graph, scene, seen, shape)
    traces.append(_nodes(graph, scene, shape, moved if displacements is not None else None))
    for symbol in supports(scene.fixed, nodes, ends, shape):
        traces += _symbol(graph, symbol)
    load = plane_points(np.asarray(scene.load if load is None else load, dtype=float))
    lines, acting = arrows(load, nodes, ends, shape)
    if 0 < len(acting) <= MANY_SYMBOLS:
        label = f"load ({len(acting):,}), largest {quantity(np.linalg.norm(load, axis=1).max(), 'N')}"
        traces.append(_lines(graph, lines, LOAD_COLOUR, label, 3.0))
    figure = graph.Figure(traces)
    divisor, unit = scaled(largest, "m")
    title = f"<b>{scene.name}</b>"
    if displacements is not None and real:
        title += f"   largest displacement {largest / divisor:.3g} {unit}, drawn × {number(amplification)}"
    if word:
        title += f"<br><span style='color:{STAMP_COLOUR}'>{word}</span>"
    _lay_out(figure, title, flat=nodes.shape[1] == 2)
    return figure


def write_html(figure, path):
    """Write a plotly figure with all it needs into one ``.html`` file, replaced only once it is complete."""
    check_writable(path, (".html", ".htm"))
    text = figure.to_html(include_plotlyjs=True, full_html=True, default_height="98vh", config={"displaylogo": False})
    with atomic(path) as temporary:
        pathlib.Path(temporary).write_text(text, encoding="utf-8")


def _plotly():
    try:
        import plotly.graph_objects
    except ImportError as error:
        raise RuntimeError("pictures for a browser need plotly: pip install 'latinpc[interactive]'") from error
    return plotly.graph_objects


def _places(points):
    """Return x, y, z of points in the plane or in space."""
    return (*points.T, np.zeros(len(points))) if points.shape[1] == 2 else tuple(points.T)


def _broken(segments):
    """Return the points of segments (m, 2, d) as one line with gaps, (3 m, d)."""
    gaps = np.full((len(segments), 1, segments.shape[2]), np.nan)
    return np.concatenate([segments, gaps], axis=1).reshape(-1, segments.shape[2])


def _lines(graph, segments, colour, name, width, values=None, **how):
    """Return a trace of segments; with values (m,) the colour is a scale of theirs."""
    x, y, z = _places(_broken(segments))
    line = {"color": colour, "width": width}
    if values is not None:
        line = {**colour, "color": np.repeat(values, 3), "width": width}
    how = {"mode": "lines", "name": name, "line": line, "hoverinfo": "skip", "showlegend": True} | how
    return graph.Scatter3d(x=x, y=y, z=z, **how)


def _texts(graph, points, texts, name):
    """Return a trace that is not seen, and says something of each point under the mouse."""
    x, y, z = _places(points)
    return graph.Scatter3d(
        x=x, y=y, z=z, mode="markers", marker={"size": 6, "opacity": 0.0}, text=texts, hoverinfo="text", name=name,
        showlegend=False,
    )  # fmt: skip


def _kinds(scene, seen):
    """Return (name, links) for each law of the links that are drawn."""
    return [(law_name(law), seen & (scene.law == law)) for law in np.unique(scene.law[seen])]


def _forces(graph, scene, seen, shape, tensions):
    """Return the traces of links coloured by their forces, slack ones apart, and what they say."""
    scale, loose = Scale(tensions[seen]), slack(scene, tensions)
    stops = np.linspace(0.0, 1.0, STOPS)
    colours = scale.colours(scale.low + stops * (scale.high - scale.low))
    bar = {"title": {"text": scale.label, "side": "right"}, "x": 0.82, "len": 0.45, "y": 0.72, "thickness": 14}
    look = {
        "colorscale": [[stop, matplotlib.colors.to_hex(colour)] for stop, colour in zip(stops, colours)],
        "cmin": scale.low / scale.divisor,
        "cmax": scale.high / scale.divisor,
    }
    traces = []
    for name, links in _kinds(scene, seen):
        for chosen, is_slack in ((links & ~loose, False), (links & loose, True)):
            segments = shape[scene.links[chosen]]
            if is_slack and len(segments):
                traces.append(_lines(graph, segments, SLACK_COLOUR, f"{name}, slack ({len(segments):,})", 3.0))
            elif len(segments):
                with_bar = {"showscale": True, "colorbar": bar} if not traces and scale.largest > 0.0 else {}
                label, width = f"{name} ({len(segments):,})", WIDTHS[name == "bar"]
                values = tensions[chosen] / scale.divisor
                traces.append(_lines(graph, segments, look | with_bar, label, width, values))
    numbers = np.flatnonzero(seen)
    said = [f"{_said(scene, link)}<br>{'slack' if loose[link] else quantity(tensions[link], 'N')}" for link in numbers]
    return [*traces, _texts(graph, shape[scene.links[numbers]].mean(axis=1), said, "links")]


def _laws(graph, scene, seen, shape):
    """Return the traces of links coloured by their laws, and what they say."""
    traces = []
    for name, links in _kinds(scene, seen):
        colour = law_colours(scene.law[links][:1])[0]
        label = f"{name} ({np.count_nonzero(links):,})"
        traces.append(_lines(graph, shape[scene.links[links]], str(colour), label, WIDTHS[name == "bar"]))
    numbers = np.flatnonzero(seen)
    said = [f"{_said(scene, link)}<br>stiffness {quantity(scene.stiffness[link], 'N/m')}" for link in numbers]
    return [*traces, _texts(graph, shape[scene.links[numbers]].mean(axis=1), said, "links")]


def _said(scene, link):
    """Return what is said of a link: its name, law and nodes."""
    ends = " to ".join(map(scene.node_name, scene.links[link]))
    return f"link {scene.link_name(link)}: {law_name(scene.law[link])}, {ends}"


def _nodes(graph, scene, shape, moved):
    """Return the trace of the nodes, small dots that say where they are and how far they move."""
    said = [
        f"node {scene.node_name(node)} ({', '.join(f'{value:.4g}' for value in place)}) m"
        for node, place in enumerate(scene.nodes)
    ]
    if moved is not None:
        said = [f"{text}<br>moves by {quantity(np.linalg.norm(vector), 'm')}" for text, vector in zip(said, moved)]
    x, y, z = _places(shape)
    marker = {"size": 1.5, "color": "#333333"}
    return graph.Scatter3d(x=x, y=y, z=z, mode="markers", marker=marker, text=said, hoverinfo="text", name="nodes")


def _symbol(graph, symbol):
    """Return the traces of supports of one kind."""
    x, y, z = _places(symbol.triangles.reshape(-1, symbol.triangles.shape[2]))
    corner = np.arange(len(x)).reshape(-1, 3).T
    colour = SUPPORT_COLOUR if symbol.filled else "#eeeeee"
    label = f"{symbol.label} ({len(np.unique(symbol.nodes)):,})"
    how = {"color": colour, "flatshading": True, "hoverinfo": "skip", "name": label, "legendgroup": symbol.label}
    mesh = graph.Mesh3d(x=x, y=y, z=z, **dict(zip("ijk", corner)), showlegend=True, **how)
    edges = np.concatenate([symbol.triangles[:, [i, (i + 1) % 3]] for i in range(3)] + [symbol.lines])
    rim = _lines(graph, edges, SUPPORT_COLOUR, label, 2.0, showlegend=False, legendgroup=symbol.label)
    return [mesh, rim]


def _lay_out(figure, title, flat):
    """Give both axes one scale, and look from the side, or from above at a structure in the plane."""
    axis = {"backgroundcolor": "#f8f8fb", "gridcolor": "#dddddd", "showbackground": True}
    space = {f"{name}axis": axis | {"title": {"text": f"{name} (m)"}} for name in "xyz"}
    eye = {"x": 0.0, "y": 0.0, "z": 2.0} if flat else {"x": 0.9, "y": -1.5, "z": 0.7}
    up = {"x": 0, "y": 1, "z": 0} if flat else {"x": 0, "y": 0, "z": 1}
    camera = {"eye": eye, "up": up, "projection": {"type": "orthographic" if flat else "perspective"}}
    if flat:
        space["zaxis"] = {"visible": False}
    places = np.concatenate([np.column_stack([trace.x, trace.y, trace.z]).astype(float) for trace in figure.data])
    extent = np.nanmax(places, axis=0) - np.nanmin(places, axis=0)
    extent = 1.3 * np.maximum(extent, 0.04 * extent.max()) / extent.max()  # what the camera has in its sight
    space |= {"aspectmode": "manual", "aspectratio": dict(zip("xyz", extent))}
    figure.update_layout(
        title={"text": title, "x": 0.02},
        scene={**space, "camera": camera, "dragmode": "pan" if flat else "turntable", "domain": {"x": [0.0, 0.8]}},
        margin={"l": 0, "r": 0, "t": 60, "b": 0},
        legend={"x": 0.81, "y": 0.45, "xanchor": "left", "yanchor": "top"},
        paper_bgcolor="white",
    )
