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
        whole: (N,) whether the cell is what it would be in larger surroundings; false for cells that a window may cut.
    """

    areas: Float
    fractions: Float
    whole: Bool


def voronoi_cells(pattern: FibrePattern) -> VoronoiCells:
    """Of a periodic cell by the images around it, of a window by mirror images, which cut the cells at its sides.

    A cell in a window is whole if the circles about its corners, through its centre, lie within the window: no
    fibre outside could change it.
    """
    points = _periodic(pattern) if pattern.periodic else _mirrored(pattern)
    diagram = Voronoi(points)
    ends = np.array(diagram.ridge_vertices)
    finite = np.all(ends >= 0, axis=1)
    edges = diagram.vertices[ends[finite]]
    length = np.hypot(*(edges[:, 1] - edges[:, 0]).T)
    areas, whole = np.zeros(pattern.count), np.ones(pattern.count, dtype=bool)
    for owner, other in (diagram.ridge_points[finite].T, diagram.ridge_points[finite].T[::-1]):
        own = owner < pattern.count
        height = np.hypot(*(points[other[own]] - points[owner[own]]).T) / 2
        areas += np.bincount(owner[own], length[own] * height / 2, pattern.count)
        if not pattern.periodic:
            corners = edges[own]
            radius = np.linalg.norm(corners - points[owner[own], None], axis=2)
            room = np.minimum(corners, pattern.size - corners).min(axis=2)
            whole[owner[own][np.any(radius > room, axis=1)]] = False
    return VoronoiCells(areas, pi * pattern.radii**2 / areas, whole)


def _periodic(pattern: FibrePattern) -> Float:
    """The centres and their eight images: of no others is an edge of a cell's boundary."""
    shifts = [np.array(step) * pattern.size for step in product((-1, 0, 1), repeat=2) if any(step)]
    return np.concatenate([pattern.wrapped, *(pattern.wrapped + shift for shift in shifts)])


def _mirrored(pattern: FibrePattern) -> Float:
    """The centres and their mirror images over the four sides."""
    margin = OFF_SIDE * pattern.size.min()
    inside = np.clip(pattern.centres, margin, pattern.size - margin)
    points = [inside]
    for axis, side in product((0, 1), repeat=2):
        image = inside.copy()
        image[:, axis] = 2 * side * pattern.size[axis] - image[:, axis]
        points.append(image)
    return np.concatenate(points)
