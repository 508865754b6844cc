"""The numbers of fibres in a picture of the cell: those that `fibre = N` of a case file means."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from scipy.spatial import cKDTree

from feti_homog.report.plots.decimation import DrawnMesh
from feti_homog.typing import Array

MOST_NUMBERS = 2000  # of fibres; of more none could be read
INSIDE, SEEN = 0.4, 0.85  # of a radius: how far from the sides a number stands, and how far at most from the centre
POINTS_PER_INCH, CHARACTERS = 72, 2.2
LEAST_SIZE, LARGEST_SIZE = 3.0, 11.0  # of the letters, in points


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
