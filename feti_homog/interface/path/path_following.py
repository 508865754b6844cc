"""Load-induced debonding, Section III.F: the load follows a path, and overloaded bonds break.

`events` finds every break exactly.  On the first leg from zero, without initial gaps, the response is homogeneous of
degree one: one solve gives the load of the next break, which may be lower than the previous load (snap-back).  Later
legs control the load, see `leg`.  `increments` is the paper's loop.

Energy.  A break happens at constant load: stresses or strains jump, and work minus the change of stored energy is
released.  Between breaks, only friction loses energy.  The `energies` of a point count from the previous point.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from feti_homog.interface.contact import CoupledInterfaces
from feti_homog.interface.laws.bond_law import BondLaw
from feti_homog.interface.loads import Load
from feti_homog.interface.path.frictionless_leg import FrictionlessLeg
from feti_homog.interface.path.leg import Leg
from feti_homog.interface.path.path_points import Energies, PathState, Point, break_bonds, most_utilised

Engine = Callable[[CoupledInterfaces, BondLaw, Sequence[Load], int, PathState], Leg]
"""Function that makes a leg from the cell, the law, the waypoints, the leg number and the initial path state."""


def events(
    cell: CoupledInterfaces, law: BondLaw, waypoints: Sequence[Load], begin: PathState, engine: Engine = FrictionlessLeg
) -> Iterator[Point]:
    """Yield every break along zero -> waypoints[0] -> ..., and the end of each leg.  Collective.

    A leg begins with the strains or stresses of the previous state, as the leg's waypoint prescribes.  The state of a
    point precedes its break.  On later legs, and with friction on all legs, contact changes are points, too (`broke` =
    0); the response is straight up to a point, from the state after the last break.  A point without convergence is the
    last one.  Raises NotCarriedError if the cell carries no more load; the last point is at the largest load.
    """
    for leg in range(begin.leg, len(waypoints)):
        if leg == 0 and engine is FrictionlessLeg:
            points = _first_leg(cell, law, waypoints[0], len(waypoints), begin)
        else:
            points = engine(cell, law, waypoints, leg, begin).points()
        for point in points:
            yield point
            if not point.state.converged:
                return  # the next break cannot follow from a wrong state
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
    """Yield the points of the paper's loop, which breaks all overloaded bonds at equal load steps.  Collective.

    The state of a point follows its breaks.  `begin.leg` is the number of finished steps.  With `worst_only`, only the
    worst bonds break between two solves.  A point without convergence is the last one; with friction, the last point
    may be at the largest load that the cell carries.  Raises NotCarriedError if the cell carries no more load, or a
    step has no admissible statuses.
    """
    legs, current = len(waypoints), None
    for step in range(begin.leg + 1, steps + 1):
        leg = (step * legs - 1) // steps
        if current is None or leg > current.leg:
            position = begin.position or max((step - 1) * legs / steps - leg, 0.0)
            current = engine(cell, law, waypoints, leg, replace(begin, leg=leg, position=position))
        point = current.step(step, steps, worst_only)
        begin = point.after
        yield point
        if current.limit is not None:
            raise current.limit
        if not point.state.converged:
            return


def _first_leg(cell: CoupledInterfaces, law: BondLaw, load: Load, legs: int, begin: PathState) -> Iterator[Point]:
    """Yield the points of the first leg, also where the load falls.  Collective; raises like `events`.

    With fixed bonds, the state under t times the load is t times the state, for t >= 0.
    """
    factor = begin.position
    while True:
        state = cell.equilibrium(load, begin.bonds, begin.lam)
        full, lam = cell.macroscopic(state.solutions), state.multipliers
        before = full.scaled(factor)
        energies = begin.energies_to(before)
        used, largest, worst = most_utilised(cell, law, state)
        factor = 1.0 / max(largest, 1.0)
        reached = full.scaled(factor)
        energies = energies.plus(Energies(reached.stored - before.stored, 0.0, 0.0))
        if largest <= 1.0:
            after = PathState(1, 0.0, state.bonds, lam, reached, reached)
            yield Point(1.0 / legs, 1.0, state, 0, 0, energies, used, after)
            return
        path_state = PathState(0, factor, state.bonds, lam, begin.origin, reached)
        broke, softened, begin = break_bonds(cell, law, worst, state, path_state)
        yield Point(factor / legs, factor, state, broke, softened, energies, used / largest, begin)
