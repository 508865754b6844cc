"""A path with friction on debonded faces: from zero on linear pieces, between which statuses change or bonds break."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from feti_homog.errors import NotCarriedError
from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.contact.states import Status
from feti_homog.interface.friction.coulomb_faces import StuckError
from feti_homog.interface.friction.sliding_cell import SlidingCell
from feti_homog.interface.laws.bond_law import BondLaw
from feti_homog.interface.loads.load import Load
from feti_homog.interface.path.next_change import first_break_between
from feti_homog.interface.path.path_points import NO_ENERGIES, UTILISATION_TIE, PathState, Point, most_utilised
from feti_homog.interface.path.sliding_leg import SlidingLeg
from feti_homog.typing import Float

# Share of a leg without a point, after which a change of statuses is one.
LEAST_SHARE = 0.01
# Changes in a row at the same load, after which they count as a cycle.
MOST_CHANGES_AT_A_LOAD = 200
SAME_LOAD = 1e-12
# What is left of a jump or a strain, relative to what it was, that is rounding: an unloaded cell bears nothing.
CANCELLED = 1e-12
CYCLE = "friction: the statuses of the faces change without end at one load (a cycle)"


def sliding_events(
    cell: CoupledInterfaces, sliding: SlidingCell, law: BondLaw, waypoints: Sequence[Load], begin: PathState
) -> Iterator[Point]:
    """Yield breaks, changes of statuses and ends of legs along zero -> waypoints[0] -> ..., the load controlled.

    Collective.

    Raises:
        NotCarriedError: nothing goes on from the last point, the limit of the load.
    """
    for leg in range(begin.leg, len(waypoints)):
        for point in SlidingEvents(cell, sliding, law, waypoints, leg, begin).points():
            yield point
            begin = point.after


class SlidingEvents(SlidingLeg):
    """Leg at whose rising share s statuses change and bonds break.

    From a state the rates of the faces are those of a problem of complementarity, and hold up to the first of: a face
    reaches a limit of its status, a bond its strength, s = 1.
    """

    def points(self) -> Iterator[Point]:
        """Yield the points of the leg.  Collective."""
        yield from self._break_overloaded()
        changes = 0
        while self._share < 1.0:
            before = self._share
            try:
                status, rate = self._rates()
            except NotCarriedError:
                if self._share > self._reported:
                    yield self._point(0, 0, self._path_state())
                raise
            yield from self._advance(status, rate)
            changes = 0 if self._share > before + SAME_LOAD else changes + 1
            if changes > MOST_CHANGES_AT_A_LOAD:
                raise StuckError(CYCLE)
        yield self._point(0, 0, replace(self._path_state(), leg=self.leg + 1, position=0.0))

    def _rates(self) -> tuple[Status, Float]:
        """Return the statuses with which the state goes on, and the rate of x.  Collective, decided on rank 0."""
        velocity = self.sliding.given(self.end) - self.sliding.given(self.start)
        here, faces = self._here, self.sliding.faces
        return self._on_root(faces.rates, here.status, here.x, self.end.by_stress, velocity)

    def _advance(self, status: Status, rate: Float) -> Iterator[Point]:
        """Go on along the rates up to the next change, and past it."""
        here, faces, cell = self._here, self.sliding.faces, self.cell
        status, x = self._on_root(faces.settled, status, self._given(self._share, here.x), here.x)
        change, rest = cell.comm.bcast(faces.next_change(status, x, rate)), 1.0 - self._share
        if change >= rest - SAME_LOAD:
            change = np.inf
        whole = x + min(rest, change) * rate
        tractions = (self.sliding.traction(each) for each in (x, whole))
        bonds = self.sliding.bonds(self._bonds, status, x)
        breaks = first_break_between(cell, self.law, bonds, *tractions)
        way = min(breaks, 1.0) * min(rest, change)
        there = x + way * rate
        rounded = (there != 0.0) & (np.abs(there) <= CANCELLED * np.abs(x))
        there[rounded] = 0.0
        if not rounded.any():
            faces.solver.keep(there, faces.solver.product(x) + way * faces.solver.product(rate))
        self._go(status, x, there)
        at_end = breaks > 1.0 and change >= rest
        self._share = 1.0 if at_end else self._share + way
        if breaks <= 1.0:
            yield from self._break()
            yield from self._break_overloaded()
        elif not at_end and self._is_point():
            self._first = False
            yield self._point(0, 0, self._path_state())

    def _is_point(self) -> bool:
        """Return whether a change of statuses here is a point."""
        return self._first or self._share - self._reported >= LEAST_SHARE

    def _go(self, status: Status, x: Float, there: Float) -> None:
        """Go straight from x to `there`, with these statuses."""
        after, area = self._standing(status, there), self.sliding.area
        heat = self.sliding.faces.heat(status, x, there) / area
        self._add(after, 0.0, heat)
        self._here, self._bonds = after, self.sliding.bonds(self._bonds, status, there)

    def _break_overloaded(self) -> Iterator[Point]:
        """Break what a break has overloaded, at the same load.  Collective."""
        while most_utilised(self.cell, self.law, self._state())[1] > 1.0 + UTILISATION_TIE:
            yield from self._break()

    def _break(self) -> Iterator[Point]:
        """Break the worst bonds here, and find the state after it.  Collective."""
        broke, softened, broken = self._broken(most_utilised(self.cell, self.law, self._state())[2])
        yield self._point(broke, softened, broken)
        self._after_break(broken)

    def _point(self, broke: int, softened: int, after: PathState) -> Point:
        """Return the point here, at which so many bonds part and so many soften.  Collective."""
        state = self._state()
        used = most_utilised(self.cell, self.law, state)[0]
        energies, self._energies, self._reported = self._energies, NO_ENERGIES, self._share
        return Point((self.leg + self._share) / self.legs, 1.0, state, broke, softened, energies, used, after)
