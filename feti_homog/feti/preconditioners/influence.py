"""Influence of unit jumps: the inverse of the projected dual operator, exact for any active rows.

With all bonds intact the multipliers that close the jumps g are H g,

    H = B_D (S - S Z (Z^T S Z)^-1 Z^T S) B_D^T,  B_D = W^-1 B D^-1,  G^T H = 0,

for the displacements Z y of the bonded cell.  Without the rows D (no force there, jumps as they like) they are

    H_D g = H g - H[:, D] H[D, D]^-1 (H g)[D].

A node that debonds costs two columns of H, a face that closes or opens nothing; the cell is never factored again.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dpstrf

from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.feti.operators.interface_operators import InterfaceOperators
from feti_homog.feti.preconditioners.assembled_schur import AssembledSchur
from feti_homog.feti.preconditioners.scaled import StiffnessScaled
from feti_homog.typing import Float, Int

# Columns of H that are found at once.
CHUNK = 32
# Pivots of H[D, D] smaller than this, relative to its diagonal, belong to forces on a loose fibre as a whole.
SINGULAR = 1e-10


class Influence:
    """z = H_D r on the active rows.  A Krylov method has nothing left to do but to confirm."""

    def __init__(self, comm: MPI.Intracomm, jump_operator: JumpOperator, boundary: InterfaceOperators) -> None:
        """Factor the bonded cell; all boundary operators must be dense.  Collective."""
        self.comm, self.start = comm, jump_operator.owned[0]
        self.boundary, self.bonded = boundary, AssembledSchur(comm, jump_operator, boundary)
        self.scaled = StiffnessScaled(comm, jump_operator, boundary, self._forces)
        rows = jump_operator.owned[1] - self.start
        # Rows that have ever been inactive, as they came, and H there, (known, known); its columns, with room for more.
        # `_inactive` tells which of them are so now, `_kept` which of those the factor is of.
        self._known: Int = np.zeros(0, np.int64)
        self._table, self._room = np.zeros((0, 0)), np.zeros((rows, CHUNK), order="F")
        self.activate(np.ones(rows))

    def activate(self, active: Float) -> None:
        """Restrict to the rows where `active` is 1; collective."""
        self._active = active
        inactive = np.concatenate(self.comm.allgather(self.start + np.flatnonzero(active == 0)))
        self._learn(np.setdiff1d(inactive, self._known))
        order = np.argsort(self._known)
        self._inactive = order[np.searchsorted(self._known, inactive, sorter=order)]
        if len(inactive):
            held = self._table[np.ix_(self._inactive, self._inactive)]
            factor, order, rank, _ = dpstrf(held, tol=SINGULAR * held.diagonal().max(), lower=1)
            self._factor, self._kept = factor[:rank, :rank], order[:rank] - 1

    @property
    def _columns(self) -> Float:
        """(owned rows, known) of H."""
        return self._room[:, : len(self._known)]

    def apply(self, r: Float) -> Float:
        """H_D r for r (owned rows,) or (owned rows, k); 0 on inactive rows."""
        z = self.scaled.apply(r)
        if len(self._inactive):
            z -= self._columns @ self._forces_on_inactive(self._everywhere(z, self._known))
        return (self._active if z.ndim == 1 else self._active[:, None]) * z

    def first(self, start: Float, closing: Float) -> Float:
        """What closes the jump is the solution."""
        return closing

    def _forces_on_inactive(self, z: Float) -> Float:
        """Jumps (known rows, ...) that take the forces z off the inactive rows; 0 on the others."""
        some = self._inactive[self._kept]
        jumps = np.zeros_like(z)
        half = solve_triangular(self._factor, z[some], lower=True)
        jumps[some] = solve_triangular(self._factor, half, lower=True, trans=1)
        return jumps

    def _forces(self, x: Float) -> Float:
        """S x - S Z (Z^T S Z)^-1 Z^T S x."""
        forces = self.boundary.apply_schur(x)
        return forces + self.boundary.apply_schur(self.bonded.relaxed(forces))

    def _learn(self, rows: Int) -> None:
        """Find the columns of H for these rows.  Collective."""
        for first in range(0, len(rows), CHUNK):
            some = rows[first : first + CHUNK]
            unit = np.zeros((len(self._active), len(some)))
            mine = (some >= self.start) & (some < self.start + len(unit))
            unit[some[mine] - self.start, np.flatnonzero(mine)] = 1.0
            self._add(some, self.scaled.apply(unit))

    def _add(self, rows: Int, columns: Float) -> None:
        old, self._known = len(self._known), np.concatenate([self._known, rows])
        n = len(self._known)
        if n > self._room.shape[1]:
            self._room = np.concatenate([self._room.T, np.empty((n, len(columns)))]).T
        self._room[:, old:n] = columns
        table = np.empty((n, n))
        table[:old, :old] = self._table
        table[:, old:] = self._everywhere(columns, self._known)
        table[old:, :old] = table[:old, old:].T
        self._table = table

    def _everywhere(self, x: Float, rows: Int) -> Float:
        """The values of x (owned rows, ...) on some global rows, on every rank."""
        mine = (rows >= self.start) & (rows < self.start + len(x))
        values = np.zeros((len(rows), *x.shape[1:]))
        values[mine] = x[rows[mine] - self.start]
        self.comm.Allreduce(MPI.IN_PLACE, values)
        return values
