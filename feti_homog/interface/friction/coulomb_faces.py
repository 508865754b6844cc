"""Coulomb friction on n debonded nodes, by dense arrays: the statuses of a state and of its rates.

The jumps g = (g_n, g_t) of the nodes and the macroscopic strains E are the unknowns x = (g, E) of the energy
x.S x / 2: the forces on the nodes are f = -(S x)_g, tension positive, and (S x)_E works on the strains.  With the
pressure p = -f_n

    g_n >= 0,  p >= 0,  g_n p = 0,        |f_t| <= mu p,  f_t = s mu p where the slip grows with the sign s.

A node is apart (f = 0), sticks (g_n = 0, g_t as it was), or slides (g_n = 0, f_t = s mu p).  Springs between the faces
of a node are part of S, and f the force beside theirs: a damaged bond is a node without friction on springs of
1 / (C - C_0), apart while it is pulled.

Jumps along the fibres may stand behind the loads: those of `tied` nodes stay while these touch, the others bear no
force.  No status depends on them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from feti_homog.errors import NotCarriedError
from feti_homog.interface.contact.states import Status
from feti_homog.interface.friction.lemke import complementary, first_guess
from feti_homog.interface.friction.status_solver import StatusSolver
from feti_homog.interface.friction.status_system import (
    BACKWARD,
    FORWARD,
    OPEN_FACE,
    STICK,
    free_rows,
    residual,
)
from feti_homog.typing import Bool, Float

# Forces and jumps below this share of the largest are rounding; both are scaled by the stiffness of a node.
NOISE = 1e-10
# Share of the forces of the loads that may be left on a free motion.
UNBALANCED = 1e-7
# What rounding leaves of a sum, relative to the sum of the sizes of its terms.
ROUNDED_SUM = 1e-13
# Block pivots without progress, after which one node at random changes at a time: with friction a fixed order may come
# back to where it was.  And solves after which Lemke's method takes over.
BLOCK_PIVOTS, LEAST_SOLVES, SOLVES_PER_NODE = 11, 50, 4
NOTHING = np.zeros(0, bool)
SEARCHED = "friction: no admissible statuses of the faces were found"
INDEFINITE = "friction: the sliding faces resist no more (an indefinite pivot)"


class StuckError(NotCarriedError):
    """No statuses of debonded faces go on from a state."""


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


class CoulombFaces:
    """Debonded faces.

    Attributes:
        friction: (n,) mu.
        tied: (n,) which nodes do not slip along the fibres while they touch; (0,) where x has no such jumps.
        S: (m, m) the scaled stiffness, of 1 on the diagonal of a node, and `size` (m,): S_ij size_i size_j is that of
            the cell.
        solver: of systems with it.
    """

    def __init__(self, stiffness: Float, friction: Float, tied: Bool = NOTHING) -> None:
        """`stiffness` (m, m) of normal and tangential jumps of each node, then of the v loads, then along the fibres.

        m is 2n + v, with jumps along the fibres 3n + v.
        """
        n, diagonal = len(friction), stiffness.diagonal()
        self.friction, self.tied = friction, tied
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
        return slice(2 * self.nodes, len(self.S) - len(self.tied))

    def forces(self, x: Float) -> tuple[Float, Float]:
        """(n,) scaled normal and tangential forces."""
        f = -self.solver.product(x)[: 2 * self.nodes]
        return f[::2], f[1::2]

    def linear(self, status: Status, given: Prescribed, start: Float) -> Float:
        """(m,) scaled x with these statuses; what nothing determines stays as it is at the start (m,)."""
        return self.solver.solve(*self._free(status, given.by_stress), *self._prescribed(status, given, start))

    def _free(self, status: Status, by_stress: Bool) -> tuple[Bool, Float]:
        """Return `free_rows` of statuses."""
        return free_rows(status, self.friction, self._given_by_force(status, by_stress))

    def _given_by_force(self, status: Status, by_stress: Bool) -> Bool:
        """(m - 2n,) which of the loads, and of the jumps along the fibres, are given by what works on them."""
        return np.concatenate([by_stress, ~self.tied | (status == OPEN_FACE)]) if len(self.tied) else by_stress

    def settled(self, status: Status, given: Prescribed, x: Float) -> Float:
        """(m,) scaled x without the rounding of the way to it; a free motion, which rounding would drive, keeps it."""
        return self.linear(status, given, x) if self.solver.sign(*self._free(status, given.by_stress)) else x

    def _prescribed(self, status: Status, given: Prescribed, start: Float) -> tuple[Float, Float]:
        """(m,) x with what is prescribed, and (m,) S x on the rows of loads."""
        last, loads, x, rows = 2 * self.nodes, self.loads, start.copy(), np.zeros(len(start))
        x[:last:2] = np.where(status == OPEN_FACE, x[:last:2], 0.0)
        x[1:last:2] = np.where(status == STICK, given.slip, x[1:last:2])
        x[loads] = np.where(given.by_stress, x[loads], given.values)
        rows[loads] = given.values
        return x, rows

    def _noise(self, x: Float, slip: Float) -> float:
        """Return the scaled force, and jump, that is rounding where the loads of x and a slip (n,) act."""
        last = 2 * self.nodes
        by_loads = np.abs(self.S[:last, last:] @ x[last:]).max(initial=0.0)
        slips = np.zeros(len(x))
        slips[1:last:2] = slip
        return NOISE * float(max(by_loads, np.abs((self.S @ slips)[:last]).max(initial=0.0) if slip.any() else 0.0))

    def search(self, status: Status, allowed: Bool, given: Prescribed, start: Float) -> tuple[Status, Float]:
        """Return statuses (n,) and scaled x that are admissible, from a first guess.

        `allowed` (n, 4) are the statuses that a node may have, in the columns [STICK, FORWARD, OPEN_FACE, BACKWARD];
        conditions between a status and one that is not allowed do not count.

        Raises:
            StuckError: none was found.
        """
        status = self._known(status)
        fewest, left, random = self.nodes + 1, 0, np.random.default_rng(0)
        for _ in range(LEAST_SOLVES + SOLVES_PER_NODE * self.nodes):
            x = self.linear(status, given, start)
            better = self._improved(status, allowed, given.slip, x)
            wrong = np.flatnonzero(better != status)
            if not len(wrong) and self._is_balanced(status, given, start, x):
                return status, x
            if not len(wrong):
                break
            left -= 1
            if len(wrong) < fewest:
                fewest, left = len(wrong), BLOCK_PIVOTS
            chosen = wrong if left > 0 else random.choice(wrong, 1)
            status = status.copy()
            status[chosen] = better[chosen]
        return self._complementary(allowed, given, start)

    def _is_balanced(self, status: Status, given: Prescribed, start: Float, x: Float) -> bool:
        """Return False if a free motion, such as the turning of a fibre that slides all around, has a force on it."""
        rows = self._prescribed(status, given, start)[1]
        left = residual(self.solver.product(x), rows, *self._free(status, given.by_stress))
        by_loads = np.abs(self.S[:, 2 * self.nodes :] @ x[2 * self.nodes :]).max(initial=0.0)
        return bool(np.abs(left).max(initial=0.0) <= UNBALANCED * max(by_loads, self._noise(x, given.slip) / NOISE))

    def _improved(self, status: Status, allowed: Bool, slip: Float, x: Float) -> Status:
        """(n,) the statuses that the signs of forces and jumps call for."""
        normal, tangential = self.forces(x)
        noise, gap, moved = self._noise(x, slip), x[: 2 * self.nodes : 2], x[1 : 2 * self.nodes : 2] - slip
        better, closed = status.copy(), status != OPEN_FACE
        limit = -self.friction * normal
        pulled = closed & (normal > noise) & allowed[:, OPEN_FACE]
        for sign in (FORWARD, BACKWARD):
            over = (status == STICK) & (sign * tangential - limit > noise) & allowed[:, sign]
            back = (status == sign) & (sign * moved < -noise) & allowed[:, STICK]
            better[over] = sign
            better[back] = STICK
        touches = ~closed & (gap < -noise) & allowed[:, FORWARD]
        way = np.where(np.abs(moved) > noise, np.sign(moved), STICK)
        better[touches] = np.where(self.friction > 0.0, way, FORWARD)[touches]
        better[pulled] = OPEN_FACE
        return better

    def _complementary(self, allowed: Bool, given: Prescribed, start: Float) -> tuple[Status, Float]:
        """Return the same by Lemke's method."""
        guess = first_guess(self.friction, allowed)
        x, rows = self._prescribed(guess, given, start)
        by_force = self._given_by_force(guess, given.by_stress)
        found = complementary(self.S, self.friction, allowed, by_force, x, rows)
        if found is not None:
            x = self.linear(found, given, start)
            is_right = (self._improved(found, allowed, given.slip, x) == found).all()
            if is_right and self._is_balanced(found, given, start, x):
                return found, x
        raise StuckError(SEARCHED)

    def all_allowed(self) -> Bool:
        """(n, 4) True, but that faces without friction have one status of touching, FORWARD."""
        return self._without_friction_free(np.ones((self.nodes, 4), bool))

    def _known(self, status: Status) -> Status:
        """(n,) FORWARD for each other status of touching faces without friction."""
        return np.where((self.friction == 0.0) & (status != OPEN_FACE), FORWARD, status).astype(np.int8)

    def _without_friction_free(self, allowed: Bool) -> Bool:
        allowed[np.ix_(self.friction == 0.0, [STICK, BACKWARD])] = False
        return allowed

    def rates(self, status: Status, x: Float, by_stress: Bool, rate: Float) -> tuple[Status, Float]:
        """Return the statuses (n,) with which a state x goes on, and the rate (m,) of x, as the loads (v,) change.

        Raises:
            StuckError: there are none, or the determinant of the sliding faces has lost its sign.
        """
        given, status = Prescribed(by_stress, rate, np.zeros(self.nodes)), self._known(status)
        allowed = self._at_limits(status, x)
        status, v = self.search(status, allowed, given, np.zeros(len(x)))
        if self.solver.sign(*self._free(status, by_stress)) < 0:
            raise StuckError(INDEFINITE)
        return status, v

    def _at_limits(self, status: Status, x: Float) -> Bool:
        """(n, 4) the statuses that nodes of a state may go on with: their own, and others where a limit is reached."""
        closed, gap = status != OPEN_FACE, x[: 2 * self.nodes : 2]
        (normal, tangential), noise = self.forces(x), self._noise_of_state(x)
        allowed = np.zeros((self.nodes, 4), bool)
        allowed[np.arange(self.nodes), status] = True
        for sign in (FORWARD, BACKWARD):
            limited = closed & ((status == sign) | (sign * tangential + self.friction * normal >= -noise))
            allowed[limited, sign] = allowed[limited, STICK] = True
        allowed[np.where(closed, normal >= -noise, gap <= noise)] = True
        return self._without_friction_free(allowed)

    def _noise_of_state(self, x: Float) -> float:
        """Return the force, and jump, that is rounding in an equilibrium, with forces of its own where none load it.

        Slips that an unloaded cell keeps leave forces of rounding.
        """
        summed = float((self.solver.absolute @ np.abs(x))[: 2 * self.nodes].max(initial=0.0))
        largest = float(np.abs(self.forces(x)).max(initial=0.0))
        return max(self._noise(x, np.zeros(self.nodes)), NOISE * largest, ROUNDED_SUM * summed)

    def next_change(self, status: Status, x: Float, rate: Float) -> float:
        """Return how far x goes on along its `rate` until a status ends, inf if none does."""
        noise, closed = self._noise(rate, np.zeros(self.nodes)), status != OPEN_FACE
        (normal, tangential), (dn, dt) = self.forces(x), self.forces(rate)
        sticks, last = status == STICK, 2 * self.nodes
        rooms = [(x[:last:2][~closed], rate[:last:2][~closed]), (-normal[closed], -dn[closed])]
        for sign in (FORWARD, BACKWARD):
            room = -self.friction * np.stack([normal, dn]) - sign * np.stack([tangential, dt])
            rooms.append((room[0][sticks], room[1][sticks]))
        here, falls = (np.concatenate(each) for each in zip(*rooms, strict=True))
        ends = falls < -noise
        return float((np.maximum(here[ends], 0.0) / -falls[ends]).min(initial=np.inf))

    def heat(self, status: Status, before: Float, after: Float) -> float:
        """Return the heat of friction on a straight way between two states, whose statuses these are."""
        sliding, tangential = np.abs(status) == 1, (self.forces(before)[1] + self.forces(after)[1]) / 2
        return float((tangential * (after - before)[1 : 2 * self.nodes : 2])[sliding].sum())

    def losses(self, status: Status, before: Float, after: Float) -> tuple[float, float]:
        """Return what all faces lose in a step at constant load, and the heat of those that slide behind it.

        Along the way the forces change as the jumps do; heat is the slip times the force behind the step, as of one
        implicit step.
        """
        last, step = 2 * self.nodes, after - before
        forces = -(self.solver.product(before) + self.solver.product(after)) / 2
        forces[self.loads] = 0.0
        sliding = np.abs(status) == 1
        heat = (self.forces(after)[1] * step[1:last:2])[sliding].sum()
        return float(forces @ step), float(heat)
