"""Explicit local operators: dense Schur complements and flexibilities on the boundary dofs of each subdomain.

They cost about a further factorization and pay after some ten to hundred applications, as a debonding path makes.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy.linalg.lapack import dpotrf, dpotri
from scipy.sparse import csr_matrix

from feti_homog import petsc_c
from feti_homog.feti.constraints import Constraints
from feti_homog.feti.local import LocalSolver
from feti_homog.feti.operator import DualOperator
from feti_homog.feti.subdomain import Subdomain

Int = NDArray[np.int64]
Float = NDArray[np.float64]


class DenseBlocks:
    """y_s = A_s x_s with a dense symmetric A_s for each subdomain of this rank."""

    def __init__(self, blocks: Sequence[Float]) -> None:
        self.blocks = blocks
        self.offsets = np.cumsum([0, *(len(b) for b in blocks)])
        self._y = np.empty(self.offsets[-1])

    def apply(self, x: Float) -> Float:
        """A x; the next call overwrites it."""
        for block, (first, last) in zip(self.blocks, pairwise(self.offsets), strict=True):
            np.dot(block, x[first:last], out=self._y[first:last])
        return self._y


class ExplicitDualOperator(DualOperator):
    """F with the boundary part of every K+ as a dense matrix.

    With the fixing nodes on the boundary, eliminating the interior from K + rho Rf Rf^T leaves S + rho Rf Rf^T, whose
    inverse is that boundary part; S is what the Dirichlet preconditioner needs.
    """

    def __init__(
        self, constraints: Constraints, solver: LocalSolver, subdomains: Sequence[Subdomain], boundary: Sequence[Int]
    ) -> None:
        super().__init__(constraints, solver)
        own = [solver.offsets[s] + dofs for s, dofs in enumerate(boundary)]
        self._Bb = self.B[:, np.concatenate(own or [np.zeros(0, np.int64)])]
        self._BbT = self._Bb.T.tocsr()
        schur, flexibility = [], []
        for subdomain, dofs in zip(subdomains, boundary, strict=True):
            nodes = np.unique(dofs // 2)
            S = schur_complement(subdomain.regularised(nodes), dofs)
            flexibility.append(_inverse(S))
            fixed, term = subdomain.fixing(nodes)
            at = np.searchsorted(dofs, fixed)
            S[np.ix_(at, at)] -= term
            schur.append(S)
        self.flexibility, self.schur = DenseBlocks(flexibility), DenseBlocks(schur)

    def apply(self, x: Float) -> Float:
        """sum_s B K+ B^T x."""
        return self.constraints.sum(self._Bb @ self.flexibility.apply(self._BbT @ self.constraints.gather(x)))


def schur_complement(matrix: csr_matrix, dofs: Int) -> Float:
    """(n, n) Schur complement of an SPD matrix on `dofs`, by MUMPS' partial factorization.

    Options have the prefix `feti_schur_`.
    """
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
    factor, info = dpotrf(S, lower=1)
    if info == 0:
        inverse, info = dpotri(factor, lower=1)
    if info:
        raise np.linalg.LinAlgError(f"a regularised Schur complement is not positive definite (LAPACK info {info})")
    lower = np.tril(inverse)
    return lower + np.tril(lower, -1).T
