"""The jump operator B on one rank, the layout of the multipliers, interface springs, and node blocks.

A fine node has k copies in the subdomains.  Copies within one body are glued in all components by orthonormal
contrasts, and can never part.  An inner body, such as a fibre, and the body around it are glued between the means of
their copies, in the plane by two rows along the normal n and the tangent; this bond can break.  So B has full row rank,
n.(u_outer - u_inner) is the gap, and a normal multiplier is the nodal force between the faces, positive in tension.
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
    """The springs at all bonded nodes: traction = stiffness x jump, in tension and compression.

    Attributes:
        stiffness: for every interface of the case, the stiffness in opening and slip, or in slip along the fibres, as
            stress per length; inf is rigid.  Without springs, the tuple is empty.
        soften: whether the compliance may grow during the run.
    """

    stiffness: tuple[tuple[float, ...], ...]
    soften: bool = False

    def compliance(self, jump_operator: JumpOperator) -> Float:
        """Compute the compliance C = 1 / (k l) (owned rows,), stiffness k, tributary length l; 0 without springs."""
        nodes, C = jump_operator.nodes, np.zeros(jump_operator.owned[1] - jump_operator.owned[0])
        for component, stiffness in enumerate(zip(*self.stiffness, strict=True)):
            C[nodes.row + component] = 1.0 / (np.array(stiffness)[nodes.pair] * nodes.length)
        return C


GLUE = InterfaceSprings(())


class JumpOperator:
    """The jump operator B on the local subdomains, and the layout of the multipliers.

    Attributes:
        comm: communicator of all ranks.
        problem: displacement components and unit loads, also on ranks without subdomains.
        components: number of rows of a vector constraint.
        B: (local rows, local dofs) signed and rotated entries; local rows are all rows with an entry at a local dof.
        rows: (local rows,) global row numbers.
        node_rows: as returned by `ConstraintLayout.node_rows`.
        shared_dofs: number of displacements at nodes that subdomains share, on all ranks.
        nodes: interface nodes that this rank owns.
        outer_copies: as returned by `ConstraintLayout.outer_copies`.
        copies, inside: as returned by `ConstraintLayout.facing`.
        owned: half-open range of the global rows that this rank owns.
        global_rows: number of rows on all ranks.
        shared: vertices and edges to which the rows belong.
        is_shared_row: (local rows,) whether another rank has the row, too.
        vector: PETSc vector with the layout of the multipliers.
    """

    def __init__(
        self,
        comm: MPI.Intracomm,
        shared: SharedEntities,
        subdomains: Sequence[Meshed],
        lattice: ReferenceLattice,
        problem: Problem = PLANE,
    ) -> None:
        """Assemble B, and find the interface nodes of this rank.  Collective."""
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
        """Return the local rows of shared entities (e,), one entity after the other."""
        entity, p = expand(entities, self._count[entities])
        return np.asarray(self._first[entity] + p)

    def gather(self, owned: Float) -> Float:
        """Gather the local rows of x (owned rows,) or (owned rows, k); x itself if layouts agree.  Collective."""
        return self._exchange(owned).gather(owned)

    def sum(self, local: Float) -> Float:
        """Sum x (local rows,) or (local rows, k) to owned rows; return x itself if layouts agree.  Collective."""
        return self._exchange(local).sum(local)

    def from_outer(self, numbers: Int) -> Int:
        """Send the numbers of outer node copies to the owners of interface nodes.  Collective.

        Every rank passes `numbers` (local fine nodes,), and receives the numbers (k,) at its interface nodes.
        """
        rows, copies = self.outer_copies
        local = np.zeros(len(self.rows))
        local[rows] = numbers[copies]  # integers below 2^53 are exact
        return self.sum(local)[self.nodes.row].astype(np.int64)

    def _exchange(self, x: Float) -> _Exchange:
        """Return the scatter for the column count of x, from a cache of KEPT_EXCHANGES scatters.  Collective."""
        columns = x.size // len(x) if len(x) else int(np.prod(x.shape[1:]))
        exchange = self._exchanges.pop(columns, None) or _Exchange(self.vector, self.rows, columns)
        self._exchanges[columns] = exchange
        if len(self._exchanges) > KEPT_EXCHANGES:
            self._exchanges.pop(next(iter(self._exchanges))).destroy()
        return exchange


class _Exchange:
    """The PETSc scatter between owned and local rows for k columns; no operation if both layouts agree."""

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
        """Gather the local rows of x (owned rows,) or (owned rows, k); x itself if layouts agree.  Collective."""
        if self._same:
            return owned
        self._owned.getArray()[:] = owned.ravel()
        self._scatter.scatter(self._owned, self._local)
        local: Float = self._local.getArray(readonly=True).reshape(-1, *owned.shape[1:])
        return local.copy()

    def sum(self, local: Float) -> Float:
        """Sum x (local rows,) or (local rows, k) to owned rows; return x itself if layouts agree.  Collective."""
        if self._same:
            return local
        self._owned.zeroEntries()
        self._local.getArray()[:] = local.ravel()
        self._scatter.scatter(self._local, self._owned, addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        owned: Float = self._owned.getArray(readonly=True).reshape(-1, *local.shape[1:])
        return owned.copy()

    def destroy(self) -> None:
        """Free the vectors and the scatter.  Collective."""
        if not self._same:
            for petsc_object in (self._scatter, self._owned, self._local):
                petsc_object.destroy()


class NodeBlocks:
    """A block-diagonal matrix, with one dense block for the multipliers at every fine node.

    Attributes:
        rows: number of owned rows.
        blocks: for every block size k, the owned rows (b, k) and the entries (b, k, k) of b blocks.
    """

    def __init__(self, comm: MPI.Intracomm, jump_operator: JumpOperator, local: csr_matrix) -> None:
        """Sum `local` (local rows, local rows) over ranks, and store the owned blocks.  Collective."""
        first, last = jump_operator.owned
        matrix = assemble_owned_rows(comm, local, jump_operator.rows, jump_operator.rows, (last - first, last - first))
        entries = matrix[:, first:last].tocoo()
        starts, sizes = jump_operator.node_rows
        self.rows = last - first
        self.blocks: list[tuple[Int, Float]] = []
        block = np.repeat(np.arange(len(starts)), sizes)[entries.row]
        for size in np.unique(sizes):
            chosen = np.flatnonzero(sizes == size)
            number = np.full(len(starts), -1)
            number[chosen] = np.arange(len(chosen))
            mine = number[block] >= 0
            b = block[mine]
            dense = np.zeros((len(chosen), size, size))
            dense[number[b], entries.row[mine] - starts[b], entries.col[mine] - starts[b]] = entries.data[mine]
            self.blocks.append((starts[chosen][:, None] + np.arange(size), dense))

    def inverse(self, active: Float) -> csr_matrix:
        """Return the block inverse (owned rows, owned rows) on rows where `active` (owned rows,) is 1, 0 elsewhere."""
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
