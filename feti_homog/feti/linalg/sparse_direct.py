"""Direct solves on one rank, through PETSc's KSP and PC."""

from __future__ import annotations

import weakref
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from petsc4py import PETSc
from scipy.sparse import csr_matrix

from feti_homog.errors import CaseError
from feti_homog.feti.linalg.factor_status import check_factor, power_of_two
from feti_homog.feti.thresholds import CHOLMOD_COLUMNS_ONE_BY_ONE, ITERATIVE_RTOL, MUMPS_EXTRA_WORKSPACE_PERCENT
from feti_homog.typing import Float

# PETSc's error code for a factorization that the chosen library does not have (PETSC_ERR_MISSING_FACTOR).
MISSING_FACTOR = 92
# With these CHOLMOD makes L L^T of small matrices too, which those that are indefinite do not have: D of its own
# L D L^T may have any sign.
DEFINITE = {"mat_cholmod_final_asis": False, "mat_cholmod_final_ll": True}


class DirectSolver:
    """X = A^-1 B for one symmetric definite matrix A (n, n) and any number of right-hand sides."""

    max_columns_one_by_one = CHOLMOD_COLUMNS_ONE_BY_ONE

    def __init__(self, matrix: csr_matrix, prefix: str) -> None:
        """Factorize.  Options under `prefix` (default: cholesky by CHOLMOD).

        Raises:
            LinAlgError, MemoryError, CaseError: as `factor_by_mumps`.
        """
        self._scale = power_of_two(matrix.diagonal())
        scaled = csr_matrix((self._scale * matrix.data, matrix.indices, matrix.indptr), shape=matrix.shape)
        self._ksp = factor_by_cholmod(scaled, prefix)
        self._x, self._b = self._ksp.getOperators()[0].createVecs()
        self._destroy = weakref.finalize(self, _destroy, self._ksp, self._x, self._b)

    def solve(self, B: Float) -> Float:
        """A^-1 B for B (n,) or (n, k)."""
        if B.size <= self.max_columns_one_by_one * len(B) or self._ksp.getType() != PETSc.KSP.Type.PREONLY:
            X = np.empty_like(B)
            for x, b in zip(X.reshape(len(B), -1).T, B.reshape(len(B), -1).T, strict=True):
                self._b.setArray(b)
                self._ksp.solve(self._b, self._x)
                np.multiply(self._x.getArray(readonly=True), self._scale, out=x)
            return X
        X = np.empty(B.shape, order="F")
        right = np.asfortranarray(B)
        matrices = [PETSc.Mat().createDense(X.shape, array=a, comm=PETSc.COMM_SELF) for a in (right, X)]
        self._ksp.getPC().matApply(*matrices)
        for matrix in matrices:
            matrix.destroy()
        X *= self._scale
        return X

    def destroy(self) -> None:
        """Free the factor now; otherwise it is freed with this object."""
        self._destroy()


def iterations(ksp: PETSc.KSP) -> int:
    """Of the last solve by an iterative method; 1 by a factor."""
    return 1 if ksp.getType() == PETSc.KSP.Type.PREONLY else int(ksp.getIterationNumber())


def factor_by_cholmod(matrix: csr_matrix, prefix: str) -> PETSc.KSP:
    """A KSP with the factorization of a symmetric definite matrix; options under `prefix`, CHOLMOD by default.

    Raises as `factor_by_mumps`.
    """
    A = _sequential(matrix)
    A.setOption(PETSc.Mat.Option.SPD, True)
    with _refusing_indefinite(prefix):
        ksp = _direct_ksp(A, prefix, PETSc.Mat.SolverType.CHOLMOD)
        _set_up(ksp)
    return ksp


def factor_by_mumps(A: PETSc.Mat, prefix: str, near_kernel: Float | None = None) -> PETSc.KSP:
    """A KSP with the factorization of a symmetric definite matrix on any communicator; options under `prefix`, MUMPS by
    default.

    The matrix should have rows and columns of similar size: MUMPS does not scale it here, for its own scaling loses
    all digits of coarse problems with contrasts of 1e6.  Multigrid learns of the `near_kernel` (n, k), orthonormal
    vectors of little energy.

    Raises:
        LinAlgError: the matrix is not positive definite, or too near to one that is singular.
        MemoryError: MUMPS could not factor.
        CaseError: the library that the options name has no such factorization.
    """
    _tell(A, near_kernel)
    A.setOption(PETSc.Mat.Option.SPD, True)
    ksp = _direct_ksp(A, prefix, PETSc.Mat.SolverType.MUMPS)
    pc = ksp.getPC()
    if pc.getFactorSolverType() == PETSc.Mat.SolverType.MUMPS:
        pc.getFactorMatrix().setMumpsIcntl(8, 0)
        pc.getFactorMatrix().setMumpsIcntl(14, MUMPS_EXTRA_WORKSPACE_PERCENT)
    _set_up(ksp)
    return ksp


def _set_up(ksp: PETSc.KSP) -> None:
    """Factor, and read what the library says of it."""
    try:
        ksp.setUp()
    except PETSc.Error as error:
        words = str(error).splitlines()[-1].split("] ", 1)[-1]
        raise np.linalg.LinAlgError(f"not positive definite ({words})") from error
    check_factor(ksp.getPC())


@contextmanager
def _refusing_indefinite(prefix: str) -> Iterator[None]:
    """Have the options DEFINITE, those that are given excepted."""
    database = PETSc.Options(prefix)
    added = {name: value for name, value in DEFINITE.items() if not database.hasName(name)}
    for name, value in added.items():
        database.setValue(name, value)
    try:
        yield
    finally:
        for name in added:
            database.delValue(name)


def _tell(A: PETSc.Mat, near_kernel: Float | None) -> None:
    """Let the matrix know of its near-kernel (n, k), the same on all of its ranks."""
    if near_kernel is None or not near_kernel.shape[1]:
        return
    vectors = [A.createVecLeft() for _ in near_kernel.T]
    for vector, values in zip(vectors, near_kernel.T, strict=True):
        vector.setArray(values[slice(*vector.getOwnershipRange())])
    space = PETSc.NullSpace().create(vectors=vectors, comm=A.comm)
    A.setNearNullSpace(space)
    # The matrix keeps them, and frees them with itself.
    for petsc_object in (space, *vectors):
        petsc_object.destroy()


def _direct_ksp(A: PETSc.Mat, prefix: str, library: str) -> PETSc.KSP:
    """A KSP that applies a Cholesky factorization by `library` once; options under `prefix` may change both."""
    ksp = PETSc.KSP().create(A.comm)
    ksp.setOptionsPrefix(prefix)
    ksp.setOperators(A)
    ksp.setType(PETSc.KSP.Type.PREONLY)
    ksp.setErrorIfNotConverged(True)
    ksp.setTolerances(rtol=ITERATIVE_RTOL)
    pc = ksp.getPC()
    pc.setType(PETSc.PC.Type.CHOLESKY)
    pc.setFactorSolverType(library)
    ksp.setFromOptions()
    try:
        pc.setFactorSetUpSolverType()
    except PETSc.Error as error:
        if error.ierr != MISSING_FACTOR:
            raise
        where = f"on {A.comm.size} ranks" if A.comm.size > 1 else "on one rank"
        raise CaseError(
            f"-{prefix}pc_factor_mat_solver_type {pc.getFactorSolverType()}: it has no {pc.getType()} factorization "
            f"of a matrix {where}; mumps has"
        ) from error
    return ksp


def _destroy(ksp: PETSc.KSP, *vectors: PETSc.Vec) -> None:
    """Free a factor at once: objects that Python merely drops stay until PETSc's garbage collection."""
    for petsc_object in (ksp.getOperators()[0], ksp, *vectors):
        petsc_object.destroy()


def _sequential(matrix: csr_matrix) -> PETSc.Mat:
    """The matrix as PETSc's, on this rank alone; both have the same arrays."""
    matrix.sort_indices()
    csr = matrix.indptr, matrix.indices, matrix.data
    return PETSc.Mat().createAIJWithArrays(matrix.shape, csr, comm=PETSc.COMM_SELF)
