"""Coulomb friction on n debonded nodes, by dense arrays: statuses of states and of rates.

The jumps g = (g_n, g_t) of the nodes and the macroscopic strains E are the unknowns x = (g, E) of the energy
x.S x / 2: the forces on the nodes are f = -(S x)_g, tension positive, and (S x)_E works on the strains.  With the
pressure p = -f_n

    g_n >= 0,  p >= 0,  g_n p = 0,        |f_t| <= mu p,  f_t = s mu p where the slip grows with the sign s.

A node is apart (f = 0), sticks (g_n = 0, g_t unchanged), or slides (g_n = 0, f_t = s mu p).  S includes springs between
the faces of a node, and f excludes their force: a damaged bond is a node without friction on springs 1 / (C - C_0),
apart while the bond is under tension.

Pivots change all wrong statuses at once while the number of wrong statuses falls, and nearly always end.  Otherwise the
search tries all sets of statuses, if the sets are few, and then raises mu from a fraction at which pivots succeed.
"""

from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from feti_homog.errors import NotCarriedError
from feti_homog.interface.contact import Status
from feti_homog.interface.contact.contact_problem import BLOCK_PIVOTS
from feti_homog.interface.friction.face_system import FaceSystem, Prescribed
from feti_homog.interface.friction.status_system import BACKWARD, FORWARD, OPEN_FACE, STICK, FaceStatus
from feti_homog.typing import Bool, Float

# Number of pivots, beyond four for each node, after which other searches begin.
SOLVES = 50
# Largest number of status sets to try, and of equal continuation steps of mu.
MOST_TRIED = 256.0
STATUSES = np.array(list(FaceStatus), np.int8)
Found = tuple[Status, Float] | None

SEARCHED = "friction: no admissible statuses of the faces were found"
FREE = "nothing carries more: the faces slide freely"
INDEFINITE = "friction: the sliding faces resist no more (an indefinite pivot)"


class StuckError(NotCarriedError):
    """A state has no continuation: the search finds no admissible statuses of the debonded faces."""


@dataclass(frozen=True)
class StatusSearch:
    """A search for admissible face statuses (n,) and the scaled x (m,).

    A method returns None if its search finds no admissible statuses; the argument `status` (n,) is the first guess.

    Attributes:
        allowed: (n, 4) statuses that a node may have, in the columns [STICK, FORWARD, OPEN_FACE, BACKWARD]; the search
            ignores the conditions for a change to any other status.
        faces, load: the faces, and the prescribed loads and slips.
        start: (m,) scaled x before the load, from which free motions keep their amplitudes.
    """

    faces: FaceSystem
    allowed: Bool
    load: Prescribed
    start: Float

    def run(self, status: Status) -> Found:
        """Search by pivots, by trial, by continuation, and by pivots from other guesses, until a search succeeds."""
        result = self.by_pivots(status) or self.by_trial(status) or self.by_continuation(status)
        for other in (STICK, OPEN_FACE):
            guess = np.where(self.allowed[:, other], other, status).astype(np.int8)
            result = result or self.by_pivots(guess) or self.by_continuation(guess)
        return result

    def by_pivots(self, status: Status, solves: int | None = None) -> Found:
        """Search by at most `solves` pivots.  Return the final statuses and x if the forces balance."""
        result, balanced = self._pivoted(status, solves)
        return result if balanced else None

    def slides_freely(self, status: Status) -> bool:
        """Return whether the pivots end at statuses with forces that drive a free motion."""
        result, balanced = self._pivoted(status)
        return result is not None and not balanced

    def _pivoted(self, status: Status, solves: int | None = None) -> tuple[Found, bool]:
        """Correct wrong statuses by pivots: return the statuses with x, and whether the forces balance.

        Returns (None, False) after `solves` pivots, by default SOLVES + 4 n.  After some block pivots without progress,
        one random node changes at a time: a fixed order may end in a cycle.
        """
        fewest, pivots, random = self.faces.nodes + 1, 0, np.random.default_rng(0)
        for _ in range(solves or SOLVES + self.allowed.size):
            x, balanced = self.faces.linear(status, self.load, self.start)
            better = self._improved(status, x)
            wrong = np.flatnonzero(better != status)
            if not len(wrong):
                return (status, x), balanced and self.faces.is_balanced(status, self.load, x)
            pivots -= 1
            if len(wrong) < fewest:
                fewest, pivots = len(wrong), BLOCK_PIVOTS
            chosen = wrong if pivots > 0 else random.choice(wrong, 1)
            status = status.copy()
            status[chosen] = better[chosen]
        return None, False

    def jammed(self, status: Status) -> Iterator[tuple[Status, Float]]:
        """Yield admissible statuses and x: from guesses that all sliding faces, or one, stick; then by trial."""
        sliding = np.flatnonzero((np.abs(status) == 1) & self.allowed[:, STICK])
        for stuck in (sliding, *sliding):
            guess = status.copy()
            guess[stuck] = STICK
            if (result := self.by_pivots(guess, SOLVES)) is not None:
                yield result
        yield from self._tried(status)

    def by_trial(self, status: Status) -> Found:
        """Return the admissible statuses with the fewest changes of the guess, and x; None also with too many sets."""
        return next(self._tried(status), None)

    def _tried(self, status: Status) -> Iterator[tuple[Status, Float]]:
        """Yield all admissible statuses and x, fewest changes of the guess first; nothing with too many sets to try."""
        choosers = np.flatnonzero(self.allowed.sum(axis=1) > 1)
        if self.allowed[choosers].sum(axis=1).astype(float).prod() > MOST_TRIED:
            return
        choices = np.array(list(product(*(STATUSES[row] for row in self.allowed[choosers]))), np.int8)
        for choice in choices[np.argsort((choices != status[choosers]).sum(axis=1), kind="stable")]:
            trial = status.copy()
            trial[choosers] = choice
            x, balanced = self.faces.linear(trial, self.load, self.start)
            if balanced and self.faces.is_balanced(trial, self.load, x) and (self._improved(trial, x) == trial).all():
                yield trial, x

    def by_continuation(self, status: Status) -> Found:
        """Search by pivots as friction rises from zero to mu, in steps from the last statuses; None at tiny steps."""
        fraction, step, faces = 0.0, 0.5, copy(self.faces)
        search = replace(self, faces=faces)
        while step >= 1.0 / MOST_TRIED:
            faces.friction = min(fraction + step, 1.0) * self.faces.friction
            result = search.by_pivots(status)
            if result is None:
                step /= 2.0
            elif fraction + step >= 1.0:
                return result
            else:
                fraction, status = fraction + step, result[0]
        return None

    def _improved(self, status: Status, x: Float) -> Status:
        """Return the allowed statuses (n,) that the signs of the forces and jumps in x require."""
        faces, allowed, noise = self.faces, self.allowed, self.faces.noise(x)
        normal, tangential = faces.forces(x)
        gap, moved = x[faces.gaps], x[faces.slips] - self.load.slip
        better, closed = status.copy(), status != OPEN_FACE
        limit = -faces.friction * normal
        pulled = closed & (normal > noise) & allowed[:, OPEN_FACE]
        for sign in (FORWARD, BACKWARD):
            over = (status == STICK) & (sign * tangential - limit > noise) & allowed[:, sign]
            back = (status == sign) & (sign * moved < -noise) & allowed[:, STICK]
            better[over] = sign
            better[back] = STICK
        touches = ~closed & (gap < -noise) & allowed[:, FORWARD]
        direction = np.where(np.abs(moved) > noise, np.sign(moved), STICK)
        better[touches] = np.where(faces.friction > 0.0, direction, FORWARD)[touches]
        better[pulled] = OPEN_FACE
        return better


class CoulombFaces(FaceSystem):
    """Debonded faces with Coulomb friction: a status (n,) for each node, and forces and jumps by scaled x (m,)."""

    def search(self, status: Status, allowed: Bool, load: Prescribed, start: Float) -> tuple[Status, Float]:
        """Find admissible statuses (n,) and scaled x from a first guess; arguments as in `StatusSearch`.

        Raises:
            NotCarriedError: the forces drive a free motion.
            StuckError: the search found no admissible statuses.
        """
        search = StatusSearch(self, allowed, load, start)
        result = search.run(self._known(status))
        if result is None:
            raise NotCarriedError(FREE) if search.slides_freely(self._known(status)) else StuckError(SEARCHED)
        return result

    def all_allowed(self) -> Bool:
        """Return the mask (n, 4) of all statuses; without friction, a face may only be open or FORWARD."""
        allowed = np.ones((self.nodes, 4), bool)
        allowed[np.ix_(self.friction == 0.0, [STICK, BACKWARD])] = False
        return allowed

    def _known(self, status: Status) -> Status:
        """Return the statuses (n,) with FORWARD at touching faces without friction."""
        return np.where((self.friction == 0.0) & (status != OPEN_FACE), FORWARD, status).astype(np.int8)

    def rates(self, status: Status, x: Float, by_stress: Bool, rate: Float) -> tuple[Status, Float]:
        """Find the next statuses (n,), and the rate (m,) of the state x under a load rate (v,).

        Raises NotCarriedError and StuckError as `step` does.
        """
        load, status, start = Prescribed(by_stress, rate, np.zeros(self.nodes)), self._known(status), np.zeros(len(x))
        noise = self.noise(x)
        allowed = self._at_limits(status, x, noise)
        try:
            return self._resisting(status, allowed, load, start)
        except NotCarriedError:
            # All faces of a cell that is nearly unloaded are at limits, but for the rounding of the loads.
            nearly = self._at_limits(status, x, np.maximum(noise, self.least_force(status, load)))
            if (nearly == allowed).all():
                raise
        return self._resisting(status, nearly, load, start)

    def step(self, status: Status, load: Prescribed, start: Float) -> tuple[Status, Float]:
        """Find the statuses (n,) and x (m,) at the end of an implicit step to a load; arguments as in `search`.

        Raises as `search` does, and StuckError if det M is negative, and positive for no other admissible statuses.
        """
        return self._resisting(status, self.all_allowed(), load, start)

    def carries(self, status: Status, load: Prescribed, start: Float) -> bool:
        """Return whether `step` would find admissible statuses, with any det M; a few pivots decide most cases."""
        search = StatusSearch(self, self.all_allowed(), load, start)
        result = search.by_pivots(self._known(status), SOLVES)
        if result is not None or search.slides_freely(self._known(status)):
            return result is not None
        return search.run(self._known(status)) is not None

    def _resisting(self, status: Status, allowed: Bool, load: Prescribed, start: Float) -> tuple[Status, Float]:
        """Find admissible statuses for which det M is not negative, and x; arguments as in `search`.

        A pinched fibre jams if all faces that pinch it stick, and snaps through, with a negative stiffness, if one of
        these faces slides: both sets of statuses are admissible.  Raises NotCarriedError and StuckError as `step` does.
        """
        status, x = self.search(status, allowed, load, start)
        if self.sign(status, load.by_stress) >= 0:
            return status, x
        for result in StatusSearch(self, allowed, load, start).jammed(status):
            if self.sign(result[0], load.by_stress) > 0:
                return result
        raise StuckError(INDEFINITE)

    def _at_limits(self, status: Status, x: Float, noise: Float) -> Bool:
        """Return the mask (n, 4) of allowed statuses: present statuses and, at limits up to `noise`, the next ones."""
        closed = status != OPEN_FACE
        normal, tangential = self.forces(x)
        allowed = np.zeros((self.nodes, 4), bool)
        allowed[np.arange(self.nodes), status] = True
        for sign in (FORWARD, BACKWARD):
            limited = closed & ((status == sign) | (sign * tangential + self.friction * normal >= -noise))
            allowed[limited, sign] = allowed[limited, STICK] = True
        allowed[np.where(closed, normal >= -noise, x[self.gaps] <= noise)] = True
        return allowed & self.all_allowed()

    def next_change(self, status: Status, x: Float, rate: Float) -> float:
        """Return the time until a node leaves its status while x changes at `rate`; inf if no node does."""
        noise, closed = self.noise(rate), status != OPEN_FACE
        (normal, tangential), (dn, dt) = self.forces(x), self.forces(rate)
        sticks = status == STICK
        rooms = [(x[self.gaps], rate[self.gaps], ~closed), (-normal, -dn, closed)]
        for sign in (FORWARD, BACKWARD):
            room, slope = -self.friction * np.stack([normal, dn]) - sign * np.stack([tangential, dt])
            rooms.append((room, slope, sticks))
        margins, falls, counts = (np.stack(values) for values in zip(*rooms, strict=True))
        ends = counts & (falls < -noise)
        return float((np.maximum(margins[ends], 0.0) / -falls[ends]).min(initial=np.inf))

    def heat(self, status: Status, before: Float, after: Float) -> float:
        """Return the heat of a straight path at fixed statuses: mean friction forces times slips, at sliding nodes."""
        sliding, tangential = np.abs(status) == 1, (self.forces(before)[1] + self.forces(after)[1]) / 2
        return float((tangential * (after - before)[self.slips])[sliding].sum())

    def losses(self, status: Status, before: Float, after: Float) -> tuple[float, float]:
        """Return the energy lost on the straight path between states x at constant load, and the heat in this loss."""
        forces = -(self.product(before) + self.product(after)) / 2
        forces[self.loads] = 0.0
        return float(forces @ (after - before)), self.heat_behind(status, before, after)

    def heat_behind(self, status: Status, before: Float, after: Float) -> float:
        """Return the heat of an implicit step: final friction forces times slips, at sliding nodes."""
        slips = (after - before)[self.slips]
        return float((self.forces(after)[1] * slips)[np.abs(status) == 1].sum())
