"""Strengths: the largest share of the components, or the root of the sum of their squares."""

from __future__ import annotations

import numpy as np

from feti_homog.typing import Float
from feti_homog.verify.bond_laws.law import BondLaw


class MaxStrength(BondLaw):
    """The component that is nearest to its strength breaks the bond."""

    def utilisation(self, traction: Float) -> Float:
        """(k,) largest share of a component."""
        return np.asarray(self.shares(traction).max(axis=1, initial=0.0))

    def breaks(self, traction: Float) -> dict[str, float]:
        """Shares of the components."""
        return dict(zip(("normal", "tangential", "axial"), self.shares(traction)[0].tolist(), strict=False))


class QuadraticStrength(MaxStrength):
    """All components together break the bond."""

    def utilisation(self, traction: Float) -> Float:
        """(k,) root of the sum of the squares of all shares."""
        return np.asarray(np.sqrt(np.square(self.shares(traction)).sum(axis=1)))
