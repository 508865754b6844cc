"""States of the interface: which bonds hold, what each remembers, and the equilibrium of a cell under one load."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from feti_homog.feti.dual_solution import DualSolution
from feti_homog.interface.loads.load import CoupledSolution, Load, Multipliers
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
        certificate: errors of the KKT conditions, `contact_certificate.kkt_errors`.
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
    def solutions(self) -> CoupledSolution:
        """Solutions of all problems."""
        return CoupledSolution(tuple(each.solution for each in self.problems))

    @property
    def multipliers(self) -> Multipliers:
        """Multipliers of all problems."""
        return self.solutions.lam

    @property
    def converged(self) -> bool:
        """Return True if the Krylov method solved all problems."""
        return self.solutions.converged
