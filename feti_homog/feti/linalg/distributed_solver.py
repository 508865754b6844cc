"""Solves with a matrix that is the sum over ranks of parts: by elimination, or as the options ask for.

A right-hand side is such a sum, too: each rank has its part, and gets the solution, on its own unknowns.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy.sparse import csr_matrix

from feti_homog.feti.linalg.collectives import allgather_rows
from feti_homog.feti.linalg.distributed_matrix import assemble_distributed
from feti_homog.feti.linalg.factor_status import power_of_two
from feti_homog.feti.linalg.rank_tree import RankTree
from feti_homog.feti.linalg.sparse_direct import factor_by_mumps, iterations
from feti_homog.feti.linalg.tree_elimination import TreeElimination
from feti_homog.feti.thresholds import MUMPS_COLUMNS_ONE_BY_ONE
from feti_homog.parallel.distributed_arrays import allreduce_sum
from feti_homog.typing import Float, Int

# Options, after the prefix, that ask for a solver of PETSc's on all ranks.
CHOICES = "ksp_type", "pc_type"


class DistributedSolver:
    """PETSc's KSP on all ranks: an iterative method, or one factor."""

    max_columns_one_by_one = MUMPS_COLUMNS_ONE_BY_ONE

    def __init__(
        self,
        comm: MPI.Intracomm,
        total: int,
        unknowns: Int,
        part: csr_matrix,
        prefix: str,
        near_kernel: Float | None = None,
    ) -> None:
        """Options under `prefix` (default: cholesky by MUMPS).  Collective.

        Args:
            total, unknowns, part: as of `TreeElimination`.
            near_kernel: (u, c) vectors of little energy, of which multigrid learns.

        Raises:
            LinAlgError, MemoryError: as `factor_by_mumps`.
            CaseError: the library that the options name cannot factor distributed matrices, as CHOLMOD cannot.
        """
        self.comm, self.total, self.unknowns = comm, total, unknowns
        matrix = assemble_distributed(comm, part, unknowns, total)
        self._scale = power_of_two(matrix.getDiagonal().getArray(readonly=True), comm)
        matrix.scale(self._scale)
        self._ksp = factor_by_mumps(matrix, prefix, None if near_kernel is None else self._orthonormal(near_kernel))
        self._x, self._b = self._ksp.getOperators()[0].createVecs()

    def _orthonormal(self, vectors: Float) -> Float:
        """(n, m) a basis of the space of vectors (u, c) that ranks with the same unknown agree on; without zeros."""
        copies = self._sum(np.ones((len(vectors), 1)))
        whole = self._sum(vectors) / np.maximum(copies, 1.0)
        return np.linalg.qr(whole[:, whole.any(axis=0)])[0]

    def solve(self, B: Float) -> Float:
        """As `TreeElimination.solve`."""
        right = self._sum(B if B.ndim == 2 else B[:, None])[slice(*self._b.getOwnershipRange())]
        X = np.empty(right.shape, order="F")
        if right.shape[1] > self.max_columns_one_by_one and self._ksp.getType() == PETSc.KSP.Type.PREONLY:
            self._solve_at_once(np.asfortranarray(right), X)
        else:
            for x, b in zip(X.T, right.T, strict=True):
                self._b.setArray(b)
                self._ksp.solve(self._b, self._x)
                x[:] = self._x.getArray(readonly=True)
        X *= self._scale
        whole = allgather_rows(self.comm, X, np.diff(self._b.getOwnershipRanges()))
        return np.asarray(whole[self.unknowns]).reshape(B.shape)

    def _sum(self, B: Float) -> Float:
        """(n, k) the sum over ranks of B (u, k)."""
        part = np.zeros((self.total, B.shape[1]))
        part[self.unknowns] = B
        return allreduce_sum(self.comm, part)

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


class RenewedSolver:
    """Solves with a matrix that changes: by elimination, unless the options under a prefix name a method of PETSc's.

    Attributes:
        current: of the matrix as it is; None before it is factored, and when it is freed.
    """

    def __init__(self, comm: MPI.Intracomm, total: int, unknowns: Int, prefix: str) -> None:
        """`total` and `unknowns` as of `TreeElimination`; the latter may change a little, see `factor`.  Collective."""
        self._total, self._prefix = total, prefix
        self._tree = RankTree(comm, total, unknowns)
        self.current: TreeElimination | DistributedSolver | None = None

    def factor(self, unknowns: Int, part: csr_matrix, near_kernel: Float | None = None) -> None:
        """Factor, and free what there was before; arguments as of `DistributedSolver`.  Collective.

        Raises:
            LinAlgError: the matrix is not definite; on all ranks if it is so on one, for rounding may differ where
                processors do.
            CaseError: the library that the options name has no such factorization.
        """
        self._free()
        options = PETSc.Options()
        if not any(options.hasName(self._prefix + choice) for choice in CHOICES):
            self.current = TreeElimination(self._tree, self._total, unknowns, part, self._prefix)
            return
        comm, error = self._tree.comm, None
        try:
            self.current = DistributedSolver(comm, self._total, unknowns, part, self._prefix, near_kernel)
        except np.linalg.LinAlgError as caught:
            error = caught
        if comm.allreduce(error is not None, MPI.LOR):
            raise np.linalg.LinAlgError(f"a coarse matrix is singular: {error or 'on another rank'}") from error

    def solve(self, B: Float) -> Float:
        """As `TreeElimination.solve`."""
        assert self.current is not None, "nothing is factored"
        return self.current.solve(B)

    @property
    def iterations(self) -> int:
        """Of the last solve for one column, if the options ask for an iterative method; else 1."""
        return self.current.iterations if isinstance(self.current, DistributedSolver) else 1

    def destroy(self) -> None:
        """Free all, for good.  Collective."""
        self._free()
        self._tree.destroy()

    def _free(self) -> None:
        if self.current is not None:
            self.current.destroy()
            self.current = None
