"""Divide a large cell into tiles, which ranks fill independently, with common nodes on common borders.

Tiles depend on the cell alone, so that the mesh is the same for any rank count.  A rank has the torus of the tiles
that the rank has filled: outline numbers identify nodes on lines, the following numbers identify nodes within tiles,
tile by tile, and the two classes of a torus edge determine the number of the edge.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import QhullError

from feti_homog.mesh.coarse_mesh import CoarseMesh, edge_keys
from feti_homog.mesh.outline.lines import MATRIX, OUTSIDE
from feti_homog.mesh.outline.outline import Bridges, Marks, Outline, crossings, curve_at, images, on_side
from feti_homog.mesh.periodic_topology import Torus, plane_edges_of
from feti_homog.mesh.tiles.tile_filling import Filling, Tile, arc_edges
from feti_homog.microstructure import Arrangement
from feti_homog.microstructure.shapes import Discs, Ellipses
from feti_homog.typing import Array, Int

if TYPE_CHECKING:
    from feti_homog.mesh.tiles import matrix_faces


@dataclass(frozen=True)
class TilePolicy:
    """The least disc count of cells with tiles, and the disc count of a tile.

    Attributes:
        least_discs: cells with fewer discs are one tile.
        discs: discs in a tile. Small tiles have many nodes at fixed positions on bridges; large tiles are too few for
            many ranks.
    """

    least_discs: int = 400
    discs: int = 25


DEFAULT_TILES = TilePolicy()


@dataclass(frozen=True)
class Tiling:
    """The assignment of bridges, discs and matrix faces to tiles.

    Attributes:
        bridges: bridges on tile borders.
        beside: (b, 2) the tiles to the left and right of each bridge.
        matrix: the tiles of the matrix faces.
        within: (k,) the tile within each circle; all images of a disc have the same tile.
    """

    bridges: Bridges
    beside: Int
    matrix: matrix_faces.MatrixTiles
    within: Int


def is_tiled(arrangement: Arrangement, policy: TilePolicy) -> bool:
    """Return whether an arrangement has at least `policy.least_discs` outlines, all of them discs."""
    return len(arrangement.phase) >= policy.least_discs and isinstance(arrangement.outlines, Discs)


def tiling(arrangement: Arrangement, largest: float, marks: Marks, policy: TilePolicy) -> Tiling | None:
    """Tile a large cell with round fibres; None for other cells, collinear centres, or too few bridges.

    `largest` is the element size; `marks` become nodes, which bridges avoid.
    """
    if not is_tiled(arrangement, policy):
        return None
    from feti_homog.mesh.tiles import matrix_faces  # few cells have tiles

    size = arrangement.size
    discs, disc, around = images(arrangement)
    assert isinstance(discs, Discs)
    circles = discs.circles
    outer = np.flatnonzero(around == MATRIX)
    try:
        lines = matrix_faces.centre_lines(circles, outer)
    except QhullError:  # all centres on one line
        return None
    marked = [(k, np.radians(angle)) for k in outer.tolist() for angle in marks.get(int(disc[k]), ())]
    vertices = np.array([k for k, _ in marked], np.int64), np.array([angle for _, angle in marked])
    margin = matrix_faces.CLEAR * arrangement.outer_radii.mean()
    candidates = matrix_faces.bridges(lines, size, margin, largest, vertices)
    # Side pieces in the matrix: the discs or corners at both ends, and the end points.
    nodes, ends = [], []
    for axis, is_far in np.ndindex(2, 2):
        level, places = size[1 - axis] if is_far else 0.0, crossings(discs[outer], axis, size)
        points = on_side(places, axis, level)
        circle = curve_at(discs[outer], on_side((places[:-1] + places[1:]) / 2, axis, level))
        first, last = len(discs) + (points[[0, -1]] > 0) @ [1, 2]
        along_side = np.concatenate([[first], outer[circle], [last]])
        piece = np.flatnonzero(circle == MATRIX)
        # Counter-clockwise around the cell.
        order = [0, 1] if is_far == axis else [1, 0]
        nodes.append(along_side[piece[:, None] + [0, 2]][:, order])
        ends.append(points[piece[:, None] + [0, 1]][:, order])
    sides = np.concatenate(nodes), np.concatenate(ends)
    grid = np.maximum(1, np.round(size * np.sqrt(len(arrangement.radii) / policy.discs / size.prod()))).astype(int)
    matrix = matrix_faces.matrix_tiles(circles, outer, sides, candidates, lines, size, grid)
    if matrix is None:
        return None
    half = matrix.lines
    bridge = np.arange(len(sides[0]), len(half.node) // 2)
    bridge = bridge[matrix.tile[bridge] != matrix.tile[half.twin[bridge]]]
    return Tiling(
        bridges=Bridges(np.stack([half.node[bridge], half.node[half.twin[bridge]]], axis=1), half.angle[bridge]),
        beside=np.stack([matrix.tile[bridge], matrix.tile[half.twin[bridge]]], axis=1),
        matrix=matrix,
        within=matrix_faces.grid_cell(np.mod(arrangement.centres, size), size, grid)[disc],
    )


def cut(lines: Outline, cell: Tile, tiles: Tiling | None) -> list[Tile]:
    """Cut a cell with the outline `lines` into tiles; without a tiling (None), return the cell as the only tile."""
    if tiles is None:
        return [cell]
    from feti_homog.mesh.tiles import matrix_faces

    # The tiles on both sides of each curve, OUTSIDE beyond the sides.
    curves, matrix = cell.curves, tiles.matrix
    on_left, on_right = tiles.within[curves.inside], tiles.within[curves.outside]
    is_side = curves.outside == OUTSIDE
    pieces = np.flatnonzero(is_side & (curves.inside == MATRIX))
    on_left[pieces], on_right[is_side] = matrix.tile[: len(pieces)], OUTSIDE
    arc = np.flatnonzero((curves.circle != MATRIX) & (curves.outside == MATRIX))
    # The middle of the first edge gives the direction of an arc.
    begin = curves.first[arc]
    middle = (lines.points[curves.node[begin]] + lines.points[curves.node[begin + 1]]) / 2
    offset = middle - lines.ellipses.centres[curves.circle[arc]]
    angle = np.arctan2(offset[:, 1], offset[:, 0])
    on_right[arc] = matrix_faces.beside(matrix.lines, matrix.tile, matrix.alone, curves.circle[arc], angle)
    n = len(tiles.bridges.angle)
    on_left[len(curves) - n :], on_right[len(curves) - n :] = tiles.beside.T
    tile = np.concatenate([on_left, on_right[on_right != on_left]])
    curve = np.concatenate([np.arange(len(curves)), np.flatnonzero(on_right != on_left)])
    order = np.lexsort((curve, tile))
    tile, curve = tile[order], curve[order]
    parts = []
    for name in np.unique(tile[tile != OUTSIDE]).tolist():
        numbers = curve[np.searchsorted(tile, name) : np.searchsorted(tile, name, side="right")]
        tile_curves = curves.chosen(numbers)
        nodes, node = np.unique(tile_curves.node, return_inverse=True)
        inside = np.where(on_left[numbers] == name, tile_curves.inside, OUTSIDE)
        outside = np.where(on_right[numbers] == name, tile_curves.outside, OUTSIDE)
        bounded = replace(tile_curves, node=node, inside=inside, outside=outside)
        parts.append(replace(cell, points=cell.points[nodes], nodes=nodes, classes=cell.classes[nodes], curves=bounded))
    return parts


@dataclass(frozen=True)
class Regions:
    """The regions of a generated cell, which every rank has.

    Attributes:
        width, height, origin: size of the mesh, and its lower left corner in the coordinates of the user.
        scale: mesh lengths / lengths in tiles.
        phases: phase names, the matrix first.
        ellipses: the k circles, as in `CoarseMesh`.
        constituent: (k + 1,) the constituent directly within each circle, -1 in a void; the last entry is the matrix.
        phase, precedence: (constituents,) phase number and ascending precedence, as in `CoarseMesh`.
        nodes: node count on the lines.
    """

    width: float
    height: float
    scale: float
    origin: tuple[float, float]
    phases: tuple[str, ...]
    ellipses: Ellipses
    constituent: Int
    phase: Int
    precedence: Int
    nodes: int


@dataclass(frozen=True)
class FilledTile:
    """A tile with its triangles.

    Attributes:
        number: index of the tile among all tiles.
        tile, filling: the lines with nodes; the triangles and inner nodes.
        first: number of the first inner node in the cell.
    """

    number: int
    tile: Tile
    filling: Filling
    first: int


def tile_mesh(regions: Regions, tiles: Sequence[FilledTile]) -> tuple[CoarseMesh, Int, Int]:
    """Join filled tiles to one mesh, without the triangles in voids.

    Also returns the class (n,) of each node, numbered in the cell, and the tile (m,) of each triangle.
    """
    scalars, pairs, triples = np.zeros(0, np.int64), np.zeros((0, 2), np.int64), np.zeros((0, 3), np.int64)
    parts: list[tuple[Array, ...]] = [(scalars, scalars, 0.0 * pairs, triples, scalars, scalars, pairs, scalars)]
    for filled in tiles:
        tile, filling, curves = filled.tile, filled.filling, filled.tile.curves
        inner = filled.first + np.arange(len(filling.inner))
        numbers, classes = (np.concatenate([nodes, inner]) for nodes in (tile.nodes, tile.classes))
        constituent = regions.constituent[filling.circle]
        solid = np.flatnonzero(constituent >= 0)
        # A tile also has arcs with only a void on the side of the tile.
        sides = np.stack([curves.inside, curves.outside])
        is_solid = (sides != OUTSIDE) & (regions.constituent[sides] >= 0)
        arcs, circle = arc_edges(curves.chosen(np.flatnonzero(is_solid.any(axis=0))))
        elements = numbers[filling.triangles[solid]], constituent[solid], np.full(len(solid), filled.number)
        points = np.concatenate([tile.points, filling.inner])
        parts.append((numbers, classes, points, *elements, tile.nodes[arcs], circle))
    arrays = map(np.concatenate, zip(*parts, strict=True))
    numbers, classes, points, triangles, constituent, tile_of, arcs, circle = arrays
    number, triangles = np.unique(triangles, return_inverse=True)
    everywhere, first = np.unique(numbers, return_index=True)
    place = first[np.searchsorted(everywhere, number)]
    _, first, inverse = np.unique(classes[place], return_index=True, return_inverse=True)
    arcs = np.searchsorted(number, arcs).astype(np.int32)
    # Two adjacent tiles both have the arcs between them.
    once = np.sort(np.unique(edge_keys(arcs, len(number)), return_index=True)[1])
    mesh = CoarseMesh(
        width=regions.width,
        height=regions.height,
        points=regions.scale * points[place],
        triangles=triangles.reshape(-1, 3).astype(np.int32),
        phase=regions.phase[constituent].astype(np.int32),
        phases=regions.phases,
        precedence=regions.precedence[constituent].astype(np.int32),
        representative=first[inverse].astype(np.int32),
        ellipses=regions.ellipses,
        arc_edges=arcs[once],
        arc_circle=circle[once].astype(np.int32),
        origin=regions.origin,
    )
    return mesh, classes[place], tile_of


def tile_torus(regions: Regions, tiles: Sequence[FilledTile], all_nodes: int) -> tuple[Torus, Int]:
    """Make the torus of filled tiles, except for triangles in voids; also return the tile (m,) of each triangle.

    `all_nodes` is the node count in the cell.
    """
    mesh, classes, tile = tile_mesh(regions, tiles)
    plane, triangle_edges = plane_edges_of(mesh)
    class_keys, node_class = np.unique(classes, return_inverse=True)
    keys, torus_edge = np.unique(np.sort(classes[plane], axis=1) @ np.array([all_nodes, 1]), return_inverse=True)
    void_arcs = mesh.arc_edges[regions.constituent[mesh.arc_circle] < 0]
    constituent = np.searchsorted(regions.precedence, mesh.precedence)
    at_void = np.isin(keys, np.sort(classes[void_arcs], axis=1) @ [all_nodes, 1])
    torus = Torus(
        mesh, node_class, plane, triangle_edges, torus_edge, constituent, class_keys, keys, at_void, is_whole=False
    )
    return torus, tile
