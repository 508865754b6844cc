"""Tiles of a large cell: parts of its outline that ranks fill by themselves, with the same nodes on common borders.

They depend on the cell alone, so that its mesh is the same on any number of ranks.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.spatial import QhullError

from feti_homog.fibres.arrangement import Arrangement
from feti_homog.fibres.outlines.ellipses import Discs
from feti_homog.mesh.outline.bridges import CLEAR, Bridges, bridges, centre_lines
from feti_homog.mesh.outline.curves import MATRIX, OUTSIDE
from feti_homog.mesh.outline.outline import Outline, crossings, disc_at, images, on_side
from feti_homog.mesh.tiles.filling import Tile
from feti_homog.mesh.tiles.matrix_faces import MatrixTiles, grid_cell, matrix_tiles
from feti_homog.typing import Float, Int


@dataclass(frozen=True)
class TilePolicy:
    """Choice of the cells that are cut into tiles, and of the number of tiles.

    Attributes:
        least_discs: cells with fewer are filled at once.
        discs: of a tile. Smaller tiles put more nodes on borders, where bridges fix their places; larger ones leave too
            few tiles for many ranks.
    """

    least_discs: int = 400
    discs: int = 25


DEFAULT_TILES = TilePolicy()


@dataclass(frozen=True)
class Tiling:
    """Tiles of the parts of a cell.

    Attributes:
        bridges: those on borders of tiles.
        beside: (b, 2) the tiles on the left and on the right of each.
        matrix: the faces of the matrix, with the tile of each.
        sides: (s,) the tile beside each piece of a side in the matrix, in the order of the outline's.
        within: (k,) the tile of what is in each circle; all images of a disc are in one.
    """

    bridges: Bridges
    beside: Int
    matrix: MatrixTiles
    sides: Int
    within: Int


def is_tiled(arrangement: Arrangement, policy: TilePolicy) -> bool:
    """Return whether it is large and has round discs only."""
    return len(arrangement.phase) >= policy.least_discs and isinstance(arrangement.outlines, Discs)


def tiling(
    arrangement: Arrangement, largest: float, marks: Mapping[int, Sequence[float]], policy: TilePolicy
) -> Tiling | None:
    """Return the tiling of a large cell of round fibres; None for others, and where there is no room for bridges.

    `largest` is the size of elements, and `marks` are as in `BareOutline.of`.
    """
    if not is_tiled(arrangement, policy):
        return None
    size = arrangement.size
    circles, disc, around = images(arrangement)
    outer = np.flatnonzero(around == MATRIX)
    try:
        lines = centre_lines(circles, outer)
    except QhullError:  # all centres on one line
        return None
    marked = [(k, np.radians(angle)) for k in outer.tolist() for angle in marks.get(int(disc[k]), ())]
    vertices = np.array([k for k, _ in marked], np.int64), np.array([angle for _, angle in marked])
    found = bridges(lines, size, CLEAR * arrangement.outer_radii.mean(), largest, vertices)
    sides = _side_pieces(circles, outer, size)
    grid = np.maximum(1, np.round(size * np.sqrt(len(arrangement.radii) / policy.discs / size.prod()))).astype(int)
    matrix = matrix_tiles(circles, outer, sides, found, lines, size, grid)
    if matrix is None:
        return None
    half, n_sides = matrix.lines, len(sides[0])
    bridge = np.arange(n_sides, len(half.node) // 2)
    bridge = bridge[matrix.tile[bridge] != matrix.tile[half.twin[bridge]]]
    return Tiling(
        bridges=Bridges(np.stack([half.node[bridge], half.node[half.twin[bridge]]], axis=1), half.angle[bridge]),
        beside=np.stack([matrix.tile[bridge], matrix.tile[half.twin[bridge]]], axis=1),
        matrix=matrix,
        sides=matrix.tile[:n_sides],
        within=grid_cell(np.mod(arrangement.centres, size), size, grid)[disc],
    )


def _side_pieces(circles: Float, outer: Int, size: Float) -> tuple[Int, Float]:
    """Return the pieces of sides in the matrix, as `matrix_tiles` takes them.

    `outer` (n,) are the circles that bound it.
    """
    nodes, ends = [], []
    for axis, (level, low) in product((0, 1), ((0.0, True), (1.0, False))):
        places = crossings(circles[outer], axis, size)
        points = on_side(places, axis, level * size[1 - axis])
        found = disc_at(circles[outer], on_side((places[:-1] + places[1:]) / 2, axis, level * size[1 - axis]))
        node = np.where(found == MATRIX, MATRIX, outer[found])
        corner = len(circles) + (points[[0, -1]] > 0) @ [1, 2]
        piece = np.flatnonzero(found == MATRIX)
        around = np.concatenate([corner[:1], node, corner[1:]])
        both, where = np.stack([around[piece], around[piece + 2]], axis=1), points[piece[:, None] + [0, 1]]
        forward = low == (axis == 0)
        nodes.append(both if forward else both[:, ::-1])
        ends.append(where if forward else where[:, ::-1])
    return np.concatenate(nodes), np.concatenate(ends)


def cut(lines: Outline, cell: Tile, tiles: Tiling | None) -> list[tuple[Int, Tile]]:
    """Return the tiles of a cell whose outline is `lines`, each with the numbers (n,) of its nodes.

    The cell as it is without a tiling.
    """
    if tiles is None:
        return [(np.arange(len(cell.points)), cell)]
    curves = cell.curves
    left, right = _tiles_beside(lines, tiles)
    tile = np.concatenate([left, right[right != left]])
    curve = np.concatenate([np.arange(len(curves)), np.flatnonzero(right != left)])
    order = np.lexsort((curve, tile))
    tile, curve = tile[order], curve[order]
    parts = []
    for name in np.unique(tile[tile != OUTSIDE]).tolist():
        own = curve[np.searchsorted(tile, name) : np.searchsorted(tile, name, side="right")]
        mine = curves.chosen(own)
        nodes, node = np.unique(mine.node, return_inverse=True)
        inside = np.where(left[own] == name, mine.inside, OUTSIDE)
        outside = np.where(right[own] == name, mine.outside, OUTSIDE)
        bounded = replace(mine, node=node, inside=inside, outside=outside)
        parts.append((nodes, replace(cell, points=cell.points[nodes], curves=bounded)))
    return parts


def _tiles_beside(lines: Outline, tiles: Tiling) -> tuple[Int, Int]:
    """Return the tiles (c,) on the left and on the right of curves, OUTSIDE beyond the sides."""
    curves = lines.curves
    left, right = tiles.within[curves.inside], tiles.within[curves.outside]
    is_side = curves.outside == OUTSIDE
    left[is_side & (curves.inside == MATRIX)], right[is_side] = tiles.sides, OUTSIDE
    arc = np.flatnonzero((curves.circle != MATRIX) & (curves.outside == MATRIX))
    # The middle of the first edge tells where on the circle an arc is.
    begin = curves.first[arc]
    middle = (lines.points[curves.node[begin]] + lines.points[curves.node[begin + 1]]) / 2
    offset = middle - lines.ellipses.centres[curves.circle[arc]]
    right[arc] = tiles.matrix.beside(curves.circle[arc], np.arctan2(offset[:, 1], offset[:, 0]))
    n = len(tiles.bridges.angle)
    left[len(curves) - n :], right[len(curves) - n :] = tiles.beside.T
    return left, right
