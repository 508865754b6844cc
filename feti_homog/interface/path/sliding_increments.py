"""A path with friction on debonded faces in equal load steps, each an implicit one.

In a step slips grow from where they were with the sign of the traction behind it, then overloaded bonds break at its
load until none is left.  The way within the step is not known: its heat is that of the slips under the forces behind
it, and the work of the loads what is stored, lost or heat.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from feti_homog.errors import NotCarriedError
from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.contact.states import BONDED
from feti_homog.interface.friction.coulomb_faces import StuckError
from feti_homog.interface.friction.sliding_cell import SlidingCell
from feti_homog.interface.laws.bond_law import BondLaw
from feti_homog.interface.loads.load import Load
from feti_homog.interface.path.path_points import (
    NO_ENERGIES,
    UTILISATION_TIE,
    Energies,
    PathState,
    Point,
    count_on_all_ranks,
    most_utilised,
)
from feti_homog.interface.path.sliding_leg import SlidingLeg
from feti_homog.system.parallel.mpi_errors import on_root

# Share of a load within which the largest one that is carried is found.
LEAST_STEP = 1e-9


def sliding_increments(
    cell: CoupledInterfaces,
    sliding: SlidingCell,
    law: BondLaw,
    waypoints: Sequence[Load],
    steps: int,
    worst_only: bool,
    begin: PathState,
) -> Iterator[Point]:
    """Yield the states after each of `steps` equal load steps, `begin.leg` of which are done; as `increments`.

    Where nothing carries the load of a step, the last point is at the largest load of it that is carried.  Collective.

    Raises:
        NotCarriedError: nothing carries more, or a step has no admissible statuses.
    """
    last, legs, way = -1, len(waypoints), None
    for step in range(begin.leg + 1, steps + 1):
        leg = (step * legs - 1) // steps
        if way is None or leg > last:
            before = begin.position or max((step - 1) * legs / steps - leg, 0.0)
            way = SlidingSteps(cell, sliding, law, waypoints, leg, replace(begin, leg=leg, position=before))
        point = way.step(step, steps, worst_only)
        last, begin = leg, point.after
        yield point
        if way.limit is not None:
            raise way.limit


class SlidingSteps(SlidingLeg):
    """Leg along which the load goes in steps.

    Attributes:
        limit: why the last step ended before its load, None if it did not.
    """

    limit: NotCarriedError | None = None

    def step(self, step: int, steps: int, worst_only: bool) -> Point:
        """Return the point after the step of this number, from 1, of the whole path.  Collective."""
        before, parted = self._bonds, 0
        self._go_to(self._carried(step * self.legs / steps - self.leg))
        while True:
            state = self._state()
            used, largest, worst = most_utilised(self.cell, self.law, state)
            if largest <= 1.0 + UTILISATION_TIE:
                break
            count, _, broken = self._broken(worst if worst_only else used > 1.0)
            parted += count
            self._after_break(broken)
        weaker = (state.bonds.history != before.history).any(axis=1) & (state.status == BONDED)
        energies, self._energies = self._energies, NO_ENERGIES
        softened, factor = count_on_all_ranks(self.cell, weaker), step / steps
        after = replace(self._path_state(), leg=step, position=0.0)
        if self.limit is not None:
            factor = (self.leg + self._share) / self.legs
            after = replace(after, leg=step - 1, position=self._share)
        return Point(factor, 1.0, state, parted, softened, energies, used, after)

    def _carried(self, share: float) -> float:
        """Return this share of the leg, or the largest before it whose load is carried.  Collective.

        Raises:
            NotCarriedError: none beyond the last step.
        """
        here, faces = self._here, self.sliding.faces

        def refused(share: float) -> NotCarriedError | None:
            try:
                faces.step(here.status, self._given(share, here.x), here.x)
            except NotCarriedError as error:
                return error
            return None

        def largest() -> tuple[float, NotCarriedError | None]:
            low, high, limit = self._share, share, refused(share)
            if limit is None or isinstance(limit, StuckError):
                return share, None
            while high - low > LEAST_STEP * share:
                middle = (low + high) / 2
                carries = faces.carries(here.status, self._given(middle, here.x), here.x)
                low, high = (middle, high) if carries else (low, middle)
            if low - self._share <= 10 * LEAST_STEP * share:
                raise limit
            return low, limit

        found, self.limit = on_root(self.cell.comm, largest)
        return found

    def _go_to(self, share: float) -> None:
        """Go to a share of the leg with the bonds as they are.  Collective."""
        here, faces, area = self._here, self.sliding.faces, self.sliding.area
        given, self._share = self._given(share, here.x), share
        status, x = self._on_root(faces.step, here.status, given, here.x)
        heat = faces.heat_behind(status, here.x, x) / area
        stored = self.sliding.stored(x) - self.sliding.stored(here.x)
        self._energies = self._energies.plus(Energies(stored + heat, 0.0, 0.0, heat))
        self._here, self._bonds = self._standing(status, x), self.sliding.bonds(self._bonds, status, x)
