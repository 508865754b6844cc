"""PETSc contexts of the projected dual problem: shell matrix, shell preconditioner, convergence test.

H is the preconditioner: M^-1, or H_0 of `coarse.adaptive.Balanced` with coarse displacements in equilibrium.

A vector holds k multiplier vectors, the k values of a row side by side, so that load cases are solved together.
Errors that the contexts raise are kept until PETSc has returned (`CallbackErrors`).
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from feti_homog.feti.coarse.natural import NaturalCoarseSpace
from feti_homog.feti.operators.interface_operators import DualOperator
from feti_homog.feti.operators.preconditioners import Preconditioner
from feti_homog.feti.thresholds import FORCE_STALL_ITERATIONS, MAX_ITERATIONS, RTOL, STALL_ITERATIONS
from feti_homog.system.parallel.distributed_arrays import allreduce_sum, scale_rows
from feti_homog.system.petsc.c_functions import CallbackErrors
from feti_homog.typing import Float

# Methods that apply the preconditioner to the residual itself, so that the jump can be read off there.  With others
# the convergence test sees only the forces; the checks of a response test the jump.
PRECONDITION_TRUE_RESIDUAL = (PETSc.KSP.Type.CG, PETSc.KSP.Type.FCG)

ESTIMATES_SINGULAR_VALUES = (PETSc.KSP.Type.CG, PETSc.KSP.Type.GMRES, PETSc.KSP.Type.FGMRES)


class ActiveRows:
    """Owned rows that carry multipliers: `mask` (owned rows,) is 1 where they do, else 0."""

    def __init__(self, rows: int) -> None:
        self.mask = np.ones(rows)

    def restrict(self, x: Float) -> Float:
        """x (rows,) or (rows, k) with 0 on the inactive rows."""
        return scale_rows(self.mask, x)


class ProjectedOperator:
    """y = P F x on the active rows."""

    def __init__(
        self,
        errors: CallbackErrors,
        operator: DualOperator,
        natural: NaturalCoarseSpace,
        active: ActiveRows,
        columns: int,
    ) -> None:
        """For vectors of so many columns."""
        self._errors = errors
        self.operator, self.natural, self.active = operator, natural, active
        self.shape = (-1, columns)
        self.event = PETSc.Log.Event("FETIDual")

    def mult(self, mat: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """y = P F x.  Collective."""
        with self.event:
            values = x.getArray(readonly=True).reshape(self.shape)
            y.setArray(self._errors.call(lambda: self._apply(values), np.full(values.shape, np.nan)).ravel())

    def _apply(self, x: Float) -> Float:
        return self.natural.project(self.active.restrict(self.operator.apply(x)))


class ProjectedPreconditioner:
    """z = P H r; keeps r, the interface jump B u of the iterate."""

    def __init__(
        self,
        comm: MPI.Intracomm,
        errors: CallbackErrors,
        preconditioner: Preconditioner,
        natural: NaturalCoarseSpace,
        columns: int,
    ) -> None:
        """For vectors of so many columns."""
        self._errors = errors
        self.comm, self.preconditioner, self.natural = comm, preconditioner, natural
        self.shape = (-1, columns)
        self.event = PETSc.Log.Event("FETIPrecond")
        self._residual = np.zeros((0, columns))

    def apply(self, pc: PETSc.PC, r: PETSc.Vec, z: PETSc.Vec) -> None:
        """z = P H r.  Collective."""
        with self.event:
            self._residual = r.getArray(readonly=True).reshape(self.shape)
            z.setArray(self._errors.call(self._apply, np.full(self._residual.shape, np.nan)).ravel())

    def _apply(self) -> Float:
        return self.natural.project(self.preconditioner.apply(self._residual))

    def jump_norm(self) -> float:
        """|P r| of the last r: the jump that the best rigid-body motions leave.  Collective."""
        r = self.natural.project(self._residual)
        return float(np.sqrt(allreduce_sum(self.comm, np.array([(r * r).sum()]))[0]))


class Stall:
    """Watches a norm: it stalls if it has not halved for `patience` iterations."""

    def __init__(self, patience: int) -> None:
        self._patience = patience
        self.reset()

    def reset(self) -> None:
        self._smallest, self._found_at = np.inf, 0

    def is_reached(self, iteration: int, norm: float) -> bool:
        """Return whether the norm stalls, given that of this iteration."""
        if norm < self._smallest / 2:
            self._smallest, self._found_at = norm, iteration
        return iteration - self._found_at >= self._patience


class PrimalTest:
    """PETSc's convergence test: converged when both primal residuals, the jump and the forces, are below rtol.

    The jump is |P r| relative to that of the torn cell; the forces that would close it are |P H r| relative to those of
    the torn cell, |P M^-1 P d|.  A small dual residual alone can hide a large one of these.

    Attributes:
        ends_on_stall: whether norms that do not fall any more are a breakdown.
    """

    def __init__(self, errors: CallbackErrors, preconditioner: ProjectedPreconditioner) -> None:
        self._errors, self.preconditioner, self.ends_on_stall = errors, preconditioner, False
        self._jump_scale, self._force_scale = 1.0, 1.0
        self._jump_stall, self._force_stall = Stall(STALL_ITERATIONS), Stall(FORCE_STALL_ITERATIONS)

    def set_scales(self, jump: float, forces: float) -> None:
        """Set the norms of the torn cell's jump and of the forces that close it, for the next solve."""
        self._jump_scale, self._force_scale = jump, forces

    def is_met(self, rtol: float, jump: float, forces: float) -> bool:
        """Return whether norms of the jump and of the forces are both below rtol, or there is no jump."""
        return jump <= rtol * self._jump_scale and (forces <= rtol * self._force_scale or jump == 0.0)

    def __call__(self, ksp: PETSc.KSP, iteration: int, residual: float) -> PETSc.KSP.ConvergedReason:
        """Return whether to go on; `residual` is the norm of the preconditioned one, |P H r|.  Collective."""
        failed = PETSc.KSP.ConvergedReason.DIVERGED_NANORINF
        return self._errors.call(lambda: self._judge(ksp, iteration, residual), failed)

    def _judge(self, ksp: PETSc.KSP, iteration: int, residual: float) -> PETSc.KSP.ConvergedReason:
        rtol, atol, divtol, _ = ksp.getTolerances()
        if iteration == 0:
            self._jump_stall.reset()
            self._force_stall.reset()
        if not np.isfinite(residual):
            return PETSc.KSP.ConvergedReason.DIVERGED_NANORINF
        if residual > divtol * self._force_scale:
            return PETSc.KSP.ConvergedReason.DIVERGED_DTOL
        if residual <= atol:
            return PETSc.KSP.ConvergedReason.CONVERGED_ATOL
        if residual > rtol * self._force_scale:
            return self._go_on(self._force_stall.is_reached(iteration, residual))
        if ksp.getType() not in PRECONDITION_TRUE_RESIDUAL:
            return PETSc.KSP.ConvergedReason.CONVERGED_RTOL
        jump = self.preconditioner.jump_norm()
        if jump <= rtol * self._jump_scale:
            return PETSc.KSP.ConvergedReason.CONVERGED_RTOL
        return self._go_on(self._jump_stall.is_reached(iteration, jump))

    def _go_on(self, stalled: bool) -> PETSc.KSP.ConvergedReason:
        """Return iterating, or a breakdown."""
        if stalled and self.ends_on_stall:
            return PETSc.KSP.ConvergedReason.DIVERGED_BREAKDOWN
        return PETSc.KSP.ConvergedReason.ITERATING


class Krylov:
    """PETSc's Krylov method for k load cases at once.

    Options have the prefix `feti_`.  The preconditioner's own prefix is `feti_projected_`, because `feti_pc_type` names
    one of ours, not one of PETSc's; options under it are refused.
    """

    def __init__(
        self,
        comm: MPI.Intracomm,
        vector: PETSc.Vec,
        operator: DualOperator,
        preconditioner: Preconditioner,
        natural: NaturalCoarseSpace,
        active: ActiveRows,
        columns: int,
    ) -> None:
        """Set up; `vector` is one of the multiplier vectors.  Collective."""
        self._columns = columns
        own, whole = vector.getSizes()
        sizes = (own * columns, whole * columns)
        self._errors = CallbackErrors(comm)
        self._preconditioner = ProjectedPreconditioner(comm, self._errors, preconditioner, natural, columns)
        self.test = PrimalTest(self._errors, self._preconditioner)
        context = ProjectedOperator(self._errors, operator, natural, active, columns)
        A = PETSc.Mat().createPython((sizes, sizes), context, comm=vector.comm)
        A.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        A.setUp()
        self._right, self._solution = A.createVecs()
        self.ksp = PETSc.KSP().create(vector.comm)
        self.ksp.setOptionsPrefix("feti_")
        self.ksp.setOperators(A)
        self.ksp.setType(PETSc.KSP.Type.CG)
        self.ksp.setNormType(PETSc.KSP.NormType.PRECONDITIONED)
        self.ksp.setTolerances(rtol=RTOL, atol=0.0, max_it=MAX_ITERATIONS)
        self.ksp.setConvergenceTest(self.test)
        pc = self.ksp.getPC()
        pc.setType(PETSc.PC.Type.PYTHON)
        pc.setOptionsPrefix("feti_projected_")
        pc.setPythonContext(self._preconditioner)
        self.ksp.setFromOptions()

    def solve(self, residual: Float) -> Float:
        """Return the multipliers (rows, k) that remove the residual (rows, k), as far as `ksp` converged.  Collective.

        Raises what operator, preconditioner or test raise on all ranks; a rank that raises alone ends the job.
        """
        self._right.setArray(residual.ravel())
        self._solution.zeroEntries()
        with self._errors.raised():
            self.ksp.solve(self._right, self._solution)
        found: Float = self._solution.getArray(readonly=True).reshape(residual.shape).copy()
        return found

    def describe(self, iterations: int) -> str:
        """Return iterations and estimated condition number of the last solve, as -feti_view prints them."""
        ksp, load_cases = self.ksp, self._columns
        words = f"FETI: {load_cases} load case{'s' * (load_cases > 1)}, {iterations} iterations"
        if not iterations or ksp.getType() not in ESTIMATES_SINGULAR_VALUES:
            return words
        largest, smallest = ksp.computeExtremeSingularValues()
        return f"{words}, condition number about {largest / smallest:.3g} ({smallest:.3g} to {largest:.3g})"

    def destroy(self) -> None:
        """Free the shell matrix and the Krylov method; collective."""
        self.ksp.getOperators()[0].destroy()
        self.ksp.destroy()
