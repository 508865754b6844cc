"""A leg of a path that does not begin at zero: the load is controlled and the response piecewise linear."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from mpi4py import MPI

from feti_homog.errors import NotCarriedError
from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.contact.states import Equilibrium
from feti_homog.interface.laws.bond_law import BondLaw
from feti_homog.interface.loads.load import CoupledSolution, Load, Macroscopic
from feti_homog.interface.path.next_change import first_break, first_change
from feti_homog.interface.path.path_points import (
    NO_ENERGIES,
    UTILISATION_TIE,
    PathState,
    Point,
    break_bonds,
    most_utilised,
)
from feti_homog.typing import Float

# Shares of a leg that are not distinguished.
LEAST_SHARE = 1e-9
# A response is on a straight line if it is off by no more than this many relative tolerances of the Krylov method, and
# by no more than rounding leaves of the best solves, both relative to the largest stress of the line.  The solver,
# which begins with the multipliers of the line, was off by a few hundredths of a tolerance.
OFF_LINE_PER_RTOL, OFF_LINE_ROUNDING = 10.0, 1e-10


class LaterLeg:
    """Events on leg `leg` of `legs`, the way between two loads of the same kinds, at rising share s of it.

    From the equilibrium at s the transitions are

        overloaded   By a break, or at tips by a change of contact, with which the energy jumps that they release.  The
                     worst bonds break: a point; equilibrium at the same s without them.
        advance      With the response linear from here on, predict where the first bond breaks, where the contact
                     begins to change, and where the leg ends.  Equilibrium at the first of these; if the stress is
                     not on the line, or a bond is overloaded, something comes before: halve the way until that is
                     not so.  What was reached is
          a break    the worst bonds break: a point; equilibrium at the same s without them;
          a change   a point; equilibrium a little further, where the change is beyond doubt;
          less       a point if contact states are others than before.
        touch        Open faces carry nothing of what the stresses of the load become: a point where they touch.
        end          s = 1: a point.

    A change that was predicted and does not come is a false alarm: up to the next change predictions are not used, and
    only halving finds it.
    """

    def __init__(
        self, cell: CoupledInterfaces, law: BondLaw, waypoints: Sequence[Load], leg: int, begin: PathState
    ) -> None:
        """Stand at `begin` on the way from its origin to waypoint `leg`.  Collective."""
        self.cell, self.law, self.end = cell, law, waypoints[leg]
        self.leg, self.legs = leg, len(waypoints)
        self.origin = begin.last if begin.position == 0.0 else begin.origin
        self.start = cell.leg_start(self.origin, waypoints[leg - 1], self.end)
        # Where the last point is, up to where the line is known to bend, and whether a predicted change did not come.
        self._reported, self._bends_before, self._false_alarm = begin.position, np.inf, False
        self._from, self._energies = begin, NO_ENERGIES
        self._stand(begin.position, cell.equilibrium(self._load_at(begin.position), begin.bonds, begin.lam))

    def _load_at(self, share: float) -> Load:
        return self.start.after(share, self.end)

    def points(self) -> Iterator[Point]:
        """Yield the points of the leg; if a solve does not converge, up to there. Collective."""
        yield from self._break_overloaded()
        while self._share < 1.0 and self._state.converged:
            ahead = self._ahead()
            yield from self._touch() if ahead is None else self._advance(ahead)
        yield self._point(0, 0, self._path_state(self.leg + 1, 0.0))

    def _ahead(self) -> CoupledSolution | None:
        """Return the end of the leg with the contact states as they are; None if they do not carry its stresses."""
        try:
            return self.cell.linear(self.end, self._state.bonds, self._state.multipliers)
        except NotCarriedError:
            return None

    def _advance(self, ahead: CoupledSolution) -> Iterator[Point]:
        """Go to the next event, or as far towards it as the response is straight, and past it."""
        before, share = self._state, self._share
        breaks, begins, certain = self._predict(ahead)
        target = min(breaks, begins, 1.0)
        is_here = target - share <= LEAST_SHARE and (target == begins or (target == breaks and self._is_due()))
        reached = is_here or self._approach(target, ahead)
        if reached and target == breaks and self._is_due():
            yield from self._break()
        elif reached and target == begins:
            yield from self._change(min(breaks, certain), before)
        elif self._differs(before):
            self._false_alarm = False
            if self._share > self._reported + LEAST_SHARE:
                yield from self._turned()
        yield from self._break_overloaded()

    def _is_due(self) -> bool:
        """Return whether the worst bonds are at their strength."""
        return self._used_at_worst > 1.0 - UTILISATION_TIE

    def _predict(self, ahead: CoupledSolution) -> tuple[float, float, float]:
        """Shares of the leg where a bond breaks, where the contact begins to change, and where that is beyond doubt.

        What does not happen on the leg is at infinity.
        """
        rest = 1.0 - self._share
        breaks = first_break(self.cell, self.law, self._state, ahead)
        begins, certain = (1.0, 1.0) if self._false_alarm else first_change(self.cell.plane, self._state, ahead.plane)
        if begins == 1.0:
            begins = certain = np.inf
        return self._share + rest * breaks, self._share + rest * begins, self._share + rest * certain

    def _approach(self, target: float, ahead: CoupledSolution) -> bool:
        """Stand at the target, or at the first half, quarter, ... of the way up to which the response is straight.

        Whether it is the target.
        """
        start, here, reached = self._share, self._state, True
        nearest = min(start + LEAST_SHARE, 1.0)
        target = max(target, nearest)
        if target >= self._bends_before:
            target, reached = max((start + self._bends_before) / 2, nearest), False
        while True:
            way = (target - start) / (1.0 - start)
            state = self.cell.equilibrium(self._load_at(target), here.bonds, here.multipliers.towards(ahead.lam, way))
            if target <= nearest or not state.converged or self._continues(ahead, way, state):
                break
            self._bends_before, reached = target, False
            target = max((start + target) / 2, nearest)
        self._stand(target, state)
        return reached

    def _continues(self, ahead: CoupledSolution, way: float, state: Equilibrium) -> bool:
        """Return whether no bond is overloaded in a state, and its response on the line to `ahead`.  Collective."""
        cell = self.cell
        _, used, _ = most_utilised(cell, self.law, state)
        here, there = self._from.last, cell.macroscopic(ahead)
        ends = np.stack([self._response(here), self._response(there)])
        off = np.abs((1.0 - way) * ends[0] + way * ends[1] - self._response(cell.macroscopic(state.solutions))).max()
        strains = np.stack([here.strain, there.strain])
        largest = max(np.abs(ends).max(), np.abs(cell.least_bonded_stress(strains)).max())
        tolerance = max(OFF_LINE_PER_RTOL * cell.plane.solver.rtol, OFF_LINE_ROUNDING)
        return bool(used <= 1.0 + UTILISATION_TIE and off <= tolerance * largest)

    def _response(self, state: Macroscopic) -> Float:
        """(n,) what the load leaves open: stresses, and strains times a stiffness."""
        return np.where(self.end.by_stress, self.cell.plane.scales.largest_stiffness * state.strain, state.stress)

    def _change(self, beyond: float, from_state: Equilibrium) -> Iterator[Point]:
        """Report the state in which the contact begins to change, and go on to where the change is beyond doubt.

        If there is a point here, of a break or a waypoint, report the state after the change instead.  Faces that touch
        without a force may open on the way here from `from_state`.
        """
        before, beyond = self._state, min(max(beyond, self._share + LEAST_SHARE), 1.0)
        there_is_one = self._share <= self._reported + LEAST_SHARE
        if not there_is_one:
            yield self._turn(beyond)
        self._stand(beyond, self.cell.equilibrium(self._load_at(beyond), before.bonds, before.multipliers))
        self._false_alarm = not self._differs(from_state)
        if there_is_one and not self._false_alarm:
            yield from self._turned()

    def _touch(self) -> Iterator[Point]:
        """Report the state in which open faces touch, which carry no more than there is here, and go on from there.

        Raises:
            NotCarriedError: touching faces do not carry it either.
        """
        state, beyond = self._state, min(self._share + LEAST_SHARE, 1.0)
        there = self.cell.equilibrium(self._load_at(beyond), state.bonds, state.multipliers)
        here = self.cell.equilibrium(self._load_at(self._share), there.bonds, there.multipliers)
        self._stand(self._share, here)
        yield self._turn(beyond)
        self._stand(beyond, there)
        self._false_alarm = False

    def _turned(self) -> Iterator[Point]:
        """Report the state after a change of contact; a break here is the point otherwise."""
        if not self._is_overloaded():
            yield self._turn(self._share)

    def _turn(self, position: float) -> Point:
        """Return the state here as a point at which nothing breaks and from which the path goes on at `position`."""
        return self._point(0, 0, self._path_state(self.leg, position))

    def _break_overloaded(self) -> Iterator[Point]:
        while self._is_overloaded():
            yield from self._break()

    def _is_overloaded(self) -> bool:
        """Return True if bonds break here at once: a break or a change of contact has overloaded them."""
        return self._used_at_worst > 1.0 + UTILISATION_TIE and self._state.converged

    def _break(self) -> Iterator[Point]:
        """Break the worst bonds here, and find the state after it."""
        cell, state, worst = self.cell, self._state, self._worst
        bonds, broke, softened, fracture = break_bonds(cell, self.law, worst, state)
        broken = replace(self._path_state(self.leg, self._share), bonds=bonds, broken=fracture)
        yield self._point(broke, softened, broken)
        self._bends_before, self._false_alarm, self._from = np.inf, False, broken
        self._stand(self._share, cell.equilibrium(self._load_at(self._share), bonds, state.multipliers))

    def _point(self, broke: int, softened: int, after: PathState) -> Point:
        """Return the point here, at which so many bonds part and so many soften."""
        energies, self._energies, self._reported = self._energies, NO_ENERGIES, self._share
        load_factor = (self.leg + self._share) / self.legs
        return Point(load_factor, 1.0, self._state, broke, softened, energies, self._used, after)

    def _path_state(self, leg: int, position: float) -> PathState:
        """From the state here on, at a position of a leg."""
        return replace(self._from, leg=leg, position=position)

    def _stand(self, share: float, state: Equilibrium) -> None:
        """Stand at a share of the leg, where this state was found."""
        self._share, self._state = share, state
        if share >= self._bends_before:
            self._bends_before = np.inf
        self._used, self._used_at_worst, self._worst = most_utilised(self.cell, self.law, state)
        here = self.cell.macroscopic(state.solutions)
        self._energies = self._energies.plus(self._from.energies_to(here))
        self._from = PathState(self.leg, share, state.bonds, state.multipliers, self.origin, here)

    def _differs(self, before: Equilibrium) -> bool:
        """Return whether contact states are other than before; collective."""
        return bool(self.cell.comm.allreduce(bool(self._state.bonds.differs(before.bonds).any()), MPI.LOR))
