"""Represent the matrix between discs by the faces of a planar graph of bridges and cell sides.

A bridge is a straight line across the matrix between the facing points of neighbouring discs, normal to both circles.
In a narrow gap, the length of a bridge is about the edge size of the mesh, which allows good triangles.

The graph nodes are the discs, and the cell corners outside discs. Each line consists of two half-lines, one from each
end. A half-line leaves a disc in the direction of the start point on the circle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import Delaunay, cKDTree

from feti_homog.mesh.outline.graded_size import CHUNK, wrap
from feti_homog.mesh.outline.outline import TURN, Bridges, OnCircles
from feti_homog.mesh.periodic_topology import components
from feti_homog.microstructure import arrangements
from feti_homog.microstructure.shapes import on_circle
from feti_homog.typing import Float, Int

# Least distance of bridges from third discs, in disc radii, and of bridge ends from cell sides, in mean radii.
CLEAR = 0.3
# Least angle between two bridges on one disc.
LEAST_ANGLE = np.radians(25)


@dataclass(frozen=True)
class CentreLines:
    """Lines between the centres of neighbouring discs: edges of a Delaunay triangulation.

    Attributes:
        ends: (e, 2) circles of both discs.
        angle: (e,) direction from the first to the second disc, in radians.
        gap: (e,) distance between the circles.
        facing: (e, 2, 2) the point on each circle that faces the other circle.
        clearance: (e,) least distance between the line and the centre of a third disc, in radii of that disc.
    """

    ends: Int
    angle: Float
    gap: Float
    facing: Float
    clearance: Float


def centre_lines(circles: Float, which: Int) -> CentreLines:
    """Connect the centres of the circles `which` (n,) by a Delaunay triangulation.

    `circles` is (k, 3). Clearances above 1 + CLEAR may be too large.  Raises QhullError if all centres lie on one line.
    """
    centres, radii = circles[which, :2], circles[which, 2]
    corners = Delaunay(centres).simplices
    pairs = np.sort(np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]]), axis=1)
    ends = np.unique(pairs, axis=0)
    vector = centres[ends[:, 1]] - centres[ends[:, 0]]
    length = np.linalg.norm(vector, axis=1)
    normal = vector / length[:, None]
    clearance = np.full(len(ends), np.inf)
    # Discs of similar radii at a time, so that searches omit small discs far from a line.
    classes = np.floor(np.log2(radii / radii.min())).astype(int)
    for members in (np.flatnonzero(classes == level) for level in np.unique(classes)):
        tree, reach = cKDTree(centres[members]), (1 + CLEAR) * radii[members].max()
        for begin in range(0, len(ends), CHUNK):
            batch = slice(begin, begin + CHUNK)
            close = tree.query_ball_point(centres[ends[batch, 0]] + vector[batch] / 2, length[batch] / 2 + reach)
            line = begin + np.repeat(np.arange(len(close)), [len(candidates) for candidates in close])
            disc = members[np.concatenate([np.zeros(0, np.int64), *filter(len, close)]).astype(int)]
            is_third = (disc[:, None] != ends[line]).all(axis=1)
            line, disc = line[is_third], disc[is_third]
            offset = centres[disc] - centres[ends[line, 0]]
            share = np.clip((offset * vector[line]).sum(axis=1) / length[line] ** 2, 0, 1)
            distance = np.linalg.norm(offset - share[:, None] * vector[line], axis=1)
            np.minimum.at(clearance, line, distance / radii[disc])
    facing = centres[ends] + radii[ends][:, :, None] * np.stack([normal, -normal], axis=1)
    angle, gap = np.arctan2(normal[:, 1], normal[:, 0]), length - radii[ends].sum(axis=1)
    return CentreLines(which[ends], angle, gap, facing, clearance)


def bridges(lines: CentreLines, size: Float, margin: float, largest: float, vertices: OnCircles) -> Bridges:
    """Choose bridges among the centre lines, clear of other discs and sides.

    On a disc, the angle between two bridges, or between a bridge and a vertex among `vertices`, is at least
    LEAST_ANGLE; the shorter of two close bridges stays.  Good triangles near a cell side need room: bridge ends are
    more than `margin` away, middles more than the bridge length or the element size `largest`, whichever is less.
    """
    middle = lines.facing.mean(axis=1)
    away, ends_away = (np.minimum(points, size - points) for points in (middle, lines.facing))
    inside = (ends_away.min(axis=(1, 2)) > margin) & (away.min(axis=1) > np.minimum(largest, lines.gap))
    clear = np.flatnonzero(inside & (lines.clearance > 1 + CLEAR))
    order = np.lexsort((clear, (lines.gap[clear] / size.max()).round(arrangements.DECIMALS)))
    candidates = Bridges(lines.ends[clear[order]], lines.angle[clear[order]])
    circle, angle = (np.concatenate(parts) for parts in zip(candidates.on_circles, vertices, strict=True))
    # Vertices come before all bridges.
    first, count = len(vertices[0]), len(order)
    rank = np.concatenate([first + np.arange(count), first + np.arange(count), np.arange(first)])
    # Pairs of points on one circle within LEAST_ANGLE; circle numbers differ by more.
    places = wrap(np.column_stack([circle, angle]), np.array([np.inf, TURN]))
    close = cKDTree(places, boxsize=[0, TURN]).query_pairs(LEAST_ANGLE, output_type="ndarray")
    better, worse = np.sort(rank[close], axis=1).T
    # All vertices stay, even close vertices; points that stay, best first, exclude worse points nearby.
    better, worse = better[worse >= first], worse[worse >= first]
    chosen, undecided = np.zeros(first + count, bool), np.ones(first + count, bool)
    while undecided.any():
        between = undecided[better] & undecided[worse]
        better, worse = better[between], worse[between]
        free = undecided.copy()
        free[worse] = False
        chosen |= free
        undecided &= ~free
        undecided[worse[free[better]]] = False
    return Bridges(candidates.ends[chosen[first:]], candidates.angle[chosen[first:]])


@dataclass(frozen=True)
class HalfLines:
    """The h half-lines of the graph, two for each line.

    Attributes:
        node: (h,) start node.
        angle: (h,) direction of the start point from the node centre, in [0, 2 pi).
        start: (h, 2) start point.
        twin: (h,) the other half-line of the line.
    """

    node: Int
    angle: Float
    start: Float
    twin: Int

    @classmethod
    def of(cls, nodes: Int, centres: Float, starts: Float) -> HalfLines:
        """Halve the lines between `nodes` (l, 2), with the end points `starts` (l, 2, 2).

        `centres` (n, 2) are node positions; half-lines from the second nodes come last.
        """
        node, start = nodes.T.ravel(), np.concatenate([starts[:, 0], starts[:, 1]])
        other = np.concatenate([starts[:, 1], starts[:, 0]])
        # At a corner, the start point is the centre: then the other end gives the direction.
        offset = np.where(np.all(start == centres[node], axis=1)[:, None], other, start) - centres[node]
        angle = np.arctan2(offset[:, 1], offset[:, 0]) % TURN
        return cls(node, angle, start, (np.arange(len(node)) + len(nodes)) % len(node))

    def faces(self) -> tuple[Int, Int]:
        """Trace loops with a face on the left: return the next half-line (h,) in the loop, and the loop number (h,)."""
        order = np.lexsort((self.angle, self.node))
        place = np.argsort(order)
        first = np.searchsorted(self.node[order], self.node[order])
        last = np.searchsorted(self.node[order], self.node[order], side="right") - 1
        # The next half-line clockwise from the twin.
        arrived = place[self.twin]
        after = order[np.where(arrived == first[arrived], last[arrived], arrived - 1)]
        return after, components(len(after), np.arange(len(after)), after)


@dataclass(frozen=True)
class MatrixTiles:
    """The assignment of the matrix faces to tiles; a tile is a cell of a grid.

    Attributes:
        lines: half-lines that divide the matrix: side pieces, then bridges.
        tile: (h,) tile on the left of each half-line.
        alone: (n,) tile around each disc without half-lines; -1 for all other discs.
    """

    lines: HalfLines
    tile: Int
    alone: Int


def beside(lines: HalfLines, label: Int, alone: Int, disc: Int, angle: Float) -> Int:
    """Return the matrix label (k,) beside discs (k,) at angles (k,), in radians.

    Discs have the label `alone` (n,) or, if it is -1, the `label` (h,) of the next half-line clockwise.
    """
    order = np.lexsort((lines.angle, lines.node))
    node, line_angle = lines.node[order], lines.angle[order]
    # Keys of discs differ by two turns, so that the half-lines of a disc stay together.
    place = np.searchsorted(node * 2 * TURN + line_angle, disc * 2 * TURN + angle % TURN, side="right") - 1
    first, last = np.searchsorted(node, disc), np.searchsorted(node, disc, side="right") - 1
    around = label[order[np.where(place < first, last, place)]]
    return np.where(alone[disc] < 0, around, alone[disc])


def matrix_tiles(
    circles: Float, outer: Int, sides: tuple[Int, Float], bridges: Bridges, lines: CentreLines, size: Float, grid: Int
) -> MatrixTiles | None:
    """Distribute the matrix faces to the cells of a grid (2,) by centroids.

    Returns None if no centre line assigns a disc, or a group of discs without bridges to the sides, to a face.

    Args:
        circles: (k, 3) centres and radii.
        outer: (n,) circles that bound the matrix.
        sides: nodes (s, 2) and ends (s, 2, 2) of side pieces in the matrix, counter-clockwise around the cell.
    """
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]) * size
    centres = np.concatenate([circles[:, :2], corners])
    ends = np.stack([on_circle(circles[bridges.ends[:, k]], bridges.angle + k * np.pi) for k in (0, 1)], axis=1)
    half = HalfLines.of(np.concatenate([sides[0], bridges.ends]), centres, np.concatenate([sides[1], ends]))
    after, loop = half.faces()
    lone = np.setdiff1d(outer, half.node)
    count = loop.max() + 1
    alone = np.full(len(circles), -1)
    alone[lone] = count + np.arange(len(lone))
    # A centre line crosses no bridge: both are edges of one triangulation. So a centre line in the cell, away from
    # third discs, runs through one face.
    free = (lines.clearance > 1) & np.all((lines.facing > 0) & (lines.facing < size), axis=(1, 2))
    n = half.node.max() + 1
    free &= ~np.isin(lines.ends @ [n, 1], half.node * n + half.node[half.twin])
    pairs = (beside(half, loop, alone, lines.ends[free, k], lines.angle[free] + k * np.pi) for k in (0, 1))
    face = components(count + len(lone), *pairs)
    # The lines, and chords along circles between lines.
    end, which = half.start[half.twin], np.tile(loop, 2)
    a, b = np.concatenate([half.start, end]), np.concatenate([end, half.start[after]])
    cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    # A face has one outer loop, and inner loops of negative area. The face beyond the sides has no outer loop. Loops
    # around trees contain both halves of all lines, and have no area except for rounding.
    is_tree = np.bincount(loop, loop[half.twin] != loop) == 0
    around = np.bincount(face[:count], (np.bincount(which, cross) > 0) & ~is_tree, face.max() + 1)
    beyond = face[loop[half.twin[0]]]
    if (np.delete(around, beyond) != 1).any():
        return None
    centroids = [np.bincount(face[which], (a + b)[:, k] * cross) / np.bincount(face[which], cross) / 3 for k in (0, 1)]
    tile = grid_cell(np.stack(centroids, axis=1), size, grid)
    return MatrixTiles(half, tile[face[loop]], np.where(alone < 0, alone, tile[face[alone]]))


def grid_cell(points: Float, size: Float, grid: Int) -> Int:
    """Find the cell (k,) of a grid (2,) over [0, size] around each point."""
    share = (points / size).round(arrangements.DECIMALS)
    column, row = np.clip((share * grid).astype(np.int64), 0, grid - 1).T
    return np.asarray(column * grid[1] + row)
