"""Loads of a cell: prescribed strains, or the stresses that work on them; and macroscopic states."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from feti_homog.typing import Bool, Float

# Rounding of loads relative to the ends of their leg, of fractions of a leg, and of vanishing jumps and strains.
ROUNDING = 1e-12

Multipliers = tuple[Float, ...]
"""Multipliers (owned rows,) of each problem, the plane first."""


@dataclass(frozen=True)
class Macroscopic:
    """Strains E, including temperature changes, and their work conjugates Sigma, energy per cell area.

    With fixed bonds the cell stores E.Sigma / 2, and E'.Sigma = E.Sigma' for two states (Betti).

    Attributes:
        strain, stress: (n,).
    """

    strain: Float
    stress: Float

    @property
    def stored(self) -> float:
        """Stored energy E.Sigma / 2."""
        return 0.5 * float(self.strain @ self.stress)

    def scaled(self, factor: float) -> Macroscopic:
        """Return the state under `factor` times the load."""
        return Macroscopic(factor * self.strain, factor * self.stress)

    def load(self, by_stress: Bool) -> Load:
        """Return the load that prescribes stresses in the components `by_stress` (n,), else strains."""
        return Load(np.where(by_stress, self.stress, self.strain), by_stress)

    def released_to(self, after: Macroscopic) -> float:
        """Return the energy that a break releases at constant load: work minus change of stored energy.

        1/2 (E'.Sigma - E.Sigma'), with ' after the break; at constant strain 1/2 E.(Sigma - Sigma').
        """
        return 0.5 * float(after.strain @ self.stress - self.strain @ after.stress)


@dataclass(frozen=True)
class Load:
    """Prescribed values of n macroscopic strains, including a temperature change, or of their stresses.

    Attributes:
        values: (n,) strains and stresses.
        by_stress: (n,) True for stresses.
    """

    values: Float
    by_stress: Bool

    @classmethod
    def strain(cls, values: Float) -> Load:
        """Prescribe strains (n,)."""
        return cls(values, np.zeros(len(values), bool))

    def parts(self, sizes: Sequence[int]) -> list[Load]:
        """Split the load into parts of these sizes."""
        ends = np.cumsum(sizes)[:-1]
        return [Load(*part) for part in zip(np.split(self.values, ends), np.split(self.by_stress, ends), strict=True)]

    def after(self, share: float, end: Load) -> Load:
        """Interpolate to the load `end`: (1 - share) load + share end; components that cancel are zero."""
        values = (1.0 - share) * self.values + share * end.values
        largest = np.abs([self.values, end.values]).max(axis=0)
        return Load(np.where(np.abs(values) <= ROUNDING * largest, 0.0, values), self.by_stress)
