"""Find the vertices that pieces of a body share, sum values over pieces, and fit stresses across cuts.

Each vertex and each coarse edge on a cut has a home rank, which knows all pieces with this vertex or edge.  The patch
of elements about a shared vertex extends over all pieces of the body.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from mpi4py import MPI

from feti_homog.fem import local_fits, stress_recovery
from feti_homog.feti.decomposition import sharers
from feti_homog.mesh import FineMesh, Submesh
from feti_homog.system.parallel import distributed_arrays
from feti_homog.typing import Array, Bool, Float, Int, Int32

NO_ROWS = np.zeros((0, 3), np.int64)
# Number of element layers about shared vertices, so that all vertices within two edges have complete patches.
LAYERS = 3


class SharedVertices:
    """The vertices that several pieces of a body share, in the meshes of this rank.

    Attributes:
        meshes: indices of this rank's meshes with shared vertices; a mesh has one or more pieces.
        classes: (n,) shared vertex classes in each such mesh.
        sides: (f, 2) vertices of the element sides along cuts, in each such mesh.
        is_first: (f,) whether a side is the first of its two copies, one per piece.
    """

    def __init__(self, comm: MPI.Intracomm, meshes: Sequence[tuple[Sequence[Submesh], FineMesh]]) -> None:
        """Find the vertices and edges that several pieces share, from the pieces and mesh in `meshes`.  Collective."""
        self._comm = comm
        # On the piece borders: vertices (n, 3) by body, entity and position, their classes (n,), coarse edges (e, 3) by
        # body, entity and position, and the vertex classes (e, m) along these edges.
        borders = []
        for pieces, mesh in meshes:
            first, parts = 0, list[tuple[Int, Int, Int, Int]]()
            for s in pieces:
                after = first + len(s.triangles)
                triangle, k, nodes = border_lines(s, mesh, mesh.node_class[mesh.nodes[first:after]])
                first, line = after, nodes[:, :: mesh.lattice.order]  # vertices
                ends = s.vertex_class[s.triangles[triangle[:, None], np.stack([k, (k + 1) % 3], axis=1)]]
                back = s.backwards[triangle, k]
                ends[back] = ends[back, ::-1]
                position = np.arange(line.shape[1])
                position[-1] = 0
                entity = sharers.entity_code(s.edge_keys[s.edge_class[s.triangle_edges[triangle, k]]], True)
                body = s.constituent[triangle]
                key = np.tile(entity[:, None], len(position))
                key[:, [0, -1]] = sharers.entity_code(s.class_keys[ends], False)
                rows = np.stack(np.broadcast_arrays(body[:, None], key, position), axis=2).reshape(-1, 3)
                classes, index = np.unique(line, return_index=True)
                parts.append((rows[index], classes, np.column_stack([body, entity, np.zeros_like(entity)]), line))
            borders.append([np.concatenate(table) for table in zip(*parts, strict=True)])
        vertex_copies = self._copies([rows for rows, *_ in borders])
        edge_copies = self._copies([edges for _, _, edges, _ in borders])
        self._rows = NO_ROWS
        self.meshes, self.classes, self.sides, self.is_first = list[int](), list[Int](), list[Int](), list[Bool]()
        for number, (rows, classes, _, line) in enumerate(borders):
            shared, on_cut = vertex_copies[number][:, 0] > 1, edge_copies[number][:, 0] > 1
            if shared.any():
                self._rows = np.concatenate([self._rows, rows[shared]])
                self.meshes.append(number)
                self.classes.append(classes[shared])
                self.sides.append(np.stack([line[on_cut, :-1], line[on_cut, 1:]], axis=2).reshape(-1, 2))
                self.is_first.append(np.repeat(edge_copies[number][on_cut, 1] == 1, line.shape[1] - 1))

    def sum(self, parts: Sequence[Float]) -> list[Float]:
        """Sum values (n, k) at each mesh's shared vertices over all pieces; return the sums by mesh.  Collective."""

        def sums(number: Int, values: Float) -> Float:
            totals = np.zeros((int(number.max(initial=-1)) + 1, values.shape[1]))
            np.add.at(totals, number, values)
            return np.asarray(totals[number])

        width = self._comm.allreduce(max((part.shape[1] for part in parts), default=0), MPI.MAX)
        return self._at_home(self._rows, np.concatenate([np.zeros((0, width)), *parts]), self.classes, sums)

    def _copies(self, parts: Sequence[Int]) -> list[Int]:
        """Count the copies of each row in `parts` (n, 3) on all ranks, and mark first copies: (n, 2).  Collective."""

        def copies(number: Int, _: Int) -> Int:
            _, first, count = np.unique(number, return_index=True, return_counts=True)
            return np.stack([count[number], first[number] == np.arange(len(number))], axis=1)

        rows = np.concatenate([NO_ROWS, *parts])
        return self._at_home(rows, rows, parts, copies)

    def _at_home(
        self, rows: Int, values: Array, parts: Sequence[Array], combine: Callable[[Int, Array], Array]
    ) -> list[Array]:
        """Combine the values (n, k) of equal rows (n, 3) on home ranks.  Collective.

        `combine` takes the values and one number per row, equal for equal rows.  Results are split like `parts`.
        """
        comm, home = self._comm, rows[:, 1:].sum(axis=1) // 2 % self._comm.size
        origin = np.full(len(rows), comm.rank), np.arange(len(rows))
        rows, values, source, position = distributed_arrays.exchange(comm, home, rows, values, *origin)
        order = np.lexsort(rows.T)
        is_new = np.ones(len(order), bool)
        is_new[1:] = (np.diff(rows[order], axis=0) != 0).any(axis=1)
        number = np.empty(len(order), np.int64)
        number[order] = np.cumsum(is_new) - 1
        position, combined = distributed_arrays.exchange(comm, source, position, combine(number, values))
        return np.split(combined[np.argsort(position)], np.cumsum([len(part) for part in parts])[:-1]) if parts else []


def border_lines(s: Submesh, mesh: FineMesh, classes: Int32) -> tuple[Int, Int, Int]:
    """Find the triangles and edges along the border of a piece.

    `classes` (t, q) are the lattice node classes of all triangles.  Return the triangle (e,) at each border edge, the
    position (e,) of the edge in the triangle, and node classes (e, intervals + 1) along the edge, in one order for both
    pieces.
    """
    edge, inner = s.edge_class[s.triangle_edges], np.arange(mesh.lattice.intervals - 1)
    triangle, k = np.nonzero(np.bincount(edge.ravel(), minlength=len(s.edge_keys))[edge] == 1)
    sides = np.stack([np.r_[j, 3 + j * len(inner) + inner, (j + 1) % 3] for j in range(3)])
    line = classes[triangle[:, None], sides[k]].astype(np.int64)
    back = s.backwards[triangle, k]
    line[back] = line[back, ::-1]
    return triangle, k, line


def fits_across_cuts(
    shared: SharedVertices, bodies: Sequence[stress_recovery.RecoveredStress]
) -> dict[int, tuple[Int, Float]]:
    """Fit recovered stresses at vertices on or next to cuts, over all pieces.  Collective.

    Returns:
        For each mesh index, the vertex classes (n,) and fits (n, p, m k): p coefficients of m stresses under k loads.
    """
    pieces = zip(shared.meshes, shared.classes, shared.sides, shared.is_first, strict=True)
    strips = [_Strip.of(bodies[mesh], classes, sides, first) for mesh, classes, sides, first in pieces]
    patches = _over_pieces(shared, strips, [strip.stress.patch_sums() for strip in strips])
    flags = shared.sum([np.isin(strip.shared, strip.bounds)[:, None].astype(float) for strip in strips])
    neighbours = [strip.neighbours(flag[:, 0] > 0) for strip, flag in zip(strips, flags, strict=True)]
    order = bodies[0].order if bodies else 1
    additions = [pairs.shared(*patch, order) for pairs, patch in zip(neighbours, patches, strict=True)]
    fits = {}
    additions = _over_pieces(shared, strips, additions)
    for mesh, strip, pairs, patch, added in zip(shared.meshes, strips, neighbours, patches, additions, strict=True):
        changed = np.union1d(strip.shared, pairs.at[np.isin(pairs.other, strip.shared)])
        of_strip = local_fits.fitted(*(a[changed] + b[changed] for a, b in zip(patch, added, strict=True)))
        fits[mesh] = np.flatnonzero(strip.is_vertex)[changed], of_strip
    return fits


@dataclass(frozen=True)
class _Strip:
    """The elements about the shared vertices of a mesh, with vertex numbers from 0.

    Attributes:
        stress: recovered stress on these elements.
        is_vertex: (classes,) whether a class is a vertex of these elements.
        shared: (n,) shared vertices.
        sides: (f, 2) vertices of the element sides, where each side of a body counts once.
        vector: (f, 2) vectors from the first to the second vertex of a side.
        bounds: (b,) vertices of sides with one element in the body.
    """

    stress: stress_recovery.RecoveredStress
    is_vertex: Bool
    shared: Int
    sides: Int
    vector: Float
    bounds: Int

    @classmethod
    def of(cls, body: stress_recovery.RecoveredStress, classes: Int, cut: Int, is_first: Bool) -> _Strip:
        """Find the elements within LAYERS layers about the shared vertices `classes`.

        Among the sides along a `cut` (c, 2), this piece counts only the sides marked by `is_first`.
        """
        is_vertex, corner_vertices = np.zeros(len(body.u), bool), body.node_class[body.triangles[:, :3]]
        is_vertex[classes] = True
        for _ in range(LAYERS):
            reached = is_vertex[corner_vertices].any(axis=1)
            is_vertex[corner_vertices[reached]] = True
        stress = replace(body, triangles=body.triangles[reached])
        corners, size = stress.points[stress.triangles[:, :3]], int(is_vertex.sum())
        start, stop = stress.vertices.ravel(), stress.vertices[:, [1, 2, 0]].ravel()
        vector = (corners[:, [1, 2, 0]] - corners).reshape(-1, 2)
        code, index, count = np.unique(_code(start, stop, size), return_index=True, return_counts=True)
        on_cut = _code(stress.numbers[cut[:, 0]], stress.numbers[cut[:, 1]], size)
        single = index[(count == 1) & ~np.isin(code, on_cut)]
        index = index[~np.isin(code, on_cut[~is_first])]
        sides = np.stack([start, stop], axis=1)
        return cls(stress, is_vertex, stress.numbers[classes], sides[index], vector[index], np.unique(sides[single]))

    def neighbours(self, at_boundary: Bool) -> local_fits.PatchNeighbours:
        """Pair boundary vertices with neighbours; `at_boundary` (n,) marks shared vertices on the body's boundary."""
        is_bound = np.zeros(int(self.is_vertex.sum()), bool)
        is_bound[self.bounds] = True
        is_bound[self.shared] = at_boundary
        vertex, other = np.concatenate([self.sides, self.sides[:, ::-1]]).T
        vector = np.concatenate([self.vector, -self.vector])
        return local_fits.PatchNeighbours(vertex[is_bound[vertex]], other[is_bound[vertex]], vector[is_bound[vertex]])


def _code(a: Int, b: Int, size: int) -> Int:
    """Return one number for each unordered pair of vertices (n,), among `size` vertices."""
    return np.asarray(np.minimum(a, b) * size + np.maximum(a, b))


def _over_pieces(
    shared: SharedVertices, strips: Sequence[_Strip], pairs: Sequence[tuple[Float, Float]]
) -> list[tuple[Float, Float]]:
    """Sum arrays (vertices, p, ..) in `pairs` over pieces at shared vertices, in place; return `pairs`.  Collective."""
    parts = [np.concatenate([a[s.shared], b[s.shared]], axis=2) for s, (a, b) in zip(strips, pairs, strict=True)]
    totals = shared.sum([part.reshape(len(part), -1) for part in parts])
    for strip, (moments, sums), part, total in zip(strips, pairs, parts, totals, strict=True):
        p = moments.shape[1]
        moments[strip.shared], sums[strip.shared] = np.split(total.reshape(part.shape), [p], axis=2)
    return list(pairs)
