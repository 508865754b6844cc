"""Strength of the bond between a fibre and the matrix."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from feti_homog.interface.contact import Interface, Status
from feti_homog.typing import Float


@dataclass(frozen=True)
class StrengthCriterion:
    """Limits of the traction on a bonded face, force per area; compression never breaks a bond.

    Attributes:
        normal, tangential: strengths R^n and R^t, inf where there is none.
        criterion: "max", the larger of t_n / R^n and |t_t| / R^t (the paper's), or "quadratic", the root of the
            sum of their squares.
    """

    normal: float
    tangential: float
    criterion: str

    def law(self, interface: Interface, status: Status) -> Callable[[Float], Float]:
        """`utilisation`, whatever is debonded."""
        return self.utilisation

    def utilisation(self, traction: Float) -> Float:
        """(k,) share of the strength that tractions (k, 2), normal and tangential, use: 1 breaks.

        Homogeneous of degree one in the traction.
        """
        shares = np.maximum(traction * [1.0, 0.0], 0.0) + np.abs(traction * [0.0, 1.0])
        shares /= [self.normal, self.tangential]
        if self.criterion == "max":
            return np.asarray(shares.max(axis=1, initial=0.0))
        return np.asarray(np.hypot(*shares.T))
