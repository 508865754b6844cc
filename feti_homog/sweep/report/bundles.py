"""Bundles of stress-strain curves: every realisation, their mean and its confidence interval."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from feti_homog.mechanics import response
from feti_homog.output.plots.plot_helpers import STRAIN_SYMBOLS, plain
from feti_homog.sweep.report.statistics import Statistics
from feti_homog.sweep.report.style import COLOURS, label_axes, legend
from feti_homog.sweep.report.sweep_table import SweepTable

COMPONENTS = ("11", "22", "12")


def figure(table: SweepTable) -> Figure:
    """Two panels: the stress along the strain, and the largest of the others."""
    points = [point for point in table.points if len(table.curves(point)[0])][: len(COLOURS)]
    document = next(d for d in table.finished if d.get("path"))
    along = response.leading_component(document["path"])
    across = 1 if along == 0 else 0
    picture = Figure(figsize=(9.6, 4.6), layout="constrained")
    panels = picture.subplots(1, 2, sharex=True)
    for axes, component in zip(panels, (along, across), strict=True):
        for style, point in enumerate(points):
            _bundle(axes, table, point, component, COLOURS[style])
        axes.xaxis.set_major_locator(MaxNLocator(5))
        axes.axhline(0.0, color="0.6", linewidth=0.6, zorder=0)
        label_axes(axes, f"$\\Sigma_{{{COMPONENTS[component]}}}$", table, f"${STRAIN_SYMBOLS[along]}$")
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
