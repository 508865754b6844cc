"""Softening branches of cohesive laws: how the traction falls from its peak."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from feti_homog.interface.laws.bond_law import KeyValues
from feti_homog.interface.laws.cohesive import CohesiveLaw
from feti_homog.typing import Float

# The last tooth begins where an exponential traction has fallen to this share of its peak.
EXPONENTIAL_TAIL = 0.01
NEWTON_STEPS = 60


@dataclass(frozen=True)
class PiecewiseLinear(CohesiveLaw):
    """tau falls in straight lines between `knots` (m,) with the values `heights` (m,), from 1 to 0."""

    knots: tuple[float, ...] = (0.0, 1.0)
    heights: tuple[float, ...] = (1.0, 0.0)

    @property
    def last(self) -> float:
        """Return where tau is none at first."""
        return self.knots[self.heights.index(0.0)]

    def shape(self, u: Float) -> Float:
        """tau(u) of u >= 0."""
        return np.interp(u, self.knots, self.heights)

    def area(self, u: Float | float) -> Float | float:
        """int_0^u tau."""
        u = np.minimum(u, self.last)
        if len(self.knots) == 2:
            return np.asarray(u - u**2 / (2.0 * self.knots[1]))
        knots, heights = np.array(self.knots), np.array(self.heights)
        areas = np.concatenate([[0.0], np.cumsum(np.diff(knots) * (heights[1:] + heights[:-1]) / 2.0)])
        k = np.clip(np.searchsorted(knots, u, side="right") - 1, 0, len(knots) - 2)
        return np.asarray(areas[k] + (u - knots[k]) * (heights[k] + self.shape(np.asarray(u))) / 2.0)

    def opening(self, d: Float, s: Float | float) -> Float:
        """(p,) the u with tau(u) = (1 - d) (1 + s u), in the piece where that changes sign."""
        if len(self.knots) == 2:
            return np.asarray(d / ((1.0 - d) * s + 1.0 / self.knots[1]))
        knots, heights = np.array(self.knots), np.array(self.heights)
        kept = 1.0 - np.asarray(d)
        above = heights - kept[..., None] * (1.0 + np.asarray(s)[..., None] * knots) >= 0.0
        k = np.clip(above.sum(axis=-1) - 1, 0, len(knots) - 2)
        slope = (heights[k + 1] - heights[k]) / (knots[k + 1] - knots[k])
        # tau_k + slope (u - u_k) = kept + kept s u
        return np.asarray((heights[k] - slope * knots[k] - kept) / (kept * s - slope))


@dataclass(frozen=True)
class Bilinear(PiecewiseLinear):
    """Traction falls in a straight line."""


@dataclass(frozen=True)
class Table(PiecewiseLinear):
    """Traction over opening in mode I from a table; in other modes the branch is stretched to their toughness."""

    @classmethod
    def branch(cls, value: KeyValues) -> dict[str, Any]:
        """Return knots and heights from the openings and tractions, the first of which are those of the peak."""
        openings, tractions = np.array(value.common("openings")), np.array(value.common("tractions"))
        return {"knots": tuple(openings / openings[0] - 1.0), "heights": tuple(tractions / tractions[0])}


@dataclass(frozen=True)
class Exponential(CohesiveLaw):
    """tau = exp(-u)."""

    @property
    def last(self) -> float:
        """Return where little is left."""
        return -math.log(EXPONENTIAL_TAIL)

    def shape(self, u: Float) -> Float:
        """exp(-u)."""
        return np.asarray(np.exp(-u))

    def area(self, u: Float | float) -> Float | float:
        """1 - exp(-u)."""
        return np.asarray(-np.expm1(-np.asarray(u)))

    def opening(self, d: Float, s: Float | float) -> Float:
        """(p,) the root of u + ln(1 + s u) = -ln(1 - d), which Newton's method reaches from below."""
        right = -np.log1p(-np.asarray(d))
        u = right / (1.0 + s)
        for _ in range(NEWTON_STEPS):
            step = (right - u - np.log1p(s * u)) / (1.0 + s / (1.0 + s * u))
            u = u + step
            if np.abs(step).max(initial=0.0) <= 4.0 * np.finfo(float).eps * np.abs(u).max(initial=0.0):
                break
        return np.asarray(u)
