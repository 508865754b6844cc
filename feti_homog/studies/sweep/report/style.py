"""Parts that the pictures of a sweep share: colours, scatter with means, labels and the legend."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from feti_homog.materials.constants import ABOUT_FIBRES
from feti_homog.materials.voigt import SPATIAL_STRAINS, SPATIAL_STRESSES
from feti_homog.report.plots.plot_helpers import SYMBOLS, faint_grid, stress_label
from feti_homog.studies.sweep.report.sweep_table import Series, SweepTable

COLOURS = ("#1f4e9c", "#c44e00", "#2a7f3f", "#7a3e9d", "#8c6d1f", "#c2185b")
MARKERS = ("o", "s", "^", "D", "v", "P")
REALISATION_STYLE: dict[str, Any] = {"markersize": 3.5, "alpha": 0.4, "markeredgewidth": 0, "label": "realisations"}
CONFIDENCE_STYLE: dict[str, Any] = {
    "fmt": "none", "elinewidth": 1.2, "capsize": 2.5, "label": "95 % confidence of the mean",
}  # fmt: skip
MESH_ERROR_STYLE: dict[str, Any] = {
    "fmt": "none", "elinewidth": 7.0, "alpha": 0.35, "zorder": 1, "label": "estimated error of the mesh",
}  # fmt: skip
LEGEND_HANDLE, LEGEND_CHARACTER = 0.7, 0.085  # inches of an entry: its line with the space around, a letter
NAMES = {
    "C11": "$C_{11}$",
    **{name: f"$C_{{{name[1:]}}}$" for name in ("C33", "C44", "C66")},
    **{
        name: f"{each.symbol} {each.way} the fibres{' (1 / temperature)' * name.startswith('expansion')}"
        for name, each in ABOUT_FIBRES.items()
    },
    "bulk": "plane bulk modulus $k$",
    "shear": "shear modulus $\\mu$",
    **{f"onset_{name}": f"$\\Sigma_{{{name[1:]}}}$ at the first break" for name in SPATIAL_STRESSES},
    **{f"peak_{name}": f"largest $\\Sigma_{{{name[1:]}}}$" for name in SPATIAL_STRESSES},
    **{f"end_{name}": f"${SYMBOLS[name]}$ at the end" for name in SPATIAL_STRAINS},
}


def plot_series(axes: Axes, table: SweepTable, series: Series, name: str, style: int) -> None:
    """Every realisation as a faint mark, and the means with their confidence intervals.

    Wide pale bars are the mean estimates of the mesh error, if there are any.
    """
    colour, marker = COLOURS[style], MARKERS[style]
    statistics, values = table.statistics[name], table.outputs[name]
    numbers = [table.points.index(point) for point in series.points]
    for x, point in zip(series.x, series.points, strict=True):
        rows = table.rows(point)
        if len(rows) > 1:
            axes.plot([x] * len(rows), values[rows], marker, **REALISATION_STYLE, color=colour)
    mean, spread = statistics.mean[numbers], np.nan_to_num(statistics.ci95[numbers])
    axes.plot(series.x, mean, color=colour, marker=marker, markersize=4.5, linewidth=1.2, label=series.label or None)
    if spread.any():
        axes.errorbar(series.x, mean, spread, ecolor=colour, **CONFIDENCE_STYLE)
    if (errors := table.statistics.get(f"{name}_mesh_error")) is not None:
        axes.errorbar(series.x, mean, np.nan_to_num(errors.mean[numbers]), ecolor=colour, **MESH_ERROR_STYLE)


def label_axes(axes: Axes, name: str, table: SweepTable, xlabel: str) -> None:
    """Labels, a faint grid, no box."""
    unit = "" if name.startswith(("end_", "nu_", "expansion_")) else stress_label(table.stress_unit)
    axes.set(xlabel=xlabel, ylabel=f"{NAMES.get(name, name)} {unit}".rstrip())
    faint_grid(axes)


def legend(figure: Any, axes: Sequence[Axes]) -> None:
    """One legend below for all panels."""
    found: dict[str, Any] = {}
    for one in axes:
        handles, labels = one.get_legend_handles_labels()
        found |= dict(zip(labels, handles, strict=True))
    if found:
        widest = LEGEND_HANDLE + LEGEND_CHARACTER * max(map(len, found))
        columns = max(1, min(len(found), 5, int(figure.get_figwidth() / widest)))
        figure.legend(list(found.values()), list(found), loc="outside lower center", ncols=columns, frameon=False)
