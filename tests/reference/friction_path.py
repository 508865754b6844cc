"""Paths of faces with friction, from change to change of status, rates by trying statuses one after the other.

A bond breaks at constant load, by implicit steps: its faces and all others slide from where they are.
"""

from dataclasses import dataclass
from itertools import product
from types import SimpleNamespace

import numpy as np

from reference.condensed_cell import MixedLoad
from reference.friction import BACKWARD, BONDED, FORWARD, OPEN, SIGN, STICK, NoEquilibriumError, RubbingFaces, State

TIE = 1e-9  # of forces and jumps: what is equal
TOGETHER = 1e-6  # of utilisations: bonds that break at once
MOST = 4**8  # statuses that are tried


@dataclass(frozen=True)
class Point:
    """A change of status, a break or the end of a leg, on the whole path, 0 to 1.

    With the state, before its `broke` (k,) bonds break, and energies per area up to it.
    """

    load_factor: float
    state: State
    broke: np.ndarray
    work: float
    stored: float
    heat: float
    dissipated: float


class FrictionPath:
    """The path of `faces` from rest; of a `cell` whose bonds break by `law.used(cell, state, bonded)`."""

    def __init__(self, faces: RubbingFaces, cell=None, law=None):
        self.faces, self.cell, self.law, self.state = faces, cell, law, faces.at_rest
        self.points = []
        self.work = self.heat = self.dissipated = 0.0
        self.force = self.jump = 0.0

    def follow(self, loads):
        """Return the points of all legs, straight from one load to the next."""
        for leg, load in enumerate(loads):
            self._leg(load, leg, len(loads))
        return self.points

    def increments(self, loads, steps, worst_only=False):
        """Return the points after each of so many equal steps: implicit ones, and breaks until none is left."""
        legs, start = len(loads), None
        for step in range(1, steps + 1):
            leg = (step * legs - 1) // steps
            if start is None or leg > ((step - 1) * legs - 1) // steps:
                start = self.state.start_of(loads[leg])
            load, broke = start.towards(loads[leg], step * legs / steps - leg), np.zeros(self.faces.k, bool)
            self._increment(load)
            while (which := self._overloaded(1.0 + TOGETHER)).any():
                which = which if worst_only else self.used(self.state) > 1.0
                broke |= which
                self._break(which, load)
            self._report(step / steps, broke)
        return self.points

    def _increment(self, load):
        """Go to a load by one implicit step."""
        before, faces = self.state, self.faces
        after = faces.increment(before, load)
        heat = after.shear @ (after.slip - before.slip) / faces.area
        self.heat += heat
        self.work += after.stored(faces.area) - before.stored(faces.area) + heat
        self._stand(after)

    def _leg(self, load, leg, legs):
        start, s, stays = self.state.start_of(load), 0.0, 0
        way = MixedLoad(load.values - start.values, load.by_stress)
        while s < 1.0:
            rate = self.rate(way)
            step = min(self._next_change(rate), 1.0 - s)
            stays = stays + 1 if step < TIE else 0
            if stays > 20:
                raise NoEquilibriumError(f"statuses change for ever at {(leg + s) / legs}")

            def after(share, rate=rate):
                return self.faces.linear(rate.status, start.towards(load, share), self.state)[0]

            there = 1.0 if step >= 1.0 - s else s + step
            broken = self.used(after(there)).max() > 1.0
            s = self._break_between(after, s, there) if broken else there
            self._book(after(s))
            which = self._overloaded(1.0 - TIE) if broken else np.zeros(self.faces.k, bool)
            self._break_all(which, start.towards(load, s), (leg + s) / legs)

    def _break_all(self, which, load, load_factor):
        """Report the state here, break bonds (k,) there, and those that this overloads, a point each."""
        self._report(load_factor, which)
        while which.any():
            self._break(which, load)
            which = self._overloaded(1.0 + TOGETHER)
            if which.any():
                self._report(load_factor, which)

    def used(self, state):
        """(k,) shares of what breaks the bonds."""
        if self.law is None:
            return np.zeros(self.faces.k)
        force = np.column_stack([-state.pressure, state.shear, *state.axial.reshape(-1, self.faces.k)])
        return self.law.used(self.cell, SimpleNamespace(force=force), self.faces.bonded)

    def _break_between(self, after, low, high):
        """Return the share at which the first bond breaks."""
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (low, middle) if self.used(after(middle)).max() > 1.0 else (middle, high)
        return high

    def _overloaded(self, limit):
        """(k,) the bonds that are used most, if that is more than a limit."""
        used = self.used(self.state)
        return (used >= used.max() * (1 - TOGETHER)) & (used > limit)

    def _break(self, which, load):
        """Break bonds at constant load; what that loses is what the forces on the jumps do not store."""
        before = self.state
        self.faces.bonded = self.faces.bonded & ~which
        after = self.faces.increment(before, load)
        self._lose(after, after.shear @ (after.slip - before.slip) / self.faces.area)

    def _lose(self, after, heat):
        """Go to a state at the same load with some heat; the rest of what is not stored is lost."""
        before = self.state
        work = (after.stress + before.stress) @ (after.strain - before.strain) / 2
        lost = work - after.stored(self.faces.area) + before.stored(self.faces.area)
        self.work, self.heat, self.dissipated = self.work + work, self.heat + heat, self.dissipated + lost - heat
        self._stand(after)

    def _report(self, load_factor, broke):
        stored = self.state.stored(self.faces.area)
        self.points.append(Point(load_factor, self.state, broke, self.work, stored, self.heat, self.dissipated))

    def _book(self, after):
        """Add the energies of a straight way."""
        before = self.state
        self.work += (after.stress + before.stress) @ (after.strain - before.strain) / 2
        self.heat += (after.shear + before.shear) @ (after.slip - before.slip) / 2 / self.faces.area
        self._stand(after)

    def _stand(self, after):
        self.state = after
        self.force = max(self.force, np.abs(after.pressure).max(), np.abs(after.shear).max())
        self.jump = max(self.jump, np.abs(after.gap).max(), np.abs(after.slip).max())

    def choices(self):
        """Return which statuses each node (k,) may have from the state on."""
        state, faces = self.state, self.faces
        room = faces.mu * state.pressure - np.abs(state.shear)
        small = TIE * self.force
        found = []
        for i in range(faces.k):
            if faces.bonded[i]:
                found.append((BONDED,))
            elif state.gap[i] > TIE * self.jump:
                found.append((OPEN,))
            elif state.pressure[i] <= small:
                found.append((STICK, FORWARD, BACKWARD, OPEN))
            elif room[i] > small:
                found.append((STICK,))
            else:
                found.append((STICK, FORWARD if state.shear[i] > 0 else BACKWARD))
        return found

    def rate(self, way):
        """Return the rate of the state along a way, its status that of the next stretch."""
        choices = self.choices()
        last = self.state.status
        now = np.array([status if status in own else own[0] for status, own in zip(last, choices, strict=True)])
        found = self._by_exchange(now, choices, way)
        if found is None:
            found = next(self.rates(way, now), None)
        if found is None:
            raise NoEquilibriumError("no statuses of the next stretch are admissible")
        return found

    def rates(self, way, now=None):
        """Yield all admissible rates, those first whose statuses differ least from `now`."""
        choices = self.choices()
        if np.prod([float(len(own)) for own in choices]) > MOST:
            raise NoEquilibriumError("too many nodes may change")
        tried = np.array(list(product(*choices)))
        if now is not None:
            tried = tried[np.argsort((tried != now).sum(axis=1), kind="stable")]
        for some in np.array_split(tried, max(1, len(tried) // 256)):
            for rate in self.faces.linear(some, way):
                if not self.wrong(rate, choices).any():
                    yield rate

    def wrong(self, rate, choices):
        """(k,) which of the nodes that may change contradict their status."""
        several = np.array([len(own) for own in choices])
        p, f, gap, slip, status = rate.pressure, rate.shear, rate.gap, rate.slip, rate.status
        force, jump = (TIE * max(np.abs(a).max(), np.abs(b).max(), 1e-300) for a, b in ((p, f), (gap, slip)))
        sign = np.where(self.state.shear > 0, 1.0, -1.0)
        room = self.faces.mu * p - np.where(several == 4, np.abs(f), sign * f)
        bad = (status == STICK) & (room < -force)
        bad |= (SIGN[status] != 0) & (SIGN[status] * slip < -jump)
        bad |= (several == 4) & (np.where(status == OPEN, gap < -jump, p < -force))
        return bad & (several > 1)

    def _by_exchange(self, status, choices, way):
        """Return the rate found by exchanging wrong statuses; None if that does not end soon."""
        status = status.copy()
        for _ in range(60):
            (rate,) = self.faces.linear(status, way)
            wrong = np.flatnonzero(self.wrong(rate, choices))
            if not len(wrong):
                return rate
            for i in wrong:
                status[i] = self._other(i, rate, choices[i])
        return None

    def _other(self, i, rate, own):
        """Return the status to try at a node instead of a wrong one."""
        if len(own) == 2:
            return own[int(own[0] == rate.status[i])]
        if rate.status[i] == OPEN:
            return STICK
        if rate.pressure[i] < 0:
            return OPEN
        if rate.status[i] == STICK:
            return FORWARD if rate.shear[i] > 0 else BACKWARD
        return STICK

    def _next_change(self, rate):
        """Return how far along the way the first status changes."""
        state, faces, status = self.state, self.faces, rate.status
        closed = (status != OPEN) & ~faces.bonded
        force = max(np.abs(rate.pressure).max(), np.abs(rate.shear).max())
        jump = max(np.abs(rate.gap).max(), np.abs(rate.slip).max())
        levels = [(closed, state.pressure, rate.pressure, force), (status == OPEN, state.gap, rate.gap, jump)]
        for sign in (1.0, -1.0):
            room = faces.mu * state.pressure - sign * state.shear
            levels.append((status == STICK, room, faces.mu * rate.pressure - sign * rate.shear, force))
        first = np.inf
        for which, value, slope, scale in levels:
            # What falls by rounding does not change again.
            falls = which & (slope < -10 * TIE * scale)
            ends = np.maximum(value[falls], 0.0) / -slope[falls]
            first = min(first, ends.min(initial=np.inf))
        return first
