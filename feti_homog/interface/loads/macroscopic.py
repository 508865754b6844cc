"""Macroscopic strains and stresses of a state, and the energies between states."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from feti_homog.interface.loads.load import Load
from feti_homog.typing import Bool, Float


@dataclass(frozen=True)
class Macroscopic:
    """Strains E and the stresses Sigma that work on them, energy per area of the cell.

    A change of temperature is a strain.

    With the bonds as they are the cell stores E.Sigma / 2, and E'.Sigma = E.Sigma' of two states (Betti).

    Attributes:
        strain, stress: (n,).
    """

    strain: Float
    stress: Float

    @property
    def stored(self) -> float:
        """E.Sigma / 2."""
        return 0.5 * float(self.strain @ self.stress)

    def scaled(self, factor: float) -> Macroscopic:
        """Return the state under `factor` times the load."""
        return Macroscopic(factor * self.strain, factor * self.stress)

    def load(self, by_stress: Bool) -> Load:
        """Return the load that holds the state, with these (n,) components given by their stress."""
        return Load(np.where(by_stress, self.stress, self.strain), by_stress)

    def released_to(self, after: Macroscopic) -> float:
        """Return the energy lost by a break at constant load: 1/2 (E'.Sigma - E.Sigma'), with ' after the break.

        It is the work less the change of stored energy; at constant strain 1/2 E.(Sigma - Sigma').
        """
        return 0.5 * float(after.strain @ self.stress - self.strain @ after.stress)
