"""The lines of a cell with ellipses: sides and arcs, cut where they meet, edge sizes and nodes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.mesh.outline.bridges import TURN
from feti_homog.mesh.outline.lines import MATRIX, WHOLE, Curves, EdgeSamples, Lines
from feti_homog.mesh.outline.outline import (
    MERGED,
    SAME_PLACE,
    Numbering,
    Outline,
    arcs_within,
    nested,
    on_side,
    side_curves,
    tip_vertices,
)
from feti_homog.mesh.sizes import graded_size
from feti_homog.mesh.sizes.element_estimate import refuse_many
from feti_homog.mesh.sizes.from_sources import MAX_GROWTH, Source, SourcedSize, wrap
from feti_homog.microstructure import Arrangement, arrangements
from feti_homog.microstructure.shapes import Ellipses, directions, gaps
from feti_homog.typing import Bool, Float, Int

# Steps of a quarter of an ellipse between which its length is taken to be linear.
LENGTH_STEPS = 256
# Points of each ellipse at which its curvature, and its distance from corners, are taken.
POINTS = 256
# Edges of coatings / thickness.
LONGEST = 10.0


def outline(
    arrangement: Arrangement, inner: Ellipses, sizes: graded_size.MeshSizes, marks: Mapping[int, Sequence[float]]
) -> Outline:
    """Make lines as `BareOutline.of` for an arrangement with outlines `inner`, with nodes on them."""
    size = arrangement.size
    ellipses, fibre, around = _images(arrangement, inner, size)
    places = [_crossings(ellipses, axis, size) for axis in (0, 1)]
    sides = ((axis, level) for axis in (0, 1) for level in (0.0, size[1 - axis]))
    border = np.concatenate([on_side(places[axis], axis, level) for axis, level in sides])
    curve = np.where(around == MATRIX, fibre, ~fibre)
    angles, sharp = _vertex_angles(ellipses, curve, border, size, marks)
    which, start, stop = arcs_within(len(fibre), *angles, lambda of, angle: ellipses[of].points(angle), size)
    ends = ellipses[which].points(start)
    away = cKDTree(border).query(ends)[0] > SAME_PLACE * size.max()
    border = np.unique(border, axis=0)
    numbering = Numbering(np.concatenate([border, ends[away]]))
    # Vertices within coatings are as far from each other as those on the ellipse around, which they face, or marked.
    sparse = (around != MATRIX) & ~np.isin(curve, list(marks))
    outer = np.concatenate([border, ends[away & ~sparse[which]]])

    def at(fibre: Int, within: Bool, angle: Float) -> Float:
        curves = inner[fibre].grown(np.where(within, 0.0, arrangement.coating[fibre]))
        return curves.points(curves.parameter(directions(angle)))

    tips = tip_vertices(arrangement, marks, numbering.vertices, at)
    field = _size_field(arrangement, inner, sizes, outer, sharp, tips)
    refuse_many(field.at, field.least, size)
    area = np.abs(np.linalg.det(ellipses.frames))

    def find(points: Float) -> Int:
        holds = ellipses.level(points) < 1
        return np.where(holds.any(axis=1), np.where(holds, area, np.inf).argmin(axis=1), MATRIX)

    curves = [side_curves(axis, places[axis], find, around, size, field, numbering, WHOLE) for axis in (0, 1)]
    arcs = EllipticArcs.of(ellipses[which], start, stop, sizes.interface)
    stations = EdgeSamples.of(field, arcs, WHOLE.arc).stations(np.ones(len(which), np.int64), WHOLE.most_nodes)
    node = numbering.along(arcs.points(stations.line, stations.share), stations.first)
    curves.append(Curves(node, stations.first, which, which, around[which]))
    return Outline(numbering.points(), Curves.joined(curves), ellipses, fibre, around)


def _images(arrangement: Arrangement, outlines: Ellipses, size: Float) -> tuple[Ellipses, Int, Int]:
    """Periodic images that may reach into the cell, their fibres (k,), and the ellipses around them (k,).

    They go fibre by fibre and image by image, each from without.
    """
    steps = np.array(list(product((-1, 0, 1), repeat=2)))
    order = arrangement.mesh_order
    fibre = np.repeat(np.arange(len(outlines)) if order is None else order, len(steps))
    shift = np.tile(steps, (len(outlines), 1)) * size
    inner = outlines[fibre].at(outlines.centres[fibre] + shift)
    outer = inner.grown(arrangement.coating[fibre])
    inside = np.all((outer.centres + outer.reach > 0) & (outer.centres - outer.reach < size), axis=1)
    coated = arrangement.coated[fibre[inside]]
    order, owner, around = nested(fibre[inside], coated)
    return outer[inside].joined(inner[inside][coated])[order], owner, around


def _crossings(ellipses: Ellipses, axis: int, size: Float) -> Float:
    """Sorted coordinates along `axis` on the side at 0: corners and crossings with ellipses.

    d = x - c with the known component v obeys d . (F F^T)^-1 d = 1.
    """
    inverse, other = np.linalg.inv(ellipses.squares), 1 - axis
    v, centre = -ellipses.centres[:, other], ellipses.centres[:, axis]
    p, q = inverse[:, axis, axis], inverse[:, axis, other] * v
    root = q**2 - p * (inverse[:, other, other] * v**2 - 1)
    half = np.sqrt(np.maximum(root, 0.0)) / p
    crossing = np.concatenate([centre - q / p - half, centre - q / p + half])[np.tile(half > 0, 2)]
    return np.concatenate([[0.0], np.sort(crossing[(crossing > 0) & (crossing < size[axis])]), [size[axis]]])


def _vertex_angles(
    ellipses: Ellipses, curve: Int, border: Float, size: Float, marks: Mapping[int, Sequence[float]]
) -> tuple[tuple[Int, Float], tuple[Float, Float]]:
    """Ellipse (v,) and parameter (v,) in [0, 2 pi) of all vertices: crossings with sides, and marks.

    Also the crossings (c, 2), and R phi (c,) there, with the angle phi between side and ellipse, whose radius is R.
    """
    angles, where, lengths = [np.zeros(0)], [np.zeros((0, 2))], [np.zeros(0)]
    close = cKDTree(border).query_ball_point(ellipses.centres, ellipses.longest * (1 + SAME_PLACE))
    for number, (owner, candidates) in enumerate(zip(curve.tolist(), close, strict=True)):
        places = border[candidates]
        one = ellipses[np.full(len(places), number)]
        on_it = np.abs(np.linalg.norm(one.unit(places - one.centres), axis=1) - 1) < SAME_PLACE
        places, one = places[on_it], one[on_it]
        crossing = one.parameter(places - one.centres) % TURN
        normal = one.normal(crossing)
        is_upright = np.isin(places[:, 0], (0.0, size[0]))
        along = np.where(is_upright, normal[:, 0], normal[:, 1])
        where.append(places)
        lengths.append(one.bend(normal) * np.arccos(np.minimum(np.abs(along), 1.0)))
        mark, offsets = np.radians(marks.get(owner, ())), places - ellipses.centres[number]
        away = np.abs((mark[:, None] - np.arctan2(offsets[:, 1], offsets[:, 0]) + np.pi) % TURN - np.pi)
        mark = mark[(away > MERGED).all(axis=1)]
        mine = ellipses[np.full(len(mark), number)]
        angles.append(np.append(crossing, mine.parameter(directions(mark)) % TURN))
    whose = np.repeat(np.arange(len(curve)), [len(crossing) for crossing in angles[1:]])
    return (whose, np.concatenate(angles)), (np.concatenate(where), np.concatenate(lengths))


@dataclass(frozen=True)
class EllipticArcs(Lines):
    """Arcs of ellipses, all with one longest edge, unless the curvature asks for shorter ones.

    Attributes:
        ellipses: of each arc.
        angle, way: (a, k) parameters of places on each arc, and the lengths up to there.
        cap: longest edge.
    """

    ellipses: Ellipses
    angle: Float
    way: Float
    cap: float

    @classmethod
    def of(cls, ellipses: Ellipses, start: Float, stop: Float, cap: float) -> EllipticArcs:
        """Return arcs between parameters (a,) of ellipses (a,)."""
        share = np.linspace(0, 1, LENGTH_STEPS + 1)
        angle = start[:, None] + (stop - start)[:, None] * share
        places = np.stack([ellipses.points(angle[:, k]) for k in range(len(share))], axis=1)
        length = np.cumsum(np.linalg.norm(np.diff(places, axis=1), axis=2), axis=1)
        return cls(ellipses, angle, np.column_stack([np.zeros(len(length)), length]), cap)

    @property
    def lengths(self) -> Float:
        """See `Lines`."""
        return self.way[:, -1]

    def points(self, line: Int, share: Float) -> Float:
        """See `Lines`."""
        way = self.way / self.way[:, -1:]
        after = np.clip((way[line] <= share[:, None]).sum(axis=1), 1, LENGTH_STEPS)
        low, high = way[line, after - 1], way[line, after]
        part = (share - low) / (high - low)
        parameter = self.angle[line, after - 1] * (1 - part) + self.angle[line, after] * part
        return self.ellipses[line].points(parameter)

    def caps(self, line: Int, share: Float) -> Float:
        """See `Lines`."""
        return np.full(len(line), self.cap)


def _size_field(
    arrangement: Arrangement,
    inner: Ellipses,
    sizes: graded_size.MeshSizes,
    vertices: Float,
    crossings: tuple[Float, Float],
    tips: Float,
) -> graded_size.SizeField:
    """Return the size field as `graded_size.size_field`, for the ellipses `inner`.

    `crossings` are where cell sides meet ellipses (c, 2), and the length (c,) R phi there: they meet at the angle phi,
    and the radius of curvature is R.
    """
    size, largest = arrangement.size, sizes.largest
    shells, disc = arrangement.shells
    # In mesh order: that of rows does not matter.
    rank = np.arange(len(inner)) if arrangement.mesh_order is None else np.argsort(arrangement.mesh_order)
    order = np.argsort(rank[disc], kind="stable")
    ellipses, disc = Ellipses(shells.centres, shells.frames)[order], disc[order]
    angle, which = np.tile(np.linspace(0, 2 * np.pi, POINTS, endpoint=False), len(ellipses)), np.arange(len(ellipses))
    around = np.repeat(which, POINTS)
    points, normal = ellipses[around].points(angle), ellipses[around].normal(angle)
    thin = _coating_size(arrangement, inner, disc[around], normal)
    # As on circles of the same curvature.
    caps = np.minimum(
        2 * np.pi * ellipses[around].bend(normal) / graded_size.MIN_EDGES_AROUND, np.minimum(sizes.interface, thin)
    )
    outer = ellipses[np.sort(np.unique(disc, return_index=True)[1])]
    offset = (points + size / 2) % size - size / 2
    nearest = offset[np.argmin(np.linalg.norm(offset, axis=1))]
    to_corner = min(graded_size.PASSAGE_EDGE * float(np.linalg.norm(nearest)), largest)
    sources = [
        (points, caps, np.full(len(points), MAX_GROWTH)),
        _between(outer, size, largest),
        _beside_sides(ellipses, size, largest),
        (crossings[0], np.minimum(crossings[1] / graded_size.WEDGE, largest), np.full(len(crossings[0]), MAX_GROWTH)),
        (np.stack([nearest, np.zeros(2)]), np.full(2, to_corner), np.full(2, MAX_GROWTH)),
        graded_size.at_vertices(vertices, size, largest),
    ]
    base = SourcedSize(sources, size, largest)
    if not sizes.are_graded(arrangement):
        return graded_size.SizeField(base)
    on_curves, sizes_there = cKDTree(wrap(points, size), boxsize=size), np.minimum(sizes.interface, thin)
    tree = cKDTree(wrap(tips.reshape(-1, 2), size), boxsize=size)

    def graded(positions: Float) -> Float:
        places = wrap(positions, size)
        at_tips = sizes.tip + MAX_GROWTH * np.maximum(0.0, tree.query(places)[0] - sizes.tip)
        distance, nearest = on_curves.query(places)
        return np.asarray(np.minimum(sizes_there[nearest] + MAX_GROWTH * distance, at_tips))

    return graded_size.SizeField(base, graded, min(sizes.tip, float(sizes_there.min())))


def _coating_size(arrangement: Arrangement, inner: Ellipses, disc: Int, normal: Float) -> Float:
    """Largest edge length (k,) on either side of coatings around discs (k,) where normals are n (k, 2).

    As on circles, sqrt(t R), with the thickness and the radius of curvature there, but not longer than in the thinnest
    coatings around circles, LONGEST t; infinite without a coating.
    """
    ellipse = inner[disc]
    thickness = ellipse.grown(arrangement.coating[disc]).support(normal) - ellipse.support(normal)
    return np.where(
        arrangement.coated[disc], np.minimum(np.sqrt(thickness * ellipse.bend(normal)), LONGEST * thickness), np.inf
    )


def _between(ellipses: Ellipses, size: Float, largest: float) -> Source:
    """Facing points of near fibres, with the edges that suit their gap."""
    first, second, vector = arrangements.neighbours(ellipses.centres, size, 2 * ellipses.longest.max() + largest)
    one = ellipses[first]
    other = Ellipses(one.centres + vector, ellipses.frames[second])
    gap, direction = gaps(one, other)
    normal = directions(direction)
    length = graded_size.PASSAGE_EDGE * gap
    growth = graded_size.passage_growth(gap, 1 / one.bend(normal) + 1 / other.bend(-normal))
    narrow = length < largest
    places = np.concatenate([one.facing(normal)[narrow], other.facing(-normal)[narrow]])
    return places, np.tile(length[narrow], 2), np.tile(growth[narrow], 2)


def _beside_sides(ellipses: Ellipses, size: Float, largest: float) -> Source:
    """Points where an ellipse comes near a side or hardly crosses it: extreme point and foot on the side."""
    sources: list[Source] = []
    for axis, sign in product((0, 1), (-1.0, 1.0)):
        normal = np.zeros((len(ellipses), 2))
        normal[:, axis] = sign
        extreme = ellipses.facing(normal)
        foot = extreme.copy()
        foot[:, axis] = np.round(extreme[:, axis] / size[axis]) * size[axis]
        width = np.abs(extreme - foot)[:, axis]
        length = graded_size.PASSAGE_EDGE * width
        narrow = length < largest
        growth = graded_size.passage_growth(width, 1 / ellipses.bend(normal))
        sources += [(place[narrow], length[narrow], growth[narrow]) for place in (extreme, foot)]
    places, lengths, growths = (np.concatenate(parts) for parts in zip(*sources, strict=True))
    return places, lengths, growths
