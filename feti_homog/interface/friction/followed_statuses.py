"""The response of debonded faces to what is prescribed, kept up from statuses to neighbouring ones.

The rows of M x = c are x_j where it is prescribed, (S x)_j where it is free, and (S x)_j + s mu (S x)_n of a slip that
grows with the sign s.  Of R = [M^-1; S M^-1] a row r in place of row j changes rank one,

    R <- R - R_:j (w - e_j)^T / w_j,      w = r M^-1,      det M <- w_j det M,

w a row of R itself.  Changes are collected and added to R by blocks.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from feti_homog.interface.friction.status_system import LEAST_PIVOT, largest_share, residual
from feti_homog.typing import Bool, Float, Int

# Changes that are kept beside R.
MOST_CHANGES = 32
# Right-hand sides with no more entries are found from the columns of these alone.
FEW = 8
# Residual of a row, relative to its terms, that is rounding; that is too much after refinement; steps of refinement.
ROUNDED, TOO_MUCH, REFINEMENTS = 1e-14, 1e-11, 3


class FollowedStatuses:
    """R of m entries of x, which come in any order and stay.

    Attributes:
        S: (m, m) as of `CoulombFaces`.
        free: (m,) which rows are those of S.
        slope: (m,) s mu of sliding nodes at their rows of slips, 0 elsewhere.
        sign: of det M.
    """

    def __init__(self, S: Float) -> None:
        """Prescribe all entries: M is the identity."""
        m = len(S)
        self.S, self.free, self.slope, self.sign = S, np.zeros(m, bool), np.zeros(m), 1
        self._place: Int = np.arange(m)
        self._size, self._R = m, np.stack([np.eye(m), S])
        self._forget()

    def _forget(self) -> None:
        """Keep no changes beside R."""
        capacity = self._R.shape[1]
        self._U, self._V = np.zeros((2, capacity, MOST_CHANGES)), np.zeros((MOST_CHANGES, capacity))
        self._count = 0

    def turn(self, free: Bool, slope: Float) -> bool:
        """Have these rows, and return whether that went without a pivot that is too small."""
        left = np.flatnonzero((free != self.free) | (slope != self.slope))
        while len(left):
            failed = [j for j in left if not self._exchange(j, bool(free[j]), float(slope[j]))]
            if len(failed) == len(left):
                return False
            left = np.array(failed, np.int64)
        return True

    def _exchange(self, j: int, free: bool, slope: float) -> bool:
        """Take another row j, unless its pivot is too small."""
        at = int(self._place[j])
        w = self._row(int(free), at)
        if slope:
            w += slope * self._row(1, int(self._place[j - 1]))
        pivot = w[at]
        if abs(pivot) < LEAST_PIVOT:
            return False
        column = self._R[:, : self._size, at] - self._U[:, : self._size, : self._count] @ self._V[: self._count, at]
        w[at] -= 1.0
        self._add(column, w / pivot)
        self.free[j], self.slope[j] = free, slope
        self.sign *= 1 if pivot > 0.0 else -1
        return True

    def _row(self, kind: int, at: int) -> Float:
        """(m,) row of M^-1 or S M^-1."""
        count, size = self._count, self._size
        return np.asarray(self._R[kind, at, :size] - self._U[kind, at, :count] @ self._V[:count, :size])

    def _add(self, column: Float, row: Float) -> None:
        """Subtract an outer product from R."""
        self._U[:, : self._size, self._count], self._V[self._count, : self._size] = column, row
        self._count += 1
        if self._count == MOST_CHANGES:
            self._flush()

    def _flush(self) -> None:
        size, count = self._size, self._count
        for kind in range(2 if count else 0):
            self._R[kind, :size, :size] -= self._U[kind, :size, :count] @ self._V[:count, :size]
        self._count = 0

    def _inverse(self, c: Float) -> Float:
        """(m,) M^-1 c."""
        size, own = self._size, np.empty(self._size)
        own[self._place] = c
        few = np.flatnonzero(own)
        some = few if len(few) <= FEW else slice(size)
        change = self._U[0, :size, : self._count] @ (self._V[: self._count, :size][:, some] @ own[some])
        return np.asarray((self._R[0, :size, :size][:, some] @ own[some] - change)[self._place])

    def solve(self, x: Float, given: Float, terms: Callable[[Float], Float]) -> tuple[Float, Float] | None:
        """(m,) x and S x, with the rows `given` (m,), from a start that has the prescribed entries.

        None if R has lost too many digits: each row is checked by its `terms`, sum_j |S_ij x_j|.
        """
        prescribed = np.where(self.free, given, x)
        if np.count_nonzero(prescribed) <= FEW:
            x = np.where(self.free, self._inverse(prescribed), x)
        off = np.inf
        for step in range(1 + REFINEMENTS):
            y = self.S @ x
            left, before = residual(y, given, self.free, self.slope), off
            off = largest_share(left, np.abs(given) + terms(x), self.slope)
            if off <= ROUNDED or off > before / 2 or step == REFINEMENTS:
                break
            x = np.where(self.free, x + self._inverse(left), x)
        return (x, y) if off <= TOO_MUCH else None

    def grow(self, S: Float, old: Int, other: Int, units: Float) -> bool:
        """Prescribe more entries: of S (m', m') those that are here stand at the places `old` (m,), with their S.

        Theirs has `units` (m,) of what S was scaled by.  Between the places `other` S may be another one.  False if a
        pivot on the way is too small; then R is of no S.
        """
        if not self._replace(np.flatnonzero(np.isin(old, other)), S[other[:, None], other], units):
            return False
        self._flush()
        size, m = self._size, len(S)
        new = np.setdiff1d(np.arange(m), old)
        free, slope, place = np.zeros(m, bool), np.zeros(m), np.empty(m, np.int64)
        free[old], slope[old], place[old], place[new] = self.free, self.slope, self._place, np.arange(size, m)
        self.S, self.free, self.slope, self._place = S, free, slope, place
        self._reserve(m)
        order = np.argsort(place)
        first, last = order[:size], order[size:]
        sliding = np.flatnonzero(slope[first])
        coupling = S[first[:, None], last]
        C = np.where(free[first, None], coupling, 0.0)
        C[sliding] += slope[first[sliding], None] * S[first[sliding, None] - 1, last]
        inverse, forces = self._R
        rows = coupling.T @ inverse[:size, :size]
        forces[:size, size:m] = coupling - forces[:size, :size] @ C
        forces[size:m, :size] = rows
        forces[size:m, size:m] = S[last[:, None], last] - rows @ C
        inverse[:size, size:m] = -inverse[:size, :size] @ C
        inverse[size:m, :size] = 0.0
        inverse[size:m, size:m] = np.eye(m - size)
        self._size = m
        return True

    def _replace(self, entries: Int, block: Float, units: Float) -> bool:
        """Have another block of S between rising entries, and other units (m,) of all; False as `grow`.

        While the entries are prescribed, their rows of M^-1 are those of the identity: no more of S M^-1 changes.
        """
        free, slope, at = self.free.copy(), self.slope.copy(), self._place[entries]
        free[entries], slope[entries] = False, 0.0
        if len(entries) and not self.turn(free, slope):
            return False
        self._flush()
        some = np.flatnonzero(units != 1.0)
        places, unit = self._place[some], units[some]
        self._R[:, : self._size, places] *= np.where(self.free[some], 1.0 / unit, unit)
        self._R[:, places, : self._size] *= np.stack([1.0 / unit, unit])[:, :, None]
        before = self.S[entries[:, None], entries] * np.outer(units[entries], units[entries])
        self._R[1, at[:, None], at] += block - before
        return True

    def _reserve(self, m: int) -> None:
        """Have room for m entries, and for more to come."""
        if m > self._R.shape[1]:
            R = np.empty((2, m + m // 4, m + m // 4))
            R[:, : self._size, : self._size] = self._R[:, : self._size, : self._size]
            self._R = R
            self._forget()
