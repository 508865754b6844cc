"""What elimination on a tree of ranks takes: counted sizes of its fronts, and measured seconds of some."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, log2, sqrt
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scaling_fit import Power, fit_power, nonnegative

from feti_homog.feti.thresholds import front_sharers

if TYPE_CHECKING:
    from scaling_report import Row

VALUE_BYTES = 8
# Least share of the seconds of an elimination that a rank's own unknowns take, where its fronts seem to take all.
LEAST_OWN_SHARE = 0.1


class TimedFront(NamedTuple):
    """Seconds in which so many ranks eliminate a front of such a size, and solve with it for all loads."""

    eliminated: int
    left: int
    sharers: int
    factor: float
    solve: float


class FrontSize(NamedTuple):
    """A front: unknowns that are eliminated, those that are left, and the ranks that have met."""

    eliminated: float
    left: float
    ranks: int

    @property
    def n(self) -> float:
        """Unknowns."""
        return self.eliminated + self.left

    @property
    def sharers(self) -> int:
        """Ranks that eliminate it."""
        return front_sharers(self.n, self.ranks)

    def work(self, sharers: int) -> tuple[float, float, float, float, float]:
        """Of each sharer: multiplications of a whole front, multiplications block by block, entries that are summed,
        entries that it is told, and one call."""
        e, f = self.eliminated, self.left
        alone = e**3 / 3 + e**2 * f + e * f**2
        if sharers == 1:
            return alone, 0.0, self.n**2, 0.0, 1.0
        inverse = e**3 / 3 + e**2 * f
        return 0.0, (alone + inverse) / sharers, self.n**2 / sharers, e**2 / 2 + e * f, 1.0

    def solve_work(self, sharers: int) -> tuple[float, float]:
        """Entries that each sharer reads, and one call."""
        return (self.eliminated**2 / 2 + self.eliminated * self.left) / sharers, 1.0

    def bytes_of_a_solve(self, loads: int) -> float:
        """That pass through its first rank: both halves' unknowns, to and fro, and what it tells its sharers."""
        return VALUE_BYTES * loads * 2 * self.n * (2 if self.sharers > 1 else 1)


@dataclass(frozen=True)
class FrontRates:
    """Seconds per unit of `FrontSize.work` and of `solve_work`."""

    factor: tuple[float, ...]
    solve: tuple[float, ...]

    @classmethod
    def of(cls, timed: Sequence[TimedFront]) -> FrontRates:
        """By nonnegative least squares.

        Raises:
            ValueError: none was timed.
        """
        if not timed:
            raise ValueError("rates of fronts need a run on two ranks")
        sizes, none = [FrontSize(t.eliminated, t.left, t.sharers) for t in timed], np.zeros(len(timed))
        factor = np.array([s.work(t.sharers) for s, t in zip(sizes, timed, strict=True)])
        solve = np.array([s.solve_work(t.sharers) for s, t in zip(sizes, timed, strict=True)])
        return cls(
            tuple(nonnegative(factor, np.array([t.factor for t in timed]), none).tolist()),
            tuple(nonnegative(solve, np.array([t.solve for t in timed]), none).tolist()),
        )

    def seconds(self, fronts: Sequence[FrontSize]) -> tuple[float, float]:
        """Of the factors of all, one after the other, and of a solve."""
        factor = sum(np.dot(self.factor, front.work(front.sharers)) for front in fronts)
        solve = sum(np.dot(self.solve, front.solve_work(front.sharers)) for front in fronts)
        return float(factor), float(solve)


@dataclass(frozen=True)
class Borders:
    """Sizes of fronts relative to the root of the n unknowns of the ranks that meet there: `front` of all unknowns of
    one, `left` of those left, and `last` of the unknowns of the last front relative to the root of all."""

    front: float
    left: float
    last: float

    @classmethod
    def of(cls, counted: Sequence[tuple[int, int, FrontSize]]) -> Borders:
        """Return the largest of what was counted: n, all ranks, and a front."""
        front, left, last = 0.0, 0.0, 0.0
        for n, ranks, size in counted:
            root = sqrt(n * size.ranks / ranks)
            if size.ranks == ranks:
                last = max(last, size.n / root)
            else:
                front, left = max(front, size.n / root), max(left, size.left / root)
        return cls(front, left, last)

    def fronts(self, n: float, ranks: int) -> list[FrontSize]:
        """Those at which a rank meets others, of n unknowns on so many ranks.

        None has more unknowns than the last, to which those of a group's border belong, and half as many again.
        """
        found, most = [], self.last * sqrt(n)
        for level in range(1, ceil(log2(ranks)) + 1):
            met = min(2**level, ranks)
            root = sqrt(n * met / ranks)
            left = 0.0 if met == ranks else min(self.left * root, most)
            whole = most if met == ranks else min(self.front * root, 1.5 * most)
            found.append(FrontSize(max(whole - left, 0.0), left, met))
        return found


@dataclass(frozen=True)
class Elimination:
    """Seconds of the factor and of a solve for all loads: on one rank, `alone`, and on several those of a rank's `own`
    unknowns, and of the fronts."""

    alone_factor: Power
    alone_solve: Power
    own_factor: Power
    own_solve: Power
    borders: Borders
    rates: FrontRates

    def seconds(self, n: float, ranks: int) -> tuple[float, float]:
        """Of the factor and of a solve with n unknowns."""
        if ranks == 1:
            return self.alone_factor.seconds(n), self.alone_solve.seconds(n)
        factor, solve = self.rates.seconds(self.borders.fronts(n, ranks))
        return self.own_factor.seconds(n / ranks) + factor, self.own_solve.seconds(n / ranks) + solve


class Attributes(NamedTuple):
    """Names of what rows have of an elimination: its unknowns, seconds of the factor and of all solves of an iteration,
    and fronts; and how many solves these are."""

    unknowns: str
    factor: str
    solve: str
    fronts: str
    solves: int


OF_COARSE = Attributes("vectors", "coarse_factor", "coarse_solve", "coarse_fronts", 1)
OF_NATURAL = Attributes("kernel", "natural_factor", "natural_solve", "natural_fronts", 2)


def elimination_of(rows: Sequence[Row], cores: int, of: Attributes) -> Elimination:
    """That of these rows, of which those are timed whose ranks each have a core.

    Raises:
        ValueError: too few runs on one rank, or on several.
    """
    alone, several = ([row for row in rows if low <= row.ranks <= high] for low, high in ((1, 1), (2, cores)))
    rates = FrontRates.of([timed for row in several for timed in row.timed_fronts])
    own = [_seconds_of_own(row, rates, of) for row in several]
    sizes = _values(alone, of.unknowns)
    each = np.divide(_values(several, of.unknowns), _values(several, "ranks")).tolist()
    counted = [(getattr(row, of.unknowns), row.ranks, front) for row in rows for front in getattr(row, of.fronts)]
    return Elimination(
        alone_factor=fit_power(sizes, _values(alone, of.factor)),
        alone_solve=fit_power(sizes, _values(alone, of.solve)),
        own_factor=fit_power(each, [factor for factor, _ in own]),
        own_solve=fit_power(each, [solve for _, solve in own]),
        borders=Borders.of(counted),
        rates=FrontRates(rates.factor, tuple(of.solves * rate for rate in rates.solve)),
    )


def _values(rows: Sequence[Row], name: str) -> list[float]:
    """Return an attribute of all rows."""
    return [getattr(row, name) for row in rows]


def _seconds_of_own(row: Row, rates: FrontRates, of: Attributes) -> tuple[float, float]:
    """What the factor and the solves of an iteration take without the last front."""
    last = [front for front in getattr(row, of.fronts) if front.ranks == row.ranks]
    factor, solve = rates.seconds(last)
    found = getattr(row, of.factor), getattr(row, of.solve)
    own = found[0] - factor, found[1] - of.solves * solve
    return max(own[0], LEAST_OWN_SHARE * found[0]), max(own[1], LEAST_OWN_SHARE * found[1])
