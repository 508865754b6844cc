"""mesh_error.png: where the estimated error of the mesh is."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from feti_homog.report.plots.decimation import DrawnMesh, triangle_means
from feti_homog.report.plots.plot_helpers import draw_segments, figure_of, fill_triangles, label_cell_axes, plain
from feti_homog.typing import Array

BAR_INCHES = 1.1
DECADES = 4  # below the largest density, of which less is not told apart


def figure(file: Any, drawn: DrawnMesh, borders: Array) -> Figure | None:
    """Return the cell in the colours of the density of the error, None without estimates.

    The error in a part of the cell relative to the strain energy of the cell, over the part's share of the area; the
    largest of all states.
    """
    tables = [state["mesh_error"] for state in file.get("state", {}).values() if "mesh_error" in state]
    if not tables:
        return None
    first, second, third = np.moveaxis(drawn.points[drawn.triangles], 1, 0)
    (x, y), (u, v) = (second - first).T, (third - first).T
    area = np.abs(x * v - y * u) / 2 / (file.attrs["width"] * file.attrs["height"])
    elements = drawn.group / drawn.pieces
    density: Array = np.max([triangle_means(table, None, drawn) for table in tables], axis=0) * elements / area
    most = float(density.max(initial=0.0))
    if not 0.0 < most < np.inf:
        return None
    picture, (axes,) = figure_of(file.attrs, panels=1, beside=BAR_INCHES)
    least = most / 10.0**DECADES
    colours = ScalarMappable(LogNorm(least, most), "magma_r")
    fill_triangles(axes, drawn, drawn.points, np.asarray(colours.to_rgba(np.maximum(density, least))), edges=False)
    bar = picture.colorbar(colours, cax=axes.inset_axes((1.03, 0.0, 0.04, 1.0)), extend="min")
    bar.set_label("error of the strain energy / energy, per share of the area")
    draw_segments(axes, drawn.points[borders], "black", 0.7)
    label_cell_axes(axes, file.attrs)
    axes.set_title(f"{plain(file.attrs['title'])}\nestimated error of the mesh".lstrip())
    return picture
