"""Break by energy where debonding has begun: at a tip it is what the break really releases that counts.

The energy of a tip's own spring falls with the length that it stands for, so that growth by it depends on the mesh.
What the break of bond i releases does not: with H the inverse of the dual operator on the active rows, its faces then
part by j = H_ii^-1 lam_i, and the energy of the cell falls, at constant strain, by

    1/2 lam_i . H_ii^-1 lam_i;  1/2 lam_t^2 / H_tt if they would overlap and the normal force stays.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from feti_homog.feti.preconditioners.influence import Influence
from feti_homog.interface.contact import BONDED, Interface, Status
from feti_homog.interface.energy_criterion import EnergyCriterion
from feti_homog.typing import Bool, Float, Int

# Share of a spring's stiffness that the inverse of the dual operator is where only rounding is left of it.
RIGID = 1e-9


@dataclass(frozen=True)
class Tips:
    """The bonds of this rank beside broken ones.

    Attributes:
        node: (t,) their numbers.
        H: (t, 2, 2) their blocks of the inverse of the dual operator.
        length: (t,) that they stand for.
        stiffness: (t, 2) the most that H can be, of a spring its own.
    """

    node: Int
    H: Float
    length: Float
    stiffness: Float


@dataclass(frozen=True)
class TipCriterion:
    """Bonds beside a broken one break when that releases G_c l, l being the length that they stand for; others when
    the energy of their spring reaches G_c.

    Attributes:
        springs: the criterion of the others, and the toughness.
        influence: the inverse of the dual operator, which knows the bonds beside each other.
        axial: that of slip along the fibres, where it counts.
    """

    springs: EnergyCriterion
    influence: Influence
    axial: Influence | None = None

    def law(self, interface: Interface, status: Status) -> Callable[[Float], Float]:
        """The utilisation (k,) of tractions (k, 2) on the interface nodes of this rank, with these bonds.  Collective;
        what it returns is not."""
        tips = self.tips(interface, status)
        own, length = tips.node, tips.length

        def utilisation(traction: Float) -> Float:
            used = self.springs.utilisation(traction)
            released = released_energy(tips.H, traction[own] * length[:, None], tips.stiffness, interface.contact)
            used[own] = np.sqrt(released / (self.springs.toughness * length)) * self.springs.mode_factor(traction[own])
            return used

        return utilisation

    def tips(self, interface: Interface, status: Status) -> Tips:
        """The tips that this rank owns.  Collective."""
        interface.solver.activate(interface.active(status))
        numbers, mine = self._own(status)
        H = self.influence.inverse_blocks(self.influence.neighbours.rows[numbers][:, None] + np.arange(2))
        own, H = numbers[mine] - self.influence.neighbours.first, H[mine]
        length = interface.nodes.length[own]
        springs = length[:, None] * [self.springs.normal_stiffness, self.springs.tangential_stiffness]
        return Tips(own, H, length, np.minimum(springs, self.influence.norm))

    def axial_flexibility(self, axial: Interface | None, status: Status) -> Float:
        """(t,) H_aa of the tips of `tips`, for slip along the fibres; empty without it.  Collective."""
        if axial is None or self.axial is None:
            return np.zeros(0)
        axial.solver.activate(axial.active(status))
        numbers, mine = self._own(status)
        rows = self.axial.neighbours.rows[numbers]
        return np.asarray(self.axial.inverse_blocks(np.stack([rows, rows], axis=1))[mine, 0, 0])

    def _own(self, status: Status) -> tuple[Int, Bool]:
        """(n,) numbers of the tips of all ranks, and which are this rank's.  Collective."""
        neighbours = self.influence.neighbours
        everywhere = np.concatenate(neighbours.comm.allgather(status))
        tips = np.flatnonzero((everywhere == BONDED) & (neighbours.adjacency @ (everywhere != BONDED) > 0))
        return tips, (tips >= neighbours.first) & (tips < neighbours.first + len(status))


def released_energy(H: Float, lam: Float, stiffness: Float, contact: bool) -> Float:
    """(m,) energies that the breaks of single bonds release, for their blocks H (m, 2, 2) and forces lam (m, 2).

    `stiffness` (m, 2) is the most that H can be, of a spring its own: where H is rounding beside it, as at the last
    bond of a fibre, no force can act.  With `contact` faces that would overlap keep their normal force.
    """
    root = np.sqrt(stiffness)
    share, vectors = np.linalg.eigh(H / (root[:, :, None] * root[:, None, :]))
    along = np.einsum("mij,mi->mj", vectors, lam / root)
    inverse = np.where(share > RIGID, 1.0 / np.where(share > RIGID, share, 1.0), 0.0)
    opens = (np.einsum("mj,mj->m", vectors[:, 0], inverse * along) >= 0.0) | (not contact)
    both, tangential = (inverse * along**2).sum(axis=1), H[:, 1, 1] / stiffness[:, 1]
    slides = tangential > RIGID
    shear = np.where(slides, lam[:, 1] ** 2 / stiffness[:, 1] / np.where(slides, tangential, 1.0), 0.0)
    return np.asarray(np.where(opens, both, shear) / 2)
