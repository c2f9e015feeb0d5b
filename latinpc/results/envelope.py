"""Write and draw the envelope of load cases: the lowest and the highest force of each link."""

from __future__ import annotations

import numpy as np

from latinpc.laws import UNILATERAL, Law

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
from .tables import table, write_csv
from .units import scaled

SLACK_COLOUR = "#c800a1"
COLUMNS = ("link", "start", "end", "law", "lowest", "lowest_case", "highest", "highest_case", "slack", "slack_cases")


def write_envelope(path, cases):
    """Write a row for each link: nodes, law, extreme forces (N) and their cases, cases in which it is slack.

    Not collective: call it on one rank. Links and nodes are counted from 0.

    Parameters
    ----------
    path : str or path-like
        A ``.csv`` file; it is replaced only once it is completely written.
    cases : latinpc.runs.cases.Cases
    """
    scene, names = cases.scene, np.array([*cases.names, ""], dtype=object)  # -1: no case has converged
    lowest, highest, low, high = cases.envelope()
    laws = [law.name.lower() for law in Law] + ["table"] * len(scene.tables)
    slack = cases.slack & np.array([case["converged"] for case in cases.report["cases"]])[:, None]
    loose = np.array(["; ".join(names[:-1][column]) for column in slack.T], dtype=object)
    columns = (
        np.arange(len(scene.links)), *scene.links.T, np.array(laws)[scene.law], lowest, names[low], highest,
        names[high], slack.sum(axis=0), loose,
    )  # fmt: skip
    write_csv(path, table(dict(zip(COLUMNS, columns))))


def draw_envelope(cases, path):
    """Draw the structure twice: the greatest tension of each link, and its greatest compression.

    Cables that are slack in a case, and links in compression that are open, stand out.

    Parameters
    ----------
    cases : latinpc.runs.cases.Cases
    path : str or path-like
        A ``.png``, ``.pdf`` or ``.svg`` file, replaced only once it is complete.
    """
    scene = cases.scene
    lowest, highest, *_ = cases.envelope()
    pull, push = np.maximum(highest, 0.0), np.maximum(-lowest, 0.0)
    loose = (cases.slack_cases() > 0) & np.isin(scene.law, UNILATERAL)
    shown = scene.law != Law.TANGENT  # which acts across the line between its nodes
    points = plane_points(scene.nodes)
    figure = new_figure(14.0, 6.2)
    divisor, unit = scaled(max(pull.max(), push.max()), "N")
    thin = float(np.clip(40.0 / np.sqrt(len(scene.links)), 0.28, 1.3))
    halves = ((0.0, "Greatest tension", TENSION, pull), (0.5, "Greatest compression", COMPRESSION, push))
    for left, title, colour, force in halves:
        if points.shape[1] == 3:
            axes = axes_3d(figure, [left, 0.0, 0.42, 0.9], points)
        else:
            axes = axes_2d(figure, [left + 0.05, 0.1, 0.36, 0.76], points)
        label_axes(figure, axes)
        colours = colour(force / max(force.max(), 1e-300))
        colours[force == 0.0] = (0.8, 0.8, 0.8, 1.0)
        if title.endswith("tension"):
            colours[loose] = [0xC8 / 255, 0.0, 0xA1 / 255, 1.0]
        widths = np.where(scene.law == Law.BAR, 2.0 * thin, thin)
        draw_links(axes, points[scene.links][shown], colours[shown], widths[shown])
        if force.max() > 0.0:
            colour_bar(
                figure, [left + 0.435, 0.54, 0.01, 0.34], colour, 0.0, force.max() / divisor, f"{title} ({unit})"
            )
    _titles(figure, cases, loose)
    save(figure, path)


def _titles(figure, cases, loose):
    """Write the name of the scene, and how many links slacken."""
    good = sum(case["converged"] for case in cases.report["cases"])
    figure.text(0.02, 0.945, f"{cases.scene.name}: envelope of {good} load cases", fontsize=14, weight="bold")
    if loose.any():
        text = f"{np.count_nonzero(loose):,} links slack in some case"
        figure.text(0.98, 0.948, text, fontsize=10, ha="right", color=SLACK_COLOUR)
