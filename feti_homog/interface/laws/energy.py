"""Energy criteria for the bonds of an elastic interface (linear elastic-brittle interface model, LEBIM).

Tavara, Mantic, Graciani, Paris, Eng. Anal. Bound. Elem. 35 (2011) 207; the mode-mixity law is Hutchinson and Suo's.

At a debonding tip the released energy is decisive.  The spring energy at a tip falls with the tributary length of the
node, so a criterion by spring energy depends on the mesh; a criterion by released energy does not.  With H the inverse
of the dual operator on the active rows and nodal forces lam, a break of bond i parts the faces by j = H_ii^-1 lam_i,
and the energy of the cell falls, at constant strain, by

    1/2 lam_i . H_ii^-1 lam_i;  1/2 lam_t^2 / H_tt if the faces would overlap, and therefore keep the normal force.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np

from feti_homog.errors import ConvergenceError
from feti_homog.interface.contact import BONDED, BondState, ContactProblem, CoupledInterfaces
from feti_homog.interface.laws.bond_law import UTILISATION_TIE, SectionValues, SpringLaw
from feti_homog.typing import Bool, Float, Int

if TYPE_CHECKING:
    from feti_homog.feti.exact import exact_inverse

# Fraction of the stiffness beside a bond below which blocks of H are rounding errors.
RIGID = 1e-9


@dataclass(frozen=True)
class SpringEnergy(SpringLaw):
    """The law in which a bond breaks when its spring energy reaches the toughness G_c of its mode angle psi.

        G_I = <t_n>^2 / (2 k_n), G_II = t_t^2 / (2 k_t), tan^2 psi = G_II / G_I;
        G_I + G_II = G_c = G_Ic [1 + tan^2((1 - lambda) psi)],

    with normal traction t_n, <x> = max(x, 0), shear t_t; along the fibre t_a adds G_III = t_a^2 / (2 k_a) to G_II.

    Attributes:
        toughness: G_Ic, energy per area.
        mode_sensitivity: lambda; at 1, G_c is independent of the mode; at 0, pure shear breaks no bond.
    """

    normal_stiffness: float | Float
    tangential_stiffness: float | Float
    toughness: float | Float
    mode_sensitivity: float | Float
    axial_stiffness: float | Float = math.inf

    has_tips: ClassVar[bool] = True

    @classmethod
    def of_keys(cls, value: SectionValues) -> Self:
        """Make the law from [interface] keys; the axial stiffness defaults to the tangential stiffness."""
        return cls(
            value("normal_stiffness"),
            value("tangential_stiffness"),
            value("toughness"),
            value("mode_sensitivity"),
            value("axial_stiffness", "tangential_stiffness"),
        )

    def mode_factor(self, traction: Float) -> Float:
        """Return sqrt(G_Ic / G_c) (p,), by which the mode of tractions (p, c) reduces the utilisation."""
        # 1 / (1 + tan^2 x) = cos^2 x
        return np.asarray(np.cos((1.0 - self.mode_sensitivity) * self.mode_angle(traction)))

    def share(self, traction: Float) -> Float:
        """Return the utilisation sqrt((G_I + G_II) / G_c) (p,) under tractions (p, c).

        The utilisation is convex, and homogeneous of degree one because psi is independent of the size of the traction.
        """
        return np.asarray(np.sqrt(sum(self.energies(traction)) / self.toughness) * self.mode_factor(traction))

    def fracture_toughness(self, traction: Float) -> Float:
        """Return the toughness G_c (p,), an energy per area, for the modes of tractions (p, c)."""
        return np.asarray(self.toughness / self.mode_factor(traction) ** 2)

    def fracture(self, bonds: BondState, which: Bool, traction: Float) -> Float:
        """Return the toughness G_c (p,) of the bonds in the mask `which` (k,) under tractions (k, c)."""
        return self.at(np.flatnonzero(which)).fracture_toughness(traction[which])


@dataclass(frozen=True)
class TipEnergies:
    """Data for the released energies at this rank's t debonding tips, which are intact bonds beside broken bonds.

    Attributes:
        H: (t, 2, 2) diagonal blocks of the inverse dual operator.
        length: (t,) tributary lengths.
        stiffness: (t, c) upper bounds for the diagonals of H and for `axial`, see `ExactInverse.stiffness`.
        axial: (t,) H for slip along the fibres; empty without an axial problem.
    """

    H: Float
    length: Float
    stiffness: Float
    axial: Float


@dataclass(frozen=True, kw_only=True)
class ReleasedEnergy(SpringEnergy):
    """The law in which bonds at tips break by the released energy.

    A bond at a tip breaks when its break releases G_c l, with tributary length l; other bonds break when their spring
    energy reaches G_c.

    Attributes:
        influence: inverse dual operator of the plane problem.
        axial: inverse dual operator for slip along the fibres; None without an axial problem.
    """

    influence: exact_inverse.ExactInverse
    axial: exact_inverse.ExactInverse | None = None

    def in_state(self, cell: CoupledInterfaces, bonds: BondState) -> SpringsAndTips:
        """Return the law at this rank's nodes in a bond state.  Collective; methods of the returned law are not.

        Sets the bond state of the solvers.  Raises ConvergenceError if rounding hides the released energy.
        """
        self._activate(self.influence, cell.plane, bonds)
        neighbours, first = self.influence.neighbours, self.influence.neighbours.first
        all_status = np.concatenate(neighbours.comm.allgather(bonds.status))
        at_tips = np.flatnonzero((all_status == BONDED) & (neighbours.adjacency @ (all_status != BONDED) > 0))
        is_local = (at_tips >= first) & (at_tips < first + len(bonds.status))
        rows = neighbours.rows[at_tips][:, None] + np.arange(2)
        H = self.influence.inverse_blocks(rows)[is_local]
        stiffness, axial = self.influence.stiffness[rows[is_local]], np.zeros(0)
        if self.axial is not None:
            self._activate(self.axial, cell.problems[1], bonds)
            axial_rows = self.axial.neighbours.rows[at_tips]
            axial = self.axial.inverse_blocks(np.stack([axial_rows, axial_rows], axis=1))[is_local, 0, 0]
            stiffness = np.column_stack([stiffness, self.axial.stiffness[axial_rows[is_local]]])
        node, number = at_tips[is_local] - first, np.full(len(bonds.status), -1)
        number[node] = np.arange(len(node))
        tips = TipEnergies(H, cell.nodes.length[node], stiffness, axial)
        springs = {field.name: getattr(self, field.name) for field in fields(SpringEnergy)}
        return SpringsAndTips(**springs, tips=tips, number=number, contact=cell.plane.contact)

    @staticmethod
    def _activate(influence: exact_inverse.ExactInverse, interface: ContactProblem, bonds: BondState) -> None:
        """Update the inverse dual operator to a bond state.  Collective; raises like `in_state`."""
        interface.prepare(bonds)
        if not influence.rounding <= UTILISATION_TIE:
            raise ConvergenceError(
                f'[interface] growth = "released": rounding hides {influence.rounding:.1e} of the released energy, '
                f"expected at most {UTILISATION_TIE:g}: springs are too soft beside bodies that are cut or coated, or "
                'phases too far apart; growth = "springs" tolerates more'
            )


@dataclass(frozen=True, kw_only=True)
class SpringsAndTips(SpringEnergy):
    """The law in one bond state: utilisation sqrt(released energy / (G_c l)) at tips, as in `SpringEnergy` elsewhere.

    Attributes:
        tips: tips of this rank.
        number: (p,) tip number of each node, -1 for nodes that are no tips.
        contact: whether contact prevents overlap of faces.
    """

    tips: TipEnergies
    number: Int
    contact: bool

    def share(self, traction: Float) -> Float:
        """Return the utilisation (p,) under tractions (p, c)."""
        used, at_tips = super().share(traction), np.flatnonzero(self.number >= 0)
        springs, tips, t = self.at(at_tips), self.tips, self.number[at_tips]
        length, stiffness = tips.length[t], tips.stiffness[t]
        lam = traction[at_tips] * length[:, None]
        released = released_energy(tips.H[t], lam[:, :2], stiffness[:, :2], self.contact)
        if len(tips.axial):
            gives_way = tips.axial[t] > RIGID * stiffness[:, 2]
            along = lam[:, 2] ** 2 / np.where(gives_way, 2.0 * tips.axial[t], 1.0)
            released = released + np.where(gives_way, along, 0.0)
        used[at_tips] = np.sqrt(released / (springs.toughness * length)) * springs.mode_factor(traction[at_tips])
        return used

    def convex(self, p: int) -> Bool:
        """Return the mask (p,) of nodes with convex `share`: all but tips, whose energies need not be convex."""
        return np.asarray(self.number < 0)


def released_energy(H: Float, lam: Float, stiffness: Float, contact: bool) -> Float:
    """Return the energy (m,) that each break would release, from blocks H (m, 2, 2) and forces `lam` (m, 2).

    `stiffness` (m, 2) bounds the diagonals of H.  Where H is a rounding error relative to this bound, as at the last
    bond of a fibre, no force can act.  With `contact`, faces that would overlap keep the normal force.
    """
    root = np.sqrt(stiffness)
    ratio, vectors = np.linalg.eigh(H / (root[:, :, None] * root[:, None, :]))
    along = np.einsum("mij,mi->mj", vectors, lam / root)
    inverse = np.where(ratio > RIGID, 1.0 / np.where(ratio > RIGID, ratio, 1.0), 0.0)
    opens = (np.einsum("mj,mj->m", vectors[:, 0], inverse * along) >= 0.0) | (not contact)
    both, tangential = (inverse * along**2).sum(axis=1), H[:, 1, 1] / stiffness[:, 1]
    slides = tangential > RIGID
    shear = np.where(slides, lam[:, 1] ** 2 / stiffness[:, 1] / np.where(slides, tangential, 1.0), 0.0)
    return np.asarray(np.where(opens, both, shear) / 2)
