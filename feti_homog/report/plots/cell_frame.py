"""Figures of a cell: their size, the axes of the cell, and colour bars beside it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from feti_homog.report.plots.plot_helpers import unit_label

CELL_INCHES, BAR_INCHES = 4.8, 1.1  # the longer side of a drawn cell, and the room for a colour bar beside it
BAR, LEAST_BAR = (0.04, 1.0), (0.15, 1.2)  # width and height of a bar: shares of the cell's, and least inches


def figure_of(attributes: Any, panels: int, beside: float = 0.0) -> tuple[Figure, Sequence[Axes]]:
    """Return a figure with panels for pictures of the cell, and so many inches beside them for a bar."""
    width, height = cell_size(attributes)
    size = panels * (width + 0.7) + 0.1 + beside, max(height, LEAST_BAR[1]) + 1.2
    figure = Figure(figsize=size, layout="compressed")
    return figure, figure.subplots(1, panels, squeeze=False)[0]


def cell_scale(attributes: Any) -> float:
    """Inches in the picture for a length unit of the cell."""
    return CELL_INCHES / max(float(attributes["width"]), float(attributes["height"]))


def cell_size(attributes: Any) -> tuple[float, float]:
    """Width and height of the cell in the picture, inches."""
    scale = cell_scale(attributes)
    return scale * float(attributes["width"]), scale * float(attributes["height"])


def label_cell_axes(axes: Axes, attributes: Any) -> None:
    unit = unit_label(attributes["length_unit"]) or "(cell units)"
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.margins(0.03)
    axes.set_xlabel(f"$x_1$ {unit}")
    axes.set_ylabel(f"$x_2$ {unit}")
    axes.spines[["top", "right"]].set_visible(False)


def bar_beside(axes: Axes, shapes: Any, extend: str, size: tuple[float, float] | None = None) -> Any:
    """Return the colour bar of shapes, at the right of their axes.

    `size` is that of the cell in the picture, inches: beside a narrow cell the bar is wider, beside a flat one higher.
    """
    figure: Any = axes.figure
    width, height = BAR if size is None else np.maximum(np.divide(LEAST_BAR, size), BAR).tolist()
    return figure.colorbar(
        shapes, cax=axes.inset_axes((1.0 + 0.75 * width, 0.5 * (1.0 - height), width, height)), extend=extend
    )
