"""Points of a path of load, from where it goes on, and which bonds break under a state."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from feti_homog.interface.bond_criterion import BondCriterion
from feti_homog.interface.contact import BONDED, Equilibrium, Interface, Status
from feti_homog.typing import Bool, Float

# Bonds whose utilisation differs by no more than this, relatively, break together: those of a symmetric cell do, but
# for the solver's error.
UTILISATION_TIE = 1e-6


@dataclass(frozen=True)
class PathState:
    """Where a path stands, enough to go on from.

    Attributes:
        leg, position: the macroscopic strain is the share `position`, 0..1, of the way to waypoint `leg`; of
            increments, `leg` is the number of those done.
        status, lam: contact states (k,) and multipliers (owned rows,) to begin with.
        stress_before_break: (3,) Sigma there before bonds broke that `status` no longer has; None if none did.
    """

    leg: int
    position: float
    status: Status
    lam: Float
    stress_before_break: Float | None = None


@dataclass(frozen=True)
class Point:
    """A point of the path.

    Attributes:
        load_factor: position on the whole path, 0 to 1, every leg taking the same share.
        scale: the state is `scale` times the equilibrium under `state.solution.strain`.
        state: that equilibrium.
        broke: number of bonds that break at this state, after it; of increments, that broke in the step, before it.
        released: energy per area of the cell that was lost to breaks between the last point's state and this one.
        after: from where the path goes on.
    """

    load_factor: float
    scale: float
    state: Equilibrium
    broke: int
    released: float
    after: PathState


def unloaded(interface: Interface, status: Status) -> PathState:
    """The beginning of a path with the debonded nodes of `status`."""
    return PathState(0, 0.0, status, np.zeros(interface.solver.rows))


def energy_released(strain: Float, before: Float | None, after: Float) -> float:
    """1/2 E.(Sigma before - Sigma after): lost per area by breaks at constant strain (3,); 0 if nothing broke (None).

    At fixed contact states the stored energy is 1/2 E.Sigma, and no work is done at constant strain.
    """
    return 0.0 if before is None else 0.5 * float(strain @ (before - after))


def utilisation(interface: Interface, criterion: BondCriterion, state: Equilibrium) -> Float:
    """(k,) share of strength that bonded nodes use, 0 on debonded ones."""
    used = criterion.law(interface, state.status)(interface.traction(state.solution))
    return np.where(state.status == BONDED, used, 0.0)


def most_utilised(interface: Interface, criterion: BondCriterion, state: Equilibrium) -> tuple[float, Bool]:
    """The largest utilisation of all bonds, and which (k,) of this rank's have it; collective, rank 0 decides."""
    comm = interface.solver.comm
    used = utilisation(interface, criterion, state)
    largest = comm.bcast(comm.reduce(used.max(initial=0.0), MPI.MAX))
    return float(largest), (used >= largest * (1.0 - UTILISATION_TIE)) & (used > 0.0)


def count_on_all_ranks(interface: Interface, which: Bool) -> int:
    """Number of nodes of `which` (k,) on all ranks; collective."""
    return int(interface.solver.comm.allreduce(int(which.sum())))
