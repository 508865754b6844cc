"""A leg of a path: the loads from one waypoint to the next, by events or in equal steps.

Two engines follow the load: `FrictionlessLeg` solves for equilibria, `CoulombLeg` for rates of faces with friction.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import replace

from feti_homog.errors import NotCarriedError
from feti_homog.interface.contact import BONDED, CoupledInterfaces, Equilibrium
from feti_homog.interface.laws.bond_law import UTILISATION_TIE, BondLaw
from feti_homog.interface.loads import Load, Macroscopic
from feti_homog.interface.path import path_points
from feti_homog.typing import Bool, Float

# Difference up to which fractions of a leg count as equal.
SAME_SHARE = 1e-9


class Leg(ABC):
    """Leg number `leg` of a path, at a fraction s that rises from 0 to 1.

    The loads `start` at s = 0 and `end` at s = 1 prescribe stresses in the same components.  Bonds break at constant
    load: the state before a break is a point, and the path continues from the state after the break at the same s.
    Methods that solve raise NotCarriedError if the cell does not carry the stresses of the load.

    Attributes:
        limit: error that stopped the last step short of its load, or None.
    """

    limit: NotCarriedError | None = None
    _mean: Macroscopic

    def __init__(
        self, cell: CoupledInterfaces, law: BondLaw, waypoints: Sequence[Load], leg: int, begin: path_points.PathState
    ) -> None:
        """Begin at the position in `begin`, on the way to waypoint `leg`.  Collective."""
        self.cell, self.law, self.leg, self.waypoints = cell, law, leg, waypoints
        self.end = waypoints[leg]
        self.origin = begin.last if begin.position == 0.0 else begin.origin
        self.start = cell.leg_start(self.origin, waypoints[leg - 1] if leg else None, self.end)
        self._share = self._reported = begin.position
        self._from, self._bonds, self._energies = begin, begin.bonds, path_points.NO_ENERGIES
        self._utilisation: tuple[Equilibrium, tuple[Float, float, Bool]] | None = None

    @property
    @abstractmethod
    def state(self) -> Equilibrium:
        """The equilibrium at s.  Collective."""

    @abstractmethod
    def _settle(self, begin: path_points.PathState) -> None:
        """Find the state at leg fraction s with the bonds of `begin`, which a break may have changed.  Collective."""

    @abstractmethod
    def _advance(self) -> Iterator[path_points.Point]:
        """Advance to the next event, or part of the way, and yield points.  Collective."""

    @abstractmethod
    def _go_to(self, share: float) -> None:
        """Advance to fraction `share` of the leg in one step, with fixed bonds.  Collective."""

    def points(self) -> Iterator[path_points.Point]:
        """Yield the points of the leg, its end as the last point.  Collective."""
        yield from self._break_overloaded()
        while not self._is_over():
            yield from self._advance()
        yield self._point(0, 0, replace(self._path_state(), leg=self.leg + 1, position=0.0))

    def step(self, number: int, steps: int, worst_only: bool) -> path_points.Point:
        """Advance to the end of step `number` (from 1), break overloaded bonds, and return the point.  Collective.

        With `worst_only`, only the worst bonds break between two solves.  If the cell carries only a part of the step,
        the point is at this part, and `limit` is set.
        """
        before, parted = self._bonds.history, 0
        self._go_to(number * len(self.waypoints) / steps - self.leg)
        first = self._used()[0]
        while self._is_overloaded():
            used, _, worst = self._used()
            count, _, broken = self._release(worst if worst_only else used > 1.0 + UTILISATION_TIE)
            parted += count
            self._settle(broken)
        bonds, after = self.state.bonds, self._path_state()
        hold_less = (bonds.history != before).any(axis=1) & (bonds.status == BONDED)
        weaker = path_points.count_on_all_ranks(self.cell, hold_less)
        if self.limit is not None:
            return replace(self._point(parted, weaker, replace(after, leg=number - 1)), used=first)
        point = self._point(parted, weaker, replace(after, leg=number, position=0.0))
        return replace(point, load_factor=number / steps, used=first)

    def _load_at(self, share: float) -> Load:
        """Return the load at a leg fraction."""
        return self.start.after(share, self.end)

    def _is_over(self) -> bool:
        """Return whether the leg is at its end."""
        return self._share >= 1.0

    def _used(self) -> tuple[Float, float, Bool]:
        """Return `path_points.most_utilised` for the state, computed once.  Collective."""
        if self._utilisation is None or self._utilisation[0] is not self.state:
            self._utilisation = self.state, path_points.most_utilised(self.cell, self.law, self.state)
        return self._utilisation[1]

    def _is_overloaded(self) -> bool:
        """Return whether the state has converged and has bonds beyond their strength.  Collective."""
        return self._used()[1] > 1.0 + UTILISATION_TIE and self.state.converged

    def _break_overloaded(self, is_due: bool = False) -> Iterator[path_points.Point]:
        """Yield a point and break the worst bonds, until none is overloaded; at least once if `is_due`.  Collective."""
        while is_due or self._is_overloaded():
            broke, softened, broken = self._release(self._used()[2])
            yield self._point(broke, softened, broken)
            self._settle(broken)
            is_due = False

    def _release(self, which: Bool) -> tuple[int, int, path_points.PathState]:
        """Break the bonds in the mask `which` (k,), and return the result of `break_bonds`.  Collective."""
        return path_points.break_bonds(self.cell, self.law, which, self.state, self._path_state())

    def _point(self, broke: int, softened: int, after: path_points.PathState) -> path_points.Point:
        """Return the point at s, with the numbers of bonds that part and soften; reset the energy sum.  Collective."""
        energies, self._energies = self._energies, path_points.NO_ENERGIES
        self._reported = self._share
        load_factor = (self.leg + self._share) / len(self.waypoints)
        return path_points.Point(load_factor, 1.0, self.state, broke, softened, energies, self._used()[0], after)

    def _path_state(self) -> path_points.PathState:
        """Return the path state at s.  Collective."""
        state = self.state
        return path_points.PathState(self.leg, self._share, state.bonds, state.multipliers, self.origin, self._mean)
