"""The dual operator F = sum_s B K+ B^T, Eq. (36), and the compliance C of elastic bonds, on the owned rows."""

from __future__ import annotations

from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.feti.operators.interface_operators import InterfaceOperators
from feti_homog.parallel.distributed_arrays import scale_rows
from feti_homog.typing import Float


class DualOperator:
    """y = (F + C) x.  Symmetric positive definite, since B has full row rank and K+ is definite.

    Attributes:
        compliance: (owned rows,) the diagonal C.
    """

    def __init__(self, jump_operator: JumpOperator, boundary: InterfaceOperators, compliance: Float) -> None:
        self.jump_operator, self.boundary, self.compliance = jump_operator, boundary, compliance

    def apply(self, x: Float) -> Float:
        """Return sum_s B K+ B^T x + C x for x (owned rows,) or (owned rows, k)."""
        return self.jump(self.displacement(x)) + scale_rows(self.compliance, x)

    def displacement(self, lam: Float) -> Float:
        """K+ B^T lam on the boundary dofs: minus the torn cell's answer to multipliers in Eq. (34)."""
        return self.boundary.apply_flexibility(self.boundary.BT @ self.jump_operator.gather(lam))

    def jump(self, u: Float) -> Float:
        """B u, Eq. (33), for displacements u (boundary dofs,) or (boundary dofs, k)."""
        return self.jump_operator.sum(self.boundary.B @ u)
