"""Schur complements by MUMPS against dense algebra; what MUMPS cannot make is no zeros."""

from __future__ import annotations

import numpy as np
import pytest
from petsc4py import PETSc
from scipy.sparse import csr_matrix, diags, identity, kron

from feti_homog.feti.linalg.dense_matrices import schur_complement, schur_complement_with_loads


def laplacian(n: int) -> csr_matrix:
    """(n^2, n^2), positive definite."""
    one = diags([-1.0, 2.0, -1.0], [-1, 0, 1], shape=(n, n))
    return csr_matrix(kron(one, identity(n)) + kron(identity(n), one))


def test_it_is_that_of_dense_algebra():
    A, rows = laplacian(12), np.arange(0, 144, 7)
    rest = np.setdiff1d(np.arange(144), rows)
    D = A.toarray()
    expected = D[np.ix_(rows, rows)] - D[np.ix_(rows, rest)] @ np.linalg.solve(D[np.ix_(rest, rest)], D[rest][:, rows])
    np.testing.assert_allclose(schur_complement(A, rows), expected, atol=1e-12)


def test_loads_are_condensed_with_it():
    A, rows = laplacian(12), np.arange(0, 144, 7)
    rest, loads = np.setdiff1d(np.arange(144), rows), np.random.default_rng(1).normal(size=(144, 3))
    D = A.toarray()
    inside = np.linalg.solve(D[np.ix_(rest, rest)], loads[rest])
    S, q, C = schur_complement_with_loads(A, rows, loads)
    np.testing.assert_allclose(S, schur_complement(A, rows), atol=1e-12)
    np.testing.assert_allclose(q, loads[rows] - D[np.ix_(rows, rest)] @ inside, atol=1e-12)
    np.testing.assert_allclose(C, -loads[rest].T @ inside, atol=1e-12)


def test_a_failure_of_mumps_is_reported():
    """MUMPS may use one megabyte."""
    options = PETSc.Options("feti_schur_")
    options.setValue("mat_mumps_icntl_23", 1)
    try:
        with pytest.raises(MemoryError, match=r"MUMPS cannot factor: INFOG\(1\) = -"):
            schur_complement(laplacian(60), np.arange(60))
    finally:
        options.delValue("mat_mumps_icntl_23")
