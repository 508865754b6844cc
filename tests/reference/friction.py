"""Coulomb friction on debonded faces by two slow methods: implicit increments, and rates from change to change.

z = (q, a, e): of each interface node the gap and the slip u_matrix - u_fibre of its faces, in generalized plane strain
also the slips along the fibres, and the macroscopic loads.  The bodies and springs store z.A z / 2; (A z)_n = p is the
pressure and -(A z)_t = f the shear force on the fibre.  On debonded nodes

    gap >= 0, p >= 0, gap p = 0;   |f| <= mu p;   f d slip >= 0, and d slip = 0 where |f| < mu p.

Along the fibres debonded faces slide without a force.
"""

from dataclasses import dataclass

import clarabel
import numpy as np
from scipy.sparse import csc_matrix, triu

from reference.condensed_cell import MixedLoad

BONDED, OPEN, STICK, FORWARD, BACKWARD = range(5)
SIGN = np.array([0.0, 0.0, 0.0, 1.0, -1.0])  # of the slip by status
EXACT = 1e-9  # relative, of the conditions above


@dataclass(frozen=True)
class State:
    """Loads e (m,) and what works on them per area; gap, slip, pressure and shear force of the nodes (k,)."""

    strain: np.ndarray
    stress: np.ndarray
    gap: np.ndarray
    slip: np.ndarray
    pressure: np.ndarray
    shear: np.ndarray
    status: np.ndarray
    axial: np.ndarray  # (k,) or (0,) force along the fibre
    along: np.ndarray  # and slip along it

    def start_of(self, load):
        """Return the load of the state in the kinds of another one."""
        return MixedLoad(np.where(load.by_stress, self.stress, self.strain), load.by_stress)

    def stored(self, area):
        """Return z.A z / 2 per area."""
        on_jumps = self.pressure @ self.gap - self.shear @ self.slip - self.axial @ self.along
        return self.stress @ self.strain / 2 + on_jumps / 2 / area


class NoEquilibriumError(ArithmeticError):
    """Neither method finds a state, or both rates and increments run in circles."""


class RubbingFaces:
    """The nodes of a cell: `A` of z as above, which are `bonded` (k,), coefficients of `friction`.

    `d` is 2, or 3 with slips along the fibres.
    """

    def __init__(self, A, bonded, friction, area=1.0, d=2):
        self.k, self.m, self.area = len(bonded), len(A) - d * len(bonded), area
        self.unit = np.abs(np.diag(A)).max()
        # Springs of nothing hold fibres that nothing touches.
        self.A = A / self.unit + 1e-13 * np.diag(np.arange(len(A)) < d * self.k)
        self.n, self.t = 2 * np.arange(self.k), 2 * np.arange(self.k) + 1
        self.a, self.e = np.split(np.arange(2 * self.k, len(A)), [(d - 2) * self.k])
        self.bonded, self.mu = np.array(bonded, bool), np.broadcast_to(friction, self.k).astype(float)

    @classmethod
    def of(cls, cell, bonded, friction):
        """Return those of a `CondensedCell`; faces of springs rub behind these."""
        A, n = cell.A, cell.n
        if not cell.glued:
            K = np.diag(cell.springs.ravel())
            gives = np.linalg.inv(A[:n, :n] + K)
            top = np.hstack([K - K @ gives @ K, K @ gives @ A[:n, n:]])
            A = np.vstack([top, np.hstack([top[:, n:].T, A[n:, n:] - A[n:, :n] @ gives @ A[:n, n:]])])
        jumps = np.arange(n).reshape(cell.k, cell.d)
        order = np.r_[jumps[:, :2].ravel(), jumps[:, 2:].ravel(), n : len(A)]
        return cls((A + A.T)[np.ix_(order, order)] / 2, bonded, friction, cell.area, cell.d)

    @property
    def at_rest(self):
        """The state without a load."""
        zero = np.zeros(self.k)
        status = np.where(self.bonded, BONDED, STICK)
        along = np.zeros(len(self.a))
        return State(np.zeros(self.m), np.zeros(self.m), zero, zero, zero, zero, status, along, along)

    def holds(self, status):
        """(..., k) or (..., 0) nodes that do not slip along the fibres."""
        return (status == BONDED)[..., : len(self.a)]

    def linear(self, status, load, before=None):
        """Return the states (s,) of given statuses (s, k) and a load, or their rates if there is no state `before`."""
        status = np.atleast_2d(status)
        closed, held = status != OPEN, (status == STICK) | (status == BONDED)
        unit = np.eye(len(self.A))
        M = np.broadcast_to(self.A, (len(status), *self.A.shape)).copy()
        M[:, self.t] += (SIGN[status] * self.mu)[:, :, None] * self.A[self.n]
        M[:, self.n] = np.where(closed[:, :, None], unit[self.n], M[:, self.n])
        M[:, self.t] = np.where(held[:, :, None], unit[self.t], M[:, self.t])
        M[:, self.a] = np.where(self.holds(status)[:, :, None], unit[self.a], M[:, self.a])
        M[:, self.e[~load.by_stress]] = unit[self.e[~load.by_stress]]
        b = np.zeros((len(status), len(self.A)))
        if before is not None:
            b[:, self.t] = np.where(held, before.slip, 0.0)
            b[:, self.a] = np.where(self.holds(status), before.along, 0.0)
        b[:, self.e] = np.where(load.by_stress, load.values * self.area / self.unit, load.values)
        z = np.linalg.solve(M, b[:, :, None])
        z += np.linalg.solve(M, b[:, :, None] - M @ z)
        return [self._state(*pair) for pair in zip(z[:, :, 0], status, strict=True)]

    def _state(self, z, status):
        r = self.unit * (self.A @ z)
        own = z[self.n], z[self.t], r[self.n], -r[self.t], status, -r[self.a], z[self.a]
        return State(z[self.e], r[self.e] / self.area, *own)

    def increment(self, before, load, most=500):
        """Return the state after one implicit step: problems of given friction bounds, until the pressures stay."""
        bound, found = self.mu * before.pressure, before
        for k in range(most):
            last, found = bound, self._given_bounds(bound, before, load)
            bound = self.mu * np.maximum(found.pressure, 0.0)
            if np.abs(bound - last).max() <= 1e-7 * max(bound.max(), 1e-30):
                break
            # Where pressures swing to and fro.
            bound = bound if k < 20 else (bound + last) / 2
        else:
            raise NoEquilibriumError(f"pressures change after {most} problems")
        status = found.status
        for _ in range(10):
            (exact,) = self.linear(status, load, before)
            if self.violation(exact, before) <= EXACT:
                return exact
            status = self._corrected(exact, before)
        raise NoEquilibriumError(f"conditions are violated by {self.violation(exact, before):.1e}")

    def _corrected(self, state, before):
        """(k,) the statuses that the forces and jumps of a state ask for, of nodes that are near two of them."""
        status, slid = state.status, SIGN[state.status] * (state.slip - before.slip)
        over = (status == STICK) & (np.abs(state.shear) > self.mu * state.pressure)
        found = np.where(over, np.where(state.shear > 0, FORWARD, BACKWARD), np.where(slid < 0, STICK, status))
        found = np.where((status != OPEN) & (state.pressure < 0), OPEN, found)
        found = np.where((status == OPEN) & (state.gap < 0), STICK, found)
        return np.where(self.bonded, BONDED, found)

    def _given_bounds(self, bound, before, load):
        """min z.A z / 2 + sum bound |slip - slip before|, gap >= 0, by Clarabel: as good as its tolerances."""
        free = np.ones(len(self.A), bool)
        free[self.n[self.bonded]] = free[self.t[self.bonded]] = free[self.a[self.holds(self.at_rest.status)]] = False
        free[self.e] = load.by_stress
        own = ~self.bonded
        n, t = (np.searchsorted(np.flatnonzero(free), x[own]) for x in (self.n, self.t))
        held = np.zeros(len(self.A))
        held[self.e] = np.where(load.by_stress, 0.0, load.values)
        f = -self.A @ held
        f[self.e] += np.where(load.by_stress, load.values * self.area / self.unit, 0.0)
        v, size = int(own.sum()), int(free.sum())
        H = np.zeros((size + v,) * 2)
        H[:size, :size] = self.A[np.ix_(free, free)]
        reach = max(np.abs(f).max(), 1e-300)
        # A slip of nothing costs: otherwise its bound v >= |slip| may grow for ever.
        q = np.r_[-f[free] / reach, np.maximum(bound[own] / self.unit / reach, 1e-9)]
        C, b = np.zeros((3 * v, size + v)), np.zeros(3 * v)
        rows = np.arange(v)
        C[rows, n] = -1.0
        for start, sign in ((v, 1.0), (2 * v, -1.0)):
            C[start + rows, t], C[start + rows, size + rows] = sign, -1.0
            b[start : start + v] = sign * before.slip[own] / reach
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-12
        problem = triu(csc_matrix(H), format="csc"), q, csc_matrix(C), b, [clarabel.NonnegativeConeT(3 * v)]
        answer = clarabel.DefaultSolver(*problem, settings).solve()
        s, y = np.array(answer.s).reshape(3, v), np.array(answer.z).reshape(3, v)
        z = held.copy()
        z[free] = reach * np.array(answer.x)[:size]
        status = np.where(self.bonded, BONDED, STICK)
        # Of each slack and its multiplier one is zero; slacks of those that slide are twice their slip.
        status[own] = np.where(s[0] > y[0], OPEN, np.select([s[1] > y[1], s[2] > y[2]], [BACKWARD, FORWARD], STICK))
        return self._state(z, status)

    def violation(self, state, before):
        """Return the largest violation of the conditions of an implicit step, relative to its forces and jumps."""
        own, slid = ~self.bonded, state.slip - before.slip
        p, f, gap = state.pressure[own], state.shear[own], state.gap[own]
        jump = max(np.abs(state.gap).max(), np.abs(state.slip).max(), 1e-300)
        # Where all faces are open forces are rounding.
        force = max(np.abs(state.pressure).max(), np.abs(state.shear).max(), 1e-6 * self.unit * jump)
        jump = max(jump, force / self.unit)
        slid, room = slid[own], self.mu[own] * p - np.abs(f)
        parts = [
            np.maximum(-gap, 0.0) / jump,
            np.maximum(-p, 0.0) / force,
            np.abs(gap * p) / (jump * force),
            np.maximum(-room, 0.0) / force,
            np.maximum(-f * slid, 0.0) / (jump * force),
            np.abs(slid * room * (p > EXACT * force)) / (jump * force),
        ]
        return max(part.max(initial=0.0) for part in parts)
