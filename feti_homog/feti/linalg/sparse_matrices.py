"""Sparse matrices: sums of dense blocks, symmetric scaling, and sums over ranks."""

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy.sparse import csr_matrix, diags

from feti_homog.feti.thresholds import MAX_BUFFERED_ENTRIES
from feti_homog.system.parallel import distributed_arrays
from feti_homog.typing import Bool, Float, Int, Int32


class DenseBlockSum:
    """A sparse sum of dense blocks.

    Blocks wait in a buffer until the buffer has more than `max_buffered_entries` entries and more entries than the sum.
    So the memory is at most about twice the sum, and each copy of the sum doubles its entries.
    """

    def __init__(self, shape: tuple[int, int], max_buffered_entries: int = MAX_BUFFERED_ENTRIES) -> None:
        self._sum = csr_matrix(shape)
        self._max_buffered_entries = max_buffered_entries
        # Rows of each block, entry counts of the rows, columns and values.
        self._buffer: list[tuple[Int, Int, Int32, Float]] = []
        self._buffered_entries = 0

    def add(self, rows: Int, columns: Int, values: Float) -> None:
        """Add a dense block of `values` (rows, columns)."""
        counts, wide = np.full(len(rows), len(columns)), np.tile(columns.astype(np.int32), len(rows))
        self._buffer.append((rows, counts, wide, values.ravel()))
        self._buffered_entries += values.size
        if self._buffered_entries > max(self._max_buffered_entries, self._sum.nnz):
            self._flush()

    def matrix(self) -> csr_matrix:
        """Return the sum of all blocks."""
        self._flush()
        return self._sum

    def _flush(self) -> None:
        """Add the buffered blocks to the sum."""
        if not self._buffer:
            return
        rows, counts, columns, values = (np.concatenate(part) for part in zip(*self._buffer, strict=True))
        self._buffer, self._buffered_entries = [], 0
        m, n = self._sum.shape
        # A product sums faster than a conversion from coordinates, which sorts.
        stacked = csr_matrix((values, columns, np.r_[0, np.cumsum(counts)]), shape=(len(rows), n))
        place = csr_matrix((np.ones(len(rows)), (rows, np.arange(len(rows)))), shape=(m, len(rows)))
        # A sum copies both terms, even if one is empty.
        self._sum = self._sum + place @ stacked if self._sum.nnz else csr_matrix(place @ stacked)


def scaled(A: csr_matrix, weights: Float) -> csr_matrix:
    """Compute diag(weights) A diag(weights) for weights (n,), in the pattern of A (n, n).

    Products with diagonal matrices would compute the pattern again.
    """
    data = A.data * weights[A.indices] * np.repeat(weights, np.diff(A.indptr))
    # Copies of the indices: a sort of one matrix must not shuffle the other.
    return csr_matrix((data, A.indices.copy(), A.indptr.copy()), shape=A.shape)


def assemble_owned_rows(
    comm: MPI.Intracomm, local: csr_matrix, rows: Int, columns: Int, owned: tuple[int, int]
) -> csr_matrix:
    """Sum local matrices over ranks, and return the owned rows.  Collective.

    Args:
        local: (r, c) this rank's contribution.
        rows, columns: (r,) and (c,) global numbers of its rows and columns.
        owned: numbers of rows and columns that this rank owns.

    Returns:
        (owned rows, all columns).
    """
    A = _assemble(comm, local, rows, columns, owned)
    indptr, indices, values = A.getValuesCSR()
    sizes = A.getLocalSize()[0], A.getSize()[1]
    A.destroy()
    return csr_matrix((values, indices, indptr), shape=sizes)


def gathered_sum(comm: MPI.Intracomm, part: csr_matrix, unknowns: Int, total: int) -> csr_matrix:
    """Sum `part` (u, u) on the `unknowns` (u,) over ranks into (n, n), on every rank.  Collective."""
    entries = part.tocoo()
    triples = unknowns[entries.row], unknowns[entries.col], entries.data
    rows, columns, values = (np.concatenate(parts) for parts in zip(*comm.allgather(triples), strict=True))
    return csr_matrix((values, (rows, columns)), shape=(total, total))


def add_shared_rows(comm: MPI.Intracomm, local: csr_matrix, rows: Int, is_shared_row: Bool, owned: int) -> csr_matrix:
    """Add the entries of other ranks in shared rows to `local`.  Collective.

    Args:
        local: (r, n) this rank's contribution; the n columns are common to all ranks.
        rows: (r,) global row numbers.
        is_shared_row: (r,) whether other ranks have the row, too; only shared rows are sent.
        owned: number of rows that this rank owns.

    Returns:
        (r, n) local rows of the sum over ranks.
    """
    if comm.size == 1:
        return local
    shared, n = local[is_shared_row], local.shape[1]
    used, indices = np.unique(shared.indices, return_inverse=True)
    narrow = csr_matrix((shared.data, indices, shared.indptr), shape=(shared.shape[0], len(used)))
    A = _assemble(comm, narrow, rows[is_shared_row], used, (owned, _even_share(comm, n)))
    # Descending order: PETSc 3.18 mixes up the columns if every rank requests all rows in ascending order.
    asked_rows = PETSc.IS().createGeneral(rows[is_shared_row][::-1].astype(PETSc.IntType), comm=PETSc.COMM_SELF)
    all_columns = PETSc.IS().createStride(n, 0, 1, comm=PETSc.COMM_SELF)
    sums = A.createSubMatrices(asked_rows, all_columns)[0]
    indptr, indices, data = sums.getValuesCSR()
    for petsc_object in (sums, A, asked_rows, all_columns):
        petsc_object.destroy()
    at = np.flatnonzero(is_shared_row)[::-1]
    place = csr_matrix((np.ones(len(at)), (at, np.arange(len(at)))), shape=(len(rows), len(at)))
    unshared = diags((~is_shared_row).astype(float)) @ local
    return unshared + place @ csr_matrix((data, indices, indptr), shape=(len(at), n))


def assemble_distributed(comm: MPI.Intracomm, part: csr_matrix, numbers: Int, total: int) -> PETSc.Mat:
    """Sum parts (k, k) over ranks into a matrix (n, n) with evenly distributed rows.  Collective.

    Rows and columns of the parts have the `numbers` (k,).
    """
    share = _even_share(comm, total)
    return _assemble(comm, part, numbers, numbers, (share, share))


def allreduce_sparse(comm: MPI.Intracomm, part: csr_matrix) -> csr_matrix:
    """Sum small sparse square matrices over ranks, on every rank.  Collective."""
    if comm.size == 1:
        return part
    some = np.union1d(np.flatnonzero(np.diff(part.indptr)), part.indices)
    A = assemble_distributed(comm, part[some][:, some], some, part.shape[0])
    parts = A.getValuesCSR()
    A.destroy()
    counts, entries = (np.array(comm.allgather(n)) for n in (len(parts[0]) - 1, len(parts[1])))
    lengths = distributed_arrays.allgather_rows(comm, np.diff(parts[0]), counts)
    indices, values = (distributed_arrays.allgather_rows(comm, x, entries) for x in parts[1:])
    return csr_matrix((values, indices, np.concatenate([[0], np.cumsum(lengths)])), shape=part.shape)


def _even_share(comm: MPI.Intracomm, n: int) -> int:
    """Return the row count of this rank in an even distribution of n rows."""
    return n // comm.size + (comm.rank < n % comm.size)


def _assemble(comm: MPI.Intracomm, local: csr_matrix, rows: Int, columns: Int, owned: tuple[int, int]) -> PETSc.Mat:
    """Sum local matrices into a distributed PETSc matrix; arguments as of `assemble_owned_rows`."""
    maps = [PETSc.LGMap().create(i.astype(PETSc.IntType), comm=comm) for i in (rows, columns)]
    sizes = tuple((n, comm.allreduce(n)) for n in owned)
    A = PETSc.Mat().createIS(sizes, lgmapr=maps[0], lgmapc=maps[1], comm=comm)
    csr = csr_matrix(local)
    part = PETSc.Mat().createAIJ(csr.shape, csr=(csr.indptr, csr.indices, csr.data), comm=PETSc.COMM_SELF)
    A.setISLocalMat(part)
    A.assemble()
    assembled = PETSc.Mat()
    A.convert(PETSc.Mat.Type.AIJ, assembled)
    for petsc_object in (A, part, *maps):
        petsc_object.destroy()
    return assembled
