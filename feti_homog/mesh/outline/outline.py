"""Build the cell lines: images of outlines, vertices, arcs and pieces of sides."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.mesh.outline.lines import MATRIX, Curves
from feti_homog.microstructure import Arrangement
from feti_homog.microstructure.shapes import Conics, Discs, Ellipses, Outlines
from feti_homog.typing import Bool, Float, Int

TURN = 2 * np.pi
# Relative distance below which two positions coincide.
SAME_PLACE = 1e-9
# Angle between a mark and another vertex on a circle, in radians, below which the mark is that vertex.
MERGED = np.radians(0.05)

# Circle (v,) and angle (v,) in radians of points on circles.
OnCircles = tuple[Int, Float]
# Angles in degrees, measured at the centre, by curve: k is the outer curve of fibre k, ~k the curve within its coating.
Marks = Mapping[int, Sequence[float]]


@dataclass(frozen=True)
class Bridges:
    """Straight lines between circles `ends` (b, 2); `angle` (b,) is the direction from the first circle, in radians."""

    ends: Int
    angle: Float

    @property
    def on_circles(self) -> OnCircles:
        """The circles (2b,) and angles (2b,) of all bridge ends: first the start points, then the end points."""
        return self.ends.T.ravel(), np.concatenate([self.angle, self.angle + np.pi]) % TURN


@dataclass(frozen=True)
class Outline:
    """The lines of a cell, divided by nodes: borders, interfaces and bridges.

    Attributes:
        points: (n, 2) exact positions of the nodes on all lines.
        curves: curves through the nodes.
        ellipses: k circles and ellipses in the plane, disc by disc and image by image, coating before core.
        disc: (k,) index of the fibre or void of each circle or ellipse.
        around: (k,) index of the circle or ellipse that surrounds each one, MATRIX if none does.
    """

    points: Float
    curves: Curves
    ellipses: Ellipses
    disc: Int
    around: Int

    @property
    def is_coating(self) -> Bool:
        """The mask (k,) of the outer circles of rings: of coatings, and of walls of hollow fibres."""
        return np.isin(np.arange(len(self.around)), self.around)


def images(arrangement: Arrangement) -> tuple[Outlines, Int, Int]:
    """Find the outlines (k,) in the cell, their fibres (k,), and the outline (k,) around each, MATRIX if none.

    Periodic images have separate entries, fibre by fibre and image by image, coating before core.
    """
    size, outlines, outer = arrangement.size, arrangement.outlines, arrangement.outer
    steps = np.array(list(np.ndindex(3, 3))) - 1
    fibre = np.repeat(arrangement.order, len(steps))
    centres = outlines.centres[fibre] + np.tile(steps, (len(outlines), 1)) * size
    if isinstance(outer, Discs):
        inside = ((centres - np.clip(centres, 0, size)) ** 2).sum(axis=1) < (outer.radii**2)[fibre]
    else:
        low, high = centres - outer.extents[fibre, :, 0], centres + outer.extents[fibre, :, 1]
        inside = np.all((high > 0) & (low < size), axis=1)
    fibre, centres = fibre[inside], centres[inside]
    coated = arrangement.coated[fibre]
    place = np.arange(len(fibre)) + np.cumsum(coated) - coated
    order = np.argsort(np.concatenate([place, place[coated] + 1]))
    curves = outer[fibre].at(centres).joined(outlines[fibre[coated]].at(centres[coated]))[order]
    around = np.concatenate([np.full(len(fibre), MATRIX), place[coated]])[order]
    return curves, np.concatenate([fibre, fibre[coated]])[order], around


def crossings(curves: Conics, axis: int, size: Float) -> Float:
    """Find where curves cross the side from the origin along `axis`: ascending coordinates (k,), with both corners."""
    middle, half = curves.chord(axis)
    crossing = np.concatenate([middle - half, middle + half])[np.tile(half > 0, 2)]
    return np.concatenate([[0.0], np.sort(crossing[(crossing > 0) & (crossing < size[axis])]), [size[axis]]])


def on_side(places: Float, axis: int, level: float) -> Float:
    """Return the points (k, 2) of a side: coordinates `places` (k,) along `axis`, and `level` along the other axis."""
    points = np.full((len(places), 2), level)
    points[:, axis] = places
    return points


def curve_at(curves: Conics, points: Float) -> Int:
    """Find the smallest curve (k,) that contains each point (k, 2); MATRIX if no curve does."""
    beyond = curves.centres - np.clip(curves.centres, points.min(axis=0), points.max(axis=0))
    numbers = np.flatnonzero(np.linalg.norm(beyond, axis=1) < curves.longest)
    if not len(numbers):
        return np.full(len(points), MATRIX)
    offsets = (points[:, None] - curves.centres[numbers]).reshape(-1, 2)
    levels = np.linalg.norm(curves[np.tile(numbers, len(points))].unit(offsets), axis=1)
    holds = levels.reshape(len(points), len(numbers)) < 1
    return np.where(holds.any(axis=1), numbers[np.where(holds, curves.radii[numbers], np.inf).argmin(axis=1)], MATRIX)


def on_curves(curves: Conics, points: Float) -> tuple[Int, Float]:
    """Find all c pairs of a curve and a point on it; return the curve numbers (c,) and points (c, 2)."""
    close = cKDTree(points).query_ball_point(curves.centres, curves.longest * (1 + SAME_PLACE))
    number = np.repeat(np.arange(len(curves)), [len(candidates) for candidates in close])
    points = points[np.concatenate([np.zeros(0, np.int64), *filter(len, close)]).astype(int)]
    unit = curves[number].unit(points - curves.centres[number])
    is_on_curve = np.abs(np.linalg.norm(unit, axis=1) - 1) < SAME_PLACE
    return number[is_on_curve], points[is_on_curve]


def vertex_angles(curves: Conics, name: Int, crossing: tuple[Int, Float], marks: Marks) -> OnCircles:
    """Return the curves (v,) and parameters (v,) in [0, 2 pi) of crossings and marks.

    `crossing` is the result of `on_curves`, and `name` (k,) has the key of each curve in `marks`. Marks within MERGED
    of another vertex are left out.
    """
    number, points = crossing
    offset, count = points - curves.centres[number], len(number)
    direction = np.arctan2(offset[:, 1], offset[:, 0])
    for curve in np.flatnonzero(np.isin(name, list(marks))).tolist():
        for mark in np.radians(marks[int(name[curve])]):
            if all(abs((mark - other + np.pi) % TURN - np.pi) > MERGED for other in direction[number == curve]):
                number, direction = np.append(number, curve), np.append(direction, mark)
    marked = curves[number[count:]].parameter_at(direction[count:])
    return number, np.append(curves[number[:count]].parameter(offset), marked) % TURN


def arcs_within(curves: Conics, vertices: OnCircles, size: Float) -> tuple[Int, Float, Float]:
    """Divide curves at `vertices` into arcs of at most a quarter turn, and keep arcs within the cell.

    Returns curves (a,), and first and last parameters (a,). The arcs of a curve without vertices begin at 0.
    """
    bare_curves = np.setdiff1d(np.arange(len(curves)), vertices[0])
    curve, angle = np.append(vertices[0], bare_curves), np.append(vertices[1], np.zeros(len(bare_curves)))
    order = np.lexsort((angle, curve))
    curve, angle = curve[order], angle[order]
    is_first = np.diff(curve, prepend=-1) != 0
    after = np.append(angle[1:], 0.0)
    after[np.append(is_first[1:], True)] = angle[is_first] + TURN
    span = after - angle
    parts = np.maximum(1, np.ceil(span / (TURN / 4) - SAME_PLACE)).astype(int)
    begin = np.repeat(np.arange(len(parts)), parts)
    part = np.arange(len(begin)) - np.repeat(np.cumsum(parts) - parts, parts)
    arc_curve, first = curve[begin], angle[begin] + span[begin] * part / parts[begin]
    last = angle[begin] + span[begin] * (part + 1) / parts[begin]
    middle = curves[arc_curve].points((first + last) / 2)
    within = np.all((middle > 0) & (middle < size), axis=1)
    return arc_curve[within], first[within], last[within]


def tip_vertices(arrangement: Arrangement, marks: Marks, vertices: Float) -> Float:
    """Find the vertex nearest to each mark on the curves of an arrangement: positions (t, 2)."""
    names = {*range(len(arrangement.radii)), *(~np.flatnonzero(arrangement.coated)).tolist()}
    pairs = [(name, mark) for name, angles in marks.items() if name in names for mark in angles]
    name, mark = np.array([name for name, _ in pairs], np.int64), np.array([mark for _, mark in pairs])
    fibre = np.where(name < 0, ~name, name)
    curves = arrangement.outlines[fibre].grown(np.where(name < 0, 0.0, arrangement.coating[fibre]))
    size = arrangement.size
    assert isinstance(curves, Conics)
    places = curves.points(curves.parameter_at(np.radians(mark)))
    return np.asarray(vertices[cKDTree(vertices % size, boxsize=size).query(places % size)[1]])
