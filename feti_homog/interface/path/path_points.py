"""Points of a load path, the states from which a path continues, and breaks of bonds."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from mpi4py import MPI

from feti_homog.interface.contact import BONDED, BondState, CoupledInterfaces, Equilibrium
from feti_homog.interface.contact.coupled_interfaces import held_traction
from feti_homog.interface.laws.bond_law import UTILISATION_TIE, BondLaw
from feti_homog.interface.loads import Macroscopic, Multipliers
from feti_homog.typing import Bool, Float


@dataclass(frozen=True)
class PathState:
    """The state from which a path can continue.

    Attributes:
        leg, position: the load is at the fraction `position`, 0..1, of the way to waypoint `leg`; with increments,
            `leg` is the number of finished steps.
        bonds, lam: initial bond states and multipliers.
        origin: state at the beginning of the leg.
        last: state at the last point.
        broken: fracture energy per cell area of the bonds that broke at the last point, each in its mode;
            0 without toughness, None without a break.
        stretched: with friction, energy per area in the springs of damaged bonds, before the break at the last point.
    """

    leg: int
    position: float
    bonds: BondState
    lam: Multipliers
    origin: Macroscopic
    last: Macroscopic
    broken: float | None = None
    stretched: float = 0.0

    def energies_to(self, after: Macroscopic) -> Energies:
        """Return the energies from the last point to the state `after`; only a break at the last point loses any."""
        lost = 0.0 if self.broken is None else self.last.released_to(after)
        return Energies(after.stored - self.last.stored + lost, lost, self.broken or 0.0)


class Energies(NamedTuple):
    """The energies per cell area between two points: work, released energy, fracture energy, frictional heat."""

    work: float
    released: float
    fracture: float
    friction: float = 0.0

    def plus(self, more: Energies) -> Energies:
        """Return the sum with the energies `more`."""
        return Energies(*(a + b for a, b in zip(self, more, strict=True)))


NO_ENERGIES = Energies(0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Point:
    """A point of a load path.

    Attributes:
        load_factor: position on the path, 0 to 1, with equal parts for all legs.
        scale: ratio of the point's state to the equilibrium `state`.
        state: equilibrium.
        broke: number of bonds that part after this state; with increments, in the step before this state.
        softened: number of bonds that lose teeth but hold.
        energies: energies since the previous point.
        used: (k,) utilisation before bonds break, 0 without a bond; empty in a point from a checkpoint.
        after: state from which the path continues.
    """

    load_factor: float
    scale: float
    state: Equilibrium
    broke: int
    softened: int
    energies: Energies
    used: Float
    after: PathState


def unloaded(cell: CoupledInterfaces, bonds: BondState) -> PathState:
    """Return the unloaded path state with these bonds."""
    nothing = Macroscopic(np.zeros(len(cell.loads)), np.zeros(len(cell.loads)))
    return PathState(0, 0.0, bonds, cell.no_multipliers(), nothing, nothing)


def break_bonds(
    cell: CoupledInterfaces, law: BondLaw, which: Bool, state: Equilibrium, place: PathState
) -> tuple[int, int, PathState]:
    """Break the bonds in the mask `which` (k,) of an equilibrium, regardless of the tractions.  Collective.

    Return the numbers of bonds that part and that soften, over all ranks, and `place` with the bonds after the break.
    """
    traction, bonds = held_traction(cell, state), state.bonds
    history, parts = law.after(bonds, which, traction)
    status = cell.plane.debond(state.status, parts, state.multipliers[0])
    pressed = np.where(which, traction[:, 0] < 0.0, bonds.pressed)  # a first guess for the search of contact states
    energy = 0.0
    if law.has_toughness:
        energy = float(law.fracture(bonds, which, traction) @ cell.nodes.length[which])
        energy = float(cell.comm.allreduce(energy) / cell.area)
    parted, softened = (count_on_all_ranks(cell, nodes) for nodes in (parts, which & ~parts))
    broken = replace(bonds, status=status, history=history, pressed=pressed)
    return parted, softened, replace(place, bonds=broken, broken=energy)


def most_utilised(cell: CoupledInterfaces, law: BondLaw, state: Equilibrium) -> tuple[Float, float, Bool]:
    """Return the utilisations, the largest value, and the most utilised nodes.  Collective.

    The utilisations are (k,), 0 at debonded nodes; the largest value is over all ranks; the nodes are a mask (k,).
    """
    comm = cell.comm
    used = law.in_state(cell, state.bonds).share(held_traction(cell, state))
    used = np.where(state.status == BONDED, used, 0.0)
    largest = comm.bcast(comm.reduce(used.max(initial=0.0), MPI.MAX))
    return used, float(largest), (used >= largest * (1.0 - UTILISATION_TIE)) & (used > 0.0)


def count_on_all_ranks(cell: CoupledInterfaces, which: Bool) -> int:
    """Count the nodes of all ranks where `which` (k,) is true.  Collective."""
    return int(cell.comm.allreduce(int(which.sum())))
