"""Influence of unit jumps: the inverse of the projected dual operator, exact for any active rows.

With all bonds intact the multipliers that close the jumps g are H g,

    H = B_D (S - S Z (Z^T S Z)^-1 Z^T S) B_D^T,  B_D = W^-1 B D^-1,  G^T H = 0,

for the displacements Z y of the cell with all bonds intact.  Without the rows D (no force there, jumps as they like)
they are

    H_D g = H g - H[:, D] H[D, D]^-1 (H g)[D].

A node that debonds costs two columns of H, a face that closes or opens nothing; the cell is never factored again.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dpstrf

from feti_homog.common.distributed_arrays import gather_rows, scale_rows
from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.feti.operators.interface_operators import InterfaceOperators
from feti_homog.feti.preconditioners.assembled_schur import AssembledSchur
from feti_homog.feti.preconditioners.scaled import StiffnessScaled
from feti_homog.feti.preconditioners.spring_update import SpringUpdate
from feti_homog.feti.thresholds import INFLUENCE_CHUNK, SINGULAR_PIVOT
from feti_homog.typing import Float, Int


class InfluenceColumns:
    """H[:, K] and H[K, K] for the rows K that have ever been inactive, in the order in which they came.

    Attributes:
        rows: (k,) K, global numbers.
        block: (k, k) H[K, K] on every rank.
    """

    def __init__(self, comm: MPI.Intracomm, first: int, owned: int) -> None:
        """No columns yet; `first` of the `owned` rows is this rank's first global one."""
        self.comm, self.first = comm, first
        self.rows: Int = np.zeros(0, np.int64)
        self.block = np.zeros((0, 0))
        # Columns are appended in place; when they fill the buffer it doubles.
        self._buffer = np.zeros((owned, INFLUENCE_CHUNK), order="F")

    @property
    def owned(self) -> Float:
        """(owned rows, k) H[:, K]."""
        return self._buffer[:, : len(self.rows)]

    def append(self, rows: Int, columns: Float) -> None:
        """Append the columns H[:, rows], (owned rows, new).  Collective."""
        old, self.rows = len(self.rows), np.concatenate([self.rows, rows])
        n = len(self.rows)
        if n > self._buffer.shape[1]:
            self._buffer = np.concatenate([self._buffer.T, np.empty((n, len(columns)))]).T
        self._buffer[:, old:n] = columns
        block = np.empty((n, n))
        block[:old, :old] = self.block
        block[:, old:] = gather_rows(self.comm, columns, self.first, self.rows)
        block[old:, :old] = block[:old, old:].T
        self.block = block

    def positions(self, rows: Int) -> Int:
        """Where some rows of K are in K."""
        order = np.argsort(self.rows)
        return np.asarray(order[np.searchsorted(self.rows, rows, sorter=order)])


class Influence:
    """z = H_D r on the active rows: the Krylov method confirms it in one iteration.

    Attributes:
        assembled: the cell with all bonds intact.
        scaled: x -> H x, but for the `springs` at nodes where fibre and matrix are both cut.
    """

    def __init__(self, comm: MPI.Intracomm, jump_operator: JumpOperator, operators: InterfaceOperators) -> None:
        """Factor the cell with all bonds intact; all boundary operators must be dense.  Collective."""
        self.comm, self.first = comm, jump_operator.owned[0]
        self.operators, self.assembled = operators, AssembledSchur(comm, jump_operator, operators)
        self.scaled = StiffnessScaled(comm, jump_operator, operators, self._reactions)
        self.springs = SpringUpdate(comm, self.first, operators.compliance, self.scaled.apply)
        rows = jump_operator.owned[1] - self.first
        self._columns = InfluenceColumns(comm, self.first, rows)
        self.activate(np.ones(rows))

    def activate(self, active: Float) -> None:
        """Restrict to the rows where `active` is 1: factor H[D, D], where D are the others.  Collective."""
        self._active = active
        inactive = np.concatenate(self.comm.allgather(self.first + np.flatnonzero(active == 0)))
        self._compute_columns(np.setdiff1d(inactive, self._columns.rows))
        # Where the rows D, and those of them that the factor keeps, are in K.
        self._inactive = self._columns.positions(inactive)
        if len(inactive):
            block = self._columns.block[np.ix_(self._inactive, self._inactive)]
            factor, order, rank, _ = dpstrf(block, tol=SINGULAR_PIVOT * block.diagonal().max(), lower=1)
            self._factor, self._kept = factor[:rank, :rank], self._inactive[order[:rank] - 1]

    def apply(self, r: Float) -> Float:
        """H_D r for r (owned rows,) or (owned rows, k); 0 on inactive rows.  Collective."""
        z = self.springs.apply(self.scaled.apply(r))
        if len(self._inactive):
            z -= self._columns.owned @ self._inactive_jumps(gather_rows(self.comm, z, self.first, self._columns.rows))
        return scale_rows(self._active, z)

    def inverse_blocks(self, pairs: Int) -> Float:
        """(m, 2, 2) diagonal blocks of H_D, for the same pairs (m, 2) of active global rows on every rank.  Collective.

        Rows that leave together change the multipliers of their own by all of them, and open by H_ii^-1 lam_i.
        """
        self._compute_columns(np.setdiff1d(pairs, self._columns.rows))
        at = self._columns.positions(pairs.ravel()).reshape(-1, 2)
        blocks = self._columns.block[at[:, :, None], at[:, None, :]]
        if len(self._inactive):
            half = solve_triangular(self._factor, self._columns.block[np.ix_(self._kept, at.ravel())], lower=True)
            half = half.reshape(len(half), -1, 2)
            blocks = blocks - np.einsum("kmi,kmj->mij", half, half)
        return np.asarray(blocks)

    def initial_multipliers(self, previous: Float, closing: Float) -> Float:
        """What closes the jump is the solution."""
        return closing

    def _inactive_jumps(self, z: Float) -> Float:
        """H[D, D]^-1 z[D] on K (k,) or (k, columns), 0 off D: jumps that take the forces z off the inactive rows."""
        jumps = np.zeros_like(z)
        half = solve_triangular(self._factor, z[self._kept], lower=True)
        jumps[self._kept] = solve_triangular(self._factor, half, lower=True, trans=1)
        return jumps

    def _reactions(self, x: Float) -> Float:
        """S x - S Z (Z^T S Z)^-1 Z^T S x."""
        forces = self.operators.apply_skin(x)
        return forces + self.operators.apply_skin(self.assembled.relieving_displacement(forces))

    def _compute_columns(self, rows: Int) -> None:
        """Append the columns of H for these rows.  Collective."""
        for start in range(0, len(rows), INFLUENCE_CHUNK):
            some = rows[start : start + INFLUENCE_CHUNK]
            unit = np.zeros((len(self._active), len(some)))
            mine = (some >= self.first) & (some < self.first + len(unit))
            unit[some[mine] - self.first, np.flatnonzero(mine)] = 1.0
            self._columns.append(some, self.springs.apply(self.scaled.apply(unit)))
