"""Distances and directions from each fibre to those nearest to it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.microstructure.fibre_pattern import FibrePattern
from feti_homog.typing import Float


@dataclass(frozen=True)
class NearestNeighbours:
    """The k fibres nearest to each of N, between centres.

    Attributes:
        distances: (N, k), the nearest first; infinite where a window has no more fibres.
        directions: (N, k) degrees from x1 towards x2, in [0, 360).
        weights: (N, k), of each column with the sum 1: of a distance in the distribution.  Those of a periodic cell are
            1/N.  In a window a distance d counts if the circle of that radius lies within, so that no fibre outside can
            be nearer, with the weight 1 / ((width - 2 d) (height - 2 d)) [Hanisch 1984], for the longer the fewer
            count.  A column is zero if none of its distances counts.
    """

    distances: Float
    directions: Float
    weights: Float

    @cached_property
    def means(self) -> Float:
        """(k,) mean distances, NaN where none counts."""
        total = (self.weights * np.where(self.weights > 0, self.distances, 0.0)).sum(axis=0)
        return np.where(self.weights.any(axis=0), total, np.nan)

    @cached_property
    def deviations(self) -> Float:
        """(k,) standard deviations of the distances, NaN where none counts."""
        counted = np.where(self.weights > 0, self.distances - self.means, 0.0)
        return np.where(self.weights.any(axis=0), np.sqrt((self.weights * counted**2).sum(axis=0)), np.nan)

    def quantiles(self, levels: Float, column: int) -> Float:
        """(m,) the least distances d with F(d) >= levels (m,), F the weighted distribution of one column.

        Raises ValueError if none of its distances counts.
        """
        order = np.argsort(self.distances[:, column], kind="stable")
        order = order[self.weights[order, column] > 0]
        if not len(order):
            raise ValueError("no distance counts")
        share = np.cumsum(self.weights[order, column])
        place = np.searchsorted(share / share[-1], levels - 1e-12)
        return np.asarray(self.distances[order[place], column])


def nearest_neighbours(pattern: FibrePattern, count: int = 3) -> NearestNeighbours:
    """Those of each fibre, in a periodic cell its images and its own among them."""
    candidates, _ = pattern.images(_reach(pattern, count))
    known = min(count, len(candidates) - 1)
    distances, directions = np.full((pattern.count, count), np.inf), np.full((pattern.count, count), np.nan)
    if known:
        found, which = cKDTree(candidates).query(candidates[: pattern.count], known + 1)
        distances[:, :known] = found[:, 1:]  # the first is the fibre itself
        vectors = candidates[which[:, 1:]] - candidates[: pattern.count, None]
        directions[:, :known] = np.degrees(np.arctan2(vectors[..., 1], vectors[..., 0])) % 360
    return NearestNeighbours(distances, directions, _weights(pattern, distances))


def _reach(pattern: FibrePattern, count: int) -> float:
    """Return a distance within which each fibre of a periodic cell has so many neighbours."""
    own_images = (count + 1) // 2 * pattern.size.min()
    if not pattern.periodic or pattern.count <= count:
        return float(own_images)
    others, _ = cKDTree(pattern.wrapped, boxsize=pattern.size).query(pattern.wrapped, count + 1)
    return float(min(own_images, others.max()) * (1 + 1e-9))


def _weights(pattern: FibrePattern, distances: Float) -> Float:
    if pattern.periodic:
        return np.full(distances.shape, 1 / pattern.count)
    counts = distances <= pattern.nearest_side[:, None]
    d = np.where(counts, distances, 0.0)
    inner = (pattern.width - 2 * d) * (pattern.height - 2 * d)
    raw = np.where(counts & (inner > 0), 1 / np.where(inner > 0, inner, 1.0), 0.0)
    total = raw.sum(axis=0)
    return np.asarray(raw / np.where(total > 0, total, 1.0))
