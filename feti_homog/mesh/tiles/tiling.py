"""Tiles in a large cell: parts of its outline that ranks fill by themselves, with the same nodes on common borders.

They depend on the cell alone, so that its mesh is the same on any number of ranks.  A rank has the torus for the tiles
that it has filled: nodes on lines have their numbers in the outline, nodes within tiles the numbers behind, one tile
after the other; a torus edge has the number that its two classes make.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.spatial import QhullError

from feti_homog.mesh.coarse_mesh import CoarseMesh, edge_keys, edges
from feti_homog.mesh.outline.lines import MATRIX, OUTSIDE
from feti_homog.mesh.outline.outline import Bridges, Outline, crossings, curve_at, images, on_side
from feti_homog.mesh.periodic_topology import Torus, plane_edges_of
from feti_homog.mesh.tiles.matrix_faces import (
    CLEAR,
    MatrixTiles,
    beside,
    bridges,
    centre_lines,
    grid_cell,
    matrix_tiles,
)
from feti_homog.mesh.tiles.tile_filling import Filling, Tile, arc_edges
from feti_homog.microstructure import Arrangement
from feti_homog.microstructure.shapes import Discs, Ellipses
from feti_homog.typing import Array, Float, Int, Int32


@dataclass(frozen=True)
class TilePolicy:
    """The cells that are cut into tiles, and the number of tiles.

    Attributes:
        least_discs: cells with fewer are filled at once.
        discs: in a tile. Smaller tiles put more nodes on borders, where bridges fix their places; larger ones leave too
            few tiles for many ranks.
    """

    least_discs: int = 400
    discs: int = 25


DEFAULT_TILES = TilePolicy()


@dataclass(frozen=True)
class Tiling:
    """Tiles for all parts of a cell.

    Attributes:
        bridges: on tile borders.
        beside: (b, 2) the tiles to the left and right of each bridge.
        matrix: its faces with their tiles.
        within: (k,) the tile within each circle; all images of a disc are in one.
    """

    bridges: Bridges
    beside: Int
    matrix: MatrixTiles
    within: Int


def is_tiled(arrangement: Arrangement, policy: TilePolicy) -> bool:
    """Return whether an arrangement is large and has round discs only."""
    return len(arrangement.phase) >= policy.least_discs and isinstance(arrangement.outlines, Discs)


def tiling(
    arrangement: Arrangement, largest: float, marks: Mapping[int, Sequence[float]], policy: TilePolicy
) -> Tiling | None:
    """Tile a large cell with round fibres; None for others, or without room for bridges.

    `largest` is the element size, and `marks` are as in `BareOutline.of`.
    """
    if not is_tiled(arrangement, policy):
        return None
    size = arrangement.size
    discs, disc, around = images(arrangement)
    assert isinstance(discs, Discs)
    circles = discs.circles
    outer = np.flatnonzero(around == MATRIX)
    try:
        lines = centre_lines(circles, outer)
    except QhullError:  # all centres on one line
        return None
    marked = [(k, np.radians(angle)) for k in outer.tolist() for angle in marks.get(int(disc[k]), ())]
    vertices = np.array([k for k, _ in marked], np.int64), np.array([angle for _, angle in marked])
    candidates = bridges(lines, size, CLEAR * arrangement.outer_radii.mean(), largest, vertices)
    sides = _side_pieces(discs, outer, size)
    grid = np.maximum(1, np.round(size * np.sqrt(len(arrangement.radii) / policy.discs / size.prod()))).astype(int)
    matrix = matrix_tiles(circles, outer, sides, candidates, lines, size, grid)
    if matrix is None:
        return None
    half = matrix.lines
    bridge = np.arange(len(sides[0]), len(half.node) // 2)
    bridge = bridge[matrix.tile[bridge] != matrix.tile[half.twin[bridge]]]
    return Tiling(
        bridges=Bridges(np.stack([half.node[bridge], half.node[half.twin[bridge]]], axis=1), half.angle[bridge]),
        beside=np.stack([matrix.tile[bridge], matrix.tile[half.twin[bridge]]], axis=1),
        matrix=matrix,
        within=grid_cell(np.mod(arrangement.centres, size), size, grid)[disc],
    )


def _side_pieces(discs: Discs, outer: Int, size: Float) -> tuple[Int, Float]:
    """Return the side pieces in the matrix, for `matrix_tiles`.

    `outer` (n,) are the discs that bound the matrix.
    """
    nodes, ends = [], []
    for axis, (level, low) in product((0, 1), ((0.0, True), (1.0, False))):
        places = crossings(discs[outer], axis, size)
        points = on_side(places, axis, level * size[1 - axis])
        circle = curve_at(discs[outer], on_side((places[:-1] + places[1:]) / 2, axis, level * size[1 - axis]))
        node = np.where(circle == MATRIX, MATRIX, outer[circle])
        corner = len(discs) + (points[[0, -1]] > 0) @ [1, 2]
        piece = np.flatnonzero(circle == MATRIX)
        around = np.concatenate([corner[:1], node, corner[1:]])
        both, where = np.stack([around[piece], around[piece + 2]], axis=1), points[piece[:, None] + [0, 1]]
        forward = low == (axis == 0)
        nodes.append(both if forward else both[:, ::-1])
        ends.append(where if forward else where[:, ::-1])
    return np.concatenate(nodes), np.concatenate(ends)


def cut(lines: Outline, cell: Tile, tiles: Tiling | None) -> list[Tile]:
    """Cut a cell with the outline `lines` into tiles.

    Without a tiling the cell is one tile.
    """
    if tiles is None:
        return [cell]
    # The tiles to the left and right of each curve, OUTSIDE beyond the sides.
    curves, matrix = cell.curves, tiles.matrix
    left, right = tiles.within[curves.inside], tiles.within[curves.outside]
    is_side = curves.outside == OUTSIDE
    pieces = np.flatnonzero(is_side & (curves.inside == MATRIX))
    left[pieces], right[is_side] = matrix.tile[: len(pieces)], OUTSIDE
    arc = np.flatnonzero((curves.circle != MATRIX) & (curves.outside == MATRIX))
    # The middle of the first edge shows where on the circle an arc is.
    begin = curves.first[arc]
    middle = (lines.points[curves.node[begin]] + lines.points[curves.node[begin + 1]]) / 2
    offset = middle - lines.ellipses.centres[curves.circle[arc]]
    angle = np.arctan2(offset[:, 1], offset[:, 0])
    right[arc] = beside(matrix.lines, matrix.tile, matrix.alone, curves.circle[arc], angle)
    n = len(tiles.bridges.angle)
    left[len(curves) - n :], right[len(curves) - n :] = tiles.beside.T
    tile = np.concatenate([left, right[right != left]])
    curve = np.concatenate([np.arange(len(curves)), np.flatnonzero(right != left)])
    order = np.lexsort((curve, tile))
    tile, curve = tile[order], curve[order]
    parts = []
    for name in np.unique(tile[tile != OUTSIDE]).tolist():
        some = curve[np.searchsorted(tile, name) : np.searchsorted(tile, name, side="right")]
        mine = curves.chosen(some)
        nodes, node = np.unique(mine.node, return_inverse=True)
        inside = np.where(left[some] == name, mine.inside, OUTSIDE)
        outside = np.where(right[some] == name, mine.outside, OUTSIDE)
        bounded = replace(mine, node=node, inside=inside, outside=outside)
        parts.append(replace(cell, points=cell.points[nodes], nodes=nodes, classes=cell.classes[nodes], curves=bounded))
    return parts


@dataclass(frozen=True)
class Regions:
    """Regions in a generated cell, known to every rank.

    Attributes:
        width, height, scale: of the mesh, and its lengths / lengths in tiles.
        phases: names, the matrix first.
        ellipses: the k circles, as in `CoarseMesh`.
        constituent: (k + 1,) the constituent next within each circle, -1 in a void; the last is the matrix.
        phase: (constituents,) phase number of each.
        nodes: on the lines.
    """

    width: float
    height: float
    scale: float
    phases: tuple[str, ...]
    ellipses: Ellipses
    constituent: Int
    phase: Int
    nodes: int


@dataclass(frozen=True)
class FilledTile:
    """A tile with its triangles.

    Attributes:
        number: among all tiles.
        tile, filling: nodes on its lines; triangles and nodes within.
        first: number of its first node off the lines.
    """

    number: int
    tile: Tile
    filling: Filling
    first: int

    @property
    def inner(self) -> Int:
        """(k,) numbers of the nodes off the lines."""
        return self.first + np.arange(len(self.filling.inner))


def tile_torus(regions: Regions, tiles: Sequence[FilledTile], all_nodes: int) -> tuple[Torus, Int]:
    """Return the torus of filled tiles, without voids, and the tile (m,) of each triangle.

    `all_nodes` counts the nodes in the cell.
    """
    numbers = [np.concatenate([filled.tile.nodes, filled.inner]) for filled in tiles]
    classes = [np.concatenate([filled.tile.classes, filled.inner]) for filled in tiles]
    points = [np.concatenate([filled.tile.points, filled.filling.inner]) for filled in tiles]
    constituent = _all([regions.constituent[filled.filling.circle] for filled in tiles])
    solid = constituent >= 0
    triangles = _all([n[filled.filling.triangles] for n, filled in zip(numbers, tiles, strict=True)], 3)[solid]
    number, triangles = np.unique(triangles, return_inverse=True)
    everywhere, first = np.unique(_all(numbers), return_index=True)
    place = first[np.searchsorted(everywhere, number)]
    class_keys, node_class = np.unique(_all(classes)[place], return_inverse=True)
    triangles = triangles.reshape(-1, 3).astype(np.int32)
    arcs, arc_circle = _arcs(tiles, number, triangles)
    constituent = constituent[solid]
    mesh = CoarseMesh(
        width=regions.width,
        height=regions.height,
        points=regions.scale * _all(points, 2, float)[place],
        triangles=triangles,
        phase=regions.phase[constituent].astype(np.int32),
        phases=regions.phases,
        precedence=constituent.astype(np.int32),
        representative=np.unique(node_class, return_index=True)[1][node_class].astype(np.int32),
        ellipses=regions.ellipses,
        arc_edges=arcs,
        arc_circle=arc_circle.astype(np.int32),
        debonded_edges=np.zeros((0, 2), np.int32),
    )
    plane, triangle_edges = plane_edges_of(mesh)
    ends = np.sort(class_keys[node_class[plane]], axis=1)
    keys, torus_edge = np.unique(ends @ [all_nodes, 1], return_inverse=True)
    torus = Torus(mesh, node_class, plane, triangle_edges, torus_edge, constituent, class_keys, keys, np.zeros(0, bool))
    at_void = np.zeros(len(keys), bool)
    at_void[torus_edge[torus.plane_edges(mesh.arc_edges[regions.constituent[arc_circle] < 0])]] = True
    tile = np.repeat([filled.number for filled in tiles], [len(filled.filling.triangles) for filled in tiles])
    return replace(torus, at_void=at_void, is_whole=False), tile[solid]


def _arcs(tiles: Sequence[FilledTile], number: Int, triangles: Int32) -> tuple[Int32, Int]:
    """Find the edges (a, 2) of triangles on circles, and their circles; node k is number[k]."""
    arcs = [arc_edges(filled.tile.curves) for filled in tiles]
    circle = _all([circles for _, circles in arcs])
    ends = _all([filled.tile.nodes[pairs] for filled, (pairs, _) in zip(tiles, arcs, strict=True)], 2)
    n = max(len(number), 1)
    pairs = np.searchsorted(number, ends).clip(max=n - 1).astype(np.int32)
    # A tile has arcs of its voids, too; an arc between two tiles is in both.
    keys = edge_keys(pairs, n)
    exists = (number[pairs] == ends).all(axis=1) & np.isin(keys, edge_keys(edges(triangles), n))
    first = np.flatnonzero(exists)[np.unique(keys[exists], return_index=True)[1]]
    return pairs[first], circle[first]


def _all(parts: Sequence[Array], width: int | None = None, kind: type = int) -> Array:
    """Concatenate rows; without parts there are no rows of `width` numbers."""
    return np.concatenate([np.zeros((0,) if width is None else (0, width), kind), *parts])
