"""Points of a path of load, from where it goes on, and which bonds break under a state."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from mpi4py import MPI

from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces, held_traction
from feti_homog.interface.contact.states import BONDED, BondState, Equilibrium
from feti_homog.interface.laws.bond_law import BondLaw
from feti_homog.interface.loads import Macroscopic, Multipliers
from feti_homog.typing import Bool, Float

# Bonds whose utilisation differs by no more than this, relatively, break together: those of a symmetric cell do, but
# for the solver's error.
UTILISATION_TIE = 1e-6


@dataclass(frozen=True)
class PathState:
    """Position on a path, enough to go on from.

    Attributes:
        leg, position: the load is the share `position`, 0..1, of the way to waypoint `leg`; of increments, `leg` is the
            number of those done.
        bonds, lam: states of the interface nodes and multipliers to begin with.
        origin: where the leg began.
        last: the last point's state.
        broken: fracture energy of the bonds that broke there, in the mode in which each broke, per area of the cell, 0
            of bonds without toughness; None if none broke.
        stretched: with friction, energy per area of the springs of damaged bonds, before those of `broken` broke.
    """

    leg: int
    position: float
    bonds: BondState
    lam: Multipliers
    origin: Macroscopic
    last: Macroscopic
    broken: float | None = None
    stretched: float = 0.0

    def energies_to(self, here: Macroscopic) -> Energies:
        """Return those of the way from the last point's state to one under the load at which this stands.

        The response between them may bend where contact changes, but that loses nothing: the work is what is stored or
        lost."""
        lost = 0.0 if self.broken is None else self.last.released_to(here)
        return Energies(here.stored - self.last.stored + lost, lost, self.broken or 0.0)


class Energies(NamedTuple):
    """Energies per area of the cell of a part of a path.

    The work of the loads, what breaks lost of it, the fracture energy of these breaks, and the heat of friction.
    """

    work: float
    released: float
    fracture: float
    friction: float = 0.0

    def plus(self, more: Energies) -> Energies:
        """Return those of two parts."""
        return Energies(*(a + b for a, b in zip(self, more, strict=True)))


NO_ENERGIES = Energies(0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Point:
    """A point of the path.

    Attributes:
        load_factor: position on the whole path, 0 to 1, every leg taking the same share.
        scale: the state is `scale` times the equilibrium `state`.
        state: that equilibrium.
        broke: number of bonds that part at this state, after it; of increments, that did in the step, before it.
        softened: number of bonds that lose a tooth there but hold; of increments each once, whatever its teeth.
        energies: between the last point's state and this one.
        used: (k,) share of their strength that bonds use in the state, 0 where there are none.
        after: from where the path goes on.
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
    """Return the beginning of a path with the debonded nodes of `bonds`."""
    nothing = Macroscopic(np.zeros(len(cell.loads)), np.zeros(len(cell.loads)))
    return PathState(0, 0.0, bonds, cell.no_multipliers(), nothing, nothing)


def break_bonds(
    cell: CoupledInterfaces, law: BondLaw, which: Bool, state: Equilibrium, place: PathState
) -> tuple[int, int, PathState]:
    """Break the bonds `which` (k,) in the modes of an equilibrium, whatever its size.  Collective.

    Return how many of all ranks part and how many soften, and the path state `place` with the broken bonds.
    """
    traction, bonds = held_traction(cell, state), state.bonds
    history, parts = law.after(bonds, which, traction)
    status = cell.plane.debond(state.status, parts, state.multipliers[0])
    # A first guess, which the search for contact checks.
    pressed = np.where(which, traction[:, 0] < 0.0, bonds.pressed)
    energy = 0.0
    if law.has_toughness:
        energy = float(law.fracture(bonds, which, traction) @ cell.nodes.length[which])
        energy = float(cell.comm.allreduce(energy) / cell.area)
    parted, softened = (count_on_all_ranks(cell, nodes) for nodes in (parts, which & ~parts))
    broken = replace(bonds, status=status, history=history, pressed=pressed)
    return parted, softened, replace(place, bonds=broken, broken=energy)


def most_utilised(cell: CoupledInterfaces, law: BondLaw, state: Equilibrium) -> tuple[Float, float, Bool]:
    """(k,) share of strength that the nodes of this rank use, 0 of debonded ones.

    The largest of all, and which (k,) have it. Collective, rank 0 decides.
    """
    comm = cell.comm
    used = law.in_state(cell, state.bonds).share(held_traction(cell, state))
    used = np.where(state.status == BONDED, used, 0.0)
    largest = comm.bcast(comm.reduce(used.max(initial=0.0), MPI.MAX))
    return used, float(largest), (used >= largest * (1.0 - UTILISATION_TIE)) & (used > 0.0)


def count_on_all_ranks(cell: CoupledInterfaces, which: Bool) -> int:
    """Count the nodes of `which` (k,) on all ranks.  Collective."""
    return int(cell.comm.allreduce(int(which.sum())))
