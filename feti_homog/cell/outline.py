"""The lines of the cell: its sides and the arcs of fibres in it, cut where they meet, with nodes on them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.cell.arrangement import Arrangement
from feti_homog.cell.edge_samples import EdgeSamples
from feti_homog.cell.ellipses import Ellipses
from feti_homog.cell.graded_size import MeshSizes, SizeField, size_field
from feti_homog.cell.size_field import circle_size
from feti_homog.cell.tip_marks import marked
from feti_homog.typing import Bool, Float, Int

MATRIX = -1
# Relative distance below which two positions are one.
SAME_PLACE = 1e-9
# A mark nearer than this many radians to another vertex of its circle is that vertex.
MERGED = np.radians(0.05)
TURN = 2 * np.pi
QUARTER = TURN / 4
# Positions at which the size is sampled along an arc and along a piece of a side.
ARC_SAMPLES = 65
SIDE_SAMPLES = 513


@dataclass(frozen=True)
class Curve:
    """A piece of a side or a circle from vertex to vertex, counter-clockwise around the cell or the disc.

    Attributes:
        nodes: (k,) numbers of its nodes, from end to end.
        circle: the circle it lies on; MATRIX for a piece of a side.
        inside: what is on its left: the disc, or the coating, within that circle, or MATRIX.
        outside: of a piece of a circle, what is on its right: the coating within the circle around it, or MATRIX.
    """

    nodes: Int
    circle: int
    inside: int
    outside: int = MATRIX


@dataclass(frozen=True)
class Outline:
    """The lines of a cell.

    Attributes:
        points: (n, 2) nodes on all lines, exactly in place.
        curves: through the nodes.
        ellipses: k circles and ellipses in the plane, the images of one disc after the other, that of a coating before
            the one within.
        disc: (k,) the disc of the arrangement that each circle is an image of.
        around: (k,) the circle around each; MATRIX if there is none.
    """

    points: Float
    curves: tuple[Curve, ...]
    ellipses: Ellipses
    disc: Int
    around: Int

    @property
    def is_coating(self) -> Bool:
        """(k,) which circles have a coating within."""
        return np.isin(np.arange(len(self.around)), self.around)


def images(arrangement: Arrangement) -> tuple[Float, Int, Int]:
    """Circles (k, 3) of the periodic images that reach into the cell, their fibres (k,), the circles around them (k,).

    Fibre by fibre, the circles of each image one after the other, from without.
    """
    size = np.array([arrangement.width, arrangement.height])
    outer, fibre = _outer_images(arrangement, size)
    coated = arrangement.coated[fibre]
    inner = np.column_stack([outer[:, :2], arrangement.radii[fibre]])[coated]
    place = np.arange(len(outer)) + np.cumsum(coated) - coated
    rank = np.concatenate([place, place[coated] + 1])
    order = np.argsort(rank)
    around = np.concatenate([np.full(len(outer), MATRIX), place[coated]])
    return np.concatenate([outer, inner])[order], np.concatenate([fibre, fibre[coated]])[order], around[order]


def _outer_images(arrangement: Arrangement, size: Float) -> tuple[Float, Int]:
    """Those of the discs with their coatings."""
    radii = arrangement.outer_radii
    circles, fibre = [], []
    for step in product((-1, 0, 1), repeat=2):
        centres = arrangement.centres + np.array(step) * size
        outside = centres - np.clip(centres, 0, size)
        near = np.flatnonzero((outside**2).sum(axis=1) < radii**2)
        circles.append(np.column_stack([centres[near], radii[near]]))
        fibre.append(near)
    owner = np.concatenate(fibre)
    rank = np.arange(len(radii))
    if arrangement.mesh_order is not None:
        rank[arrangement.mesh_order] = np.arange(len(rank))
    order = np.argsort(rank[owner], kind="stable")
    return np.concatenate(circles)[order], owner[order]


def outline(arrangement: Arrangement, sizes: MeshSizes, marks: Mapping[int, Sequence[float]]) -> Outline:
    """All lines of the cell with nodes at distances of at most `sizes`, closer in narrow passages.

    Opposite sides have the same nodes. `marks` maps a curve to angles in degrees, measured at its centre, that become
    nodes: curve k is the outer one of fibre k, and ~k that within its coating.
    """
    size = np.array([arrangement.width, arrangement.height])
    circles, fibre, around = images(arrangement)
    places = [_crossings(circles, axis, size) for axis in (0, 1)]
    sides = ((axis, level) for axis in (0, 1) for level in (0.0, size[1 - axis]))
    border = np.concatenate([on_side(places[axis], axis, level) for axis, level in sides])
    curve = np.where(around == MATRIX, fibre, ~fibre)
    angles = _vertex_angles(circles, curve, border, marks)
    circle, start, stop = arcs_within(angles, lambda of, angle: _on_circle(circles[of], angle), size)
    ends = _on_circle(circles[circle], start)
    away = cKDTree(border).query(ends)[0] > SAME_PLACE * size.max()
    border = np.unique(border, axis=0)
    # Vertices within coatings are as far from each other as those on the circle around, which they face, unless marked.
    sparse = (around != MATRIX) & ~np.isin(curve, list(marks))
    outer = np.concatenate([border, ends[away & ~sparse[circle]]])
    numbering = Numbering(np.concatenate([border, ends[away]]))
    field = size_field(arrangement, sizes, outer, _tips(arrangement, marks, numbering.vertices))

    curves = []
    for axis in (0, 1):
        curves += side_curves(axis, places[axis], partial(_disc_at, circles), around, size, field, numbering)
    caps = _caps(arrangement, sizes.interface, fibre, around)
    curves += _arc_curves(circles, around, circle, start, stop, caps[circle], field, numbering)
    return Outline(numbering.points(), tuple(curves), Ellipses.round(circles), fibre, around)


def _caps(arrangement: Arrangement, largest: float, fibre: Int, around: Int) -> Float:
    """Largest edge length (k,) on the circles of these discs (k,) with these circles around (k,)."""
    first = np.unique(arrangement.circles[1], return_index=True)[1]
    return np.asarray(circle_size(arrangement, largest)[first[fibre] + (around != MATRIX)])


class Numbering:
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


def on_side(places: Float, axis: int, level: float) -> Float:
    """Points (k, 2) on the side along `axis` at the given level of the other coordinate."""
    points = np.full((len(places), 2), level)
    points[:, axis] = places
    return points


def _on_circle(circles: Float, angles: Float) -> Float:
    """Points (..., 2) on circles (..., 3) at angles in radians."""
    return np.asarray(circles[..., :2] + circles[..., 2:] * np.stack([np.cos(angles), np.sin(angles)], axis=-1))


def _vertex_angles(circles: Float, curve: Int, border: Float, marks: Mapping[int, Sequence[float]]) -> list[Float]:
    """Sorted angles in [0, 2 pi) of the vertices of each circle: crossings of the sides, and the marks."""
    angles = []
    near = cKDTree(border).query_ball_point(circles[:, :2], circles[:, 2] * (1 + SAME_PLACE))
    for circle, owner, candidates in zip(circles, curve.tolist(), near, strict=True):
        offset = border[candidates] - circle[:2]
        offset = offset[np.linalg.norm(offset, axis=1) > circle[2] * (1 - SAME_PLACE)]
        own = (np.arctan2(offset[:, 1], offset[:, 0]) % TURN).tolist()
        for mark in np.radians(marks.get(owner, ())) % TURN:
            if all(abs((mark - angle + np.pi) % TURN - np.pi) > MERGED for angle in own):
                own.append(mark)
        angles.append(np.sort(own) if own else np.zeros(1))
    return angles


def arcs_within(angles: list[Float], at: Callable[[Int, Float], Float], size: Float) -> tuple[Int, Float, Float]:
    """Curve, start and stop angle (a,) of the arcs within the cell, each at most a quarter turn.

    `angles` are those of the vertices of each closed curve; at(curves, angles) are the points (a, 2) there.
    """
    curve, start, stop = [], [], []
    for number, own in enumerate(angles):
        for begin, span in zip(own, np.diff(own, append=own[0] + TURN), strict=True):
            parts = max(1, int(np.ceil(span / QUARTER - SAME_PLACE)))
            stations = begin + span * np.arange(parts + 1) / parts
            curve.append(np.full(parts, number))
            start.append(stations[:-1])
            stop.append(stations[1:])
    whose, first, last = np.concatenate(curve), np.concatenate(start), np.concatenate(stop)
    middle = at(whose, (first + last) / 2)
    within = np.all((middle > 0) & (middle < size), axis=1)
    return whose[within], first[within], last[within]


def _tips(arrangement: Arrangement, marks: Mapping[int, Sequence[float]], vertices: Float) -> Float:
    """The vertices (t, 2) that the marks have become; those of curves that are not there are none."""
    curve, angle = marked(arrangement, marks)
    size, fibre = np.array([arrangement.width, arrangement.height]), np.where(curve < 0, ~curve, curve)
    radii = np.where(curve < 0, arrangement.radii[fibre], arrangement.outer_radii[fibre])
    places = _on_circle(np.column_stack([arrangement.centres[fibre], radii]), angle)
    return np.asarray(vertices[cKDTree(vertices % size, boxsize=size).query(places % size)[1]])


def side_curves(
    axis: int,
    places: Float,
    disc_at: Callable[[Float], Int],
    around: Int,
    size: Float,
    field: SizeField,
    numbering: Numbering,
) -> list[Curve]:
    """The pieces of the two sides along `axis`, with the same nodes on both; `disc_at` tells the smallest closed curve
    around points, which is a number of `around` or MATRIX."""
    begin, span = places[:-1], np.diff(places)

    def point(piece: Int, share: Float) -> Float:
        return on_side(begin[piece] + span[piece] * share, axis, 0.0)

    samples = EdgeSamples.of(field, point, span, np.full(len(span), np.inf), SIDE_SAMPLES)
    curves = []
    for level, low in ((0.0, True), (size[1 - axis], False)):
        inside = disc_at(on_side(begin + span / 2, axis, level))
        # A chord has two edges or more: a triangle with two arc edges beside it could not be flipped. From one circle
        # of a coating to the other it is no chord.
        into = around[inside] * (inside != MATRIX) + MATRIX * (inside == MATRIX)
        crosses = np.zeros(len(inside), bool)
        crosses[:-1] |= into[1:] == inside[:-1]
        crosses[1:] |= into[:-1] == inside[1:]
        least = np.where((inside == MATRIX) | crosses, 1, 2)
        for number, stations in enumerate(samples.stations(least)):
            along = begin[number] + span[number] * stations
            along[[0, -1]] = places[number : number + 2]
            nodes = numbering.along(on_side(along, axis, level))
            # Counter-clockwise around the cell: along the coordinate at the bottom and at the right.
            curves.append(Curve(nodes if low == (axis == 0) else nodes[::-1], MATRIX, int(inside[number])))
    return curves


def _disc_at(circles: Float, points: Float) -> Int:
    """The smallest circle (k,) around each point, or MATRIX."""
    holds = np.linalg.norm(points[:, None] - circles[:, :2], axis=2) < circles[:, 2]
    return np.where(holds.any(axis=1), np.where(holds, circles[:, 2], np.inf).argmin(axis=1), MATRIX)


def _arc_curves(
    circles: Float,
    around: Int,
    circle: Int,
    start: Float,
    stop: Float,
    caps: Float,
    field: SizeField,
    numbering: Numbering,
) -> list[Curve]:
    """The arcs (a,) from angle `start` to `stop` on their circles as curves, with edges of at most `caps` (a,)."""
    span = stop - start

    def point(arc: Int, share: Float) -> Float:
        return _on_circle(circles[circle[arc]], start[arc] + span[arc] * share)

    samples = EdgeSamples.of(field, point, span * circles[circle, 2], caps, ARC_SAMPLES)
    curves = []
    stations = samples.stations(np.ones(len(span), dtype=np.intp))
    for number, begin, turn, own in zip(circle.tolist(), start, span, stations, strict=True):
        nodes = numbering.along(_on_circle(circles[number], begin + turn * own))
        curves.append(Curve(nodes, number, number, int(around[number])))
    return curves
