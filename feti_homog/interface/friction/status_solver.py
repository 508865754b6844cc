"""Solutions of the linear systems of debonded faces, by what is kept up from statuses to neighbouring ones."""

from __future__ import annotations

from collections import deque
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from feti_homog.interface.friction.followed_statuses import FollowedStatuses
from feti_homog.interface.friction.status_system import StatusSystem
from feti_homog.typing import Bool, Float, Int

# Arrays whose products are kept.
PRODUCTS = 6
# Factorizations that cost as much as to begin with what is followed.
FACTORIZATIONS = 12


class StatusSolver:
    """Systems with the matrix S (m, m) of `CoulombFaces`; rows as of `free_rows`.

    Where motions are free, or too many digits were lost, a system is factored.
    """

    def __init__(self, S: Float) -> None:
        self.S = S
        self._followed: FollowedStatuses | None = None
        self._last: tuple[bytes, StatusSystem] | None = None
        self._factored = 0
        self._products: deque[tuple[Float, Float]] = deque(maxlen=PRODUCTS)

    def follow(self, before: StatusSolver, old: Int, other: Int, units: Float) -> None:
        """Go on from a solver whose entries stand at the places `old` (m',) here, as `FollowedStatuses.grow`."""
        if before._followed is None:
            self._factored = before._factored
        elif before._followed.grow(self.S, old, other, units):
            self._followed = before._followed

    @cached_property
    def _absolute(self) -> NDArray[np.float32]:
        """(m, m) |S_ij|, of whose products the size alone counts."""
        return np.abs(self.S).astype(np.float32)

    def terms(self, x: Float) -> Float:
        """(m,) sum_j |S_ij x_j|, of whose rounding each row of S x has its share."""
        largest = float(np.abs(x).max(initial=0.0)) or 1.0
        return np.asarray(largest * (self._absolute @ np.abs(x / largest).astype(np.float32)), float)

    def product(self, x: Float) -> Float:
        """(m,) S x of an array that does not change; the last ones are kept."""
        for known, y in self._products:
            if known is x:
                return y
        return self.keep(x, self.S @ x)

    def keep(self, x: Float, y: Float) -> Float:
        """Return y, after keeping it as the product of x."""
        self._products.append((x, y))
        return y

    def solve(self, free: Bool, slope: Float, x: Float, given: Float) -> tuple[Float, bool]:
        """(m,) x with the rows `given` (m,), and whether it is a solution; as `StatusSystem.solve`."""
        followed = self._turned(free, slope)
        if followed is None:
            return self._system(free, slope).solve(x, given)
        found = followed.solve(x, given, self.terms)
        if found is None:
            self._followed, self._factored = None, 0
            return self._system(free, slope).solve(x, given)
        self.keep(*found)
        return found[0], True

    def sign(self, free: Bool, slope: Float) -> int:
        """Return that of the determinant, 0 where motions are free."""
        return (self._turned(free, slope) or self._system(free, slope)).sign

    def _turned(self, free: Bool, slope: Float) -> FollowedStatuses | None:
        """Return the response with these rows; None where motions are free, or while it does not pay yet."""
        if self._followed is None:
            if self._factored < FACTORIZATIONS:
                return None
            self._followed = FollowedStatuses(self.S)
        return self._followed if self._followed.turn(free, slope) else None

    def _system(self, free: Bool, slope: Float) -> StatusSystem:
        """Return the factored system of these rows; the last one is kept."""
        key = free.tobytes() + slope.tobytes()
        if self._last is None or self._last[0] != key:
            self._last = key, StatusSystem(self.S, free, slope)
            self._factored += 1
        return self._last[1]
