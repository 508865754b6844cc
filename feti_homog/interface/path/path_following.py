"""Load-induced debonding, Section III.F: the load follows a path, bonds over their strength break.

`events` finds every break exactly.  The first leg of the path starts at zero, where for zero initial gaps the
response is homogeneous of degree one: one solve gives the load at which the next bond breaks, be it lower than
the last (snap-back).  On later legs it is the load that is controlled, see `later_leg`.  `increments` is the paper's
loop.

Energy.  A break happens at constant load, at which stresses or strains jump, and loses work less stored energy; between
breaks nothing is lost.  A point's `energies` are those of the way from the last point's state to its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.contact.states import BONDED
from feti_homog.interface.laws.bond_law import BondLaw
from feti_homog.interface.loads.load import Load
from feti_homog.interface.path.later_leg import LaterLeg
from feti_homog.interface.path.path_points import (
    NO_ENERGIES,
    UTILISATION_TIE,
    Energies,
    PathState,
    Point,
    break_bonds,
    count_on_all_ranks,
    most_utilised,
)


def events(cell: CoupledInterfaces, law: BondLaw, waypoints: Sequence[Load], begin: PathState) -> Iterator[Point]:
    """Every break along zero -> waypoints[0] -> ..., and the end of each leg.  Collective.

    A leg begins with what the state has of the components that its waypoint gives, strain or stress.  A point's state
    is the one before its bonds break.  On later legs the changes of contact are points too, with `broke` = 0: between
    points the response is straight.  The last point is one that did not converge, if there is one.
    """
    for point in _legs(cell, law, waypoints, begin):
        yield point
        if not point.state.converged:
            # What breaks next cannot be decided on a state that does not hold.
            return


def increments(
    cell: CoupledInterfaces,
    law: BondLaw,
    waypoints: Sequence[Load],
    steps: int,
    worst_only: bool,
    begin: PathState,
) -> Iterator[Point]:
    """Yield the paper's loop: at each of `steps` equal load steps, release overloaded bonds until none is left.

    A point's state is the one after its bonds broke.  `begin.leg` is the number of steps done.  With `worst_only`
    just the most overloaded bonds are released at a time.  The last point is one that did not converge, if there is
    one.
    """
    for step in range(begin.leg + 1, steps + 1):
        leg = (step * len(waypoints) - 1) // steps
        begins_here = ((step - 1) * len(waypoints) - 1) // steps < leg
        origin, end = begin.last if begins_here else begin.origin, waypoints[leg]
        start = cell.leg_start(origin, waypoints[leg - 1] if leg else None, end)
        load = start.after(step * len(waypoints) / steps - leg, end)
        point = _increment(cell, law, load, worst_only, begin)
        after = PathState(step, 0.0, point.state.bonds, point.state.multipliers, origin, point.after.last)
        begin = after
        yield replace(point, load_factor=step / steps, after=after)
        if not point.state.converged:
            return


def _increment(cell: CoupledInterfaces, law: BondLaw, load: Load, worst_only: bool, begin: PathState) -> Point:
    """Return the state under a load after all overloaded bonds have broken."""
    bonds, lam, here, broke = begin.bonds, begin.lam, begin, 0
    energies = NO_ENERGIES
    while True:
        state = cell.equilibrium(load, bonds, lam)
        lam, reached = state.multipliers, cell.macroscopic(state.solutions)
        energies = energies.plus(here.energies_to(reached))
        used, largest, which = most_utilised(cell, law, state)
        here = PathState(begin.leg, 0.0, state.bonds, lam, begin.origin, reached)
        if largest <= 1.0 + UTILISATION_TIE or not state.converged:
            weaker = (bonds.history != begin.bonds.history).any(axis=1) & (state.status == BONDED)
            softened = count_on_all_ranks(cell, weaker)
            return Point(0.0, 1.0, state, broke, softened, energies, used, here)
        if not worst_only:
            which = used > 1.0
        bonds, parted, _, fracture = break_bonds(cell, law, which, state)
        broke += parted
        here = PathState(begin.leg, 0.0, bonds, lam, begin.origin, reached, fracture)


def _legs(cell: CoupledInterfaces, law: BondLaw, waypoints: Sequence[Load], begin: PathState) -> Iterator[Point]:
    legs = len(waypoints)
    if begin.leg == 0:
        for point in _first_leg(cell, law, waypoints[0], legs, begin):
            yield point
            begin = point.after
    for leg in range(max(begin.leg, 1), legs):
        for point in LaterLeg(cell, law, waypoints, leg, begin).points():
            yield point
            begin = point.after


def _first_leg(cell: CoupledInterfaces, law: BondLaw, load: Load, legs: int, begin: PathState) -> Iterator[Point]:
    """From zero to the load through all equilibria.

    With the bonds of now, a state under t times the load is t times the state, for t >= 0.
    """
    factor = begin.position
    while True:
        state = cell.equilibrium(load, begin.bonds, begin.lam)
        whole, lam = cell.macroscopic(state.solutions), state.multipliers
        here = whole.scaled(factor)
        energies = begin.energies_to(here)
        used, largest, worst = most_utilised(cell, law, state)
        factor = 1.0 / max(largest, 1.0)
        reached = whole.scaled(factor)
        energies = energies.plus(Energies(reached.stored - here.stored, 0.0, 0.0))
        if largest <= 1.0:
            after = PathState(1, 0.0, state.bonds, lam, reached, reached)
            yield Point(1.0 / legs, 1.0, state, 0, 0, energies, used, after)
            return
        bonds, broke, softened, fracture = break_bonds(cell, law, worst, state)
        begin = PathState(0, factor, bonds, lam, begin.origin, reached, fracture)
        yield Point(factor / legs, factor, state, broke, softened, energies, used / largest, begin)
