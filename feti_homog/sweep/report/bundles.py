"""Bundles of stress-strain curves: every realisation, their mean and its confidence interval."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from feti_homog.mechanics.response import NOISE
from feti_homog.mechanics.voigt import voigt_names
from feti_homog.output.plots.load_labels import SYMBOLS
from feti_homog.output.plots.plot_helpers import plain
from feti_homog.sweep.report.statistics import Statistics
from feti_homog.sweep.report.style import COLOURS, label_axes, legend
from feti_homog.sweep.report.sweep_table import SweepTable


def figure(table: SweepTable) -> Figure:
    """The stress along the strain and, if there is any, the largest of the others; of points along the same strain."""
    curves = {point: table.curves(point)[1] for point in table.points}
    points = [point for point, stress in curves.items() if len(stress)]
    along, count = table.leading(points[0]), curves[points[0]].shape[2]
    points = [p for p in points if table.leading(p) == along and curves[p].shape[2] == count][: len(COLOURS)]
    largest = np.max([np.abs(curves[point]).max(axis=(0, 1)) for point in points], axis=0)
    others = [k for k in np.argsort(-largest, kind="stable") if k != along and largest[k] > NOISE * largest[along]]
    shown = [along, *map(int, others[:1])]
    picture = Figure(figsize=(4.8 * len(shown), 4.6), layout="constrained")
    panels = picture.subplots(1, len(shown), sharex=True, squeeze=False)[0]
    strains, stresses = voigt_names(count)
    for axes, component in zip(panels, shown, strict=True):
        for style, point in enumerate(points):
            _bundle(axes, table, point, component, COLOURS[style])
        axes.xaxis.set_major_locator(MaxNLocator(5))
        axes.axhline(0.0, color="0.6", linewidth=0.6, zorder=0)
        label_axes(axes, f"${SYMBOLS[stresses[component]]}$", table, f"${SYMBOLS[strains[along]]}$")
    picture.suptitle(f"{plain(table.name)}: realisations, means and their 95 % confidence intervals", fontsize=12)
    legend(picture, list(panels))
    return picture


def _bundle(axes: Axes, table: SweepTable, point: int, component: int, colour: str) -> None:
    strain, stress = table.curves(point)
    curves = stress[:, :, component]
    statistics = Statistics.of(curves)
    label = table.label(point) or "mean"
    if len(curves) > 1:
        axes.plot(strain, curves.T, color=colour, linewidth=0.5, alpha=0.3)
        low, high = statistics.mean - statistics.ci95, statistics.mean + statistics.ci95
        axes.fill_between(strain, low, high, color=colour, alpha=0.18, linewidth=0.0)
        label = f"{label} ({len(curves)} realisations)"
    axes.plot(strain, statistics.mean, color=colour, linewidth=1.6, label=label)
