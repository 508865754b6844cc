"""How means converge with the size of the cell, the number of fibres in it."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from feti_homog.materials.voigt import voigt_names
from feti_homog.report.plots.plot_helpers import plain
from feti_homog.results import path_curves
from feti_homog.sweep.report.series import Series, series_over
from feti_homog.sweep.report.style import COLOURS, MARKERS, label_axes, legend, plot_series
from feti_homog.sweep.report.sweep_table import SweepTable

X_FACTOR, MARGIN = 0.94, 1.3  # factors on a logarithmic axis
CHOICES = (("C11", "bulk", "shear"), ("C11", "C33", "C44", "C66"))


def names(table: SweepTable) -> tuple[str, ...]:
    """The outputs that are drawn: moduli, or the strength of paths."""
    return next((chosen for chosen in (*CHOICES, _along(table)) if all(name in table.outputs for name in chosen)), ())


def _along(table: SweepTable) -> tuple[str, ...]:
    """Of the stress along the leading strain of paths, the first and the largest; of a given stress the strain at the
    end instead of the latter."""
    document = next((d for d in table.finished if d.get("path")), None)
    if document is None:
        return ()
    strains, stresses = voigt_names(len(document["path"][0]["stress"]))
    leading = path_curves.leading_component(document)
    is_given = any(target.get(stresses[leading]) for target in path_curves.targets(document))
    return (f"onset_{stresses[leading]}", f"end_{strains[leading]}" if is_given else f"peak_{stresses[leading]}")


def figure(table: SweepTable, key: str) -> Figure:
    """Above the realisations and the means, below the scatter of the realisations and of the mean."""
    drawn, found = names(table), series_over(table, key)[: len(COLOURS)]
    picture = Figure(figsize=(0.4 + 3.9 * len(drawn), 6.6), layout="constrained")
    panels = picture.subplots(2, len(drawn), sharex=True, squeeze=False)
    for name, upper, lower in zip(drawn, *panels, strict=True):
        for style, series in enumerate(found):
            plot_series(upper, table, series, name, style, x_factor=X_FACTOR)
            _scatter(lower, table, series, name, style)
        label_axes(upper, name, table, "")
        label_axes(lower, name, table, "number of fibres")
        lower.set_ylabel("scatter / mean (%)")
        lower.set_ylim(bottom=0.0)
    _logarithmic(panels[0, 0], sorted({int(x) for series in found for x in series.x}))
    picture.suptitle(f"{plain(table.name)}: realisations and means with 95 % confidence intervals", fontsize=12)
    legend(picture, list(panels.flat))
    return picture


def _scatter(axes: Axes, table: SweepTable, series: Series, name: str, style: int) -> None:
    """Standard deviation of one cell and half-width of the mean's interval, relative to the mean."""
    statistics = table.statistics[name]
    numbers = [table.points.index(point) for point in series.points]
    mean = np.abs(statistics.mean[numbers])
    words = f", {series.label}" if series.label else ""
    kinds = ((statistics.std, "-", "standard deviation of a cell"), (statistics.ci95, ":", "95 % interval of the mean"))
    for values, line, what in kinds:
        axes.plot(
            series.x, 100 * values[numbers] / mean, line, color=COLOURS[style], marker=MARKERS[style], markersize=4,
            linewidth=1.2, label=f"{what}{words}",
        )  # fmt: skip


def _logarithmic(axes: Axes, ticks: list[int]) -> None:
    axes.set_xscale("log")
    axes.set_xlim(ticks[0] / MARGIN, ticks[-1] * MARGIN)
    axes.set_xticks(ticks, [str(tick) for tick in ticks])
    axes.xaxis.set_minor_locator(NullLocator())
