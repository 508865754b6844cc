"""The pictures of a sweep, each drawn where what it shows varies."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullLocator

from feti_homog.materials.voigt import voigt_names
from feti_homog.report.plots.plot_helpers import STYLE, plain, save, strain_symbols
from feti_homog.results import path_curves
from feti_homog.sweep.report import match_comparison, moduli
from feti_homog.sweep.report.style import COLOURS, MARKERS, label_axes, legend, plot_series
from feti_homog.sweep.report.sweep_table import Series, Statistics, SweepTable, series_over, varies

X_FACTOR, MARGIN = 0.94, 1.3  # factors on a logarithmic axis
CHOICES = (("C11", "bulk", "shear"), ("C11", "C33", "C44", "C66"))
FIBRES = "cell.fibres"


def plot(directory: Path, table: SweepTable) -> list[Path]:
    """Draw what varies: moduli.png over the fibre fraction, cell_size.png over the number of fibres, curves.png of
    paths, match.png of cells that match a table of fibres; returns the files.  On one rank."""
    with mpl.rc_context(STYLE):
        paths = []
        if varies(table, moduli.FRACTION) and moduli.panels_of(table):
            paths.append(save(moduli.figure(table), directory / "moduli.png"))
        if varies(table, FIBRES) and convergence_names(table):
            paths.append(save(cell_size_figure(table, FIBRES), directory / "cell_size.png"))
        if any(len(table.curves(point)[0]) for point in table.points):
            paths.append(save(curves_figure(table), directory / "curves.png"))
        if match_comparison.tables(table):
            paths.append(save(match_comparison.figure(table), directory / "match.png"))
        return paths


def curves_figure(table: SweepTable) -> Figure:
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
    """Return the plane state and the leading strain of the paths of a point."""
    document = next(d for d in table.results_of(point) if d.get("path"))
    return document["case"]["analysis"]["plane"], str(path_curves.leading_component(document))


def _others(table: SweepTable, points: Sequence[int], along: int) -> list[int]:
    """Return the other stresses that are seen, the largest first."""
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


def convergence_names(table: SweepTable) -> tuple[str, ...]:
    """Return the outputs that are drawn: moduli, or the strength of paths."""
    return next(
        (chosen for chosen in (*CHOICES, _strength_names(table)) if all(name in table.outputs for name in chosen)), ()
    )


def _strength_names(table: SweepTable) -> tuple[str, ...]:
    """Of the stress along the leading strain of paths, the first and the largest.

    Of a given stress the strain at the end instead of the latter.
    """
    document = next((d for d in table.finished if d.get("path")), None)
    if document is None:
        return ()
    strains, stresses = voigt_names(len(document["path"][0]["stress"]))
    leading = path_curves.leading_component(document)
    is_given = any(target.get(stresses[leading]) for target in path_curves.targets(document))
    return (f"onset_{stresses[leading]}", f"end_{strains[leading]}" if is_given else f"peak_{stresses[leading]}")


def cell_size_figure(table: SweepTable, key: str) -> Figure:
    """Above the realisations and the means, below the scatter of the realisations and of the mean."""
    drawn, found = convergence_names(table), series_over(table, key)[: len(COLOURS)]
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
    """Draw the standard deviation of one cell and the half-width of the mean's interval, relative to the mean."""
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
