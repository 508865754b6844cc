"""Refine a subdomain uniformly, without communication, and order the nodes for elimination.

Each coarse triangle has a lattice with M = order * 2**refine intervals per side.  A fine node is a coarse vertex,
the p-th lattice node of a coarse edge, or an inner node of a coarse triangle; arithmetic on coarse numbers
identifies fine nodes on the torus and between subdomains.

The elimination order is a nested dissection (George, SIAM J. Numer. Anal. 10 (1973) 345): nodes on a cut follow the
nodes on both sides, which limits the fill.  Cuts along x or y halve the coarse triangles recursively, near the middle
and across the fewest sides; fine nodes follow the coarse triangles.  The fill is less than with minimum degree.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from feti_homog.mesh.coarse_mesh import HALVES, edge_keys, edges, twins
from feti_homog.mesh.submeshes import Submesh
from feti_homog.typing import Bool, Float, Int, Int32

# Largest offset of a cut from the middle, as a fraction of the triangles in the part.
OFF_THE_MIDDLE = 0.1
# Fewest intervals per side for which dissection also orders the inner nodes of a coarse triangle.
MANY_INTERVALS = 8
# The edges of `coarse_mesh.HALVES`; the diagonal is edge 4.
SIDES = np.array([[[0, 1, 4], [4, 2, 3]], [[0, 4, 3], [1, 2, 4]]])


@dataclass(frozen=True, eq=False)
class ReferenceLattice:
    """The reference triangle with corners (0,0), (M,0), (0,M), cut into 4**refine triangles.

    Lattices compare by identity, so that a lattice can be a cache key.

    Attributes:
        intervals: M, the number of intervals per side.
        nodes: (q, 3) integer barycentric coordinates, summing to M: corners, then edges, then interior.
        triangles: (4**refine, 3 or 6) lattice nodes; rows 4k..4k+3 make up one triangle of the next coarser level.
    """

    intervals: int
    nodes: Int
    triangles: Int

    @classmethod
    def of(cls, refine: int, order: int) -> ReferenceLattice:
        """Return the lattice after `refine` splits of all triangles in four, for elements of the `order` 1 or 2."""
        m = order * 2**refine
        corners = np.array([[[m, 0, 0], [0, m, 0], [0, 0, m]]])
        for _ in range(refine):  # child i keeps corner i, the last is in the middle
            a, b, c = corners.transpose(1, 0, 2)
            ab, bc, ca = (a + b) // 2, (b + c) // 2, (c + a) // 2
            children = np.array([[a, ab, ca], [ab, b, bc], [ca, bc, c], [bc, ca, ab]])
            corners = children.transpose(2, 0, 1, 3).reshape(-1, 3, 3)
        if order == 2:
            corners = np.concatenate([corners, (corners + np.roll(corners, -1, axis=1)) // 2], axis=1)
        j, i = np.mgrid[0 : m + 1, 0 : m + 1]
        inside = (i > 0) & (j > 0) & (i + j < m)
        p = np.arange(1, m)
        o = np.zeros_like(p)
        edges = [np.stack(s, axis=1) for s in ((m - p, p, o), (o, m - p, p), (p, o, m - p))]
        interior = np.stack([m - i - j, i, j], axis=2)[inside]
        nodes = np.concatenate([m * np.eye(3, dtype=np.int64), *edges, interior])
        number = np.zeros((m + 1, m + 1), np.int64)
        number[nodes[:, 1], nodes[:, 2]] = np.arange(len(nodes))
        return cls(m, nodes, number[corners[..., 1], corners[..., 2]])

    @property
    def order(self) -> int:
        """The order of the elements, 1 or 2."""
        return 1 if self.triangles.shape[1] == 3 else 2

    @property
    def halvings(self) -> int:
        """The number of times that all triangles of the lattice were split in four."""
        return (self.intervals // self.order).bit_length() - 1

    def coarser(self, fewer: int = 1) -> ReferenceLattice:
        """Return the lattice without its last `fewer` splits in four."""
        return ReferenceLattice.of(self.halvings - fewer, self.order)

    def within(self, finer: ReferenceLattice) -> Int:
        """Find the indices (q,) that the nodes of this lattice have in a refined lattice, `finer`."""
        number = np.empty((finer.intervals + 1,) * 2, np.int64)
        number[finer.nodes[:, 1], finer.nodes[:, 2]] = np.arange(len(finer.nodes))
        _, i, j = (finer.intervals // self.intervals * self.nodes).T
        return np.asarray(number[i, j])

    def number(self, vertices: Int, edges: Int, backwards: Bool, n_vertices: int, n_edges: int) -> Int:
        """Assign numbers (t, q) to the nodes of triangles with `vertices` (t, 3) and `edges` (t, 3).

        First come `n_vertices` vertices, then M - 1 nodes along each of `n_edges` edges, in reverse where `backwards`
        (t, 3), then inner nodes.
        """
        inner = self.intervals - 1
        p = np.arange(inner)
        along = np.where(backwards[..., None], inner - 1 - p, p)
        on_edges = (n_vertices + edges[..., None] * inner + along).reshape(len(edges), -1)
        per_triangle = len(self.nodes) - 3 - 3 * inner
        first = n_vertices + n_edges * inner + np.arange(len(vertices))[:, None] * per_triangle
        return np.concatenate([vertices, on_edges, first + np.arange(per_triangle)], axis=1)


@dataclass(frozen=True)
class FineMesh:
    """The refined subdomain mesh: n plane nodes in c classes, m elements in t coarse triangles.

    Attributes:
        points: (n, 2) plane positions.
        nodes: (t, q) plane node at each lattice node of each coarse triangle.
        curved: (t,) whether an edge of the coarse triangle lies on an ellipse; else its map from the lattice is affine.
        node_class: (n,) class of each plane node; degrees of freedom belong to classes.
        n_classes: c, the number of classes.
        lattice: the lattice in every coarse triangle.
    """

    points: Float
    nodes: Int32
    curved: Bool
    node_class: Int32
    n_classes: int
    lattice: ReferenceLattice

    @property
    def triangles(self) -> Int32:
        """The plane nodes (m, 3 or 6) of the elements: vertices, then mid-edge nodes 01, 12, 20."""
        elements = self.lattice.triangles
        return self.nodes[:, elements].reshape(-1, elements.shape[1])


def halved(pixels: Submesh) -> Submesh:
    """Cut each pixel (t, 4) of a submesh along a diagonal into two triangles (2t, 3).

    Diagonals join nodes with an even sum of row and column. A submesh of triangles is returned unchanged.
    """
    corners, m = pixels.triangles, len(pixels.triangles)
    if corners.shape[1] == 3:
        return pixels
    low = pixels.points[corners[:, 0]]
    is_odd = (np.rint(low.sum(axis=1) / np.ptp(pixels.points[corners[0], 0])) % 2).astype(np.int64)
    sides = np.c_[pixels.triangle_edges, len(pixels.edges) + np.arange(m)]
    # Diagonals follow the edges of all pixels, in the order of the classes of lower left corners.
    keys, place = np.unique(pixels.class_keys[pixels.vertex_class[corners[:, 0]]], return_inverse=True)
    arrays = {name: getattr(pixels, name) for name in ("circles", "turns", "at_void", "debonded")}
    diagonals = {name: np.zeros((m, *array.shape[1:]), array.dtype) for name, array in arrays.items()}
    diagonals |= {"edge_keys": np.iinfo(np.int32).max + keys, "edge_class": len(pixels.edge_keys) + place}
    diagonals["edges"] = np.where(is_odd[:, None] == 1, corners[:, [3, 1]], corners[:, [0, 2]])
    return replace(
        pixels,
        **{name: np.concatenate([getattr(pixels, name), rows]) for name, rows in diagonals.items()},
        constituent=np.repeat(pixels.constituent, 2),
        triangles=np.take_along_axis(corners[:, None], HALVES[is_odd], axis=2).reshape(-1, 3),
        triangle_edges=np.take_along_axis(sides[:, None], SIDES[is_odd], axis=2).reshape(-1, 3),
    )


def refine(submesh: Submesh, lattice: ReferenceLattice) -> FineMesh:
    """Refine a subdomain, with new nodes of curved edges on the circles and ellipses.

    x = sum_k b_k x_k + sum_edges (1 - b_o)^2 delta(s) with corners x_k, barycentric coordinates b_k: on the edge from a
    to c, delta is the offset of the arc from the chord at s = b_c / (b_a + b_c), and o is the opposite corner.
    Mid-edge nodes of quadratic elements are midpoints except on arcs, so that only elements at an arc are curved.
    """
    edges, back, inner = submesh.triangle_edges, submesh.backwards, lattice.intervals - 1
    plane = lattice.number(submesh.triangles, edges, back, len(submesh.points), len(submesh.edges)).astype(np.int32)
    n_classes, n_edges = len(submesh.class_keys), len(submesh.edge_keys)
    torus = lattice.number(submesh.vertex_class[submesh.triangles], submesh.edge_class[edges], back, n_classes, n_edges)
    interior = len(plane) * (len(lattice.nodes) - 3 - 3 * inner)
    n = len(submesh.points) + len(submesh.edges) * inner + interior
    points, node_class = np.empty((n, 2)), np.empty(n, np.int32)
    node_class[plane] = torus
    b, on_arc = lattice.nodes / lattice.intervals, submesh.turns[edges] > 0
    x = b @ submesh.points[submesh.triangles]
    for k in range(3):
        curved = np.flatnonzero(on_arc[:, k])
        edge = edges[curved, k]
        a, c = (submesh.points[submesh.triangles[curved, end % 3], None] for end in (k, k + 1))
        span = 1 - b[:, (k + 2) % 3]
        s = np.divide(b[:, (k + 1) % 3], span, out=np.zeros_like(span), where=span > 0)
        centre, turn = submesh.circles[edge, None, :2], submesh.turns[edge, None]
        # These points cut the arc in the ratio s of the parameters: an affine map takes the arc of a circle, where
        # spokes have these weights, to the arc of an ellipse.
        weight_a, weight_c = np.sin((1 - s) * turn)[..., None], np.sin(s * turn)[..., None]
        arc = centre + (weight_a * (a - centre) + weight_c * (c - centre)) / np.sin(turn)[..., None]
        x[curved] += span[:, None] ** 2 * (arc - (a + s[None, :, None] * (c - a)))
    if lattice.order == 2:
        corners, middles = lattice.triangles[:, :3], lattice.triangles[:, 3:]
        midway = (x[:, corners] + x[:, np.roll(corners, -1, axis=1)]) / 2
        on_edge = lattice.nodes[middles][..., [2, 0, 1]] == 0
        is_bent = (on_arc[:, None, None, :] & on_edge).any(axis=3)
        x[:, middles] = np.where(is_bent[..., None], x[:, middles], midway)
    points[plane] = x
    return FineMesh(points, plane, on_arc.max(axis=1), node_class, n_classes + n_edges * inner + interior, lattice)


def joined(meshes: Sequence[FineMesh]) -> FineMesh:
    """Concatenate refined meshes that have one lattice and no common nodes; shift node and class numbers."""
    nodes = np.cumsum([0, *(len(mesh.points) for mesh in meshes)], dtype=np.int32)
    classes = np.cumsum([0, *(mesh.n_classes for mesh in meshes)], dtype=np.int32)
    return FineMesh(
        np.concatenate([mesh.points for mesh in meshes]),
        np.concatenate([mesh.nodes + first for mesh, first in zip(meshes, nodes, strict=False)]),
        np.concatenate([mesh.curved for mesh in meshes]),
        np.concatenate([mesh.node_class + first for mesh, first in zip(meshes, classes, strict=False)]),
        int(classes[-1]),
        meshes[0].lattice,
    )


def edge_node(n_classes: int, edge: Int, position: Int, lattice: ReferenceLattice) -> Int:
    """Return the class (k,) of node `position` (k,), 1 to M - 1, on torus edges (k,), after `n_classes` vertices."""
    return n_classes + edge * (lattice.intervals - 1) + position - 1


def elimination_order(mesh: FineMesh) -> Int:
    """Return the node classes (c,) in elimination order."""
    lattice = mesh.lattice
    inside = np.arange(len(lattice.nodes))
    if lattice.intervals >= MANY_INTERVALS:
        centres = lattice.nodes[lattice.triangles[:, :3]].mean(axis=1)[:, 1:]
        inside[_dissected(centres, lattice.triangles, np.arange(lattice.triangles.shape[1]))] = np.arange(len(inside))
    return _dissected(mesh.points[mesh.nodes[:, :3]].mean(axis=1), mesh.node_class[mesh.nodes], inside)


def _dissected(centres: Float, nodes: Int | Int32, inside: Int) -> Int:
    """Order the nodes (n,) of triangles by nested dissection.

    Triangles have `centres` (t, 2) and `nodes` (t, q), corners first; `inside` (q,) ranks the nodes within one
    triangle.
    """
    size = int(nodes.max()) + 1
    one, other = twins(edge_keys(edges(np.asarray(nodes[:, :3], np.int32)), size))
    leaf = _halved(centres, (one // 3, other // 3))
    by_leaf = np.argsort(leaf)
    of_leaf, node = np.repeat(leaf[by_leaf], nodes.shape[1]), nodes[by_leaf].ravel()
    first, last, place = np.empty((3, size), np.int64)
    first[node[::-1]], last[node] = of_leaf[::-1], of_leaf
    place[nodes] = inside
    height = np.frexp((first ^ last).astype(float))[1]  # levels from the leaves to the smallest part around a node
    end = (last >> height) + 1 << height
    return np.asarray(np.lexsort((place, height, end)))


def _halved(centres: Float, neighbours: tuple[Int, Int]) -> Int:
    """Bisect triangles recursively; return their leaves (t,) in a binary tree with some empty leaves.

    A cut along x or y, near the middle of a part, crosses the fewest sides between the triangles `neighbours`, (k,) and
    (k,).
    """
    t, first = len(centres), np.array([0, len(centres)])
    by_coordinate = [np.argsort(x, kind="stable") for x in centres.T]
    order, part, rank = np.arange(t), np.zeros(t, np.int64), np.empty(t, np.int64)
    while (size := np.diff(first)).max() > 1:
        of_place = np.repeat(np.arange(len(size)), size)
        part[order] = of_place
        within = part[neighbours[0]] == part[neighbours[1]]
        offset = np.abs(np.arange(t) - np.repeat((first[:-1] + first[1:]) / 2, size))
        middle = np.flatnonzero(offset <= np.repeat(np.maximum(OFF_THE_MIDDLE * size, 0.5), size))
        cuts = []
        for along in by_coordinate:
            # One part after the other; a cut crosses a side at all positions between both triangles of the side.
            along = along[np.argsort(part[along], kind="stable")]
            rank[along] = np.arange(t)
            one, other = (rank[side][within] for side in neighbours)
            begin, end = np.minimum(one, other) + 1, np.maximum(one, other) + 1
            crossed = np.cumsum(np.bincount(begin, minlength=t + 1) - np.bincount(end, minlength=t + 1))[:t]
            cost = crossed[middle] + offset[middle] / t
            best = np.lexsort((cost, of_place[middle]))
            best = best[np.minimum(np.searchsorted(of_place[middle], np.arange(len(size))), len(best) - 1)]
            cuts.append((along, middle[best], cost[best]))
        (order_x, at_x, cost_x), (order_y, at_y, cost_y) = cuts
        by_y = (cost_y < cost_x) & (size > 1)
        order = np.where(by_y[of_place], order_y, order_x)
        middles = np.where(size < 2, first[1:], np.where(by_y, at_y, at_x))
        first = np.append(np.stack([first[:-1], middles], axis=1), first[-1])
    leaf = np.empty(t, np.int64)
    leaf[order] = np.repeat(np.arange(len(first) - 1), np.diff(first))
    return leaf
