"""PETSc contexts of the projected dual problem: shell matrix, shell preconditioner, convergence test."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from feti_homog.feti.coarse import CoarseProblem
from feti_homog.feti.operator import DualOperator
from feti_homog.feti.preconditioner import Preconditioner

Float = NDArray[np.float64]

# Methods that apply the preconditioner to the residual itself, so that the jump can be read off there; with the
# others the test is on the forces alone, and the response's own checks tell of the jump.
SEES_RESIDUAL = (PETSc.KSP.Type.CG, PETSc.KSP.Type.FCG)


class ActiveRows:
    """Which owned rows carry multipliers: 1 where they do, else 0."""

    def __init__(self, rows: int) -> None:
        self.mask = np.ones(rows)


class ProjectedOperator:
    """y = P F x on the active rows; x is in the range of P."""

    def __init__(self, operator: DualOperator, coarse: CoarseProblem, active: ActiveRows) -> None:
        self.operator, self.coarse, self.active = operator, coarse, active
        self.event = PETSc.Log.Event("FETIDual")

    def mult(self, mat: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """y = P F x."""
        with self.event:
            result = self.active.mask * self.operator.apply(x.getArray(readonly=True))
            self.coarse.project(result)
            y.setArray(result)


class ProjectedPreconditioner:
    """z = P M^-1 r; notes |r|, which is the interface jump |B u| of the iterate."""

    def __init__(self, preconditioner: Preconditioner, coarse: CoarseProblem) -> None:
        self.preconditioner, self.coarse = preconditioner, coarse
        self.event = PETSc.Log.Event("FETIPrecond")
        self.jump = 0.0

    def apply(self, pc: PETSc.PC, r: PETSc.Vec, z: PETSc.Vec) -> None:
        """z = P M^-1 r."""
        with self.event:
            self.jump = r.norm()
            result = self.preconditioner.apply(r.getArray(readonly=True))
            self.coarse.project(result)
            z.setArray(result)


class PrimalTest:
    """Converged when both primal residuals are below rtol: the jump, and the forces it takes to close it.

    The jump is |P r| relative to that of the torn cell; the forces are |P M^-1 r| relative to the torn cell's.
    A small dual residual alone can hide a large one of these.
    """

    def __init__(self, preconditioner: ProjectedPreconditioner) -> None:
        self.preconditioner = preconditioner
        self.jump, self.forces = 1.0, 1.0

    def start(self, jump: float, forces: float) -> None:
        """Norms of the torn cell's jump and of the forces that close it, for the next solve."""
        self.jump, self.forces = jump, forces

    def __call__(self, ksp: PETSc.KSP, iteration: int, residual: float) -> PETSc.KSP.ConvergedReason:
        """PETSc's convergence test; `residual` is the preconditioned one."""
        rtol, atol, divtol, _ = ksp.getTolerances()
        if not np.isfinite(residual):
            return PETSc.KSP.ConvergedReason.DIVERGED_NANORINF
        if residual > divtol * self.forces:
            return PETSc.KSP.ConvergedReason.DIVERGED_DTOL
        if residual <= atol:
            return PETSc.KSP.ConvergedReason.CONVERGED_ATOL
        closed = ksp.getType() not in SEES_RESIDUAL or self.preconditioner.jump <= rtol * self.jump
        if residual <= rtol * self.forces and closed:
            return PETSc.KSP.ConvergedReason.CONVERGED_RTOL
        return PETSc.KSP.ConvergedReason.ITERATING
