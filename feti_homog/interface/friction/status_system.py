"""The linear system of debonded faces with prescribed statuses, factored, or updated when a few statuses change.

The rows of M x = c are x_j for prescribed entries, (S x)_j for free entries, and (S x)_j + s mu (S x)_j-1 for a slip j
of sign s beside the normal jump j - 1.  A row r in place of row j changes R = [M^-1; S M^-1] by rank one,

    R <- R - R_:j (w - e_j)^T / w_j,      w = r M^-1,      det M <- w_j det M,

where w is a row of R, or a sum of two; S, x and mu are as in `coulomb_faces`.  Changes are added to R in blocks.
"""

from collections.abc import Callable
from enum import IntEnum
from functools import cached_property

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from feti_homog.interface.contact import Status
from feti_homog.typing import Bool, Float, Int


class FaceStatus(IntEnum):
    """The status of a debonded node: stuck, sliding with the sign of the slip rate, or apart."""

    STICK = 0
    FORWARD = 1
    OPEN_FACE = 2
    BACKWARD = -1


STICK, FORWARD, OPEN_FACE, BACKWARD = FaceStatus

# Stiffness, relative to the stiffness of a node, that holds free motions; iterative refinement removes its effect.  A
# residual up to this fraction of the terms of its row drives no free motion.
HELD = 1e-9
# Pivot size below which a pivot belongs to a free motion; its sign is then rounding.
LEAST_PIVOT = 1e-6
# SOFT_PIVOT: pivot size below which inverse iteration searches for free motions.  MORE_MOTIONS: number of vectors
# beyond the number of soft pivots.  INVERSE_ITERATIONS: number of iterations, each of which reduces stiff motions by
# HELD.  UNRESISTED: largest relative stiffness of a free motion.
SOFT_PIVOT, MORE_MOTIONS, INVERSE_ITERATIONS, UNRESISTED = 1e-3, 3, 3, 0.1 * HELD
# Largest number of refinements, and the residual of each row, relative to its terms, at which refinement ends.
MOST_REFINEMENTS, ROUNDED = 20, 1e-14
# Number of changes that are collected before they are added to R.
MOST_CHANGES = 32
# Largest number of nonzero entries in a right-hand side for which only the columns of these entries are read.
FEW = 8
# Largest rounding in a row of S x, relative to its terms, that refinement may leave.
NOISE = 1e-11


def free_rows(status: Status, friction: Float, by_stress: Bool) -> tuple[Bool, Float]:
    """Return the mask (m,) of free entries of x, and the slopes (m,): s mu at sliding slips, 0 elsewhere."""
    free = np.concatenate([np.stack([status == OPEN_FACE, status != STICK], axis=1).ravel(), by_stress])
    slope = np.zeros(len(free))
    slope[1 : 2 * len(status) : 2] = np.where(np.abs(status) == 1, status * friction, 0.0)
    return free, slope


def residual(y: Float, rhs: Float, free: Bool, slope: Float) -> Float:
    """Return rhs - M x (m,) from the product y = S x (m,); 0 in prescribed rows."""
    sliding = np.flatnonzero(slope)
    missing = rhs - y
    missing[sliding] -= slope[sliding] * y[sliding - 1]
    return np.where(free, missing, 0.0)


def largest_share(residuals: Float, terms: Float, slope: Float) -> float:
    """Return the largest absolute residual (m,) relative to the `terms` (m,) of its row, see `FaceSystem.terms`."""
    size, sliding = terms.copy(), np.flatnonzero(slope)
    size[sliding] += np.abs(slope[sliding]) * terms[sliding - 1]
    return float((np.abs(residuals) / np.where(size > 0.0, size, 1.0)).max(initial=0.0))


class StatusSystem:
    """The factored system S x = rhs of the free rows, with prescribed x in other rows.

    A sliding node has the row S_t + s mu S_n, because the traction is s mu times the pressure.

    Attributes:
        free: (m,) mask of the unknown entries of x.
        sign: sign of the determinant, 0 with a free motion.
    """

    def __init__(self, S: Float, free: Bool, slope: Float) -> None:
        """Factor the rows from `free_rows` in S (m, m), as in `CoulombFaces`."""
        self.free = free
        sliding = np.flatnonzero(slope)
        position = np.cumsum(self.free) - 1
        self._rows = S[self.free]
        self._rows[position[sliding]] += slope[sliding, None] * S[sliding - 1]
        A = self._rows[:, self.free]
        A[np.diag_indices(len(A))] += HELD
        self._factor = lu_factor(A, overwrite_a=True, check_finite=False) if len(A) else None

    @property
    def sign(self) -> int:
        """The sign of the determinant, 0 with a free motion; 1 without free rows."""
        if self._factor is None:
            return 1
        lu, pivots = self._factor
        if np.abs(lu.diagonal()).min() < LEAST_PIVOT or self._free_motions.shape[1]:
            return 0
        swaps = int((pivots != np.arange(len(pivots))).sum())
        return int(np.prod(np.sign(lu.diagonal()))) * (-1 if swaps % 2 else 1)

    def solve(self, x: Float, rhs: Float) -> tuple[Float, bool]:
        """Solve for x (m,); return x, and whether x is a solution.

        The start x holds the prescribed entries, and the amplitudes that free motions keep.  If the right-hand side
        `rhs` (m,) drives a free motion, no solution exists: springs of stiffness HELD bear the forces.
        """
        start, x = x, x.copy()
        if self._factor is None:
            return x, True
        terms, rows = np.abs(self._rows), rhs[self.free]
        for _ in range(MOST_REFINEMENTS):
            missing = rows - self._rows @ x
            # Motions with a stiffness near HELD take more steps.
            if (np.abs(missing) <= ROUNDED * (terms @ np.abs(x) + np.abs(rows))).all():
                break
            x[self.free] += lu_solve(self._factor, missing, check_finite=False)
        if not self._free_motions.shape[1]:
            return x, True
        # Where forces balance, rounding / HELD has driven free motions by amounts that depend on the number of ranks.
        stays = x.copy()
        stays[self.free] -= self._free_motions @ (self._free_motions.T @ (x - start)[self.free])
        # A row without any stiffness, such as shear along sliding fibres, has the rounding of other rows.
        missing = np.abs(rows - self._rows @ stays) - np.finfo(float).eps * np.abs(stays).max(initial=0.0)
        balanced = bool((missing <= HELD * (terms @ np.abs(stays) + np.abs(rows))).all())
        return stays if balanced else x, balanced

    @cached_property
    def _free_motions(self) -> Float:
        """The orthonormal free motions (free rows, k)."""
        rows = np.count_nonzero(self.free)
        soft = 0 if self._factor is None else np.count_nonzero(np.abs(self._factor[0].diagonal()) < SOFT_PIVOT)
        if not soft:
            return np.zeros((rows, 0))
        motions = np.random.default_rng(0).standard_normal((rows, min(soft + MORE_MOTIONS, rows)))
        for _ in range(INVERSE_ITERATIONS):
            motions = np.linalg.qr(lu_solve(self._factor, motions, check_finite=False))[0]
        _, size, combined = np.linalg.svd(self._rows[:, self.free] @ motions, full_matrices=False)
        return np.asarray(motions @ combined[size < UNRESISTED].T)


class FollowedStatuses:
    """The matrix R = [M^-1; S M^-1] for m entries of x, updated when rows of M change.

    Attributes:
        S: (m, m) as in `CoulombFaces`.
        free: (m,) whether the entry of x is free: the row of M is then a row of S, else of the identity.
        slope: (m,) s mu at sliding nodes' slips, 0 elsewhere.
        sign: sign of det M.
    """

    def __init__(self, S: Float) -> None:
        """Prescribe all entries: M is the identity."""
        m = len(S)
        self.S, self.free, self.slope, self.sign = S, np.zeros(m, bool), np.zeros(m), 1
        self._index: Int = np.arange(m)
        self._size, self._R = m, np.stack([np.eye(m), S])
        self._forget()

    def _forget(self) -> None:
        """Drop all changes that have not been added to R, and allocate room for new ones."""
        capacity = self._R.shape[1]
        self._U, self._V = np.zeros((2, capacity, MOST_CHANGES)), np.zeros((MOST_CHANGES, capacity))
        self._count = 0

    def turn(self, free: Bool, slope: Float) -> bool:
        """Exchange the rows of M that differ from the arguments; return False if tiny pivots leave some unexchanged."""
        pending, size = np.flatnonzero((free != self.free) | (slope != self.slope)).tolist(), self._size
        while pending:
            failed = []
            for j in pending:
                position, count = int(self._index[j]), self._count
                w = self._row(int(free[j]), position)
                if slope[j]:
                    w += slope[j] * self._row(1, int(self._index[j - 1]))
                pivot = w[position]
                if abs(pivot) < LEAST_PIVOT:
                    failed.append(j)
                    continue
                w[position] -= 1.0
                column = self._R[:, :size, position] - self._U[:, :size, :count] @ self._V[:count, position]
                self._U[:, :size, count], self._V[count, :size] = column, w / pivot
                self._count += 1
                if self._count == MOST_CHANGES:
                    self._flush()
                self.free[j], self.slope[j] = free[j], slope[j]
                self.sign *= 1 if pivot > 0.0 else -1
            if len(failed) == len(pending):
                return False
            pending = failed
        return True

    def _row(self, kind: int, at: int) -> Float:
        """Return row `at` (m,) of M^-1 if `kind` is 0, of S M^-1 if `kind` is 1."""
        count, size = self._count, self._size
        return np.asarray(self._R[kind, at, :size] - self._U[kind, at, :count] @ self._V[:count, :size])

    def _flush(self) -> None:
        """Add the collected changes to R."""
        size, count = self._size, self._count
        for kind in range(2 if count else 0):
            self._R[kind, :size, :size] -= self._U[kind, :size, :count] @ self._V[:count, :size]
        self._count = 0

    def _inverse(self, c: Float) -> Float:
        """Return the solution M^-1 c (m,) for a right-hand side c (m,)."""
        size, permuted = self._size, np.empty(self._size)
        permuted[self._index] = c
        nonzero = np.flatnonzero(permuted)
        columns = nonzero if len(nonzero) <= FEW else slice(size)
        change = self._U[0, :size, : self._count] @ (self._V[: self._count, :size][:, columns] @ permuted[columns])
        return np.asarray((self._R[0, :size, :size][:, columns] @ permuted[columns] - change)[self._index])

    def solve(self, x: Float, rhs: Float, terms: Callable[[Float], Float]) -> tuple[Float, Float] | None:
        """Solve for x (m,) from a start with the prescribed entries; return x and S x.

        Return None if R has lost too many digits, relative to the terms sum_j |S_ij x_j| of each row.
        """
        prescribed = np.where(self.free, rhs, x)
        if np.count_nonzero(prescribed) <= FEW:
            x = np.where(self.free, self._inverse(prescribed), x)
        error = np.inf
        for step in range(1 + MOST_REFINEMENTS):
            y = self.S @ x
            missing, before = residual(y, rhs, self.free, self.slope), error
            error = largest_share(missing, np.abs(rhs) + terms(x), self.slope)
            if error <= ROUNDED or error > before / 2 or step == MOST_REFINEMENTS:
                break
            x = np.where(self.free, x + self._inverse(missing), x)
        return (x, y) if error <= NOISE else None

    def grow(self, S: Float, old: Int, other: Int, units: Float) -> bool:
        """Add prescribed entries to x; the present entries get the indices `old` (m,) in S (m', m').

        New scales multiply the entries of S by units_i units_j, with `units` (m,); S also changes between the entries
        with the indices `other`.  Return False if a pivot is too small; R is then useless.
        """
        # Prescribed entries have rows of the identity in M^-1: only the block of S M^-1 between these entries changes.
        entries, free, slope = np.flatnonzero(np.isin(old, other)), self.free.copy(), self.slope.copy()
        free[entries], slope[entries] = False, 0.0
        if len(entries) and not self.turn(free, slope):
            return False
        self._flush()
        rescaled, changed = np.flatnonzero(units != 1.0), self._index[entries]
        rescaled_rows, unit = self._index[rescaled], units[rescaled]
        self._R[:, : self._size, rescaled_rows] *= np.where(self.free[rescaled], 1.0 / unit, unit)
        self._R[:, rescaled_rows, : self._size] *= np.stack([1.0 / unit, unit])[:, :, None]
        before = self.S[entries[:, None], entries] * np.outer(units[entries], units[entries])
        self._R[1, changed[:, None], changed] += S[other[:, None], other] - before
        size, m = self._size, len(S)
        new = np.setdiff1d(np.arange(m), old)
        free, slope, position = np.zeros(m, bool), np.zeros(m), np.empty(m, np.int64)
        free[old], slope[old], position[old], position[new] = self.free, self.slope, self._index, np.arange(size, m)
        self.S, self.free, self.slope, self._index = S, free, slope, position
        if m > self._R.shape[1]:
            R = np.empty((2, m + m // 4, m + m // 4))  # with room for more entries
            R[:, :size, :size] = self._R[:, :size, :size]
            self._R = R
            self._forget()
        order = np.argsort(position)
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
