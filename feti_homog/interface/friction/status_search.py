"""Search of admissible statuses of debonded faces under what is prescribed.

Pivots change all wrong statuses at once while their number falls, and nearly always come to an end.  If they do not,
all sets of statuses are tried where these are few; then the coefficients are raised from where pivots find statuses.
"""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from feti_homog.interface.contact.states import Status
from feti_homog.interface.friction.face_system import FaceSystem, Prescribed
from feti_homog.interface.friction.status_system import BACKWARD, FORWARD, OPEN_FACE, STICK, largest_share, residual
from feti_homog.typing import Bool, Float

# Share of the forces of the loads that may be left on a free motion.
UNBALANCED = 1e-7
# Pivots of blocks without progress, after which one node at random changes at a time: with friction a fixed order may
# come back to where it was.  And solves after which other searches take over; those of a step of the continuation.
BLOCK_PIVOTS, LEAST_SOLVES, SOLVES_PER_NODE, SOLVES_OF_A_STEP = 11, 50, 4, 50
# Sets of statuses that are tried one after the other, and the least step of mu.
MOST_TRIED, LEAST_STEP = 256.0, 1.0 / 256.0
STATUSES = np.array([STICK, FORWARD, OPEN_FACE, BACKWARD], np.int8)
Found = tuple[Status, Float] | None


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
        return LEAST_SOLVES + SOLVES_PER_NODE * self.faces.nodes

    def by_pivots(self, status: Status, solves: int) -> Found:
        """Return the statuses to which pivots lead, if the forces balance."""
        found, balanced = self._pivoted(status, solves)
        return found if balanced else None

    def slides_freely(self, status: Status) -> bool:
        """Return whether pivots lead to statuses that hold on a free motion, but leave forces that drive it."""
        found, balanced = self._pivoted(status, self._solves)
        return found is not None and not balanced

    def _pivoted(self, status: Status, solves: int) -> tuple[Found, bool]:
        """Return what changes of all wrong statuses at once lead to, or of one at random where they lead nowhere.

        And whether its forces balance.
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
            if (found := self.by_pivots(guess, SOLVES_OF_A_STEP)) is not None:
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
            found = search.by_pivots(status, SOLVES_OF_A_STEP)
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
        faces, given, terms = self.faces, self.given, self.faces.solver.terms
        held = np.zeros(len(x))
        # Not of strains and slips that came out: a free motion is as large as its force over what holds it.
        held[faces.loads] = np.where(given.by_stress, 0.0, given.values)
        held[1 : 2 * faces.nodes : 2] = np.where(status == STICK, given.slip, 0.0)
        rows = faces.prescribed(status, given, self.start)[1]
        free = faces.free(status, given.by_stress)
        left = np.abs(residual(faces.solver.product(x), rows, *free))
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
