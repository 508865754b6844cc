"""The lines of a cell with round fibres, cut where they meet; all ranks place their nodes afterwards."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.mesh.outline.bridges import Bridges, OnCircles
from feti_homog.mesh.outline.lines import MATRIX, WHOLE, Arcs, Curves, EdgeSamples, Sampling, Segments, Stations
from feti_homog.mesh.outline.outline import (
    SAME_PLACE,
    Numbering,
    Outline,
    arcs_within,
    crossings,
    disc_at,
    images,
    on_side,
    side_curves,
    tip_vertices,
    vertex_angles,
)
from feti_homog.mesh.sizes.graded_size import MeshSizes, SizeField, circle_size, size_field
from feti_homog.microstructure import Arrangement
from feti_homog.microstructure.shapes import Ellipses, on_circle
from feti_homog.system.parallel import dividing
from feti_homog.typing import Bool, Float, Int

NO_BRIDGES = Bridges(np.zeros((0, 2), np.int64), np.zeros(0))


# Nodes of the arcs, and of the bridges.
LineStations = tuple[Stations, Stations]


@dataclass(frozen=True)
class SizedLines:
    """Lines that get nodes one by one, so that ranks may share them."""

    arcs: Arcs
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
        circles, disc, around: (k, 3), (k,), (k,) as `outline.images` finds them.
        places: along each axis the vertices on the sides.
        vertices: (v, 2) line ends.
        circle: (a,) that each arc is on.
        lines: arcs, then bridges.
        field: the size of edges.
    """

    size: Float
    circles: Float
    disc: Int
    around: Int
    places: list[Float]
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
        of fibre k, and ~k that within its coating. The bridges are the last curves.
        """
        size = arrangement.size
        circles, disc, around = images(arrangement)
        places = [crossings(circles, axis, size) for axis in (0, 1)]
        sides = ((axis, level) for axis in (0, 1) for level in (0.0, size[1 - axis]))
        border = np.concatenate([on_side(places[axis], axis, level) for axis, level in sides])
        curve = np.where(around == MATRIX, disc, ~disc)
        angles = vertex_angles(circles, curve, border, marks)
        # Vertices within coatings are as far from each other as those on the circle around, which they face, unless
        # marked.
        sparse = (around != MATRIX) & ~np.isin(curve, list(marks))
        border_once = np.unique(border, axis=0)
        outer = np.concatenate([border_once, _arcs(circles, border, angles, size, ~sparse)[1]])
        # Ends of bridges are where there is room for them, and make nothing finer.
        angles = tuple(np.concatenate(parts) for parts in zip(angles, bridges.on_circles, strict=True))
        (circle, start, stop), ends = _arcs(circles, border, angles, size, np.ones(len(circles), bool))
        vertices = np.concatenate([border_once, ends])

        def at(fibre: Int, within: Bool, angle: Float) -> Float:
            radii = np.where(within, arrangement.radii[fibre], arrangement.outer_radii[fibre])
            return on_circle(np.column_stack([arrangement.centres[fibre], radii]), angle)

        field = size_field(arrangement, sizes, outer, tip_vertices(arrangement, marks, vertices, at))
        first = np.unique(arrangement.shells[1], return_index=True)[1]
        caps = circle_size(arrangement, sizes.interface)[first[disc] + (around != MATRIX)]
        arcs = Arcs(circles[circle], start, stop - start, caps[circle])
        lines = SizedLines(arcs, _segments(circles, bridges, caps, field), sampling)
        return cls(size, circles, disc, around, places, vertices, circle, lines, field)

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
        find, numbering, sampling = partial(disc_at, self.circles), Numbering(self.vertices), self.lines.sampling
        curves = [
            side_curves(axis, self.places[axis], find, self.around, self.size, self.field, numbering, sampling)
            for axis in (0, 1)
        ]
        arcs, bridges = stations
        node = numbering.along(self.lines.arcs.points(arcs.line, arcs.share), arcs.first)
        curves.append(Curves(node, arcs.first, self.circle, self.circle, self.around[self.circle]))
        if len(self.lines.bridges):
            node = numbering.along(self.lines.bridges.points(bridges.line, bridges.share), bridges.first)
            straight = np.full(len(self.lines.bridges), MATRIX)
            curves.append(Curves(node, bridges.first, straight, straight, straight))
        ellipses = Ellipses.round(self.circles)
        return Outline(numbering.points(), Curves.joined(curves), ellipses, self.disc, self.around)


def _arcs(
    circles: Float, border: Float, vertices: OnCircles, size: Float, chosen: Bool
) -> tuple[tuple[Int, Float, Float], Float]:
    """Return the arcs by `arcs_within`, and the points (v, 2) at which arcs on `chosen` (k,) circles begin.

    Points on the border, near its points (b, 2), are left out.
    """
    arcs = arcs_within(len(circles), *vertices, lambda of, angle: on_circle(circles[of], angle), size)
    ends, same = on_circle(circles[arcs[0]], arcs[1]), SAME_PLACE * size.max()
    away = np.all((ends > same) & (ends < size - same), axis=1)
    close = np.flatnonzero(~away)
    away[close] = cKDTree(border).query(ends[close])[0] > same
    return arcs, ends[away & chosen[arcs[0]]]


def _segments(circles: Float, bridges: Bridges, caps: Float, field: SizeField) -> Segments:
    """Return the bridges between circles, on which edges are at most `caps` (k,).

    Where elements are not graded, edges are no longer than the sizes at both ends, interpolated: so gmsh does it across
    the matrix.
    """
    begin, end = (on_circle(circles[bridges.ends[:, k]], bridges.angle + k * np.pi) for k in (0, 1))
    longest = np.full((len(begin), 2), field.base.largest)
    if field.graded is None:
        longest = np.stack(
            [np.minimum(field.at(at), caps[bridges.ends[:, k]]) for k, at in enumerate((begin, end))], axis=1
        )
    return Segments(begin, end - begin, longest)
