"""The linear system of debonded faces with given statuses."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from feti_homog.interface.contact.states import Status
from feti_homog.typing import Bool, Float

STICK, FORWARD, OPEN_FACE, BACKWARD = 0, 1, 2, -1
"""Statuses of a debonded node: tied, sliding with a rising or a falling slip, apart."""

# Stiffness, relative to that of a node, that holds what nothing else does where it is; steps of refinement remove it.
HELD = 1e-9
# A smaller pivot is that of a free motion: its sign is rounding.
LEAST_PIVOT = 1e-6
# Free motions are looked for where a pivot is smaller, among a few more than such pivots, by inverse iteration, whose
# steps leave HELD of what resists; their relative stiffness at most.
SOFT_PIVOT, MORE_MOTIONS, INVERSE_ITERATIONS, UNRESISTED = 1e-3, 3, 3, 0.1 * HELD
# Steps of refinement at most, until each row is left with this share of its terms.
MOST_REFINEMENTS, ROUNDED = 20, 1e-14
# What is left of rows, as a share of their terms, up to which no force drives a free motion.
BALANCED = 1e-9


def free_rows(status: Status, friction: Float, by_stress: Bool) -> tuple[Bool, Float]:
    """(m,) which entries of x are unknown, and (m,) s mu of sliding nodes at their slips, 0 elsewhere."""
    free = np.concatenate([np.stack([status == OPEN_FACE, status != STICK], axis=1).ravel(), by_stress])
    slope = np.zeros(len(free))
    slope[1 : 2 * len(status) : 2] = np.where(np.abs(status) == 1, status * friction, 0.0)
    return free, slope


def residual(y: Float, given: Float, free: Bool, slope: Float) -> Float:
    """(m,) what y = S x (m,) leaves of the rows `given` (m,) that are free, 0 of others."""
    sliding = np.flatnonzero(slope)
    left = given - y
    left[sliding] -= slope[sliding] * y[sliding - 1]
    return np.where(free, left, 0.0)


def largest_share(left: Float, terms: Float, slope: Float) -> float:
    """Return the largest of residuals (m,), each relative to the terms (m,) of its row."""
    size, sliding = terms.copy(), np.flatnonzero(slope)
    size[sliding] += np.abs(slope[sliding]) * terms[sliding - 1]
    return float((np.abs(left) / np.where(size > 0.0, size, 1.0)).max(initial=0.0))


class StatusSystem:
    """S x = 0 on the rows that are free, with x given on the others, factored.

    Sliding nodes have the row S_t + s mu S_n: their traction is s mu times the pressure.

    Attributes:
        free: (m,) which entries of x are unknown.
        sign: of the determinant; 0 where a motion is free.
    """

    def __init__(self, S: Float, free: Bool, slope: Float) -> None:
        """`S` (m, m) of `CoulombFaces`; what is free, and the slopes, as of `free_rows`."""
        self.free = free
        sliding = np.flatnonzero(slope)
        place = np.cumsum(self.free) - 1
        self._rows = S[self.free]
        self._rows[place[sliding]] += slope[sliding, None] * S[sliding - 1]
        A = self._rows[:, self.free]
        A[np.diag_indices(len(A))] += HELD
        self._factor = lu_factor(A, overwrite_a=True, check_finite=False) if len(A) else None

    @property
    def sign(self) -> int:
        """Sign of the determinant, 0 where a motion is free."""
        if self._factor is None:
            return 1
        lu, pivots = self._factor
        if np.abs(lu.diagonal()).min() < LEAST_PIVOT or self._free_motions.shape[1]:
            return 0
        swaps = int((pivots != np.arange(len(pivots))).sum())
        return int(np.prod(np.sign(lu.diagonal()))) * (-1 if swaps % 2 else 1)

    def solve(self, x: Float, given: Float) -> tuple[Float, bool]:
        """(m,) x with the rows `given` (m,), from a start with the entries that are not free, and whether it is one.

        What nothing determines stays as it was at the start.  If forces drive it there is no solution: x is then that
        of a cell that is held.
        """
        start, x = x, x.copy()
        if self._factor is None:
            return x, True
        terms, rows = np.abs(self._rows), given[self.free]
        for _ in range(MOST_REFINEMENTS):
            left = rows - self._rows @ x
            # Soft motions, whose stiffness is near that by which they are held, take more steps.
            if (np.abs(left) <= ROUNDED * (terms @ np.abs(x) + np.abs(rows))).all():
                break
            x[self.free] += lu_solve(self._factor, left, check_finite=False)
        if not self._free_motions.shape[1]:
            return x, True
        # Where forces balance, rounding over what holds has driven free motions, otherwise on other numbers of ranks.
        stays = x.copy()
        stays[self.free] -= self._free_motions @ (self._free_motions.T @ (x - start)[self.free])
        # A row without any stiffness, of shear along fibres that slide there, is rounding of others.
        left = np.abs(rows - self._rows @ stays) - np.finfo(float).eps * np.abs(stays).max(initial=0.0)
        balanced = bool((left <= BALANCED * (terms @ np.abs(stays) + np.abs(rows))).all())
        return stays if balanced else x, balanced

    @cached_property
    def _free_motions(self) -> Float:
        """(free rows, k) orthonormal motions that nothing resists."""
        rows = np.count_nonzero(self.free)
        soft = 0 if self._factor is None else np.count_nonzero(np.abs(self._factor[0].diagonal()) < SOFT_PIVOT)
        if not soft:
            return np.zeros((rows, 0))
        motions = np.random.default_rng(0).standard_normal((rows, min(soft + MORE_MOTIONS, rows)))
        for _ in range(INVERSE_ITERATIONS):
            motions = np.linalg.qr(lu_solve(self._factor, motions, check_finite=False))[0]
        _, size, combined = np.linalg.svd(self._rows[:, self.free] @ motions, full_matrices=False)
        return np.asarray(motions @ combined[size < UNRESISTED].T)
