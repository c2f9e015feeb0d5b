"""Draw the article's Figures 8 and 9."""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.colors import Normalize

from latinpc.laws import Law
from latinpc.results.drawing import axes_3d, colour_bar, draw_links, label_axes, new_figure, save
from latinpc.results.look import COMPRESSION, TENSION
from latinpc.results.mechanics import slack
from latinpc.results.units import scaled

GAPS = (44.0, 44.0, 42.0)  # points: labels of the axes from their edges, in Figure 9


def draw_figure_8(scene, displacements, path, amplification=2.0):
    """Draw the deformed grid coloured by vertical displacement, as in Figure 8."""
    vertical = displacements[:, 2]
    shape = scene.nodes + amplification * np.column_stack([0 * vertical, 0 * vertical, vertical])
    level = vertical[scene.links].mean(axis=1)
    colours = matplotlib.colormaps["turbo"]
    norm = Normalize(level.min(), max(level.max(), level.min() + 1e-300))

    figure = new_figure(12.0, 5.6)
    gaps = (58.0, 62.0, 68.0)
    axes = axes_3d(figure, [0.01, 0.02, 0.87, 0.92], shape, elevation=24.0, azimuth=-52.0, gaps=gaps)
    label_axes(figure, axes, gaps=gaps)
    width = float(np.clip(70.0 / np.sqrt(len(level)), 0.3, 1.5))
    draw_links(axes, shape[scene.links], colours(norm(level)), width)
    colour_bar(figure, [0.915, 0.2, 0.014, 0.6], colours, norm.vmin, norm.vmax, "Vertical displacement (m)")
    _title(figure, scene, tensions=None, text=f"Vertical displacement, drawn × {amplification:g}")
    save(figure, path)


def draw_figure_9(scene, tensions, path):
    """Draw the compressions in the bars and the tensions in the cables as heights, as in Figure 9."""
    figure = new_figure(14.0, 5.8)
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
        axes = axes_3d(
            figure, [left, 0.02, 0.42, 0.88], points, elevation=20.0, azimuth=-52.0,
            aspect=(1.0, 1.0, 0.62), gaps=GAPS,
        )  # fmt: skip
        label_axes(figure, axes, f"{label} ({unit})", gaps=GAPS)
        low, high = force.min() / divisor, force.max() / divisor
        shade = (segments[:, 0, 2] - low) / max(high - low, 1e-300)
        draw_links(axes, segments, colours(shade), 0.9)
        colour_bar(figure, [left + 0.455, 0.25, 0.007, 0.5], colours, low, high, unit)
        figure.text(left + 0.22, 0.89, label, fontsize=12, ha="center")
    _title(figure, scene, tensions)
    save(figure, path)


def _title(figure, scene, tensions, text=None):
    subdomains = "" if scene.subdomain is None else f"{scene.n_subdomains} subdomains, "
    figure.text(0.02, 0.95, f"{scene.name}: {subdomains}{len(scene.links):,} links", fontsize=13, weight="bold")
    if tensions is not None:
        cables = scene.law == Law.CABLE
        text = f"{100.0 * slack(scene, tensions)[cables].mean():.3g} % of the cables slack"
    figure.text(0.98, 0.95, text, fontsize=11, ha="right")
