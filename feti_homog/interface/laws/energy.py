"""Break by energy of the bonds of an elastic interface (LEBIM).

Tavara, Mantic, Graciani, Paris, Eng. Anal. Bound. Elem. 35 (2011) 207; the mode-mixity law is Hutchinson and Suo's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from feti_homog.interface.contact.states import BondState
from feti_homog.interface.laws.bond_law import BondLaw, KeyValues
from feti_homog.typing import Bool, Float


@dataclass(frozen=True)
class SpringEnergy(BondLaw):
    """A bond breaks when the energy of its spring reaches the toughness.

    G_I = <t_n>^2 / (2 k_n), G_II = t_t^2 / (2 k_t), tan^2 psi = G_II / G_I;
    G_I + G_II = G_c = G_Ic [1 + tan^2((1 - lambda) psi)].

    A traction along the fibre adds G_III = t_a^2 / (2 k_a) to G_II: all shear counts alike.

    The attributes are those of all nodes, or (k,) of each.

    Attributes:
        normal_stiffness, tangential_stiffness: k_n and k_t, stress per length.
        toughness: G_Ic, energy per area.
        mode_sensitivity: lambda; 1 lets G_c not depend on the mode, 0 lets shear alone break nothing.
        axial_stiffness: k_a, along the fibre.
    """

    normal_stiffness: float | Float
    tangential_stiffness: float | Float
    toughness: float | Float
    mode_sensitivity: float | Float
    axial_stiffness: float | Float = math.inf

    has_toughness: ClassVar[bool] = True
    has_tips: ClassVar[bool] = True
    break_names: ClassVar[tuple[str, ...]] = ("psi",)

    @classmethod
    def of_keys(cls, value: KeyValues) -> Self:
        """Make the law from stiffnesses and toughness; that along the fibre is the tangential one by default."""
        return cls(
            value("normal_stiffness"),
            value("tangential_stiffness"),
            value("toughness"),
            value("mode_sensitivity"),
            value("axial_stiffness", "tangential_stiffness"),
        )

    def mode_factor(self, traction: Float) -> Float:
        """(k,) sqrt(G_Ic / G_c) of the modes of tractions (k, 2)."""
        # 1 / (1 + tan^2 x) = cos^2 x
        return np.asarray(np.cos((1.0 - self.mode_sensitivity) * self.mode_angle(traction)))

    def share(self, traction: Float) -> Float:
        """(k,) sqrt((G_I + G_II) / G_c) of tractions (k, 2).

        Normal and tangential, or (k, 3), also along the fibre: 1 breaks.

        Homogeneous of degree one in the traction, for psi does not depend on its size, and convex.
        """
        return np.asarray(np.hypot(*self._roots(traction)) * self.mode_factor(traction) / np.sqrt(self.toughness))

    def fracture_toughness(self, traction: Float) -> Float:
        """(k,) G_c of the modes of tractions (k, 2), energy per area."""
        return np.asarray(self.toughness / self.mode_factor(traction) ** 2)

    def fracture(self, bonds: BondState, which: Bool, traction: Float) -> Float:
        """(p,) G_c of the bonds `which` (k,) in the modes of tractions (k, c)."""
        return self.at(np.flatnonzero(which)).fracture_toughness(traction[which])

    def breaks(self, traction: Float) -> Float:
        """(p, 1) psi of tractions (p, c), in degrees."""
        return np.degrees(self.mode_angle(traction))[:, None]

    def mode_angle(self, traction: Float) -> Float:
        """(k,) psi of tractions (k, 2), in radians: 0 opens, pi/2 shears, under pressure too."""
        opening, shear = self._roots(traction)
        return np.asarray(np.arctan2(shear, opening))

    def _roots(self, traction: Float) -> tuple[Float, Float]:
        """(k,) sqrt(G_I) and sqrt(G_II), with G_III in the latter."""
        opening = np.maximum(traction[:, 0], 0.0) / np.sqrt(2.0 * self.normal_stiffness)
        shear = np.abs(traction[:, 1]) / np.sqrt(2.0 * self.tangential_stiffness)
        if traction.shape[1] == 3:
            shear = np.hypot(shear, traction[:, 2] / np.sqrt(2.0 * self.axial_stiffness))
        return opening, shear
