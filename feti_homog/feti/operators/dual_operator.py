"""The dual operator F = sum_s B K+ B^T, Eq. (36), on the owned rows of multiplier vectors."""

from __future__ import annotations

from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.feti.operators.interface_operators import InterfaceOperators
from feti_homog.typing import Float


class DualOperator:
    """y = F x.  Symmetric positive definite, since B has full row rank and K+ is definite."""

    def __init__(self, jump_operator: JumpOperator, boundary: InterfaceOperators) -> None:
        self.jump_operator, self.boundary = jump_operator, boundary

    def apply(self, x: Float) -> Float:
        """sum_s B K+ B^T x for x (owned rows,) or (owned rows, k)."""
        return self.jump(self.displacement(x))

    def displacement(self, lam: Float) -> Float:
        """K+ B^T lam on the boundary dofs: minus the torn cell's answer to multipliers in Eq. (34)."""
        return self.boundary.apply_flexibility(self.boundary.BT @ self.jump_operator.gather(lam))

    def jump(self, u: Float) -> Float:
        """B u, Eq. (33), for displacements u (boundary dofs,) or (boundary dofs, k)."""
        return self.jump_operator.sum(self.boundary.B @ u)
