"""The dual operator F = sum_s B K+ B^T as a PETSc shell matrix, Eq. (36)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from feti_homog.feti.constraints import Constraints
from feti_homog.feti.local import LocalSolver

Float = NDArray[np.float64]


class DualOperator:
    """y = F x.  Symmetric, positive semidefinite; definite on the range of the projector."""

    def __init__(self, constraints: Constraints, solver: LocalSolver) -> None:
        self.constraints, self.solver = constraints, solver
        self.B, self.BT = constraints.B, constraints.B.T.tocsr()
        self.applications = 0

    def mult(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """y = sum_s B K+ B^T x."""
        self.applications += 1
        self.solver.b[:] = self.BT @ self.constraints.gather(x)
        self.constraints.add(self.B @ self.solver.solve(), y)

    def displacement(self, f: Float, lam: PETSc.Vec) -> Float:
        """K+ (f - B^T lam), the particular solution in Eq. (34), for local loads f."""
        self.solver.b[:] = f - self.BT @ self.constraints.gather(lam)
        return self.solver.solve().copy()

    def jump(self, u: Float, y: PETSc.Vec) -> None:
        """y = B u, Eq. (33)."""
        self.constraints.add(self.B @ u, y)
