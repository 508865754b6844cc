"""Cut the outlines and sides of a cell, with discs or ellipses, into lines; all ranks then place nodes on the lines."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.mesh.outline import lines, outline
from feti_homog.mesh.outline.graded_size import MeshSizes, SizeField, circle_size, size_field
from feti_homog.mesh.outline.lines import MATRIX, OUTSIDE, Curves, Lines, LineStations, Segments, SizedLines
from feti_homog.microstructure import Arrangement
from feti_homog.microstructure.shapes import Conics, Discs, Ellipses
from feti_homog.typing import Bool, Float, Int

NO_BRIDGES = outline.Bridges(np.zeros((0, 2), np.int64), np.zeros(0))


@dataclass(frozen=True)
class BareOutline:
    """The cell lines before the placement of nodes.

    Attributes:
        size: (2,) width and height of the cell.
        curves, disc, around: k outlines, their fibres (k,) and surrounding outlines (k,), from `outline.images`.
        vertices: (v, 2) line ends, which become nodes.
        circle: (a,) curve of each arc, an index into `curves`.
        lines: arcs and bridges.
        field: edge sizes.
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
        cls, arrangement: Arrangement, sizes: MeshSizes, marks: outline.Marks, bridges: outline.Bridges | None = None
    ) -> BareOutline:
        """Divide the outlines and cell sides into lines, for edges of at most `sizes`.

        The `marks` become nodes. The `bridges` join discs in a cell of tiles; None without tiles.
        """
        sampling, bridges = (lines.WHOLE, NO_BRIDGES) if bridges is None else (lines.IN_TILES, bridges)
        size = arrangement.size
        curves, disc, around = outline.images(arrangement)
        assert isinstance(curves, Conics)
        levels = ((axis, level) for axis in (0, 1) for level in (0.0, size[1 - axis]))
        sides = [outline.on_side(outline.crossings(curves, axis, size), axis, level) for axis, level in levels]
        border = np.concatenate(sides)
        name = np.where(around == MATRIX, disc, ~disc)
        crossing = outline.on_curves(curves, border)
        angles = outline.vertex_angles(curves, name, crossing, marks)
        border = np.unique(border, axis=0)
        (circle, *_), ends, away = _arcs(curves, border, angles, size)
        # Without marks, the vertices on the inner curve of a coating repeat the distances of the outer vertices.
        sparse = (around != MATRIX) & ~np.isin(name, list(marks))
        outer = np.concatenate([border, ends[away & ~sparse[circle]]])
        # Bridge ends have enough room, and need no finer edges.
        angles = tuple(np.concatenate(parts) for parts in zip(angles, bridges.on_circles, strict=True))
        (circle, start, stop), ends, away = _arcs(curves, border, angles, size)
        vertices = np.concatenate([border, ends[away]])
        tips = outline.tip_vertices(arrangement, marks, vertices)
        arcs: Lines
        if isinstance(curves, Discs):
            field = size_field(arrangement, sizes, outer, tips)
            first = np.unique(arrangement.shells[1], return_index=True)[1]
            caps = circle_size(arrangement, sizes.interface)[first[disc] + (around != MATRIX)]
            arcs = lines.Arcs(curves.circles[circle], start, stop - start, np.stack([caps[circle]] * 2, axis=1))
            begin, end = (curves[bridges.ends[:, k]].points(bridges.angle + k * np.pi) for k in (0, 1))
            longest = np.full((len(begin), 2), field.largest)
            if field.graded is None:
                # Edge sizes vary linearly between both ends, as in gmsh across the matrix.
                at_ends = np.stack([field(begin), field(end)], axis=1)
                longest = np.minimum(at_ends, caps[bridges.ends])
            straight = Segments(begin, end - begin, longest)
        else:
            from feti_homog.mesh.outline import elliptic_outline  # discs do not need the module

            field = elliptic_outline.size_field(arrangement, sizes, outer, tips, curves[crossing[0]], crossing[1])
            arcs = elliptic_outline.EllipticArcs.of(curves[circle], start, stop, sizes.interface)
            straight = Segments(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((0, 2)))
        return cls(size, curves, disc, around, vertices, circle, SizedLines(arcs, straight, sampling), field)

    def outline(self, stations: LineStations) -> outline.Outline:
        """Make the outline: nodes `stations` on arcs and bridges, matching nodes on sides; MeshError for too many."""
        arcs, bridges = stations
        circle, straight = self.circle, np.full(len(self.lines.bridges), MATRIX)
        parts = [*self._sides(0), *self._sides(1)]
        for kind, placed, regions in (
            (self.lines.arcs, arcs, (circle, circle, self.around[circle])),
            (self.lines.bridges, bridges, (straight, straight, straight)),
        ):
            curves = Curves(np.arange(len(placed.share)), placed.first, *regions)
            parts.append((kind.points(placed.line, placed.share), curves))
        points, curves = Curves.joined(parts)
        # Vertices, identified by position, have the first numbers; the other nodes follow.
        is_end = np.zeros(len(points), bool)
        is_end[curves.first[:-1]] = is_end[curves.first[1:] - 1] = True
        number = np.cumsum(~is_end) - 1 + len(self.vertices)
        number[is_end] = cKDTree(self.vertices).query(points[is_end])[1]
        ellipses = Ellipses(self.curves.centres, self.curves.frames)
        nodes = np.concatenate([self.vertices, points[~is_end]])
        return outline.Outline(nodes, replace(curves, node=number[curves.node]), ellipses, self.disc, self.around)

    def _sides(self, axis: int) -> Iterator[tuple[Float, Curves]]:
        """Yield nodes (n, 2) and curves of both sides along `axis`, with matching nodes; MeshError for too many."""
        places = outline.crossings(self.curves, axis, self.size)
        begin, span = places[:-1], np.diff(places)
        longest = np.full((len(span), 2), self.field.largest)
        pieces = Segments(outline.on_side(begin, axis, 0.0), outline.on_side(span, axis, 0.0), longest)
        sampling = self.lines.sampling
        # Counter-clockwise around the cell: along the coordinate at the bottom and at the right.
        for level, is_forward in ((0.0, axis == 0), (self.size[1 - axis], axis == 1)):
            inside = outline.curve_at(self.curves, outline.on_side(begin + span / 2, axis, level))
            # A chord has at least two edges, because a triangle with a chord and two arc edges cannot flip. A piece
            # between both circles of a coating is not a chord.
            into = np.where(inside == MATRIX, MATRIX, self.around[inside])
            crosses = np.zeros(len(inside), bool)
            crosses[:-1] |= into[1:] == inside[:-1]
            crosses[1:] |= into[:-1] == inside[1:]
            fewest = np.where((inside == MATRIX) | crosses, 1, 2)
            stations = lines.place_nodes(self.field, pieces, sampling.side, fewest, sampling.most_nodes)
            piece, first = stations.line, stations.first
            along, node = begin[piece] + span[piece] * stations.share, np.arange(len(piece))
            along[first[:-1]], along[first[1:] - 1] = begin, places[1:]
            if not is_forward:
                node = (first[:-1] + first[1:] - 1)[piece] - node
            straight, beyond = np.full(len(span), MATRIX), np.full(len(span), OUTSIDE)
            yield outline.on_side(along, axis, level), Curves(node, first, straight, inside, beyond)


def _arcs(
    curves: Conics, border: Float, vertices: outline.OnCircles, size: Float
) -> tuple[tuple[Int, Float, Float], Float, Bool]:
    """Cut curves by `arcs_within`; also return the arc starts (a, 2), and the mask (a,) of starts off `border`."""
    arcs = outline.arcs_within(curves, vertices, size)
    ends, same = curves[arcs[0]].points(arcs[1]), outline.SAME_PLACE * size.max()
    away = np.all((ends > same) & (ends < size - same), axis=1)
    close = np.flatnonzero(~away)
    away[close] = cKDTree(border).query(ends[close])[0] > same
    return arcs, ends, away
