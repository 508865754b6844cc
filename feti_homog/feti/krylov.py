"""PETSc contexts of the projected dual problem: shell matrix, shell preconditioner, convergence test.

F is the dual operator with springs, H its preconditioner, and P the projector of `coarse.natural`.

A PETSc vector holds the multipliers of k load cases, with the k values of a row side by side, so that one Krylov
iteration advances all load cases.  `CallbackErrors` stores exceptions of the contexts until PETSc has returned.
"""

from collections.abc import Callable
from functools import partial

import numpy as np
from petsc4py import PETSc

from feti_homog.feti.dual_solution import ActiveJumps
from feti_homog.feti.operators.preconditioners import Preconditioner
from feti_homog.feti.thresholds import FORCE_STALL_ITERATIONS, MAX_ITERATIONS, MAX_RESTARTS, RTOL, STALL_ITERATIONS
from feti_homog.system.parallel import distributed_arrays
from feti_homog.system.petsc import c_functions
from feti_homog.typing import Float

REASON = PETSc.KSP.ConvergedReason
# PETSc's converged reasons for breakdowns by rounding.
BREAKDOWNS = (REASON.DIVERGED_INDEFINITE_PC, REASON.DIVERGED_INDEFINITE_MAT, REASON.DIVERGED_BREAKDOWN)
# Methods that apply the preconditioner to the true residual, from which the convergence test computes the jump.  With
# other methods, the convergence test sees only the forces, and the checks of a response test the jump.
PRECONDITION_TRUE_RESIDUAL = (PETSc.KSP.Type.CG, PETSc.KSP.Type.FCG)


class ProjectedProblem:
    """The context of the shell matrix P F and the shell preconditioner P H; it stores the last residual r."""

    def __init__(
        self, errors: c_functions.CallbackErrors, preconditioner: Preconditioner, jumps: ActiveJumps, columns: int
    ) -> None:
        """Set up products with vectors that hold `columns` load cases."""
        self._errors, self._preconditioner, self._jumps = errors, preconditioner, jumps
        self._residual = np.zeros((0, columns))
        self._events = PETSc.Log.Event("FETIDual"), PETSc.Log.Event("FETIPrecond")

    def mult(self, mat: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Compute the matrix product y = P F x.  Collective."""
        with self._events[0]:
            values = x.getArray(readonly=True).reshape(-1, self._residual.shape[1])
            y.setArray(self._projected(lambda: self._jumps.restrict(self._jumps.operator.apply(values))))

    def apply(self, pc: PETSc.PC, r: PETSc.Vec, z: PETSc.Vec) -> None:
        """Apply the preconditioner: z = P H r.  Collective."""
        with self._events[1]:
            self._residual = r.getArray(readonly=True).reshape(-1, self._residual.shape[1])
            z.setArray(self._projected(lambda: self._preconditioner.apply(self._residual)))

    def _projected(self, vectors: Callable[[], Float]) -> Float:
        """Project the result of `vectors()` and flatten it; from the first exception on, return NaN.  Collective."""
        nothing = np.full((len(self._jumps.active), self._residual.shape[1]), np.nan)
        return self._errors.call(lambda: self._jumps.natural.project(vectors()), nothing).ravel()

    def jump_norm(self) -> float:
        """Compute |P r| for the residual r of the last `apply`.  Collective."""
        r = self._jumps.natural.project(self._residual)
        return float(np.sqrt(distributed_arrays.allreduce_sum(self._jumps.comm, np.array([(r * r).sum()]))[0]))


class Stall:
    """A test for a norm that has not halved within `patience` iterations."""

    def __init__(self, patience: int) -> None:
        self._patience = patience
        self.reset()

    def reset(self) -> None:
        self._smallest, self._smallest_at = np.inf, 0

    def is_reached(self, iteration: int, norm: float) -> bool:
        """Record the norm at an iteration, and return whether the norm stalls."""
        if norm < self._smallest / 2:
            self._smallest, self._smallest_at = norm, iteration
        return iteration - self._smallest_at >= self._patience


class PrimalTest:
    """PETSc's convergence test: the primal residuals of force and, with CG or FCG, of jump must fall below rtol.

    For the residual r, the jump residual is |P r| / |P d|, relative to the jump d of the torn cell; the force residual
    is |P H r|, relative to the norm of the forces that close d (`Preconditioner.closing_forces`).

    Attributes:
        ends_on_stall: whether a stall ends the solve, as a breakdown.
        jump_scale, force_scale: |P d|, and the norm of the forces that close d, for the next solve.
    """

    def __init__(self, problem: ProjectedProblem) -> None:
        self._problem, self.ends_on_stall = problem, False
        self.jump_scale, self.force_scale = 1.0, 1.0
        self._jump_stall, self._force_stall = Stall(STALL_ITERATIONS), Stall(FORCE_STALL_ITERATIONS)

    def __call__(self, ksp: PETSc.KSP, iteration: int, residual: float) -> PETSc.KSP.ConvergedReason:
        """Return PETSc's reason to stop, or ITERATING; `residual` is |P H r|.  Collective."""
        rtol, atol, divtol, _ = ksp.getTolerances()
        if iteration == 0:
            self._jump_stall.reset()
            self._force_stall.reset()
        if not np.isfinite(residual):
            return REASON.DIVERGED_NANORINF
        if residual > divtol * self.force_scale:
            return REASON.DIVERGED_DTOL
        if residual <= atol:
            return REASON.CONVERGED_ATOL
        if residual > rtol * self.force_scale:
            return self._go_on(self._force_stall.is_reached(iteration, residual))
        if ksp.getType() not in PRECONDITION_TRUE_RESIDUAL:
            return REASON.CONVERGED_RTOL
        jump = self._problem.jump_norm()
        if jump <= rtol * self.jump_scale:
            return REASON.CONVERGED_RTOL
        return self._go_on(self._jump_stall.is_reached(iteration, jump))

    def _go_on(self, stalled: bool) -> PETSc.KSP.ConvergedReason:
        """Return DIVERGED_BREAKDOWN if the norm has `stalled` and a stall ends the solve, else ITERATING."""
        return REASON.DIVERGED_BREAKDOWN if stalled and self.ends_on_stall else REASON.ITERATING


class Krylov:
    """PETSc's Krylov method for k load cases at once.

    Options have the prefix `feti_`.  The PETSc preconditioner has the prefix `feti_projected_`, because `feti_pc_type`
    names a preconditioner of this program; the program refuses options with the prefix `feti_projected_`.
    """

    def __init__(
        self, vector: PETSc.Vec, preconditioner: Preconditioner, jumps: ActiveJumps, columns: int, restarts: bool
    ) -> None:
        """Create the KSP for `columns` load cases, each with the layout of `vector`.  Collective.

        With `restarts`, a stalled iteration restarts with the residual of the last multipliers.
        """
        self._preconditioner, self._jumps, self._columns, self._restarts = preconditioner, jumps, columns, restarts
        owned_rows, all_rows = vector.getSizes()
        sizes = (owned_rows * columns, all_rows * columns)
        self._errors = errors = c_functions.CallbackErrors(jumps.comm)
        context = ProjectedProblem(errors, preconditioner, jumps, columns)
        self.test = test = PrimalTest(context)
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
        self.ksp.setConvergenceTest(lambda *state: errors.call(partial(test, *state), REASON.DIVERGED_NANORINF))
        pc = self.ksp.getPC()
        pc.setType(PETSc.PC.Type.PYTHON)
        pc.setOptionsPrefix("feti_projected_")
        pc.setPythonContext(context)
        self.ksp.setFromOptions()
        # PETSc reserves memory for the coefficients of all permitted iterations, which may exceed the unknowns.
        permitted = self.ksp.getTolerances()[3]
        self.ksp.setComputeSingularValues(permitted <= max(MAX_ITERATIONS, sizes[1]))

    def solve(self, lam: Float, right: Float) -> tuple[Float, Float, int, int]:
        """Solve P F lam = `right` for projected jumps `right` (owned rows, k), starting from `lam`.  Collective.

        With an adaptive coarse space the condition number is small (proven with all rows active, measured otherwise),
        so only rounding stalls the iteration.  A stalled iteration restarts from its last multipliers, with their
        residual computed anew; after MAX_RESTARTS restarts, the iteration continues through a stall.

        On several ranks, an exception in a callback ends the job, unless all ranks raise a FetiHomogError.

        Returns:
            Multipliers lam (rows, k), F lam (rows, k), also on inactive rows, iterations, PETSc's converged reason.
        """
        iterations, jumps, permitted = 0, self._jumps, self.ksp.getTolerances()[3]
        for restart in range(MAX_RESTARTS + 2):
            self.test.ends_on_stall = self._restarts and restart <= MAX_RESTARTS
            # A load case starts from 0 if `lam` leaves a residual larger than `right`.
            applied, residual = np.zeros_like(lam), right
            if jumps.norms(lam).any():
                applied = jumps.operator.apply(lam)
                residual = jumps.projected(right - applied)
            is_better = jumps.norms(residual) <= jumps.norms(right)
            lam, applied = np.where(is_better, lam, 0.0), np.where(is_better, applied, 0.0)
            residual = np.where(is_better, residual, right)
            jump = float(np.linalg.norm(jumps.norms(residual)))
            rtol, test, forces = self.ksp.getTolerances()[0], self.test, self._preconditioner.norm * jump
            if jump == 0.0 or (jump <= rtol * test.jump_scale and forces <= rtol * test.force_scale):
                return lam, applied, iterations, int(REASON.CONVERGED_RTOL)
            self._right.setArray(residual.ravel())
            self._solution.zeroEntries()
            self.ksp.setTolerances(max_it=permitted - iterations)
            with self._errors.raised():
                self.ksp.solve(self._right, self._solution)
            self.ksp.setTolerances(max_it=permitted)
            lam = lam + self._solution.getArray(readonly=True).reshape(lam.shape)
            iterations += self.ksp.getIterationNumber()
            reason = int(self.ksp.getConvergedReason())
            if reason not in BREAKDOWNS or iterations >= permitted:
                break
        return lam, jumps.operator.apply(lam), iterations, reason

    def describe(self, iterations: int) -> str:
        """Return the line that -feti_view prints about the last solve."""
        line = f"FETI: {self._columns} load case{'' if self._columns == 1 else 's'}, {iterations} iterations"
        if not iterations or self.extreme_values is None:
            return line
        smallest, largest = self.extreme_values
        return f"{line}, condition number about {largest / smallest:.3g} ({smallest:.3g} to {largest:.3g})"

    @property
    def extreme_values(self) -> tuple[float, float] | None:
        """Return the smallest and largest singular value of P H P F in the last solve; None without an estimate."""
        # Other methods estimate singular values in a norm in which P H P F is not symmetric.
        has_values = self.ksp.getComputeSingularValues() and self.ksp.getType() == PETSc.KSP.Type.CG
        if not has_values or self.ksp.getConvergedReason() <= 0 or not self.ksp.getIterationNumber():
            return None
        largest, smallest = self.ksp.computeExtremeSingularValues()
        return (smallest, largest) if smallest > 0.0 else None

    def destroy(self) -> None:
        """Free the shell matrix and the Krylov method.  Collective."""
        self.ksp.getOperators()[0].destroy()
        self.ksp.destroy()
