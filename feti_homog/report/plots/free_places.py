"""Free places beside curves, where numbers of points hide nothing."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from feti_homog.typing import Array

# Offsets of a number from its point, in points of print, the best first, and half of the room that it takes.
OFFSETS = ((-6, 16), (-6, 25), (12, 16), (22, 3), (-22, 3), (16, -12), (-16, -12), (0, -20), (28, -22), (-28, 26))
ROOM = np.array([12.0, 5.0])
SAMPLES = 4000  # of each curve
POINTS_PER_INCH = 72.0


def free_offsets(axes: Axes, points: Array) -> list[tuple[int, int]]:
    """Return an offset of the number of each point (k, 2), where neither a curve nor another number is, if there is.

    The limits of the axes are final afterwards.
    """
    axes.set_ylim(axes.get_ylim())
    to_print = POINTS_PER_INCH / axes.figure.dpi
    taken = np.vstack([_samples(line.get_transform().transform(line.get_xydata())) for line in axes.lines]) * to_print
    corners = axes.get_window_extent().get_points() * to_print
    chosen = []
    for place in axes.transData.transform(points) * to_print:
        crowds = [_crowd(place + offset, taken, corners) for offset in OFFSETS]
        chosen.append(OFFSETS[int(np.argmin(crowds))])
        number = place + chosen[-1]
        taken = np.vstack([taken, number + ROOM * np.array([[-1, 0], [0, 0], [1, 0]])])
    return chosen


def _crowd(centre: Array, taken: Array, corners: Array) -> float:
    """Return how many of the places that are taken (n, 2) lie in the room around a centre; inf outside the axes."""
    if (centre - ROOM < corners[0]).any() or (centre + ROOM > corners[1]).any():
        return np.inf
    return float((np.abs(taken - centre) <= ROOM).all(axis=1).sum())


def _samples(line: Array) -> Array:
    """Return points along a line (n, 2), evenly spaced."""
    line = line[np.isfinite(line).all(axis=1)]
    if len(line) < 2:
        return line
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1)))
    at = np.linspace(0.0, length[-1], SAMPLES)
    return np.column_stack([np.interp(at, length, column) for column in line.T])
