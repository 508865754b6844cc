"""Direct solves on one rank, through PETSc's KSP and PC."""

from __future__ import annotations

import weakref

import numpy as np
from petsc4py import PETSc
from scipy.sparse import csr_matrix

from feti_homog.typing import Float

# Per cent of MUMPS' estimate of workspace that it may need more for pivoting.
PIVOTING_ROOM = 200


class DirectSolver:
    """X = A^-1 B for one symmetric definite matrix A and any number of right-hand sides."""

    # Right-hand sides up to which the library is faster with one at a time.
    few = 2

    def __init__(self, matrix: csr_matrix, prefix: str) -> None:
        """Factorize.  Options under `prefix` (default: cholesky by CHOLMOD).

        Raises:
            PETSc.Error: the matrix is not positive definite.
        """
        self._hold(factorized(matrix, prefix))

    def _hold(self, ksp: PETSc.KSP) -> None:
        self._ksp = ksp
        self._x, self._b = ksp.getOperators()[0].createVecs()
        self._release = weakref.finalize(self, _free, ksp, self._x, self._b)

    def solve(self, B: Float) -> Float:
        """A^-1 B for B (n,) or (n, k)."""
        if B.size <= self.few * len(B):
            X = np.empty_like(B)
            for x, b in zip(X.reshape(len(B), -1).T, B.reshape(len(B), -1).T, strict=True):
                self._b.setArray(b)
                self._ksp.solve(self._b, self._x)
                x[:] = self._x.getArray(readonly=True)
            return X
        X = np.empty(B.shape, order="F")
        right = np.asfortranarray(B)
        matrices = [PETSc.Mat().createDense(X.shape, array=a, comm=PETSc.COMM_SELF) for a in (right, X)]
        self._ksp.getPC().matApply(*matrices)
        for matrix in matrices:
            matrix.destroy()
        return X

    def destroy(self) -> None:
        """Free the factor, which otherwise goes with the object."""
        self._release()


class IndefiniteSolver(DirectSolver):
    """The same for an indefinite matrix whose rows and columns are scaled."""

    few = 1

    def __init__(self, matrix: csr_matrix, prefix: str) -> None:
        """Factorize by MUMPS, L D L^T.

        Raises:
            PETSc.Error: the matrix is singular.
        """
        self._hold(factored_by_mumps(_sequential(matrix), prefix, definite=False))


def factorized(matrix: csr_matrix, prefix: str) -> PETSc.KSP:
    """A KSP with the factorization of a symmetric definite matrix; options under `prefix`."""
    A = _sequential(matrix)
    A.setOption(PETSc.Mat.Option.SPD, True)
    ksp = _unfactored(A, prefix)
    ksp.getPC().setFactorSolverType(PETSc.Mat.SolverType.CHOLMOD)
    ksp.setFromOptions()
    ksp.setUp()
    return ksp


def factored_by_mumps(A: PETSc.Mat, prefix: str, definite: bool) -> PETSc.KSP:
    """A KSP with MUMPS' factorization of a symmetric matrix whose rows and columns are scaled; on any communicator."""
    A.setOption(PETSc.Mat.Option.SPD if definite else PETSc.Mat.Option.SYMMETRIC, True)
    ksp = _unfactored(A, prefix)
    ksp.getPC().setFactorSolverType(PETSc.Mat.SolverType.MUMPS)
    ksp.getPC().setFactorSetUpSolverType()
    # Its own scaling loses all digits of coarse problems with contrasts of 1e6.
    ksp.getPC().getFactorMatrix().setMumpsIcntl(8, 0)
    ksp.getPC().getFactorMatrix().setMumpsIcntl(14, PIVOTING_ROOM)
    ksp.setUp()
    return ksp


def _free(ksp: PETSc.KSP, *vectors: PETSc.Vec) -> None:
    """Free a factor at once; PETSc would keep what Python drops until it is told to clean up."""
    for thing in (ksp.getOperators()[0], ksp, *vectors):
        thing.destroy()


def _sequential(matrix: csr_matrix) -> PETSc.Mat:
    return PETSc.Mat().createAIJ(matrix.shape, csr=(matrix.indptr, matrix.indices, matrix.data), comm=PETSc.COMM_SELF)


def _unfactored(A: PETSc.Mat, prefix: str) -> PETSc.KSP:
    ksp = PETSc.KSP().create(A.comm)
    ksp.setOptionsPrefix(prefix)
    ksp.setOperators(A)
    ksp.setType(PETSc.KSP.Type.PREONLY)
    ksp.setErrorIfNotConverged(True)
    ksp.getPC().setType(PETSc.PC.Type.CHOLESKY)
    return ksp
