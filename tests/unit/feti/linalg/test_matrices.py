"""Matrix algebra against NumPy: scaled and dense symmetric matrices, Schur complements by MUMPS and CHOLMOD."""

import numpy as np
import pytest
from petsc4py import PETSc
from scipy.sparse import block_diag, csr_matrix, diags, identity, kron, random

from feti_homog.errors import FetiHomogError
from feti_homog.feti.linalg.dense_matrices import (
    condensed_with_loads,
    full_from_lower,
    invert_upper,
    product_with_some,
    schur_complement,
)
from feti_homog.feti.linalg.sparse_matrices import scaled
from feti_homog.feti.thresholds import BLOCK_ROWS


def laplacian(n: int) -> csr_matrix:
    """(n^2, n^2), positive definite."""
    one = diags([-1.0, 2.0, -1.0], [-1, 0, 1], shape=(n, n))
    return csr_matrix(kron(one, identity(n)) + kron(identity(n), one))


def shuffled(n: int) -> np.ndarray:
    """(n,) an order of elimination."""
    return np.random.default_rng(0).permutation(n)


@pytest.mark.parametrize("order", [None, shuffled(144)], ids=["mumps", "cholmod"])
@pytest.mark.parametrize("rows", [np.arange(0, 144, 7), np.arange(40), np.array([77])], ids=["some", "block", "one"])
def test_it_is_that_of_dense_algebra(rows, order):
    A = laplacian(12)
    rest = np.setdiff1d(np.arange(144), rows)
    D = A.toarray()
    expected = D[np.ix_(rows, rows)] - D[np.ix_(rows, rest)] @ np.linalg.solve(D[np.ix_(rest, rest)], D[rest][:, rows])
    np.testing.assert_allclose(schur_complement(A, rows, order), expected, atol=1e-12)


@pytest.mark.parametrize("rows", [np.array([30, 2, 17, 9]), shuffled(36)], ids=["some", "all"])
def test_rows_keep_their_order(rows):
    A, place = laplacian(6), np.argsort(rows)
    in_order = schur_complement(A, rows[place])
    np.testing.assert_allclose(schur_complement(A, rows)[np.ix_(place, place)], in_order, atol=1e-12)


def test_a_singular_matrix_has_one():
    """The rest of it is definite: of two squares that nothing couples, both float."""
    one = laplacian(8) - diags(np.asarray(laplacian(8).sum(axis=1)).ravel())
    A, rows = csr_matrix(kron(identity(2), one)), np.array([3, 40, 70, 127])
    found = [schur_complement(A, rows, order) for order in (None, shuffled(128))]
    np.testing.assert_allclose(found[1], found[0], atol=1e-12)
    np.testing.assert_allclose(found[1].sum(axis=1), 0.0, atol=1e-12)


@pytest.mark.parametrize("scale, words", [(-1.0, "pivot"), (np.nan, "finite|pivot")])
def test_cholmod_refuses_a_rest_that_is_not_definite(scale, words):
    with pytest.raises(np.linalg.LinAlgError, match=words):
        schur_complement(csr_matrix(laplacian(6) @ diags(np.r_[1.0, scale, np.ones(34)])), np.array([0]), shuffled(36))


@pytest.mark.parametrize("order", [None, shuffled(144)], ids=["mumps", "cholmod"])
def test_loads_are_condensed_with_it(order):
    A, rows = laplacian(12), np.arange(0, 144, 7)
    rest, loads = np.setdiff1d(np.arange(144), rows), np.random.default_rng(1).normal(size=(144, 3))
    D = A.toarray()
    inside = np.linalg.solve(D[np.ix_(rest, rest)], loads[rest])
    found = condensed_with_loads(A, rows, loads, order)
    np.testing.assert_allclose(found.S, schur_complement(A, rows), atol=1e-12)
    np.testing.assert_allclose(found.q, loads[rows] - D[np.ix_(rows, rest)] @ inside, atol=1e-12)
    np.testing.assert_allclose(found.C, -loads[rest].T @ inside, atol=1e-12)
    assert found.factor is None
    assert (condensed_with_loads(A, rows, loads, order, keep_factor=True).factor is None) == (order is None)


def test_a_kept_factor_has_displacements_of_a_singular_matrix():
    rng, rows, n = np.random.default_rng(3), np.arange(0, 144, 5), 144
    A = csr_matrix(laplacian(12) - diags(np.asarray(laplacian(12).sum(axis=1)).ravel()))
    u = rng.normal(size=(n, 2))
    factor = condensed_with_loads(A, rows, np.ones((n, 1)), shuffled(n), keep_factor=True).factor
    forces = A @ u
    for columns in (slice(None), 0):
        before = forces[:, columns].copy()
        found = factor.solution(forces[:, columns], u[rows][:, columns])
        np.testing.assert_allclose(found, u[:, columns], atol=1e-12)
        assert (found[rows] == u[rows][:, columns]).all() and (forces[:, columns] == before).all()


@pytest.mark.parametrize(
    ("option", "value", "error", "words"),
    [
        ("mat_mumps_icntl_23", 1, MemoryError, r"MUMPS: INFOG\(1\) = -"),  # one megabyte
        ("mat_mumps_icntl_8", -1, FetiHomogError, "options: -feti_schur_mat_mumps_icntl_8 -1$"),  # no such scaling
    ],
)
def test_a_failure_of_mumps_names_its_cause(option, value, error, words):
    options = PETSc.Options("feti_schur_")
    options.setValue(option, value)
    try:
        with pytest.raises(error, match=words):
            schur_complement(laplacian(60), np.arange(60))
    finally:
        options.delValue(option)


def test_a_singular_rest_is_no_lack_of_memory():
    A = csr_matrix(block_diag([laplacian(4), np.zeros((2, 2))]))
    with pytest.raises(np.linalg.LinAlgError, match="singular"):
        schur_complement(A, np.arange(3))


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


def test_rows_and_columns_are_scaled():
    A = random(7, 7, 0.4, "csr", random_state=1)
    before, weights = A.toarray(), np.arange(1.0, 8.0)
    found = scaled(A, weights)
    assert np.allclose(found.toarray(), weights[:, None] * before * weights, rtol=1e-15)
    assert not any(np.shares_memory(getattr(found, name), getattr(A, name)) for name in ("data", "indices", "indptr"))
    assert np.array_equal(A.toarray(), before)


@pytest.mark.parametrize(("some", "columns"), [(0, 3), (3, 1), (3, 900), (500, 40), (600, 900)])
def test_product_with_some_columns(some, columns):
    """Both ways agree with NumPy: a product with all columns, and products with copied columns in batches."""
    rng = np.random.default_rng(some)
    matrix, at = np.asfortranarray(rng.normal(size=(30, 700))), rng.permutation(700)[:some]
    x = rng.normal(size=(some, columns))
    np.testing.assert_allclose(product_with_some(matrix, at, x), matrix[:, at] @ x, atol=1e-12)
    np.testing.assert_allclose(product_with_some(matrix, at, x[:, 0]), matrix[:, at] @ x[:, 0], atol=1e-12)
