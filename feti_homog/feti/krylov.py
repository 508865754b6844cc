"""PETSc contexts of the projected dual problem: shell matrix, shell preconditioner, convergence test.

A vector holds k multiplier vectors, the k values of a row side by side, so that load cases are solved together.
"""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from feti_homog.feti.coarse.natural import NaturalCoarseSpace
from feti_homog.feti.operators.dual_operator import DualOperator
from feti_homog.feti.preconditioners.scaled import Preconditioner
from feti_homog.typing import Float

RTOL = 1e-8
# Methods that apply the preconditioner to the residual itself, so that the jump can be read off there; with the
# others the test is on the forces alone, and the response's own checks tell of the jump.
SEES_RESIDUAL = (PETSc.KSP.Type.CG, PETSc.KSP.Type.FCG)
# Iterations in which the jump has to halve, where soft modes are deflated, once the forces are small enough.
PATIENCE = 4


class ActiveRows:
    """Which owned rows carry multipliers: 1 where they do, else 0."""

    def __init__(self, rows: int) -> None:
        self.mask = np.ones(rows)

    def restrict(self, x: Float) -> Float:
        """x (rows,) or (rows, k) with 0 on the inactive rows."""
        return np.asarray((self.mask if x.ndim == 1 else self.mask[:, None]) * x)


class ProjectedOperator:
    """y = T^T F x on the active rows; x is in the range of T (P, if the coarse problem is the natural one)."""

    def __init__(self, operator: DualOperator, coarse: NaturalCoarseSpace, active: ActiveRows, columns: int) -> None:
        self.operator, self.coarse, self.active = operator, coarse, active
        self.shape = (-1, columns)
        self.event = PETSc.Log.Event("FETIDual")

    def mult(self, mat: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """y = T^T F x."""
        with self.event:
            result = self.operator.apply(x.getArray(readonly=True).reshape(self.shape))
            y.setArray(self.coarse.residual(self.active.restrict(result)).ravel())


class ProjectedPreconditioner:
    """z = T M^-1 r; keeps r, which tells the interface jump B u of the iterate."""

    def __init__(self, preconditioner: Preconditioner, coarse: NaturalCoarseSpace, columns: int) -> None:
        self.preconditioner, self.coarse = preconditioner, coarse
        self.shape = (-1, columns)
        self.event = PETSc.Log.Event("FETIPrecond")
        self._residual = np.zeros((0, columns))

    def jump(self) -> float:
        """|P r|, the jump that the best rigid-body motions leave; collective."""
        r = self.coarse.projected(self._residual)
        return float(np.sqrt(self.coarse.everywhere(np.array([(r * r).sum()]))[0]))

    def apply(self, pc: PETSc.PC, r: PETSc.Vec, z: PETSc.Vec) -> None:
        """z = T M^-1 r."""
        with self.event:
            self._residual = r.getArray(readonly=True).reshape(self.shape)
            z.setArray(self.coarse.admissible(self.preconditioner.apply(self._residual)).ravel())


class PrimalTest:
    """Converged when both primal residuals are below rtol: the jump, and the forces it takes to close it.

    The jump is |P r| relative to that of the torn cell; the forces are |T M^-1 r| relative to the torn cell's.
    A small dual residual alone can hide a large one of these.  Rounding puts part of the residual where the coarse
    space, and no iteration, takes it away; the test ends with a breakdown when only that is left.
    """

    def __init__(self, preconditioner: ProjectedPreconditioner) -> None:
        self.preconditioner = preconditioner
        self.jump, self.forces = 1.0, 1.0
        self._least, self._at = np.inf, 0

    def start(self, jump: float, forces: float) -> None:
        """Norms of the torn cell's jump and of the forces that close it, for the next solve."""
        self.jump, self.forces = jump, forces

    def __call__(self, ksp: PETSc.KSP, iteration: int, residual: float) -> PETSc.KSP.ConvergedReason:
        """PETSc's convergence test; `residual` is the preconditioned one."""
        rtol, atol, divtol, _ = ksp.getTolerances()
        if iteration == 0:
            self._least = np.inf
        if not np.isfinite(residual):
            return PETSc.KSP.ConvergedReason.DIVERGED_NANORINF
        if residual > divtol * self.forces:
            return PETSc.KSP.ConvergedReason.DIVERGED_DTOL
        if residual <= atol:
            return PETSc.KSP.ConvergedReason.CONVERGED_ATOL
        if residual > rtol * self.forces:
            return PETSc.KSP.ConvergedReason.ITERATING
        if ksp.getType() not in SEES_RESIDUAL:
            return PETSc.KSP.ConvergedReason.CONVERGED_RTOL
        jump = self.preconditioner.jump()
        if jump <= rtol * self.jump:
            return PETSc.KSP.ConvergedReason.CONVERGED_RTOL
        if jump < self._least / 2:
            self._least, self._at = jump, iteration
        stalled = self.preconditioner.coarse.deflates and iteration - self._at >= PATIENCE
        return PETSc.KSP.ConvergedReason.DIVERGED_BREAKDOWN if stalled else PETSc.KSP.ConvergedReason.ITERATING


class Krylov:
    """PETSc's Krylov solver for k load cases at once; options have the prefix `feti_`."""

    def __init__(
        self,
        vector: PETSc.Vec,
        operator: DualOperator,
        preconditioner: Preconditioner,
        coarse: NaturalCoarseSpace,
        active: ActiveRows,
        columns: int,
    ) -> None:
        """Set up; `vector` is one of the multiplier vectors."""
        own, whole = vector.getSizes()
        sizes = (own * columns, whole * columns)
        self.projected = ProjectedPreconditioner(preconditioner, coarse, columns)
        self.test = PrimalTest(self.projected)
        A = PETSc.Mat().createPython(
            (sizes, sizes), ProjectedOperator(operator, coarse, active, columns), comm=vector.comm
        )
        A.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        A.setUp()
        self.right, self.solution = A.createVecs()
        self.ksp = PETSc.KSP().create(vector.comm)
        self.ksp.setOptionsPrefix("feti_")
        self.ksp.setOperators(A)
        self.ksp.setType(PETSc.KSP.Type.CG)
        self.ksp.setNormType(PETSc.KSP.NormType.PRECONDITIONED)
        self.ksp.setTolerances(rtol=RTOL, atol=0.0, max_it=2000)
        self.ksp.setConvergenceTest(self.test)
        pc = self.ksp.getPC()
        pc.setType(PETSc.PC.Type.PYTHON)
        pc.setOptionsPrefix("feti_projected_")
        pc.setPythonContext(self.projected)
        self.ksp.setFromOptions()

    def solve(self, residual: Float) -> Float:
        """The multipliers (rows, k) that remove the residual (rows, k)."""
        self.right.setArray(residual.ravel())
        self.solution.zeroEntries()
        self.ksp.solve(self.right, self.solution)
        return self.solution.getArray(readonly=True).reshape(residual.shape).copy()

    def destroy(self) -> None:
        """Free PETSc's shell objects; collective."""
        self.ksp.getOperators()[0].destroy()
        self.ksp.destroy()
