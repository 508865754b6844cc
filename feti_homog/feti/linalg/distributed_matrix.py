"""Distributed sparse matrices out of the contributions of all ranks."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy.sparse import csr_matrix, diags

from feti_homog.typing import Float, Int, Int32

# Entries of dense blocks that are held before they are summed up, at least.
HELD = 4_000_000


def assembled(comm: MPI.Intracomm, local: csr_matrix, rows: Int, columns: Int, owned: tuple[int, int]) -> csr_matrix:
    """The owned rows of the sum over ranks of `local`, whose rows and columns have the given global numbers.

    Args:
        owned: numbers of rows and columns that this rank owns.
    """
    A = _assembled(comm, local, rows, columns, owned)
    indptr, indices, values = A.getValuesCSR()
    sizes = A.getLocalSize()[0], A.getSize()[1]
    A.destroy()
    return csr_matrix((values, indices, indptr), shape=sizes)


def summed(comm: MPI.Intracomm, local: csr_matrix, rows: Int, foreign: NDArray[np.bool_], owned: int) -> csr_matrix:
    """The same rows of the sum over ranks of `local`, whose rows have the global numbers `rows`.

    Args:
        local: (rows, n), with the same n columns on every rank.
        foreign: which rows other ranks have too; only these travel.
        owned: number of rows that this rank owns.
    """
    if comm.size == 1:
        return local
    part, n = local[foreign], local.shape[1]
    used, indices = np.unique(part.indices, return_inverse=True)
    narrow = csr_matrix((part.data, indices, part.indptr), shape=(part.shape[0], len(used)))
    A = _assembled(comm, narrow, rows[foreign], used, (owned, _share(comm, n)))
    # Backwards: PETSc 3.18 mixes up the columns if every rank asks for all rows in their order.
    here = PETSc.IS().createGeneral(rows[foreign][::-1].astype(PETSc.IntType), comm=PETSc.COMM_SELF)
    all_columns = PETSc.IS().createStride(n, 0, 1, comm=PETSc.COMM_SELF)
    asked = A.createSubMatrices(here, all_columns)[0]
    indptr, indices, data = asked.getValuesCSR()
    for thing in (asked, A, here, all_columns):
        thing.destroy()
    at = np.flatnonzero(foreign)[::-1]
    place = csr_matrix((np.ones(len(at)), (at, np.arange(len(at)))), shape=(len(rows), len(at)))
    return diags((~foreign).astype(float)) @ local + place @ csr_matrix((data, indices, indptr), shape=(len(at), n))


def _share(comm: MPI.Intracomm, n: int) -> int:
    """How many of n things are this rank's when they are dealt out evenly."""
    return n // comm.size + (comm.rank < n % comm.size)


def _assembled(comm: MPI.Intracomm, local: csr_matrix, rows: Int, columns: Int, owned: tuple[int, int]) -> PETSc.Mat:
    maps = [PETSc.LGMap().create(i.astype(PETSc.IntType), comm=comm) for i in (rows, columns)]
    sizes = tuple((n, comm.allreduce(n)) for n in owned)
    A = PETSc.Mat().createIS(sizes, *maps, comm=comm)
    csr = csr_matrix(local)
    part = PETSc.Mat().createAIJ(csr.shape, csr=(csr.indptr, csr.indices, csr.data), comm=PETSc.COMM_SELF)
    A.setISLocalMat(part)
    A.assemble()
    whole = PETSc.Mat()
    A.convert(PETSc.Mat.Type.AIJ, whole)
    for thing in (A, part, *maps):
        thing.destroy()
    return whole


def distributed(comm: MPI.Intracomm, part: csr_matrix) -> PETSc.Mat:
    """The sum over ranks of parts of one shape, its rows dealt evenly to the ranks.  Collective."""
    rows, columns = (np.flatnonzero(np.diff(m.indptr)) for m in (part.tocsr(), part.tocsc()))
    shares = (_share(comm, part.shape[0]), _share(comm, part.shape[1]))
    return _assembled(comm, part[rows][:, columns], rows, columns, shares)


def own_rows(comm: MPI.Intracomm, part: csr_matrix) -> csr_matrix:
    """The rows of the sum over ranks of `part` that are this rank's when they are dealt out evenly.  Collective."""
    if comm.size == 1:
        return part
    A = distributed(comm, part)
    indptr, indices, values = A.getValuesCSR()
    A.destroy()
    return csr_matrix((values, indices, indptr), shape=(len(indptr) - 1, part.shape[1]))


def total(comm: MPI.Intracomm, own: csr_matrix) -> csr_matrix:
    """The sum over ranks of small matrices, on every rank."""
    if comm.size == 1:
        return own
    part = own.tocoo()
    parts = comm.allgather((part.data, part.row, part.col))
    data, rows, columns = (np.concatenate(p) for p in zip(*parts, strict=True))
    return csr_matrix((data, (rows, columns)), shape=own.shape)


class Blocks:
    """A sparse sum of dense blocks; never more of their entries are held than the sum has so far, or HELD."""

    def __init__(self, shape: tuple[int, int]) -> None:
        self._whole = csr_matrix(shape)
        # Rows, how many entries each has, their columns and values.
        self._held: list[tuple[Int, Int, Int32, Float]] = []
        self._entries = 0

    def add(self, rows: Int, columns: Int, values: Float) -> None:
        """Add `values` (rows, columns)."""
        counts = np.full(len(rows), len(columns))
        self._add(rows, counts, np.tile(columns.astype(np.int32), len(rows)), values.ravel())

    def add_larger(self, rows: Int, columns: Int, values: Float, least: Float) -> None:
        """Add those of `values` (rows, columns) that are larger in modulus than `least` (columns,)."""
        large = np.abs(values) > least
        self._add(rows, large.sum(axis=1), columns.astype(np.int32)[np.nonzero(large)[1]], values[large])

    def _add(self, rows: Int, counts: Int, columns: Int32, values: Float) -> None:
        self._held.append((rows, counts, columns, values))
        self._entries += len(values)
        if self._entries > max(HELD, self._whole.nnz):
            self._flush()

    def matrix(self) -> csr_matrix:
        """The sum so far."""
        self._flush()
        return self._whole

    def _flush(self) -> None:
        if self._held:
            rows, counts, columns, values = (np.concatenate(part) for part in zip(*self._held, strict=True))
            self._held, self._entries = [], 0
            m, n = self._whole.shape
            # A product sums faster than a conversion from coordinates, which sorts.
            one_by_one = csr_matrix((values, columns, np.r_[0, np.cumsum(counts)]), shape=(len(rows), n))
            place = csr_matrix((np.ones(len(rows)), (rows, np.arange(len(rows)))), shape=(m, len(rows)))
            self._whole = self._whole + place @ one_by_one
