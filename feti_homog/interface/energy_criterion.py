"""Break by energy of the bonds of an elastic interface (LEBIM).

Tavara, Mantic, Graciani, Paris, Eng. Anal. Bound. Elem. 35 (2011) 207; the mode-mixity law is Hutchinson and Suo's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from feti_homog.typing import Float


@dataclass(frozen=True)
class EnergyCriterion:
    """A bond breaks when the energy of its spring reaches the toughness.

    G_I = <t_n>^2 / (2 k_n), G_II = t_t^2 / (2 k_t), tan^2 psi = G_II / G_I;
    G_I + G_II = G_c = G_Ic [1 + tan^2((1 - lambda) psi)].

    Attributes:
        normal_stiffness, tangential_stiffness: k_n and k_t, stress per length.
        toughness: G_Ic, energy per area.
        mode_sensitivity: lambda; 1 lets G_c not depend on the mode, 0 lets shear alone break nothing.
    """

    normal_stiffness: float
    tangential_stiffness: float
    toughness: float
    mode_sensitivity: float

    def utilisation(self, traction: Float) -> Float:
        """(k,) sqrt((G_I + G_II) / G_c) of tractions (k, 2), normal and tangential: 1 breaks.

        Homogeneous of degree one in the traction, for psi does not depend on its size, and convex.
        """
        opening = np.maximum(traction[:, 0], 0.0) / np.sqrt(2.0 * self.normal_stiffness)
        shear = np.abs(traction[:, 1]) / np.sqrt(2.0 * self.tangential_stiffness)
        psi = np.arctan2(shear, opening)
        # 1 / (1 + tan^2 x) = cos^2 x
        used = np.hypot(opening, shear) * np.cos((1.0 - self.mode_sensitivity) * psi)
        return np.asarray(used / np.sqrt(self.toughness))
