"""Dense boundary operators of a subdomain: its Schur complement S and the flexibility S+.

Both live in the Cholesky factor of S + rho Rf Rf^T, in packed storage: products and solves with it read n^2 / 2 numbers
twice, faster than a dense matrix.  S comes from one partial factorization (MUMPS) whose factors are not kept: all that
the dual problem needs lives on the boundary, since the load of a macroscopic strain vanishes inside a uniform body.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy.linalg.blas import dtpmv, dtpsv, dtrmm, dtrsm
from scipy.linalg.lapack import dpotrf, dtpttr, dtrttp
from scipy.sparse import csr_matrix

from feti_homog import petsc_c
from feti_homog.feti.subdomain import Subdomain

Int = NDArray[np.int64]
Float = NDArray[np.float64]

# Columns up to which packed products, one after the other, are faster than to unpack for all of them.
FEW = 4


class Condensed:
    """S and S+ of one subdomain on its n boundary dofs.

    With the fixing nodes on the boundary, the inverse of S + rho Rf Rf^T is the boundary part of K+.
    """

    def __init__(self, subdomain: Subdomain, dofs: Int) -> None:
        """Factor; `dofs` (n,) are sorted local numbers.

        Raises:
            LinAlgError: the Schur complement is not positive definite.
        """
        fixed, self._term = subdomain.fixing(np.unique(dofs // 2))
        self._fixed = np.searchsorted(dofs, fixed)
        self.n = len(dofs)
        held = schur_complement(subdomain.K, dofs)
        held[np.ix_(self._fixed, self._fixed)] += self._term
        factor, info = dpotrf(held, lower=1)
        if info:
            raise np.linalg.LinAlgError(f"a held Schur complement is not positive definite (LAPACK info {info})")
        self._factor = dtrttp(factor, uplo="L")[0]
        self._held: Float | None = held

    def stiffness(self, x: Float, out: Float) -> None:
        """S x for x (n,) or (n, k)."""
        if x.size > FEW * self.n:
            out[:] = self.forces(x)
            return
        for column, result in _columns(x, out):
            result[:] = dtpmv(self.n, self._factor, dtpmv(self.n, self._factor, column, lower=1, trans=1), lower=1)
        out[self._fixed] -= self._term @ x[self._fixed]

    def flexibility(self, x: Float, out: Float) -> None:
        """S+ x for x (n,) or (n, k)."""
        if x.size > FEW * self.n:
            out[:] = self.answer(x)
            return
        for column, result in _columns(x, out):
            result[:] = dtpsv(self.n, self._factor, dtpsv(self.n, self._factor, column, lower=1), lower=1, trans=1)

    def answer(self, X: Float) -> Float:
        """S+ X for many columns X (n, m)."""
        factor = dtpttr(self.n, self._factor, uplo="L")[0]
        return np.asarray(dtrsm(1.0, factor, dtrsm(1.0, factor, X, lower=1), lower=1, trans_a=1, overwrite_b=1))

    def forces(self, X: Float) -> Float:
        """S X for many columns X (n, m)."""
        factor = dtpttr(self.n, self._factor, uplo="L")[0]
        Y = dtrmm(1.0, factor, dtrmm(1.0, factor, X, lower=1, trans_a=1), lower=1, overwrite_b=1)
        Y[self._fixed] -= self._term @ X[self._fixed]
        return np.asarray(Y)

    @property
    def held(self) -> Float:
        """(n, n) S + rho Rf Rf^T, positive definite; only until `release`."""
        if self._held is None:
            raise RuntimeError("the dense Schur complement has been released")
        return self._held

    @property
    def S(self) -> Float:
        """(n, n) a copy of S; only until `release`."""
        S = self.held.copy()
        S[np.ix_(self._fixed, self._fixed)] -= self._term
        return S

    def release(self) -> None:
        """Free the dense matrix; its factor serves from now on."""
        self._held = None


def _columns(x: Float, out: Float) -> Iterator[tuple[Float, Float]]:
    """The columns of x and of the result, views where these have one only."""
    return iter([(x, out)]) if x.ndim == 1 else zip(x.T.copy(), out.T, strict=True)


def schur_complement(matrix: csr_matrix, dofs: Int) -> Float:
    """(n, n) Schur complement of a matrix on `dofs`, by MUMPS' partial factorization; the rest has to be SPD.

    Options have the prefix `feti_schur_`.
    """
    if len(dofs) == matrix.shape[0]:
        return matrix.toarray()
    csr = matrix.indptr, matrix.indices, matrix.data
    A = PETSc.Mat().createAIJWithArrays(matrix.shape, csr, comm=PETSc.COMM_SELF)
    A.setOption(PETSc.Mat.Option.SPD, True)
    pc = PETSc.PC().create(PETSc.COMM_SELF)
    pc.setOptionsPrefix("feti_schur_")
    pc.setOperators(A)
    pc.setType(PETSc.PC.Type.CHOLESKY)
    pc.setFactorSolverType(PETSc.Mat.SolverType.MUMPS)
    pc.setFromOptions()
    pc.setFactorSetUpSolverType()
    rows = PETSc.IS().createGeneral(dofs.astype(PETSc.IntType), comm=PETSc.COMM_SELF)
    petsc_c.set_schur(pc.getFactorMatrix(), rows)
    pc.setUp()
    S = petsc_c.schur_complement(pc.getFactorMatrix(), len(dofs))
    pc.destroy()
    A.destroy()
    return S
