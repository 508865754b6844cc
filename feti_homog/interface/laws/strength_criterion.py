"""Strength of the bond between a fibre and the matrix."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from feti_homog.interface.contact.contact_problem import Status
from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.typing import Float, Int


@dataclass(frozen=True)
class StrengthCriterion:
    """Limits of the traction on a bonded face, force per area; compression never breaks a bond.

    Strengths are those of all nodes, or (k,) of each.

    Attributes:
        normal, tangential: strengths R^n and R^t, inf where there is none.
        criterion: "max", the larger of t_n / R^n and |t_t| / R^t (the paper's), or "quadratic", the root of the
            sum of their squares.
        axial: strength R^a along the fibre, whose share |t_a| / R^a counts like the others.
    """

    normal: float | Float
    tangential: float | Float
    criterion: str
    axial: float | Float = math.inf

    def at(self, node: Int) -> StrengthCriterion:
        """That of the nodes (p,), one after the other."""
        normal, tangential, axial = (at_nodes(value, node) for value in (self.normal, self.tangential, self.axial))
        return StrengthCriterion(normal, tangential, self.criterion, axial)

    def law(self, cell: CoupledInterfaces, status: Status) -> Callable[[Float], Float]:
        """`utilisation`, whatever is debonded."""
        return self.utilisation

    def utilisation(self, traction: Float) -> Float:
        """(k,) share of the strength that tractions use, normal and tangential (k, 2), or along the fibre too (k, 3): 1
        breaks.

        Homogeneous of degree one in the traction.
        """
        shares = self.shares(traction)
        if self.criterion == "max":
            return np.asarray(shares.max(axis=1, initial=0.0))
        return np.asarray(np.hypot.reduce(shares, axis=1))

    def shares(self, traction: Float) -> Float:
        """(k, c) what each component of tractions (k, c) is of its strength."""
        pulls = np.abs(traction)
        pulls[:, 0] = np.maximum(traction[:, 0], 0.0)
        return np.asarray(pulls / self.limits[..., : traction.shape[1]])

    def factor(self, before: Float, ahead: Float) -> Float:
        """(k,) the least f >= 0 at which `before` + f `ahead`, tractions (k, c), break; inf where none does.  `before`
        breaks nothing."""
        limits = self.limits[..., : before.shape[1]]
        s, ds = before / limits, ahead / limits
        if self.criterion == "max":
            towards = np.abs(ds)
            towards[:, 0] = np.maximum(ds[:, 0], 0.0)
            left = 1.0 - np.sign(ds) * s
            return np.asarray(np.divide(left, towards, out=np.full_like(s, np.inf), where=towards > 0).min(axis=1))
        # Where the sum of all squares reaches 1 under tension, and else that of the shears: compression has no share.
        opening, shear = _largest_root(s, ds), _largest_root(s[:, 1:], ds[:, 1:])
        opens = (opening >= 0.0) & np.isfinite(opening)
        opens &= s[:, 0] + np.where(opens, opening, 0.0) * ds[:, 0] >= 0.0
        return np.asarray(np.where(opens, opening, shear))

    @property
    def limits(self) -> Float:
        """(3,) or (k, 3) the strengths."""
        return np.stack(np.broadcast_arrays(self.normal, self.tangential, self.axial), axis=-1)


def at_nodes(value: float | Float, node: Int) -> float | Float:
    """A value of all nodes, or those (k,) of each, at the nodes (p,)."""
    return value[node] if isinstance(value, np.ndarray) else value


def _largest_root(s: Float, ds: Float) -> Float:
    """(k,) the largest f with |s + f ds| = 1, for vectors (k, c); NaN where there is none, inf where ds = 0."""
    a, b, c = (ds * ds).sum(axis=1), (s * ds).sum(axis=1), (s * s).sum(axis=1) - 1.0
    with np.errstate(invalid="ignore", divide="ignore"):
        root = np.sqrt(b * b - a * c)
        found = np.where(b > 0.0, -c / (b + root), (root - b) / a)
    return np.asarray(np.where(a > 0.0, found, np.inf))
