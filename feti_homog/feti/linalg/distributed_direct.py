"""Direct solves with a matrix that is the sum over ranks of parts, for right-hand sides that every rank has.

Either every rank has a factor of its own, or all ranks have one together.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy.sparse import csr_matrix

from feti_homog.feti.linalg.collectives import allgather_rows, share_columns
from feti_homog.feti.linalg.distributed_matrix import allreduce_sparse, assemble_distributed
from feti_homog.feti.linalg.sparse_direct import DirectSolver, factor_by_mumps, iterations
from feti_homog.feti.thresholds import MUMPS_COLUMNS_ONE_BY_ONE
from feti_homog.typing import Float


class DistributedDirectSolver:
    """One factorization by all ranks, none of which ever has the whole matrix (n, n)."""

    max_columns_one_by_one = MUMPS_COLUMNS_ONE_BY_ONE

    def __init__(self, comm: MPI.Intracomm, part: csr_matrix, prefix: str, near_kernel: Float | None = None) -> None:
        """Factor the sum of the parts (n, n).  Options under `prefix` (default: cholesky by MUMPS); `near_kernel` as of
        `DirectSolver`.  Collective.

        Raises:
            PETSc.Error: the matrix is not definite.
            CaseError: the library that the options name cannot factor distributed matrices, as CHOLMOD cannot.
        """
        self.comm = comm
        self._ksp = factor_by_mumps(assemble_distributed(comm, part), prefix, near_kernel)
        self._x, self._b = self._ksp.getOperators()[0].createVecs()

    def solve(self, B: Float) -> Float:
        """A^-1 B for B (n,) or (n, k), the same on every rank.  Collective."""
        right = B.reshape(len(B), -1)[slice(*self._b.getOwnershipRange())]
        X = np.empty(right.shape, order="F")
        if right.shape[1] > self.max_columns_one_by_one and self._ksp.getType() == PETSc.KSP.Type.PREONLY:
            self._solve_at_once(np.asfortranarray(right), X)
        else:
            for x, b in zip(X.T, right.T, strict=True):
                self._b.setArray(b)
                self._ksp.solve(self._b, self._x)
                x[:] = self._x.getArray(readonly=True)
        return allgather_rows(self.comm, X, np.diff(self._b.getOwnershipRanges())).reshape(B.shape)

    def _solve_at_once(self, right: Float, X: Float) -> None:
        """X = A^-1 B on this rank's rows (own rows, k), both in the order of Fortran.  Collective."""
        sizes = (self._b.getSizes(), X.shape[1])
        matrices = [PETSc.Mat().createDense(sizes, array=a, comm=self._b.comm) for a in (right, X)]
        self._ksp.getPC().matApply(*matrices)
        for matrix in matrices:
            matrix.destroy()

    @property
    def iterations(self) -> int:
        """Of the last solve for one column, if the options ask for an iterative method; else 1."""
        return iterations(self._ksp)

    def destroy(self) -> None:
        """Free the factor.  Collective."""
        for petsc_object in (self._ksp.getOperators()[0], self._ksp, self._x, self._b):
            petsc_object.destroy()


class ReplicatedDirectSolver:
    """A factorization by every rank, which solves for some of the right-hand sides."""

    def __init__(self, comm: MPI.Intracomm, part: csr_matrix, prefix: str, near_kernel: Float | None = None) -> None:
        """Factor the sum of the parts (n, n).  Options and errors as of `DirectSolver`.  Collective."""
        self.comm, self.local = comm, DirectSolver(allreduce_sparse(comm, part), prefix, near_kernel)

    def solve(self, B: Float) -> Float:
        """A^-1 B for B (n,) or (n, k), the same on every rank.  Collective."""
        return share_columns(self.comm, self.local.solve, B)

    @property
    def iterations(self) -> int:
        """As of `DirectSolver`."""
        return self.local.iterations

    def destroy(self) -> None:
        """Free the factor."""
        self.local.destroy()


def direct_solver(
    comm: MPI.Intracomm, part: csr_matrix, prefix: str, replicate: bool, near_kernel: Float | None = None
) -> ReplicatedDirectSolver | DistributedDirectSolver:
    """Solves with the sum over ranks of the parts, with a factor on each rank to `replicate`.  Collective.

    Raises:
        LinAlgError: the matrix is not definite; on all ranks if it is so on one, for rounding may differ where their
            processors do.
        CaseError: the library that the options name has no such factorization.
    """
    kind = ReplicatedDirectSolver if replicate or comm.size == 1 else DistributedDirectSolver
    solver, error = None, None
    try:
        solver = kind(comm, part, prefix, near_kernel)
    except PETSc.Error as caught:
        error = caught
    if comm.allreduce(error is not None, MPI.LOR) or solver is None:
        raise np.linalg.LinAlgError(f"a coarse matrix is singular: {error or 'on another rank'}") from error
    return solver
