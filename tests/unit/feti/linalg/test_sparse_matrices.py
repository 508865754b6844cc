"""Scaled sparse matrices, and products with some columns, against dense ones."""

import numpy as np
import pytest
from scipy.sparse import random

from feti_homog.feti.linalg.dense_matrices import product_with_some
from feti_homog.feti.linalg.sparse_matrices import scaled


def test_rows_and_columns_are_scaled():
    A = random(7, 7, 0.4, "csr", random_state=1)
    before, weights = A.toarray(), np.arange(1.0, 8.0)
    found = scaled(A, weights)
    assert np.allclose(found.toarray(), weights[:, None] * before * weights, rtol=1e-15)
    assert not any(np.shares_memory(getattr(found, name), getattr(A, name)) for name in ("data", "indices", "indptr"))
    assert np.array_equal(A.toarray(), before)


@pytest.mark.parametrize(("some", "columns"), [(0, 3), (3, 1), (3, 900), (500, 40), (600, 900)])
def test_product_with_some_columns(some, columns):
    """By all columns, or by copies of those that count, in one part or in several."""
    rng = np.random.default_rng(some)
    matrix, at = np.asfortranarray(rng.normal(size=(30, 700))), rng.permutation(700)[:some]
    x = rng.normal(size=(some, columns))
    np.testing.assert_allclose(product_with_some(matrix, at, x), matrix[:, at] @ x, atol=1e-12)
    np.testing.assert_allclose(product_with_some(matrix, at, x[:, 0]), matrix[:, at] @ x[:, 0], atol=1e-12)
