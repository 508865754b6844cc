"""States of the interface: which bonds hold, what each remembers, the equilibrium under one load and its certificate.

The certificate is how far a state of contact is from the KKT conditions, whichever way it was found.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from feti_homog.feti.dual_solution import DualSolution
from feti_homog.interface.loads import Load, Multipliers
from feti_homog.typing import Bool, Float

Status = NDArray[np.int8]

BONDED, CLOSED, OPEN = 0, 1, 2


@dataclass(frozen=True)
class BondState:
    """State of the k interface nodes that this rank owns.

    Attributes:
        status: (k,) BONDED, CLOSED or OPEN.
        history: (k, h) internal variables of the law of the bonds, from its `begin`; h = 0 of laws without memory.
        pressed: (k,) which of the bonds that hold have the normal stiffness of compression, where damage makes that
            another one than in tension.
        gap_and_slip: (k, 2) of debonded faces with friction and what damaged bonds give beside their intact springs, 0
            of other bonds; None without friction.
        sliding: (k,) the sign with which the slip of a closed node grows, 0 where it sticks; None without friction.
    """

    status: Status
    history: Float
    pressed: Bool
    gap_and_slip: Float | None = None
    sliding: Status | None = None

    @classmethod
    def without_memory(cls, status: Status) -> BondState:
        """State of bonds whose law has no internal variables."""
        return cls(status, np.zeros((len(status), 0)), np.zeros(len(status), bool))

    @property
    def sliding_signs(self) -> Status:
        """(k,) `sliding`, 0 without friction."""
        return np.zeros(len(self.status), np.int8) if self.sliding is None else self.sliding

    def with_status(self, status: Status) -> BondState:
        """Replace the status; contact changes no internal variable."""
        return replace(self, status=status)

    def flipped(self, which: Bool) -> BondState:
        """Turn the nodes `which` (k,) over: from open to closed or back, and from pulled to pressed or back."""
        holds = self.status == BONDED
        turned = np.where(which & ~holds, CLOSED + OPEN - self.status, self.status).astype(np.int8)
        return replace(self, status=turned, pressed=self.pressed ^ (which & holds))

    def differs(self, other: BondState) -> Bool:
        """(k,) nodes whose contact is another one."""
        return np.asarray((self.status != other.status) | (self.pressed != other.pressed))


Softening = Callable[[BondState, Bool], Float | None]
"""Map a state and which bonds (k,) are pulled, not pressed, to C / C_0 (k, 3) of the springs; None where it is 1."""


def never_softens(bonds: BondState, pulled: Bool) -> None:
    """Softening of springs whose compliance never changes."""


@dataclass(frozen=True)
class Equilibrium:
    """The cell under one load with the contact states that hold there.

    Attributes:
        load: what is prescribed.
        bonds: state of the interface nodes that this rank owns.
        solution: of the last dual problem; its multipliers and jumps are those of the state.
        iterations, solves: Krylov iterations and dual problems that it took.
        free_motions: number of rigid motions of bodies that no interface force resists; a face that touches without
            a force resists none.
        certificate: errors of the KKT conditions, `kkt_errors`.
        asked: (v,) sizes of the strains that the load would make with all bonds; with friction all loads up to it.
        axial: the same of the displacement along the fibres with these bonds, where that is a problem.
    """

    load: Load
    bonds: BondState
    solution: DualSolution
    iterations: int
    solves: int
    free_motions: int
    certificate: dict[str, float]
    asked: Float
    axial: Equilibrium | None = None

    @property
    def status(self) -> Status:
        """(k,) BONDED, CLOSED or OPEN."""
        return self.bonds.status

    @property
    def problems(self) -> tuple[Equilibrium, ...]:
        """Equilibria of all problems, the one in the plane first."""
        return (self,) if self.axial is None else (self, self.axial)

    @property
    def solutions(self) -> tuple[DualSolution, ...]:
        """Solutions of all problems."""
        return tuple(each.solution for each in self.problems)

    @property
    def multipliers(self) -> Multipliers:
        """Multipliers of all problems."""
        return tuple(each.lam for each in self.solutions)

    @property
    def converged(self) -> bool:
        """Return True if the Krylov method solved all problems."""
        return all(each.reason > 0 for each in self.solutions)


def kkt_errors(
    comm: MPI.Intracomm,
    traction: Float,
    length: Float,
    gap: Float,
    debonded: Bool,
    closed: Bool,
    displacement: float,
    stress: Float,
    over_interface: Callable[[Float], Float],
) -> dict[str, float]:
    """Errors of gap >= 0, force <= 0, force gap = 0 on the debonded faces, each relative to its scale.  Collective.

    `kkt_penetration` is -gap relative to the imposed displacement, `kkt_tension` the normal traction of a closed node
    relative to the largest traction of its interface, `kkt_complementarity` |force gap| relative to the largest force
    there times the displacement; of each the largest.  A traction scale is no less than the imposed stress: where no
    face carries a force, what is left of the tractions is rounding.

    Args:
        traction: (k, 2) normal and tangential traction of this rank's interface nodes, tension positive.
        length, gap: (k,) tributary interface length, force = traction length, and opening.
        debonded, closed: (k,) which nodes the conditions hold for, and which of them touch.
        displacement: the largest that the strain imposes on the cell.
        stress: (k,) that it would cause at each node.
        over_interface: from values (k,) to the largest on the interface of each node.
    """
    force = traction[:, 0] * length
    largest_traction = np.maximum(over_interface(np.abs(traction).max(axis=1, initial=0.0)), stress)
    largest_force = np.maximum(over_interface(np.abs(force)), stress * over_interface(length))
    # Without a strain there is nothing that an error could be a part of: it stands by itself.
    displacement = displacement or 1.0
    largest_traction, largest_force = (np.where(size > 0.0, size, 1.0) for size in (largest_traction, largest_force))
    worst = np.array(
        [
            np.where(debonded, -gap, 0.0).max(initial=0.0) / displacement,
            np.where(debonded & closed, traction[:, 0] / largest_traction, 0.0).max(initial=0.0),
            np.where(debonded, np.abs(force * gap) / (largest_force * displacement), 0.0).max(initial=0.0),
        ]
    )
    comm.Allreduce(MPI.IN_PLACE, worst, MPI.MAX)
    return dict(zip(("kkt_penetration", "kkt_tension", "kkt_complementarity"), worst.tolist(), strict=True))


def coulomb_errors(force: Float, friction: Float, sliding: Status) -> Float:
    """(k,) how far shear is beyond mu p, or off s mu p, and shear along the fibres, of which faces bear none.

    Args:
        force: (k, c) normal, tangential and axial traction of faces, and of damaged bonds what is beside their springs.
        friction, sliding: (k,) mu, and the sign s with which the slip grows, 0 of faces that stick.
    """
    limit, shear = friction * np.maximum(-force[:, 0], 0.0), force[:, 1]
    off = np.where(sliding == 0, np.maximum(np.abs(shear) - limit, 0.0), np.abs(sliding * shear - limit))
    along = np.abs(force[:, 2:]).max(axis=1, initial=0.0)
    return np.asarray(np.maximum(off, along))
