"""The jump operator B on one rank, the layout of the multipliers, interface springs, and node blocks.

Of the k copies of a fine node, copies within one body are glued in x and y by orthonormal contrasts and can never
part.  A body, such as a fibre, and the one around it are glued by one pair of rows (n, t) between the means of their
copies; this bond can break.  So B has full row rank, n.(u_outer - u_inner) is the gap, and a multiplier is the nodal
force that the faces exert on each other: tension is positive.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy.sparse import csr_matrix

from feti_homog.fem import PLANE, Problem
from feti_homog.feti.decomposition.constraint_layout import ConstraintLayout, Meshed, expand
from feti_homog.feti.decomposition.shared_entities import SharedEntities
from feti_homog.feti.linalg.sparse_matrices import assemble_owned_rows
from feti_homog.feti.thresholds import KEPT_EXCHANGES
from feti_homog.mesh import ReferenceLattice
from feti_homog.typing import Float, Int


@dataclass(frozen=True)
class InterfaceSprings:
    """Springs at all bonded nodes: traction = stiffness x jump, in tension and compression.

    Attributes:
        stiffness: for each interface of the case stress per opening and per slip, or per slip along the fibre;
            infinite ones are glue.
        soften: their compliance may grow while the cell is loaded.
    """

    stiffness: tuple[tuple[float, ...], ...]
    soften: bool = False

    def compliance(self, jump_operator: JumpOperator) -> Float:
        """Compute C = 1 / (k l) (owned rows,) on interface rows with tributary lengths l, else 0."""
        nodes, C = jump_operator.nodes, np.zeros(jump_operator.owned[1] - jump_operator.owned[0])
        for component, stiffness in enumerate(zip(*self.stiffness, strict=True)):
            C[nodes.row + component] = 1.0 / (np.array(stiffness)[nodes.pair] * nodes.length)
        return C


GLUE = InterfaceSprings(())


class JumpOperator:
    """The jump operator B on the local subdomains, and the layout of the multipliers.

    Attributes:
        comm: of all ranks.
        problem: displacements and unit loads; ranks without subdomains need it.
        components: rows of a vector constraint.
        B: (local rows, local dofs) signed, rotated entries; a local row is one that a local dof takes part in.
        rows: global number of each local row.
        node_rows: first owned row and row count for each fine node that this rank owns.
        shared_dofs: number of displacements at nodes that subdomains share, on all ranks.
        nodes: the interface nodes that this rank owns.
        outer_copies: local rows of interface nodes whose outer copy is on this rank, and the copies, as
            `ConstraintLayout.outer_copies`.
        copies: (local rows, 2) node copies in the outer and the inner body of a row; 0 within a body.
        inside: (local rows,) the inner body, usually the fibre; -1 within a body.
        owned: first global row of this rank and the one after its last.
        global_rows: number of rows on all ranks.
        shared: the vertices and edges that the rows belong to.
        is_shared_row: whether other ranks have each local row too.
        vector: a multiplier vector to duplicate.
    """

    def __init__(
        self,
        comm: MPI.Intracomm,
        shared: SharedEntities,
        subdomains: Sequence[Meshed],
        lattice: ReferenceLattice,
        problem: Problem = PLANE,
    ) -> None:
        self.comm, layout = comm, ConstraintLayout(shared, subdomains, lattice, problem.components)
        self.problem, self.components = problem, layout.components
        self.shared, self._first, self._count = shared, layout.first, layout.count
        elsewhere = np.bincount(np.repeat(np.arange(len(shared.key)), shared.copies), layout.base < 0, len(shared.key))
        self.is_shared_row = np.repeat(elsewhere > 0, layout.count)
        self.owned = layout.owned
        self.global_rows = layout.components * shared.constraints
        self.rows, self.B = layout.rows, layout.matrix()
        self.node_rows = layout.node_rows()
        self.shared_dofs = int(comm.allreduce(layout.components * len(self.node_rows[0])))
        self.nodes = layout.interface_nodes()
        self.outer_copies = layout.outer_copies()
        self.copies, self.inside = layout.facing()
        self.vector = PETSc.Vec().createMPI((self.owned[1] - self.owned[0], self.global_rows), comm=comm)
        self._exchanges: dict[int, _Exchange] = {}

    def rows_of(self, entities: Int) -> Int:
        """Return the local rows of shared entities, one entity after the other."""
        entity, p = expand(entities, self._count[entities])
        return np.asarray(self._first[entity] + p)

    def gather(self, owned: Float) -> Float:
        """Return the local rows of distributed vectors (owned rows,) or (owned rows, k)."""
        return self._exchange(owned).gather(owned)

    def sum(self, local: Float) -> Float:
        """Return the owned rows of `local`, (local rows,) or (local rows, k), summed over ranks."""
        return self._exchange(local).sum(local)

    def from_outer(self, numbers: Int) -> Int:
        """Send numbers of outer fine nodes to the ranks that own the interface nodes (k,).  Collective.

        Each rank passes one number for each of its fine nodes.
        """
        rows, copies = self.outer_copies
        local = np.zeros(len(self.rows))
        local[rows] = numbers[copies]  # exact, as integers below 2^53 are
        return self.sum(local)[self.nodes.row].astype(np.int64)

    def _exchange(self, x: Float) -> _Exchange:
        """Return the scatter for vectors with as many columns as x; the last KEPT_EXCHANGES are cached."""
        columns = x.size // len(x) if len(x) else int(np.prod(x.shape[1:]))
        exchange = self._exchanges.pop(columns, None) or _Exchange(self.vector, self.rows, columns)
        self._exchanges[columns] = exchange
        if len(self._exchanges) > KEPT_EXCHANGES:
            self._exchanges.pop(next(iter(self._exchanges))).destroy()
        return exchange


class _Exchange:
    """Scatters between the owned and the local rows of vectors with k columns; a copy where both are equal."""

    def __init__(self, vector: PETSc.Vec, rows: Int, columns: int) -> None:
        self._same = vector.comm.size == 1 and np.array_equal(rows, np.arange(len(rows)))
        if self._same:
            return
        sizes = tuple(columns * n for n in vector.getSizes())
        self._owned = PETSc.Vec().createMPI(sizes, bsize=columns, comm=vector.comm)
        self._local = PETSc.Vec().createSeq(columns * len(rows), bsize=columns)
        index_set = PETSc.IS().createBlock(columns, rows.astype(PETSc.IntType), comm=PETSc.COMM_SELF)
        self._scatter = PETSc.Scatter().create(self._owned, index_set, self._local, None)
        index_set.destroy()

    def gather(self, owned: Float) -> Float:
        """Return the local rows of x (owned rows,) or (owned rows, k)."""
        if self._same:
            return owned
        self._owned.getArray()[:] = owned.ravel()
        self._scatter.scatter(self._owned, self._local)
        local: Float = self._local.getArray(readonly=True).reshape(-1, *owned.shape[1:])
        return local.copy()

    def sum(self, local: Float) -> Float:
        """Return the owned rows of x (local rows,) or (local rows, k), summed over ranks."""
        if self._same:
            return local
        self._owned.zeroEntries()
        self._local.getArray()[:] = local.ravel()
        self._scatter.scatter(self._local, self._owned, addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        owned: Float = self._owned.getArray(readonly=True).reshape(-1, *local.shape[1:])
        return owned.copy()

    def destroy(self) -> None:
        """Free vectors and scatter.  Collective."""
        if not self._same:
            for petsc_object in (self._scatter, self._owned, self._local):
                petsc_object.destroy()


class NodeBlocks:
    """A block-diagonal matrix with one dense block for the multipliers at each fine node.

    Attributes:
        rows: number of rows that this rank owns.
        blocks: for each block size k the owned rows (b, k) and entries (b, k, k) of the b blocks.
    """

    def __init__(self, comm: MPI.Intracomm, jump_operator: JumpOperator, local: csr_matrix) -> None:
        """Sum `local` (local rows, local rows) over ranks and keep the owned rows.  Collective."""
        first, last = jump_operator.owned
        matrix = assemble_owned_rows(comm, local, jump_operator.rows, jump_operator.rows, (last - first, last - first))
        entries = matrix[:, first:last].tocoo()
        starts, sizes = jump_operator.node_rows
        self.rows = last - first
        self.blocks: list[tuple[Int, Float]] = []
        block = np.repeat(np.arange(len(starts)), sizes)[entries.row]
        for size in np.unique(sizes):
            some = np.flatnonzero(sizes == size)
            number = np.full(len(starts), -1)
            number[some] = np.arange(len(some))
            mine = number[block] >= 0
            number_of = block[mine]
            dense = np.zeros((len(some), size, size))
            dense[number[number_of], entries.row[mine] - starts[number_of], entries.col[mine] - starts[number_of]] = (
                entries.data[mine]
            )
            self.blocks.append((starts[some][:, None] + np.arange(size), dense))

    def inverse(self, active: Float) -> csr_matrix:
        """Invert the part where `active` (owned rows,) is 1; the rest of (owned rows, owned rows) is 0."""
        rows, columns, values = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)], [np.zeros(0)]
        for at, dense in self.blocks:
            mask = active[at]
            both = mask[:, :, None] * mask[:, None, :]
            unit = np.eye(at.shape[1]) * (1 - mask)[:, :, None]
            rows.append(np.broadcast_to(at[:, :, None], dense.shape).ravel())
            columns.append(np.broadcast_to(at[:, None, :], dense.shape).ravel())
            inverse = np.asarray(np.linalg.inv(both * dense + unit), float)
            values.append((both * inverse).ravel())
        shape = (self.rows, self.rows)
        return csr_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=shape)
