"""The gluing constraints B of one rank, and their place in the distributed vector of multipliers.

Of the k copies of a fine node, those within one body are glued in x and y by orthonormal contrasts and can never
part.  A fibre and the matrix are glued by one pair of rows (n, t) between the means of their copies; this bond can
break.  So B has full row rank, n.(u_matrix - u_fibre) is the gap, and a multiplier is the nodal force that the faces
exert on each other: tension is positive.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy.sparse import coo_matrix, csr_matrix

from feti_homog.cell.refinement import ReferenceLattice, edge_node
from feti_homog.feti.decomposition.shared_entities import SharedEntities
from feti_homog.feti.decomposition.subdomain import Subdomain
from feti_homog.typing import Bool, Float, Int


@dataclass(frozen=True)
class InterfaceNodes:
    """The breakable nodes of which a rank owns the multipliers, i = 0..k-1.

    Attributes:
        row: (k,) local row of the normal constraint; the tangential one follows it.
        points: (k, 2) position on the fibre.
        normal: (k, 2) from fibre to matrix; the tangent is (-n_y, n_x).
        length: (k,) tributary interface length: traction = nodal force / length.
        fibre: (k,) constituent.
        vertex: (k,) whether the node is one of the coarse mesh.
        precracked: (k,) whether the mesh has it debonded from the start.
    """

    row: Int
    points: Float
    normal: Float
    length: Float
    fibre: Int
    vertex: Bool
    precracked: Bool


class JumpOperator:
    """B of this rank's subdomains and the layout of the multipliers.

    Attributes:
        B: (local rows, local dofs) signed, rotated entries; a local row is one that a local dof takes part in.
        rows: global number of each local row.
        node_rows: first owned row and number of rows of each fine node that this rank owns.
        nodes: the interface nodes that this rank owns.
        owned: first global row of this rank and the one after its last.
        global_rows: number of rows on all ranks.
        shared: the vertices and edges that the rows belong to.
        is_shared_row: whether other ranks have each local row too.
        vector: a multiplier vector to duplicate.
    """

    def __init__(
        self, comm: MPI.Intracomm, shared: SharedEntities, subdomains: Sequence[Subdomain], lattice: ReferenceLattice
    ) -> None:
        layout = _Layout(shared, subdomains, lattice)
        self.shared, self._first, self._count = shared, layout.first, layout.count
        elsewhere = np.bincount(np.repeat(np.arange(len(shared.key)), shared.copies), layout.base < 0, len(shared.key))
        self.is_shared_row = np.repeat(elsewhere > 0, layout.count)
        self.owned = shared.owned
        self.global_rows = shared.global_rows
        self.rows, self.B = layout.rows, layout.matrix()
        self.node_rows = layout.node_rows(shared.owned)
        self.nodes = layout.interface_nodes(shared.owned)
        self.vector = PETSc.Vec().createMPI((shared.owned[1] - shared.owned[0], shared.global_rows), comm=comm)
        self._exchanges: dict[int, _Exchange] = {}

    def rows_of(self, entities: Int) -> Int:
        """Local rows of the nodes on some of the shared entities, one entity after the other."""
        entity, p = _expand(entities, self._count[entities])
        return np.asarray(self._first[entity] + p)

    def gather(self, owned: Float) -> Float:
        """The local rows of vectors (owned rows,) or (owned rows, k) of which each rank has its own rows."""
        return self._exchange(owned).gather(owned)

    def sum(self, local: Float) -> Float:
        """The owned rows of the sum over ranks of `local`, (local rows,) or (local rows, k)."""
        return self._exchange(local).sum(local)

    def _exchange(self, x: Float) -> _Exchange:
        columns = x.size // len(x) if len(x) else int(np.prod(x.shape[1:]))
        if columns not in self._exchanges:
            self._exchanges[columns] = _Exchange(self.vector, self.rows, columns)
        return self._exchanges[columns]


class _Exchange:
    """Scatters between the owned and the local rows of vectors with k columns; a copy where both are the same."""

    def __init__(self, vector: PETSc.Vec, rows: Int, columns: int) -> None:
        self._same = vector.comm.size == 1 and np.array_equal(rows, np.arange(len(rows)))
        if self._same:
            return
        sizes = tuple(columns * n for n in vector.getSizes())
        self._owned = PETSc.Vec().createMPI(sizes, bsize=columns, comm=vector.comm)
        self._local = PETSc.Vec().createSeq(columns * len(rows), bsize=columns)
        here = PETSc.IS().createBlock(columns, rows.astype(PETSc.IntType), comm=PETSc.COMM_SELF)
        self._scatter = PETSc.Scatter().create(self._owned, here, self._local, None)

    def gather(self, owned: Float) -> Float:
        """The local rows of x (owned rows,) or (owned rows, k)."""
        if self._same:
            return owned
        self._owned.getArray()[:] = owned.ravel()
        self._scatter.scatter(self._owned, self._local)
        local: Float = self._local.getArray(readonly=True).reshape(-1, *owned.shape[1:])
        return local.copy()

    def sum(self, local: Float) -> Float:
        """The owned rows of the sum over ranks of x (local rows,) or (local rows, k)."""
        if self._same:
            return local
        self._owned.zeroEntries()
        self._local.getArray()[:] = local.ravel()
        self._scatter.scatter(self._local, self._owned, addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        owned: Float = self._owned.getArray(readonly=True).reshape(-1, *local.shape[1:])
        return owned.copy()


class _Layout:
    """Rows and columns of one rank, entity by entity."""

    def __init__(self, shared: SharedEntities, subdomains: Sequence[Subdomain], lattice: ReferenceLattice) -> None:
        self.shared, self.subdomains, self.lattice = shared, subdomains, lattice
        copies = shared.copies
        self.count = shared.nodes * 2 * (copies - 1)
        self.first = np.cumsum(self.count) - self.count
        shift: Int = np.repeat(shared.first_row - self.first, self.count)
        self.rows: Int = shift + np.arange(self.count.sum(), dtype=np.int64)
        self.dofs = np.cumsum([0, *(2 * s.mesh.n_classes for s in subdomains)])
        self.base = self._first_nodes()

    def _first_nodes(self) -> Int:
        """For each sharer: rank-wide number of its first fine node on the entity, or -1 if it is elsewhere."""
        shared = self.shared
        base = np.full(len(shared.sharer), -1)
        entity = np.repeat(np.arange(len(shared.key)), shared.copies)
        for subdomain, offset in zip(self.subdomains, self.dofs // 2, strict=False):
            submesh = subdomain.submesh
            mine = np.flatnonzero(shared.sharer == submesh.index)
            key, is_edge = shared.key[entity[mine]], shared.is_edge[entity[mine]]
            edge = edge_node(
                len(submesh.class_keys), np.searchsorted(submesh.edge_keys, key), np.ones_like(key), self.lattice
            )
            base[mine] = offset + np.where(is_edge, edge, np.searchsorted(submesh.class_keys, key))
        return base

    def matrix(self) -> csr_matrix:
        """B (local rows, local dofs)."""
        entries = [self._entries(*group) for group in self._signatures()]
        rows, columns, values = (np.concatenate([e[i] for e in entries] or [np.zeros(0)]) for i in range(3))
        shape = (len(self.rows), self.dofs[-1])
        return coo_matrix((values, (rows.astype(np.int64), columns.astype(np.int64))), shape=shape).tocsr()

    def _signatures(self) -> list[tuple[Int, Int, bool]]:
        """Entities grouped by how many copies each body has and whether they can break."""
        shared = self.shared
        groups: list[tuple[Int, Int, bool]] = []
        for k in np.unique(shared.copies):
            some = np.flatnonzero(shared.copies == k)
            body = shared.body[shared.pointer[some][:, None] + np.arange(k)]
            starts = np.concatenate([np.ones((len(some), 1), bool), body[:, 1:] != body[:, :-1]], axis=1)
            codes, which = np.unique(np.column_stack([starts, shared.fibre[some] >= 0]), axis=0, return_inverse=True)
            for i, code in enumerate(codes):
                sizes = np.diff(np.r_[np.flatnonzero(code[:-1]), k])
                groups.append((some[which.ravel() == i], sizes, bool(code[-1])))
        return groups

    def _entries(self, entities: Int, sizes: Int, breakable: bool) -> tuple[Int, Int, Float]:
        """Rows, columns and values of B on some entities whose bodies have `sizes` copies each."""
        shared = self.shared
        contrasts = _contrasts(sizes)
        k = len(contrasts) + 1
        entity, p = _expand(entities, shared.nodes[entities])
        first = self.first[entity] + p * 2 * (k - 1)
        identity = np.broadcast_to(np.eye(2), (len(entity), 2, 2))
        frame = _frames(self._normals(entity, p)) if breakable else identity
        rows, columns, values = [], [], []
        for j in range(k):
            base = self.base[shared.pointer[entity] + j]
            local = base >= 0
            dof = 2 * (base + p)[local]
            for r in np.flatnonzero(contrasts[:, j]):
                turn = frame if r == k - 2 else identity
                rows.append(
                    np.broadcast_to((first[local] + 2 * r)[:, None, None] + [[0], [1]], (len(dof), 2, 2)).ravel()
                )
                columns.append(np.broadcast_to(dof[:, None, None] + [[0, 1]], (len(dof), 2, 2)).ravel())
                values.append((contrasts[r, j] * turn[local]).ravel())
        return np.concatenate(rows), np.concatenate(columns), np.concatenate(values)

    def _normals(self, entity: Int, p: Int) -> Float:
        """Normals at fine node p of the entities; along an arc they turn evenly."""
        shared, m = self.shared, self.lattice.intervals
        s = np.where(shared.is_edge[entity], (p + 1) / m, 0.0)
        a, b = shared.normal[entity, 0], shared.normal[entity, 1]
        angle = s * np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(axis=1))
        cos, sin = np.cos(angle), np.sin(angle)
        return np.stack([cos * a[:, 0] - sin * a[:, 1], sin * a[:, 0] + cos * a[:, 1]], axis=1)

    def node_rows(self, owned: tuple[int, int]) -> tuple[Int, Int]:
        """First owned row and number of rows of each fine node whose rows are owned."""
        shared = self.shared
        mine = np.flatnonzero((shared.first_row >= owned[0]) & (shared.first_row < owned[1]))
        size = 2 * (shared.copies[mine] - 1)
        entity, p = _expand(np.arange(len(mine)), shared.nodes[mine])
        return shared.first_row[mine][entity] - owned[0] + p * size[entity], size[entity]

    def interface_nodes(self, owned: tuple[int, int]) -> InterfaceNodes:
        """The breakable nodes whose rows are owned."""
        shared, m = self.shared, self.lattice.intervals
        mine = (shared.first_row >= owned[0]) & (shared.first_row < owned[1])
        entity, p = _expand(np.flatnonzero(mine & (shared.fibre >= 0)), shared.nodes[mine & (shared.fibre >= 0)])
        k = shared.copies[entity]
        # Row sums of the interface mass matrix: halves for linear, Simpson's rule for quadratic elements.
        quadratic = self.lattice.triangles.shape[1] == 6
        share = np.where((p % 2 == 0) & shared.is_edge[entity], 4, 2) / 3 if quadratic else np.ones(len(p))
        share = share * np.where(shared.is_edge[entity], 1.0, 0.5)
        positions = np.concatenate([_class_points(s) for s in self.subdomains] or [np.zeros((0, 2))])
        return InterfaceNodes(
            row=shared.first_row[entity] - owned[0] + (p + 1) * 2 * (k - 1) - 2,
            points=positions[self.base[shared.pointer[entity + 1] - 1] + p],
            normal=self._normals(entity, p),
            length=share * shared.length[entity] / m,
            fibre=shared.fibre[entity],
            vertex=~shared.is_edge[entity],
            precracked=shared.precracked[entity],
        )


def _class_points(subdomain: Subdomain) -> Float:
    """(c, 2) a plane position of each class."""
    points = np.empty((subdomain.mesh.n_classes, 2))
    points[subdomain.mesh.node_class] = subdomain.mesh.points
    return points


def _expand(entities: Int, nodes: Int) -> tuple[Int, Int]:
    """Entity and position of every fine node."""
    ends = np.cumsum(nodes)
    p = np.arange(ends[-1] if len(ends) else 0) - np.repeat(ends - nodes, nodes)
    return np.repeat(entities, nodes), p


def _contrasts(sizes: Int) -> Float:
    """(k - 1, k) orthonormal contrasts (Helmert) within each body, then differences of the bodies' means."""
    k = int(sizes.sum())
    ends = np.cumsum(sizes)
    rows = []
    for end, size in zip(ends, sizes, strict=True):
        for i in range(1, size):
            row = np.zeros(k)
            row[end - size : end - size + i], row[end - size + i] = 1.0, -i
            rows.append(row / np.sqrt(i * (i + 1)))
    for (b, nb), (c, nc) in zip(zip(ends, sizes, strict=True), zip(ends[1:], sizes[1:], strict=True), strict=False):
        row = np.zeros(k)
        row[b - nb : b], row[c - nc : c] = 1.0 / nb, -1.0 / nc
        rows.append(row)
    return np.array(rows)


def _frames(normal: Float) -> Float:
    """(i, 2, 2) rows n and t."""
    return np.stack([normal, np.stack([-normal[:, 1], normal[:, 0]], axis=1)], axis=1)
