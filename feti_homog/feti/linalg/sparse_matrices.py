"""Sparse matrices: sums of dense blocks, and symmetric scaling."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix

from feti_homog.feti.thresholds import MAX_BUFFERED_ENTRIES
from feti_homog.typing import Float, Int, Int32


class DenseBlockSum:
    """The sparse sum of dense blocks that are added one after the other.

    Blocks wait in a buffer, which is added to the sum when it has more than `max_buffered_entries` entries and more
    than the sum itself.  So memory is at most about twice that of the sum, which is copied only when it has doubled.
    """

    def __init__(self, shape: tuple[int, int], max_buffered_entries: int = MAX_BUFFERED_ENTRIES) -> None:
        self._sum = csr_matrix(shape)
        self._max_buffered_entries = max_buffered_entries
        # Of each block: rows, how many entries each has, their columns and values.
        self._buffer: list[tuple[Int, Int, Int32, Float]] = []
        self._buffered_entries = 0

    def add(self, rows: Int, columns: Int, values: Float) -> None:
        """Add the block `values` (rows, columns)."""
        counts, wide = np.full(len(rows), len(columns)), np.tile(columns.astype(np.int32), len(rows))
        self._buffer.append((rows, counts, wide, values.ravel()))
        self._buffered_entries += values.size
        if self._buffered_entries > max(self._max_buffered_entries, self._sum.nnz):
            self._flush()

    def matrix(self) -> csr_matrix:
        """Return the sum of all blocks so far."""
        self._flush()
        return self._sum

    def _flush(self) -> None:
        """Add the buffer to the sum."""
        if not self._buffer:
            return
        rows, counts, columns, values = (np.concatenate(part) for part in zip(*self._buffer, strict=True))
        self._buffer, self._buffered_entries = [], 0
        m, n = self._sum.shape
        # A product sums faster than a conversion from coordinates, which sorts.
        stacked = csr_matrix((values, columns, np.r_[0, np.cumsum(counts)]), shape=(len(rows), n))
        place = csr_matrix((np.ones(len(rows)), (rows, np.arange(len(rows)))), shape=(m, len(rows)))
        self._sum = self._sum + place @ stacked


def scaled(A: csr_matrix, weights: Float) -> csr_matrix:
    """diag(weights) A diag(weights) for weights (n,), in the pattern of A (n, n).

    Products with diagonal matrices would look for that pattern anew.
    """
    data = A.data * weights[A.indices] * np.repeat(weights, np.diff(A.indptr))
    # Indices of its own: sorting one matrix must not shuffle the other.
    return csr_matrix((data, A.indices.copy(), A.indptr.copy()), shape=A.shape)
