"""The torus of some tiles of a cell: what a rank knows of those that it has filled.

Nodes on lines have the numbers of the outline, those within tiles the numbers behind these, one tile after the other.
A torus edge has the number that its two classes make.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from feti_homog.fibres.outlines.ellipses import Ellipses
from feti_homog.mesh.coarse_mesh import CoarseMesh, edge_keys, edges
from feti_homog.mesh.periodic_topology import Torus, plane_edges_of
from feti_homog.mesh.tiles.filling import Filling, Tile, arc_edges
from feti_homog.typing import Array, Int, Int32


@dataclass(frozen=True)
class Regions:
    """Regions of a cell that is drawn, known to every rank.

    Attributes:
        width, height, scale: of the mesh, and its lengths / those of its tiles.
        phases: names, the matrix first.
        ellipses: the k circles, as in `CoarseMesh`.
        constituent: (k + 1,) the constituent next within each circle, -1 in a void; the last is that of the matrix.
        phase: (constituents,) number of the phase of each.
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
class NumberedTile:
    """A tile with the numbers (n,) of its nodes, and those (n,) of the nodes that stand for their classes."""

    nodes: Int
    classes: Int
    tile: Tile


@dataclass(frozen=True)
class FilledTile:
    """A tile with its triangles.

    Attributes:
        number: among all tiles.
        lines, filling: what is on its lines, and within.
        first: number of its first node that is not on a line.
    """

    number: int
    lines: NumberedTile
    filling: Filling
    first: int

    @property
    def inner(self) -> Int:
        """(k,) numbers of the nodes that are not on lines."""
        return self.first + np.arange(len(self.filling.inner))


def tile_torus(regions: Regions, tiles: Sequence[FilledTile], all_nodes: int) -> tuple[Torus, Int]:
    """Return the torus of the triangles of these tiles, without voids, and the number (m,) of the tile of each.

    `all_nodes` is how many there are in the cell.
    """
    numbers = [np.concatenate([own.lines.nodes, own.inner]) for own in tiles]
    classes = [np.concatenate([own.lines.classes, own.inner]) for own in tiles]
    points = [np.concatenate([own.lines.tile.points, own.filling.inner]) for own in tiles]
    constituent = _all([regions.constituent[own.filling.circle] for own in tiles])
    solid = constituent >= 0
    triangles = _all([n[own.filling.triangles] for n, own in zip(numbers, tiles, strict=True)], 3)[solid]
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
    tile = np.repeat([own.number for own in tiles], [len(own.filling.triangles) for own in tiles])
    return replace(torus, at_void=at_void, is_whole=False), tile[solid]


def _arcs(tiles: Sequence[FilledTile], number: Int, triangles: Int32) -> tuple[Int32, Int]:
    """Edges (a, 2) of these triangles that are on circles, and the circles (a,); node k is that of number[k]."""
    found = [arc_edges(own.lines.tile.curves) for own in tiles]
    circle = _all([circles for _, circles in found])
    ends = _all([own.lines.nodes[pairs] for own, (pairs, _) in zip(tiles, found, strict=True)], 2)
    n = max(len(number), 1)
    pairs = np.searchsorted(number, ends).clip(max=n - 1).astype(np.int32)
    # A tile has arcs of its voids, too; an arc between two tiles is in both.
    keys = edge_keys(pairs, n)
    known = (number[pairs] == ends).all(axis=1) & np.isin(keys, edge_keys(edges(triangles), n))
    first = np.flatnonzero(known)[np.unique(keys[known], return_index=True)[1]]
    return pairs[first], circle[first]


def _all(parts: Sequence[Array], width: int | None = None, kind: type = int) -> Array:
    """Their rows, one after the other; of no parts none of `width` numbers."""
    return np.concatenate([np.zeros((0,) if width is None else (0, width), kind), *parts])
