"""Path legs with friction on debonded faces: linear pieces between changes of status and breaks of bonds.

Equal load steps, in contrast, are implicit: slips grow with the sign of the final traction.  As the path within a step
is unknown, the heat is the work of final forces on slips; the work of the loads is stored, released or heat.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from feti_homog.errors import NotCarriedError
from feti_homog.interface.contact import CoupledInterfaces, Equilibrium, Status
from feti_homog.interface.friction.coulomb_faces import StuckError
from feti_homog.interface.friction.face_system import Prescribed
from feti_homog.interface.friction.sliding_cell import SlidingCell
from feti_homog.interface.laws.bond_law import BondLaw
from feti_homog.interface.loads import ROUNDING, Load, Macroscopic
from feti_homog.interface.path.leg import SAME_SHARE, Leg
from feti_homog.interface.path.onsets import first_break
from feti_homog.interface.path.path_points import Energies, PathState, Point
from feti_homog.system.parallel import mpi_errors
from feti_homog.typing import Float

# Least fraction of a leg between the last point and a change of statuses that becomes a point.
LEAST_SHARE = 0.01
# Changes at one load that count as a cycle.
MOST_CHANGES_AT_A_LOAD = 200
CYCLE = "friction: the statuses of the faces change without end at one load (a cycle)"


class CoulombLeg(Leg):
    """A leg with face statuses (n,) and scaled x (m,), as in `CoulombFaces`.

    Rates solve a complementarity problem, and are constant until a face reaches a limit of its status, a bond reaches
    its strength, or the leg ends.  A break is an implicit step at constant load to admissible statuses.
    """

    _state: Equilibrium | None

    def __init__(
        self,
        cell: CoupledInterfaces,
        law: BondLaw,
        waypoints: Sequence[Load],
        leg: int,
        begin: PathState,
        sliding: SlidingCell,
    ) -> None:
        """Find the state at `begin`.  Collective; on a leg from a waypoint, the first change of statuses is a point."""
        super().__init__(cell, law, waypoints, leg, begin)
        self.sliding, self._first, self._changes = sliding, begin.position == 0.0, 0
        self._settle(begin)

    @property
    def state(self) -> Equilibrium:
        """The equilibrium at leg fraction s, computed once.  Collective."""
        if self._state is None:
            loads = [*self.waypoints[: self.leg], self._load_at(self._share)]
            self._state = self.sliding.equilibrium(loads, self._bonds, self._x)
        return self._state

    def _path_state(self) -> PathState:
        """Return the path state at leg fraction s, with the spring energy of damaged bonds.  Collective."""
        return replace(super()._path_state(), stretched=self.sliding.stretched(self._x))

    def _on_root(self, find: Callable[..., tuple[Status, Float]], *arguments: Any) -> tuple[Status, Float]:
        """Call `find` on rank 0; return the statuses and x on all ranks, and keep the product S x.  Collective."""
        faces = self.sliding.faces

        def found() -> tuple[Status, Float, Float]:
            status, x = find(*arguments)
            return status, x, faces.product(x)

        status, x, product = mpi_errors.on_root(self.cell.comm, found)
        faces.keep(x, product)
        return status, x

    def _given(self, share: float, x: Float) -> Prescribed:
        """Return the load at a leg fraction as `Prescribed`, with slips that start from the state x."""
        load = self._load_at(share)
        return Prescribed(load.by_stress, self.sliding.given(load), x[self.sliding.faces.slips])

    def _stand(self, status: Status, x: Float, mean: Macroscopic, way: Energies) -> None:
        """Set the statuses, x and macroscopic state; add `way`, the energies since the state before, to the sum."""
        self._energies = self._energies.plus(way)
        self._bonds = self.sliding.bonds(self._bonds, status, x)
        self._status, self._x, self._mean, self._state = status, x, mean, None

    def _settle(self, begin: PathState) -> None:
        """Find the state at leg fraction s with the bonds of `begin`, which a break may have changed.  Collective.

        In a break, faces lose the work of the mean forces on the changes of jumps.  The work of the final forces on the
        slips is heat; the break releases the rest.  Raises like `CoulombFaces.search`.
        """
        sliding, self._bonds = self.sliding, begin.bonds
        self._status, self._x = status, x = sliding.begin(begin.bonds, begin.last.strain)
        self._mean, self._state = sliding.macroscopic(x), None
        if begin.broken is None:
            return
        self._mean, faces = begin.last, sliding.faces
        status, after = self._on_root(faces.search, status, faces.all_allowed(), self._given(self._share, x), x)
        lost, heat = (loss / self.cell.area for loss in faces.losses(status, x, after))
        lost += begin.stretched - sliding.stretched(x)  # softening bonds lose the energy of their springs
        lost += sliding.released_along(begin.last, sliding.macroscopic(after))
        self._go_straight(status, after, lost - heat, heat, begin.broken)
        self._first = True

    def _go_straight(self, status: Status, x: Float, released: float, heat: float, fracture: float = 0.0) -> None:
        """Advance on a straight path to new statuses and scaled x; sum up its work and the given energies, per area."""
        before, mean = self._mean, self.sliding.macroscopic(x)
        work = 0.5 * float((before.stress + mean.stress) @ (mean.strain - before.strain))
        self._stand(status, x, mean, Energies(work, released, fracture, heat))

    def _advance(self) -> Iterator[Point]:
        """Advance along the rates to the next change, break or end of the leg, and yield points.  Collective.

        Raises:
            NotCarriedError: the cell carries no more load; the last point is at the largest load.
            StuckError: no statuses continue the state, or statuses change without end.
        """
        sliding, faces, start = self.sliding, self.sliding.faces, self._share
        velocity = sliding.given(self.end) - sliding.given(self.start)
        try:
            status, rate = self._on_root(faces.rates, self._status, self._x, self.end.by_stress, velocity)
        except NotCarriedError:
            if self._share > self._reported:
                yield self._point(0, 0, self._path_state())
            raise
        status, x = self._on_root(faces.settled, status, self._given(start, self._x), self._x)
        change, rest = self.cell.comm.bcast(faces.next_change(status, x, rate)), 1.0 - start
        change = np.inf if change >= rest - ROUNDING else change
        tractions = (sliding.traction(state) for state in (x, x + min(rest, change) * rate))
        breaks = first_break(self.cell, self.law, sliding.bonds(self._bonds, status, x), *tractions)
        way = min(breaks, 1.0) * min(rest, change)
        self._share = 1.0 if breaks > 1.0 and change >= rest else start + way
        after = x + way * rate
        if self._share == 1.0:  # the given strains, without rounding
            after[faces.loads] = np.where(self.end.by_stress, after[faces.loads], sliding.given(self.end))
        rounded = (after != 0.0) & (np.abs(after) <= ROUNDING * np.abs(x))
        after[rounded] = 0.0
        if not rounded.any():
            faces.keep(after, faces.product(x) + way * faces.product(rate))
        self._go_straight(status, after, 0.0, faces.heat(status, x, after) / self.cell.area)
        if breaks <= 1.0:
            yield from self._break_overloaded(is_due=True)
        elif self._share < 1.0 and (self._first or self._share - self._reported >= LEAST_SHARE):
            self._first = False
            yield self._point(0, 0, self._path_state())
        self._changes = 0 if self._share > start + ROUNDING else self._changes + 1
        if self._changes > MOST_CHANGES_AT_A_LOAD:
            raise StuckError(CYCLE)

    def _go_to(self, share: float) -> None:
        """Advance in one step to a leg fraction.  Collective.

        If the cell carries only a part of the load, the step ends there and sets `limit`.  Raises NotCarriedError if it
        carries no more load, and StuckError if no statuses are admissible.
        """
        sliding, x, faces = self.sliding, self._x, self.sliding.faces

        def carried() -> tuple[float, NotCarriedError | None]:
            """Return the leg fraction that the cell carries, and the error beyond it or None; `share` if stuck."""
            low, high = self._share, share
            try:
                faces.step(self._status, self._given(share, x), x)
            except StuckError:
                return share, None
            except NotCarriedError as error:
                limit = error
            else:
                return share, None
            while high - low > SAME_SHARE * share:
                middle = (low + high) / 2
                carries = faces.carries(self._status, self._given(middle, x), x)
                low, high = (middle, high) if carries else (low, middle)
            if low - self._share <= 10 * SAME_SHARE * share:
                raise limit
            return low, limit

        self._share, self.limit = mpi_errors.on_root(self.cell.comm, carried)
        status, after = self._on_root(faces.step, self._status, self._given(self._share, x), x)
        heat = faces.heat_behind(status, x, after) / self.cell.area
        way = Energies(sliding.stored(after) - sliding.stored(x) + heat, 0.0, 0.0, heat)
        self._stand(status, after, sliding.macroscopic(after), way)
