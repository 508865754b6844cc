"""Dense Schur complements of sparse matrices, by one partial factorization (MUMPS) whose factors are not kept."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc
from scipy.sparse import csr_matrix

from feti_homog.common import petsc_ctypes
from feti_homog.typing import Float, Int

# What MUMPS says of a workspace that is smaller than it needs, and per cent more than its estimate that it then gets.
TOO_SMALL, MORE_WORKSPACE = (-8, -9), (None, 100, 1000)


def schur_complement(matrix: csr_matrix, rows: Int) -> Float:
    """(n, n) Schur complement of a matrix on `rows`, in Fortran order; the rest of the matrix has to be SPD.

    Options have the prefix `feti_schur_`.

    Raises:
        MemoryError: MUMPS cannot factor it, for want of memory as a rule.
    """
    if len(rows) == matrix.shape[0]:
        return np.asarray(matrix.toarray(order="F"))
    matrix.sort_indices()
    csr = matrix.indptr, matrix.indices, matrix.data
    A = PETSc.Mat().createAIJWithArrays(matrix.shape, csr, comm=PETSc.COMM_SELF)
    A.setOption(PETSc.Mat.Option.SPD, True)
    some = PETSc.IS().createGeneral(rows.astype(PETSc.IntType), comm=PETSc.COMM_SELF)
    try:
        for workspace in MORE_WORKSPACE:
            pc = _factored(A, some, workspace)
            try:
                error = _error(pc)
                if not error[0]:
                    return petsc_ctypes.schur_complement(pc.getFactorMatrix(), len(rows))
            finally:
                pc.destroy()
            if error[0] not in TOO_SMALL:
                break
    finally:
        A.destroy()
    raise MemoryError(f"MUMPS cannot make a Schur complement: INFOG(1) = {error[0]}, INFOG(2) = {error[1]}")


def _factored(A: PETSc.Mat, rows: PETSc.IS, workspace: int | None) -> PETSc.PC:
    """The partial factorization, as far as it came."""
    pc = PETSc.PC().create(PETSc.COMM_SELF)
    pc.setOptionsPrefix("feti_schur_")
    pc.setOperators(A)
    pc.setType(PETSc.PC.Type.CHOLESKY)
    pc.setFactorSolverType(PETSc.Mat.SolverType.MUMPS)
    pc.setFromOptions()
    pc.setFactorSetUpSolverType()
    if pc.getFactorSolverType() == PETSc.Mat.SolverType.MUMPS:
        # MUMPS' own scaling loses digits of coarse matrices, which are scaled.
        pc.getFactorMatrix().setMumpsIcntl(8, 0)
        if workspace is not None:
            pc.getFactorMatrix().setMumpsIcntl(14, workspace)
    petsc_ctypes.set_schur(pc.getFactorMatrix(), rows)
    pc.setUp()
    return pc


def _error(pc: PETSc.PC) -> tuple[int, int]:
    """MUMPS' INFOG(1) and INFOG(2) if the first is an error, of which PETSc says nothing; else zeros."""
    if pc.getFactorSolverType() != PETSc.Mat.SolverType.MUMPS:
        return 0, 0
    first, second = (int(pc.getFactorMatrix().getMumpsInfog(k)) for k in (1, 2))
    return (first, second) if first < 0 else (0, 0)
