"""Least squares by which the scaling study finds the constants of its models."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls


@dataclass(frozen=True)
class Shares:
    """Seconds = work (serial + parallel / ranks), both >= 0."""

    serial: float
    parallel: float

    def seconds(self, work: float, ranks: float) -> float:
        """Of so much work on so many ranks."""
        return work * (self.serial + self.parallel / ranks)


@dataclass(frozen=True)
class Power:
    """Seconds = factor work^exponent."""

    factor: float
    exponent: float

    def seconds(self, work: float) -> float:
        """Of so much work."""
        return float(self.factor * work**self.exponent)


def fit_shares(work: Sequence[float], ranks: Sequence[float], seconds: Sequence[float]) -> Shares:
    """The shares with the least sum of squares of relative errors.

    Raises:
        ValueError: all runs are on equally many ranks, so that nothing tells the shares apart.
    """
    if len(set(ranks)) < 2:
        raise ValueError("serial and parallel shares need runs on two numbers of ranks")
    w, p, t = (np.asarray(values, float) for values in (work, ranks, seconds))
    serial, parallel = nnls(np.column_stack([w / t, w / p / t]), np.ones(len(t)))[0]
    return Shares(float(serial), float(parallel))


def fit_power(work: Sequence[float], seconds: Sequence[float]) -> Power:
    """The power of the work with the least sum of squares of logarithms, each times the seconds.

    Raises:
        ValueError: all runs have equal work.
    """
    if len(set(work)) < 2:
        raise ValueError("a power needs runs of two sizes")
    x, y = np.log(work), np.log(seconds)
    exponent, constant = np.polyfit(x, y, 1, w=np.sqrt(seconds))
    return Power(float(np.exp(constant)), float(exponent))
