"""The part of the cross-section that is nearer to one fibre's centre than to any other."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from math import pi

import numpy as np
from scipy.spatial import Voronoi

from feti_homog.microstructure.fibre_pattern import FibrePattern
from feti_homog.typing import Bool, Float

# Centres on a side of a window are moved in by this share of the shorter side: they would coincide with their images.
OFF_SIDE = 1e-9


@dataclass(frozen=True)
class VoronoiCells:
    """The Voronoi cells of N fibres.

    Attributes:
        areas: (N,), with the sum width x height.
        fractions: (N,) local fibre fractions pi R^2 / area, whose mean, weighted with the areas, is the fibre fraction.
            Cells of the centres know no radii: of unequal fibres close together that of the larger may be above 1.
        weights: (N,), with the sum 1, of the cells in a distribution: 1/N in a periodic cell.  In a window a cell
            counts if it is what it would be in larger surroundings, with the weight 1 / (share of the places of the
            window where it would fit in, with all that decides on it): larger cells are fewer.
    """

    areas: Float
    fractions: Float
    weights: Float

    @property
    def whole(self) -> Bool:
        """(N,) whether a cell counts; in a window some do not."""
        return np.asarray(self.weights > 0)

    @property
    def mean_fraction(self) -> float:
        """Weighted mean of the local fractions, NaN if no cell counts."""
        return float(self.weights @ self.fractions) if self.weights.any() else np.nan

    @property
    def fraction_deviation(self) -> float:
        """Their weighted standard deviation."""
        return float(np.sqrt(self.weights @ (self.fractions - self.mean_fraction) ** 2))


def voronoi_cells(pattern: FibrePattern) -> VoronoiCells:
    """Cells of a periodic pattern by images around it, of a window by mirror images, which cut them at its sides.

    A cell in a window counts if the circles about its corners, through its centre, lie within the window: no fibre
    outside could change it.
    """
    points = _periodic(pattern) if pattern.periodic else _mirrored(pattern)
    diagram = Voronoi(points)
    ends = np.array(diagram.ridge_vertices)
    finite = np.all(ends >= 0, axis=1)
    edges = diagram.vertices[ends[finite]]
    length = np.hypot(*(edges[:, 1] - edges[:, 0]).T)
    areas = np.zeros(pattern.count)
    lowest, highest = np.full((pattern.count, 2), np.inf), np.full((pattern.count, 2), -np.inf)
    for owner, other in (diagram.ridge_points[finite].T, diagram.ridge_points[finite].T[::-1]):
        own = owner < pattern.count
        height = np.hypot(*(points[other[own]] - points[owner[own]]).T) / 2
        areas += np.bincount(owner[own], length[own] * height / 2, pattern.count)
        radius = np.linalg.norm(edges[own] - points[owner[own], None], axis=2)[..., None]
        np.minimum.at(lowest, owner[own], (edges[own] - radius).min(axis=1))
        np.maximum.at(highest, owner[own], (edges[own] + radius).max(axis=1))
    return VoronoiCells(areas, pi * pattern.radii**2 / areas, _weights(pattern, lowest, highest))


def _weights(pattern: FibrePattern, lowest: Float, highest: Float) -> Float:
    """Return those of cells whose circles lie between the corners `lowest` and `highest` (N, 2)."""
    if pattern.periodic:
        return np.full(pattern.count, 1 / pattern.count)
    within = np.all((lowest >= 0) & (highest <= pattern.size), axis=1)
    room = np.prod(pattern.size - (highest - lowest), axis=1)
    raw = np.where(within & (room > 0), 1 / np.where(room > 0, room, 1.0), 0.0)
    return np.asarray(raw / (raw.sum() or 1.0))


def _periodic(pattern: FibrePattern) -> Float:
    """Return the centres and their eight images: of no others is an edge of a cell's boundary."""
    shifts = [np.array(step) * pattern.size for step in product((-1, 0, 1), repeat=2) if any(step)]
    return np.concatenate([pattern.wrapped, *(pattern.wrapped + shift for shift in shifts)])


def _mirrored(pattern: FibrePattern) -> Float:
    """Return the centres and their mirror images over the four sides."""
    margin = OFF_SIDE * pattern.size.min()
    inside = np.clip(pattern.centres, margin, pattern.size - margin)
    points = [inside]
    for axis, side in product((0, 1), repeat=2):
        image = inside.copy()
        image[:, axis] = 2 * side * pattern.size[axis] - image[:, axis]
        points.append(image)
    return np.concatenate(points)
