"""Dense Cholesky factorizations by LAPACK, and its statuses."""

from __future__ import annotations

import numpy as np
from scipy.linalg.lapack import dpotrf

from feti_homog.typing import Float


def cholesky(A: Float, lower: bool = True, clean: bool = True) -> Float:
    """The triangle L with L L^T = A (n, n), or the upper one L^T, in the memory of A if that is in Fortran order.

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
