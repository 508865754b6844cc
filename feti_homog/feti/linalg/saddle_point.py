"""Saddle-point systems of coarse problems: E c + K^T a = f, K c = g."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mpi4py import MPI
from scipy.sparse import bmat, csr_matrix, vstack

from feti_homog.common.distributed_arrays import allreduce_sum
from feti_homog.feti.linalg.collectives import allgather_rows
from feti_homog.feti.linalg.distributed_direct import DistributedDirectSolver, ReplicatedDirectSolver, direct_solver
from feti_homog.feti.linalg.distributed_matrix import reduce_scatter_rows
from feti_homog.feti.linalg.scaled_sparse import scaled
from feti_homog.feti.thresholds import (
    AUGMENTATION_WEIGHT,
    COARSE_SOLVES,
    INDEFINITE_COARSE_SOLVES,
    WELL_CONDITIONED_SOLVES,
)
from feti_homog.typing import Float

Solver = ReplicatedDirectSolver | DistributedDirectSolver


class SaddlePoint:
    """c and a for symmetric E (n, n), definite on the kernel of K (m, n), whose rows may depend on each other.

    Every rank has all of f, g, c and a, and parts of the matrices.  The unknowns are scaled to a unit diagonal of E and
    unit rows of K.

    Attributes:
        entries: nonzero ones of this rank's part of the augmented matrix.
    """

    def __init__(
        self,
        comm: MPI.Intracomm,
        E: csr_matrix,
        K: csr_matrix,
        null_projector: csr_matrix,
        prefix: str,
        replicate: bool,
        enough: Sequence[tuple[int, float]] = COARSE_SOLVES,
    ) -> None:
        """Factor the sums over ranks of E and K.  Collective.

        Args:
            E, K: this rank's parts, of one shape on all ranks.
            null_projector: (m, m) orthogonal projector to all a with K^T a = 0.
            prefix: of the options of the definite factor; those of the indefinite one have `indefinite_` behind it.
            replicate: whether every rank has a factor of its own.
            enough: solves with the definite factor, and the relative residual with which no more are made.

        Raises:
            LinAlgError: the matrix is singular.
            CaseError: the library that the options name cannot factor the matrix, or not on that many ranks.
        """
        self._columns = 1.0 / np.sqrt(allreduce_sum(comm, E.diagonal()))
        K = reduce_scatter_rows(comm, scaled(K, columns=self._columns))
        length = np.sqrt(np.asarray(K.multiply(K).sum(axis=1)).ravel())
        length = np.where(length > 0, length, 1.0)
        self._rows = 1.0 / np.concatenate(comm.allgather(length))
        E = scaled(E, self._columns, self._columns)
        self._system = _System(comm, E, scaled(K, 1.0 / length))
        self._inner: _Augmented | _Indefinite
        augmented = self._system.augmented()
        self.entries = int(augmented.nnz)
        try:
            definite = direct_solver(comm, augmented, prefix, definite=True, replicate=replicate)
            self._inner = _Augmented(self._system, definite)
            for self._solves, residual in enough:
                if self._error() <= residual:
                    return
            self.destroy()
        except np.linalg.LinAlgError:
            pass
        self._solves = INDEFINITE_COARSE_SOLVES
        bordered = self._system.bordered(null_projector)
        indefinite = direct_solver(comm, bordered, f"{prefix}indefinite_", definite=False, replicate=replicate)
        self._inner = _Indefinite(self._system, indefinite)

    def solve(self, f: Float, g: Float) -> tuple[Float, Float]:
        """c and a for f (n,) and g (m,), or (n, k) and (m, k).  Collective."""
        columns, rows = (s if f.ndim == 1 else s[:, None] for s in (self._columns, self._rows))
        c, a = self._inner.solve(columns * f, rows * g, self._solves)
        return columns * c, rows * a

    @property
    def well_conditioned(self) -> bool:
        """Whether a few solves with the augmented matrix were accurate enough."""
        return isinstance(self._inner, _Augmented) and self._solves <= WELL_CONDITIONED_SOLVES

    def destroy(self) -> None:
        """Free the factor.  Collective."""
        self._inner.solver.destroy()

    def _error(self) -> float:
        """Relative residual after solving for the right-hand sides of some known c and a, the largest of any rank.
        Collective."""
        c, a = (np.cos(np.arange(n) + 1.0) for n in (len(self._columns), len(self._rows)))
        f, g = self._system.residuals(np.zeros_like(c), np.zeros_like(a), c, a)
        rests = self._system.residuals(f, g, *self._inner.solve(f, g, self._solves))
        error = max(np.linalg.norm(r) / (np.linalg.norm(b) or 1.0) for r, b in zip(rests, (f, g), strict=True))
        return float(self._system.comm.allreduce(error, MPI.MAX))


class _System:
    """The scaled matrices: E (n, n), the sum of every rank's part, and K (m, n), of which every rank has some rows."""

    def __init__(self, comm: MPI.Intracomm, E: csr_matrix, K: csr_matrix) -> None:
        self.comm, self.E, self.K, self.KT = comm, E, K, K.T.tocsr()
        self._counts = np.array(comm.allgather(K.shape[0]))
        first = int(self._counts[: comm.rank].sum())
        self.own, self._m = slice(first, first + K.shape[0]), int(self._counts.sum())

    def allgather(self, own: Float) -> Float:
        """(m,) or (m, k), of which each rank brings the rows that it has of K.  Collective."""
        return allgather_rows(self.comm, own, self._counts)

    def residuals(self, f: Float, g: Float, c: Float, a: Float) -> tuple[Float, Float]:
        """f - E c - K^T a and g - K c.  Collective."""
        return f - allreduce_sum(self.comm, self.E @ c + self.KT @ a[self.own]), g - self.allgather(self.K @ c)

    def augmented(self) -> csr_matrix:
        """This rank's part of E + rho K^T K."""
        return (self.E + AUGMENTATION_WEIGHT * (self.KT @ self.K)).tocsr()

    def bordered(self, null_projector: csr_matrix) -> csr_matrix:
        """This rank's part of [E K^T; K -N] for the projector N to all a with K^T a = 0."""
        before, after = (csr_matrix((n, self.K.shape[1])) for n in (self.own.start, self._m - self.own.stop))
        K = vstack([before, self.K, after])
        return bmat([[self.E, K.T], [K, -null_projector if self.comm.rank == 0 else None]]).tocsr()


class _Augmented:
    """By E + rho K^T K, definite: steps of the augmented Lagrangian (Fortin & Glowinski, 1983).

    For columns that overlap widely K^T K has no entry that E has not, so this costs a quarter of an indefinite factor.
    """

    def __init__(self, system: _System, solver: Solver) -> None:
        self._system, self.solver = system, solver

    def solve(self, f: Float, g: Float, solves: int) -> tuple[Float, Float]:
        """c and a after so many steps, each with one sum over ranks.  Collective."""
        system, g = self._system, g[self._system.own]
        c = self.solver.solve(f + AUGMENTATION_WEIGHT * allreduce_sum(system.comm, system.KT @ g))
        a = AUGMENTATION_WEIGHT * (system.K @ c - g)
        for _ in range(solves - 1):
            missed = g - system.K @ c
            used = allreduce_sum(system.comm, system.E @ c + system.KT @ (a - AUGMENTATION_WEIGHT * missed))
            dc = self.solver.solve(f - used)
            c, a = c + dc, a + AUGMENTATION_WEIGHT * (system.K @ dc - missed)
        return c, system.allgather(a)


class _Indefinite:
    """By an L D L^T factor of the whole, for matrices that are too badly conditioned for the augmented one."""

    def __init__(self, system: _System, solver: Solver) -> None:
        self._system, self.solver = system, solver

    def solve(self, f: Float, g: Float, solves: int) -> tuple[Float, Float]:
        """c and a after so many steps of iterative refinement.  Collective."""
        x = self.solver.solve(np.concatenate([f, g]))
        for _ in range(solves - 1):
            residuals = self._system.residuals(f, g, x[: len(f)], x[len(f) :])
            x = x + self.solver.solve(np.concatenate(residuals))
        return x[: len(f)], x[len(f) :]
