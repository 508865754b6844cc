"""Scaled sparse matrices against dense products."""

import numpy as np
from scipy.sparse import random

from feti_homog.feti.linalg.sparse_matrices import scaled


def test_rows_and_columns_are_scaled():
    A = random(7, 7, 0.4, "csr", random_state=1)
    before, weights = A.toarray(), np.arange(1.0, 8.0)
    found = scaled(A, weights)
    assert np.allclose(found.toarray(), weights[:, None] * before * weights, rtol=1e-15)
    assert not any(np.shares_memory(getattr(found, name), getattr(A, name)) for name in ("data", "indices", "indptr"))
    assert np.array_equal(A.toarray(), before)
