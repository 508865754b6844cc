"""Bridges: straight lines across the matrix between the facing points of neighbouring discs.

A bridge is normal to both circles and, in a narrow gap, about as long as the edges there, so a mesh can have it without
bad triangles. Borders of tiles run along bridges and arcs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import Delaunay, cKDTree

from feti_homog.mesh.sizes.graded_size import CHUNK, wrap
from feti_homog.typing import Float, Int

TURN = 2 * np.pi
# Bridges stay away from third discs by this part of their radii, and their ends from sides by that of the mean radius.
CLEAR = 0.3
# Between two bridges on one disc, at least.
LEAST_ANGLE = np.radians(25)
# Decimals in which gaps and centroids are compared, relative to the cell; ties are broken by place.
PLACE_DECIMALS = 9

# Circle (v,) and angle (v,) in radians of points on circles.
OnCircles = tuple[Int, Float]


@dataclass(frozen=True)
class Bridges:
    """Lines (b,) between discs `ends` (b, 2), the second in the direction `angle` (b,)."""

    ends: Int
    angle: Float

    @property
    def on_circles(self) -> OnCircles:
        """The points at which bridges begin, then the points at which they end."""
        return self.ends.T.ravel(), np.concatenate([self.angle, self.angle + np.pi]) % TURN


@dataclass(frozen=True)
class CentreLines:
    """Edges of the Delaunay triangulation of the disc centres.

    Attributes:
        ends: (e, 2) discs.
        angle: (e,) direction from the first to the second.
        gap: (e,) between the discs.
        facing: (e, 2, 2) the point on each end's circle that faces the other.
        clearance: (e,) least distance between the line and a third disc's centre / its radius.
    """

    ends: Int
    angle: Float
    gap: Float
    facing: Float
    clearance: Float


def centre_lines(circles: Float, which: Int) -> CentreLines:
    """Connect the centres of discs `which` (n,); clearances are exact up to 1 + CLEAR."""
    centres, radii = circles[which, :2], circles[which, 2]
    corners = Delaunay(centres).simplices
    pairs = np.sort(np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]]), axis=1)
    ends = np.unique(pairs, axis=0)
    vector = centres[ends[:, 1]] - centres[ends[:, 0]]
    length = np.linalg.norm(vector, axis=1)
    normal = vector / length[:, None]
    clearance = np.full(len(ends), np.inf)
    # Discs of about one radius at a time: small ones far from a line need not be looked at.
    classes = np.floor(np.log2(radii / radii.min())).astype(int)
    for members in (np.flatnonzero(classes == level) for level in np.unique(classes)):
        tree, reach = cKDTree(centres[members]), (1 + CLEAR) * radii[members].max()
        for begin in range(0, len(ends), CHUNK):
            some = slice(begin, begin + CHUNK)
            close = tree.query_ball_point(centres[ends[some, 0]] + vector[some] / 2, length[some] / 2 + reach)
            line = begin + np.repeat(np.arange(len(close)), [len(candidates) for candidates in close])
            disc = members[np.concatenate([np.zeros(0, np.int64), *filter(len, close)]).astype(int)]
            third = (disc[:, None] != ends[line]).all(axis=1)
            line, disc = line[third], disc[third]
            offset = centres[disc] - centres[ends[line, 0]]
            share = np.clip((offset * vector[line]).sum(axis=1) / length[line] ** 2, 0, 1)
            away = np.linalg.norm(offset - share[:, None] * vector[line], axis=1)
            np.minimum.at(clearance, line, away / radii[disc])
    facing = centres[ends] + radii[ends][:, :, None] * np.stack([normal, -normal], axis=1)
    return CentreLines(
        ends=which[ends],
        angle=np.arctan2(normal[:, 1], normal[:, 0]),
        gap=length - radii[ends].sum(axis=1),
        facing=facing,
        clearance=clearance,
    )


def bridges(lines: CentreLines, size: Float, margin: float, largest: float, vertices: OnCircles) -> Bridges:
    """Choose bridges among the centre lines, clear of third discs and cell sides.

    Bridges on one disc are LEAST_ANGLE from each other and from its `vertices`; of two that are too near, the shorter
    one stays. Their ends are `margin` away from the sides, and their middles by a `largest` edge or their length: good
    triangles beside a side need room.
    """
    middle = lines.facing.mean(axis=1)
    away, ends_away = (np.minimum(points, size - points) for points in (middle, lines.facing))
    inside = (ends_away.min(axis=(1, 2)) > margin) & (away.min(axis=1) > np.minimum(largest, lines.gap))
    clear = np.flatnonzero(inside & (lines.clearance > 1 + CLEAR))
    order = np.lexsort((clear, (lines.gap[clear] / size.max()).round(PLACE_DECIMALS)))
    candidates = Bridges(lines.ends[clear[order]], lines.angle[clear[order]])
    circle, angle = (np.concatenate(parts) for parts in zip(candidates.on_circles, vertices, strict=True))
    # Vertices come before all bridges.
    first, count = len(vertices[0]), len(order)
    rank = np.concatenate([first + np.arange(count), first + np.arange(count), np.arange(first)])
    # Pairs of points on one circle within LEAST_ANGLE; circles are farther apart than that.
    places = wrap(np.column_stack([circle, angle]), np.array([np.inf, TURN]))
    near = cKDTree(places, boxsize=[0, TURN]).query_pairs(LEAST_ANGLE, output_type="ndarray")
    better, worse = np.sort(rank[near], axis=1).T
    # All vertices stay, however near each other; each rank that stays, best first, excludes the worse ones near it.
    better, worse = better[worse >= first], worse[worse >= first]
    stays, open_ = np.zeros(first + count, bool), np.ones(first + count, bool)
    while open_.any():
        between = open_[better] & open_[worse]
        better, worse = better[between], worse[between]
        free = open_.copy()
        free[worse] = False
        stays |= free
        open_ &= ~free
        open_[worse[free[better]]] = False
    return Bridges(candidates.ends[stays[first:]], candidates.angle[stays[first:]])
