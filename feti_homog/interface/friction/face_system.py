"""The linear response of debonded faces with given statuses, kept up from statuses to neighbouring ones.

See `coulomb_faces`.  Where motions are free, or too many digits were lost, a system is factored.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from feti_homog.interface.contact.states import Status
from feti_homog.interface.friction.status_system import OPEN_FACE, STICK, FollowedStatuses, StatusSystem, free_rows
from feti_homog.typing import Bool, Float, Float32, Int

# Arrays whose products are kept.
PRODUCTS = 6
# Factorizations that cost as much as to begin with what is followed.
FACTORIZATIONS = 12

# Forces and jumps of a node, scaled by its stiffness, that are rounding, relative to the terms of its rows of S x.
NOISE = 1e-11


@dataclass(frozen=True)
class Prescribed:
    """Loads, and slips of nodes that stick.

    Attributes:
        by_stress: (v,) which of the loads are given by what works on them.
        values: (v,) strains, or (S x)_E of the others.
        slip: (n,) slip of nodes that stick.
    """

    by_stress: Bool
    values: Float
    slip: Float


class FaceSystem:
    """Debonded faces, and what their statuses make of loads.

    Attributes:
        friction: (n,) mu.
        S: (m, m) the scaled stiffness, of 1 on the diagonal of a node, and `size` (m,): S_ij size_i size_j is that of
            the cell.
    """

    def __init__(self, stiffness: Float, friction: Float) -> None:
        """`stiffness` (m, m) of normal and tangential jumps of each node, then of the v loads: m is 2n + v."""
        n, diagonal = len(friction), stiffness.diagonal()
        self.friction = friction
        nodes = np.repeat(diagonal[: 2 * n].reshape(n, 2).max(axis=1, initial=0.0), 2)
        size = np.sqrt(np.concatenate([nodes, np.maximum(diagonal[2 * n :], 0.0)]))
        self.size = np.where(size > 0.0, size, 1.0)
        self.S = stiffness / np.outer(self.size, self.size)
        self._followed: FollowedStatuses | None = None
        self._last: tuple[bytes, StatusSystem] | None = None
        self._factored = 0
        self._products: deque[tuple[Float, Float]] = deque(maxlen=PRODUCTS)

    @property
    def nodes(self) -> int:
        """n."""
        return len(self.friction)

    @property
    def loads(self) -> slice:
        """Place of the loads in x."""
        return slice(2 * self.nodes, len(self.S))

    def forces(self, x: Float) -> tuple[Float, Float]:
        """(n,) scaled normal and tangential forces."""
        f = -self.product(x)[: 2 * self.nodes]
        return f[::2], f[1::2]

    def follow(self, before: FaceSystem, old: Int, other: Int) -> None:
        """Go on from faces whose entries stand at the places `old` (m',) here, as `FollowedStatuses.grow`."""
        units = before.size / self.size[old]
        if before._followed is None:
            self._factored = before._factored
        elif before._followed.grow(self.S, old, other, units):
            self._followed = before._followed

    @cached_property
    def _absolute(self) -> Float32:
        """(m, m) |S_ij|, of whose products the size alone counts."""
        return np.asarray(np.abs(self.S), np.float32)

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

    def linear(self, status: Status, given: Prescribed, start: Float) -> tuple[Float, bool]:
        """(m,) scaled x with these statuses, and whether it is a solution; from a start as of `StatusSystem.solve`."""
        rows, (x, values) = self.free(status, given.by_stress), self.prescribed(status, given, start)
        followed = self._turned(*rows)
        if followed is not None:
            found = followed.solve(x, values, self.terms)
            if found is not None:
                self.keep(*found)
                return found[0], True
            self._followed, self._factored = None, 0
        return self._system(*rows).solve(x, values)

    def sign(self, status: Status, by_stress: Bool) -> int:
        """Return the sign of the determinant with these statuses, 0 where motions are free."""
        rows = self.free(status, by_stress)
        return (self._turned(*rows) or self._system(*rows)).sign

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

    def free(self, status: Status, by_stress: Bool) -> tuple[Bool, Float]:
        """Return `free_rows` of statuses."""
        return free_rows(status, self.friction, by_stress)

    def settled(self, status: Status, given: Prescribed, x: Float) -> tuple[Status, Float]:
        """Return the statuses, and x (m,) without the rounding of the way to it.

        Where a motion is free, which rounding would drive, x is as it was.
        """
        return status, self.linear(status, given, x)[0] if self.sign(status, given.by_stress) else x

    def prescribed(self, status: Status, given: Prescribed, start: Float) -> tuple[Float, Float]:
        """(m,) x with what is prescribed, and (m,) S x on the rows of loads."""
        last, loads, x, rows = 2 * self.nodes, self.loads, start.copy(), np.zeros(len(start))
        x[:last:2] = np.where(status == OPEN_FACE, x[:last:2], 0.0)
        x[1:last:2] = np.where(status == STICK, given.slip, x[1:last:2])
        x[loads] = np.where(given.by_stress, x[loads], given.values)
        rows[loads] = given.values
        return x, rows

    def noise(self, x: Float) -> Float:
        """(n,) the scaled force, and jump, of each node that is rounding in x."""
        terms = self.terms(x)[: 2 * self.nodes].reshape(-1, 2)
        return np.asarray(NOISE * terms.max(axis=1, initial=0.0))
