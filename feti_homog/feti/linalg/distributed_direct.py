"""Direct solves with a matrix that is the sum over ranks of parts, for right-hand sides that every rank has."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_matrix

from feti_homog.feti.linalg.collectives import allgather_rows
from feti_homog.feti.linalg.distributed_matrix import assemble_distributed
from feti_homog.feti.linalg.sparse_direct import DirectSolver, IndefiniteSolver, factor_by_mumps
from feti_homog.typing import Float


class DistributedDirectSolver:
    """One factorization by all ranks, none of which ever has the whole matrix (n, n)."""

    def __init__(self, comm: MPI.Intracomm, part: csr_matrix, prefix: str, definite: bool) -> None:
        """Factor the sum of the parts (n, n).  Options under `prefix` (default: cholesky by MUMPS).  Collective.

        Raises:
            PETSc.Error: the matrix is singular, or not definite as it should be.
            CaseError: the library that the options name cannot factor distributed matrices, as CHOLMOD cannot.
        """
        self.comm = comm
        self._ksp = factor_by_mumps(assemble_distributed(comm, part), prefix, definite)
        self._x, self._b = self._ksp.getOperators()[0].createVecs()

    def solve(self, b: Float) -> Float:
        """A^-1 b for b (n,) or (n, k), the same on every rank.  Collective."""
        x = np.empty_like(b)
        own = slice(*self._b.getOwnershipRange())
        counts = np.diff(self._b.getOwnershipRanges())
        for column, right in zip(x.reshape(len(b), -1).T, b.reshape(len(b), -1).T, strict=True):
            self._b.setArray(right[own])
            self._ksp.solve(self._b, self._x)
            column[:] = allgather_rows(self.comm, self._x.getArray(readonly=True), counts)
        return x

    def destroy(self) -> None:
        """Free the factor.  Collective."""
        for petsc_object in (self._ksp.getOperators()[0], self._ksp, self._x, self._b):
            petsc_object.destroy()


def direct_solver(
    comm: MPI.Intracomm, part: csr_matrix, prefix: str, definite: bool
) -> DirectSolver | DistributedDirectSolver:
    """Solves with the sum over ranks of the parts.  Collective; options and errors as of the solvers."""
    if comm.size > 1:
        return DistributedDirectSolver(comm, part, prefix, definite)
    return (DirectSolver if definite else IndefiniteSolver)(part, prefix)
