"""Edge lengths that grow with the distance from sources with given lengths."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.typing import Float

# Growth of the edge length per distance, at most.
MAX_GROWTH = 0.4
NEAREST = 16  # sources that count at a position
# Positions in one query of a tree, which bounds its memory.
CHUNK = 100_000

# Places (k, 2), edge lengths (k,) and growths (k,).
Source = tuple[Float, Float, Float]


class SourcedSize:
    """The size h(x) = min(largest, min_k (h_k + g_k |x - x_k|)) on the torus.

    Source k acts within the distance `largest` / MAX_GROWTH.

    Attributes:
        largest: size anywhere.
        least: lower bound of h.
    """

    def __init__(
        self, sources: Sequence[Source], size: Float, largest: float, chunk: int = CHUNK, nearest: int = NEAREST
    ) -> None:
        """Prepare sources on the torus with periods `size` (2,).

        The `nearest` sources count at a position; a query has `chunk` positions.
        """
        self.largest = largest
        self._size, self._bound, self._chunk, self._nearest = size, largest / MAX_GROWTH, chunk, nearest
        places, lengths, growths = (np.concatenate(parts) for parts in zip(*sources, strict=True))
        self._places = wrap(places, size)
        # Where the tree finds no more sources, it returns their number: an infinite length.
        self._lengths, self._growths = np.append(lengths, np.inf), np.append(growths, MAX_GROWTH)
        self.least = min(largest, float(self._lengths.min()))
        self._tree = cKDTree(self._places, boxsize=size)

    def __call__(self, points: Float) -> Float:
        """Return the edge lengths h (n,) at points (n, 2)."""
        wrapped, count, parts = wrap(points, self._size), min(self._nearest, len(self._places)), []
        for k in range(0, max(1, len(points)), self._chunk):
            some = wrapped[k : k + self._chunk]
            distance, nearest = self._tree.query(some, k=count, distance_upper_bound=self._bound)
            sizes = (self._lengths[nearest] + self._growths[nearest] * distance).reshape(len(some), count)
            parts.append(np.minimum(self.largest, sizes.min(axis=1)))
        return np.concatenate(parts)


def wrap(points: Float, size: Float) -> Float:
    """Wrap positions (n, 2) into the cell [0, size)."""
    wrapped = points % size
    return np.where(wrapped >= size, 0.0, wrapped)
