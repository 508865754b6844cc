"""Break by energy of the bonds of an elastic interface (LEBIM).

Tavara, Mantic, Graciani, Paris, Eng. Anal. Bound. Elem. 35 (2011) 207; the mode-mixity law is Hutchinson and Suo's.

At a tip of debonding the released energy counts.  The energy in the spring of a tip falls with the length of its node,
so that growth by it depends on the mesh.  The energy that the break of bond i releases does not: with H the inverse of
the dual operator on the active rows, its faces then part by j = H_ii^-1 lam_i, and the energy of the cell falls, at
constant strain, by

    1/2 lam_i . H_ii^-1 lam_i;  1/2 lam_t^2 / H_tt if they would overlap and the normal force stays.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np

from feti_homog.errors import ConvergenceError
from feti_homog.interface.contact.contact_problem import ContactProblem
from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.contact.states import BONDED, BondState
from feti_homog.interface.laws.bond_law import KeyValues, SpringLaw
from feti_homog.typing import Bool, Float, Int

if TYPE_CHECKING:
    from feti_homog.feti.exact import exact_inverse

# Blocks of H are rounding if smaller than this share of the stiffness beside the bond.
RIGID = 1e-9
# Largest rounding of H with which energies are compared: bonds whose utilisation differs by less break together.
MOST_ROUNDING = 1e-6


@dataclass(frozen=True)
class SpringEnergy(SpringLaw):
    """A bond breaks when its spring energy reaches the toughness.

    G_I = <t_n>^2 / (2 k_n), G_II = t_t^2 / (2 k_t), tan^2 psi = G_II / G_I;
    G_I + G_II = G_c = G_Ic [1 + tan^2((1 - lambda) psi)].

    A traction along the fibre adds G_III = t_a^2 / (2 k_a) to G_II.

    Attributes:
        toughness: G_Ic, energy per area.
        mode_sensitivity: lambda; with 1 G_c is independent of the mode, with 0 shear alone breaks nothing.
    """

    normal_stiffness: float | Float
    tangential_stiffness: float | Float
    toughness: float | Float
    mode_sensitivity: float | Float
    axial_stiffness: float | Float = math.inf

    has_tips: ClassVar[bool] = True

    @classmethod
    def of_keys(cls, value: KeyValues) -> Self:
        """Make the law from stiffnesses and toughness; the axial stiffness defaults to the tangential one."""
        return cls(
            value("normal_stiffness"),
            value("tangential_stiffness"),
            value("toughness"),
            value("mode_sensitivity"),
            value("axial_stiffness", "tangential_stiffness"),
        )

    def mode_factor(self, traction: Float) -> Float:
        """(p,) sqrt(G_Ic / G_c) under tractions (p, c)."""
        # 1 / (1 + tan^2 x) = cos^2 x
        return np.asarray(np.cos((1.0 - self.mode_sensitivity) * self.mode_angle(traction)))

    def share(self, traction: Float) -> Float:
        """(p,) sqrt((G_I + G_II) / G_c) under tractions (p, c).

        Homogeneous of degree one in the traction, for psi is independent of its size, and convex.
        """
        return np.asarray(np.sqrt(sum(self.energies(traction)) / self.toughness) * self.mode_factor(traction))

    def fracture_toughness(self, traction: Float) -> Float:
        """(p,) G_c under tractions (p, c), energy per area."""
        return np.asarray(self.toughness / self.mode_factor(traction) ** 2)

    def fracture(self, bonds: BondState, which: Bool, traction: Float) -> Float:
        """(p,) G_c of bonds `which` (k,) under tractions (k, c)."""
        return self.at(np.flatnonzero(which)).fracture_toughness(traction[which])


@dataclass(frozen=True)
class TipEnergies:
    """The bonds of this rank beside broken ones.

    Attributes:
        H: (t, 2, 2) diagonal blocks of the inverse dual operator.
        length: (t,) tributary lengths.
        stiffness: (t, c) upper bound of H, as `ExactInverse.stiffness`.
        axial: (t,) H for slip along the fibres; empty without this problem.
    """

    H: Float
    length: Float
    stiffness: Float
    axial: Float


@dataclass(frozen=True, kw_only=True)
class ReleasedEnergy(SpringEnergy):
    """Bonds beside a broken one break when the break releases G_c l, with l their tributary length.

    Other bonds break when their spring energy reaches G_c.

    Attributes:
        influence: inverse dual operator, which couples neighbouring bonds.
        axial: inverse for slip along the fibres, if that is a problem.
    """

    influence: exact_inverse.ExactInverse
    axial: exact_inverse.ExactInverse | None = None

    @classmethod
    def of(
        cls,
        springs: SpringEnergy,
        influence: exact_inverse.ExactInverse,
        axial: exact_inverse.ExactInverse | None = None,
    ) -> Self:
        """Make the law from springs and the problems' inverses."""
        return cls(**vars(springs), influence=influence, axial=axial)

    def in_state(self, cell: CoupledInterfaces, bonds: BondState) -> SpringsAndTips:
        """Return the law at this rank's nodes with these bonds.  Collective; its methods are not.

        Raises:
            ConvergenceError: rounding hides the released energy.
        """
        self._activate(self.influence, cell.plane, bonds)
        neighbours, first = self.influence.neighbours, self.influence.neighbours.first
        everywhere = np.concatenate(neighbours.comm.allgather(bonds.status))
        beside = np.flatnonzero((everywhere == BONDED) & (neighbours.adjacency @ (everywhere != BONDED) > 0))
        mine = (beside >= first) & (beside < first + len(bonds.status))
        rows = neighbours.rows[beside][:, None] + np.arange(2)
        H, axial = self.influence.inverse_blocks(rows)[mine], np.zeros(0)
        stiffness = self.influence.stiffness[rows[mine]]
        node, number = beside[mine] - first, np.full(len(bonds.status), -1)
        if self.axial is not None:
            self._activate(self.axial, cell.problems[1], bonds)
            rows = self.axial.neighbours.rows[beside]
            axial = self.axial.inverse_blocks(np.stack([rows, rows], axis=1))[mine, 0, 0]
            stiffness = np.column_stack([stiffness, self.axial.stiffness[rows[mine]]])
        number[node] = np.arange(len(node))
        tips = TipEnergies(H, cell.nodes.length[node], stiffness, axial)
        springs = {field.name: getattr(self, field.name) for field in fields(SpringEnergy)}
        return SpringsAndTips(**springs, tips=tips, number=number, contact=cell.plane.contact)

    @staticmethod
    def _activate(influence: exact_inverse.ExactInverse, interface: ContactProblem, bonds: BondState) -> None:
        """Update the inverse to these bonds.  Collective; raises as `in_state`."""
        interface.prepare(bonds)
        if not influence.rounding <= MOST_ROUNDING:
            raise ConvergenceError(
                f'[interface] growth = "released": rounding hides {influence.rounding:.1e} of what breaks release, '
                f"expected at most {MOST_ROUNDING:g}: springs are too soft beside bodies that are cut or coated, or "
                'phases too far apart; growth = "springs" bears more'
            )


@dataclass(frozen=True, kw_only=True)
class SpringsAndTips(SpringEnergy):
    """Released energy in a state of the bonds: at tips sqrt(released / (G_c l)), at other nodes the springs.

    Attributes:
        number: (p,) tip number of a node, or -1.
        contact: whether faces do not overlap.
    """

    tips: TipEnergies
    number: Int
    contact: bool

    def share(self, traction: Float) -> Float:
        """(p,) utilisation by tractions (p, c)."""
        used, at = super().share(traction), np.flatnonzero(self.number >= 0)
        springs, tips, t = self.at(at), self.tips, self.number[at]
        length, stiffness = tips.length[t], tips.stiffness[t]
        lam = traction[at] * length[:, None]
        released = released_energy(tips.H[t], lam[:, :2], stiffness[:, :2], self.contact)
        if len(tips.axial):
            gives_way = tips.axial[t] > RIGID * stiffness[:, 2]
            along = lam[:, 2] ** 2 / np.where(gives_way, 2.0 * tips.axial[t], 1.0)
            released = released + np.where(gives_way, along, 0.0)
        used[at] = np.sqrt(released / (springs.toughness * length)) * springs.mode_factor(traction[at])
        return used

    def convex(self, p: int) -> Bool:
        """(p,) False at tips, whose released energy need not be subadditive."""
        return np.asarray(self.number < 0)


def released_energy(H: Float, lam: Float, stiffness: Float, contact: bool) -> Float:
    """(m,) energies that breaks of single bonds release, with blocks H (m, 2, 2) and forces lam (m, 2).

    `stiffness` (m, 2) bounds H: where H is rounding beside it, as at the last bond of a fibre, no force can act.  With
    `contact` faces that would overlap keep their normal force.
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
