"""cell.png: phases and subdomains, and the numbers of the fibres, those that `fibre = N` of a case file means."""

from __future__ import annotations

from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from scipy.spatial import cKDTree

from feti_homog.report.plots.decimation import DrawnMesh, outline_edges
from feti_homog.report.plots.plot_helpers import (
    cell_scale,
    draw_segments,
    figure_of,
    fill_triangles,
    label_cell_axes,
    plain,
)
from feti_homog.typing import Array

MESH_LINES = 6000  # triangles up to which their edges are drawn
MATRIX = "#ece8df"
FIBRES = ("Blues", "Oranges", "Greens", "Purples", "Reds", "Greys")  # one colour map for each phase
MOST_NUMBERS = 2000  # of fibres; of more none could be read
INSIDE, SEEN = 0.4, 0.85  # of a radius: how far from the sides a number stands, and how far at most from the centre
POINTS_PER_INCH, CHARACTERS = 72, 2.2
LEAST_SIZE, LARGEST_SIZE = 3.0, 11.0  # of the letters, in points


def figure(file: Any, drawn: DrawnMesh, borders: Array) -> Figure:
    """Return the phases, each body in a shade of its own and with the fibre's number, beside the subdomains."""
    attributes = file.attrs
    picture, (left, right) = figure_of(attributes, panels=2)
    edges = len(drawn.triangles) <= MESH_LINES
    bodies, subdomains = drawn.body.max() + 1, drawn.subdomain.max() + 1
    shades, legend = _shades(drawn, list(attributes["phases"]))
    for axes, label, colours in ((left, drawn.body, shades), (right, drawn.subdomain, _distinct(subdomains))):
        fill_triangles(axes, drawn, drawn.points, colours[label], edges)
        draw_segments(axes, drawn.points[borders], "black", 0.9)
        label_cell_axes(axes, attributes)
    draw_segments(right, drawn.points[outline_edges(drawn, drawn.subdomain)], "black", 0.5)
    write_fibre_numbers(left, file, drawn, borders, cell_scale(attributes))
    left.set_title(_count(bodies, "body", "bodies"))
    right.set_title(_count(subdomains, "subdomain", "subdomains"))
    right.set_ylabel("")
    picture.suptitle(plain(attributes["title"]), fontsize=12)
    picture.legend(handles=legend, loc="outside lower center", ncols=4, frameon=False)
    return picture


def _shades(drawn: DrawnMesh, phases: list[str]) -> tuple[Array, list[Patch]]:
    """Return a colour (bodies, 4) for each body, a shade of its phase's; and the legend of the phases."""
    colours = np.zeros((drawn.body.max() + 1, 4))
    legend = []
    for index, phase in enumerate(phases):
        bodies = np.unique(drawn.body[drawn.phase == index])
        if not len(bodies):
            continue
        if index == 0:
            shades = np.tile(mpl.colors.to_rgba(MATRIX), (len(bodies), 1))
        else:
            tones = 0.65 - 0.35 * (np.arange(len(bodies)) * 0.618 % 1.0)
            shades = mpl.colormaps[FIBRES[(index - 1) % len(FIBRES)]](tones)
        colours[bodies] = shades
        legend.append(Patch(facecolor=shades[0], edgecolor="black", linewidth=0.6, label=phase))
    return colours, legend


def _distinct(count: int) -> Array:
    """Colours (count, 4), of which those with near numbers differ most."""
    colours: Array = mpl.colormaps["tab20"](np.arange(count) * 7 % 20)
    colours[:, :3] = 0.3 + 0.7 * colours[:, :3]
    return colours


def _count(number: int, one: str, many: str) -> str:
    return f"{number} {one if number == 1 else many}"


def write_fibre_numbers(axes: Axes, file: Any, drawn: DrawnMesh, borders: Array, inches: float) -> None:
    """Write each fibre's number on it, on every part of a round one that the sides of the cell cut.

    `borders` are the outlines (e, 2) of the bodies, `inches` a length unit in the picture.
    """
    fibres = file["fibre"]
    if len(fibres["number"]) > MOST_NUMBERS:
        return
    period, low = np.array([file.attrs["width"], file.attrs["height"]]), drawn.points.min(axis=0)
    outline = cKDTree(drawn.points[np.unique(borders)])
    tables = (fibres[name][:] for name in ("number", "body", "centre", "radius"))
    for number, body, centre, radius in zip(*tables, strict=True):
        if np.isfinite(radius):
            places, room = _on_images(centre, radius, low, period), radius
        else:
            places, room = _inside(drawn, body, outline)
        size = float(np.clip(room * inches * POINTS_PER_INCH / CHARACTERS, LEAST_SIZE, LARGEST_SIZE))
        for x, y in places:
            axes.text(x, y, str(number), fontsize=size, ha="center", va="center", clip_on=True)


def _on_images(centre: Array, radius: float, low: Array, period: Array) -> Array:
    """(p, 2) the centres of a circle's images, moved into the cell, if they are near enough."""
    shifts = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1]), axis=-1).reshape(-1, 2)
    images = centre + shifts * period
    margin = np.minimum(INSIDE * radius, 0.4 * period)
    moved = np.clip(images, low + margin, low + period - margin)
    places: Array = moved[np.linalg.norm(moved - images, axis=1) <= SEEN * radius]
    return places


def _inside(drawn: DrawnMesh, body: int, outline: cKDTree) -> tuple[Array, float]:
    """(1, 2) the place in a body that is farthest from the outlines, and how far it is."""
    middles = drawn.points[drawn.triangles[drawn.body == body]].mean(axis=1)
    distance = outline.query(middles)[0]
    best = int(np.argmax(distance))
    return middles[best : best + 1], float(distance[best])
