"""Solutions of all problems of a cell: in the plane and, in generalized plane strain, along the fibres."""

from __future__ import annotations

from dataclasses import dataclass

from feti_homog.feti.dual_solution import DualSolution
from feti_homog.typing import Float


class Multipliers(tuple[Float, ...]):
    """(owned rows,) multipliers of each problem, that of the plane first."""

    __slots__ = ()

    @property
    def plane(self) -> Float:
        """Multipliers in the plane."""
        return self[0]

    def towards(self, others: Multipliers, share: float) -> Multipliers:
        """Multipliers after a share of the way to others."""
        return Multipliers((1.0 - share) * a + share * b for a, b in zip(self, others, strict=True))


@dataclass(frozen=True)
class CoupledSolution:
    """Solutions with the same bonds, `parts` of each problem, that of the plane first."""

    parts: tuple[DualSolution, ...]

    @property
    def plane(self) -> DualSolution:
        """The solution in the plane."""
        return self.parts[0]

    @property
    def lam(self) -> Multipliers:
        """Their multipliers."""
        return Multipliers(each.lam for each in self.parts)

    @property
    def converged(self) -> bool:
        """Return True if the Krylov method found all."""
        return all(each.reason > 0 for each in self.parts)
