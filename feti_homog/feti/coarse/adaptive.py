"""The adaptive coarse problem: soft modes of the subdomains deflated beside the rigid-body motions.

U = M^-1 B V for the kernels and the soft modes V of all subdomains, so U holds Q G with Q = M^-1.  A correction z keeps
what no coarse vector can do better,

    T z = z - U c,   [U^T F U   U^T G] [c]   [U^T F z]
                     [G^T U     0    ] [a] = [G^T z  ],

and a residual r loses the rigid-body part that makes U^T r vanish (Spillane & Rixen, IJNME 95, 2013, Section 5).
Once some rows are inactive, M^-1 is another and Q G no longer among its range; then G itself joins U.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_matrix, diags, hstack

from feti_homog.common import process_memory
from feti_homog.feti.coarse.deflation_vectors import preconditioned
from feti_homog.feti.coarse.geneo import coarse_vectors, dual_blocks
from feti_homog.feti.coarse.natural import NaturalCoarseSpace
from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.feti.decomposition.neighbours import Neighbours
from feti_homog.feti.linalg.dense_block_sum import DenseBlockSum
from feti_homog.feti.linalg.distributed_matrix import add_shared_rows
from feti_homog.feti.linalg.replicated_saddle_point import ReplicatedSaddlePoint, coarse_saddle_point
from feti_homog.feti.linalg.saddle_point import SaddlePoint
from feti_homog.feti.operators.interface_operators import InterfaceOperators
from feti_homog.feti.preconditioners.scaled import StiffnessScaled
from feti_homog.feti.thresholds import DEFAULTS
from feti_homog.typing import Float, Int

THRESHOLD = 0.24
# Active rows per coarse vector below which the vectors are taken to depend on each other.
ROOM = 4
# Largest T T z - T z, and G^T T z, of a usable coarse problem, relative to T z and G^T z.
LEAK = 1e-6


class AdaptiveCoarseSpace(NaturalCoarseSpace):
    """The coarse space of this module.  Every rank holds its rows of U and a factor of the coarse matrix.

    Attributes:
        threshold: tau.
        counts: soft modes of each of this rank's subdomains.
    """

    def __init__(
        self,
        comm: MPI.Intracomm,
        jump_operator: JumpOperator,
        boundary: InterfaceOperators,
        scaling: StiffnessScaled,
        threshold: float,
        replicated_vectors: int = DEFAULTS.replicated_vectors,
    ) -> None:
        """Find the soft modes and factor.  All boundary operators must be dense but of large bodies.  Collective."""
        super().__init__(comm, jump_operator, boundary)
        self.threshold, self._replicated_vectors = threshold, replicated_vectors
        self.jump_operator = jump_operator
        neighbours = Neighbours(comm, jump_operator, boundary.subdomains)
        self._rows, self._boundary = neighbours.rows, boundary
        self._blocks = dual_blocks(comm, jump_operator, boundary, scaling, self._rows)
        V = coarse_vectors(self._blocks, neighbours, threshold)
        process_memory.trim()
        self.counts = [v.shape[1] - b.R.shape[1] for v, b in zip(V, self._blocks, strict=True)]
        self._mask = np.ones(len(jump_operator.rows))
        own = (boundary.B @ self.R).tocsr()
        shape = (own.shape[0], self.dimension)
        self._motions = csr_matrix((own.data, own.indices + self.own.start, own.indptr), shape=shape)
        self._complete, self._usable, self._sufficient = False, True, False
        # The faintest entries of U are dropped for large bodies.
        self._exact = not comm.allreduce(any(boundary.facewise), MPI.LOR)
        self.saddle: SaddlePoint | ReplicatedSaddlePoint | None = None
        self._E: csr_matrix
        # (columns, S+ B^T U there) of each subdomain
        self._answers: list[tuple[Int, Float]]
        U = preconditioned(comm, jump_operator, self._blocks, neighbours, V)
        process_memory.trim()
        self._span(U)
        self._active = np.ones(self.U.shape[0])
        self.factor()

    @property
    def vectors(self) -> int:
        """Dimension of the space that every residual is orthogonal to."""
        return int(self.U.shape[1])

    @property
    def deflates(self) -> bool:
        """Whether the coarse vectors are in use."""
        return self._usable

    def activate(self, active: Float) -> None:
        """Factorize for the owned rows of which `active` is 1; U is restricted to them."""
        super().activate(active)
        if not self._complete:
            rows, is_shared_row = self.jump_operator.rows, self.jump_operator.is_shared_row
            G = add_shared_rows(self.comm, self._motions, rows, is_shared_row, len(active))
            self._complete = True
            self._span(hstack([self._U, G]).tocsr())
        mask = self.jump_operator.gather(active).copy()
        changed = mask != self._mask
        touched = [i for i, rows in enumerate(self._rows) if changed[rows].any()]
        change = DenseBlockSum(self._E.shape)
        for i in touched:
            columns, loads = self._loads(i)
            change.add(columns, columns, -loads.T @ self._answers[i][1])
        self._mask = mask
        for i in touched:
            columns, loads = self._loads(i)
            self._answers[i] = columns, self._blocks[i].operator.apply_flexibility(loads)
            change.add(columns, columns, loads.T @ self._answers[i][1])
        self._E = self._E + change.matrix()
        self._active = active
        self.factor()

    def simplify(self) -> bool:
        """Leave it at rigid-body motions until rows change; whether that is a change."""
        usable, self._usable = self._usable, False
        return usable

    def admissible(self, z: Float) -> Float:
        """T z."""
        if not self._usable:
            return self.projected(z)
        c, _ = self._solve(self._energy(z), self.GaT @ z)
        return np.asarray(z - self._column(z) * (self.U @ c))

    def residual(self, r: Float) -> Float:
        """r - G a with U^T (r - G a) = 0 as far as that can be; or P r, where that does as well.

        While all rows are active U has M^-1 G in its range, so T M^-1 takes away what P leaves of it, to rounding.
        """
        if not self._usable or (self._sufficient and not self._complete):
            return self.projected(r)
        _, a = self._solve(self.U.T @ r, np.zeros((self.dimension, *r.shape[1:])))
        return np.asarray(r - self.Ga @ a)

    def improved(self, lam: Float, residual: Float, apply: Callable[[Float], Float]) -> tuple[Float, Float]:
        """lam + U c with U^T (r - F U c - G a) = 0 and G^T U c = 0, and its residual."""
        if not self._usable:
            return lam, residual
        c, _ = self._solve(self.U.T @ residual, np.zeros((self.dimension, *residual.shape[1:])))
        z = self._column(residual) * (self.U @ c)
        return lam + z, self.residual(residual - apply(z))

    def _column(self, x: Float) -> Float:
        """The active rows, to multiply x with."""
        return self._active if x.ndim == 1 else self._active[:, None]

    def _solve(self, energy: Float, work: Float) -> tuple[Float, Float]:
        """c and a of the coarse problem whose right-hand sides are the sums over ranks of the arguments."""
        if self.saddle is None:
            raise RuntimeError("the coarse problem has been freed")
        right = self.everywhere(np.concatenate([energy, work]))
        return self.saddle.solve(right[: self.vectors], right[self.vectors :])

    def factor(self) -> None:
        """Factor the coarse matrix, and find out whether it is any good.  Collective."""
        rows = int(self.everywhere(np.array([self._active.sum()]))[0])
        self._usable = rows >= ROOM * self.vectors and self._factored() and self._projects()
        # Of a badly conditioned coarse problem T would not take away enough.
        self._sufficient = self._exact and self.saddle is not None and self.saddle.well_conditioned

    def _factored(self) -> bool:
        seen = self.everywhere(abs(self.U.T) @ self._active) > 0.0
        mask = diags(seen.astype(float))
        E, K = mask @ self._E @ mask, (self.GaT @ self.U).tocsr() @ mask
        # Motions that nothing resists have no part in the columns of G.
        free = csr_matrix(self.free @ self.free.T)
        if self.comm.rank == 0:
            E = E + diags((~seen).astype(float))
        if self._complete:
            first = self.vectors - self.dimension
            stiffness = self.everywhere(E.diagonal())[first:].mean()
            at = free.tocoo()
            if self.comm.rank == 0:
                E = E + csr_matrix((stiffness * at.data, (at.row + first, at.col + first)), shape=E.shape)
        process_memory.trim()
        self.destroy()
        try:
            self.saddle = coarse_saddle_point(
                self.comm, E.tocsr(), K.tocsr(), free, "feti_coarse_", self._replicated_vectors
            )
        except np.linalg.LinAlgError:
            return False
        return True

    def destroy(self) -> None:
        """Free the factor.  Collective."""
        if self.saddle is not None:
            self.saddle.destroy()
            self.saddle = None

    def _projects(self) -> bool:
        """Whether T is a projector that leaves no work of rigid-body motions.

        With few active rows the columns of U depend on each other and the coarse matrix is singular.
        """
        z = self._active * np.cos(np.arange(len(self._active)) + 1.0)
        once = self.admissible(z)
        twice = self.admissible(once)
        before, after = (np.abs(self.everywhere(self.GaT @ x)).max(initial=0.0) for x in (z, once))
        size, change = self.everywhere(np.array([once @ once, (twice - once) @ (twice - once)]))
        return bool(after <= LEAK * before and change <= LEAK**2 * size)

    def _span(self, U: csr_matrix) -> None:
        """Let the columns of U (local rows, vectors) be the coarse vectors.  Collective."""
        self._U, self.U = U, self._own(U)
        E = DenseBlockSum((self.vectors, self.vectors))
        self._answers = []
        for i, block in enumerate(self._blocks):
            columns, loads = self._loads(i)
            self._answers.append((columns, block.operator.apply_flexibility(loads)))
            E.add(columns, columns, loads.T @ self._answers[i][1])
        self._E = E.matrix()

    def _loads(self, i: int) -> tuple[Int, Float]:
        """B^T U of subdomain i, on the active rows: its nonzero columns, and (boundary dofs, columns)."""
        rows = self._rows[i]
        columns, dense = _compressed(self._U, rows)
        return columns, self._blocks[i].B.T @ (self._mask[rows, None] * dense)

    def _energy(self, z: Float) -> Float:
        """This rank's share of U^T F z, (vectors,) or (vectors, k)."""
        x = self._boundary.BT @ self.jump_operator.gather(z)
        energy = np.zeros((self.vectors, *z.shape[1:]))
        for (columns, answer), span in zip(self._answers, self._boundary.slices, strict=True):
            energy[columns] += answer.T @ x[span]
        return energy

    def _own(self, local: csr_matrix) -> csr_matrix:
        """The owned of the local rows, which follow each other; no copy."""
        first, last = self.jump_operator.owned
        at = np.searchsorted(self.jump_operator.rows, first)
        ends = local.indptr[at : at + last - first + 1]
        part = slice(ends[0], ends[-1])
        entries = local.data[part], local.indices[part], ends - ends[0]
        return csr_matrix(entries, shape=(last - first, local.shape[1]))


def _compressed(matrix: csr_matrix, rows: Int) -> tuple[Int, Float]:
    """Some rows as a dense matrix: its nonzero columns and their values."""
    part = matrix[rows]
    seen = np.zeros(part.shape[1], bool)
    seen[part.indices] = True
    columns, number = np.flatnonzero(seen), np.cumsum(seen) - 1
    dense = np.zeros((len(rows), len(columns)))
    dense[np.repeat(np.arange(len(rows)), np.diff(part.indptr)), number[part.indices]] = part.data
    return columns, dense
