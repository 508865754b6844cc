"""A leg of a path that does not begin at zero strain: the strain is controlled and the response piecewise linear."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from mpi4py import MPI

from feti_homog.feti.dual_solution import DualSolution
from feti_homog.interface.bond_criterion import BondCriterion
from feti_homog.interface.contact import Equilibrium, Interface
from feti_homog.interface.leg_prediction import first_break, first_change
from feti_homog.interface.path_points import (
    UTILISATION_TIE,
    Break,
    PathState,
    Point,
    count_on_all_ranks,
    energies_of,
    fracture_energy,
    most_utilised,
)
from feti_homog.typing import Float

# Shares of a leg that are not told apart.
LEAST_SHARE = 1e-9
# A strain that is smaller than this, relative to those at the ends of its leg, is what rounding leaves of zero.
STRAIN_ROUNDING = 1e-13
# A stress is on a straight line if it is off by no more than this many relative tolerances of the Krylov method, and
# by no more than rounding leaves of the best solves, both relative to the largest stress of the line.  The solver,
# which begins with the multipliers of the line, was off by a few hundredths of a tolerance.
OFF_LINE_PER_RTOL, OFF_LINE_ROUNDING = 10.0, 1e-10


def strain_between(before: Float, after: Float, share: float) -> Float:
    """The strain (3,) after a share of a leg; what is left of zero by rounding is zero."""
    strain = (1.0 - share) * before + share * after
    return np.asarray(np.where(np.abs(strain).max() > STRAIN_ROUNDING * np.abs([before, after]).max(), strain, 0.0))


class LaterLeg:
    """Events on leg `leg` of `legs`, the way between two strains, at rising share s of it.

    From the equilibrium at s the transitions are

        overloaded   The worst bonds break: a point; equilibrium at the same s without them.
        advance      With the response linear from here on, predict where the first bond breaks, where the contact
                     begins to change, and where the leg ends.  Equilibrium at the first of these; if the stress is
                     not on the line, or a bond is overloaded, something comes before: halve the way until that is
                     not so.  What was reached is
          a break    the worst bonds break: a point; equilibrium at the same s without them;
          a change   a point; equilibrium a little further, where the change is beyond doubt;
          less       a point if contact states are others than before.
        end          s = 1: a point.

    A change that was predicted and does not come is a false alarm: up to the next change predictions are not used, and
    only halving finds it.
    """

    def __init__(
        self,
        interface: Interface,
        criterion: BondCriterion,
        strains: tuple[Float, Float],
        number: tuple[int, int],
        begin: PathState,
    ) -> None:
        """Stand where `begin` says on the way between two `strains` (3,); `number` is (leg, legs).  Collective."""
        self.interface, self.criterion, self.strains = interface, criterion, strains
        self.leg, self.legs = number
        # Where the last point is, up to where the line is known to bend, and whether a predicted change did not come.
        self._reported, self._bends_before, self._false_alarm = begin.position, np.inf, False
        self._broken, self._energies = begin.broken, (0.0, 0.0)
        strain = strain_between(*strains, begin.position)
        self._stand(begin.position, interface.equilibrium(strain, begin.status, begin.lam))

    def points(self) -> Iterator[Point]:
        """The points of the leg; if a solve does not converge, up to there.  Collective."""
        yield from self._break_overloaded()
        while self._share < 1.0 and self._state.solution.reason >= 0:
            yield from self._advance()
        yield self._point(0, PathState(self.leg + 1, 0.0, self._state.status, self._state.solution.lam))

    def _advance(self) -> Iterator[Point]:
        """Go to the next event, or as far towards it as the response is straight, and past it."""
        before, share = self._state, self._share
        ahead = self.interface.linear(self.strains[1], before.status, before.solution.lam)
        breaks, begins, certain = self._predict(ahead)
        target = min(breaks, begins, 1.0)
        is_here = target - share <= LEAST_SHARE and (target == begins or (target == breaks and self._is_due()))
        reached = is_here or self._approach(target, ahead)
        if reached and target == breaks and self._is_due():
            yield from self._break()
        elif reached and target == begins:
            yield from self._change(min(breaks, certain))
        elif self._differs(before):
            self._false_alarm = False
            if self._share > self._reported + LEAST_SHARE:
                yield self._turn(self._share)
        yield from self._break_overloaded()

    def _is_due(self) -> bool:
        """Whether the worst bonds are at their strength."""
        return self._load > 1.0 - UTILISATION_TIE

    def _predict(self, ahead: DualSolution) -> tuple[float, float, float]:
        """Shares of the leg where a bond breaks, where the contact begins to change, and where that is beyond doubt.

        What does not happen on the leg is at infinity.
        """
        rest = 1.0 - self._share
        breaks = first_break(self.interface, self.criterion, self._state, ahead)
        begins, certain = (1.0, 1.0) if self._false_alarm else first_change(self.interface, self._state, ahead)
        if begins == 1.0:
            begins = certain = np.inf
        return self._share + rest * breaks, self._share + rest * begins, self._share + rest * certain

    def _approach(self, target: float, ahead: DualSolution) -> bool:
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
            lam = (1.0 - way) * here.solution.lam + way * ahead.lam
            state = self.interface.equilibrium(strain_between(*self.strains, target), here.status, lam)
            if target <= nearest or state.solution.reason < 0 or self._continues(ahead, way, state):
                break
            self._bends_before, reached = target, False
            target = max((start + target) / 2, nearest)
        self._stand(target, state)
        return reached

    def _continues(self, ahead: DualSolution, way: float, state: Equilibrium) -> bool:
        """Whether no bond is overloaded in a state, and its stress is on the line from here to `ahead`; collective."""
        _, load, _ = most_utilised(self.interface, self.criterion, state)
        stress = self.interface.stress
        ends = np.stack([stress(self._state.solution), stress(ahead)])
        off = np.abs((1.0 - way) * ends[0] + way * ends[1] - stress(state.solution)).max()
        largest = max(np.abs(ends).max(), np.abs(np.stack(self.strains) @ self.interface.least_bonded_stiffness).max())
        tolerance = max(OFF_LINE_PER_RTOL * self.interface.solver.rtol, OFF_LINE_ROUNDING)
        return bool(load <= 1.0 + UTILISATION_TIE and off <= tolerance * largest)

    def _change(self, beyond: float) -> Iterator[Point]:
        """Report the state in which the contact begins to change, and go on to where the change is beyond doubt.

        If there is a point here, of a break or a waypoint, report the state after the change instead.
        """
        before, beyond = self._state, min(max(beyond, self._share + LEAST_SHARE), 1.0)
        there_is_one = self._share <= self._reported + LEAST_SHARE
        if not there_is_one:
            yield self._turn(beyond)
        strain = strain_between(*self.strains, beyond)
        self._stand(beyond, self.interface.equilibrium(strain, before.status, before.solution.lam))
        self._false_alarm = not self._differs(before)
        if there_is_one and not self._false_alarm:
            yield self._turn(self._share)

    def _turn(self, position: float) -> Point:
        """The state here as a point at which nothing breaks and from which the path goes on at `position`."""
        return self._point(0, PathState(self.leg, position, self._state.status, self._state.solution.lam))

    def _break_overloaded(self) -> Iterator[Point]:
        while self._load > 1.0 + UTILISATION_TIE and self._state.solution.reason >= 0:
            yield from self._break()

    def _break(self) -> Iterator[Point]:
        """Break the worst bonds here, and find the state after it."""
        solution, broke = self._state.solution, count_on_all_ranks(self.interface, self._worst)
        status = self.interface.debond(self._state.status, self._worst, solution.lam)
        fracture = fracture_energy(self.interface, self.criterion, self._worst, self.interface.traction(solution))
        broken = Break(self.interface.stress(solution), fracture)
        yield self._point(broke, PathState(self.leg, self._share, status, solution.lam, broken))
        self._bends_before, self._false_alarm, self._broken = np.inf, False, broken
        self._stand(self._share, self.interface.equilibrium(solution.strain, status, solution.lam))

    def _point(self, broke: int, after: PathState) -> Point:
        energies, self._energies, self._reported = self._energies, (0.0, 0.0), self._share
        load_factor = (self.leg + self._share) / self.legs
        return Point(load_factor, 1.0, self._state, broke, *energies, self._used, after)

    def _stand(self, share: float, state: Equilibrium) -> None:
        """Stand at a share of the leg, where this state was found."""
        self._share, self._state = share, state
        if share >= self._bends_before:
            self._bends_before = np.inf
        self._used, self._load, self._worst = most_utilised(self.interface, self.criterion, state)
        after = self.interface.stress(state.solution)
        released, fracture = energies_of(self._broken, state.solution.strain, after)
        self._energies, self._broken = (self._energies[0] + released, self._energies[1] + fracture), None

    def _differs(self, before: Equilibrium) -> bool:
        """Whether contact states are other than before; collective."""
        differ = bool((self._state.status != before.status).any())
        return bool(self.interface.solver.comm.allreduce(differ, MPI.LOR))
