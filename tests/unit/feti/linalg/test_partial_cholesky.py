"""Partial factorizations by CHOLMOD's own functions."""

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from feti_homog.feti.linalg.partial_cholesky import PartialFactor, is_available

pytestmark = pytest.mark.skipif(not is_available(), reason="CHOLMOD's structures are those of other versions")


def test_the_factor_is_the_dense_one():
    rng = np.random.default_rng(1)
    root, loads, order, rows = rng.random((9, 9)), rng.random((9, 2)), rng.permutation(9), np.array([2, 5, 7])
    A = root @ root.T + np.eye(9)
    factor = PartialFactor(csr_matrix(A), rows, order)
    U, found = factor.last_block(), factor.forward(loads)
    whole = np.r_[order[~np.isin(order, rows)], rows]
    L = np.linalg.cholesky(A[np.ix_(whole, whole)])
    np.testing.assert_allclose(np.triu(U), L[-3:, -3:][::-1, ::-1], rtol=1e-12)
    np.testing.assert_allclose(found[-3:], np.linalg.solve(L, loads[whole])[-3:], rtol=1e-12)
    for B in (loads, loads[:, 0], loads[:, :1]):
        np.testing.assert_allclose(factor.solve(B), np.linalg.solve(A, B), rtol=1e-11)
    assert factor.forward(loads[:, :0]).shape == (9, 0)


@pytest.mark.parametrize("kind", [np.float32, np.int64])
def test_numbers_of_other_types_are_converted(kind):
    A, rows, order = 4.0 * np.eye(3) + np.eye(3, k=1) + np.eye(3, k=-1), np.array([2]), np.arange(3)
    B = np.array([1.0, 2.0, 3.0])
    for matrix, right in ((A.astype(kind), B), (A, B.astype(kind))):
        found = PartialFactor(csr_matrix(matrix), rows, order).solve(right)
        np.testing.assert_allclose(found, np.linalg.solve(A, B), rtol=1e-12)


@pytest.mark.parametrize("wrong", [0, 4, 8, 11])
def test_a_matrix_that_is_not_definite_is_refused_without_a_word(capfd, wrong):
    """One negative pivot anywhere: among the rows that are eliminated first, and the last of all."""
    A = 4.0 * np.eye(12) + np.eye(12, k=1) + np.eye(12, k=-1)
    A[wrong, wrong] = -1.0
    with pytest.raises(np.linalg.LinAlgError, match="not positive definite"):
        PartialFactor(csr_matrix(A), np.array([8, 11]), np.arange(12))
    assert capfd.readouterr() == ("", "")
