"""Powers of two by which matrices are scaled for their factorization, and the statuses that libraries return of one.

Libraries have thresholds without a unit: where MUMPS leaves a Schur complement, it replaces pivots below about 1e-16.
So each matrix is factored with its largest diagonal entry between 1 and 2.  A power of two changes no digit.
"""

from __future__ import annotations

import math

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from feti_homog.typing import Float

# INFOG(1) of MUMPS where a pivot is zero.
SINGULAR = -10
LEAST_EXPONENT = -1000


def power_of_two(diagonal: Float, comm: MPI.Intracomm | None = None) -> float:
    """Return the factor that brings the largest entry of a diagonal, or of all ranks' parts of it, to between 1 and
    2.

    It is 1 where none is positive.  Collective, if there are ranks.

    Raises:
        LinAlgError: an entry is not finite; on all ranks.
    """
    largest = float(diagonal.max(initial=0.0)) if np.isfinite(diagonal).all() else math.inf
    if comm is not None:
        largest = comm.allreduce(largest, MPI.MAX)
    if math.isinf(largest):
        raise np.linalg.LinAlgError("a matrix has entries that are not finite")
    return math.ldexp(1.0, 1 - max(math.frexp(largest)[1], LEAST_EXPONENT)) if largest > 0.0 else 1.0


def check_factor(pc: PETSc.PC) -> None:
    """Read what the library of a factored `pc` returned beside the factor.

    Raises:
        LinAlgError: the matrix of a Cholesky factorization is not positive definite, or pivots are too small for MUMPS.
        MemoryError: MUMPS could not factor, for want of memory as a rule.
    """
    library, is_cholesky = pc.getFactorSolverType(), pc.getType() == PETSc.PC.Type.CHOLESKY
    negative = 0
    if library == PETSc.Mat.SolverType.MUMPS:
        negative = _read_mumps(pc.getFactorMatrix(), is_cholesky)
    elif library == PETSc.Mat.SolverType.PETSC and is_cholesky:
        negative, zero, _ = pc.getFactorMatrix().getInertia()
        negative += zero
    if negative:
        raise np.linalg.LinAlgError(f"not positive definite ({library}: {negative} pivots that are not positive)")


def mumps_error(factor: PETSc.Mat) -> tuple[int, int]:
    """MUMPS' INFOG(1) and INFOG(2) if the first is an error, which PETSc may keep to itself; else zeros."""
    first, second = (int(factor.getMumpsInfog(k)) for k in (1, 2))
    return (first, second) if first < 0 else (0, 0)


def _read_mumps(factor: PETSc.Mat, is_cholesky: bool) -> int:
    """Return the number of negative pivots. Raises as `check_factor`."""
    first, second = mumps_error(factor)
    if first == SINGULAR:
        raise np.linalg.LinAlgError(f"singular (MUMPS: INFOG(1) = {first}, INFOG(2) = {second})")
    if first:
        raise MemoryError(f"MUMPS cannot factor: INFOG(1) = {first}, INFOG(2) = {second}")
    replaced = int(factor.getMumpsInfog(25))
    if replaced:
        raise np.linalg.LinAlgError(f"nearly singular (MUMPS: INFOG(25) = {replaced} tiny pivots were replaced)")
    # Without symmetry INFOG(12) counts exchanged pivots.
    return int(factor.getMumpsInfog(12)) if is_cholesky else 0
