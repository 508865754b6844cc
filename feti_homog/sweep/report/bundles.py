"""Bundles of stress-strain curves: every realisation, their mean and its confidence interval."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from feti_homog.materials.voigt import voigt_names
from feti_homog.report.plots.plot_helpers import plain, strain_symbols
from feti_homog.results import path_curves
from feti_homog.sweep.report.statistics import Statistics
from feti_homog.sweep.report.style import COLOURS, label_axes, legend
from feti_homog.sweep.report.sweep_table import SweepTable


def figure(table: SweepTable) -> Figure:
    """Two panels: the stress along the strain, and the largest of the others, if there is any.

    Points whose paths lead along another strain are left out.
    """
    there = [point for point in table.points if len(table.curves(point)[0])]
    points = [point for point in there if _leads(table, point) == _leads(table, there[0])][: len(COLOURS)]
    document = next(d for d in table.results_of(points[0]) if d.get("path"))
    along, (strains, stresses) = (
        path_curves.leading_component(document),
        voigt_names(len(document["path"][0]["stress"])),
    )
    components = [along, *_others(table, points, along)[:1]]
    picture = Figure(figsize=(0.4 + 4.6 * len(components), 4.6), layout="constrained")
    panels = picture.subplots(1, len(components), sharex=True, squeeze=False)[0]
    symbol = strain_symbols(len(strains))[along]
    for axes, component in zip(panels, components, strict=True):
        for style, point in enumerate(points):
            _bundle(axes, table, point, component, COLOURS[style])
        axes.xaxis.set_major_locator(MaxNLocator(5))
        axes.axhline(0.0, color="0.6", linewidth=0.6, zorder=0)
        label_axes(axes, f"$\\Sigma_{{{stresses[component][1:]}}}$", table, f"${symbol}$")
    picture.suptitle(f"{plain(table.name)}: realisations, means and their 95 % confidence intervals", fontsize=12)
    legend(picture, list(panels))
    return picture


def _leads(table: SweepTable, point: int) -> tuple[str, str]:
    """The plane state and the leading strain of the paths of a point."""
    document = next(d for d in table.results_of(point) if d.get("path"))
    return document["case"]["analysis"]["plane"], str(path_curves.leading_component(document))


def _others(table: SweepTable, points: Sequence[int], along: int) -> list[int]:
    """The other stresses that are seen, the largest first."""
    largest = np.max([np.abs(table.curves(point)[1]).max(axis=(0, 1)) for point in points], axis=0)
    seen = [k for k in path_curves.components_above(path_curves.FAINT, largest[None]) if k != along]
    return sorted(seen, key=lambda k: -largest[k])


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
