"""Write and draw the envelope of load cases: the lowest and the highest force of each link."""

from __future__ import annotations

import numpy as np
from matplotlib.colors import to_rgba
from matplotlib.lines import Line2D

from latinpc.laws import UNILATERAL

from .drawing import (
    STAMP_COLOUR,
    axes_for,
    draw_links,
    draw_symbols,
    force_bar,
    label_axes,
    new_figure,
    plane_points,
    save,
    symbol_keys,
)
from .look import DASHES, MANY_LINKS, SLACK_COLOUR, Scale, widths_of
from .mechanics import stresses, utilisations
from .pictures import drawn_links
from .symbols import supports
from .tables import AXES, link_columns, node_columns, table, write_csv
from .units import counted

COLUMNS = (
    "link", "start", "end", "law", "lowest (N)", "lowest_case", "highest (N)", "highest_case", "slack", "slack_cases",
)  # fmt: skip
WORST = "stress (Pa)", "utilisation", "worst_case"  # where there are areas and strengths


def envelope_table(cases):
    """Return a row for each link: nodes, law, extreme forces (N) and their cases, cases in which it is slack.

    Of structures with areas and strengths also the stress (Pa) and the utilisation of the case in which they are
    largest. Links and nodes are counted from 0.

    Parameters
    ----------
    cases : latinpc.Cases

    Returns
    -------
    structured array
    """
    scene, names = cases.scene, np.array([*cases.names, ""], dtype=object)  # -1: no case has converged
    lowest, highest, low, high = cases.envelope()
    slack = cases.slack & cases.good[:, None]
    loose = np.array(["; ".join(names[:-1][column]) for column in slack.T], dtype=object)
    columns = (
        np.arange(len(scene.links)), *scene.links.T, scene.laws, lowest, names[low], highest,
        names[high], slack.sum(axis=0), loose,
    )  # fmt: skip
    push = -lowest > highest
    worst = (function(scene, np.where(push, lowest, highest)) for function in (stresses, utilisations))
    more = dict(zip(WORST, (*worst, np.where(push, names[low], names[high]))))
    more = {name: values for name, values in more.items() if scene.area is not None and values is not None}
    return table(dict(zip(COLUMNS, columns)) | more | link_columns(scene))


def write_envelope(path, cases):
    """Write `envelope_table` into a ``.csv`` file, replaced only once it is complete; call it on one rank."""
    write_csv(path, envelope_table(cases))


def reactions_table(cases):
    """Return a row for each component of each reaction: node, place (m), axis, extremes (N) and their cases, each case.

    Nodes are counted from 0, besides the names that a file has given them.

    Parameters
    ----------
    cases : latinpc.Cases

    Returns
    -------
    structured array
    """
    scene, names = cases.scene, np.array([*cases.names, ""], dtype=object)
    node, axis = np.nonzero(scene.fixed)
    lowest, highest, low, high = (values[node, axis] for values in cases.reaction_envelope())
    columns = {"node": node, **dict(zip(AXES, scene.nodes[node].T)), "axis": np.array(list(AXES))[axis]}
    columns |= {"lowest (N)": lowest, "lowest_case": names[low], "highest (N)": highest, "highest_case": names[high]}
    columns |= {f"{name} (N)": forces[node, axis] for name, forces in zip(cases.names, cases.reactions)}
    return table(columns | node_columns(scene, node))


def write_reactions(path, cases):
    """Write `reactions_table` into a ``.csv`` file, replaced only once it is complete; call it on one rank."""
    write_csv(path, reactions_table(cases))


def draw_envelope(cases, path):
    """Write `envelope_figure` into a ``.png``, ``.pdf`` or ``.svg`` file, replaced only once it is complete."""
    save(envelope_figure(cases), path)


def envelope_figure(cases):
    """Draw the structure twice: the greatest tension of each link, and its greatest compression, on one scale.

    Cables and links in compression that are slack in all cases have a colour of their own, where they would have none
    of a force; those that are slack in some case are dashed, in the colour of what they bear in the others.

    Parameters
    ----------
    cases : latinpc.Cases

    Returns
    -------
    matplotlib.figure.Figure
    """
    scene, seen = cases.scene, drawn_links(cases.scene)
    lowest, highest, *_ = cases.envelope()
    often, good = cases.slack_cases() * np.isin(scene.law, UNILATERAL), np.count_nonzero(cases.good)
    always, sometimes = (often == good) & (often > 0), (often > 0) & (often < good)
    points, ends = plane_points(scene.nodes), scene.links[seen]
    stands = supports(scene.fixed, points, ends)
    figure, widths = new_figure(14.0, 6.2), widths_of(scene.law[seen])
    scale = Scale(lowest[seen], highest[seen])  # one for both halves
    extent = np.vstack([points, *(one.triangles.reshape(-1, points.shape[1]) for one in stands)])
    pull, push = np.maximum(highest[seen], 0.0), np.minimum(lowest[seen], 0.0)
    dashed = len(ends) <= MANY_LINKS
    styles = [DASHES if dashed and free else (0, None) for free in sometimes[seen]]
    for left, title, force in ((0.0, "Greatest tension", pull), (0.46, "Greatest compression", push)):
        rectangle = [left, 0.0, 0.44, 0.88] if points.shape[1] == 3 else [left + 0.05, 0.1, 0.37, 0.74]
        axes = axes_for(figure, rectangle, extent)
        label_axes(figure, axes)
        colours = scale.colours(force)
        if title.endswith("tension"):
            colours[always[seen]] = to_rgba(SLACK_COLOUR)
        draw_links(axes, points[ends], colours, widths, styles)
        draw_symbols(axes, stands)
        figure.text(left + 0.22, 0.875, title, fontsize=11, ha="center")
    force_bar(figure, [0.935, 0.30, 0.01, 0.54], scale)
    figure.legend(handles=symbol_keys(stands), loc="lower right", fontsize=9, frameon=False)
    keys = _slack_keys(np.count_nonzero(always), np.count_nonzero(sometimes), dashed)
    if keys:
        figure.legend(handles=keys, loc="upper right", ncols=len(keys), fontsize=9, frameon=False)
    _titles(figure, cases, good)
    return figure


def _slack_keys(always, sometimes, dashed):
    """Return the keys of a legend for links that are slack in all cases, and in some, as many as there are."""
    found = []
    if always:
        found.append(Line2D([], [], color=SLACK_COLOUR, linewidth=1.6, label=f"slack in all cases ({always:,})"))
    if sometimes:
        style = {"color": "#555555", "linewidth": 1.6, "linestyle": DASHES if dashed else "none"}
        found.append(Line2D([], [], label=f"slack in some case ({sometimes:,})", **style))
    return found


def _titles(figure, cases, good):
    """Write the name of the scene, and how many cases it is the envelope of."""
    title = f"{cases.scene.name}: envelope of {counted(good, 'load case')}"
    figure.text(0.02, 0.945, title, fontsize=14, weight="bold", parse_math=False)
    bad = [name for name, good in zip(cases.names, cases.good) if not good]
    if bad:
        text = f"not converged, left out: {', '.join(bad)}"
        figure.text(0.02, 0.905, text, fontsize=10, color=STAMP_COLOUR, parse_math=False)
