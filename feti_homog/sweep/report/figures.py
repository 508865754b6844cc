"""Pictures of a sweep, each drawn where its quantity varies, and of fibres matched to those of a table."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullLocator

from feti_homog.fibres.fibre_window import read_window
from feti_homog.materials.voigt import voigt_names
from feti_homog.microstructure.fibre_pattern import FibrePattern
from feti_homog.microstructure.neighbour_match import nearest_neighbours
from feti_homog.microstructure.statistics import distances, pair_functions, voronoi_cells
from feti_homog.report.plots.plot_helpers import STYLE, SYMBOLS, faint_grid, plain, save
from feti_homog.results import path_curves
from feti_homog.sweep.report import moduli
from feti_homog.sweep.report.style import COLOURS, MARKERS, label_axes, legend, plot_series
from feti_homog.sweep.report.sweep_table import Series, Statistics, SweepTable, series_over, varies
from feti_homog.typing import Document, Float

MOST_TABLES, MOST_CELLS = 4, 60  # that are drawn
TABLE_STYLE: dict[str, Any] = {"color": "black", "linewidth": 1.8, "zorder": 3}
X_FACTOR, MARGIN = 0.94, 1.3  # factors on a logarithmic axis
CHOICES = (("C11", "bulk", "shear"), ("C11", "C33", "C44", "C66"))
FIBRES = "cell.fibres"
FEWEST_OF_INTERVAL = 10  # realisations: of fewer saw-teeth an interval of the mean means nothing


def tables(table: SweepTable) -> list[Path]:
    """Return the tables of fibres that finished cases match, as far as they are still there."""
    paths = dict.fromkeys(path for d in table.finished if (path := d["case"]["cell"].get("match")) is not None)
    return [path for path in map(Path, paths) if path.is_file()]


def figure(table: SweepTable) -> Figure:
    """Return a row for each table.

    Distances of neighbours, which are matched, then L(r) and local fractions, which follow.
    """
    found = tables(table)[:MOST_TABLES]
    picture = Figure(figsize=(13.0, 0.9 + 3.8 * len(found)), layout="constrained")
    panels = picture.subplots(len(found), 3, squeeze=False)
    for path, row in zip(found, panels, strict=True):
        documents = [d for d in table.finished if d["case"]["cell"].get("match") == str(path)][:MOST_CELLS]
        _compare(row, path, documents)
    picture.suptitle(f"{plain(table.name)}: cells beside the fibres that they match", fontsize=12)
    legend(picture, list(panels.flat))
    return picture


def pattern_of(document: Document) -> FibrePattern:
    """Return the fibres of a result, in its periodic cell."""
    cell, fibres = document["cell"], document["fibres"]
    centres, radii = (np.array([fibre[key] for fibre in fibres]) for key in ("centre", "radius"))
    return FibrePattern(cell["width"], cell["height"], centres, radii, periodic=True)


def _compare(row: Sequence[Axes], path: Path, documents: Sequence[Document]) -> None:
    window, cells = read_window(path), [pattern_of(document) for document in documents]
    words = f"{plain(path.name)}, {window.count} fibres"
    for k, order in enumerate(("nearest", "second")):
        for cell in cells:
            row[0].step(*_distribution(cell, k), where="post", color=COLOURS[k], linewidth=0.7, alpha=0.5)
        row[0].step([], [], color=COLOURS[k], label=f"{order} neighbours of the cells")
        row[0].step(*_distribution(window, k), where="post", **TABLE_STYLE, label="" if k else "table")
    for cell in cells:
        row[1].plot(*_clustering(cell), color=COLOURS[2], linewidth=0.7, alpha=0.5)
        row[2].step(*_local_fractions(cell), where="post", color=COLOURS[2], linewidth=0.7, alpha=0.5)
    row[1].plot([], [], color=COLOURS[2], label="cells")
    row[1].plot(*_clustering(window), **TABLE_STYLE)
    row[2].step(*_local_fractions(window), where="post", **TABLE_STYLE)
    most = max(document["cell"]["match_distance"] for document in documents)
    row[0].set_title(f"{words}; cells to {most:.4f} mean diameters")
    labels = (
        ("distance of centres / mean diameter", "share of fibres below"),
        ("r / mean radius", "(L(r) - r) / mean radius"),
        ("local fibre fraction", "share of fibres below"),
    )
    for axes, (xlabel, ylabel) in zip(row, labels, strict=True):
        axes.set(xlabel=xlabel, ylabel=ylabel)
        faint_grid(axes)


def _distribution(pattern: FibrePattern, k: int) -> tuple[Float, Float]:
    """Return the distances to the k-th neighbour that count, in mean diameters, and the weighted share up to each."""
    near = nearest_neighbours(pattern, k + 1)
    order = np.argsort(near.distances[:, k])
    order = order[near.weights[order, k] > 0]
    return near.distances[order, k] / (2 * pattern.mean_radius), np.cumsum(near.weights[order, k])


def _clustering(pattern: FibrePattern) -> tuple[Float, Float]:
    """r and L(r) - r, in mean radii."""
    pairs = pair_functions(pattern, distances(pattern))
    return pairs.r / pattern.mean_radius, (pairs.ripley_l - pairs.r) / pattern.mean_radius


def _local_fractions(pattern: FibrePattern) -> tuple[Float, Float]:
    """Return those of the Voronoi cells that count, sorted, and the weighted share up to each."""
    cells = voronoi_cells(pattern)
    order = np.argsort(cells.fractions)
    order = order[cells.whole[order]]
    return cells.fractions[order], np.cumsum(cells.weights[order])


def plot(directory: Path, table: SweepTable) -> list[Path]:
    """Draw the varied quantities; returns the files.  On one rank.

    moduli.png over the fibre fraction, cell_size.png over the number of fibres, curves.png of paths, match.png of cells
    that match a table of fibres.
    """
    with mpl.rc_context(STYLE):
        paths = []
        if varies(table, moduli.FRACTION) and moduli.panels_of(table):
            paths.append(save(moduli.figure(table), directory / "moduli.png"))
        if varies(table, FIBRES) and convergence_names(table):
            paths.append(save(cell_size_figure(table, FIBRES), directory / "cell_size.png"))
        if any(len(table.curves(point)[0]) for point in table.points):
            paths.append(save(curves_figure(table), directory / "curves.png"))
        if tables(table):
            paths.append(save(figure(table), directory / "match.png"))
        return paths


def curves_figure(table: SweepTable) -> Figure:
    """Two panels: the stress along the strain, and the largest of the others, if there is any.

    Points whose paths lead along another strain are left out.
    """
    there = [point for point in table.points if len(table.curves(point)[0])]
    points = [point for point in there if _leads(table, point) == _leads(table, there[0])][: len(COLOURS)]
    document = next(d for d in table.results_of(points[0]) if d.get("path"))
    strains, stresses = voigt_names(len(document["path"][0]["stress"]))
    along = path_curves.leading_component(document)
    components = [along, *_others(table, points, along)[:1]]
    picture = Figure(figsize=(0.4 + 4.6 * len(components), 4.6), layout="constrained")
    panels = picture.subplots(1, len(components), sharex=True, squeeze=False)[0]
    symbol = SYMBOLS[strains[along]]
    counts = [len(table.curves(point)[1]) for point in points]
    few = min(counts) < FEWEST_OF_INTERVAL
    for axes, component in zip(panels, components, strict=True):
        for style, point in enumerate(points):
            _bundle(axes, table, point, component, COLOURS[style], few)
        axes.xaxis.set_major_locator(MaxNLocator(5))
        axes.axhline(0.0, color="0.6", linewidth=0.6, zorder=0)
        label_axes(axes, f"$\\Sigma_{{{stresses[component][1:]}}}$", table, f"${symbol}$")
    band = "range of the realisations" if few else "95 % confidence interval of the mean"
    words = f"realisations and their mean; band: {band}" if max(counts) > 1 else "stress along the paths"
    picture.suptitle(f"{plain(table.name)}: {words}", fontsize=11)
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


def _bundle(axes: Axes, table: SweepTable, point: int, component: int, colour: str, few: bool) -> None:
    strain, stress = table.curves(point)
    curves = stress[:, :, component]
    statistics = Statistics.of(curves)
    label = table.label(point) or "mean"
    if len(curves) > 1:
        axes.plot(strain, curves.T, color=colour, linewidth=0.5, alpha=0.3)
        half = statistics.ci95
        low, high = (
            (curves.min(axis=0), curves.max(axis=0)) if few else (statistics.mean - half, statistics.mean + half)
        )
        axes.fill_between(strain, low, high, color=colour, alpha=0.18, linewidth=0.0)
        label = f"{label} ({len(curves)} realisations)"
    axes.plot(strain, statistics.mean, color=colour, linewidth=1.6, label=label)


def convergence_names(table: SweepTable) -> tuple[str, ...]:
    """Return the outputs that are drawn: moduli, or the strength of paths."""
    return next(
        (chosen for chosen in (*CHOICES, _strength_names(table)) if all(name in table.outputs for name in chosen)), ()
    )


def _strength_names(table: SweepTable) -> tuple[str, ...]:
    """Names of the stress along the leading strain of paths, the first and the largest.

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
