"""Dense symmetric matrices by one of their triangles, against NumPy."""

import numpy as np
import pytest

from feti_homog.feti.linalg.dense_matrices import full_from_lower, invert_upper
from feti_homog.feti.thresholds import BLOCK_ROWS

SIZES = [1, 2, BLOCK_ROWS, BLOCK_ROWS + 1, 2 * BLOCK_ROWS, 2 * BLOCK_ROWS + 1, 203]


def definite(n):
    M = np.random.default_rng(n).standard_normal((n, n))
    return np.asfortranarray(M @ M.T + n * np.eye(n))


@pytest.mark.parametrize("n", SIZES)
def test_the_inverse_takes_the_upper_triangle_alone(n):
    A = definite(n)
    both = A.copy(order="F")
    invert_upper(both)
    expected = np.linalg.inv(A)
    assert np.abs(np.triu(both - expected)).max() < 1e-12 * np.abs(expected).max()
    assert (np.tril(both, -1) == np.tril(A, -1)).all()


@pytest.mark.parametrize("n", SIZES)
def test_an_indefinite_matrix_is_refused(n):
    A = definite(n)
    A[n // 2, n // 2] = -1.0
    with pytest.raises(np.linalg.LinAlgError, match="not positive definite"):
        invert_upper(A)


@pytest.mark.parametrize("n", SIZES)
def test_mirrored_is_symmetric_with_that_lower_triangle(n):
    A = np.asfortranarray(np.random.default_rng(n).standard_normal((n, n)))
    before = A.copy()
    whole = full_from_lower(A)
    assert (whole == whole.T).all() and (np.tril(whole) == np.tril(A)).all() and (before == A).all()
