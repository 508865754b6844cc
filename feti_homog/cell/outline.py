"""The lines of the cell: its sides and the arcs of fibres in it, cut where they meet, with nodes on them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.cell.arrangement import Arrangement
from feti_homog.cell.bridges import Bridges, OnCircles
from feti_homog.cell.circle_arcs import (
    SAME_PLACE,
    arc_curves,
    arcs_within,
    bridge_curves,
    on_circle,
    on_circles,
    vertex_angles,
)
from feti_homog.cell.curves import MATRIX, OUTSIDE, Curves, Numbering, backwards
from feti_homog.cell.edge_samples import WHOLE, EdgeSamples, Sampling
from feti_homog.cell.ellipses import Ellipses
from feti_homog.cell.graded_size import MeshSizes, SizeField, size_field
from feti_homog.cell.size_field import circle_size
from feti_homog.cell.tip_marks import marked
from feti_homog.typing import Bool, Float, Int

NO_BRIDGES = Bridges(np.zeros((0, 2), np.int64), np.zeros(0))


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
    curves: Curves
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


def outline(
    arrangement: Arrangement,
    sizes: MeshSizes,
    marks: Mapping[int, Sequence[float]],
    bridges: Bridges = NO_BRIDGES,
    sampling: Sampling = WHOLE,
) -> Outline:
    """All lines of the cell with nodes at distances of at most `sizes`, closer in narrow passages.

    Opposite sides have the same nodes. `marks` maps a curve to angles in degrees, measured at its centre, that become
    nodes: curve k is the outer one of fibre k, and ~k that within its coating. The bridges are the last curves.

    Raises:
        MeshError: there would be more nodes than the `sampling` allows.
    """
    size = np.array([arrangement.width, arrangement.height])
    circles, fibre, around = images(arrangement)
    places = [crossings(circles, axis, size) for axis in (0, 1)]
    sides = ((axis, level) for axis in (0, 1) for level in (0.0, size[1 - axis]))
    border = np.concatenate([on_side(places[axis], axis, level) for axis, level in sides])
    curve = np.where(around == MATRIX, fibre, ~fibre)
    vertices = vertex_angles(circles, curve, border, marks)
    # Vertices within coatings are as far from each other as those on the circle around, which they face, unless marked.
    sparse = (around != MATRIX) & ~np.isin(curve, list(marks))
    outer = np.concatenate([np.unique(border, axis=0), _arcs(circles, border, vertices, size, ~sparse)[1]])
    # Ends of bridges are where there is room for them, and make nothing finer.
    vertices = tuple(np.concatenate(parts) for parts in zip(vertices, bridges.on_circles, strict=True))
    (circle, start, stop), ends = _arcs(circles, border, vertices, size, np.ones(len(circles), bool))
    numbering = Numbering(np.concatenate([np.unique(border, axis=0), ends]))
    field = size_field(arrangement, sizes, outer, _tips(arrangement, marks, numbering.vertices))

    find = partial(disc_at, circles)
    curves = [side_curves(axis, places[axis], find, around, size, field, numbering, sampling) for axis in (0, 1)]
    caps = _caps(arrangement, sizes.interface, fibre, around)
    curves.append(arc_curves(circles, around, circle, start, stop, caps[circle], field, numbering, sampling))
    if len(bridges.angle):
        curves.append(bridge_curves(circles, bridges, caps, field, numbering, sampling))
    return Outline(numbering.points(), Curves.joined(curves), Ellipses.round(circles), fibre, around)


def _arcs(
    circles: Float, border: Float, vertices: OnCircles, size: Float, chosen: Bool
) -> tuple[tuple[Int, Float, Float], Float]:
    """The arcs of `arcs_within`, and the points (v, 2) at which those of the `chosen` (k,) circles begin, but for those
    on the border, near its points (b, 2)."""
    arcs = arcs_within(len(circles), *vertices, partial(on_circles, circles), size)
    ends = on_circles(circles, *arcs[:2])
    away = cKDTree(border).query(ends)[0] > SAME_PLACE * size.max()
    return arcs, ends[away & chosen[arcs[0]]]


def _caps(arrangement: Arrangement, largest: float, fibre: Int, around: Int) -> Float:
    """Largest edge length (k,) on the circles of these discs (k,) with these circles around (k,)."""
    first = np.unique(arrangement.circles[1], return_index=True)[1]
    return np.asarray(circle_size(arrangement, largest)[first[fibre] + (around != MATRIX)])


def crossings(circles: Float, axis: int, size: Float) -> Float:
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


def _tips(arrangement: Arrangement, marks: Mapping[int, Sequence[float]], vertices: Float) -> Float:
    """The vertices (t, 2) that the marks have become; those of curves that are not there are none."""
    curve, angle = marked(arrangement, marks)
    size, fibre = np.array([arrangement.width, arrangement.height]), np.where(curve < 0, ~curve, curve)
    radii = np.where(curve < 0, arrangement.radii[fibre], arrangement.outer_radii[fibre])
    places = on_circle(np.column_stack([arrangement.centres[fibre], radii]), angle)
    return np.asarray(vertices[cKDTree(vertices % size, boxsize=size).query(places % size)[1]])


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
    """The pieces of the two sides along `axis`, with the same nodes on both; `disc_at` tells the smallest closed curve
    around points, which is a number of `around` or MATRIX."""
    begin, span = places[:-1], np.diff(places)

    def point(piece: Int, share: Float) -> Float:
        return on_side(begin[piece] + span[piece] * share, axis, 0.0)

    samples = EdgeSamples.of(field, point, span, lambda piece, share: np.full(len(piece), np.inf), sampling.side)
    parts = []
    for level, low in ((0.0, True), (size[1 - axis], False)):
        inside = disc_at(on_side(begin + span / 2, axis, level))
        # A chord has two edges or more: a triangle with two arc edges beside it could not be flipped. From one circle
        # of a coating to the other it is no chord.
        into = around[inside] * (inside != MATRIX) + MATRIX * (inside == MATRIX)
        crosses = np.zeros(len(inside), bool)
        crosses[:-1] |= into[1:] == inside[:-1]
        crosses[1:] |= into[:-1] == inside[1:]
        least = np.where((inside == MATRIX) | crosses, 1, 2)
        station, first = samples.stations(least, sampling.most_nodes)
        piece = np.repeat(np.arange(len(span)), np.diff(first))
        along = begin[piece] + span[piece] * station
        along[first[:-1]], along[first[1:] - 1] = begin, places[1:]
        node = numbering.along(on_side(along, axis, level), first)
        # Counter-clockwise around the cell: along the coordinate at the bottom and at the right.
        turned = np.full(len(span), low != (axis == 0))
        straight, beyond = np.full(len(span), MATRIX), np.full(len(span), OUTSIDE)
        parts.append(Curves(backwards(node, first, turned), first, straight, inside, beyond))
    return Curves.joined(parts)


def disc_at(circles: Float, points: Float) -> Int:
    """The smallest circle (k,) around each point on a line, or MATRIX."""
    beyond = circles[:, :2] - np.clip(circles[:, :2], points.min(axis=0), points.max(axis=0))
    near = np.flatnonzero(np.linalg.norm(beyond, axis=1) < circles[:, 2])
    if not len(near):
        return np.full(len(points), MATRIX)
    own = circles[near]
    holds = np.linalg.norm(points[:, None] - own[:, :2], axis=2) < own[:, 2]
    return np.where(holds.any(axis=1), near[np.where(holds, own[:, 2], np.inf).argmin(axis=1)], MATRIX)
