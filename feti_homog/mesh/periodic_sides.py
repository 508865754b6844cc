"""Which places on opposite sides of a periodic cell belong together."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from feti_homog.typing import Float, Int


def paired_sides(points: Float, period: Float) -> Iterator[tuple[int, Int, Int]]:
    """The pairs of points that differ by a period; of sides that match, these are the i-th along each.

    Args:
        points: (n, 2) nodes, or middles of edges; those on sides are exactly at 0 or at the period.
        period: (2,) width and height.

    Yields:
        For each axis across which sides are paired: the axis, points (k,) on the side at 0 and their partners (k,) on
        the side at the period, both in ascending order along the side.
    """
    for axis in (0, 1):
        along = points[:, 1 - axis]
        low, high = (np.flatnonzero(points[:, axis] == level) for level in (0.0, period[axis]))
        yield axis, low[np.argsort(along[low])], high[np.argsort(along[high])]
