"""Break by energy where debonding has begun: at a tip it is what the break really releases that counts.

The energy of a tip's own spring falls with the length that it stands for, so that growth by it depends on the mesh.
What the break of bond i releases does not: with H the inverse of the dual operator on the active rows, its faces then
part by j = H_ii^-1 lam_i, and the energy of the cell falls, at constant strain, by

    1/2 lam_i . H_ii^-1 lam_i;  1/2 lam_t^2 / H_tt if they would overlap and the normal force stays.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from feti_homog.errors import ConvergenceError
from feti_homog.feti.exact.exact_inverse import ExactInverse
from feti_homog.interface.contact.contact_problem import ContactProblem
from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.contact.states import BONDED, BondState, Status
from feti_homog.interface.laws.bond_law import BondLaw, Utilisation
from feti_homog.interface.laws.energy import SpringEnergy
from feti_homog.typing import Bool, Float, Int

# Share of the stiffness beside a bond that the inverse of the dual operator is where only rounding is left of it.
RIGID = 1e-9
# Largest rounding of the inverse of the dual operator with which energies are compared: bonds whose utilisation differs
# by less break together.
MOST_ROUNDING = 1e-6


@dataclass(frozen=True)
class Tips:
    """The bonds of this rank beside broken ones.

    Attributes:
        node: (t,) their numbers.
        H: (t, 2, 2) their blocks of the inverse of the dual operator.
        length: (t,) that they stand for.
        stiffness: (t, c) the most that H can be, as `ExactInverse.stiffness`.
        axial: (t,) the same blocks for slip along the fibres; empty where there is none.
    """

    node: Int
    H: Float
    length: Float
    stiffness: Float
    axial: Float

    def chosen(self, which: Int) -> Tips:
        """Return some of them."""
        axial = self.axial[which] if len(self.axial) else self.axial
        return Tips(self.node[which], self.H[which], self.length[which], self.stiffness[which], axial)

    def released(self, traction: Float, contact: bool) -> Float:
        """(t,) energies that breaks release under tractions (t, c); with `contact` faces do not overlap."""
        lam = traction * self.length[:, None]
        released = released_energy(self.H, lam[:, :2], self.stiffness[:, :2], contact)
        if len(self.axial) == 0:
            return released
        gives_way = self.axial > RIGID * self.stiffness[:, 2]
        along = np.where(gives_way, lam[:, 2] ** 2 / np.where(gives_way, 2.0 * self.axial, 1.0), 0.0)
        return np.asarray(released + along)


@dataclass(frozen=True)
class ReleasedEnergy(BondLaw):
    """Bonds beside a broken one break when that releases G_c l, l being the length that they stand for.

    Others when the energy of their spring reaches G_c.

    Attributes:
        springs: the criterion of the others, and the toughness.
        influence: the inverse of the dual operator, which couples the bonds beside each other.
        axial: that of slip along the fibres, where it counts.
    """

    springs: SpringEnergy
    influence: ExactInverse
    axial: ExactInverse | None = None

    has_toughness: ClassVar[bool] = True
    has_tips: ClassVar[bool] = True
    break_names: ClassVar[tuple[str, ...]] = SpringEnergy.break_names

    def at(self, node: Int) -> ReleasedEnergy:
        """Return the law of the nodes (p,), one after the other."""
        return replace(self, springs=self.springs.at(node))

    def share(self, traction: Float) -> Float:
        """(p,) shares of the springs."""
        return self.springs.share(traction)

    def breaks(self, traction: Float) -> Float:
        """(p, 1) psi of tractions (p, c), in degrees."""
        return self.springs.breaks(traction)

    def fracture(self, bonds: BondState, which: Bool, traction: Float) -> Float:
        """(p,) G_c of the bonds `which` (k,) in the modes of tractions (k, c)."""
        return self.springs.fracture(bonds, which, traction)

    def mode_angle(self, traction: Float) -> Float:
        """(p,) psi of tractions (p, c), in radians."""
        return self.springs.mode_angle(traction)

    def utilisation(self, cell: CoupledInterfaces, bonds: BondState) -> Utilisation:
        """Utilisation of the nodes of this rank with these bonds.  Collective; what it returns is not."""
        tips = self.tips(cell, bonds)
        number = np.full(len(bonds.status), -1)
        number[tips.node] = np.arange(len(tips.node))
        return ReleasedUtilisation(self.springs, tips, number, cell.plane.contact)

    def tips(self, cell: CoupledInterfaces, bonds: BondState) -> Tips:
        """Return the tips that this rank owns. Collective.

        Raises:
            ConvergenceError: rounding hides what breaks release.
        """
        self._activate(self.influence, cell.plane, bonds)
        numbers, mine = self._own(bonds.status)
        rows = self.influence.neighbours.rows[numbers][:, None] + np.arange(2)
        H, axial = self.influence.inverse_blocks(rows)[mine], np.zeros(0)
        stiffness = self.influence.stiffness[rows[mine]]
        own = numbers[mine] - self.influence.neighbours.first
        if self.axial is not None:
            self._activate(self.axial, cell.problems[1], bonds)
            rows = self.axial.neighbours.rows[numbers]
            axial = self.axial.inverse_blocks(np.stack([rows, rows], axis=1))[mine, 0, 0]
            stiffness = np.column_stack([stiffness, self.axial.stiffness[rows[mine]]])
        return Tips(own, H, cell.nodes.length[own], stiffness, axial)

    @staticmethod
    def _activate(influence: ExactInverse, interface: ContactProblem, bonds: BondState) -> None:
        """Let the inverse be that with these bonds.  Collective; raises as `tips`."""
        interface.prepare(bonds)
        if not influence.rounding <= MOST_ROUNDING:
            raise ConvergenceError(
                f'[interface] growth = "released": rounding hides {influence.rounding:.1e} of what breaks release, '
                f"expected at most {MOST_ROUNDING:g}: springs are too soft beside bodies that are cut or coated, or "
                'phases too far apart; growth = "springs" bears more'
            )

    def _own(self, status: Status) -> tuple[Int, Bool]:
        """(n,) numbers of the tips of all ranks, and which are this rank's.  Collective."""
        neighbours = self.influence.neighbours
        everywhere = np.concatenate(neighbours.comm.allgather(status))
        tips = np.flatnonzero((everywhere == BONDED) & (neighbours.adjacency @ (everywhere != BONDED) > 0))
        return tips, (tips >= neighbours.first) & (tips < neighbours.first + len(status))


class ReleasedUtilisation(Utilisation):
    """sqrt(released / (G_c l)) at tips, the utilisation of the springs at other nodes."""

    def __init__(self, law: SpringEnergy, tips: Tips, number: Int, contact: bool) -> None:
        """Store the tips.

        `number` (p,) is the number of the tip at a node, or -1; with `contact` faces do not overlap.
        """
        super().__init__(law)
        self._springs, self._tips, self._number, self._contact = law, tips, number, contact

    def __call__(self, traction: Float) -> Float:
        """(p,) shares that tractions (p, c) at the nodes use."""
        used = self._springs.share(traction)
        at = np.flatnonzero(self._number >= 0)
        tips, springs = self._tips.chosen(self._number[at]), self._springs.at(at)
        released = tips.released(traction[at], self._contact)
        used[at] = np.sqrt(released / (springs.toughness * tips.length)) * springs.mode_factor(traction[at])
        return used

    def at(self, node: Int) -> ReleasedUtilisation:
        """Return the same of the nodes (p,), one after the other."""
        return ReleasedUtilisation(self._springs.at(node), self._tips, self._number[node], self._contact)

    def is_convex(self, p: int) -> Bool:
        """(p,) False at tips: what their breaks release need not be subadditive."""
        return np.asarray(self._number < 0)

    def first_factor(self, before: Float, ahead: Float) -> None:
        """There is no formula for the energies that breaks of tips release."""


def released_energy(H: Float, lam: Float, stiffness: Float, contact: bool) -> Float:
    """(m,) energies that the breaks of single bonds release, for their blocks H (m, 2, 2) and forces lam (m, 2).

    `stiffness` (m, 2) is the most that H can be: where H is rounding beside it, as at the last
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
