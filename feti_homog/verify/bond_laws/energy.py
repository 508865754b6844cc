"""Energies of springs: G_I = <t_n>^2 / (2 k_n) and G_II = t_t^2 / (2 k_t) + t_a^2 / (2 k_a) reach G_c(psi)."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from feti_homog.typing import Float
from feti_homog.verify.bond_laws.law import BondLaw


class SpringEnergy(BondLaw):
    """G_I + G_II = G_c = G_Ic [1 + tan^2((1 - lambda) psi)] breaks the bond, tan^2 psi = G_II / G_I."""

    has_toughness: ClassVar[bool] = True
    has_tips: ClassVar[bool] = True

    def utilisation(self, traction: Float) -> Float:
        """(k,) sqrt(G / G_c) of the springs' energies G = G_I + G_II."""
        return np.asarray(np.sqrt(self.energies(traction).sum(axis=1) / self.lost(self.mode(traction))))

    def mode(self, traction: Float) -> Float:
        """(k,) psi of tractions (k, c)."""
        first, second = np.sqrt(self.energies(traction)).T
        return np.asarray(np.arctan2(second, first))

    def lost(self, psi: Float) -> Float:
        """(k,) G_c in the modes psi (k,)."""
        turned = (1 - np.asarray(self.section["mode_sensitivity"], float)) * psi
        return np.asarray(np.asarray(self.section["toughness"], float) * (1 + np.tan(turned) ** 2))

    def breaks(self, traction: Float) -> dict[str, float]:
        """Return the mode in degrees."""
        return {"psi": float(np.degrees(self.mode(traction))[0])}
