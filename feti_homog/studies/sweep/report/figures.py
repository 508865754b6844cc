"""Pictures of a sweep: moduli over the fibre fraction, curves of paths."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from feti_homog.materials.voigt import voigt_names
from feti_homog.report.plots.plot_helpers import STYLE, SYMBOLS, plain, save
from feti_homog.results import path_curves
from feti_homog.studies.sweep.report import moduli
from feti_homog.studies.sweep.report.style import COLOURS, label_axes, legend
from feti_homog.studies.sweep.report.sweep_table import Statistics, SweepTable, varies

FEWEST_OF_INTERVAL = 10  # realisations: of fewer saw-teeth an interval of the mean means nothing


def plot(directory: Path, table: SweepTable) -> list[Path]:
    """Draw the varied quantities; returns the files.  On one rank.

    moduli.png over the fibre fraction, curves.png of paths.
    """
    with mpl.rc_context(STYLE):
        paths = []
        if varies(table, moduli.FRACTION) and moduli.panels_of(table):
            paths.append(save(moduli.figure(table), directory / "moduli.png"))
        if any(len(table.curves(point)[0]) for point in table.points):
            paths.append(save(curves_figure(table), directory / "curves.png"))
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
