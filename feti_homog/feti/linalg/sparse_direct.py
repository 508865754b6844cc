"""Sparse direct solvers on one rank by PETSc, with scaling and checks for all direct solvers.

Libraries have absolute thresholds: for a Schur complement, MUMPS replaces pivots below about 1e-16.  So matrices are
scaled to a largest diagonal entry between 1 and 2.  The scale is a power of two, which changes no digit.
"""

import math
import sys
import weakref
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy.sparse import csr_matrix

from feti_homog.errors import CaseError, ConvergenceError, FetiHomogError
from feti_homog.feti.thresholds import MUMPS_EXTRA_WORKSPACE_PERCENT, ZERO_TOLERANCE
from feti_homog.system.petsc import c_functions, options_database
from feti_homog.typing import Float

Options = Mapping[str, bool | int | str]
# INFOG(1) of MUMPS (see its users' guide) if a pivot is zero, and if memory or the allowed workspace is too small.
SINGULAR, NO_MEMORY = {-6, -10, -40}, {-5, -7, -8, -9, -11, -12, -13, -14, -15, -17, -19, -20}
# PETSc's error code if the library has no such factorization (PETSC_ERR_MISSING_FACTOR).
MISSING_FACTOR = 92
NOT_CONVERGED = 91  # PETSC_ERR_NOT_CONVERGED
# End of PETSc's message if CHOLMOD is out of memory.
CHOLMOD_OUT_OF_MEMORY = "failed with status -2"
# With these options CHOLMOD computes L L^T for small matrices, too, and fails if the matrix is indefinite: with the
# default L D L^T, entries of D may have any sign.
DEFINITE: Options = {"mat_cholmod_final_asis": False, "mat_cholmod_final_ll": True}
# With these options CHOLMOD eliminates the rows in their order, and tries no other order.
ORDERED: Options = {"pc_factor_mat_ordering_type": "natural", "mat_cholmod_nmethods": 1}


def power_of_two(diagonal: Float, comm: MPI.Intracomm | None = None) -> float:
    """Return the power of two that scales the largest diagonal entry to [1, 2).

    The scale is 1 if no entry is positive.  With `comm`, the diagonal is distributed, and the call is collective.

    Raises:
        LinAlgError: an entry is not finite; with `comm`, on all ranks.
    """
    largest = float(diagonal.max(initial=0.0)) if np.isfinite(diagonal).all() else math.inf
    if comm is not None:
        largest = comm.allreduce(largest, MPI.MAX)
    if math.isinf(largest):
        raise np.linalg.LinAlgError("matrix: entries are not finite")
    return math.ldexp(1.0, 1 - max(math.frexp(largest)[1], sys.float_info.min_exp)) if largest > 0.0 else 1.0


def check_factor(pc: PETSc.PC) -> None:
    """Raise an exception if the library of `pc` reports an error or wrong pivots.

    Raises:
        LinAlgError: the matrix is singular or, with Cholesky, not positive definite, or MUMPS replaced tiny pivots.
        MemoryError: MUMPS lacks memory; FetiHomogError: MUMPS fails for another reason, usually its options.
    """
    library, is_cholesky = pc.getFactorSolverType(), pc.getType() == PETSc.PC.Type.CHOLESKY
    negative = 0
    if library == PETSc.Mat.SolverType.MUMPS:
        factor = pc.getFactorMatrix()
        first, second, replaced = (int(factor.getMumpsInfog(k)) for k in (1, 2, 25))
        error = f"INFOG(1) = {first}, INFOG(2) = {second}"
        if first in SINGULAR:
            raise np.linalg.LinAlgError(f"singular (MUMPS: {error})")
        if first in NO_MEMORY:
            raise MemoryError(f"MUMPS: {error}")
        if first < 0:
            choices = options_database.choices(pc.getOptionsPrefix()).items()
            options = ", ".join(f"-{name} {value}".strip() for name, value in choices) or "none"
            raise FetiHomogError(f"MUMPS cannot factor a matrix: {error} (see its users' guide); options: {options}")
        if replaced:
            raise np.linalg.LinAlgError(f"nearly singular (MUMPS: INFOG(25) = {replaced} tiny pivots were replaced)")
        # For unsymmetric matrices INFOG(12) counts exchanged pivots.
        negative = int(factor.getMumpsInfog(12)) if is_cholesky else 0
    elif library == PETSc.Mat.SolverType.PETSC and is_cholesky:
        negative, zero, _ = pc.getFactorMatrix().getInertia()
        negative += zero
    if negative:
        raise np.linalg.LinAlgError(f"not positive definite ({library}: {negative} pivots are not positive)")


class DirectSolver:
    """A solver X = A^-1 B for one symmetric definite matrix A (n, n) on one rank."""

    def __init__(self, matrix: csr_matrix, prefix: str, is_ordered: bool = False) -> None:
        """Factor A = `matrix`, by default by CHOLMOD's Cholesky; `is_ordered` and exceptions are as in `factored`."""
        self._scale = power_of_two(matrix.diagonal())
        scaled = csr_matrix((self._scale * matrix.data, matrix.indices, matrix.indptr), shape=matrix.shape)
        self._ksp = factored(sequential(scaled), prefix, PETSc.Mat.SolverType.CHOLMOD, is_ordered=is_ordered)
        self._x, self._b = self._ksp.getOperators()[0].createVecs()
        pc, A = self._ksp.getPC(), self._ksp.getOperators()[0]
        is_cholesky = pc.getType() == PETSc.PC.Type.CHOLESKY
        # A factor of CHOLMOD needs no matrix: an empty matrix with the same size saves the memory.
        if is_cholesky and pc.getFactorSolverType() == PETSc.Mat.SolverType.CHOLMOD and is_direct(self._ksp):
            empty = PETSc.Mat().createAIJ(A.getSizes(), nnz=0, comm=A.comm)
            empty.assemble()
            pc.setReusePreconditioner(True)
            self._ksp.setOperators(empty)
            A.destroy()
        self._destroy = weakref.finalize(self, _destroy, self._ksp, self._x, self._b)

    def solve(self, B: Float) -> Float:
        """Compute A^-1 B for B (n,) or (n, k); raises like `solve_columns`."""
        X = solve_columns(self._ksp, self._x, self._b, B if B.ndim == 2 else B[:, None])
        X *= self._scale
        return X.reshape(B.shape)

    def destroy(self) -> None:
        """Free the factor; without this call, the destructor frees the factor."""
        self._destroy()


def is_direct(ksp: PETSc.KSP) -> bool:
    """Return whether the solver applies a factor and does not iterate."""
    return bool(ksp.getType() == PETSc.KSP.Type.PREONLY)


def solve_columns(ksp: PETSc.KSP, x: PETSc.Vec, b: PETSc.Vec, B: Float) -> Float:
    """Compute X = A^-1 B (owned rows, k), in Fortran order, for B (owned rows, k).

    Collective on the ranks of A.  `x` and `b` are work vectors.  Iterative methods solve column by column.  Raises
    ConvergenceError if an iterative method does not converge.
    """
    X = np.empty(B.shape, order="F")
    if B.shape[1] > 1 and is_direct(ksp):
        sizes = (b.getSizes(), B.shape[1])
        matrices = [PETSc.Mat().createDense(sizes, array=a, comm=b.comm) for a in (np.asfortranarray(B), X)]
        ksp.getPC().matApply(*matrices)
        for matrix in matrices:
            matrix.destroy()
        return X
    for column, right in zip(X.T, B.T, strict=True):
        b.setArray(right)
        try:
            ksp.solve(b, x)
        except PETSc.Error as error:
            if error.ierr != NOT_CONVERGED:
                raise
            method, solver = ksp.getType(), f"-{ksp.getOptionsPrefix()}"
            end = f"KSPConvergedReason {int(ksp.getConvergedReason())}, iterations: {ksp.getIterationNumber()}"
            cure = f"raise {solver}ksp_max_it or {solver}ksp_rtol, or choose another {solver}pc_type"
            raise ConvergenceError(f"{solver}ksp_type {method}: no convergence ({end}); {cure}") from error
        column[:] = x.getArray(readonly=True)
    return X


def factored(A: PETSc.Mat, prefix: str, library: str, is_ordered: bool = False) -> PETSc.KSP:
    """Return a KSP with the Cholesky factor of a symmetric definite matrix A.

    Collective on the ranks of A.  `library` is the default, and options with `prefix` may choose another method.  With
    `is_ordered`, the rows are eliminated in their order.  Rows and columns should have similar sizes, as MUMPS does not
    scale here: the scaling of MUMPS loses all digits of coarse problems with contrasts of 1e6.

    Raises:
        LinAlgError: A is not positive definite, or nearly singular.
        MemoryError: MUMPS or CHOLMOD is out of memory.
        CaseError: the library in the options has no such factorization; FetiHomogError: as in `check_factor`.
    """
    A.setOption(PETSc.Mat.Option.SPD, True)
    ksp = PETSc.KSP().create(A.comm)
    ksp.setOptionsPrefix(prefix)
    ksp.setOperators(A)
    ksp.setType(PETSc.KSP.Type.PREONLY)
    ksp.setErrorIfNotConverged(True)
    ksp.setTolerances(rtol=ZERO_TOLERANCE)
    pc = ksp.getPC()
    pc.setType(PETSc.PC.Type.CHOLESKY)
    pc.setFactorSolverType(library)
    with _unless_given({**DEFINITE, **(ORDERED if is_ordered else {})}, prefix):
        ksp.setFromOptions()
        try:
            pc.setFactorSetUpSolverType()
        except PETSc.Error as error:
            if error.ierr != MISSING_FACTOR:
                raise
            where = f"on {A.comm.size} ranks" if A.comm.size > 1 else "on one rank"
            raise CaseError(
                f"-{prefix}pc_factor_mat_solver_type {pc.getFactorSolverType()}: no {pc.getType()} "
                f"factorization of a matrix {where}; expected mumps"
            ) from error
        if pc.getFactorSolverType() == PETSc.Mat.SolverType.MUMPS:
            pc.getFactorMatrix().setMumpsIcntl(8, 0)
            pc.getFactorMatrix().setMumpsIcntl(14, MUMPS_EXTRA_WORKSPACE_PERCENT)
        try:
            ksp.setUp()
        except PETSc.Error as error:
            if pc.getFactorSolverType() == PETSc.Mat.SolverType.MUMPS:
                check_factor(pc)
            message = c_functions.error_words(error)
            if message.endswith(CHOLMOD_OUT_OF_MEMORY):
                raise MemoryError(message) from error
            raise np.linalg.LinAlgError(f"not positive definite ({message})") from error
    check_factor(pc)
    return ksp


@contextmanager
def _unless_given(options: Options, prefix: str) -> Iterator[None]:
    """Context manager: set PETSc options during a block, except options that the user has set."""
    database = PETSc.Options(prefix)
    added = {name: value for name, value in options.items() if not database.hasName(name)}
    for name, value in added.items():
        database.setValue(name, value)
    try:
        yield
    finally:
        for name in added:
            database.delValue(name)


def _destroy(ksp: PETSc.KSP, *vectors: PETSc.Vec) -> None:
    """Destroy a KSP, its matrix and vectors at once, not in PETSc's garbage collection."""
    for petsc_object in (ksp.getOperators()[0], ksp, *vectors):
        petsc_object.destroy()


def sequential(matrix: csr_matrix) -> PETSc.Mat:
    """Share the arrays of `matrix` with a PETSc matrix on this rank; the indices are first sorted in place."""
    matrix.sort_indices()
    csr = matrix.indptr, matrix.indices, matrix.data
    return PETSc.Mat().createAIJWithArrays(matrix.shape, csr, comm=PETSc.COMM_SELF)
