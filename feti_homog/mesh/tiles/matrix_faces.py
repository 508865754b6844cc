"""The matrix between discs as faces in a planar graph, whose lines are bridges and cell sides.

Its nodes are the discs and the cell corners outside discs; lines leave a disc in the directions in which they begin on
its circle. Lines are listed twice, once from either end.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from feti_homog.mesh.outline.bridges import PLACE_DECIMALS, TURN, Bridges, CentreLines
from feti_homog.mesh.periodic_topology import components
from feti_homog.microstructure.shapes import on_circle
from feti_homog.typing import Float, Int

NOWHERE = -1


@dataclass(frozen=True)
class HalfLines:
    """Half-lines (h,) in pairs: number k and its other half twin[k].

    Attributes:
        node: (h,) that it begins at.
        angle: (h,) in [0, 2 pi) from the centre of the node.
        start: (h, 2) where it begins.
        twin: (h,)
    """

    node: Int
    angle: Float
    start: Float
    twin: Int

    @classmethod
    def of(cls, nodes: Int, centres: Float, starts: Float) -> HalfLines:
        """Halve the lines between `nodes` (l, 2), from starts[:, 0] to starts[:, 1] (l, 2, 2).

        The nodes have these centres (n, 2); halves from the second node come last.
        """
        node, start = nodes.T.ravel(), np.concatenate([starts[:, 0], starts[:, 1]])
        other = np.concatenate([starts[:, 1], starts[:, 0]])
        # A corner is its own place: what leaves it is seen from where it goes.
        offset = np.where(np.all(start == centres[node], axis=1)[:, None], other, start) - centres[node]
        angle = np.arctan2(offset[:, 1], offset[:, 0]) % TURN
        return cls(node, angle, start, (np.arange(len(node)) + len(nodes)) % len(node))

    def faces(self) -> tuple[Int, Int]:
        """Return the half-line (h,) after each one around the face on its left, and that face (h,)."""
        order = np.lexsort((self.angle, self.node))
        place = np.empty_like(order)
        place[order] = np.arange(len(order))
        first = np.searchsorted(self.node[order], self.node[order])
        last = np.searchsorted(self.node[order], self.node[order], side="right") - 1
        # Clockwise the next from where one came.
        arrived = place[self.twin]
        after = order[np.where(arrived == first[arrived], last[arrived], arrived - 1)]
        return after, components(len(after), np.arange(len(after)), after)


@dataclass(frozen=True)
class MatrixTiles:
    """Tiles in the matrix next to discs.

    Attributes:
        lines: half-lines that divide the matrix: side pieces, then bridges.
        tile: (h,) on the left of each.
        alone: (n,) tile around a disc without such lines; NOWHERE where there are some.
    """

    lines: HalfLines
    tile: Int
    alone: Int


def beside(lines: HalfLines, label: Int, alone: Int, disc: Int, angle: Float) -> Int:
    """Return the matrix label (k,) beside discs (k,) at angles (k,).

    The next half-line clockwise has the label among `label` (h,), a disc without half-lines among `alone` (n,).
    """
    order = np.lexsort((lines.angle, lines.node))
    node, at = lines.node[order], lines.angle[order]
    # Twice a turn apart, so that those of one disc stay together.
    place = np.searchsorted(node * 2 * TURN + at, disc * 2 * TURN + angle % TURN, side="right") - 1
    first, last = np.searchsorted(node, disc), np.searchsorted(node, disc, side="right") - 1
    around = label[order[np.where(place < first, last, place)]]
    return np.where(alone[disc] == NOWHERE, around, alone[disc])


def matrix_tiles(
    circles: Float,
    outer: Int,
    sides: tuple[Int, Float],
    bridges: Bridges,
    lines: CentreLines,
    size: Float,
    grid: Int,
) -> MatrixTiles | None:
    """Deal the matrix faces to the cells of a grid (2,) by their centroids.

    None if a disc, or a group of discs without bridges to the sides, has no face.

    Args:
        circles: (k, 3).
        outer: (n,) circles that bound the matrix.
        sides: nodes (s, 2) and ends (s, 2, 2) of side pieces in the matrix, counter-clockwise around the cell.
    """
    nodes, starts = sides
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]) * size
    centres = np.concatenate([circles[:, :2], corners])
    ends = [on_circle(circles[bridges.ends[:, end]], bridges.angle + end * np.pi) for end in (0, 1)]
    facing = np.stack(ends, axis=1)
    half = HalfLines.of(np.concatenate([nodes, bridges.ends]), centres, np.concatenate([starts, facing]))
    after, loop = half.faces()
    lone = np.setdiff1d(outer, half.node)
    count = loop.max() + 1
    alone = np.full(len(circles), NOWHERE)
    alone[lone] = count + np.arange(len(lone))
    face = _faces_of_loops(half, loop, alone, lines, count + len(lone), size)
    area, moment = _areas_and_moments(half, after, loop)
    areas = np.bincount(face[:count], area, face.max() + 1)
    # A face has one loop around it, and others in it, which are negative. The one beyond the sides has none around it.
    # Loops around trees, which have both halves of all their lines, have no area but for rounding.
    is_tree = np.bincount(loop, loop[half.twin] != loop) == 0
    around = np.bincount(face[:count], (area > 0) & ~is_tree, face.max() + 1)
    beyond = face[loop[half.twin[0]]]
    if (np.delete(around, beyond) != 1).any():
        return None
    moments = np.stack([np.bincount(face[:count], moment[:, k], face.max() + 1) for k in (0, 1)], axis=1)
    tile = grid_cell(moments / areas[:, None], size, grid)
    return MatrixTiles(half, tile[face[loop]], np.where(alone == NOWHERE, NOWHERE, tile[face[alone]]))


def grid_cell(points: Float, size: Float, grid: Int) -> Int:
    """Find the cell (k,) of a grid (2,) over [0, size] that contains each point."""
    share = (points / size).round(PLACE_DECIMALS)
    column, row = np.clip((share * grid).astype(np.int64), 0, grid - 1).T
    return np.asarray(column * grid[1] + row)


def _areas_and_moments(half: HalfLines, after: Int, loop: Int) -> tuple[Float, Float]:
    """Compute the areas (l,) and first moments (l, 2) of loops of half-lines."""
    end = half.start[half.twin]
    a, b = np.concatenate([half.start, end]), np.concatenate([end, half.start[after]])
    cross, loop = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], np.concatenate([loop, loop])
    return np.bincount(loop, cross) / 2, np.stack(
        [np.bincount(loop, (a + b)[:, k] * cross) for k in (0, 1)], axis=1
    ) / 6


def _faces_of_loops(half: HalfLines, loop: Int, alone: Int, lines: CentreLines, count: int, size: Float) -> Int:
    """Return the face (count,) of each loop, and then of each lone disc.

    A centre line crosses no bridge, for both are edges in one triangulation. So, in the cell and away from third
    discs, there is one face along it.
    """
    free = (lines.clearance > 1) & np.all((lines.facing > 0) & (lines.facing < size), axis=(1, 2))
    ends, angle = lines.ends[free], lines.angle[free]
    n = half.node.max() + 1
    is_bridge = np.isin(ends[:, 0] * n + ends[:, 1], half.node * n + half.node[half.twin])
    ends, angle = ends[~is_bridge], angle[~is_bridge]
    one, other = (beside(half, loop, alone, ends[:, end], angle + end * np.pi) for end in (0, 1))
    return components(count, one, other)
