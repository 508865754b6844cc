"""Dense symmetric matrices: Cholesky factorizations by LAPACK and its statuses, inverses and copies of one triangle.

A square array has room for the triangles of two.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg.blas import dtrmm
from scipy.linalg.lapack import dlauum, dpotrf, dtrtri

from feti_homog.feti.thresholds import MIRRORED_BLOCK_ROWS, TRIANGLE_INVERSE_ROWS
from feti_homog.typing import Float


def cholesky(A: Float, lower: bool = True, clean: bool = True) -> Float:
    """Return the triangle L with L L^T = A (n, n), or the upper one L^T.

    In the memory of A if that is in Fortran order.

    Args:
        clean: set the other triangle to 0.

    Raises:
        LinAlgError: A is not positive definite, or has entries that are not finite.
    """
    if not len(A):
        return A
    L, info = dpotrf(A, lower=lower, clean=clean, overwrite_a=1)
    check_lapack("dpotrf", info)
    # OpenBLAS returns 0 for NaN, which the factorization carries to the last pivot.
    if not np.isfinite(L[-1, -1]):
        raise np.linalg.LinAlgError("not positive definite (entries that are not finite)")
    return np.asarray(L)


def check_lapack(routine: str, info: int) -> None:
    """Read the info that a routine of LAPACK returns.

    Raises:
        LinAlgError: the matrix is not positive definite, or singular.
        ValueError: an argument is illegal.
    """
    if info > 0:
        raise np.linalg.LinAlgError(f"not positive definite ({routine}: LAPACK info {info})")
    if info < 0:
        raise ValueError(f"{routine}: argument {-info} is illegal (LAPACK info {info})")


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
    """Return the symmetric matrix, in C order, whose lower triangle is that of A (n, n).

    By blocks that fit the cache.
    """
    whole, lower = A.copy(order="F"), np.tri(block, dtype=bool)
    for j in range(0, len(A), block):
        some = slice(j, j + block)
        whole[:j, some] = whole[some, :j].T
        corner = whole[some, some]
        whole[some, some] = np.where(lower[: len(corner), : len(corner)], corner, corner.T)
    return np.asarray(whole.T)
