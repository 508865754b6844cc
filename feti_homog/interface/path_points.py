"""Points of a path of load, from where it goes on, and which bonds break under a state."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from feti_homog.interface.bond_criterion import BondCriterion, spring_criterion
from feti_homog.interface.contact import BONDED, Equilibrium, Interface, Status
from feti_homog.typing import Bool, Float

# Bonds whose utilisation differs by no more than this, relatively, break together: those of a symmetric cell do, but
# for the solver's error.
UTILISATION_TIE = 1e-6


@dataclass(frozen=True)
class Break:
    """Bonds that broke at constant strain.

    Attributes:
        stress: (3,) Sigma before.
        fracture_energy: toughness G_c, in the mode in which each broke, times its length, per area of the cell; 0 of
            bonds without toughness.
    """

    stress: Float
    fracture_energy: float


@dataclass(frozen=True)
class PathState:
    """Where a path stands, enough to go on from.

    Attributes:
        leg, position: the macroscopic strain is the share `position`, 0..1, of the way to waypoint `leg`; of
            increments, `leg` is the number of those done.
        status, lam: contact states (k,) and multipliers (owned rows,) to begin with.
        broken: the break there of bonds that `status` no longer has; None if none broke.
    """

    leg: int
    position: float
    status: Status
    lam: Float
    broken: Break | None = None


@dataclass(frozen=True)
class Point:
    """A point of the path.

    Attributes:
        load_factor: position on the whole path, 0 to 1, every leg taking the same share.
        scale: the state is `scale` times the equilibrium under `state.solution.strain`.
        state: that equilibrium.
        broke: number of bonds that break at this state, after it; of increments, that broke in the step, before it.
        released: energy per area of the cell that was lost to breaks between the last point's state and this one.
        fracture_energy: of these breaks.
        used: (k,) share of their strength that bonds use in the state, 0 where there are none.
        after: from where the path goes on.
    """

    load_factor: float
    scale: float
    state: Equilibrium
    broke: int
    released: float
    fracture_energy: float
    used: Float
    after: PathState


def unloaded(interface: Interface, status: Status) -> PathState:
    """The beginning of a path with the debonded nodes of `status`."""
    return PathState(0, 0.0, status, np.zeros(interface.solver.rows))


def energies_of(broken: Break | None, strain: Float, after: Float) -> tuple[float, float]:
    """Energies per area of a break at constant strain (3,): what is released, and its fracture energy; 0 of none.

    At fixed contact states the stored energy is 1/2 E.Sigma, and no work is done at constant strain; so what is
    released is 1/2 E.(Sigma before - Sigma after).
    """
    if broken is None:
        return 0.0, 0.0
    return 0.5 * float(strain @ (broken.stress - after)), broken.fracture_energy


def fracture_energy(interface: Interface, criterion: BondCriterion, which: Bool, traction: Float) -> float:
    """Toughness times length of the bonds of `which` (k,) under tractions (k, 2) of any size, per area; collective."""
    springs = spring_criterion(criterion)
    if springs is None:
        return 0.0
    energy = float(springs.fracture_toughness(traction[which]) @ interface.nodes.length[which])
    return float(interface.solver.comm.allreduce(energy) / interface.size.prod())


def most_utilised(interface: Interface, criterion: BondCriterion, state: Equilibrium) -> tuple[Float, float, Bool]:
    """(k,) share of strength that the nodes of this rank use, 0 of debonded ones; the largest of all, and which (k,)
    have it.  Collective, rank 0 decides."""
    comm = interface.solver.comm
    used = criterion.law(interface, state.status)(interface.traction(state.solution))
    used = np.where(state.status == BONDED, used, 0.0)
    largest = comm.bcast(comm.reduce(used.max(initial=0.0), MPI.MAX))
    return used, float(largest), (used >= largest * (1.0 - UTILISATION_TIE)) & (used > 0.0)


def count_on_all_ranks(interface: Interface, which: Bool) -> int:
    """Number of nodes of `which` (k,) on all ranks; collective."""
    return int(interface.solver.comm.allreduce(int(which.sum())))
