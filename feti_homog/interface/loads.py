"""Loads of a cell, by prescribed strains or their conjugate stresses, and macroscopic states."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from feti_homog.typing import Bool, Float

# Rounding error of loads relative to the ends of a leg, of fractions of a leg, and of vanishing jumps and strains.
ROUNDING = 1e-12

Multipliers = tuple[Float, ...]
"""Multipliers (owned rows,) of each problem, the plane problem first."""


@dataclass(frozen=True)
class Macroscopic:
    """The macroscopic strains E, with temperature changes, and their work conjugates Sigma.

    E.Sigma is an energy per cell area.  With fixed bonds the cell stores E.Sigma / 2, and E'.Sigma = E.Sigma' for two
    states (Betti).

    Attributes:
        strain, stress: (n,) E and Sigma.
    """

    strain: Float
    stress: Float

    @property
    def stored(self) -> float:
        """The stored energy E.Sigma / 2 per cell area."""
        return 0.5 * float(self.strain @ self.stress)

    def scaled(self, factor: float) -> Macroscopic:
        """Return the state under the load, multiplied by `factor`."""
        return Macroscopic(factor * self.strain, factor * self.stress)

    def load(self, by_stress: Bool) -> Load:
        """Return the load of this state, with stresses in the components `by_stress` (n,), else strains."""
        return Load(np.where(by_stress, self.stress, self.strain), by_stress)

    def released_to(self, after: Macroscopic) -> float:
        """Return the energy that a break releases at constant load.

        Work minus the change of stored energy is 1/2 (E'.Sigma - E.Sigma'), with ' after the break; at constant strain
        1/2 E.(Sigma - Sigma').
        """
        return 0.5 * float(after.strain @ self.stress - self.strain @ after.stress)


@dataclass(frozen=True)
class Load:
    """A load: prescribed values of n macroscopic strains, with a temperature change, or of stresses.

    Attributes:
        values: (n,) strains and stresses.
        by_stress: (n,) whether a component prescribes the stress.
    """

    values: Float
    by_stress: Bool

    @classmethod
    def strain(cls, values: Float) -> Load:
        """Make the load that prescribes strains (n,)."""
        return cls(values, np.zeros(len(values), bool))

    def parts(self, sizes: Sequence[int]) -> list[Load]:
        """Split the load into parts with given numbers of components."""
        ends = np.cumsum(sizes)[:-1]
        return [Load(*part) for part in zip(np.split(self.values, ends), np.split(self.by_stress, ends), strict=True)]

    def after(self, share: float, end: Load) -> Load:
        """Interpolate between this load and the load `end`.

        The result is (1 - share) load + share end; components that cancel are zero.
        """
        values = (1.0 - share) * self.values + share * end.values
        largest = np.abs([self.values, end.values]).max(axis=0)
        return Load(np.where(np.abs(values) <= ROUNDING * largest, 0.0, values), self.by_stress)
