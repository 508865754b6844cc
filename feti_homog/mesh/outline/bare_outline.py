"""The lines of a cell with discs and ellipses, cut where they meet; all ranks place their nodes afterwards."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.mesh.outline.bridges import Bridges, OnCircles
from feti_homog.mesh.outline.lines import (
    MATRIX,
    OUTSIDE,
    WHOLE,
    Arcs,
    Curves,
    EdgeSamples,
    Lines,
    Sampling,
    Segments,
    Stations,
)
from feti_homog.mesh.outline.outline import (
    SAME_PLACE,
    Outline,
    arcs_within,
    crossings,
    curve_at,
    images,
    on_curves,
    on_side,
    tip_vertices,
    vertex_angles,
)
from feti_homog.mesh.sizes.graded_size import MeshSizes, SizeField, circle_size, size_field
from feti_homog.microstructure import Arrangement
from feti_homog.microstructure.shapes import Conics, Discs, Ellipses
from feti_homog.system.parallel import dividing
from feti_homog.typing import Bool, Float, Int

NO_BRIDGES = Bridges(np.zeros((0, 2), np.int64), np.zeros(0))


# Nodes of the arcs, and of the bridges.
LineStations = tuple[Stations, Stations]


@dataclass(frozen=True)
class SizedLines:
    """Lines that get nodes one by one, so that ranks may share them."""

    arcs: Lines
    bridges: Segments
    sampling: Sampling

    def parts(self, count: int) -> list[SizedLines]:
        """Divide the lines, in order, into `count` parts of equal numbers."""
        arcs, bridges = (pairwise(dividing.even(len(lines), count)) for lines in (self.arcs, self.bridges))
        return [
            SizedLines(self.arcs.chosen(slice(*arcs_part)), self.bridges.chosen(slice(*bridges_part)), self.sampling)
            for arcs_part, bridges_part in zip(arcs, bridges, strict=True)
        ]

    def stations(self, field: SizeField) -> LineStations:
        """Place the nodes.

        Raises:
            MeshError: there would be more than the sampling allows.
        """
        limit, ones = self.sampling.most_nodes, np.ones(len(self.arcs) + len(self.bridges), np.int64)
        arcs = EdgeSamples.of(field, self.arcs, self.sampling.arc).stations(ones[: len(self.arcs)], limit)
        bridges = EdgeSamples.of(field, self.bridges, self.sampling.bridge).stations(ones[len(self.arcs) :], limit)
        return arcs, bridges

    def joined(self, parts: Sequence[LineStations]) -> LineStations:
        """Join the nodes of all parts.

        Raises:
            MeshError: they are more than the sampling allows.
        """
        arcs, bridges = (Stations.joined(stations, self.sampling.most_nodes) for stations in zip(*parts, strict=True))
        return arcs, bridges


@dataclass(frozen=True)
class BareOutline:
    """The lines of a cell without nodes but for their ends.

    Attributes:
        size: (2,) width and height.
        curves, disc, around: k outlines, (k,), (k,) as `outline.images` finds them.
        vertices: (v, 2) line ends.
        circle: (a,) the curve of each arc.
        lines: arcs, then bridges.
        field: the size of edges.
    """

    size: Float
    curves: Conics
    disc: Int
    around: Int
    vertices: Float
    circle: Int
    lines: SizedLines
    field: SizeField

    @classmethod
    def of(
        cls,
        arrangement: Arrangement,
        sizes: MeshSizes,
        marks: Mapping[int, Sequence[float]],
        bridges: Bridges = NO_BRIDGES,
        sampling: Sampling = WHOLE,
    ) -> BareOutline:
        """Lines whose nodes are to be at distances of at most `sizes`, closer in narrow passages.

        `marks` maps a curve to angles in degrees, measured at its centre, that become nodes: curve k is the outer one
        of fibre k, and ~k that within its coating. The bridges, between discs, are the last curves.
        """
        size = arrangement.size
        curves, disc, around = images(arrangement)
        sides = ((axis, level) for axis in (0, 1) for level in (0.0, size[1 - axis]))
        border = np.concatenate([on_side(crossings(curves, axis, size), axis, level) for axis, level in sides])
        name = np.where(around == MATRIX, disc, ~disc)
        crossing = on_curves(curves, border)
        angles = vertex_angles(curves, name, crossing, marks)
        border = np.unique(border, axis=0)
        (circle, *_), ends, away = _arcs(curves, border, angles, size)
        # Vertices within coatings are as far from each other as those on the curve around, which they face, unless
        # marked.
        sparse = (around != MATRIX) & ~np.isin(name, list(marks))
        outer = np.concatenate([border, ends[away & ~sparse[circle]]])
        # Ends of bridges are where there is room for them, and make nothing finer.
        angles = tuple(np.concatenate(parts) for parts in zip(angles, bridges.on_circles, strict=True))
        (circle, start, stop), ends, away = _arcs(curves, border, angles, size)
        vertices = np.concatenate([border, ends[away]])
        tips = tip_vertices(arrangement, marks, vertices)
        arcs: Lines
        if isinstance(curves, Discs):
            field = size_field(arrangement, sizes, outer, tips)
            first = np.unique(arrangement.shells[1], return_index=True)[1]
            caps = circle_size(arrangement, sizes.interface)[first[disc] + (around != MATRIX)]
            arcs = Arcs(curves.circles[circle], start, stop - start, np.stack([caps[circle]] * 2, axis=1))
            straight = _segments(curves, bridges, caps, field)
        else:
            from feti_homog.mesh.outline import elliptic_outline  # discs, the common case, do without

            field = elliptic_outline.size_field(arrangement, sizes, outer, tips, curves[crossing[0]], crossing[1])
            arcs = elliptic_outline.EllipticArcs.of(curves[circle], start, stop, sizes.interface)
            straight = Segments(*np.zeros((3, 0, 2)))
        return cls(size, curves, disc, around, vertices, circle, SizedLines(arcs, straight, sampling), field)

    def stations(self) -> LineStations:
        """Return where the nodes of its lines are, all found here.

        Raises:
            MeshError: there would be more than the sampling allows.
        """
        return self.lines.stations(self.field)

    def outline(self, stations: LineStations) -> Outline:
        """With these nodes; opposite sides have the same.

        Raises:
            MeshError: the sides would have more than the sampling allows.
        """
        arcs, bridges = stations
        circle, straight = self.circle, np.full(len(self.lines.bridges), MATRIX)
        parts = [*self._sides(0), *self._sides(1)]
        for lines, placed, regions in (
            (self.lines.arcs, arcs, (circle, circle, self.around[circle])),
            (self.lines.bridges, bridges, (straight, straight, straight)),
        ):
            curves = Curves(np.arange(len(placed.share)), placed.first, *regions)
            parts.append((lines.points(placed.line, placed.share), curves))
        begin = np.cumsum([0, *(len(points) for points, _ in parts)])
        place = np.concatenate([curves.node + first for (_, curves), first in zip(parts, begin, strict=False)])
        points, curves = np.concatenate([points for points, _ in parts]), Curves.joined([curves for _, curves in parts])
        # Vertices, found by position, have the first numbers, and then the nodes between.
        is_end = np.zeros(len(points), bool)
        is_end[curves.first[:-1]] = is_end[curves.first[1:] - 1] = True
        number = np.cumsum(~is_end) - 1 + len(self.vertices)
        number[is_end] = cKDTree(self.vertices).query(points[is_end])[1]
        ellipses = Ellipses(self.curves.centres, self.curves.frames)
        nodes = np.concatenate([self.vertices, points[~is_end]])
        return Outline(nodes, replace(curves, node=number[place]), ellipses, self.disc, self.around)

    def _sides(self, axis: int) -> Iterator[tuple[Float, Curves]]:
        """Yield the nodes (n, 2) on both sides along `axis`, the same ones, and the pieces through them."""
        places = crossings(self.curves, axis, self.size)
        begin, span = places[:-1], np.diff(places)
        longest = np.full((len(span), 2), self.field.base.largest)
        pieces = Segments(on_side(begin, axis, 0.0), on_side(span, axis, 0.0), longest)
        samples = EdgeSamples.of(self.field, pieces, self.lines.sampling.side)
        for level, low in ((0.0, True), (self.size[1 - axis], False)):
            inside = curve_at(self.curves, on_side(begin + span / 2, axis, level))
            # A chord has two edges or more: a triangle with two arc edges beside it could not be flipped. From one
            # circle of a coating to the other it is no chord.
            into = np.where(inside == MATRIX, MATRIX, self.around[inside])
            crosses = np.zeros(len(inside), bool)
            crosses[:-1] |= into[1:] == inside[:-1]
            crosses[1:] |= into[:-1] == inside[1:]
            fewest = np.where((inside == MATRIX) | crosses, 1, 2)
            stations = samples.stations(fewest, self.lines.sampling.most_nodes)
            piece, first = stations.line, stations.first
            along, node = begin[piece] + span[piece] * stations.share, np.arange(len(piece))
            along[first[:-1]], along[first[1:] - 1] = begin, places[1:]
            if low != (axis == 0):
                # Counter-clockwise around the cell: along the coordinate at the bottom and at the right.
                node = (first[:-1] + first[1:] - 1)[piece] - node
            straight, beyond = np.full(len(span), MATRIX), np.full(len(span), OUTSIDE)
            yield on_side(along, axis, level), Curves(node, first, straight, inside, beyond)


def _arcs(
    curves: Conics, border: Float, vertices: OnCircles, size: Float
) -> tuple[tuple[Int, Float, Float], Float, Bool]:
    """Return the arcs by `arcs_within`, the points (a, 2) at which they begin, and which are not in `border` (b, 2)."""
    arcs = arcs_within(curves, vertices, size)
    ends, same = curves[arcs[0]].points(arcs[1]), SAME_PLACE * size.max()
    away = np.all((ends > same) & (ends < size - same), axis=1)
    close = np.flatnonzero(~away)
    away[close] = cKDTree(border).query(ends[close])[0] > same
    return arcs, ends, away


def _segments(curves: Discs, bridges: Bridges, caps: Float, field: SizeField) -> Segments:
    """Return the bridges between discs, on whose circles edges are at most `caps` (k,).

    Where elements are not graded, edges are no longer than the sizes at both ends, interpolated: so gmsh does it across
    the matrix.
    """
    begin, end = (curves[bridges.ends[:, k]].points(bridges.angle + k * np.pi) for k in (0, 1))
    longest = np.full((len(begin), 2), field.base.largest)
    if field.graded is None:
        longest = np.stack(
            [np.minimum(field.at(at), caps[bridges.ends[:, k]]) for k, at in enumerate((begin, end))], axis=1
        )
    return Segments(begin, end - begin, longest)
