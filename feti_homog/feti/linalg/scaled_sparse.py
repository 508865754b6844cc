"""Symmetrically scaled sparse matrices."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix

from feti_homog.typing import Float


def scaled(A: csr_matrix, weights: Float) -> csr_matrix:
    """diag(weights) A diag(weights) for weights (n,), in the pattern of A (n, n).

    Products with diagonal matrices would look for that pattern anew.
    """
    data = A.data * weights[A.indices] * np.repeat(weights, np.diff(A.indptr))
    # Indices of its own: sorting one matrix must not shuffle the other.
    return csr_matrix((data, A.indices.copy(), A.indptr.copy()), shape=A.shape)
