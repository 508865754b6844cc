"""Dense Schur complements of sparse matrices, by one partial factorization (MUMPS) whose factors are not kept."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc
from scipy.sparse import csr_matrix

from feti_homog.common import petsc_ctypes
from feti_homog.typing import Float, Int


def schur_complement(matrix: csr_matrix, rows: Int) -> Float:
    """(n, n) Schur complement of a matrix on `rows`, in Fortran order; the rest of the matrix has to be SPD.

    Options have the prefix `feti_schur_`.
    """
    if len(rows) == matrix.shape[0]:
        return np.asarray(matrix.toarray(order="F"))
    matrix.sort_indices()
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
    if pc.getFactorSolverType() == PETSc.Mat.SolverType.MUMPS:
        # MUMPS' own scaling loses digits of coarse matrices, which are scaled.
        pc.getFactorMatrix().setMumpsIcntl(8, 0)
    some = PETSc.IS().createGeneral(rows.astype(PETSc.IntType), comm=PETSc.COMM_SELF)
    petsc_ctypes.set_schur(pc.getFactorMatrix(), some)
    pc.setUp()
    S = petsc_ctypes.schur_complement(pc.getFactorMatrix(), len(rows))
    pc.destroy()
    A.destroy()
    return S
