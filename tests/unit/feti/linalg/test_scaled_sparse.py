"""Scaled sparse matrices against dense products."""

from __future__ import annotations

import numpy as np
from scipy.sparse import random

from feti_homog.feti.linalg.scaled_sparse import scaled


def test_rows_and_columns_are_scaled():
    A = random(7, 5, 0.4, "csr", random_state=1)
    before, r, c = A.toarray(), np.arange(1.0, 8.0), 2.0 ** np.arange(5)
    for rows, columns in ((r, None), (None, c), (r, c), (None, None)):
        found = scaled(A, rows, columns)
        left = np.ones(7) if rows is None else rows
        right = np.ones(5) if columns is None else columns
        assert np.allclose(found.toarray(), left[:, None] * before * right, rtol=1e-15)
        assert not any(
            np.shares_memory(getattr(found, name), getattr(A, name)) for name in ("data", "indices", "indptr")
        )
    assert np.array_equal(A.toarray(), before)
