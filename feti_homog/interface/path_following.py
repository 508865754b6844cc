"""Load-induced debonding, Section III.F: the macroscopic strain follows a path, bonds over their strength break.

`events` finds every break exactly.  The first leg of the path starts at zero, where for zero initial gaps the
response is homogeneous of degree one: one solve gives the load at which the next bond breaks, be it lower than
the last (snap-back).  On later legs it is the strain that is controlled, see `later_leg`.  `increments` is the paper's
loop.

Energy.  A break happens at constant strain E and loses 1/2 E.(Sigma before - Sigma after) per area of the cell; between
breaks nothing is lost.  A point's `released` is what breaks lost on the way from the last point's state to its own.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from feti_homog.interface.bond_criterion import BondCriterion
from feti_homog.interface.contact import Interface
from feti_homog.interface.later_leg import LaterLeg, strain_between
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


def events(interface: Interface, criterion: BondCriterion, waypoints: Float, begin: PathState) -> Iterator[Point]:
    """Every break along zero -> waypoints[0] -> ... (n, 3), and the end of each leg.  Collective.

    A point's state is the one before its bonds break.  On later legs the changes of contact are points too, with
    `broke` = 0: between points the response is straight.  The last point is one that did not converge, if there is one.
    """
    for point in _legs(interface, criterion, waypoints, begin):
        yield point
        if point.state.solution.reason < 0:
            # What breaks next cannot be decided on a state that does not hold.
            return


def increments(
    interface: Interface,
    criterion: BondCriterion,
    waypoints: Float,
    steps: int,
    worst_only: bool,
    begin: PathState,
) -> Iterator[Point]:
    """The paper's loop: at each of `steps` equal load steps, release overloaded bonds until none is left.

    A point's state is the one after its bonds broke.  `begin.leg` is the number of steps done.  With `worst_only`
    just the most overloaded bonds are released at a time.  The last point is one that did not converge, if there is
    one.
    """
    corners = np.vstack([np.zeros(3), waypoints])
    status, lam = begin.status, begin.lam
    for step in range(begin.leg + 1, steps + 1):
        leg = (step * len(waypoints) - 1) // steps
        strain = strain_between(corners[leg], corners[leg + 1], step * len(waypoints) / steps - leg)
        broke, broken = 0, None
        while True:
            state = interface.equilibrium(strain, status, lam)
            status, lam = state.status, state.solution.lam
            used, load, which = most_utilised(interface, criterion, state)
            if load <= 1.0 + UTILISATION_TIE or state.solution.reason < 0:
                break
            if not worst_only:
                which = used > 1.0
            fracture = fracture_energy(interface, criterion, which, interface.traction(state.solution))
            if broken is None:
                broken = Break(interface.stress(state.solution), fracture)
            else:
                broken = replace(broken, fracture_energy=broken.fracture_energy + fracture)
            broke += count_on_all_ranks(interface, which)
            status = interface.debond(status, which, lam)
        energies = energies_of(broken, strain, interface.stress(state.solution))
        yield Point(step / steps, 1.0, state, broke, *energies, used, PathState(step, 0.0, status, lam))
        if state.solution.reason < 0:
            return


def _legs(interface: Interface, criterion: BondCriterion, waypoints: Float, begin: PathState) -> Iterator[Point]:
    legs = len(waypoints)
    if begin.leg == 0:
        for point in _first_leg(interface, criterion, waypoints[0], legs, begin):
            yield point
            begin = point.after
    for leg in range(max(begin.leg, 1), legs):
        strains = (waypoints[leg - 1], waypoints[leg])
        for point in LaterLeg(interface, criterion, strains, (leg, legs), begin).points():
            yield point
            begin = point.after


def _first_leg(
    interface: Interface, criterion: BondCriterion, strain: Float, legs: int, begin: PathState
) -> Iterator[Point]:
    """From zero to `strain` through all equilibria; with the bonds of now, Sigma(t E) = t Sigma(E) for t >= 0."""
    status, lam, factor, broken = begin.status, begin.lam, begin.position, begin.broken
    while True:
        state = interface.equilibrium(strain, status, lam)
        lam, stress = state.solution.lam, interface.stress(state.solution)
        energies = energies_of(broken, factor * strain, factor * stress)
        used, load, worst = most_utilised(interface, criterion, state)
        if load <= 1.0:
            yield Point(1.0 / legs, 1.0, state, 0, *energies, used, PathState(1, 0.0, state.status, lam))
            return
        factor, traction = 1.0 / load, interface.traction(state.solution)
        broken = Break(stress / load, fracture_energy(interface, criterion, worst, traction))
        broke, status = count_on_all_ranks(interface, worst), interface.debond(state.status, worst, lam)
        after = PathState(0, factor, status, lam, broken)
        yield Point(factor / legs, factor, state, broke, *energies, used / load, after)
