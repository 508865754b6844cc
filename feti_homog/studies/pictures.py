"""fit.png: computed and measured values of a fit."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from feti_homog.report.plots.plot_helpers import STYLE, plain, save

COLOURS = ("#1f4e9c", "#c44e00", "#2a7f3f", "#7a3e9d", "#8c6d1f", "#c2185b")
MARKERS = ("o", "s", "^", "D", "v", "P")
Rows = list[Mapping[str, Any]]


def draw_fit(path: Path, document: Mapping[str, Any]) -> Path:
    """Draw a fit: residuals, and curves over their strain.  Raises FetiHomogError if it cannot be written."""
    single = [row for row in document["measured"] if row["strain"] is None]
    curves = [row for row in document["measured"] if row["strain"] is not None]
    parts = [(_draw_residuals, single)] * bool(single) + [(_draw_curves, curves)] * bool(curves)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(6.5 * len(parts), 4.5), layout="constrained")
        for axes, (draw, rows) in zip(figure.subplots(1, len(parts), squeeze=False)[0], parts, strict=True):
            draw(axes, rows)
        figure.suptitle(f"{plain(document['name'])}: computed and measured", fontsize=12)
        return save(figure, path)


def _draw_residuals(axes: Axes, rows: Rows) -> None:
    """Draw residuals in standard deviations, a row for each value."""
    place = np.arange(len(rows))
    tests = np.array([row["test"] for row in rows])
    residuals = np.array([row["residual"] for row in rows])
    axes.axvspan(-1.96, 1.96, color="0.93", zorder=0)
    axes.axvline(0.0, color="0.5", linewidth=0.8)
    for k, test in enumerate(np.unique(tests)):
        colour, marker = COLOURS[k % len(COLOURS)], MARKERS[k % len(MARKERS)]
        axes.plot(residuals[tests == test], place[tests == test], marker, color=colour, label=f"test {test}")
    labels = [f"{row['name']} {row['value']:.4g} / {row['computed']:.4g}" for row in rows]
    axes.set_yticks(place, [plain(label) for label in labels])
    axes.invert_yaxis()
    axes.set_xlabel("(computed - measured) / std")
    axes.set_title("measured / computed")
    if len(np.unique(tests)) > 1:
        axes.legend(frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))


def _draw_curves(axes: Axes, rows: Rows) -> None:
    """Draw points of measured curves with their standard deviations, and the computed curves through them."""
    for k, test in enumerate(dict.fromkeys(row["test"] for row in rows)):
        points = [row for row in rows if row["test"] == test]
        x, y, std, computed = (
            np.array([row[name] for row in points]) for name in ("strain", "value", "std", "computed")
        )
        colour, marker = COLOURS[k % len(COLOURS)], MARKERS[k % len(MARKERS)]
        axes.errorbar(x, y, std, fmt=marker, color=colour, markersize=4, label=f"test {test}, measured")
        axes.plot(x, computed, color=colour, label=f"test {test}, computed")
    axes.set(xlabel=rows[0]["strain_name"], ylabel=rows[0]["name"])
    axes.legend(frameon=False)
