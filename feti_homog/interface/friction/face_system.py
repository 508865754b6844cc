"""The linear response of debonded faces with prescribed statuses; see `coulomb_faces`.

A change of a few statuses updates this response; after free motions, or a loss of digits, the system is factored anew.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from feti_homog.interface.contact import Status
from feti_homog.interface.friction import status_system
from feti_homog.typing import Bool, Float, Float32, Int

# Number of arrays whose products with S are stored.
PRODUCTS = 6
# Number of factorizations that cost as much as the set-up of `FollowedStatuses`.
FACTORIZATIONS = 12

# Largest force relative to the forces of the loads that counts as zero: on a free motion, or on an unloaded face.
UNBALANCED = 1e-7


@dataclass(frozen=True)
class Prescribed:
    """The prescribed loads, and the slips from which the nodes start, all scaled as x.

    Attributes:
        by_stress: (v,) whether a load prescribes the stress.
        values: (v,) strains, or (S x)_E where a load prescribes the stress.
        slip: (n,) slip of a sticking node; the slip of another node grows from it.
        pressure: (n,) scaled pressure added at the nodes; 0 except in a search.
    """

    by_stress: Bool
    values: Float
    slip: Float
    pressure: Float | float = 0.0


class FaceSystem:
    """Debonded faces, and their response to loads while the nodes keep prescribed statuses.

    Attributes:
        friction: (n,) mu.
        S: (m, m) scaled stiffness of x = (g, E), with 1 as the largest diagonal entry of each node.
        size: (m,) scales, m = 2n + v: jumps and strains are x / size, the stiffness is S_ij size_i size_j.
        nodes: number n of nodes.
        gaps, slips, loads: slices of g_n, g_t and the v loads E in x.
    """

    def __init__(self, stiffness: Float, friction: Float) -> None:
        """Scale the stiffness (m, m), m = 2n + v, of n jumps (normal, tangential), then v loads; `friction` is (n,)."""
        n, diagonal = len(friction), stiffness.diagonal()
        self.friction, self.nodes = friction, n
        self.gaps, self.slips, self.loads = slice(0, 2 * n, 2), slice(1, 2 * n, 2), slice(2 * n, len(stiffness))
        nodes = np.repeat(diagonal[: 2 * n].reshape(n, 2).max(axis=1, initial=0.0), 2)
        size = np.sqrt(np.concatenate([nodes, np.maximum(diagonal[2 * n :], 0.0)]))
        self.size = np.where(size > 0.0, size, 1.0)
        self.S = stiffness / np.outer(self.size, self.size)
        self._absolute: Float32 = np.abs(self.S).astype(np.float32)
        self._followed: status_system.FollowedStatuses | None = None
        self._last: tuple[bytes, status_system.StatusSystem] | None = None
        self._factored = 0
        self._products: deque[tuple[Float, Float]] = deque(maxlen=PRODUCTS)

    def forces(self, x: Float) -> tuple[Float, Float]:
        """Return the scaled normal and tangential forces (n,) in a state x, tension positive."""
        f = -self.product(x)
        return f[self.gaps], f[self.slips]

    def rooms(self, status: Status, x: Float, slip: Float | float, pressure: Float | float) -> Float:
        """Return the force or jump (4, n) that separates each node from each next status; inf if none leads there.

        The rows [STICK, FORWARD, OPEN_FACE, BACKWARD] are s (g_t - slip), mu p - f_t, p and mu p + f_t, with added
        pressure; g_n is the room of an open node, in the row STICK.
        """
        normal, tangential = self.forces(x)
        total, sticks, closed = pressure - normal, status == status_system.STICK, status != status_system.OPEN_FACE
        limit, slides = self.friction * total, closed & ~sticks & (self.friction > 0.0)
        reversal = np.where(slides, status * (x[self.slips] - slip), np.inf)
        return np.stack(
            [
                np.where(closed, reversal, x[self.gaps]),
                np.where(sticks, limit - tangential, np.inf),
                np.where(closed, total, np.inf),
                np.where(sticks, limit + tangential, np.inf),
            ]
        )

    def follow(self, before: FaceSystem, old: Int, other: Int) -> None:
        """Take over the response of `before`, which is then useless, if `FollowedStatuses.grow` can extend it."""
        units = before.size / self.size[old]
        if before._followed is None:
            self._factored = before._factored
        elif before._followed.grow(self.S, old, other, units):
            self._followed = before._followed

    def terms(self, x: Float) -> Float:
        """Return the scale (m,) of rounding in S x, in single precision: sum_j |S_ij x_j|."""
        largest = float(np.abs(x).max(initial=0.0)) or 1.0
        return np.asarray(largest * (self._absolute @ np.abs(x / largest).astype(np.float32)), float)

    def product(self, x: Float) -> Float:
        """Return and store the product S x (m,); the caller must not change x later."""
        for array, y in self._products:
            if array is x:
                return y
        return self.keep(x, self.S @ x)

    def keep(self, x: Float, y: Float) -> Float:
        """Store y (m,) as the product S x, and return y."""
        self._products.append((x, y))
        return y

    def linear(self, status: Status, load: Prescribed, start: Float) -> tuple[Float, bool]:
        """Solve for the scaled x (m,) with given statuses; return x, and whether the forces balance."""
        rows = status_system.free_rows(status, self.friction, load.by_stress)
        x, values = self.prescribed(status, load, start)
        followed = self._turned(*rows)
        if followed is not None:
            solution = followed.solve(x, values, self.terms)
            if solution is not None:
                self.keep(*solution)
                return solution[0], True
            self._followed, self._factored = None, 0
        return self._system(*rows).solve(x, values)

    def sign(self, status: Status, by_stress: Bool) -> int:
        """Return the sign of det M, see `status_system`, with given statuses; 0 with free motions."""
        rows = status_system.free_rows(status, self.friction, by_stress)
        followed = self._turned(*rows)
        return self._system(*rows).sign if followed is None else followed.sign

    def _turned(self, free: Bool, slope: Float) -> status_system.FollowedStatuses | None:
        """Return `FollowedStatuses` with rows from `free_rows`; None at a tiny pivot, or while factoring is cheaper."""
        if self._followed is None:
            if self._factored < FACTORIZATIONS:
                return None
            self._followed = status_system.FollowedStatuses(self.S)
        return self._followed if self._followed.turn(free, slope) else None

    def _system(self, free: Bool, slope: Float) -> status_system.StatusSystem:
        """Return the factored system of rows from `free_rows`; reuse the last system if it has these rows."""
        key = free.tobytes() + slope.tobytes()
        if self._last is None or self._last[0] != key:
            self._last = key, status_system.StatusSystem(self.S, free, slope)
            self._factored += 1
        return self._last[1]

    def settled(self, status: Status, load: Prescribed, x: Float) -> tuple[Status, Float]:
        """Return the statuses, and x (m,) solved anew without accumulated rounding; with a free motion, x stays."""
        has_free_motion = self.sign(status, load.by_stress) == 0
        return status, (x if has_free_motion else self.linear(status, load, x)[0])

    def is_balanced(self, status: Status, load: Prescribed, x: Float) -> bool:
        """Return whether no force drives a free motion, such as a fibre that turns in a hole."""
        free, slope = status_system.free_rows(status, self.friction, load.by_stress)
        rows = self.prescribed(status, load, x)[1]
        unbalanced = np.abs(status_system.residual(self.product(x), rows, free, slope))
        unbalanced = np.maximum(unbalanced - np.finfo(float).eps * np.abs(x).max(initial=0.0), 0.0)
        return status_system.largest_share(unbalanced, self._sizes(status, load), slope) <= UNBALANCED

    def least_force(self, status: Status, load: Prescribed) -> float:
        """Return the scaled force below which forces count as zero: a fraction of the forces of loads and slips."""
        return float(UNBALANCED * self._sizes(status, load).max(initial=0.0))

    def _sizes(self, status: Status, load: Prescribed) -> Float:
        """Bound the forces (m,) that prescribed loads and slips cause at each node and at its neighbours in S."""
        # Only prescribed entries: a free motion in x is as large as its force divided by the stiffness HELD.
        fixed, rows = np.zeros((2, len(self.S)))
        rows[self.loads] = load.values
        fixed[self.loads] = np.where(load.by_stress, 0.0, load.values)
        fixed[self.slips] = np.where(status == status_system.STICK, load.slip, 0.0)
        return np.asarray(np.abs(rows) + self.terms(self.terms(fixed)))

    def prescribed(self, status: Status, load: Prescribed, start: Float) -> tuple[Float, Float]:
        """Return x (m,), with `start` in free entries, and the right-hand side (m,): loads and added pressures."""
        x, rows = start.copy(), np.zeros(len(start))
        x[self.gaps] = np.where(status == status_system.OPEN_FACE, x[self.gaps], 0.0)
        x[self.slips] = np.where(status == status_system.STICK, load.slip, x[self.slips])
        x[self.loads] = np.where(load.by_stress, x[self.loads], load.values)
        rows[self.loads] = load.values
        rows[self.gaps] = np.where(status == status_system.OPEN_FACE, -load.pressure, 0.0)
        rows[self.slips] = np.where(np.abs(status) == 1, -status * self.friction * load.pressure, 0.0)
        return x, rows

    def noise(self, x: Float) -> Float:
        """Return the rounding error (n,) of the scaled forces and jumps at each node."""
        terms = self.terms(x)[: 2 * self.nodes].reshape(-1, 2)
        return np.asarray(status_system.NOISE * terms.max(axis=1, initial=0.0))
