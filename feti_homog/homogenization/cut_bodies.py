"""Bodies in several pieces: shared vertices, sums over pieces, stress fits.

Each vertex and each coarse edge on a cut has a home rank, which knows all pieces that have it.  Element patches
about shared vertices belong to the body, not to its pieces.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from mpi4py import MPI

from feti_homog.fem import local_fits, stress_recovery
from feti_homog.feti.decomposition import sharers
from feti_homog.mesh import FineMesh, Submesh
from feti_homog.system.parallel import distributed_arrays
from feti_homog.typing import Array, Bool, Float, Int, Int32

NO_ROWS = np.zeros((0, 3), np.int64)
# Layers of elements about shared vertices: shared vertices, their neighbours, and the neighbours of these have all of
# their elements.
LAYERS = 3


class SharedVertices:
    """Shared vertices in this rank's meshes; each mesh joins some pieces.

    Attributes:
        meshes: which of this rank's meshes have shared vertices.
        classes: (n,) shared vertex classes in each such mesh.
        sides: (f, 2) vertices on element sides along cuts, in each.
        is_first: (f,) whether each side belongs to the first of its two pieces.
    """

    def __init__(self, comm: MPI.Intracomm, meshes: Sequence[tuple[Sequence[Submesh], FineMesh]]) -> None:
        """Find the vertices and edges that several pieces have.  Collective."""
        self._comm = comm
        borders = [_border(pieces, mesh) for pieces, mesh in meshes]
        vertex_copies, edge_copies = (self._copies([border[k] for border in borders]) for k in (0, 2))
        self._rows = NO_ROWS
        self.meshes, self.classes, self.sides, self.is_first = list[int](), list[Int](), list[Int](), list[Bool]()
        for mesh, (rows, classes, _, line) in enumerate(borders):
            shared, on_cut = vertex_copies[mesh][:, 0] > 1, edge_copies[mesh][:, 0] > 1
            if shared.any():
                self._rows = np.concatenate([self._rows, rows[shared]])
                self.meshes.append(mesh)
                self.classes.append(classes[shared])
                self.sides.append(np.stack([line[on_cut, :-1], line[on_cut, 1:]], axis=2).reshape(-1, 2))
                self.is_first.append(np.repeat(edge_copies[mesh][on_cut, 1] == 1, line.shape[1] - 1))

    def sum(self, parts: Sequence[Float]) -> list[Float]:
        """(n, k) sums over pieces for values `parts` (n, k) at each mesh's shared vertices.  Collective."""

        def sums(number: Int, values: Float) -> Float:
            totals = np.zeros((int(number.max(initial=-1)) + 1, values.shape[1]))
            np.add.at(totals, number, values)
            return np.asarray(totals[number])

        width = self._comm.allreduce(max((part.shape[1] for part in parts), default=0), MPI.MAX)
        return _split(self._at_home(self._rows, np.concatenate([np.zeros((0, width)), *parts]), sums), self.classes)

    def _copies(self, rows: Sequence[Int]) -> list[Int]:
        """(n, 2) copy counts for each mesh's rows (n, 3), and 1 at the first copy, else 0.  Collective."""

        def copies(number: Int, _: Int) -> Int:
            _, first, count = np.unique(number, return_index=True, return_counts=True)
            return np.stack([count[number], first[number] == np.arange(len(number))], axis=1)

        all_rows = np.concatenate([NO_ROWS, *rows])
        return _split(self._at_home(all_rows, all_rows, copies), rows)

    def _at_home(self, rows: Int, values: Array, combine: Callable[[Int, Array], Array]) -> Array:
        """Call `combine` with row numbers (n, 3) and their values (n, k), on all ranks.  Collective."""
        comm, home = self._comm, rows[:, 1:].sum(axis=1) // 2 % self._comm.size
        rows, values, source, place = distributed_arrays.exchange(
            comm, home, rows, values, np.full(len(rows), comm.rank), np.arange(len(rows))
        )
        order = np.lexsort(rows.T)
        is_new = np.ones(len(order), bool)
        is_new[1:] = (np.diff(rows[order], axis=0) != 0).any(axis=1)
        number = np.empty(len(order), np.int64)
        number[order] = np.cumsum(is_new) - 1
        place, combined = distributed_arrays.exchange(comm, source, place, combine(number, values))
        return np.asarray(combined[np.argsort(place)])


def _split(values: Array, parts: Sequence[Array]) -> list[Array]:
    """Split rows of values into arrays as long as the parts."""
    return [values[a:b] for a, b in pairwise(np.cumsum([0, *map(len, parts)]).tolist())]


def _border(pieces: Sequence[Submesh], mesh: FineMesh) -> tuple[Int, Int, Int, Int]:
    """Return vertices and coarse edges on the piece borders of a joined mesh.

    These are vertices (n, 3) by body, entity and position, their classes (n,), coarse edges (e, 3) alike, and the
    vertex classes along the edges (e, m).
    """
    first, borders = 0, []
    for s in pieces:
        triangle, k, line = border_lines(s, mesh, mesh.node_class[mesh.nodes[first : first + len(s.triangles)]])
        first, line = first + len(s.triangles), line[:, :: mesh.lattice.order]
        ends = s.vertex_class[s.triangles[triangle[:, None], np.stack([k, (k + 1) % 3], axis=1)]]
        back = s.backwards[triangle, k]
        ends[back] = ends[back, ::-1]
        place = np.arange(line.shape[1])
        place[-1] = 0
        key = np.tile(
            sharers.entity_code(s.edge_keys[s.edge_class[s.triangle_edges[triangle, k]]], True)[:, None], len(place)
        )
        edges = np.column_stack([s.constituent[triangle], key[:, 0], np.zeros(len(key), np.int64)])
        key[:, [0, -1]] = sharers.entity_code(s.class_keys[ends], False)
        rows = np.stack(np.broadcast_arrays(s.constituent[triangle][:, None], key, place), axis=2).reshape(-1, 3)
        classes, once = np.unique(line, return_index=True)
        borders.append((rows[once], classes, edges, line))
    vertices, classes, edges, lines = (np.concatenate(rows) for rows in zip(*borders, strict=True))
    return vertices, classes, edges, lines


def border_lines(s: Submesh, mesh: FineMesh, classes: Int32) -> tuple[Int, Int, Int]:
    """Return triangles (e,) at a piece border, their edges (e,), and classes (e, M + 1) along the edges.

    `classes` (t, q) are the lattice node classes of all triangles.
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
    """Return, by mesh, vertex classes (n,) and fits (n, p, m k) that cuts change.  Collective."""
    pieces = zip(shared.meshes, shared.classes, shared.sides, shared.is_first, strict=True)
    strips = [_Strip.of(bodies[mesh], classes, sides, first) for mesh, classes, sides, first in pieces]
    patches = _over_pieces(shared, strips, [strip.stress.patch_sums() for strip in strips])
    flags = shared.sum([np.isin(strip.shared, strip.bounds)[:, None].astype(float) for strip in strips])
    neighbours = [strip.neighbours(flag[:, 0] > 0) for strip, flag in zip(strips, flags, strict=True)]
    order = bodies[0].order if bodies else 1
    more = [
        (pairs.shared_matrices(moments, order), pairs.shared(sums, order))
        for pairs, (moments, sums) in zip(neighbours, patches, strict=True)
    ]
    fits = {}
    more = _over_pieces(shared, strips, more)
    for mesh, strip, pairs, patch, added in zip(shared.meshes, strips, neighbours, patches, more, strict=True):
        changed = np.union1d(strip.shared, pairs.at[np.isin(pairs.other, strip.shared)])
        of_strip = local_fits.fitted(*(a[changed] + b[changed] for a, b in zip(patch, added, strict=True)))
        fits[mesh] = np.flatnonzero(strip.is_vertex)[changed], of_strip
    return fits


@dataclass(frozen=True)
class _Strip:
    """Elements about one mesh's shared vertices; their vertices are numbered from 0.

    Attributes:
        stress: on these elements alone.
        is_vertex: (classes,) whether a class is a vertex in these elements.
        shared: (n,) the shared vertices.
        sides: (f, 2) element sides, each once in its body; `vector` (f, 2) from the first vertex to the second.
        bounds: (b,) vertices at which a side has no other element in the body.
    """

    stress: stress_recovery.RecoveredStress
    is_vertex: Bool
    shared: Int
    sides: Int
    vector: Float
    bounds: Int

    @classmethod
    def of(cls, body: stress_recovery.RecoveredStress, classes: Int, cut: Int, is_first: Bool) -> _Strip:
        """Find the elements; other pieces count the sides `cut` (c, 2) on cuts, but for the first copies."""
        is_vertex, at = np.zeros(len(body.u), bool), body.node_class[body.triangles[:, :3]]
        is_vertex[classes] = True
        for _ in range(LAYERS):
            reached = is_vertex[at].any(axis=1)
            is_vertex[at[reached]] = True
        stress = replace(body, triangles=body.triangles[reached])
        corners, size = stress.points[stress.triangles[:, :3]], int(is_vertex.sum())
        start, stop = stress.vertices.ravel(), stress.vertices[:, [1, 2, 0]].ravel()
        vector = (corners[:, [1, 2, 0]] - corners).reshape(-1, 2)
        code, once, count = np.unique(_code(start, stop, size), return_index=True, return_counts=True)
        on_cut = _code(stress.numbers[cut[:, 0]], stress.numbers[cut[:, 1]], size)
        single = once[(count == 1) & ~np.isin(code, on_cut)]
        once = once[~np.isin(code, on_cut[~is_first])]
        sides = np.stack([start, stop], axis=1)
        return cls(stress, is_vertex, stress.numbers[classes], sides[once], vector[once], np.unique(sides[single]))

    def neighbours(self, at_boundary: Bool) -> local_fits.PatchNeighbours:
        """Return pairs whose first is on the body boundary, as shared vertices (n,) are if `at_boundary`."""
        is_bound = np.zeros(int(self.is_vertex.sum()), bool)
        is_bound[self.bounds] = True
        is_bound[self.shared] = at_boundary
        at, other = np.concatenate([self.sides, self.sides[:, ::-1]]).T
        vector = np.concatenate([self.vector, -self.vector])
        return local_fits.PatchNeighbours(at[is_bound[at]], other[is_bound[at]], vector[is_bound[at]])


def _code(a: Int, b: Int, size: int) -> Int:
    """Return one number for each vertex pair, among `size` vertices."""
    return np.asarray(np.minimum(a, b) * size + np.maximum(a, b))


def _over_pieces(
    shared: SharedVertices, strips: Sequence[_Strip], pairs: Sequence[tuple[Float, Float]]
) -> list[tuple[Float, Float]]:
    """Add strip moments and sums (vertices, p, ..) over all pieces, at shared vertices.  Collective."""
    parts = [
        np.concatenate([a[strip.shared], b[strip.shared]], axis=2) for strip, (a, b) in zip(strips, pairs, strict=True)
    ]
    totals = shared.sum([part.reshape(len(part), -1) for part in parts])
    for strip, (moments, sums), part, total in zip(strips, pairs, parts, totals, strict=True):
        p = moments.shape[1]
        moments[strip.shared], sums[strip.shared] = np.split(total.reshape(part.shape), [p], axis=2)
    return list(pairs)
