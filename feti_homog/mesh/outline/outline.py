"""The lines of a cell with nodes on them, and before: images, vertices, arcs, pieces of sides."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.mesh.outline.bridges import TURN, OnCircles
from feti_homog.mesh.outline.lines import MATRIX, OUTSIDE, Curves, EdgeSamples, Sampling, Segments
from feti_homog.mesh.sizes.graded_size import SizeField
from feti_homog.microstructure import Arrangement
from feti_homog.microstructure.shapes import Ellipses
from feti_homog.typing import Bool, Float, Int

# Relative distance below which two positions are one.
SAME_PLACE = 1e-9
# A mark nearer than this many radians to another vertex of its circle is that vertex.
MERGED = np.radians(0.05)
QUARTER = TURN / 4


@dataclass(frozen=True)
class Outline:
    """The lines of a cell.

    Attributes:
        points: (n, 2) nodes on all lines, exactly in place.
        curves: through the nodes.
        ellipses: k circles and ellipses in the plane, disc by disc and image by image, each from without.
        disc: (k,) whose image each circle is.
        around: (k,) the circle around each; MATRIX if there is none.
    """

    points: Float
    curves: Curves
    ellipses: Ellipses
    disc: Int
    around: Int

    @property
    def is_coating(self) -> Bool:
        """(k,) which circles have a coating within."""
        return np.isin(np.arange(len(self.around)), self.around)


class Numbering:
    """Number nodes: first the vertices (v, 2), found by position, then the nodes between."""

    def __init__(self, vertices: Float) -> None:
        self.vertices = vertices
        self._tree = cKDTree(vertices)
        self._between: list[Float] = []
        self._count = len(vertices)

    def along(self, points: Float, first: Int) -> Int:
        """Assign numbers (n,) to the nodes `points` (n, 2) of curves from first[:-1] on, whose ends are vertices."""
        is_end = np.zeros(len(points), bool)
        is_end[first[:-1]] = is_end[first[1:] - 1] = True
        number = np.empty(len(points), np.int64)
        number[is_end] = self._tree.query(points[is_end])[1]
        between = np.count_nonzero(~is_end)
        number[~is_end] = np.arange(self._count, self._count + between)
        self._count += between
        self._between.append(points[~is_end])
        return number

    def points(self) -> Float:
        """Positions (n, 2) of all nodes by number."""
        return np.concatenate([self.vertices, *self._between])


def images(arrangement: Arrangement) -> tuple[Float, Int, Int]:
    """Circles (k, 3) of periodic images that reach into the cell, their fibres (k,), the circles around them (k,).

    They go fibre by fibre and image by image, each from without.
    """
    size, radii = arrangement.size, arrangement.outer_radii
    rank = np.arange(len(radii))
    if arrangement.mesh_order is not None:
        rank[arrangement.mesh_order] = np.arange(len(rank))
    circles, fibres = [], []
    for step in product((-1, 0, 1), repeat=2):
        centres = arrangement.centres + np.array(step) * size
        outside = centres - np.clip(centres, 0, size)
        inside = np.flatnonzero((outside**2).sum(axis=1) < radii**2)
        circles.append(np.column_stack([centres[inside], radii[inside]]))
        fibres.append(inside)
    fibre = np.concatenate(fibres)
    order = np.argsort(rank[fibre], kind="stable")
    outer, fibre = np.concatenate(circles)[order], fibre[order]
    coated = arrangement.coated[fibre]
    inner = np.column_stack([outer[:, :2], arrangement.radii[fibre]])[coated]
    order, owner, around = nested(fibre, coated)
    return np.concatenate([outer, inner])[order], owner, around


def nested(fibre: Int, coated: Bool) -> tuple[Int, Int, Int]:
    """Order outer curves (n,), and behind them the curves within coatings, fibre by fibre from without: (k,).

    Also, in this order, their fibres (k,), and the curves around them (k,).
    """
    place = np.arange(len(fibre)) + np.cumsum(coated) - coated
    order = np.argsort(np.concatenate([place, place[coated] + 1]))
    around = np.concatenate([np.full(len(fibre), MATRIX), place[coated]])
    return order, np.concatenate([fibre, fibre[coated]])[order], around[order]


def crossings(circles: Float, axis: int, size: Float) -> Float:
    """Sorted coordinates along `axis` on the side at 0: corners and crossings with circles."""
    depth, centre, radius = circles[:, 1 - axis], circles[:, axis], circles[:, 2]
    half = np.sqrt(np.maximum(radius**2 - depth**2, 0.0))
    crossing = np.concatenate([centre - half, centre + half])[np.tile(half > 0, 2)]
    return np.concatenate([[0.0], np.sort(crossing[(crossing > 0) & (crossing < size[axis])]), [size[axis]]])


def on_side(places: Float, axis: int, level: float) -> Float:
    """Points (k, 2) on the side along `axis` at the given level of the other coordinate."""
    points = np.full((len(places), 2), level)
    points[:, axis] = places
    return points


def side_curves(
    axis: int,
    places: Float,
    disc_at: Callable[[Float], Int],
    around: Int,
    size: Float,
    field: SizeField,
    numbering: Numbering,
    sampling: Sampling,
) -> Curves:
    """Return the pieces of both sides along `axis`, with the same nodes.

    `disc_at` returns the smallest closed curve around points, which is a number of `around` or MATRIX.
    """
    begin, span = places[:-1], np.diff(places)
    longest = np.full((len(span), 2), field.base.largest)
    pieces = Segments(on_side(begin, axis, 0.0), on_side(span, axis, 0.0), longest)
    samples = EdgeSamples.of(field, pieces, sampling.side)
    parts = []
    for level, low in ((0.0, True), (size[1 - axis], False)):
        inside = disc_at(on_side(begin + span / 2, axis, level))
        # A chord has two edges or more: a triangle with two arc edges beside it could not be flipped. From one circle
        # of a coating to the other it is no chord.
        into = around[inside] * (inside != MATRIX) + MATRIX * (inside == MATRIX)
        crosses = np.zeros(len(inside), bool)
        crosses[:-1] |= into[1:] == inside[:-1]
        crosses[1:] |= into[:-1] == inside[1:]
        fewest = np.where((inside == MATRIX) | crosses, 1, 2)
        stations = samples.stations(fewest, sampling.most_nodes)
        piece, first = stations.line, stations.first
        along = begin[piece] + span[piece] * stations.share
        along[first[:-1]], along[first[1:] - 1] = begin, places[1:]
        node = numbering.along(on_side(along, axis, level), first)
        if low != (axis == 0):
            # Counter-clockwise around the cell: along the coordinate at the bottom and at the right.
            node = node[(first[:-1] + first[1:] - 1)[piece] - np.arange(len(node))]
        straight, beyond = np.full(len(span), MATRIX), np.full(len(span), OUTSIDE)
        parts.append(Curves(node, first, straight, inside, beyond))
    return Curves.joined(parts)


def disc_at(circles: Float, points: Float) -> Int:
    """Return the smallest circle (k,) around each point on a line, or MATRIX."""
    beyond = circles[:, :2] - np.clip(circles[:, :2], points.min(axis=0), points.max(axis=0))
    close = np.flatnonzero(np.linalg.norm(beyond, axis=1) < circles[:, 2])
    if not len(close):
        return np.full(len(points), MATRIX)
    candidates = circles[close]
    holds = np.linalg.norm(points[:, None] - candidates[:, :2], axis=2) < candidates[:, 2]
    return np.where(holds.any(axis=1), close[np.where(holds, candidates[:, 2], np.inf).argmin(axis=1)], MATRIX)


def vertex_angles(circles: Float, curve: Int, border: Float, marks: Mapping[int, Sequence[float]]) -> OnCircles:
    """Circle (v,) and angle (v,) in [0, 2 pi) of all vertices: crossings with sides, and marks."""
    close = cKDTree(border).query_ball_point(circles[:, :2], circles[:, 2] * (1 + SAME_PLACE))
    number = np.repeat(np.arange(len(circles)), [len(candidates) for candidates in close])
    offset = border[np.concatenate([np.zeros(0, np.int64), *filter(len, close)]).astype(int)] - circles[number, :2]
    on_it = np.linalg.norm(offset, axis=1) > circles[number, 2] * (1 - SAME_PLACE)
    number, offset = number[on_it], offset[on_it]
    angle = np.arctan2(offset[:, 1], offset[:, 0]) % TURN
    for circle in np.flatnonzero(np.isin(curve, list(marks))).tolist():
        for mark in np.radians(marks[int(curve[circle])]) % TURN:
            if all(abs((mark - other + np.pi) % TURN - np.pi) > MERGED for other in angle[number == circle]):
                number, angle = np.append(number, circle), np.append(angle, mark)
    return number, angle


def arcs_within(
    n_curves: int, curve: Int, angle: Float, at: Callable[[Int, Float], Float], size: Float
) -> tuple[Int, Float, Float]:
    """Divide curves into arcs within the cell, at most a quarter turn each: curve, start and stop angle (a,).

    Closed curve curve[v] has a vertex at angle[v]; one without any gets one at 0. at(curves, angles) are the points
    (a, 2) there.
    """
    without = np.setdiff1d(np.arange(n_curves), curve)
    curve, angle = np.concatenate([curve, without]), np.concatenate([angle, np.zeros(len(without))])
    order = np.lexsort((angle, curve))
    curve, angle = curve[order], angle[order]
    is_first = np.diff(curve, prepend=-1) != 0
    after = np.append(angle[1:], 0.0)
    after[np.append(is_first[1:], True)] = angle[is_first] + TURN
    span = after - angle
    parts = np.maximum(1, np.ceil(span / QUARTER - SAME_PLACE)).astype(int)
    begin = np.repeat(np.arange(len(parts)), parts)
    part = np.arange(len(begin)) - np.repeat(np.cumsum(parts) - parts, parts)
    whose, first, last = curve[begin], *(angle[begin] + (span[begin] * k / parts[begin]) for k in (part, part + 1))
    middle = at(whose, (first + last) / 2)
    within = np.all((middle > 0) & (middle < size), axis=1)
    return whose[within], first[within], last[within]


def tip_vertices(
    arrangement: Arrangement,
    marks: Mapping[int, Sequence[float]],
    vertices: Float,
    at: Callable[[Int, Bool, Float], Float],
) -> Float:
    """Return the vertices (t, 2) that marks in degrees have become; missing curves have none.

    Mark k is on the outer curve of fibre k, ~k on the curve within its coating. at(fibres, within, angles) are the
    places (t, 2) of marks on fibres (t,), within coatings (t,) or not.
    """
    curves = {*range(len(arrangement.radii)), *(~np.flatnonzero(arrangement.coated)).tolist()}
    pairs = [(curve, mark) for curve, angles in marks.items() if curve in curves for mark in angles]
    curve, mark = np.array([k for k, _ in pairs], np.int64), np.array([mark for _, mark in pairs])
    places = at(np.where(curve < 0, ~curve, curve), curve < 0, np.radians(mark))
    size = arrangement.size
    return np.asarray(vertices[cKDTree(vertices % size, boxsize=size).query(places % size)[1]])
