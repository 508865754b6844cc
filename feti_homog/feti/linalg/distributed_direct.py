"""Direct solves with a matrix that is the sum over ranks of parts, for right-hand sides that every rank has."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_matrix

from feti_homog.feti.linalg.distributed_matrix import distributed
from feti_homog.feti.linalg.sparse_direct import DirectSolver, IndefiniteSolver, factored_by_mumps
from feti_homog.typing import Float


class Distributed:
    """The ranks factor the matrix together (MUMPS), and none ever has all of it."""

    def __init__(self, comm: MPI.Intracomm, part: csr_matrix, prefix: str, definite: bool) -> None:
        """Factor the sum of the parts (n, n); options under `prefix`.  Collective.

        Raises:
            PETSc.Error: the matrix is singular, or not definite as it should be.
        """
        self.comm = comm
        self._ksp = factored_by_mumps(distributed(comm, part), prefix, definite)
        self._x, self._b = self._ksp.getOperators()[0].createVecs()

    def solve(self, b: Float) -> Float:
        """A^-1 b for b (n,) or (n, k), the same on every rank.  Collective."""
        x = np.empty_like(b)
        own = slice(*self._b.getOwnershipRange())
        counts = np.diff(self._b.getOwnershipRanges())
        for column, right in zip(x.reshape(len(b), -1).T, b.reshape(len(b), -1).T, strict=True):
            self._b.setArray(right[own])
            self._ksp.solve(self._b, self._x)
            whole = np.empty(len(b))
            self.comm.Allgatherv(self._x.getArray(readonly=True), (whole, counts))
            column[:] = whole
        return x

    def destroy(self) -> None:
        """Free the factor.  Collective."""
        for thing in (self._ksp.getOperators()[0], self._ksp, self._x, self._b):
            thing.destroy()


def solver(comm: MPI.Intracomm, part: csr_matrix, prefix: str, definite: bool) -> DirectSolver | Distributed:
    """Solves with the sum of the parts.  Collective."""
    if comm.size > 1:
        return Distributed(comm, part, prefix, definite)
    return (DirectSolver if definite else IndefiniteSolver)(part, prefix)
