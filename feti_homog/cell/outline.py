"""The lines of the cell: its sides and the arcs of fibres in it, cut where they meet, with nodes on them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.cell.arrangement import Arrangement
from feti_homog.cell.size_field import circle_size, line_size
from feti_homog.errors import MeshError
from feti_homog.typing import Float, Int

MATRIX = -1
# Relative distance below which two positions are one.
SAME_PLACE = 1e-9
# A mark nearer than this many radians to another vertex of its circle is that vertex.
MERGED = np.radians(0.05)
TURN = 2 * np.pi
QUARTER = TURN / 4
# Nodes on lines with which a cell is still meshed in minutes.
MAX_LINE_NODES = 120_000
# Positions at which the size is sampled along an arc and along a piece of a side.
ARC_SAMPLES = 65
SIDE_SAMPLES = 513

Spacing = Callable[[Float], Float]


@dataclass(frozen=True)
class Curve:
    """A piece of a side or a circle from vertex to vertex, counter-clockwise around the cell or the disc.

    Attributes:
        nodes: (k,) numbers of its nodes, from end to end.
        circle: the circle it lies on; MATRIX for a piece of a side.
        inside: what is on its left: the disc of that circle, or MATRIX.
    """

    nodes: Int
    circle: int
    inside: int


@dataclass(frozen=True)
class Outline:
    """Nodes (n, 2) on all lines, exactly in place, curves through them, and circles (k, 3) in the plane."""

    points: Float
    curves: tuple[Curve, ...]
    circles: Float


def images(arrangement: Arrangement) -> tuple[Float, Int]:
    """Circles (k, 3) of the periodic images that reach into the cell, fibre by fibre, and their fibres (k,)."""
    size = np.array([arrangement.width, arrangement.height])
    circles, fibre = [], []
    for step in product((-1, 0, 1), repeat=2):
        centres = arrangement.centres + np.array(step) * size
        outside = centres - np.clip(centres, 0, size)
        near = np.flatnonzero((outside**2).sum(axis=1) < arrangement.radii**2)
        circles.append(np.column_stack([centres[near], arrangement.radii[near]]))
        fibre.append(near)
    owner = np.concatenate(fibre)
    order = np.argsort(owner, kind="stable")
    return np.concatenate(circles)[order], owner[order]


def outline(arrangement: Arrangement, largest: float, marks: Mapping[int, Sequence[float]]) -> Outline:
    """All lines of the cell with nodes at distances of at most `largest`, closer in narrow passages.

    Opposite sides have the same nodes. `marks` maps a fibre to angles in degrees, measured at its centre,
    that become nodes.
    """
    size = np.array([arrangement.width, arrangement.height])
    circles, fibre = images(arrangement)
    places = [_crossings(circles, axis, size) for axis in (0, 1)]
    sides = ((axis, level) for axis in (0, 1) for level in (0.0, size[1 - axis]))
    border = np.concatenate([_on_side(places[axis], axis, level) for axis, level in sides])
    circle, start, stop = _arcs(circles, _vertex_angles(circles, fibre, border, marks), size)
    ends = _on_circle(circles[circle], start)
    away = cKDTree(border).query(ends)[0] > SAME_PLACE * size.max()
    numbering = _Numbering(np.concatenate([np.unique(border, axis=0), ends[away]]))
    spacing = line_size(arrangement, largest, numbering.vertices)

    curves = []
    for axis in (0, 1):
        curves += _side_curves(axis, places[axis], circles, size, spacing, numbering)
    curves += _arc_curves(circles, circle, start, stop, spacing, largest, numbering)
    return Outline(numbering.points(), tuple(curves), circles)


class _Numbering:
    """Gives numbers to the nodes: first the vertices (v, 2), found by position, then those between."""

    def __init__(self, vertices: Float) -> None:
        self.vertices = vertices
        self._tree = cKDTree(vertices)
        self._between: list[Float] = []
        self._count = len(vertices)

    def along(self, points: Float) -> Int:
        """Numbers (k,) of the nodes at `points` (k, 2) on one curve, whose ends are vertices."""
        _, ends = self._tree.query(points[[0, -1]])
        between = np.arange(self._count, self._count + len(points) - 2)
        self._count += len(between)
        self._between.append(points[1:-1])
        return np.concatenate([ends[:1], between, ends[1:]])

    def points(self) -> Float:
        """Positions (n, 2) of all nodes by number."""
        return np.concatenate([self.vertices, *self._between])


def _crossings(circles: Float, axis: int, size: Float) -> Float:
    """Sorted coordinates along `axis` of the vertices on the side at 0: corners and crossings of circles."""
    depth, centre, radius = circles[:, 1 - axis], circles[:, axis], circles[:, 2]
    half = np.sqrt(np.maximum(radius**2 - depth**2, 0.0))
    crossing = np.concatenate([centre - half, centre + half])[np.tile(half > 0, 2)]
    return np.concatenate([[0.0], np.sort(crossing[(crossing > 0) & (crossing < size[axis])]), [size[axis]]])


def _on_side(places: Float, axis: int, level: float) -> Float:
    """Points (k, 2) on the side along `axis` at the given level of the other coordinate."""
    points = np.full((len(places), 2), level)
    points[:, axis] = places
    return points


def _on_circle(circles: Float, angles: Float) -> Float:
    """Points (..., 2) on circles (..., 3) at angles in radians."""
    return np.asarray(circles[..., :2] + circles[..., 2:] * np.stack([np.cos(angles), np.sin(angles)], axis=-1))


def _vertex_angles(circles: Float, fibre: Int, border: Float, marks: Mapping[int, Sequence[float]]) -> list[Float]:
    """Sorted angles in [0, 2 pi) of the vertices of each circle: crossings of the sides, and the marks."""
    angles = []
    near = cKDTree(border).query_ball_point(circles[:, :2], circles[:, 2] * (1 + SAME_PLACE))
    for circle, owner, candidates in zip(circles, fibre.tolist(), near, strict=True):
        offset = border[candidates] - circle[:2]
        offset = offset[np.linalg.norm(offset, axis=1) > circle[2] * (1 - SAME_PLACE)]
        own = (np.arctan2(offset[:, 1], offset[:, 0]) % TURN).tolist()
        for mark in np.radians(marks.get(owner, ())) % TURN:
            if all(abs((mark - angle + np.pi) % TURN - np.pi) > MERGED for angle in own):
                own.append(mark)
        angles.append(np.sort(own) if own else np.zeros(1))
    return angles


def _arcs(circles: Float, angles: list[Float], size: Float) -> tuple[Int, Float, Float]:
    """Circle, start and stop angle (a,) of the arcs within the cell, each at most a quarter turn."""
    circle, start, stop = [], [], []
    for number, own in enumerate(angles):
        for begin, span in zip(own, np.diff(own, append=own[0] + TURN), strict=True):
            parts = max(1, int(np.ceil(span / QUARTER - SAME_PLACE)))
            stations = begin + span * np.arange(parts + 1) / parts
            circle.append(np.full(parts, number))
            start.append(stations[:-1])
            stop.append(stations[1:])
    whose, first, last = np.concatenate(circle), np.concatenate(start), np.concatenate(stop)
    middle = _on_circle(circles[whose], (first + last) / 2)
    within = np.all((middle > 0) & (middle < size), axis=1)
    return whose[within], first[within], last[within]


def _side_curves(
    axis: int, places: Float, circles: Float, size: Float, spacing: Spacing, numbering: _Numbering
) -> list[Curve]:
    """The pieces of the two sides along `axis`, with the same nodes on both."""
    share = np.linspace(0, 1, SIDE_SAMPLES)
    begin, span = places[:-1], np.diff(places)
    samples = _on_side((begin[:, None] + span[:, None] * share).ravel(), axis, 0.0)
    sizes = spacing(samples).reshape(len(span), -1)
    curves = []
    for level, low in ((0.0, True), (size[1 - axis], False)):
        inside = _disc_at(_on_side(begin + span / 2, axis, level), circles)
        # A chord has two edges or more: a triangle with two arc edges beside it could not be flipped.
        least = np.where(inside == MATRIX, 1, 2)
        for number, stations in enumerate(_stations(share, sizes, span, least)):
            along = begin[number] + span[number] * stations
            along[[0, -1]] = places[number : number + 2]
            nodes = numbering.along(_on_side(along, axis, level))
            # Counter-clockwise around the cell: along the coordinate at the bottom and at the right.
            curves.append(Curve(nodes if low == (axis == 0) else nodes[::-1], MATRIX, int(inside[number])))
    return curves


def _disc_at(points: Float, circles: Float) -> Int:
    """The circle (k,) whose disc holds each point, or MATRIX."""
    holds = np.linalg.norm(points[:, None] - circles[:, :2], axis=2) < circles[:, 2]
    return np.where(holds.any(axis=1), holds.argmax(axis=1), MATRIX)


def _arc_curves(
    circles: Float,
    circle: Int,
    start: Float,
    stop: Float,
    spacing: Spacing,
    largest: float,
    numbering: _Numbering,
) -> list[Curve]:
    """The arcs (a,) from angle `start` to `stop` on their circles as curves."""
    share = np.linspace(0, 1, ARC_SAMPLES)
    span = stop - start
    samples = _on_circle(circles[circle, None], start[:, None] + span[:, None] * share)
    caps = circle_size(circles[circle, 2], largest)
    sizes = np.minimum(spacing(samples.reshape(-1, 2)).reshape(len(span), -1), caps[:, None])
    curves = []
    stations = _stations(share, sizes, span * circles[circle, 2], np.ones(len(span), dtype=np.intp))
    for number, begin, turn, own in zip(circle.tolist(), start, span, stations, strict=True):
        nodes = numbering.along(_on_circle(circles[number], begin + turn * own))
        curves.append(Curve(nodes, number, number))
    return curves


def _stations(share: Float, sizes: Float, lengths: Float, least: Int) -> list[Float]:
    """For each curve the positions in [0, 1] of its nodes, equidistant in the measure ds / h.

    The sizes h (c, s) are given at the positions `share` (s,), the lengths (c,) in the same unit.
    Raises MeshError if they would be too many.
    """
    density = lengths[:, None] / sizes
    steps = (density[:, 1:] + density[:, :-1]) / 2 * np.diff(share)
    measure = np.concatenate([np.zeros((len(lengths), 1)), np.cumsum(steps, axis=1)], axis=1)
    if measure[:, -1].sum() > MAX_LINE_NODES:
        raise MeshError(
            f"[cell] the lines of the cell need about {measure[:, -1].sum():.2g} nodes; expected at most "
            f"{MAX_LINE_NODES}: make mesh_size larger, or fibre_fraction or fibres smaller"
        )
    counts = np.maximum(np.ceil(measure[:, -1] - 1e-6).astype(int), least)
    pairs = zip(measure, counts, strict=True)
    return [np.interp(np.linspace(0, own[-1], count + 1), own, share) for own, count in pairs]
