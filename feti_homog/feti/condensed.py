"""Dense boundary operators of a subdomain: its Schur complement S and the flexibility S+.

They come from one partial factorization (MUMPS) whose factors are not kept: all that the dual problem needs lives on
the boundary, since the load of a macroscopic strain vanishes inside a uniform body.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy.linalg.lapack import dpotrf, dpotri
from scipy.sparse import csr_matrix

from feti_homog import petsc_c
from feti_homog.feti.subdomain import Subdomain

Int = NDArray[np.int64]
Float = NDArray[np.float64]


class Condensed:
    """S and S+ of one subdomain on its n boundary dofs.

    With the fixing nodes on the boundary, eliminating the interior from K + rho Rf Rf^T leaves S + rho Rf Rf^T, whose
    inverse is the boundary part of K+.
    """

    def __init__(self, subdomain: Subdomain, dofs: Int) -> None:
        """Factor; `dofs` (n,) are sorted local numbers."""
        nodes = np.unique(dofs // 2)
        self.S = schur_complement(subdomain.regularised(nodes), dofs)
        fixed, self._term = subdomain.fixing(nodes)
        at = np.searchsorted(dofs, fixed)
        self._fixed = np.ix_(at, at)
        self.S[self._fixed] -= self._term

    def held(self) -> Float:
        """(n, n) S + rho Rf Rf^T, positive definite."""
        held = self.S.copy()
        held[self._fixed] += self._term
        return held

    @cached_property
    def S_plus(self) -> Float:
        """(n, n) generalized inverse of S; made when first needed, for by then other memory is free again."""
        return _inverse(self.held())

    def stiffness(self, x: Float, out: Float) -> None:
        """S x for x (n,) or (n, k)."""
        np.dot(self.S, x, out=out)

    def flexibility(self, x: Float, out: Float) -> None:
        """S+ x for x (n,) or (n, k)."""
        np.dot(self.S_plus, x, out=out)


def schur_complement(matrix: csr_matrix, dofs: Int) -> Float:
    """(n, n) Schur complement of an SPD matrix on `dofs`, by MUMPS' partial factorization.

    Options have the prefix `feti_schur_`.
    """
    if len(dofs) == matrix.shape[0]:
        return matrix.toarray()
    A = PETSc.Mat().createAIJ(matrix.shape, csr=(matrix.indptr, matrix.indices, matrix.data), comm=PETSc.COMM_SELF)
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


def _inverse(S: Float) -> Float:
    """Inverse of an SPD matrix, whole."""
    factor, info = dpotrf(S, lower=1, overwrite_a=1)
    if info == 0:
        inverse, info = dpotri(factor, lower=1, overwrite_c=1)
    if info:
        raise np.linalg.LinAlgError(f"a regularised Schur complement is not positive definite (LAPACK info {info})")
    lower = np.tril(inverse)
    return np.asarray(lower + np.tril(lower, -1).T)
