"""The linear response of debonded faces with given statuses; see `coulomb_faces`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from feti_homog.interface.contact.states import Status
from feti_homog.interface.friction.status_solver import StatusSolver
from feti_homog.interface.friction.status_system import OPEN_FACE, STICK, free_rows
from feti_homog.typing import Bool, Float

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
        solver: of systems with it.
    """

    def __init__(self, stiffness: Float, friction: Float) -> None:
        """`stiffness` (m, m) of normal and tangential jumps of each node, then of the v loads: m is 2n + v."""
        n, diagonal = len(friction), stiffness.diagonal()
        self.friction = friction
        nodes = np.repeat(diagonal[: 2 * n].reshape(n, 2).max(axis=1, initial=0.0), 2)
        size = np.sqrt(np.concatenate([nodes, np.maximum(diagonal[2 * n :], 0.0)]))
        self.size = np.where(size > 0.0, size, 1.0)
        self.S = stiffness / np.outer(self.size, self.size)
        self.solver = StatusSolver(self.S)

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
        f = -self.solver.product(x)[: 2 * self.nodes]
        return f[::2], f[1::2]

    def linear(self, status: Status, given: Prescribed, start: Float) -> tuple[Float, bool]:
        """(m,) scaled x with these statuses, and whether it is a solution; from a start as of `StatusSystem.solve`."""
        return self.solver.solve(*self.free(status, given.by_stress), *self.prescribed(status, given, start))

    def free(self, status: Status, by_stress: Bool) -> tuple[Bool, Float]:
        """Return `free_rows` of statuses."""
        return free_rows(status, self.friction, by_stress)

    def settled(self, status: Status, given: Prescribed, x: Float) -> tuple[Status, Float]:
        """Return the statuses, and x (m,) without the rounding of the way to it.

        Where a motion is free, which rounding would drive, x is as it was.
        """
        is_free = self.solver.sign(*self.free(status, given.by_stress)) == 0
        return status, x if is_free else self.linear(status, given, x)[0]

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
        terms = self.solver.terms(x)[: 2 * self.nodes].reshape(-1, 2)
        return np.asarray(NOISE * terms.max(axis=1, initial=0.0))
