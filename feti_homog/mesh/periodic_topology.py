"""Represent the coarse cell as a torus: node classes, torus edges and constituents.

Two plane nodes that differ by a period form one class, and two boundary edges that differ by a period form one
torus edge.  A constituent is a connected part of one phase on the torus, even if the cell boundary cuts it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix, csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra

from feti_homog.mesh.coarse_mesh import CoarseMesh, edge_keys, on_sides, representatives
from feti_homog.microstructure import phase_names
from feti_homog.microstructure.shapes import Ellipses
from feti_homog.typing import Bool, Float, Int, Int32

# Count of numbers / upper bound of the numbers, below which sorting is cheaper than a table of all possible numbers.
FEW = 1 / 512


@dataclass(frozen=True)
class Torus:
    """The node classes, torus edges and constituents of a coarse mesh.

    Attributes:
        mesh: the plane mesh of m triangles or pixels, or some tiles of a larger mesh.
        node_class: (n,) class of each plane node.
        edges: (e, 2) plane edges, sorted by node numbers; each runs from the lexicographically lower to the upper end.
        triangle_edges: (m, 3) plane edge from vertex k to vertex k + 1 (mod 3); (m, 4) for pixels.
        torus_edge: (e,) torus edge of each plane edge.
        constituent: (m,) constituent of each triangle; matrix constituents come first.
        class_keys, edge_keys: ascending numbers of the classes and torus edges in the whole cell.
        at_void: (torus edges,) mask of edges at voids: one triangle in the cell, but on no side without images.
        is_whole: whether the mesh has all triangles of the cell.
    """

    mesh: CoarseMesh
    node_class: Int
    edges: Int
    triangle_edges: Int
    torus_edge: Int
    constituent: Int
    class_keys: Int
    edge_keys: Int
    at_void: Bool
    is_whole: bool = True

    @classmethod
    def of(cls, mesh: CoarseMesh) -> Torus:
        """Identify the periodic images of a mesh, and number the constituents."""
        node_class = present(mesh.representative, len(mesh.points))[1]
        edges, triangle_edges = plane_edges_of(mesh)
        low_edge = representatives((mesh.points[edges[:, 0]] + mesh.points[edges[:, 1]]) / 2, *mesh.shift)
        torus_edge = present(low_edge, len(edges))[1]
        one, other = edge_pairs(torus_edge[triangle_edges])
        same = mesh.phase[one] == mesh.phase[other]
        label = components(len(mesh.triangles), one[same], other[same])
        keys = np.arange(node_class.max() + 1), np.arange(torus_edge.max() + 1)
        at_void = np.bincount(torus_edge[triangle_edges].ravel()) == 1
        if mesh.boundary != "periodic":
            at_void[torus_edge] &= ~on_sides(mesh.points[edges], mesh.period)
        torus = cls(mesh, node_class, edges, triangle_edges, torus_edge, label, *keys, at_void)
        # Fibres of equal precedence are numbered in the order of the circles.
        circle = np.full(len(edges), len(mesh.ellipses))
        circle[torus.arcs] = mesh.arc_circle
        first = np.full(label.max() + 1, len(mesh.ellipses))
        np.minimum.at(first, label, circle[triangle_edges].min(axis=1))
        order = np.lexsort((first[label], mesh.precedence))
        return replace(torus, constituent=renumber(label, order))

    @property
    def triangle_torus_edges(self) -> Int:
        """The torus edge (m, 3) from vertex k to vertex k + 1 (mod 3); (m, 4) for pixels."""
        return self.torus_edge[self.triangle_edges]

    @cached_property
    def sides(self) -> tuple[Int, Int, Int]:
        """The triangles (k,) and (k,) on both sides of each shared torus edge, and the number (k,) of this edge."""
        edge = np.flatnonzero(np.bincount(self.triangle_torus_edges.ravel()) == 2)
        return *edge_pairs(self.triangle_torus_edges), edge

    @property
    def is_outline(self) -> Bool:
        """The mask (torus edges,) of edges between phases or beside voids."""
        one, other, edge = self.sides
        mask = self.at_void.copy()
        mask[edge] = self.mesh.phase[one] != self.mesh.phase[other]
        return mask

    def low_copies(self, chosen: Bool) -> Int32:
        """Return end nodes (k, 2) of torus edges in the mask `chosen`: on cell sides, of the left or lower image."""
        is_high = (self.mesh.points[self.edges] == self.mesh.shift).all(axis=1).any(axis=1)
        return np.asarray(self.edges[chosen[self.torus_edge] & ~is_high], np.int32)

    @property
    def voids(self) -> int:
        """The number of connected void boundaries."""
        classes, ends = np.unique(self.edge_ends[self.at_void], return_inverse=True)
        return int(components(len(classes), *ends.reshape(-1, 2).T).max(initial=-1)) + 1

    @cached_property
    def debonded(self) -> Bool:
        """The mask (torus edges,) of edges that are debonded from the start."""
        debonded = np.zeros(len(self.edge_keys), bool)
        debonded[self.torus_edge[self.plane_edges(self.mesh.debonded_edges)]] = True
        return debonded

    @cached_property
    def edge_ellipses(self) -> Ellipses:
        """The e ellipses through the plane edges, shrunk to points for straight edges."""
        n = len(self.edges)
        centres, frames = np.zeros((n, 2)), np.zeros((n, 2, 2))
        curves = self.mesh.ellipses[self.mesh.arc_circle]
        centres[self.arcs], frames[self.arcs] = curves.centres, curves.frames
        return Ellipses(centres, frames)

    @cached_property
    def edge_circles(self) -> Float:
        """The circle (e, 3), centre and radius, of each plane edge: radius NaN on ellipses, 0 for straight edges."""
        circles = np.zeros((len(self.edges), 3), float if len(self.arcs) else np.float16)  # small in label images
        circles[self.arcs] = self.mesh.ellipses.circles[self.mesh.arc_circle]
        return circles

    @cached_property
    def edge_turns(self) -> Float:
        """The increment (e,) of the ellipse parameter along each plane edge, at most pi; 0 for straight edges."""
        turns, curves = np.zeros_like(self.edge_circles[:, 0]), self.mesh.ellipses[self.mesh.arc_circle]
        start, stop = (curves.unit(self.mesh.points[self.edges[self.arcs, end]] - curves.centres) for end in (0, 1))
        sine = start[:, 0] * stop[:, 1] - start[:, 1] * stop[:, 0]
        turns[self.arcs] = np.arctan2(np.abs(sine), (start * stop).sum(axis=1))
        return turns

    @cached_property
    def edge_ends(self) -> Int:
        """The classes (torus edges, 2) at the ends of each torus edge."""
        ends = np.empty((len(self.edge_keys), 2), np.int64)
        ends[self.torus_edge[::-1]] = self.node_class[self.edges[::-1]]
        return ends

    @cached_property
    def meeting(self) -> Int:
        """The number (classes,) of constituents that meet in each class."""
        corner, n = self.node_class[self.mesh.triangles], int(self.constituent.max(initial=0)) + 1
        one, counts = np.zeros(len(self.class_keys), np.int64), np.ones(len(self.class_keys), np.int64)
        one[corner] = self.constituent[:, None]
        entries = np.nonzero(one[corner] != self.constituent[:, None])
        pairs = np.unique(corner[entries] * n + self.constituent[entries[0]])
        return counts + np.bincount(pairs // n, minlength=len(counts))

    @cached_property
    def touching(self) -> Bool:
        """The mask (classes,) of classes where two constituents meet more than once, or without a common edge.

        At an ordinary interface node, each of two constituents fills one sector of the surrounding triangles.  If
        `is_whole` is false, all entries are False: such meshes have only round fibres, which touch nowhere.
        """
        if not self.is_whole:
            return np.zeros(len(self.class_keys), bool)
        one, other, edge = self.sides
        between, n = edge[self.constituent[one] != self.constituent[other]], len(self.class_keys)
        alone = np.bincount(self.triangle_torus_edges.ravel()) == 1
        shared = np.bincount(self.edge_ends[between].ravel(), minlength=n)
        free = np.bincount(self.edge_ends[alone].ravel(), minlength=n)
        # Each edge between constituents ends a sector; two edges at a void, or at the outside, together end one.
        sectors = shared + free // 2
        return np.asarray((self.meeting == 2) & ((sectors != 2) | (shared == 0)))

    @cached_property
    def never_part(self) -> Bool:
        """The mask (classes,) of joined nodes, where three or more constituents meet, or two are `touching`."""
        return np.asarray((self.meeting > 2) | self.touching)

    @cached_property
    def edge_lengths(self) -> Float:
        """The length (torus edges,) of each torus edge; curved edges count with their chord."""
        ends = self.mesh.points[self.edges]
        lengths = np.empty(len(self.edge_keys))
        lengths[self.torus_edge] = np.hypot(*(ends[:, 1] - ends[:, 0]).T)
        return lengths

    @cached_property
    def arcs(self) -> Int:
        """The numbers (a,) of the plane edges in `CoarseMesh.arc_edges`."""
        return self.plane_edges(self.mesh.arc_edges)

    def plane_edges(self, pairs: Int32) -> Int:
        """Find the plane edge (k,) between each pair (k, 2) of plane nodes; every pair must be an edge of the mesh."""
        n = len(self.mesh.points)
        if not len(pairs):
            return np.zeros(0, np.int64)
        return np.asarray(np.searchsorted(np.sort(self.edges, axis=1) @ [n, 1], edge_keys(pairs, n)))

    @cached_property
    def constituent_phase(self) -> Int:
        """The phase number (constituents,) of each constituent."""
        phase = np.zeros(self.constituent.max(initial=-1) + 1, np.int64)
        phase[self.constituent] = self.mesh.phase
        return phase

    @cached_property
    def nesting(self) -> Int:
        """The position (constituents,) of each constituent in the order from the outermost to the innermost.

        The order is by distance from the matrix, counted in constituents; `places_by_depth` decides ties.
        """
        one, other, _ = self.sides
        a, b = self.constituent[one], self.constituent[other]
        phase, n = self.constituent_phase, len(self.constituent_phase)
        touching = csr_matrix((np.ones(len(a)), (a, b)), shape=(n, n))
        depth = dijkstra(touching, False, np.flatnonzero(phase == 0), unweighted=True, min_only=True)
        return places_by_depth(depth, phase, self.mesh.phases)

    def plane_parts(self) -> Int:
        """Return the part (m,) of each triangle if cell sides cut constituents apart (Fig. 2a, `bodies = "plane"`)."""
        one, other = edge_pairs(self.triangle_edges)
        same = self.constituent[one] == self.constituent[other]
        label = components(len(self.constituent), one[same], other[same])
        return renumber(label, np.argsort(self.constituent, kind="stable"))


def places_by_depth(depth: Float | Int, phase: Int, phases: tuple[str, ...]) -> Int:
    """Return the nesting position (n,) of constituents by their depth (n,) from the matrix, the outermost first.

    At equal depth, coatings precede fibres, and lower numbers precede higher numbers; `phase` (n,) indexes `phases`.
    """
    coats = np.array([name == phase_names.COATING for name in phases])[phase]
    return np.argsort(np.lexsort((~coats, depth)))


def edge_pairs(triangle_edges: Int) -> tuple[Int, Int]:
    """Find the two triangles (k,) and (k,) beside each shared edge, in ascending order of edges.

    The memory is proportional to the largest edge number.
    """
    edges, sides = triangle_edges.ravel(), np.arange(triangle_edges.size)
    first, last = np.zeros((2, edges.max(initial=-1) + 1), np.int64)
    first[edges[::-1]], last[edges] = sides[::-1], sides
    is_shared, corners = first != last, triangle_edges.shape[1]
    return first[is_shared] // corners, last[is_shared] // corners


def components(n: int, one: Int, other: Int) -> Int:
    """Label the n vertices of a graph by connected component; edges join the vertices `one` (k,) and `other` (k,)."""
    graph = coo_matrix((np.ones(len(one), np.int8), (one, other)), shape=(n, n))
    return np.asarray(connected_components(graph, directed=False)[1], np.int64)


def present(numbers: Int | Int32, size: int) -> tuple[Int, Int]:
    """Return the distinct `numbers` (k,), ascending, and the index of every entry in them.  All are below `size`."""
    if numbers.size < FEW * size:
        members, place = np.unique(numbers, return_inverse=True)
        return np.asarray(members), np.asarray(place.reshape(numbers.shape))
    is_present, place = np.zeros(size, bool), np.empty(size, np.int64)
    is_present[numbers] = True
    members = np.flatnonzero(is_present)
    place[members] = np.arange(len(members))
    return members, place[numbers]


def renumber(label: Int, order: Int) -> Int:
    """Renumber labels (n,) by their first appearance in the permutation `order` (n,)."""
    first = np.empty(label.max(initial=-1) + 1, np.int64)
    first[label[order[::-1]]] = np.arange(len(order))[::-1]
    return np.asarray(np.argsort(np.argsort(first))[label])


def plane_edges_of(mesh: CoarseMesh) -> tuple[Int, Int]:
    """Find the plane edges of a mesh; return `edges` (e, 2) and `triangle_edges` (m, 3 or 4), as in `Torus`."""
    start, stop = mesh.triangles.ravel(), np.roll(mesh.triangles, -1, axis=1).ravel()
    low, high, n = np.minimum(start, stop), np.maximum(start, stop), len(mesh.points)
    # Sides in ascending order of the lower node, then of the other: sparse matrices sort faster than `np.unique`.
    by_low = csc_matrix((high, low, np.arange(start.size + 1)), shape=(n, start.size)).tocsr()
    order = csr_matrix((by_low.indices, by_low.data, by_low.indptr), shape=(n, n))
    order.sort_indices()
    is_first = np.diff(order.indices, prepend=-1) != 0
    is_first[order.indptr[:-1][np.diff(order.indptr) > 0]] = True
    which, chosen = np.empty(start.size, np.int64), order.data[is_first]
    which[order.data] = np.cumsum(is_first) - 1
    edges = np.stack([low[chosen], high[chosen]], axis=1).astype(np.int64)
    (xa, ya), (xb, yb) = mesh.points[edges[:, 0]].T, mesh.points[edges[:, 1]].T
    backwards = (xa > xb) | ((xa == xb) & (ya > yb))
    edges[backwards] = edges[backwards, ::-1]
    return edges, which.reshape(mesh.triangles.shape)
