"""PETSc contexts of the projected dual problem: shell matrix, shell preconditioner, convergence test.

H is the preconditioner: M^-1, or H_0 of `coarse.adaptive.Balanced`.

A vector holds k multiplier vectors, the k values of a row side by side, so that load cases are solved together.
Errors that the contexts raise are kept until PETSc has returned (`CallbackErrors`).
"""

from collections.abc import Callable

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from feti_homog.feti.coarse.natural import NaturalCoarseSpace
from feti_homog.feti.operators.interface_operators import DualOperator
from feti_homog.feti.operators.preconditioners import Preconditioner
from feti_homog.feti.thresholds import FORCE_STALL_ITERATIONS, MAX_ITERATIONS, RTOL, STALL_ITERATIONS
from feti_homog.system.parallel import distributed_arrays
from feti_homog.system.petsc import c_functions
from feti_homog.typing import Float

# Methods that apply the preconditioner to the residual itself, so that the jump can be read off there.  With others
# the convergence test sees only the forces; the checks of a response test the jump.
PRECONDITION_TRUE_RESIDUAL = (PETSc.KSP.Type.CG, PETSc.KSP.Type.FCG)

ESTIMATES_SINGULAR_VALUES = (PETSc.KSP.Type.CG, PETSc.KSP.Type.GMRES, PETSc.KSP.Type.FGMRES)


class ActiveRows:
    """The owned rows that carry multipliers: `mask` (owned rows,) is 1 there, else 0."""

    def __init__(self, rows: int) -> None:
        self.mask = np.ones(rows)

    def restrict(self, x: Float) -> Float:
        """Set x (rows,) or (rows, k) to 0 on the inactive rows."""
        return distributed_arrays.scale_rows(self.mask, x)


class ProjectedProblem:
    """The products y = P F x and z = P H r on the active rows; r, the jump of the iterate, is kept."""

    def __init__(
        self,
        errors: c_functions.CallbackErrors,
        operator: DualOperator,
        preconditioner: Preconditioner,
        natural: NaturalCoarseSpace,
        active: ActiveRows,
        columns: int,
    ) -> None:
        """Set up for vectors with this number of `columns`."""
        self._errors, self._operator, self._preconditioner = errors, operator, preconditioner
        self._natural, self._active, self._residual = natural, active, np.zeros((0, columns))
        self._events = PETSc.Log.Event("FETIDual"), PETSc.Log.Event("FETIPrecond")

    def mult(self, mat: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Set y = P F x.  Collective."""
        with self._events[0]:
            values = x.getArray(readonly=True).reshape(-1, self._residual.shape[1])
            y.setArray(self._projected(lambda: self._active.restrict(self._operator.apply(values))))

    def apply(self, pc: PETSc.PC, r: PETSc.Vec, z: PETSc.Vec) -> None:
        """Set z = P H r.  Collective."""
        with self._events[1]:
            self._residual = r.getArray(readonly=True).reshape(-1, self._residual.shape[1])
            z.setArray(self._projected(lambda: self._preconditioner.apply(self._residual)))

    def _projected(self, vectors: Callable[[], Float]) -> Float:
        """Project `vectors()` and flatten the result; NaN if `vectors` raises."""
        nothing = np.full((len(self._active.mask), self._residual.shape[1]), np.nan)
        return self._errors.call(lambda: self._natural.project(vectors()), nothing).ravel()

    def jump_norm(self) -> float:
        """Compute |P r| of the last r, the jump that no rigid-body motion closes.  Collective."""
        r = self._natural.project(self._residual)
        return float(
            np.sqrt(distributed_arrays.allreduce_sum(self._operator.boundary.comm, np.array([(r * r).sum()]))[0])
        )


class Stall:
    """Test for a norm that has not halved for `patience` iterations."""

    def __init__(self, patience: int) -> None:
        self._patience = patience
        self.reset()

    def reset(self) -> None:
        self._smallest, self._found_at = np.inf, 0

    def is_reached(self, iteration: int, norm: float) -> bool:
        """Record the norm at this iteration, and return whether it stalls."""
        if norm < self._smallest / 2:
            self._smallest, self._found_at = norm, iteration
        return iteration - self._found_at >= self._patience


class PrimalTest:
    """PETSc's convergence test: converged when both primal residuals, the jump and the forces, are below rtol.

    The jump is |P r| relative to the jump of the torn cell; the forces that would close it are |P H r| relative to
    the forces of the torn cell, |P M^-1 P d|.  A small dual residual alone can hide a large one of these.

    Attributes:
        ends_on_stall: whether a stall is a breakdown.
        jump_scale, force_scale: norms of the torn cell's jump and of the forces that close it, for the next solve.
    """

    def __init__(self, errors: c_functions.CallbackErrors, problem: ProjectedProblem) -> None:
        self._errors, self._problem, self.ends_on_stall = errors, problem, False
        self.jump_scale, self.force_scale = 1.0, 1.0
        self._jump_stall, self._force_stall = Stall(STALL_ITERATIONS), Stall(FORCE_STALL_ITERATIONS)

    def is_met(self, rtol: float, jump: float, forces: float) -> bool:
        """Return whether norms of the jump and of the forces are both below rtol, or the jump is zero."""
        return jump == 0.0 or (jump <= rtol * self.jump_scale and forces <= rtol * self.force_scale)

    def __call__(self, ksp: PETSc.KSP, iteration: int, residual: float) -> PETSc.KSP.ConvergedReason:
        """Test for convergence; `residual` is the norm |P H r|.  Collective."""
        failed = PETSc.KSP.ConvergedReason.DIVERGED_NANORINF
        return self._errors.call(lambda: self._judge(ksp, iteration, residual), failed)

    def _judge(self, ksp: PETSc.KSP, iteration: int, residual: float) -> PETSc.KSP.ConvergedReason:
        rtol, atol, divtol, _ = ksp.getTolerances()
        if iteration == 0:
            self._jump_stall.reset()
            self._force_stall.reset()
        if not np.isfinite(residual):
            return PETSc.KSP.ConvergedReason.DIVERGED_NANORINF
        if residual > divtol * self.force_scale:
            return PETSc.KSP.ConvergedReason.DIVERGED_DTOL
        if residual <= atol:
            return PETSc.KSP.ConvergedReason.CONVERGED_ATOL
        if residual > rtol * self.force_scale:
            return self._go_on(self._force_stall.is_reached(iteration, residual))
        if ksp.getType() not in PRECONDITION_TRUE_RESIDUAL:
            return PETSc.KSP.ConvergedReason.CONVERGED_RTOL
        jump = self._problem.jump_norm()
        if jump <= rtol * self.jump_scale:
            return PETSc.KSP.ConvergedReason.CONVERGED_RTOL
        return self._go_on(self._jump_stall.is_reached(iteration, jump))

    def _go_on(self, stalled: bool) -> PETSc.KSP.ConvergedReason:
        """Return DIVERGED_BREAKDOWN for a stall that ends the solve, else ITERATING."""
        if stalled and self.ends_on_stall:
            return PETSc.KSP.ConvergedReason.DIVERGED_BREAKDOWN
        return PETSc.KSP.ConvergedReason.ITERATING


class Krylov:
    """PETSc's Krylov method for k load cases at once.

    Options have the prefix `feti_`.  The preconditioner's own prefix is `feti_projected_`, because `feti_pc_type` names
    a preconditioner of this program, not of PETSc; options under that prefix are refused.
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
        """Create the KSP for `columns` load cases, each with the layout of `vector`.  Collective."""
        self._columns = columns
        owned_rows, all_rows = vector.getSizes()
        sizes = (owned_rows * columns, all_rows * columns)
        self._errors = c_functions.CallbackErrors(comm)
        context = ProjectedProblem(self._errors, operator, preconditioner, natural, active, columns)
        self.test = PrimalTest(self._errors, context)
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
        pc.setPythonContext(context)
        self.ksp.setFromOptions()

    def solve(self, residual: Float) -> Float:
        """Solve for the multipliers (rows, k) that remove the residual (rows, k).  Collective.

        Errors in the operator, the preconditioner or the test are raised again if all ranks raise them; otherwise the
        job ends.
        """
        self._right.setArray(residual.ravel())
        self._solution.zeroEntries()
        with self._errors.raised():
            self.ksp.solve(self._right, self._solution)
        multipliers: Float = self._solution.getArray(readonly=True).reshape(residual.shape).copy()
        return multipliers

    def describe(self, iterations: int) -> str:
        """Describe the last solve for -feti_view: iterations and estimated condition number."""
        ksp, load_cases = self.ksp, self._columns
        line = f"FETI: {load_cases} load case{'s' * (load_cases > 1)}, {iterations} iterations"
        if not iterations or ksp.getType() not in ESTIMATES_SINGULAR_VALUES:
            return line
        largest, smallest = ksp.computeExtremeSingularValues()
        return f"{line}, condition number about {largest / smallest:.3g} ({smallest:.3g} to {largest:.3g})"

    def destroy(self) -> None:
        """Free the shell matrix and the Krylov method; collective."""
        self.ksp.getOperators()[0].destroy()
        self.ksp.destroy()
