"""Solutions of both problems of a cell: in the plane, and along the fibres in generalized plane strain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from feti_homog.feti.dual_solution import DualSolution
from feti_homog.typing import Float


class Multipliers(NamedTuple):
    """(owned rows,) multipliers in the plane, and along the fibres; the latter empty without such a problem."""

    plane: Float
    axial: Float

    def towards(self, others: Multipliers, share: float) -> Multipliers:
        """Those after a share of the way to others."""
        return Multipliers(*((1.0 - share) * a + share * b for a, b in zip(self, others, strict=True)))


@dataclass(frozen=True)
class CoupledSolution:
    """Solutions with the same bonds; `axial` is None without such a problem."""

    plane: DualSolution
    axial: DualSolution | None

    @property
    def lam(self) -> Multipliers:
        """Their multipliers."""
        return Multipliers(self.plane.lam, np.zeros(0) if self.axial is None else self.axial.lam)

    @property
    def converged(self) -> bool:
        """Whether the Krylov method found both."""
        return self.plane.reason > 0 and (self.axial is None or self.axial.reason > 0)
