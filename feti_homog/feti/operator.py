"""The dual operator F = sum_s B K+ B^T, Eq. (36), on the owned rows of a multiplier vector."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from feti_homog.feti.constraints import Constraints
from feti_homog.feti.local import LocalSolver

Float = NDArray[np.float64]


class DualOperator:
    """y = F x.  Symmetric positive definite, since B has full row rank and K+ is definite."""

    def __init__(self, constraints: Constraints, solver: LocalSolver) -> None:
        self.constraints, self.solver = constraints, solver
        self.B, self.BT = constraints.B, constraints.B.T.tocsr()

    def apply(self, x: Float) -> Float:
        """sum_s B K+ B^T x."""
        self.solver.b[:] = self.BT @ self.constraints.gather(x)
        return self.jump(self.solver.solve())

    def displacement(self, f: Float, lam: Float) -> Float:
        """K+ (f - B^T lam), the particular solution in Eq. (34), for local loads f."""
        self.solver.b[:] = f - self.BT @ self.constraints.gather(lam)
        return self.solver.solve().copy()

    def jump(self, u: Float) -> Float:
        """B u, Eq. (33)."""
        return self.constraints.sum(self.B @ u)
