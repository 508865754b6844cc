"""Saddle-point systems of coarse problems: E c + K^T a = f, K c = g."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy.sparse import bmat, csr_matrix, diags, vstack

from feti_homog.feti.linalg import distributed_direct
from feti_homog.feti.linalg.distributed_matrix import own_rows
from feti_homog.feti.linalg.sparse_direct import DirectSolver
from feti_homog.typing import Float

Solver = DirectSolver | distributed_direct.Distributed

# Of the constraints in the augmented matrix; each solve with it shrinks their error by about this factor.
WEIGHT = 1e7
# Relative residual that a coarse solve must reach, for T takes away nearly all of what it is applied to where materials
# differ much; and the fewest and most solves that are made to reach it.
ACCURATE = 1e-14
FEWEST_SOLVES, MOST_SOLVES = 3, 4
# Of the indefinite factor.
INDEFINITE_SOLVES = 2


class SaddlePoint:
    """c and a for symmetric E (n, n), definite on the kernel of K (m, n), whose rows may depend on each other.

    Every rank has all of f, g, c and a, and parts of the matrices.  The unknowns are scaled to a unit diagonal of E and
    unit rows of K.

    Attributes:
        entries: nonzero ones of this rank's part of the augmented matrix.
    """

    def __init__(self, comm: MPI.Intracomm, E: csr_matrix, K: csr_matrix, free: csr_matrix, prefix: str) -> None:
        """Factor the sums over ranks of E and K.  `free` (m, m) is a projector to all a with K^T a = 0.  Collective.

        Options under `prefix`.

        Raises:
            LinAlgError: the matrix is singular.
        """
        self._columns = 1.0 / np.sqrt(_sum(comm, E.diagonal()))
        K = own_rows(comm, (K @ diags(self._columns)).tocsr())
        length = np.sqrt(np.asarray(K.multiply(K).sum(axis=1)).ravel())
        length = np.where(length > 0, length, 1.0)
        self._rows = 1.0 / np.concatenate(comm.allgather(length))
        E = (diags(self._columns) @ E @ diags(self._columns)).tocsr()
        self._system = _System(comm, E, (diags(1.0 / length) @ K).tocsr())
        self._solves = FEWEST_SOLVES
        self._inner: _Augmented | _Indefinite
        augmented = self._system.augmented()
        self.entries = int(augmented.nnz)
        try:
            self._inner = _Augmented(self._system, distributed_direct.solver(comm, augmented, prefix, definite=True))
            if self._refine():
                return
            self.destroy()
        except PETSc.Error:
            pass
        self._solves = INDEFINITE_SOLVES
        try:
            whole = distributed_direct.solver(comm, self._system.beside(free), prefix, definite=False)
        except PETSc.Error as error:
            raise np.linalg.LinAlgError(f"a coarse matrix is singular: {error}") from error
        self._inner = _Indefinite(self._system, whole)

    def solve(self, f: Float, g: Float) -> tuple[Float, Float]:
        """c and a for f (n,) and g (m,), or (n, k) and (m, k).  Collective."""
        columns, rows = (s if f.ndim == 1 else s[:, None] for s in (self._columns, self._rows))
        c, a = self._inner.solve(columns * f, rows * g, self._solves)
        return columns * c, rows * a

    @property
    def benign(self) -> bool:
        """Whether the augmented matrix was good enough, and no solve more than the fewest was wanted."""
        return isinstance(self._inner, _Augmented) and self._solves == FEWEST_SOLVES

    def destroy(self) -> None:
        """Free the factor.  Collective."""
        self._inner.solver.destroy()

    def _refine(self) -> bool:
        """Make as many solves as it takes; whether that was enough."""
        while self._error() > ACCURATE:
            self._solves += 1
            if self._solves > MOST_SOLVES:
                return False
        return True

    def _error(self) -> float:
        """Relative residual of some system."""
        c, a = (np.cos(np.arange(n) + 1.0) for n in (len(self._columns), len(self._rows)))
        f, g = self._system.left(np.zeros_like(c), np.zeros_like(a), c, a)
        left = self._system.left(f, g, *self._inner.solve(f, g, self._solves))
        return float(max(np.linalg.norm(r) / (np.linalg.norm(b) or 1.0) for r, b in zip(left, (f, g), strict=True)))


class _System:
    """E (n, n), the sum of every rank's part, and K (m, n), of which every rank has some rows."""

    def __init__(self, comm: MPI.Intracomm, E: csr_matrix, K: csr_matrix) -> None:
        self.comm, self.E, self.K, self.KT = comm, E, K, K.T.tocsr()
        self._counts = np.array(comm.allgather(K.shape[0]))
        first = int(self._counts[: comm.rank].sum())
        self.own, self.total = slice(first, first + K.shape[0]), int(self._counts.sum())

    def everywhere(self, own: Float) -> Float:
        """(m,) or (m, k) of which every rank has the rows that it has of K.  Collective."""
        whole = np.empty((self.total, *own.shape[1:]))
        self.comm.Allgatherv(np.ascontiguousarray(own), (whole, self._counts * (whole.size // max(self.total, 1))))
        return whole

    def left(self, f: Float, g: Float, c: Float, a: Float) -> tuple[Float, Float]:
        """f - E c - K^T a and g - K c.  Collective."""
        return f - _sum(self.comm, self.E @ c + self.KT @ a[self.own]), g - self.everywhere(self.K @ c)

    def augmented(self) -> csr_matrix:
        """This rank's part of E + rho K^T K."""
        return (self.E + WEIGHT * (self.KT @ self.K)).tocsr()

    def beside(self, free: csr_matrix) -> csr_matrix:
        """This rank's part of [E K^T; K -free]."""
        empty = [csr_matrix((n, self.K.shape[1])) for n in (self.own.start, self.total - self.own.stop)]
        K = vstack([empty[0], self.K, empty[1]])
        return bmat([[self.E, K.T], [K, -free if self.comm.rank == 0 else None]]).tocsr()


class _Augmented:
    """By E + rho K^T K, definite: steps of the augmented Lagrangian (Fortin & Glowinski, 1983).

    For columns that overlap widely K^T K has no entry that E has not, so this costs a quarter of an indefinite factor.
    """

    def __init__(self, system: _System, solver: Solver) -> None:
        self._system, self.solver = system, solver

    def solve(self, f: Float, g: Float, solves: int) -> tuple[Float, Float]:
        """c and a after so many steps, each with one sum over ranks.  Collective."""
        system, g = self._system, g[self._system.own]
        c = self.solver.solve(f + WEIGHT * _sum(system.comm, system.KT @ g))
        a = WEIGHT * (system.K @ c - g)
        for _ in range(solves - 1):
            missed = g - system.K @ c
            dc = self.solver.solve(f - _sum(system.comm, system.E @ c + system.KT @ (a - WEIGHT * missed)))
            c, a = c + dc, a + WEIGHT * (system.K @ dc - missed)
        return c, system.everywhere(a)


class _Indefinite:
    """By an LDL^T factor of the whole, for matrices that are too badly conditioned for the other."""

    def __init__(self, system: _System, solver: Solver) -> None:
        self._system, self.solver = system, solver

    def solve(self, f: Float, g: Float, solves: int) -> tuple[Float, Float]:
        """c and a after so many steps of iterative refinement.  Collective."""
        x = self.solver.solve(np.concatenate([f, g]))
        for _ in range(solves - 1):
            left = self._system.left(f, g, x[: len(f)], x[len(f) :])
            x = x + self.solver.solve(np.concatenate(left))
        return x[: len(f)], x[len(f) :]


def _sum(comm: MPI.Intracomm, part: Float) -> Float:
    """Of the parts of all ranks.  Collective."""
    whole = np.empty_like(part)
    comm.Allreduce(part, whole)
    return whole
