"""A path with friction on debonded faces: from zero on linear pieces, between which statuses change or bonds break."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.contact.states import BondState, Equilibrium, Status
from feti_homog.interface.friction.coulomb_faces import StuckError
from feti_homog.interface.friction.face_system import Prescribed
from feti_homog.interface.friction.sliding_cell import SlidingCell
from feti_homog.interface.friction.status_system import OPEN_FACE
from feti_homog.interface.laws.bond_law import BondLaw
from feti_homog.interface.loads.load import Load, Macroscopic
from feti_homog.interface.path.next_change import first_break_between
from feti_homog.interface.path.path_points import (
    NO_ENERGIES,
    UTILISATION_TIE,
    Energies,
    PathState,
    Point,
    break_bonds,
    most_utilised,
)
from feti_homog.parallel.mpi_errors import on_root
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
        StuckError: nothing goes on from the last point.
    """
    for leg in range(begin.leg, len(waypoints)):
        for point in SlidingLeg(cell, sliding, law, waypoints, leg, begin).points():
            yield point
            begin = point.after


@dataclass(frozen=True)
class Standing:
    """Position of a path: the statuses (n,) of the faces and scaled x (m,) of `CoulombFaces`, with its averages."""

    status: Status
    x: Float
    mean: Macroscopic


class SlidingLeg:
    """Leg `leg`, the way between two loads of the same kinds, at rising share s of it.

    From a state the rates of the faces are those of a problem of complementarity, and hold up to the first of: a face
    reaches a limit of its status, a bond its strength, s = 1.  A break is a step at constant load, with the statuses
    that are admissible behind it: slips grow from where they were with the sign of the traction.
    """

    def __init__(
        self,
        cell: CoupledInterfaces,
        sliding: SlidingCell,
        law: BondLaw,
        waypoints: Sequence[Load],
        leg: int,
        begin: PathState,
    ) -> None:
        """Stand at `begin`.  Collective."""
        self.cell, self.sliding, self.law, self.end = cell, sliding, law, waypoints[leg]
        self.leg, self.legs = leg, len(waypoints)
        self.origin = begin.last if begin.position == 0.0 else begin.origin
        self.start = cell.leg_start(self.origin, waypoints[leg - 1] if leg else None, self.end)
        self._share, self._bonds = begin.position, begin.bonds
        status, x = sliding.begin(begin.bonds, begin.last.strain)
        self._here = self._standing(status, x)
        self._found: tuple[Standing, Equilibrium] | None = None
        self._reported, self._energies, self._first = begin.position, NO_ENERGIES, begin.position == 0.0
        self._after_break(begin)

    def points(self) -> Iterator[Point]:
        """Yield the points of the leg.  Collective."""
        yield from self._break_overloaded()
        changes = 0
        while self._share < 1.0:
            before = self._share
            status, rate = self._rates()
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

    def _on_root(self, find: Callable[..., tuple[Status, Float]], *arguments: Any) -> tuple[Status, Float]:
        """Return the statuses and the array that rank 0 finds, whose product every rank keeps.  Collective."""
        solver = self.sliding.faces.solver

        def found() -> tuple[Status, Float, Float]:
            status, x = find(*arguments)
            return status, x, solver.product(x)

        status, x, product = on_root(self.cell.comm, found)
        solver.keep(x, product)
        return status, x

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
        self._let_go(status, x)
        opened = self._opened_tied(here.status, status)
        if opened and self._most_used(bonds) > 1.0 + UTILISATION_TIE:
            yield from self._break()
            yield from self._break_overloaded()
            return
        self._go(status, x, there)
        at_end = breaks > 1.0 and change >= rest
        self._share = 1.0 if at_end else self._share + way
        if breaks <= 1.0:
            yield from self._break()
            yield from self._break_overloaded()
        elif not at_end and (opened or self._is_point()):
            self._first = False
            yield self._point(0, 0, self._path_state())

    def _given(self, share: float, x: Float) -> Prescribed:
        """Return what is prescribed at a share of the leg, with the slips of scaled x."""
        load = self.start.after(share, self.end)
        return Prescribed(load.by_stress, self.sliding.given(load), x[1 : 2 * len(self.sliding.rows) : 2])

    def _standing(self, status: Status, x: Float) -> Standing:
        return Standing(status, x, Macroscopic(self.sliding.strain(x), self.sliding.stress(x)))

    def _let_go(self, status: Status, x: Float) -> None:
        """Go to x with these statuses at the same load: faces that opened bear no shear along the fibres any more."""
        if len(self.sliding.faces.tied):
            lost, _ = self.sliding.faces.losses(status, self._here.x, x)
            self._add(self._standing(status, x), lost / self.sliding.area, 0.0)
            self._here = self._standing(status, x)

    def _is_point(self) -> bool:
        """Return whether a change of statuses here is a point."""
        return self._first or self._share - self._reported >= LEAST_SHARE

    def _opened_tied(self, before: Status, status: Status) -> bool:
        """Return whether tied faces opened, whose shear along the fibres went to bonds."""
        tied, opened = self.sliding.faces.tied, (status == OPEN_FACE) & (before != OPEN_FACE)
        return bool((tied & opened[: len(tied)]).any())

    def _most_used(self, bonds: BondState) -> float:
        """Stand with these bonds, and return the largest share of their strength that they use.  Collective."""
        self._bonds = bonds
        return most_utilised(self.cell, self.law, self._state())[1]

    def _go(self, status: Status, x: Float, there: Float) -> None:
        """Go straight from x to `there`, with these statuses."""
        after, area = self._standing(status, there), self.sliding.area
        heat = self.sliding.faces.heat(status, x, there) / area
        self._add(after, 0.0, heat)
        self._here, self._bonds = after, self.sliding.bonds(self._bonds, status, there)

    def _add(self, after: Standing, released: float, heat: float, fracture: float = 0.0) -> None:
        """Add the energies of the way to a state."""
        before = self._here.mean
        work = 0.5 * float((before.stress + after.mean.stress) @ (after.mean.strain - before.strain))
        self._energies = self._energies.plus(Energies(work, released, fracture, heat))

    def _break_overloaded(self) -> Iterator[Point]:
        """Break what a break has overloaded, at the same load.  Collective."""
        while most_utilised(self.cell, self.law, self._state())[1] > 1.0 + UTILISATION_TIE:
            yield from self._break()

    def _break(self) -> Iterator[Point]:
        """Break the worst bonds here, and find the state after it.  Collective."""
        state = self._state()
        worst = most_utilised(self.cell, self.law, state)[2]
        bonds, broke, softened, fracture = break_bonds(self.cell, self.law, worst, state)
        stretched = self.sliding.stretched(self._here.x)
        broken = replace(self._path_state(), bonds=bonds, broken=fracture, stretched=stretched)
        yield self._point(broke, softened, broken)
        self._after_break(broken)

    def _after_break(self, begin: PathState) -> None:
        """Go to the state after a break at constant load, if there was one.  Collective.

        The faces lose half the product of their forces, before and after it, and their jumps; of that the slips make
        heat by the forces after it, and the break has lost the rest.
        """
        if begin.broken is None:
            return
        status, x = self.sliding.begin(begin.bonds, begin.last.strain)
        self._here, faces = Standing(status, x, begin.last), self.sliding.faces
        given = self._given(self._share, x)
        status, there = self._on_root(faces.search, status, faces.all_allowed(), given, x)
        lost, heat = (own / self.sliding.area for own in faces.losses(status, x, there))
        after = self._standing(status, there)
        # Springs of the bonds that soften do not keep what they were stretched by before.
        lost += begin.stretched - self.sliding.stretched(x) + self.sliding.released_along(begin.last, after.mean)
        self._add(after, lost - heat, heat, begin.broken)
        self._here, self._bonds, self._first = after, self.sliding.bonds(begin.bonds, status, there), True

    def _state(self) -> Equilibrium:
        """Return the state here, which is found once.  Collective."""
        if self._found is None or self._found[0] is not self._here:
            load = self.start.after(self._share, self.end)
            self._found = self._here, self.sliding.equilibrium(load, self._bonds, self._here.x)
        return self._found[1]

    def _path_state(self) -> PathState:
        """Return the beginning of the way from here on."""
        lam = self.sliding.multipliers(self._here.x)
        return PathState(self.leg, self._share, self._bonds, lam, self.origin, self._here.mean)

    def _point(self, broke: int, softened: int, after: PathState) -> Point:
        """Return the point here, at which so many bonds part and so many soften.  Collective."""
        state = self._state()
        used = most_utilised(self.cell, self.law, state)[0]
        energies, self._energies, self._reported = self._energies, NO_ENERGIES, self._share
        return Point((self.leg + self._share) / self.legs, 1.0, state, broke, softened, energies, used, after)
