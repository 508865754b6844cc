"""Tables with polygons: the outlines of all fibres, and where the cell's sides pass between them."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from feti_homog.fibres.clear_sides import farthest, widest_gaps
from feti_homog.fibres.convex_shapes import ConvexShapes
from feti_homog.fibres.ellipses import Ellipses
from feti_homog.typing import Float

if TYPE_CHECKING:
    from feti_homog.case.rounded_polygons import RoundedPolygons
    from feti_homog.fibres.arrangement import Arrangement

# Points of each outline from which distances are taken.
POINTS = 256


def shapes_of(ellipses: Ellipses, polygons: RoundedPolygons, unit: float = 1.0) -> ConvexShapes:
    """The ellipses (k,), but polygons where these have sides, which are in the `unit`."""
    lengths = polygons.circumradius / unit, polygons.rounding / unit
    return ConvexShapes.of(ellipses, polygons.sides, *lengths, polygons.angle)


def outer_shapes(arrangement: Arrangement) -> ConvexShapes:
    """Those of the discs with the coatings around them."""
    shapes = arrangement.shapes
    assert shapes is not None
    frames, coated = shapes.frames.copy(), arrangement.coated
    bare = Ellipses(arrangement.centres[coated], frames[coated])
    frames[coated] = bare.grown(arrangement.thickness[coated]).frames
    return replace(shapes, centres=arrangement.centres, frames=frames)


def clearance(arrangement: Arrangement) -> float:
    """Distance of the sides of the cell from the nearest position at which they would touch an outline."""
    size = np.array([arrangement.width, arrangement.height])
    touching = (arrangement.centres[:, :, None] + _reach(arrangement)) / size[:, None]
    return float(np.abs((touching - np.round(touching)) * arrangement.width).min())


def clear_shift(arrangement: Arrangement) -> Arrangement:
    """The arrangement moved as a whole such that the cell's boundary stays clear of tangency with the outlines.

    As of discs: the sides are in the middles of the widest gaps between tangents, the corner far from outlines.
    """
    size = np.array([arrangement.width, arrangement.height])
    touching = arrangement.centres[:, :, None] + _reach(arrangement)
    lines = [widest_gaps(touching[:, axis].ravel(), size[axis]) for axis in (0, 1)]
    corners = np.array(list(product(*lines)))
    points = outer_shapes(arrangement).boundary(POINTS)[0]
    away = [np.linalg.norm((corner - points + size / 2) % size - size / 2, axis=1).min() for corner in corners]
    return replace(arrangement, centres=(arrangement.centres - farthest(corners, np.array(away))) % size)


def _reach(arrangement: Arrangement) -> Float:
    """(N, 2, 2) along each axis, backwards and forwards, with signs."""
    return np.asarray(outer_shapes(arrangement).extents * [-1.0, 1.0])
