"""Load-induced debonding, Section III.F: the macroscopic strain follows a path, bonds over their strength break.

`events` finds every break exactly.  The first leg of the path starts at zero, where for zero initial gaps the
response is homogeneous of degree one: one solve gives the load at which the next bond breaks, be it lower than
the last (snap-back).  On later legs the response is piecewise linear and is followed from one change of contact
to the next; bonds that a break overloads there break at the same load.  `increments` is the paper's loop.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from feti_homog.feti.dual_solution import DualSolution
from feti_homog.interface.contact import BONDED, CLOSED, NOISE, OPEN, Equilibrium, Interface, Status
from feti_homog.interface.strength_criterion import StrengthCriterion
from feti_homog.typing import Bool, Float

# Bonds whose utilisation differs by no more than this break together, as those of a symmetric cell must.
TIE = 1e-6
# Least steps along a later leg, past a change of contact; with loose fibres, whose gaps are not unique, larger.
STEP, LOOSE_STEP = 1e-6, 0.02
# Shares of a leg that are not told apart, and strains that are zero, relative to those at its ends.
RESOLUTION, ROUNDING = 1e-9, 1e-13
BISECTIONS = 60


@dataclass(frozen=True)
class PathState:
    """Where a path stands, enough to go on from: `position` 0..1 on `leg` (or the number of the increment)."""

    leg: int
    position: float
    status: Status
    lam: Float


@dataclass(frozen=True)
class Point:
    """A point of the path.

    Attributes:
        load_factor: position on the whole path, 0 to 1, every leg taking the same share.
        scale: the state is `scale` times the equilibrium under `state.solution.strain`.
        state: that equilibrium.
        broke: number of bonds that break here (after the state).
        after: from where the path goes on.
    """

    load_factor: float
    scale: float
    state: Equilibrium
    broke: int
    after: PathState


def unloaded(interface: Interface, status: Status) -> PathState:
    """The beginning of a path with the debonded nodes of `status`."""
    return PathState(0, 0.0, status, np.zeros(interface.solver.rows))


def events(interface: Interface, law: StrengthCriterion, waypoints: Float, begin: PathState) -> Iterator[Point]:
    """Every break along zero -> waypoints[0] -> ... (n, 3), and the end of each leg.  Collective.

    On later legs also the changes of contact, with `broke` = 0: between points the response is straight.
    """
    legs = len(waypoints)
    if begin.leg == 0 and begin.position < 1.0:
        for point in _first_leg(interface, law, waypoints[0], legs, begin):
            yield point
            begin = point.after
    for leg in range(max(begin.leg, 1), legs):
        for point in _later_leg(interface, law, (waypoints[leg - 1], waypoints[leg]), leg, legs, begin):
            yield point
            begin = point.after


def increments(
    interface: Interface, law: StrengthCriterion, waypoints: Float, steps: int, worst_only: bool, begin: PathState
) -> Iterator[Point]:
    """The paper's loop: at each of `steps` equal load steps, release overloaded bonds until none is left.

    `begin.leg` is the number of steps done.  With `worst_only` just the most overloaded bonds are released at a time.
    """
    corners = np.vstack([np.zeros(3), waypoints])
    status, lam = begin.status, begin.lam
    for step in range(begin.leg + 1, steps + 1):
        leg = (step * len(waypoints) - 1) // steps
        strain = _between(corners[leg], corners[leg + 1], step * len(waypoints) / steps - leg)
        broke = 0
        while True:
            state = interface.equilibrium(strain, status, lam)
            status, lam = state.status, state.solution.lam
            load, worst = _worst(interface, law, state)
            if load <= 1.0 + TIE:
                break
            which = worst if worst_only else _utilisation(interface, law, state.status, state.solution) > 1.0
            broke += interface.solver.comm.allreduce(int(which.sum()))
            status = interface.debond(status, which, lam)
        yield Point(step / steps, 1.0, state, broke, PathState(step, 0.0, status, lam))


def _first_leg(
    interface: Interface, law: StrengthCriterion, strain: Float, legs: int, begin: PathState
) -> Iterator[Point]:
    status, lam = begin.status, begin.lam
    while True:
        state = interface.equilibrium(strain, status, lam)
        lam = state.solution.lam
        load, worst = _worst(interface, law, state)
        if load <= 1.0:
            yield Point(1.0 / legs, 1.0, state, 0, PathState(1, 0.0, state.status, lam))
            return
        broke = interface.solver.comm.allreduce(int(worst.sum()))
        status = interface.debond(state.status, worst, lam)
        yield Point(1.0 / load / legs, 1.0 / load, state, broke, PathState(0, 0.0, status, lam))


def _later_leg(
    interface: Interface, law: StrengthCriterion, ends: tuple[Float, Float], leg: int, legs: int, begin: PathState
) -> Iterator[Point]:
    status, lam, s = begin.status, begin.lam, begin.position
    safe, due, told = s, False, s
    while True:
        state = interface.equilibrium(_between(*ends, s), status, lam)
        load, worst = _worst(interface, law, state)
        if load > 1.0 + TIE and s - safe > RESOLUTION:
            # A change of contact on the way has brought the break forward.
            s, due = (safe + s) / 2, False
            continue
        changed = interface.solver.comm.allreduce(bool((state.status != status).any()), MPI.LOR)
        status, lam = state.status, state.solution.lam
        if load > 1.0 + TIE or (due and load > 1.0 - TIE):
            broke = interface.solver.comm.allreduce(int(worst.sum()))
            status = interface.debond(status, worst, lam)
            yield Point((leg + s) / legs, 1.0, state, broke, PathState(leg, s, status, lam))
            safe, due, told = s, False, s
            continue
        if s == 1.0:
            yield Point((leg + 1) / legs, 1.0, state, 0, PathState(leg + 1, 0.0, status, lam))
            return
        if changed and s > told:
            told = s
            yield Point((leg + s) / legs, 1.0, state, 0, PathState(leg, s, status, lam))
        ahead = interface.linear(ends[1], status, lam)
        breaks, changes = _first_break(interface, law, state, ahead), _first_change(interface, state, ahead)
        least = 0.0 if breaks <= changes and not due else LOOSE_STEP if state.loose else STEP
        safe, due = s, breaks <= changes and breaks < 1.0 and not due
        s = min(1.0, s + max(min(breaks, changes) * (1.0 - s), least))
        way = (s - safe) / (1.0 - safe)
        lam = (1.0 - way) * lam + way * ahead.lam


def _between(before: Float, after: Float, share: float) -> Float:
    """The strain after a share of a leg; what is left of zero by rounding is zero."""
    strain = (1.0 - share) * before + share * after
    return np.where(np.abs(strain).max() > ROUNDING * np.abs([before, after]).max(), strain, 0.0)


def _utilisation(interface: Interface, law: StrengthCriterion, status: Status, solution: DualSolution) -> Float:
    """(k,) share of strength that bonded nodes use, 0 on debonded ones."""
    return law.utilisation(interface.traction(solution)) * (status == BONDED)


def _worst(interface: Interface, law: StrengthCriterion, state: Equilibrium) -> tuple[float, Bool]:
    """The largest utilisation of all bonds, and which of this rank's have it; rank 0 decides."""
    comm = interface.solver.comm
    used = _utilisation(interface, law, state.status, state.solution)
    load = comm.bcast(comm.reduce(used.max(initial=0.0), MPI.MAX))
    return float(load), (used >= load * (1.0 - TIE)) & (used > 0.0)


def _first_break(interface: Interface, law: StrengthCriterion, state: Equilibrium, ahead: DualSolution) -> float:
    """Share of the way to `ahead` at which the first bond reaches its strength, or inf.

    Utilisation is convex along a straight way, so below 1 here and above 1 there it passes 1 once: bisection.
    """
    here, there = interface.traction(state.solution), interface.traction(ahead)
    over = (state.status == BONDED) & (law.utilisation(there) > 1.0)
    here, step = here[over], there[over] - here[over]
    low, high = np.zeros(len(here)), np.ones(len(here))
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        broken = law.utilisation(here + middle[:, None] * step) > 1.0
        low, high = np.where(broken, low, middle), np.where(broken, middle, high)
    return float(interface.solver.comm.allreduce(high.min(initial=np.inf), MPI.MIN))


def _first_change(interface: Interface, state: Equilibrium, ahead: DualSolution) -> float:
    """Share of the way to `ahead` at which the first node closes or opens; 1 if none does."""
    comm, row = interface.solver.comm, interface.nodes.row
    if not interface.contact:
        return 1.0
    noise = NOISE * interface.solver.rtol
    largest = comm.allreduce(np.abs(ahead.lam).max(initial=0.0), MPI.MAX)
    force, gap = ahead.lam[row], ahead.jump[row]
    opens = (state.status == CLOSED) & (force > noise * largest)
    closes = (state.status == OPEN) & (gap < -noise * np.abs(ahead.strain).max())
    shares = [np.ones(1)]
    for which, here, there in ((opens, -state.solution.lam[row], -force), (closes, state.solution.jump[row], gap)):
        a, b = np.maximum(here[which], 0.0), there[which]
        shares.append(a / (a - b))
    return float(comm.allreduce(np.concatenate(shares).min(), MPI.MIN))
