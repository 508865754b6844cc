"""Sparse matrices with scaled rows and columns."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix

from feti_homog.typing import Float


def scaled(A: csr_matrix, rows: Float | None = None, columns: Float | None = None) -> csr_matrix:
    """diag(rows) A diag(columns) for rows (n,) and columns (m,), in the pattern of A (n, m).

    Products with diagonal matrices would look for that pattern anew.
    """
    data = A.data.copy() if columns is None else A.data * columns[A.indices]
    if rows is not None:
        data *= np.repeat(rows, np.diff(A.indptr))
    # Indices of its own: sorting one matrix must not shuffle the other.
    return csr_matrix((data, A.indices.copy(), A.indptr.copy()), shape=A.shape)
