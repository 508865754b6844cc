"""Strength criteria: a bond breaks at a limit of the traction, force per area; compression breaks no bond."""

import math
from abc import abstractmethod
from dataclasses import dataclass
from typing import Self

import numpy as np

from feti_homog.interface.laws.bond_law import BondLaw, SectionValues
from feti_homog.typing import Float


@dataclass(frozen=True)
class Strength(BondLaw):
    """Base class of criteria that combine the utilisations of traction components.

    Attributes:
        normal, tangential: strengths R^n and R^t, numbers or (p,) at p nodes; inf without a limit.
        axial: strength R^a along the fibre, a number or (p,); inf without a limit.
    """

    normal: float | Float
    tangential: float | Float
    axial: float | Float = math.inf

    @classmethod
    def of_keys(cls, value: SectionValues) -> Self:
        """Make the law from [interface] keys; the axial strength defaults to the tangential strength."""
        axial = value("axial_strength", "tangential_strength")
        return cls(value("normal_strength"), value("tangential_strength"), axial)

    def share(self, traction: Float) -> Float:
        """Return the utilisation (p,) under tractions (p, c)."""
        return self.together(self.breaks(traction))

    @abstractmethod
    def together(self, shares: Float) -> Float:
        """Combine the utilisations (p, c) of traction components to node utilisations (p,)."""

    def breaks(self, traction: Float) -> Float:
        """Return the utilisations (p, c) of traction components (p, c), relative to their strengths; 0 for pressure."""
        pulls = np.abs(traction)
        pulls[:, 0] = np.maximum(traction[:, 0], 0.0)
        return np.asarray(pulls / self.limits[..., : traction.shape[1]])

    @property
    def limits(self) -> Float:
        """The strengths [normal, tangential, axial], (3,) or (p, 3)."""
        return np.stack(np.broadcast_arrays(self.normal, self.tangential, self.axial), axis=-1)


class MaxStrength(Strength):
    """The paper's criterion: a bond breaks at max(<t_n> / R^n, |t_t| / R^t, |t_a| / R^a) = 1; <x> is max(x, 0)."""

    def together(self, shares: Float) -> Float:
        """Return the largest utilisation (p,) among the components (p, c)."""
        return np.asarray(shares.max(axis=1, initial=0.0))

    def first_factor(self, before: Float, direction: Float) -> Float:
        """Return the load factors (p,) at which a component first reaches its strength; see `BondLaw.first_factor`."""
        limits = self.limits[..., : before.shape[1]]
        s, ds = before / limits, direction / limits
        towards = np.abs(ds)
        towards[:, 0] = np.maximum(ds[:, 0], 0.0)
        room = 1.0 - np.sign(ds) * s
        return np.asarray(np.divide(room, towards, out=np.full_like(s, np.inf), where=towards > 0).min(axis=1))


class QuadraticStrength(Strength):
    """The quadratic criterion: (<t_n> / R^n)^2 + (t_t / R^t)^2 + (t_a / R^a)^2 = 1 at a break; <x> is max(x, 0)."""

    def together(self, shares: Float) -> Float:
        """Return the root (p,) of the sum of squared utilisations (p, c)."""
        return np.asarray(np.hypot.reduce(shares, axis=1))

    def first_factor(self, before: Float, direction: Float) -> Float:
        """Return the load factors (p,) at which squared utilisations sum to 1; see `BondLaw.first_factor`."""
        limits = self.limits[..., : before.shape[1]]
        s, ds = before / limits, direction / limits
        opening, shear = _largest_root(s, ds), _largest_root(s[:, 1:], ds[:, 1:])
        opens = (opening >= 0.0) & np.isfinite(opening)
        opens &= s[:, 0] + np.where(opens, opening, 0.0) * ds[:, 0] >= 0.0
        return np.asarray(np.where(opens, opening, shear))


def _largest_root(s: Float, ds: Float) -> Float:
    """Return the largest f (k,) with |s + f ds| = 1, for vectors s, ds (k, c); NaN without a root, inf for ds = 0."""
    a, b, c = (ds * ds).sum(axis=1), (s * ds).sum(axis=1), (s * s).sum(axis=1) - 1.0
    with np.errstate(invalid="ignore", divide="ignore"):
        root = np.sqrt(b * b - a * c)
        factor = np.where(b > 0.0, -c / (b + root), (root - b) / a)
    return np.asarray(np.where(a > 0.0, factor, np.inf))
