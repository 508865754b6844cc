"""Loads on a cell: strains, or the stresses that work on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from feti_homog.typing import Bool, Float

# What is smaller than this, relative to its values at the ends of its leg, is what rounding leaves of zero.
LOAD_ROUNDING = 1e-13


@dataclass(frozen=True)
class Load:
    """Of each of n macroscopic strains, a change of temperature among them, its value or that of its stress.

    Attributes:
        values: (n,) strains and stresses.
        by_stress: (n,) which are stresses.
    """

    values: Float
    by_stress: Bool

    @classmethod
    def strain(cls, values: Float) -> Load:
        """Return the strains (n,)."""
        return cls(values, np.zeros(len(values), bool))

    def parts(self, sizes: Sequence[int]) -> list[Load]:
        """Return the load in parts of so many components."""
        ends = np.cumsum(sizes)[:-1]
        return [Load(*part) for part in zip(np.split(self.values, ends), np.split(self.by_stress, ends), strict=True)]

    def after(self, share: float, end: Load) -> Load:
        """Return the load after a share of the way to another one of the same kinds.

        What is left of zero by rounding is zero.
        """
        values = (1.0 - share) * self.values + share * end.values
        largest = np.abs([self.values, end.values]).max(axis=0)
        return Load(np.where(np.abs(values) <= LOAD_ROUNDING * largest, 0.0, values), self.by_stress)
