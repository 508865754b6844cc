"""A path with friction on debonded faces: where it stands on a leg, its energies, and breaks at constant load."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.contact.states import Equilibrium, Status
from feti_homog.interface.friction.face_system import Prescribed
from feti_homog.interface.friction.sliding_cell import SlidingCell
from feti_homog.interface.laws.bond_law import BondLaw
from feti_homog.interface.loads.load import Load, Macroscopic
from feti_homog.interface.path.path_points import NO_ENERGIES, Energies, PathState, break_bonds
from feti_homog.system.parallel.mpi_errors import on_root
from feti_homog.typing import Bool, Float


@dataclass(frozen=True)
class Standing:
    """Position of a path: the statuses (n,) of the faces and scaled x (m,) of `CoulombFaces`, with its averages."""

    status: Status
    x: Float
    mean: Macroscopic


class SlidingLeg:
    """Leg `leg`, the way between two loads of the same kinds, at a share s of it.

    A break is a step at constant load, with the statuses that are admissible behind it: slips grow from where they
    were with the sign of the traction.
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
        """Stand at `begin`, where the next change of statuses is the `_first` if it is a waypoint.  Collective."""
        self.cell, self.sliding, self.law, self.end = cell, sliding, law, waypoints[leg]
        self.leg, self.legs, self._before = leg, len(waypoints), waypoints[:leg]
        self.origin = begin.last if begin.position == 0.0 else begin.origin
        self.start = cell.leg_start(self.origin, waypoints[leg - 1] if leg else None, self.end)
        self._share, self._bonds, self._energies = begin.position, begin.bonds, NO_ENERGIES
        self._reported, self._first = begin.position, begin.position == 0.0
        status, x = sliding.begin(begin.bonds, begin.last.strain)
        self._here = self._standing(status, x)
        self._found: tuple[Standing, Equilibrium] | None = None
        self._after_break(begin)

    def _on_root(self, find: Callable[..., tuple[Status, Float]], *arguments: Any) -> tuple[Status, Float]:
        """Return the statuses and the array that rank 0 finds, whose product every rank keeps.  Collective."""
        solver = self.sliding.faces.solver

        def found() -> tuple[Status, Float, Float]:
            status, x = find(*arguments)
            return status, x, solver.product(x)

        status, x, product = on_root(self.cell.comm, found)
        solver.keep(x, product)
        return status, x

    def _given(self, share: float, x: Float) -> Prescribed:
        """Return what is prescribed at a share of the leg, with the slips of scaled x."""
        load = self.start.after(share, self.end)
        return Prescribed(load.by_stress, self.sliding.given(load), x[1 : 2 * len(self.sliding.rows) : 2])

    def _standing(self, status: Status, x: Float) -> Standing:
        return Standing(status, x, Macroscopic(self.sliding.strain(x), self.sliding.stress(x)))

    def _add(self, after: Standing, released: float, heat: float, fracture: float = 0.0) -> None:
        """Add the energies of the straight way to a state."""
        before = self._here.mean
        work = 0.5 * float((before.stress + after.mean.stress) @ (after.mean.strain - before.strain))
        self._energies = self._energies.plus(Energies(work, released, fracture, heat))

    def _broken(self, which: Bool) -> tuple[int, int, PathState]:
        """Return how many of the bonds `which` (k,) part and how many soften here, and the state then.  Collective."""
        bonds, parted, softened, fracture = break_bonds(self.cell, self.law, which, self._state())
        stretched = self.sliding.stretched(self._here.x)
        return parted, softened, replace(self._path_state(), bonds=bonds, broken=fracture, stretched=stretched)

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
            loads = [*self._before, self.start.after(self._share, self.end)]
            self._found = self._here, self.sliding.equilibrium(loads, self._bonds, self._here.x)
        return self._found[1]

    def _path_state(self) -> PathState:
        """Return the beginning of the way from here on."""
        lam = self.sliding.multipliers(self._here.x)
        return PathState(self.leg, self._share, self._bonds, lam, self.origin, self._here.mean)
