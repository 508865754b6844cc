"""Vertices of elements that several pieces of one body share, and sums over the pieces.

Each vertex and each coarse edge on a cut has a home rank, which knows all pieces that have it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from mpi4py import MPI

from feti_homog.feti.decomposition.sharers import entity_code
from feti_homog.mesh.refinement import FineMesh
from feti_homog.mesh.submesh import Submesh
from feti_homog.system.parallel.distributed_arrays import exchange
from feti_homog.typing import Array, Bool, Float, Int, Int32

NO_ROWS = np.zeros((0, 3), np.int64)


class SharedVertices:
    """The shared vertices of the meshes of this rank, of which each joins those of some pieces.

    Attributes:
        meshes: numbers of this rank's meshes that have some.
        classes: of each of these meshes, (n,) of its shared vertices.
        sides: of each, (f, 2) vertices of the sides of elements on cuts.
        is_first: of each, (f,) whether it is that of the first of the two pieces.
    """

    def __init__(self, comm: MPI.Intracomm, meshes: Sequence[tuple[Sequence[Submesh], FineMesh]]) -> None:
        """Find them.  Collective."""
        self._comm = comm
        found = [_border(submeshes, mesh) for submeshes, mesh in meshes]
        copies = self._copies([vertices for vertices, *_ in found])
        self._rows = np.concatenate([NO_ROWS, *(own[0][n[:, 0] > 1] for own, n in zip(found, copies, strict=True))])
        of_edges = self._copies([edges for _, _, edges, _ in found])
        self.meshes, self.classes, self.sides, self.is_first = list[int](), list[Int](), list[Int](), list[Bool]()
        for mesh, ((_, classes, _, line), of_vertices, of_edge) in enumerate(zip(found, copies, of_edges, strict=True)):
            shared, on_cut = classes[of_vertices[:, 0] > 1], of_edge[:, 0] > 1
            if len(shared):
                self.meshes.append(mesh)
                self.classes.append(shared)
                self.sides.append(np.stack([line[on_cut, :-1], line[on_cut, 1:]], axis=2).reshape(-1, 2))
                self.is_first.append(np.repeat(of_edge[on_cut, 1] == 1, line.shape[1] - 1))

    def sum(self, parts: Sequence[Float]) -> list[Float]:
        """(n, k) sums over the pieces of `parts` (n, k) at the vertices of each mesh.  Collective."""
        width = self._comm.allreduce(max((own.shape[1] for own in parts), default=0), MPI.MAX)
        return _split(self._at_home(self._rows, np.concatenate([np.zeros((0, width)), *parts]), _sums), self.classes)

    def _copies(self, rows: Sequence[Int]) -> list[Int]:
        """(n, 2) of the rows (n, 3) of each mesh, what `_copies` returns.  Collective."""
        every = np.concatenate([NO_ROWS, *rows])
        return _split(self._at_home(every, every, _copies), rows)

    def _at_home(self, rows: Int, values: Array, combine: Callable[[Int, Array], Array]) -> Array:
        """Return, of each row (n, 3), what its home makes of the rows and values (n, k) of all ranks.  Collective."""
        comm, home = self._comm, rows[:, 1:].sum(axis=1) // 2 % self._comm.size
        rows, values, source, place = exchange(
            comm, home, rows, values, np.full(len(rows), comm.rank), np.arange(len(rows))
        )
        order = np.lexsort(rows.T)
        is_new = np.ones(len(order), bool)
        is_new[1:] = (np.diff(rows[order], axis=0) != 0).any(axis=1)
        number = np.empty(len(order), np.int64)
        number[order] = np.cumsum(is_new) - 1
        place, combined = exchange(comm, source, place, combine(number, values))
        return np.asarray(combined[np.argsort(place)])


def _copies(number: Int, _: Array) -> Array:
    """(n, 2) how many have the same number, and 1 of the first of them, else 0."""
    _, first, count = np.unique(number, return_index=True, return_counts=True)
    return np.stack([count[number], first[number] == np.arange(len(number))], axis=1)


def _sums(number: Int, values: Array) -> Array:
    """(n, k) sums of the values (n, k) with the same number."""
    sums = np.zeros((int(number.max(initial=-1)) + 1, values.shape[1]))
    np.add.at(sums, number, values)
    return np.asarray(sums[number])


def _split(values: Array, parts: Sequence[Array]) -> list[Array]:
    """Return the rows of values that belong to each of some parts, as many as each has."""
    return [values[a:b] for a, b in pairwise(np.cumsum([0, *map(len, parts)]).tolist())]


def _border(submeshes: Sequence[Submesh], mesh: FineMesh) -> tuple[Int, Int, Int, Int]:
    """Return vertices on the borders of pieces, whose meshes are joined, by body, entity and place: (n, 3).

    Their classes (n,), the coarse edges there in the same terms (e, 3), and the classes of vertices along these (e, m).
    """
    first, found = 0, []
    for s in submeshes:
        triangle, k, line = border_lines(s, mesh, mesh.node_class[mesh.nodes[first : first + len(s.triangles)]])
        first, line = first + len(s.triangles), line[:, :: mesh.lattice.order]
        ends = s.vertex_class[s.triangles[triangle[:, None], np.stack([k, (k + 1) % 3], axis=1)]]
        back = s.backwards[triangle, k]
        ends[back] = ends[back, ::-1]
        place = np.arange(line.shape[1])
        place[-1] = 0
        key = np.tile(entity_code(s.edge_keys[s.edge_class[s.triangle_edges[triangle, k]]], True)[:, None], len(place))
        edges = np.column_stack([s.constituent[triangle], key[:, 0], np.zeros(len(key), np.int64)])
        key[:, [0, -1]] = entity_code(s.class_keys[ends], False)
        rows = np.stack(np.broadcast_arrays(s.constituent[triangle][:, None], key, place), axis=2).reshape(-1, 3)
        classes, once = np.unique(line, return_index=True)
        found.append((rows[once], classes, edges, line))
    vertices, classes, edges, lines = (np.concatenate(each) for each in zip(*found, strict=True))
    return vertices, classes, edges, lines


def border_lines(s: Submesh, mesh: FineMesh, classes: Int32) -> tuple[Int, Int, Int]:
    """Return the triangles (e,) at the border of a piece, their edges (e,) there, and the nodes (e, M + 1) along these.

    In the direction of the edges; `classes` (t, q) of the nodes.
    """
    edge, inner = s.edge_class[s.triangle_edges], np.arange(mesh.lattice.intervals - 1)
    triangle, k = np.nonzero(np.bincount(edge.ravel(), minlength=len(s.edge_keys))[edge] == 1)
    sides = np.stack([np.r_[j, 3 + j * len(inner) + inner, (j + 1) % 3] for j in range(3)])
    line = classes[triangle[:, None], sides[k]].astype(np.int64)
    back = s.backwards[triangle, k]
    line[back] = line[back, ::-1]
    return triangle, k, line
