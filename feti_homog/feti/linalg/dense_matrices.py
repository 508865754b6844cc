"""Dense symmetric matrices: Schur complements by sparse elimination, Cholesky factors and inverses by LAPACK."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from petsc4py import PETSc
from scipy.linalg.blas import dtrmm
from scipy.linalg.lapack import dlauum, dpotrf, dpotrs, dtrtri
from scipy.sparse import bmat, csr_matrix

from feti_homog.feti.linalg.sparse_direct import check_factor, power_of_two, sequential
from feti_homog.feti.thresholds import BLOCK_ROWS, COLUMNS_AT_ONCE, COPIED_COLUMNS
from feti_homog.system.petsc import c_functions, options_database
from feti_homog.typing import Float, Int

if TYPE_CHECKING:
    from feti_homog.feti.linalg.partial_cholesky import PartialFactor

TOO_SMALL = (-8, -9)  # INFOG(1) of MUMPS if its workspace is too small
MORE_WORKSPACE = (None, 100, 1000)  # percentages that are added to its estimate, one after the other


def schur_complement(matrix: csr_matrix, rows: Int, order: Int | None = None) -> Float:
    """Compute the Schur complement (n, n) of a matrix (dofs, dofs) on `rows` (n,), in Fortran order.

    CHOLMOD eliminates the other rows in the `order` (dofs,); the diagonal on `rows` must then be positive.  Without
    `order` or CHOLMOD, or with options under `feti_schur_`, MUMPS eliminates them, and sorts the indices of `matrix`.

    Raises:
        LinAlgError: the block of the other rows is not positive definite, or the matrix is not finite.
        MemoryError, FetiHomogError: the library lacks memory, or cannot factor the matrix for another reason.
    """
    if len(rows) == matrix.shape[0]:
        return np.asarray(matrix[rows][:, rows].toarray(order="F"))
    if order is not None and _can_be_ordered():
        return _by_cholmod(matrix, rows, np.zeros((matrix.shape[0], 0)), order, keep_factor=False).S
    scale = power_of_two(matrix.diagonal())
    # The matrix is scaled in place and back, which changes no digit: a copy would be as large as the matrix.
    matrix.data *= scale
    A = sequential(matrix)
    A.setOption(PETSc.Mat.Option.SPD, True)
    index_set = PETSc.IS().createGeneral(rows.astype(PETSc.IntType), comm=PETSc.COMM_SELF)
    pc = PETSc.PC()
    try:
        for workspace in MORE_WORKSPACE:
            pc.destroy()
            pc.create(PETSc.COMM_SELF)
            pc.setOptionsPrefix("feti_schur_")
            pc.setOperators(A)
            pc.setType(PETSc.PC.Type.CHOLESKY)
            pc.setFactorSolverType(PETSc.Mat.SolverType.MUMPS)
            pc.setFromOptions()
            pc.setFactorSetUpSolverType()
            # The scaling of MUMPS loses digits of coarse matrices, which are already scaled.
            pc.getFactorMatrix().setMumpsIcntl(8, 0)
            if workspace is not None:
                pc.getFactorMatrix().setMumpsIcntl(14, workspace)
            c_functions.set_schur(pc.getFactorMatrix(), index_set)
            pc.setUp()
            if pc.getFactorMatrix().getMumpsInfog(1) not in TOO_SMALL:
                break
        check_factor(pc)
        schur = c_functions.schur_complement(pc.getFactorMatrix(), len(rows))
    finally:
        for petsc_object in (pc, index_set, A):
            petsc_object.destroy()
        matrix.data /= scale
    schur /= scale
    return schur


@dataclass(frozen=True)
class ShiftedFactor:
    """The Cholesky factor of K + D, for a matrix K (dofs, dofs) that may be singular.

    Attributes:
        factor: L with L L^T = K + D.
        rows: (n,) rows that remained when K was condensed.
        D: (n,) positive diagonal of D on `rows`; D is 0 elsewhere.
    """

    factor: PartialFactor
    rows: Int
    D: Float

    def solution(self, f: Float, x: Float) -> Float:
        """Solve K u = f (dofs, k) by (K + D) u = f + D x; x (n, k) are the values of the solution u on `rows`."""
        right = f.copy(order="F")
        right[self.rows] += (self.D * x.T).T
        u = self.factor.solve(right)
        u[self.rows] = x
        return u


@dataclass(frozen=True)
class CondensedMatrix:
    """A matrix K and loads Q (dofs, v), condensed to n rows b; i are the other rows.

    Attributes:
        S: (n, n) Schur complement K_bb - K_bi K_ii^-1 K_ib, in Fortran order.
        q: (n, v) Q_b - K_bi K_ii^-1 Q_i.
        C: (v, v) -Q_i^T K_ii^-1 Q_i.
        factor: CHOLMOD's factor of K, shifted; None if it is not kept, or if MUMPS condensed K.
    """

    S: Float
    q: Float
    C: Float
    factor: ShiftedFactor | None = None


def condensed_with_loads(
    matrix: csr_matrix, rows: Int, loads: Float, order: Int | None = None, keep_factor: bool = False
) -> CondensedMatrix:
    """Condense matrix and loads Q (dofs, v) to `rows` like `schur_complement`; `keep_factor` keeps CHOLMOD's factor."""
    if order is not None and _can_be_ordered():
        return _by_cholmod(matrix, rows, loads, order, keep_factor)
    v, n = loads.shape[1], len(rows)
    corner = csr_matrix((np.zeros(v), np.arange(v), np.arange(v + 1)), shape=(v, v))  # MUMPS expects a diagonal
    Q = csr_matrix(loads)
    bordered = bmat([[matrix, Q], [Q.T, corner]], format="csr")
    schur = schur_complement(bordered, np.r_[rows, matrix.shape[0] + np.arange(v)])
    return CondensedMatrix(np.asfortranarray(schur[:n, :n]), schur[:n, n:].copy(), schur[n:, n:].copy())


def _can_be_ordered() -> bool:
    """Return whether CHOLMOD can eliminate in a chosen order, and no option configures MUMPS."""
    from feti_homog.feti.linalg import partial_cholesky  # only large subdomains need it

    return partial_cholesky.is_available() and not options_database.choices("feti_schur_")


def _by_cholmod(matrix: csr_matrix, rows: Int, loads: Float, order: Int, keep_factor: bool) -> CondensedMatrix:
    """Condense a matrix K and loads Q by the factorization K + D = L L^T; raises like `schur_complement`.

    D > 0 on `rows` makes K + D definite even if K is singular.  With y = L^-1 Q and the block L_bb of L on `rows` b,
    S = L_bb L_bb^T - D, q = L_bb y_b and C = -y_i^T y_i.
    """
    from feti_homog.feti.linalg.partial_cholesky import PartialFactor  # only large subdomains need it

    n, shift = len(rows), matrix.diagonal()[rows]
    D = csr_matrix((shift, (rows, rows)), shape=matrix.shape)
    factor = PartialFactor(csr_matrix(matrix + D), rows, order)
    U, y = factor.last_block(), factor.forward(loads)
    shifted = ShiftedFactor(factor, rows, shift) if keep_factor else None
    del factor  # before S needs its memory
    inner, last = y[:-n], y[-n:]
    q = dtrmm(1.0, U, last[::-1])[::-1].copy()
    if not np.isfinite(U.diagonal()).all():
        raise np.linalg.LinAlgError("not positive definite (entries are not finite)")
    check_lapack("dlauum", dlauum(U, lower=0, overwrite_c=1)[1])
    S = full_from_lower(U[::-1, ::-1]).T
    S[np.diag_indices(n)] -= shift
    return CondensedMatrix(S, q, -inner.T @ inner, shifted)


def cholesky(A: Float, lower: bool = True, clean: bool = True) -> Float:
    """Compute the Cholesky factor L (n, n) of A = L L^T, or L^T if not `lower`.

    The factor overwrites A if A is in Fortran order.  Without `clean`, the other triangle keeps entries of A.

    Raises:
        LinAlgError: A is not positive definite, or has entries that are not finite.
    """
    if not len(A):
        return A
    L, info = dpotrf(A, lower=lower, clean=clean, overwrite_a=1)
    check_lapack("dpotrf", info)
    # OpenBLAS reports success for NaN, which the factorization carries to the last pivot.
    if not np.isfinite(L[-1, -1]):
        raise np.linalg.LinAlgError("not positive definite (entries are not finite)")
    return np.asarray(L)


class DenseSolver:
    """A solver X = A^-1 B for one SPD matrix A (n, n), by LAPACK."""

    def __init__(self, A: Float) -> None:
        """Factor A by `cholesky`; a matrix in Fortran order is overwritten."""
        self._L = cholesky(A, clean=False)

    def solve(self, B: Float) -> Float:
        """Compute A^-1 B for B (n,) or (n, k)."""
        X, info = dpotrs(self._L, B, lower=1)
        check_lapack("dpotrs", info)
        return np.asarray(X)

    def destroy(self) -> None:
        """Free the factor."""
        self._L = self._L[:0, :0].copy()


def check_lapack(routine: str, info: int) -> None:
    """Raise an exception if LAPACK's `info` reports an error.

    Raises:
        LinAlgError: the matrix is not positive definite, or singular.
        ValueError: an argument is illegal.
    """
    if info > 0:
        raise np.linalg.LinAlgError(f"not positive definite ({routine}: LAPACK info {info})")
    if info < 0:
        raise ValueError(f"{routine}: argument {-info} is illegal (LAPACK info {info})")


def invert_upper(A: Float) -> None:
    """Overwrite the upper triangle of an SPD matrix A (n, n), in Fortran order, with the triangle of A^-1.

    Entries below the diagonal are not read and do not change.

    Raises:
        LinAlgError: A is not positive definite.
    """
    cholesky(A, lower=False, clean=False)
    _invert_triangle(A)
    check_lapack("dlauum", dlauum(A, lower=0, overwrite_c=1)[1])


def _invert_triangle(U: Float) -> None:
    """Invert the upper triangle U (n, n) in place, by halves: OpenBLAS would go column by column."""
    n = len(U)
    if n <= BLOCK_ROWS:
        U[:], info = dtrtri(U, lower=0)
        check_lapack("dtrtri", info)
        return
    first, corner, last = U[: n // 2, : n // 2], U[: n // 2, n // 2 :], U[n // 2 :, n // 2 :]
    _invert_triangle(first)
    _invert_triangle(last)
    corner[:] = dtrmm(1.0, last, dtrmm(-1.0, first, corner), side=1, overwrite_b=1)


def full_from_lower(A: Float, block: int = BLOCK_ROWS) -> Float:
    """Copy the lower triangle of A (n, n) to a symmetric matrix in C order; blocks of `block` rows fit the cache."""
    full, lower = A.copy(order="F"), np.tri(block, dtype=bool)
    for j in range(0, len(A), block):
        rows = slice(j, j + block)
        full[:j, rows] = full[rows, :j].T
        corner = full[rows, rows]
        full[rows, rows] = np.where(lower[: len(corner), : len(corner)], corner, corner.T)
    return np.asarray(full.T)


def product_with_some(columns: Float, at: Int, x: Float) -> Float:
    """Compute columns[:, at] x for columns (n, m), `at` (c,) and x (c,) or (c, k).

    Columns are copied COLUMNS_AT_ONCE at a time, unless a product with all m columns costs less.
    """
    k = x.size // max(len(x), 1)
    if len(at) * (k + COPIED_COLUMNS) > columns.shape[1] * k:
        padded = np.zeros((columns.shape[1], *x.shape[1:]))
        padded[at] = x
        return np.asarray(columns @ padded)
    product = np.zeros((len(columns), *x.shape[1:]))
    for batch in np.array_split(np.arange(len(at)), len(at) // COLUMNS_AT_ONCE + 1):
        product += columns[:, at[batch]] @ x[batch]
    return product
