"""Coulomb friction on n debonded nodes, by dense arrays: the statuses of a state and of its rates.

The jumps g = (g_n, g_t) of the nodes and the macroscopic strains E are the unknowns x = (g, E) of the energy
x.S x / 2: the forces on the nodes are f = -(S x)_g, tension positive, and (S x)_E works on the strains.  With the
pressure p = -f_n

    g_n >= 0,  p >= 0,  g_n p = 0,        |f_t| <= mu p,  f_t = s mu p where the slip grows with the sign s.

A node is apart (f = 0), sticks (g_n = 0, g_t as it was), or slides (g_n = 0, f_t = s mu p).  Springs between the faces
of a node are part of S, and f the force beside theirs: a damaged bond is a node without friction on springs of
1 / (C - C_0), apart while it is pulled.
"""

from __future__ import annotations

import numpy as np

from feti_homog.errors import NotCarriedError
from feti_homog.interface.contact.states import Status
from feti_homog.interface.friction.face_system import FaceSystem, Prescribed
from feti_homog.interface.friction.status_search import SOLVES_OF_A_STEP, StatusSearch
from feti_homog.interface.friction.status_system import BACKWARD, FORWARD, OPEN_FACE, STICK
from feti_homog.typing import Bool, Float

SEARCHED = "friction: no admissible statuses of the faces were found"
FREE = "nothing carries more: the faces slide freely"
INDEFINITE = "friction: the sliding faces resist no more (an indefinite pivot)"


class StuckError(NotCarriedError):
    """No statuses of debonded faces go on from a state."""


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
        found = search.by_pivots(self._known(status), SOLVES_OF_A_STEP)
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
        if self.solver.sign(*self.free(status, given.by_stress)) >= 0:
            return status, x
        for found in StatusSearch(self, allowed, given, start).jammed(status):
            if self.solver.sign(*self.free(found[0], given.by_stress)) > 0:
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
        forces = -(self.solver.product(before) + self.solver.product(after)) / 2
        forces[self.loads] = 0.0
        return float(forces @ (after - before)), self.heat_behind(status, before, after)

    def heat_behind(self, status: Status, before: Float, after: Float) -> float:
        """Return the heat of one implicit step: slips times the forces behind it, of faces that slide behind it."""
        slips = (after - before)[1 : 2 * self.nodes : 2]
        return float((self.forces(after)[1] * slips)[np.abs(status) == 1].sum())
