"""Load-induced debonding, Section III.F: the load follows a path, bonds over their strength break.

`events` finds every break exactly.  The first leg of the path starts at zero, where for zero initial gaps the
response is homogeneous of degree one: one solve gives the load at which the next bond breaks, be it lower than
the last (snap-back).  On later legs it is the load that is controlled, see `leg`.  `increments` is the paper's
loop.

Energy.  A break happens at constant load, at which stresses or strains jump, and loses work less stored energy; between
breaks nothing is lost.  A point's `energies` are those of the way from the last point's state to its own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.laws.bond_law import BondLaw
from feti_homog.interface.loads import Load
from feti_homog.interface.path.frictionless_leg import FrictionlessLeg
from feti_homog.interface.path.leg import Leg
from feti_homog.interface.path.path_points import Energies, PathState, Point, break_bonds, most_utilised

Engine = Callable[[CoupledInterfaces, BondLaw, Sequence[Load], int, PathState], Leg]
"""From cell, law, waypoints, number and begin of a leg to the leg."""


def events(
    cell: CoupledInterfaces, law: BondLaw, waypoints: Sequence[Load], begin: PathState, engine: Engine = FrictionlessLeg
) -> Iterator[Point]:
    """Every break along zero -> waypoints[0] -> ..., and the end of each leg.  Collective.

    A leg begins with what the state has of the components that its waypoint gives, strain or stress.  A point's state
    is the one before its bonds break.  On later legs, and with friction on all, the changes of contact are points too,
    with `broke` = 0: between points the response is straight.  The last point is one that did not converge, if there is
    one.

    Raises:
        NotCarriedError: nothing goes on from the last point, the limit of the load.
    """
    for leg in range(begin.leg, len(waypoints)):
        if leg == 0 and engine is FrictionlessLeg:
            points = _first_leg(cell, law, waypoints[0], len(waypoints), begin)
        else:
            points = engine(cell, law, waypoints, leg, begin).points()
        for point in points:
            yield point
            if not point.state.converged:
                # What breaks next cannot be decided on a state that does not hold.
                return
            begin = point.after


def increments(
    cell: CoupledInterfaces,
    law: BondLaw,
    waypoints: Sequence[Load],
    steps: int,
    worst_only: bool,
    begin: PathState,
    engine: Engine = FrictionlessLeg,
) -> Iterator[Point]:
    """Yield the paper's loop: at each of `steps` equal load steps, release overloaded bonds until none is left.

    A point's state is the one after its bonds broke.  `begin.leg` is the number of steps done.  With `worst_only`
    just the most overloaded bonds are released at a time.  The last point is one that did not converge, if there is
    one; where nothing carries the load of a step with friction, it is at the largest load that is carried.  Collective.

    Raises:
        NotCarriedError: nothing carries more, or a step has no admissible statuses.
    """
    legs, way = len(waypoints), None
    for step in range(begin.leg + 1, steps + 1):
        leg = (step * legs - 1) // steps
        if way is None or leg > way.leg:
            position = begin.position or max((step - 1) * legs / steps - leg, 0.0)
            way = engine(cell, law, waypoints, leg, replace(begin, leg=leg, position=position))
        point = way.step(step, steps, worst_only)
        begin = point.after
        yield point
        if way.limit is not None:
            raise way.limit
        if not point.state.converged:
            return


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
        place = PathState(0, factor, state.bonds, lam, begin.origin, reached)
        broke, softened, begin = break_bonds(cell, law, worst, state, place)
        yield Point(factor / legs, factor, state, broke, softened, energies, used / largest, begin)
