"""Least-squares fits for the constants of the scaling study's models."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares, nnls

from feti_homog.typing import Float


@dataclass(frozen=True)
class Shares:
    """Seconds = work (serial + parallel / ranks), both >= 0."""

    serial: float
    parallel: float

    def seconds(self, work: float, ranks: float) -> float:
        """Return the seconds of `work` on `ranks` ranks."""
        return work * (self.serial + self.parallel / ranks)


@dataclass(frozen=True)
class Power:
    """Seconds = factor work^exponent."""

    factor: float
    exponent: float


def fit_shares(work: Sequence[float], ranks: Sequence[float], seconds: Sequence[float]) -> Shares:
    """Fit `Shares` by `nonnegative` least squares.

    Raises:
        ValueError: all runs are on equally many ranks, so that the shares cannot be separated.
    """
    if len(set(ranks)) < 2:
        raise ValueError("serial and parallel shares need runs on two numbers of ranks")
    w, p, t = (np.asarray(values, float) for values in (work, ranks, seconds))
    return Shares(*map(float, nonnegative(np.column_stack([w, w / p]), t, np.zeros_like(t))))


def nonnegative(columns: Float, seconds: Float, known: Float) -> Float:
    """Return x >= 0 (k,) with the least sum of squares of log((columns x + known) / seconds).

    With logarithms, twice as long and half as long are equally wrong.  `columns` (runs, k), other arrays (runs,).
    """
    relative = columns / seconds[:, None]
    scale = relative.mean(axis=0)
    start = nnls(relative / scale, 1.0 - known / seconds)[0]
    # Not at a bound, where the method has no derivative.
    start = np.maximum(start, 1e-3 * max(start.max(), 1e-3))
    found = least_squares(
        lambda x: np.log(relative / scale @ x + known / seconds), start, bounds=(0.0, np.inf), xtol=1e-12, ftol=1e-12
    )
    return np.asarray(found.x / scale)


def fit_power(work: Sequence[float], seconds: Sequence[float]) -> Power:
    """Fit a `Power` of the work by least squares of logarithms, weighted with the seconds.

    Raises:
        ValueError: all runs have equal work.
    """
    if len(set(work)) < 2:
        raise ValueError("a power needs runs of two sizes")
    x, y = np.log(work), np.log(seconds)
    exponent, constant = np.polyfit(x, y, 1, w=np.sqrt(seconds))
    return Power(float(np.exp(constant)), float(exponent))
