"""Path legs without friction, where the load is controlled and the response piecewise linear."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from mpi4py import MPI

from feti_homog.errors import NotCarriedError
from feti_homog.feti import DualSolution
from feti_homog.interface.contact import BondState, Equilibrium
from feti_homog.interface.laws.bond_law import UTILISATION_TIE
from feti_homog.interface.loads import Macroscopic, Multipliers
from feti_homog.interface.path.leg import SAME_SHARE, Leg
from feti_homog.interface.path.onsets import first_break, first_change
from feti_homog.interface.path.path_points import PathState, Point, most_utilised
from feti_homog.typing import Float

# A response is on a straight line within the solver's error, or within this rounding of the best solves, relative to
# the largest stress of the line.
OFF_LINE_ROUNDING = 1e-10


class FrictionlessLeg(Leg):
    """A leg with equilibria that are independent of the path.

    From the equilibrium at leg fraction s, the transitions are

        overloaded   A break, or a contact change at which the released energy of tips jumps, overloads bonds: the
                     worst bonds break (a point); solve at the same s without these bonds.
        advance      With a linear response, predict the first break, the beginning of a contact change, and the
                     end of the leg, and solve at the first of these.  If the stress is not on the line, or a bond
                     is overloaded, an event was missed: halve the step until no event is missed.  The result is
          a break    the worst bonds break (a point); solve at the same s without these bonds;
          a change   a point; solve a little further, where the change is beyond doubt;
          neither    a point if contact states have changed.
        touch        Open faces do not carry the stresses of the load: a point where the faces touch.
        end          s = 1: a point.

    A predicted change that does not occur is a false alarm: up to the next change, only halving finds changes.
    """

    _state: Equilibrium
    # Fraction before which the line bends, and whether the last prediction was a false alarm.
    _bends_before, _false_alarm = np.inf, False

    @property
    def state(self) -> Equilibrium:
        """The equilibrium at leg fraction s; not collective."""
        return self._state

    def points(self) -> Iterator[Point]:
        """Find the first equilibrium, and yield the leg's points up to a solve without convergence.  Collective."""
        self._settle(self._from)
        yield from super().points()

    def _is_over(self) -> bool:
        """Return whether the leg is at its end, or a solve did not converge."""
        return self._share >= 1.0 or not self._state.converged

    def _settle(self, begin: PathState) -> None:
        """Find the equilibrium at the present leg fraction s, with the bonds of `begin`.  Collective."""
        self._bends_before, self._false_alarm, self._from = np.inf, False, begin
        self._go_to(self._share)

    def _go_to(self, share: float) -> None:
        """Advance to the equilibrium at a leg fraction.  Collective; raises like `CoupledInterfaces.equilibrium`."""
        self._stand(share, self._solve(share, self._from.bonds, self._from.lam))

    def _solve(self, share: float, bonds: BondState, lam: Multipliers) -> Equilibrium:
        """Solve for the equilibrium at a leg fraction, from guessed bonds and multipliers.  Collective."""
        return self.cell.equilibrium(self._load_at(share), bonds, lam)

    def _stand(self, share: float, state: Equilibrium) -> None:
        """Set the state at a leg fraction, and add the energies since the state before to the sum.  Collective."""
        if share >= self._bends_before:
            self._bends_before = np.inf
        self._share, self._state, self._bonds = share, state, state.bonds
        self._mean = self.cell.macroscopic(state.solutions)
        self._energies = self._energies.plus(self._from.energies_to(self._mean))
        self._from = self._path_state()

    def _advance(self) -> Iterator[Point]:
        """Advance past the next event, or to the end of the straight response, and yield points.  Collective.

        Raises:
            NotCarriedError: neither open nor touching faces carry the load's stresses.
        """
        cell, before, start = self.cell, self._state, self._share
        try:
            end = cell.linear(self.end, before.bonds, before.multipliers)  # with fixed contact states
        except NotCarriedError:
            beyond = min(start + SAME_SHARE, 1.0)
            touching = self._solve(beyond, before.bonds, before.multipliers)
            self._stand(start, self._solve(start, touching.bonds, touching.multipliers))
            yield self._turn(beyond)
            self._stand(beyond, touching)
            self._false_alarm = False
            return
        # Fractions of the leg at which a bond breaks, contact begins to change, and contact surely has changed; or inf.
        breaks = first_break(cell, self.law, before.bonds, cell.traction(before.solutions), cell.traction(end))
        change = (1.0, 1.0) if self._false_alarm else first_change(cell.plane, before, end[0])
        breaks, begins, certain = (start + (1.0 - start) * way for way in (breaks, *change))
        begins = begins if begins < 1.0 - SAME_SHARE else np.inf
        target = min(breaks, begins, 1.0)
        is_here = target - start <= SAME_SHARE and (target == begins or (target == breaks and self._is_due()))
        reached = is_here or self._approach(target, end)
        is_due = reached and target == breaks and self._is_due()
        is_reported = self._share <= self._reported + SAME_SHARE
        turned = False
        if reached and target == begins and not is_due:
            # Beyond the state in which contact begins to change, the change is beyond doubt; faces that touch without a
            # force may have opened since `before`.
            state = self._state
            beyond = min(max(min(breaks, certain), self._share + SAME_SHARE), 1.0)
            if not is_reported:
                yield self._turn(beyond)
            self._stand(beyond, self._solve(beyond, state.bonds, state.multipliers))
            self._false_alarm = not self._differs(before)
            turned = is_reported and not self._false_alarm
        elif not is_due and self._differs(before):
            self._false_alarm, turned = False, not is_reported
        # The state after a change is a point, unless a break or the end at this s is a point.
        if turned and not self._is_over() and not self._is_overloaded():
            yield self._turn(self._share)
        yield from self._break_overloaded(is_due)

    def _is_due(self) -> bool:
        """Return whether the most utilised bonds have reached their strength.  Collective."""
        return self._used()[1] > 1.0 - UTILISATION_TIE

    def _approach(self, target: float, end: Sequence[DualSolution]) -> bool:
        """Advance to the leg fraction `target`, or to one before it if the response bends.  Collective.

        Return whether the leg has reached the target; `end` has the solutions at the end of the leg.
        """
        cell, start, begin, reached = self.cell, self._share, self._state, True
        nearest = min(start + SAME_SHARE, 1.0)
        target = max(target, nearest)
        if target >= self._bends_before:
            target, reached = max((start + self._bends_before) / 2, nearest), False
        before, after = self._mean, cell.macroscopic(end)
        ends = np.stack([self._response(before), self._response(after)])
        parts = np.split(np.stack([before.strain, after.strain]), [len(cell.plane.solver.problem.loads)], axis=1)
        pairs = zip(parts, cell.problems, strict=False)
        least = [np.abs(strain @ problem.scales.least_bonded_stiffness).max() for strain, problem in pairs]
        largest = max(np.abs(ends).max(), *least)
        off_line = max(cell.plane.scales.sign_noise, OFF_LINE_ROUNDING) * largest
        while True:
            way = (target - start) / (1.0 - start)
            lam = tuple((1.0 - way) * a + way * b.lam for a, b in zip(begin.multipliers, end, strict=True))
            state = self._solve(target, begin.bonds, lam)
            if target <= nearest or not state.converged:
                break
            # The response is straight if no bond is overloaded and the state is on the line to `end`.
            used = most_utilised(cell, self.law, state)[1]
            error = (1.0 - way) * ends[0] + way * ends[1] - self._response(cell.macroscopic(state.solutions))
            if used <= 1.0 + UTILISATION_TIE and np.abs(error).max() <= off_line:
                break
            self._bends_before, reached = target, False
            target = max((start + target) / 2, nearest)
        self._stand(target, state)
        return reached

    def _response(self, state: Macroscopic) -> Float:
        """Return the components (n,) that the load leaves free: stresses, or strains times the largest stiffness."""
        return np.where(self.end.by_stress, self.cell.plane.scales.largest_stiffness * state.strain, state.stress)

    def _turn(self, position: float) -> Point:
        """Return a point without a break for the present state; the path continues at `position`.  Collective."""
        return self._point(0, 0, replace(self._path_state(), position=position))

    def _differs(self, before: Equilibrium) -> bool:
        """Return whether contact states have changed since the equilibrium `before`.  Collective."""
        return bool(self.cell.comm.allreduce(bool(self._state.bonds.differs(before.bonds).any()), MPI.LOR))
