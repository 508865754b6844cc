"""The coarse cell as a torus: node classes, torus edges and constituents.

Two plane nodes that differ by a period are one class, two boundary edges that differ by a period one
torus edge.  A constituent is a connected part with one phase on the torus, so a fibre that the
cell's boundary cuts is one constituent.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra

from feti_homog.mesh.coarse_mesh import CoarseMesh, edge_keys, representatives, twins
from feti_homog.microstructure import phase_names
from feti_homog.microstructure.shapes import Ellipses
from feti_homog.typing import Bool, Float, Int, Int32

# Numbers below a size, in proportion to it, below which sorting them costs less than an entry for each below it.
FEW = 1 / 16


@dataclass(frozen=True)
class Torus:
    """Identities on the torus, for a `CoarseMesh` with m triangles or some tiles in a larger one.

    Attributes:
        mesh: the plane mesh.
        node_class: (n,) by plane node.
        edges: (e, 2) plane edges by ascending nodes, each from its lexicographically lower to its upper end.
        triangle_edges: (m, 3) plane edge from vertex k to vertex k + 1 (mod 3).
        torus_edge: (e,) by plane edge.
        constituent: (m,) by triangle; matrix constituents come first.
        class_keys, edge_keys: ascending numbers in the whole cell, for classes and torus edges.
        at_void: (torus edges,) whether only one triangle in the whole cell has it, beside a void.
        is_whole: whether no triangle in the cell is missing.
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
        """Identify the periodic images of `mesh` and find its constituents."""
        node_class = np.unique(mesh.representative, return_inverse=True)[1]
        edges, triangle_edges = plane_edges_of(mesh)
        low_edge = representatives(mesh.points[edges].mean(axis=1), mesh.width, mesh.height)
        torus_edge = np.unique(low_edge, return_inverse=True)[1]
        one, other = edge_pairs(torus_edge[triangle_edges])
        same = mesh.phase[one] == mesh.phase[other]
        label = components(len(mesh.triangles), one[same], other[same])
        keys = np.arange(node_class.max() + 1), np.arange(torus_edge.max() + 1)
        at_void = np.bincount(torus_edge[triangle_edges].ravel()) == 1
        torus = cls(mesh, node_class, edges, triangle_edges, torus_edge, label, *keys, at_void)
        # Where the precedence leaves it open, fibres on circles are numbered in the order of the circles.
        circle = np.full(len(edges), len(mesh.ellipses))
        circle[torus.arcs] = mesh.arc_circle
        first = np.full(label.max() + 1, len(mesh.ellipses))
        np.minimum.at(first, np.repeat(label, 3), circle[triangle_edges].ravel())
        order = np.lexsort((np.arange(len(label)), first[label], mesh.precedence))
        return replace(torus, constituent=renumber(label, order))

    @cached_property
    def triangle_torus_edges(self) -> Int:
        """(m, 3) torus edge from vertex k to vertex k + 1 (mod 3)."""
        return self.torus_edge[self.triangle_edges]

    @cached_property
    def sides(self) -> tuple[Int, Int, Int]:
        """The two triangles (e,) and (e,) beside each shared torus edge, and the edge (e,)."""
        one, other = twins(self.triangle_torus_edges.ravel())
        return one // 3, other // 3, self.triangle_torus_edges.ravel()[one]

    @cached_property
    def debonded(self) -> Bool:
        """Mask (torus edges,) of the edges that are debonded from the start."""
        debonded = np.zeros(len(self.edge_keys), bool)
        debonded[self.torus_edge[self.plane_edges(self.mesh.debonded_edges)]] = True
        return debonded

    @cached_property
    def edge_ellipses(self) -> Ellipses:
        """The e ellipses that the plane edges lie on; points for straight edges."""
        n = len(self.edges)
        centres, frames = np.zeros((n, 2)), np.zeros((n, 2, 2))
        curves = self.mesh.ellipses[self.mesh.arc_circle]
        centres[self.arcs], frames[self.arcs] = curves.centres, curves.frames
        return Ellipses(centres, frames)

    @cached_property
    def edge_circles(self) -> Float:
        """(e, 3) centre and radius by plane edge: radius NaN on ellipses, 0 where the edge is straight."""
        circles = np.zeros((len(self.edges), 3))
        circles[self.arcs] = self.mesh.circles[self.mesh.arc_circle]
        return circles

    @cached_property
    def edge_turns(self) -> Float:
        """(e,) how far the parameter turns on its ellipse along each plane edge, at most pi; 0 where it is straight."""
        turns, curves = np.zeros(len(self.edges)), self.mesh.ellipses[self.mesh.arc_circle]
        start, stop = (curves.unit(self.mesh.points[self.edges[self.arcs, end]] - curves.centres) for end in (0, 1))
        sine = start[:, 0] * stop[:, 1] - start[:, 1] * stop[:, 0]
        turns[self.arcs] = np.arctan2(np.abs(sine), (start * stop).sum(axis=1))
        return turns

    @cached_property
    def edge_ends(self) -> Int:
        """Classes (torus edges, 2) at the ends of each edge."""
        plane = np.unique(self.torus_edge, return_index=True)[1]
        return np.asarray(self.node_class[self.edges[plane]])

    @cached_property
    def meeting(self) -> Int:
        """Number (classes,) of the constituents that meet in each class."""
        corner, n = self.node_class[self.mesh.triangles], int(self.constituent.max(initial=0)) + 1
        pairs = np.unique(corner * n + self.constituent[:, None])
        return np.bincount(pairs // n, minlength=len(self.class_keys))

    @cached_property
    def touching(self) -> Bool:
        """(classes,) where two constituents meet, but not along one line: more than once, or without an edge.

        On a line each has one sector among the triangles around.  Round fibres, which alone are torn by tiles, touch
        nowhere.
        """
        if not self.is_whole:
            return np.zeros(len(self.class_keys), bool)
        one, other, edge = self.sides
        between = edge[self.constituent[one] != self.constituent[other]]
        ends = (self.edge_ends[some].ravel() for some in (between, self.at_void))
        shared, free = (np.bincount(classes, minlength=len(self.class_keys)) for classes in ends)
        # Each edge between constituents ends a sector, and so do both sides of a void together.
        sectors = shared + free // 2
        return np.asarray((self.meeting == 2) & ((sectors != 2) | (shared == 0)))

    @cached_property
    def never_part(self) -> Bool:
        """(classes,) where constituents are held together whatever their interface: three meet, or two touch."""
        return np.asarray((self.meeting > 2) | self.touching)

    @cached_property
    def edge_lengths(self) -> Float:
        """Length of each torus edge, of its chord if it lies on a circle."""
        ends = self.mesh.points[self.edges]
        lengths = np.empty(len(self.edge_keys))
        lengths[self.torus_edge] = np.hypot(*(ends[:, 1] - ends[:, 0]).T)
        return lengths

    @cached_property
    def arcs(self) -> Int:
        """(a,) plane edge of each of the mesh's `arc_edges`."""
        return self.plane_edges(self.mesh.arc_edges)

    def plane_edges(self, pairs: Int32) -> Int:
        """(k,) plane edge between each pair (k, 2) of plane nodes."""
        n = len(self.mesh.points)
        return np.asarray(np.searchsorted(np.sort(self.edges, axis=1) @ [n, 1], edge_keys(pairs, n)))

    @cached_property
    def constituent_phase(self) -> Int:
        """(constituents,) phase of each constituent."""
        first = np.unique(self.constituent, return_index=True)[1]
        return np.asarray(self.mesh.phase[first], np.int64)

    @cached_property
    def nesting(self) -> Int:
        """Ranks (constituents,) from the outermost to the innermost.

        By the number of constituents between it and the matrix, a coating before the fibre within, and then by number.
        """
        one, other, _ = self.sides
        a, b = self.constituent[one], self.constituent[other]
        phase, n = self.constituent_phase, len(self.constituent_phase)
        touching = csr_matrix((np.ones(len(a)), (a, b)), shape=(n, n))
        depth = dijkstra(touching, False, np.flatnonzero(phase == 0), unweighted=True, min_only=True)
        return places_by_depth(depth, phase, self.mesh.phases)

    def plane_parts(self) -> Int:
        """Cut the constituents (m,) at the cell's boundary, as in the paper's Fig. 2a (`bodies = "plane"`)."""
        one, other = edge_pairs(self.triangle_edges)
        same = self.constituent[one] == self.constituent[other]
        label = components(len(self.constituent), one[same], other[same])
        return renumber(label, np.argsort(self.constituent, kind="stable"))


def places_by_depth(depth: Float | Int, phase: Int, phases: tuple[str, ...]) -> Int:
    """Rank n constituents from the outermost to the innermost, by depths (n,) in the matrix.

    A coating is before the fibre within, and then they go by number; `phase` (n,) are phase numbers.
    """
    coats = np.array([name == phase_names.COATING for name in phases])[phase]
    return np.argsort(np.lexsort((~coats, depth)))


def edge_pairs(triangle_edges: Int) -> tuple[Int, Int]:
    """Return the two triangles beside each shared edge: two arrays, in the edges' order."""
    one, other = twins(triangle_edges.ravel())
    return one // 3, other // 3


def components(n: int, one: Int, other: Int) -> Int:
    """Return connected components of the graph on n vertices with edges (left, right): (n,) labels."""
    graph = coo_matrix((np.ones(len(one), np.int8), (one, other)), shape=(n, n))
    return np.asarray(connected_components(graph, directed=False)[1], np.int64)


def present(numbers: Int | Int32, size: int) -> tuple[Int, Int]:
    """Return the distinct numbers (k,), all below `size`, ascending, and the index of each entry in them."""
    if numbers.size < FEW * size:
        members, place = np.unique(numbers, return_inverse=True)
        return np.asarray(members), np.asarray(place.reshape(numbers.shape))
    is_present = np.zeros(size, bool)
    is_present[numbers] = True
    members = np.flatnonzero(is_present)
    place = np.empty(size, np.int64)
    place[members] = np.arange(len(members))
    return members, place[numbers]


def renumber(label: Int, order: Int) -> Int:
    """Assign numbers to the labels by their first appearance in `order`."""
    first = np.unique(label[order], return_index=True)[1]
    return np.asarray(np.argsort(np.argsort(first))[label])


def plane_edges_of(mesh: CoarseMesh) -> tuple[Int, Int]:
    """Find the plane edges: `edges` (e, 2) and `triangle_edges` (m, 3), as in `Torus`."""
    ends = np.stack([mesh.triangles, np.roll(mesh.triangles, -1, axis=1)], axis=2).reshape(-1, 2)
    keys, which = np.unique(edge_keys(ends, len(mesh.points)), return_inverse=True)
    edges = np.stack(np.divmod(keys, len(mesh.points)), axis=1)
    (xa, ya), (xb, yb) = mesh.points[edges[:, 0]].T, mesh.points[edges[:, 1]].T
    backwards = (xa > xb) | ((xa == xb) & (ya > yb))
    edges[backwards] = edges[backwards, ::-1]
    return edges, which.reshape(-1, 3)
