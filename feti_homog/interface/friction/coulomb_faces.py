"""Coulomb friction on n debonded nodes, by dense arrays: find admissible states, and their rates.

The jumps g = (g_n, g_t) of the nodes and the macroscopic strains E are the unknowns x = (g, E) of the energy
x.S x / 2: the forces on the nodes are f = -(S x)_g, tension positive, and (S x)_E works on the strains.  With the
pressure p = -f_n

    g_n >= 0,  p >= 0,  g_n p = 0,        |f_t| <= mu p,  f_t = s mu p where the slip grows with the sign s.

A node is apart (f = 0), sticks (g_n = 0, g_t unchanged), or slides (g_n = 0, f_t = s mu p).  S includes springs between
the faces of a node, and f excludes their force: a damaged bond is a node on springs 1 / (C - C_0), apart while the bond
is under tension; mu is 0 there, unless damage brings friction.
"""

import numpy as np

from feti_homog.errors import NotCarriedError
from feti_homog.interface.contact import Status
from feti_homog.interface.friction.face_system import FaceSystem, Prescribed
from feti_homog.interface.friction.status_search import StatusSearch
from feti_homog.interface.friction.status_system import BACKWARD, FORWARD, OPEN_FACE, STICK
from feti_homog.typing import Bool, Float

SEARCHED = "friction: no admissible statuses of the faces were found"
FREE = "nothing carries more: the faces slide freely"
INDEFINITE = "friction: the sliding faces resist no more (an indefinite pivot)"


class StuckError(NotCarriedError):
    """A state has no continuation: no admissible statuses of the faces resist, or the statuses change without end."""


class CoulombFaces(FaceSystem):
    """Debonded faces with Coulomb friction, each with a status (n,); forces and jumps follow from scaled x (m,)."""

    def search(self, status: Status, allowed: Bool, load: Prescribed, start: Float) -> tuple[Status, Float]:
        """Find admissible statuses (n,) and scaled x from a first guess; arguments as in `StatusSearch`.

        Raises:
            NotCarriedError: the forces drive a free motion.
            StuckError: the search found no admissible statuses.
        """
        search = StatusSearch(self, allowed, load, start)
        result, balanced = search.by_pivots(self._known(status))
        found = result if balanced else search.by_lemke()
        if found is None:
            raise NotCarriedError(FREE) if result else StuckError(SEARCHED)
        return found

    def all_allowed(self) -> Bool:
        """Return the mask (n, 4) of possible statuses: all four or, without friction, only OPEN_FACE and FORWARD."""
        allowed = np.ones((self.nodes, 4), bool)
        allowed[np.ix_(self.friction == 0.0, [STICK, BACKWARD])] = False
        return allowed

    def _known(self, status: Status) -> Status:
        """Return a copy of the statuses (n,) in which touching faces without friction are FORWARD."""
        return np.where((self.friction == 0.0) & (status != OPEN_FACE), FORWARD, status).astype(np.int8)

    def rates(self, status: Status, x: Float, by_stress: Bool, rate: Float) -> tuple[Status, Float]:
        """Find the next statuses (n,) and the rate (m,) of x under a load rate (v,).  Raises as `step` does.

        A second search, if the first fails, also takes faces of a nearly unloaded cell for faces at limits.
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

        Raises as `search` does, and StuckError if det M (`status_system`) is negative, also after Lemke's method.
        """
        return self._resisting(status, self.all_allowed(), load, start)

    def carries(self, status: Status, load: Prescribed, start: Float) -> bool:
        """Return whether `search` finds admissible statuses under a load, even if det M (`status_system`) < 0."""
        try:
            self.search(status, self.all_allowed(), load, start)
        except NotCarriedError:
            return False
        return True

    def _resisting(self, status: Status, allowed: Bool, load: Prescribed, start: Float) -> tuple[Status, Float]:
        """Find admissible statuses (n,) for which det M is not negative, and x (m,); arguments as in `search`.

        A pinched fibre jams if all faces that pinch it stick, and snaps through, with a negative stiffness, if one of
        these faces slides: both sets of statuses are admissible.  Raises NotCarriedError and StuckError as `step` does.
        """
        status, x = self.search(status, allowed, load, start)
        if self.sign(status, load.by_stress) >= 0:
            return status, x
        result = StatusSearch(self, allowed, load, start).by_lemke()
        if result is None or self.sign(result[0], load.by_stress) < 0:
            raise StuckError(INDEFINITE)
        return result

    def _at_limits(self, status: Status, x: Float, noise: Float) -> Bool:
        """Return the mask (n, 4) of allowed statuses: the present ones and, at limits up to `noise`, the next ones."""
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
        rooms, rates = self.rooms(status, x, x[self.slips], 0.0), self.rooms(status, rate, 0.0, 0.0)
        falls = rates < -self.noise(rate)
        falls[STICK] &= status == OPEN_FACE  # only faces without pressure slip against their sign
        return float((np.maximum(rooms[falls], 0.0) / -rates[falls]).min(initial=np.inf))

    def heat(self, status: Status, before: Float, after: Float) -> float:
        """Return the frictional heat of a straight path at fixed statuses: mean forces times slips at sliding nodes."""
        sliding, tangential = np.abs(status) == 1, (self.forces(before)[1] + self.forces(after)[1]) / 2
        return float((tangential * (after - before)[self.slips])[sliding].sum())

    def losses(self, status: Status, before: Float, after: Float) -> tuple[float, float]:
        """Return the energy lost by faces on a straight path between states x at constant load, and the heat in it."""
        forces = -(self.product(before) + self.product(after)) / 2
        forces[self.loads] = 0.0
        return float(forces @ (after - before)), self.heat_behind(status, before, after)

    def heat_behind(self, status: Status, before: Float, after: Float) -> float:
        """Return the frictional heat of an implicit step: final forces times slips at sliding nodes."""
        slips = (after - before)[self.slips]
        return float((self.forces(after)[1] * slips)[np.abs(status) == 1].sum())
