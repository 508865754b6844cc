"""Mean, scatter and confidence interval of the mean over realisations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from feti_homog.typing import Float

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Statistics:
    """Over the realisations that are done, (points, ...): `ci95` is half the width of the 95 % confidence interval of
    the mean by Student's t; it and `std` are NaN of fewer than two."""

    count: Float
    mean: Float
    std: Float
    ci95: Float

    @classmethod
    def of(cls, samples: Float) -> Statistics:
        """Over the first axis of samples (n, ...), without those that are NaN."""
        known = np.isfinite(samples)
        count = known.sum(axis=0)
        several = np.where(count > 1, count, np.nan)
        mean = np.where(known, samples, 0.0).sum(axis=0) / np.where(count > 0, count, np.nan)
        std = np.sqrt(np.where(known, (samples - mean) ** 2, 0.0).sum(axis=0) / (several - 1))
        return cls(count.astype(float), mean, std, student.ppf(0.5 + CONFIDENCE / 2, several - 1) * std / several**0.5)
