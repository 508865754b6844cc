"""Edge lengths that grow with the distance from places where they are known."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.typing import Float

# Growth of the edge length per distance, at most.
MAX_GROWTH = 0.4
# Sources that count at a position, the nearest, and those that may at any of a line.
NEAREST, NEAREST_OF_LINE = 16, 32
# Positions whose sources are looked for at once, for the memory that this takes.
CHUNK = 100_000

# Places (k, 2), edge lengths (k,) and growths (k,).
Source = tuple[Float, Float, Float]


class SourcedSize:
    """The size h(x) = min(largest, min_k (h_k + g_k |x - x_k|)) at positions x on the torus.

    A source k counts within the distance at which a length 0 that grows by MAX_GROWTH reaches the largest.

    Attributes:
        largest: size anywhere.
        least: no size is below it.
    """

    def __init__(self, sources: Sequence[Source], size: Float, largest: float, chunk: int = CHUNK) -> None:
        """Prepare sources on the torus with periods `size` (2,); `chunk` positions are looked at together."""
        self.largest = largest
        self._size, self._bound, self._chunk = size, largest / MAX_GROWTH, chunk
        places, lengths, growths = (np.concatenate(parts) for parts in zip(*sources, strict=True))
        self._places = wrap(places, size)
        # Where the tree finds no more, it gives the source behind the last: an infinite one.
        self._lengths, self._growths = np.append(lengths, np.inf), np.append(growths, MAX_GROWTH)
        self.least = min(largest, float(self._lengths.min()))
        self._tree = cKDTree(self._places, boxsize=size)

    def __call__(self, points: Float) -> Float:
        """(n,) at points (n, 2)."""
        wrapped, count, parts = wrap(points, self._size), min(NEAREST, len(self._places)), []
        for k in range(0, max(1, len(points)), self._chunk):
            some = wrapped[k : k + self._chunk]
            distance, nearest = self._tree.query(some, k=count, distance_upper_bound=self._bound)
            sizes = (self._lengths[nearest] + self._growths[nearest] * distance).reshape(len(some), count)
            parts.append(np.minimum(self.largest, sizes.min(axis=1)))
        return np.concatenate(parts)

    def on_lines(self, points: Float) -> Float:
        """(c, m) at points (c, m, 2) of lines, as for each point.

        Sources are looked for once for all of a short line.
        """
        middle = points[:, points.shape[1] // 2]
        half = np.sqrt(((points - middle[:, None]) ** 2).sum(axis=2).max(axis=1, initial=0.0))
        # Longer ones have too many sources near them.
        short = half < self._bound
        sizes = np.empty(points.shape[:2])
        sizes[~short] = self(points[~short].reshape(-1, 2)).reshape(-1, points.shape[1])
        lines, chunk = np.flatnonzero(short), max(1, self._chunk // NEAREST_OF_LINE)
        for k in range(0, len(lines), chunk):
            some = lines[k : k + chunk]
            sizes[some] = self._on_some(points[some], middle[some], half[some])
        return sizes

    def _on_some(self, points: Float, middle: Float, half: Float) -> Float:
        """(c, m) on short lines whose points are at most `half` (c,) from their `middle` (c, 2)."""
        count = min(NEAREST_OF_LINE, len(self._places))
        reach = self._bound + float(half.max(initial=0.0))
        distance, close = self._tree.query(wrap(middle, self._size), k=count, distance_upper_bound=reach)
        distance, close = distance.reshape(len(middle), count), close.reshape(len(middle), count)
        length, growth = self._lengths[close], self._growths[close]
        # What counts at all points of a line bounds it from above; sources that are above everywhere do not matter.
        everywhere = distance + half[:, None] < self._bound
        above = np.where(everywhere, length + growth * (distance + half[:, None]), self.largest).min(axis=1)
        below = length + growth * np.maximum(0.0, distance - half[:, None])
        line, which = np.nonzero(below < np.minimum(above, self.largest)[:, None])
        source = close[line, which]
        squares = np.zeros((len(line), points.shape[1]))
        for axis, period in enumerate(self._size):
            way = points[line, :, axis] - self._places[source, axis][:, None]
            way -= period * np.round(way / period)
            way *= way
            squares += way
        away = np.sqrt(squares)
        candidates = self._lengths[source][:, None] + self._growths[source][:, None] * away
        candidates[away >= self._bound] = self.largest
        sizes = np.full(points.shape[:2], self.largest)
        first = np.flatnonzero(np.diff(line, prepend=-1))
        if len(first):
            sizes[line[first]] = np.minimum(self.largest, np.minimum.reduceat(candidates, first, axis=0))
        # What a line's own sources are does not depend on the lines that it is looked at with.
        full = distance[:, -1] < self._bound + half
        sizes[full] = self(points[full].reshape(-1, 2)).reshape(-1, points.shape[1])
        return sizes


def wrap(points: Float, size: Float) -> Float:
    """Positions (n, 2) on the torus, in [0, size)."""
    wrapped = points % size
    return np.where(wrapped >= size, 0.0, wrapped)
