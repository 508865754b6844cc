"""The search for admissible statuses of debonded faces with Coulomb friction; see `coulomb_faces`.

Pivots change all wrong statuses at once while the number of wrong statuses falls, and nearly always succeed.  Otherwise
Lemke's method follows one path of states, which ends at admissible statuses or on a ray (Cottle, Pang and Stone, The
Linear Complementarity Problem, 1992).
"""

from dataclasses import dataclass

import numpy as np

from feti_homog.interface.contact import Status
from feti_homog.interface.contact.contact_problem import BLOCK_PIVOTS
from feti_homog.interface.friction.face_system import FaceSystem, Prescribed
from feti_homog.interface.friction.status_system import BACKWARD, FORWARD, OPEN_FACE, STICK, FaceStatus
from feti_homog.typing import Bool, Float

# Number of pivots, beyond four for each node, after which a search ends.
SOLVES = 50
STATUSES = list(FaceStatus)
Found = tuple[Status, Float] | None


@dataclass(frozen=True)
class StatusSearch:
    """A search for admissible face statuses (n,) and the scaled x (m,).

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

    def by_pivots(self, status: Status) -> tuple[Found, bool]:
        """Correct wrong statuses by pivots: return the statuses with x, and whether the forces balance.

        Forces that do not balance drive a free motion.  After SOLVES + 4 n pivots the result is (None, False).  After
        some block pivots without progress, one random node changes at a time: a fixed order may end in a cycle.
        """
        fewest, pivots, random = self.faces.nodes + 1, 0, np.random.default_rng(0)
        for _ in range(SOLVES + self.allowed.size):
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

    def _improved(self, status: Status, x: Float) -> Status:
        """Return statuses (n,) in which each node that violates a condition has the allowed status that mends it."""
        rooms, noise = self._rooms(status, x), self.faces.noise(x)
        better, wrong = status.copy(), rooms < -noise
        wrong[STICK] &= rooms[OPEN_FACE] > noise  # without pressure, a slip may have either sign
        for target in (FORWARD, BACKWARD, STICK, OPEN_FACE):
            if wrong[target].any():
                better[wrong[target]] = self._entered(target, status, x)[wrong[target]]
        return better

    def by_lemke(self) -> Found:
        """Search by Lemke's method: admissible statuses under an added pressure that falls to zero.

        The added pressure is t d, with random d by node.  At large t, all faces allowed to touch are STICK or, without
        friction, FORWARD.  As t falls, nodes change their statuses one by one; after a change t goes on, down or up, as
        the new status admits.  At the end det M >= 0 (`status_system`).  Returns None if t rises without end, after
        SOLVES + 4 n changes, or as in `_balanced`.
        """
        faces, load, rest = self.faces, self.load, np.zeros(len(self.start))
        # Nodes of a symmetric cell would reach limits together under equal pressures.
        d = np.random.default_rng(0).uniform(1.0, 2.0, faces.nodes) * (self.allowed.sum(axis=1) > 1)
        touching = self.allowed[:, [STICK, FORWARD, BACKWARD]].any(axis=1)
        status = np.where(touching, np.where(faces.friction > 0.0, STICK, FORWARD), OPEN_FACE).astype(np.int8)
        x = faces.linear(status, load, self.start)[0]
        rooms, rates = self._rooms(status, x), faces.rooms(status, rest, 0.0, d)
        least = np.divide(-rooms, rates, out=np.zeros_like(rooms), where=rooms < 0.0)
        target, node = np.unravel_index(least.argmax(), least.shape)
        t = least[target, node]
        if t == 0.0:
            return self._balanced(status)
        velocity = Prescribed(load.by_stress, np.zeros(len(load.values)), np.zeros(faces.nodes), d)
        for _ in range(SOLVES + self.allowed.size):
            left, status = status[node], status.copy()
            status[node] = self._entered(STATUSES[target], status, x)[node]
            rate = faces.linear(status, velocity, rest)[0]
            rooms, rates = self._rooms(status, x, t * d), faces.rooms(status, rate, 0.0, d)
            # The room up to the status that the node has left is zero, and has to grow.
            back = STICK if status[node] == OPEN_FACE else left, node
            sign, rooms[back] = np.sign(rates[back]), np.inf
            falls = np.isfinite(rooms) & (sign * rates < -faces.noise(rate))
            ways = np.divide(np.maximum(rooms, 0.0), -sign * rates, out=np.full_like(rooms, np.inf), where=falls)
            target, node = np.unravel_index(ways.argmin(), ways.shape)
            way = ways[target, node]
            if sign < 0.0 and way >= t:
                return self._balanced(status)
            if way == np.inf:
                return None
            t, x = t + sign * way, x + sign * way * rate
        return None

    def _balanced(self, status: Status) -> Found:
        """Return the statuses and x by pivots; None if the pivots do not end, or the forces do not balance."""
        result, balanced = self.by_pivots(status)
        return result if balanced else None

    def _rooms(self, status: Status, x: Float, pressure: Float | float = 0.0) -> Float:
        """Return the `FaceSystem.rooms` (4, n) up to allowed statuses; inf up to other statuses."""
        enters = self.allowed.T.copy()
        enters[STICK] |= self.allowed[:, FORWARD]  # an open face without friction closes to FORWARD
        return np.where(enters, self.faces.rooms(status, x, self.load.slip, pressure), np.inf)

    def _entered(self, target: FaceStatus, status: Status, x: Float) -> Status:
        """Return statuses (n,) of nodes that reach the limit `target`; closing faces slide in the slip's direction."""
        if target != STICK:
            return np.full_like(status, target)
        slip = x[self.faces.slips] - self.load.slip
        closing = np.where(np.abs(slip) > self.faces.noise(x), np.sign(slip), STICK)
        closing = np.where(self.faces.friction > 0.0, closing, FORWARD)
        return np.where(status == OPEN_FACE, closing, STICK).astype(np.int8)
