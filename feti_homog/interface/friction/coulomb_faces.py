"""Coulomb friction on n debonded nodes, by dense arrays: the statuses of a state and of its rates.

The jumps g = (g_n, g_t) of the nodes and the macroscopic strains E are the unknowns x = (g, E) of the energy
x.S x / 2: the forces on the nodes are f = -(S x)_g, tension positive, and (S x)_E works on the strains.  With the
pressure p = -f_n

    g_n >= 0,  p >= 0,  g_n p = 0,        |f_t| <= mu p,  f_t = s mu p where the slip grows with the sign s.

A node is apart (f = 0), sticks (g_n = 0, g_t as it was), or slides (g_n = 0, f_t = s mu p).  Springs between the faces
of a node are part of S, and f the force beside theirs: a damaged bond is a node without friction on springs of
1 / (C - C_0), apart while it is pulled.

Pivots change all wrong statuses at once while their number falls, and nearly always come to an end.  If they do not,
all sets of statuses are tried where these are few; then the coefficients are raised from where pivots find statuses.
"""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from feti_homog.errors import NotCarriedError
from feti_homog.interface.contact.contact_problem import BLOCK_PIVOTS
from feti_homog.interface.contact.states import Status
from feti_homog.interface.friction.face_system import FaceSystem, Prescribed
from feti_homog.interface.friction.status_system import BACKWARD, FORWARD, OPEN_FACE, STICK, largest_share, residual
from feti_homog.typing import Bool, Float

# Share of the forces of the loads that may be left on a free motion.
UNBALANCED = 1e-7
# Solves, and solves a node, after which other searches take over; solves of a step of the continuation.
SOLVES, SOLVES_PER_NODE = 50, 4
# Sets of statuses that are tried one after the other, and the least step of mu.
MOST_TRIED, LEAST_STEP = 256.0, 1.0 / 256.0
STATUSES = np.array([STICK, FORWARD, OPEN_FACE, BACKWARD], np.int8)
Found = tuple[Status, Float] | None

SEARCHED = "friction: no admissible statuses of the faces were found"
FREE = "nothing carries more: the faces slide freely"
INDEFINITE = "friction: the sliding faces resist no more (an indefinite pivot)"


class StuckError(NotCarriedError):
    """No statuses of debonded faces go on from a state."""


@dataclass(frozen=True)
class StatusSearch:
    """Search for statuses (n,) and scaled x (m,) that are admissible; each method returns None if it finds none.

    Attributes:
        allowed: (n, 4) statuses that a node may have, in the columns [STICK, FORWARD, OPEN_FACE, BACKWARD]; conditions
            between a status and one that is not allowed do not count.
        start: (m,) where x stays if nothing determines it.
    """

    faces: FaceSystem
    allowed: Bool
    given: Prescribed
    start: Float

    def run(self, status: Status) -> Found:
        """Return what is found from a first guess by one method after the other."""
        found = self.by_pivots(status, self._solves)
        return found or self.by_trial(status) or self.by_continuation(status)

    @property
    def _solves(self) -> int:
        """Number of solves after which other searches take over."""
        return SOLVES + SOLVES_PER_NODE * self.faces.nodes

    def by_pivots(self, status: Status, solves: int) -> Found:
        """Return the statuses to which pivots lead, if the forces balance."""
        found, balanced = self._pivoted(status, solves)
        return found if balanced else None

    def slides_freely(self, status: Status) -> bool:
        """Return whether pivots lead to statuses that hold on a free motion, but leave forces that drive it."""
        found, balanced = self._pivoted(status, self._solves)
        return found is not None and not balanced

    def _pivoted(self, status: Status, solves: int) -> tuple[Found, bool]:
        """Return what changes of all wrong statuses at once lead to, and whether its forces balance.

        After some block pivots without progress one node at random changes at a time: with friction a fixed order may
        come back to where it was.
        """
        fewest, left, random = self.faces.nodes + 1, 0, np.random.default_rng(0)
        for _ in range(solves):
            x, balanced = self.faces.linear(status, self.given, self.start)
            better = self._improved(status, x)
            wrong = np.flatnonzero(better != status)
            if not len(wrong):
                return (status, x), balanced and self._is_balanced(status, x)
            left -= 1
            if len(wrong) < fewest:
                fewest, left = len(wrong), BLOCK_PIVOTS
            chosen = wrong if left > 0 else random.choice(wrong, 1)
            status = status.copy()
            status[chosen] = better[chosen]
        return None, False

    def jammed(self, status: Status) -> Iterator[tuple[Status, Float]]:
        """Yield others beside admissible statuses: from all faces that slide stuck, from each alone, and by trial."""
        sliding = np.flatnonzero((np.abs(status) == 1) & self.allowed[:, STICK])
        for stuck in (sliding, *sliding):
            guess = status.copy()
            guess[stuck] = STICK
            if (found := self.by_pivots(guess, SOLVES)) is not None:
                yield found
        yield from self._tried(status)

    def by_trial(self, status: Status) -> Found:
        """Return the admissible statuses that differ least from a guess, if there are few to try."""
        return next(self._tried(status), None)

    def _tried(self, status: Status) -> Iterator[tuple[Status, Float]]:
        """Yield all admissible statuses, those first that differ least from a guess; none if there are many to try."""
        several = np.flatnonzero(self.allowed.sum(axis=1) > 1)
        if self.allowed[several].sum(axis=1).astype(float).prod() > MOST_TRIED:
            return
        choices = np.array(list(product(*(STATUSES[own] for own in self.allowed[several]))), np.int8)
        for choice in choices[np.argsort((choices != status[several]).sum(axis=1), kind="stable")]:
            tried = status.copy()
            tried[several] = choice
            if (found := self._checked(tried)) is not None:
                yield found

    def by_continuation(self, status: Status) -> Found:
        """Return what pivots find with a share of mu that rises to 1, from where they found something last."""
        share, step, faces = 0.0, 0.5, copy(self.faces)
        search = replace(self, faces=faces)
        while step >= LEAST_STEP:
            faces.friction = min(share + step, 1.0) * self.faces.friction
            found = search.by_pivots(status, SOLVES)
            if found is None:
                step /= 2.0
            elif share + step >= 1.0:
                return found
            else:
                share, status = share + step, found[0]
        return None

    def _checked(self, status: Status) -> Found:
        """Return statuses with their x if they are admissible."""
        x, balanced = self.faces.linear(status, self.given, self.start)
        balanced = balanced and self._is_balanced(status, x)
        return (status, x) if balanced and (self._improved(status, x) == status).all() else None

    def _is_balanced(self, status: Status, x: Float) -> bool:
        """Return False if a free motion, such as the turning of a fibre that slides all around, has a force on it."""
        faces, given, terms = self.faces, self.given, self.faces.terms
        held = np.zeros(len(x))
        # Not of strains and slips that came out: a free motion is as large as its force over what holds it.
        held[faces.loads] = np.where(given.by_stress, 0.0, given.values)
        held[1 : 2 * faces.nodes : 2] = np.where(status == STICK, given.slip, 0.0)
        rows = faces.prescribed(status, given, self.start)[1]
        free = faces.free(status, given.by_stress)
        left = np.abs(residual(faces.product(x), rows, *free))
        left = np.maximum(left - np.finfo(float).eps * np.abs(x).max(initial=0.0), 0.0)
        # Of the forces of what is prescribed, at a node and at those that it is coupled with.
        return largest_share(left, np.abs(rows) + terms(terms(held)), free[1]) <= UNBALANCED

    def _improved(self, status: Status, x: Float) -> Status:
        """(n,) the statuses that the signs of forces and jumps call for."""
        faces, allowed, slip, last = self.faces, self.allowed, self.given.slip, 2 * self.faces.nodes
        normal, tangential = faces.forces(x)
        noise, gap, moved = faces.noise(x), x[:last:2], x[1:last:2] - slip
        better, closed = status.copy(), status != OPEN_FACE
        limit = -faces.friction * normal
        pulled = closed & (normal > noise) & allowed[:, OPEN_FACE]
        for sign in (FORWARD, BACKWARD):
            over = (status == STICK) & (sign * tangential - limit > noise) & allowed[:, sign]
            back = (status == sign) & (sign * moved < -noise) & allowed[:, STICK]
            better[over] = sign
            better[back] = STICK
        touches = ~closed & (gap < -noise) & allowed[:, FORWARD]
        way = np.where(np.abs(moved) > noise, np.sign(moved), STICK)
        better[touches] = np.where(faces.friction > 0.0, way, FORWARD)[touches]
        better[pulled] = OPEN_FACE
        return better


class CoulombFaces(FaceSystem):
    """Debonded faces with Coulomb friction."""

    def search(self, status: Status, allowed: Bool, given: Prescribed, start: Float) -> tuple[Status, Float]:
        """Return statuses (n,) and scaled x that are admissible, from a first guess; arguments as of `StatusSearch`.

        Raises:
            NotCarriedError: forces drive a motion that nothing resists.
            StuckError: none was found.
        """
        search = StatusSearch(self, allowed, given, start)
        found = search.run(self._known(status))
        if found is None:
            raise NotCarriedError(FREE) if search.slides_freely(self._known(status)) else StuckError(SEARCHED)
        return found

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
        return self._resisting(status, self._at_limits(status, x), given, np.zeros(len(x)))

    def step(self, status: Status, given: Prescribed, start: Float) -> tuple[Status, Float]:
        """Return the statuses (n,) and x (m,) of an implicit step to what is given, from a first guess and a start.

        Raises:
            StuckError: as `rates`.
        """
        return self._resisting(status, self.all_allowed(), given, start)

    def carries(self, status: Status, given: Prescribed, start: Float) -> bool:
        """Return whether there is such a step; sure of it where few pivots find that it is so, or that it is not."""
        search = StatusSearch(self, self.all_allowed(), given, start)
        found = search.by_pivots(self._known(status), SOLVES)
        if found is not None or search.slides_freely(self._known(status)):
            return found is not None
        return search.run(self._known(status)) is not None

    def _resisting(self, status: Status, allowed: Bool, given: Prescribed, start: Float) -> tuple[Status, Float]:
        """Return admissible statuses whose determinant is not negative, and scaled x; arguments as of `search`.

        A fibre that few faces pinch is jammed where they stick, and is pushed through by a negative stiffness where
        one of them slides: both are admissible.

        Raises:
            StuckError: none was found, or with a negative determinant alone.
        """
        status, x = self.search(status, allowed, given, start)
        if self.sign(status, given.by_stress) >= 0:
            return status, x
        for found in StatusSearch(self, allowed, given, start).jammed(status):
            if self.sign(found[0], given.by_stress) > 0:
                return found
        raise StuckError(INDEFINITE)

    def _at_limits(self, status: Status, x: Float) -> Bool:
        """(n, 4) the statuses that nodes of a state may go on with: their own, and others where a limit is reached."""
        closed, gap = status != OPEN_FACE, x[: 2 * self.nodes : 2]
        (normal, tangential), noise = self.forces(x), self.noise(x)
        allowed = np.zeros((self.nodes, 4), bool)
        allowed[np.arange(self.nodes), status] = True
        for sign in (FORWARD, BACKWARD):
            limited = closed & ((status == sign) | (sign * tangential + self.friction * normal >= -noise))
            allowed[limited, sign] = allowed[limited, STICK] = True
        allowed[np.where(closed, normal >= -noise, gap <= noise)] = True
        return self._without_friction_free(allowed)

    def next_change(self, status: Status, x: Float, rate: Float) -> float:
        """Return how far x goes on along its `rate` until a status ends, inf if none does."""
        noise, closed = self.noise(rate), status != OPEN_FACE
        (normal, tangential), (dn, dt) = self.forces(x), self.forces(rate)
        sticks, last = status == STICK, 2 * self.nodes
        rooms = [(x[:last:2], rate[:last:2], ~closed), (-normal, -dn, closed)]
        for sign in (FORWARD, BACKWARD):
            room, slope = -self.friction * np.stack([normal, dn]) - sign * np.stack([tangential, dt])
            rooms.append((room, slope, sticks))
        here, falls, counts = (np.stack(each) for each in zip(*rooms, strict=True))
        ends = counts & (falls < -noise)
        return float((np.maximum(here[ends], 0.0) / -falls[ends]).min(initial=np.inf))

    def heat(self, status: Status, before: Float, after: Float) -> float:
        """Return the heat of friction on a straight way between two states, whose statuses these are."""
        sliding, tangential = np.abs(status) == 1, (self.forces(before)[1] + self.forces(after)[1]) / 2
        return float((tangential * (after - before)[1 : 2 * self.nodes : 2])[sliding].sum())

    def losses(self, status: Status, before: Float, after: Float) -> tuple[float, float]:
        """Return what all faces lose in a step at constant load, and the heat of those that slide behind it.

        Along the way the forces change as the jumps do.
        """
        forces = -(self.product(before) + self.product(after)) / 2
        forces[self.loads] = 0.0
        return float(forces @ (after - before)), self.heat_behind(status, before, after)

    def heat_behind(self, status: Status, before: Float, after: Float) -> float:
        """Return the heat of one implicit step: slips times the forces behind it, of faces that slide behind it."""
        slips = (after - before)[1 : 2 * self.nodes : 2]
        return float((self.forces(after)[1] * slips)[np.abs(status) == 1].sum())
