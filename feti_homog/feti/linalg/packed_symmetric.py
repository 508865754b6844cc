"""Dense symmetric matrices by one of their triangles, so that a square array has room for two."""

from __future__ import annotations

import numpy as np
from scipy.linalg.blas import dtrmm
from scipy.linalg.lapack import dlauum, dtrtri

from feti_homog.feti.linalg.dense_cholesky import check_lapack, cholesky
from feti_homog.feti.thresholds import MIRRORED_BLOCK_ROWS, TRIANGLE_INVERSE_ROWS
from feti_homog.typing import Float


def invert_upper(A: Float) -> None:
    """Let the upper triangle and the diagonal of the SPD matrix A (n, n), in Fortran order, become those of A^-1.

    The strict lower triangle stays.

    Raises:
        LinAlgError: A is not positive definite.
    """
    cholesky(A, lower=False, clean=False)
    _invert_triangle(A)
    check_lapack("dlauum", dlauum(A, lower=0, overwrite_c=1)[1])


def _invert_triangle(U: Float) -> None:
    """U <- U^-1 for the upper triangle of U, by halves: OpenBLAS inverts large ones column by column."""
    n = len(U)
    if n <= TRIANGLE_INVERSE_ROWS:
        U[:], info = dtrtri(U, lower=0)
        check_lapack("dtrtri", info)
        return
    first, corner, last = U[: n // 2, : n // 2], U[: n // 2, n // 2 :], U[n // 2 :, n // 2 :]
    _invert_triangle(first)
    _invert_triangle(last)
    corner[:] = dtrmm(1.0, last, dtrmm(-1.0, first, corner), side=1, overwrite_b=1)


def full_from_lower(A: Float, block: int = MIRRORED_BLOCK_ROWS) -> Float:
    """The symmetric matrix, in C order, whose lower triangle is that of A (n, n); by blocks that fit the cache."""
    whole, lower = A.copy(order="F"), np.tri(block, dtype=bool)
    for j in range(0, len(A), block):
        some = slice(j, j + block)
        whole[:j, some] = whole[some, :j].T
        corner = whole[some, some]
        whole[some, some] = np.where(lower[: len(corner), : len(corner)], corner, corner.T)
    return np.asarray(whole.T)
