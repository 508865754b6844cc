"""Sparse matrices: sums of dense blocks, sums over ranks, and a solver for such sums."""

from collections.abc import Iterable

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy.sparse import csr_matrix, diags

from feti_homog.feti.linalg.sparse_direct import factored, is_direct, power_of_two, sequential, solve_columns
from feti_homog.feti.thresholds import MAX_BUFFERED_ENTRIES, REPLICATED_UNKNOWNS
from feti_homog.system.parallel import distributed_arrays
from feti_homog.typing import Bool, Float, Int, Int32


def sum_of_blocks(
    shape: tuple[int, int], blocks: Iterable[tuple[Int, Int, Float]], max_buffered_entries: int = MAX_BUFFERED_ENTRIES
) -> csr_matrix:
    """Sum dense blocks (rows (r,), columns (c,), values (r, c)) into a sparse matrix.

    Blocks wait in a buffer, until it holds more entries than `max_buffered_entries` and than the sum.  So the memory is
    at most about twice the sum, and the sum is copied only when its entries have doubled.
    """
    total, buffer, buffered_entries = csr_matrix(shape), [], 0
    for rows, columns, values in blocks:
        wide = np.tile(columns.astype(np.int32), len(rows))
        buffer.append((rows, np.full(len(rows), len(columns)), wide, values.ravel()))
        buffered_entries += values.size
        if buffered_entries > max(max_buffered_entries, total.nnz):
            total, buffer, buffered_entries = _with_buffered(total, buffer), [], 0
    return _with_buffered(total, buffer) if buffer else total


def _with_buffered(total: csr_matrix, buffer: list[tuple[Int, Int, Int32, Float]]) -> csr_matrix:
    """Return `total` plus buffered blocks; a block has rows, entry counts of the rows, columns and values."""
    rows, counts, columns, values = (np.concatenate(part) for part in zip(*buffer, strict=True))
    m, n = total.shape
    # A product adds faster than a conversion from coordinates, which sorts.
    stacked = csr_matrix((values, columns, np.r_[0, np.cumsum(counts)]), shape=(len(rows), n))
    place = csr_matrix((np.ones(len(rows)), (rows, np.arange(len(rows)))), shape=(m, len(rows)))
    # A sum copies both terms, even if one is empty.
    return total + place @ stacked if total.nnz else csr_matrix(place @ stacked)


def scaled(A: csr_matrix, weights: Float) -> csr_matrix:
    """Compute diag(w) A diag(w) for w = `weights` (n,), in the pattern of A (n, n).

    Products with diagonal matrices would compute the pattern again.
    """
    data = A.data * weights[A.indices] * np.repeat(weights, np.diff(A.indptr))
    # Copies of the indices, because a sort of one matrix must not shuffle the other.
    return csr_matrix((data, A.indices.copy(), A.indptr.copy()), shape=A.shape)


def assemble_owned_rows(
    comm: MPI.Intracomm, local: csr_matrix, rows: Int, columns: Int, owned: tuple[int, int]
) -> csr_matrix:
    """Sum local matrices over ranks; return the owned rows (owned rows, all columns).  Collective.

    Args:
        local: (r, c) contribution of this rank.
        rows, columns: (r,) and (c,) global numbers of the rows and columns of `local`.
        owned: numbers of rows and of columns that this rank owns.
    """
    A = _assemble(comm, local, rows, columns, owned)
    indptr, indices, values = A.getValuesCSR()
    sizes = A.getLocalSize()[0], A.getSize()[1]
    A.destroy()
    return csr_matrix((values, indices, indptr), shape=sizes)


def add_shared_rows(comm: MPI.Intracomm, local: csr_matrix, rows: Int, is_shared_row: Bool, owned: int) -> csr_matrix:
    """Sum local matrices over ranks; return the sum's local rows (r, n), on one rank `local` itself.  Collective.

    Args:
        local: (r, n) contribution of this rank; all ranks have the same n columns.
        rows: (r,) global row numbers.
        is_shared_row: (r,) whether another rank has the row, too; only shared rows are sent.
        owned: number of rows that this rank owns.
    """
    if comm.size == 1:
        return local
    shared, n = local[is_shared_row], local.shape[1]
    used, indices = np.unique(shared.indices, return_inverse=True)
    narrow = csr_matrix((shared.data, indices, shared.indptr), shape=(shared.shape[0], len(used)))
    A = _assemble(comm, narrow, rows[is_shared_row], used, (owned, PETSc.Sys.splitOwnership(n, comm=comm)[0]))
    # Descending order, because PETSc 3.18 mixes up the columns if every rank requests all rows in ascending order.
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
    """Sum parts (k, k) over ranks into a PETSc matrix (n, n), n = `total`.  Collective.

    Rows and columns of `part` have the global `numbers` (k,); the rows of the sum are evenly distributed.
    """
    share = PETSc.Sys.splitOwnership(total, comm=comm)[0]
    return _assemble(comm, part, numbers, numbers, (share, share))


def allreduce_sparse(comm: MPI.Intracomm, part: csr_matrix) -> csr_matrix:
    """Sum sparse matrices (n, n) over ranks, on every rank; on one rank return `part`.  Collective."""
    if comm.size == 1:
        return part
    numbers = np.union1d(np.flatnonzero(np.diff(part.indptr)), part.indices)
    A = assemble_distributed(comm, part[numbers][:, numbers], numbers, part.shape[0])
    indptr, columns, data = A.getValuesCSR()
    A.destroy()
    counts, entries = (np.array(comm.allgather(n)) for n in (len(indptr) - 1, len(columns)))
    lengths = distributed_arrays.allgather_rows(comm, np.diff(indptr), counts)
    indices, values = (distributed_arrays.allgather_rows(comm, x, entries) for x in (columns, data))
    return csr_matrix((values, indices, np.concatenate([[0], np.cumsum(lengths)])), shape=part.shape)


def _assemble(comm: MPI.Intracomm, local: csr_matrix, rows: Int, columns: Int, owned: tuple[int, int]) -> PETSc.Mat:
    """Sum local matrices into a distributed PETSc matrix; arguments are as in `assemble_owned_rows`.  Collective."""
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


class DistributedSolver:
    """A solver X = A^-1 B for definite matrices A (n, n) that are summed over ranks.

    Up to n = REPLICATED_UNKNOWNS, every rank factors the whole matrix, by CHOLMOD; above, all ranks factor the matrix
    together, by MUMPS.  Options with the prefix replace these solvers; with `ksp_type` or `pc_type`, ranks solve
    together for any n.
    """

    def __init__(self, comm: MPI.Intracomm, total: int, prefix: str, most_whole: int = REPLICATED_UNKNOWNS) -> None:
        """Choose the solver for n = `total`; `most_whole` replaces REPLICATED_UNKNOWNS."""
        self.comm, self.total, self._prefix = comm, total, prefix
        self._ksp: PETSc.KSP | None = None
        options = PETSc.Options(prefix)
        together = total > most_whole or any(options.hasName(name) for name in ("ksp_type", "pc_type"))
        self.is_distributed = comm.size > 1 and together

    def factor(self, unknowns: Int, part: csr_matrix, near_kernel: Float | None = None) -> None:
        """Sum and factor A, and free the previous factor.  Collective.

        Args:
            unknowns: (u,) global numbers of the local unknowns, ascending; ranks may have unknowns in common.
            part: (u, u) contribution of this rank.
            near_kernel: (u, c) vectors with little energy, for multigrid.

        Raises:
            LinAlgError: A is not positive definite on a rank (rounding may differ between processors); all ranks raise.
            MemoryError, CaseError, FetiHomogError: as in `factored`.
        """
        self.destroy()
        error = None
        self._unknowns = unknowns
        try:
            if self.is_distributed:
                matrix = assemble_distributed(self.comm, part, unknowns, self.total)
            else:
                entries = part.tocoo()
                triples = self.comm.allgather((unknowns[entries.row], unknowns[entries.col], entries.data))
                rows, columns, values = (np.concatenate(parts) for parts in zip(*triples, strict=True))
                matrix = sequential(csr_matrix((values, (rows, columns)), shape=(self.total, self.total)))
            self._scale = power_of_two(matrix.getDiagonal().getArray(readonly=True), self.comm)
            matrix.scale(self._scale)
            library = PETSc.Mat.SolverType.MUMPS if self.is_distributed else PETSc.Mat.SolverType.CHOLMOD
            # The vectors need all ranks; the factorization may fail on only one rank.
            self._x, self._b = matrix.createVecs()
            if near_kernel is not None:
                # A basis (n, m), without zero columns and equal on all ranks.
                mean = self._sum(near_kernel) / np.maximum(self._sum(np.ones((len(near_kernel), 1))), 1.0)
                basis = np.linalg.qr(mean[:, mean.any(axis=0)])[0][slice(*matrix.getOwnershipRange())]
                vectors = [matrix.createVecLeft() for _ in basis.T]
                for vector, values in zip(vectors, basis.T, strict=True):
                    vector.setArray(values)
                space = PETSc.NullSpace().create(vectors=vectors, comm=matrix.comm)
                if vectors:
                    matrix.setNearNullSpace(space)
                # The matrix has references to these objects, which its destructor frees.
                for petsc_object in (space, *vectors):
                    petsc_object.destroy()
            self._ksp = factored(matrix, self._prefix, library)
        except np.linalg.LinAlgError as caught:
            error = caught
        if self.comm.allreduce(error is not None, MPI.LOR):
            # PETSc's garbage collection frees the KSP: a rank that failed alone cannot take part in `destroy`.
            self._ksp = None
            raise np.linalg.LinAlgError(f"coarse matrix: singular, {error or 'on another rank'}") from error

    def solve(self, B: Float) -> Float:
        """Solve A X = sum of B over ranks; return the local unknowns (u,) or (u, k).  Collective.

        B (u,) or (u, k) is the part of this rank.  Call `factor` first; raises like `solve_columns`.
        """
        assert self._ksp is not None, "no matrix is factored"
        right = self._sum(B if B.ndim == 2 else B[:, None])[slice(*self._b.getOwnershipRange())]
        X = solve_columns(self._ksp, self._x, self._b, right)
        X *= self._scale
        if self.is_distributed:
            X = distributed_arrays.allgather_rows(self.comm, X, np.diff(self._b.getOwnershipRanges()))
        return np.asarray(X[self._unknowns]).reshape(B.shape)

    def _sum(self, B: Float) -> Float:
        """Sum B (u, k) over ranks: (n, k).  Collective."""
        part = np.zeros((self.total, B.shape[1]))
        part[self._unknowns] = B
        return distributed_arrays.allreduce_sum(self.comm, part)

    @property
    def iterations(self) -> int:
        """Return the iterations of the last solve for one column; 1 for a direct method."""
        assert self._ksp is not None, "no matrix is factored"
        return 1 if is_direct(self._ksp) else int(self._ksp.getIterationNumber())

    def destroy(self) -> None:
        """Free the factor.  Collective."""
        if self._ksp is not None:
            for petsc_object in (self._ksp.getOperators()[0], self._ksp, self._x, self._b):
                petsc_object.destroy()
            self._ksp = None
