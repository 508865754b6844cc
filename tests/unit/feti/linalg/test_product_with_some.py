"""Products with some columns of a matrix."""

import numpy as np
import pytest

from feti_homog.feti.linalg.dense_matrices import product_with_some


@pytest.mark.parametrize(("some", "columns"), [(0, 3), (3, 1), (3, 900), (500, 40), (600, 900)])
def test_product_with_some_columns(some, columns):
    """By all columns, or by copies of those that count, in one part or in several."""
    rng = np.random.default_rng(some)
    matrix, at = np.asfortranarray(rng.normal(size=(30, 700))), rng.permutation(700)[:some]
    x = rng.normal(size=(some, columns))
    np.testing.assert_allclose(product_with_some(matrix, at, x), matrix[:, at] @ x, atol=1e-12)
    np.testing.assert_allclose(product_with_some(matrix, at, x[:, 0]), matrix[:, at] @ x[:, 0], atol=1e-12)
