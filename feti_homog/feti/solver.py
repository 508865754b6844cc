"""The FETI solver: one set-up for a mesh, then projected Krylov solves for any loads and active rows.

With f = -Q E for a load E (v,), which begins with the macroscopic strain, Eqs. (34), (36), (37) read on the active rows

    (F + C) lam - G alpha = d E,  G^T lam = 0,  u* = K+ (-Q E - B^T lam) + R alpha,  d = -B K+ Q.

Here F = B K+ B^T and G = B R, with the jumps B u, and kernel R and generalized inverse K+ of the stiffness K.  C is the
compliance of elastic bonds, whose faces part by B u* = C lam; rigid bonds (glue) have C = 0.

Tractions t = Sigma n on the sides follow E among the loads as Sigma (m,), such that int u* (x) n ds = 0 there: E is the
mean strain, Sigma the mean stress (`FetiSolver.closure`).  With their work on rigid motions, G^T lam = -R^T Q E.
"""

import weakref
from collections.abc import Sequence
from contextlib import ExitStack
from functools import cached_property

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from feti_homog.errors import NotCarriedError
from feti_homog.fem import PLANE, Problem
from feti_homog.feti import solver_plan
from feti_homog.feti.decomposition.jump_operator import GLUE, InterfaceSprings, JumpOperator
from feti_homog.feti.decomposition.shared_entities import SharedEntities
from feti_homog.feti.decomposition.subdomain import Subdomain
from feti_homog.feti.dual_solution import ActiveJumps, DualSolution
from feti_homog.feti.krylov import Krylov
from feti_homog.feti.operators.interface_operators import DualOperator
from feti_homog.feti.operators.one_subdomain import CondensedLoads
from feti_homog.feti.thresholds import DEFAULTS, MOST_DOFS_UNTRIMMED, Thresholds
from feti_homog.mesh import ReferenceLattice
from feti_homog.system.runtime import process
from feti_homog.typing import Float


class FetiSolver:
    """A solver for the dual problem of a torn cell under any loads and interface states.

    The set-up factors every subdomain; `displacement` may factor interiors.  Options have the prefix `feti_`.

    Attributes:
        problem: components of the displacement, and unit loads.
        jump_operator: B and the layout of the multipliers.
        interface_operators: S and S+ of the local subdomains.
        intact_compliance: (owned rows,) C of the intact springs.
        operator: F + C.
        preconditioner: preconditioner of F + C, as chosen by `solver_plan.choose`.
        exact_inverse: the preconditioner if it is made from influence columns, else None.
        natural: natural coarse space of rigid-body motions, with G and the projector P.
        adaptive: adaptive coarse space of the preconditioner, None without one.
        coarse_dimension: number of coarse displacements, or of rigid-body motions without `adaptive`.
        active, jumps: rows that carry multipliers; projections and norms of the jumps there.
        solves: loads solved so far.
        condition: largest estimated condition number of the preconditioned operator so far; 0 without iterations.
        method: names of preconditioner and coarse space for the summary.
    """

    def __init__(
        self,
        comm: MPI.Intracomm,
        shared: SharedEntities,
        subdomains: Sequence[Subdomain],
        lattice: ReferenceLattice,
        applications: int,
        thresholds: Thresholds = DEFAULTS,
        springs: InterfaceSprings = GLUE,
        problem: Problem = PLANE,
        recovers: bool = False,
    ) -> None:
        """Factor the subdomains and the coarse problem.  Collective.

        The arguments `applications` and `recovers`, and the exceptions, are as in `solver_plan.build`.
        """
        self.comm, self.subdomains, self.problem = comm, subdomains, problem
        self.jump_operator = JumpOperator(comm, shared, subdomains, lattice, problem)
        self.intact_compliance = compliance = springs.compliance(self.jump_operator)
        options = applications, compliance, springs.soften, thresholds, recovers
        parts = solver_plan.build(comm, self.jump_operator, subdomains, *options)
        self.interface_operators, self.preconditioner = parts.operators, parts.preconditioner
        self.exact_inverse, self.method = parts.exact_inverse, parts.method
        self.natural, self.adaptive, self.coarse_dimension = parts.natural, parts.adaptive, parts.coarse_dimension
        self.operator = DualOperator(self.interface_operators, compliance)
        if sum(s.n_dofs for s in subdomains) > MOST_DOFS_UNTRIMMED:
            process.trim_memory()
        self.jumps = ActiveJumps(comm, self.operator, self.natural)
        self._by_columns = None
        if self.exact_inverse is not None:
            from feti_homog.feti.confirmation import InfluenceSolutions  # only influence columns need it

            self._by_columns = InfluenceSolutions(comm, self.exact_inverse, self.operator, self.natural, self.jumps)
        # The loads of unit strains, and their solutions; without tractions on the sides, the loads are the strains.
        self._closure, self._units = np.eye(len(problem.loads)), list[DualSolution]()
        self._view = PETSc.Options("feti_").getBool("view", False)
        # Shell contexts call Python, so the solver destroys them: PETSc finalizes after the interpreter has shut down.
        self._krylov: dict[int, Krylov] = {}
        self._shells = ExitStack()
        self._shells.callback(self._krylov.clear)
        self._destroy_krylov = weakref.finalize(self, self._shells.close)
        self._krylov_for(1)
        self.solves, self.condition = 0, 0.0
        if self._view:
            PETSc.Sys.Print(parts.describe(comm), comm=comm)

    @property
    def rows(self) -> int:
        """Return the number of multipliers that this rank owns."""
        return self.jump_operator.owned[1] - self.jump_operator.owned[0]

    @property
    def ksp(self) -> PETSc.KSP:
        """Return PETSc's Krylov method for one load case."""
        return self._krylov_for(1).ksp

    @property
    def rtol(self) -> float:
        """Return the relative tolerance of the Krylov method."""
        return float(self.ksp.getTolerances()[0])

    @property
    def condensed(self) -> CondensedLoads:
        """Return the unit loads, condensed to the subdomain boundaries."""
        return self.interface_operators.condensed

    @cached_property
    def _torn_displacement(self) -> Float:
        """Compute the displacements -K+ Q (boundary dofs, v) of the torn cell under the unit loads."""
        operators = self.interface_operators
        u = operators.apply_flexibility(-self.condensed.boundary)
        parts = zip(self.subdomains, operators.dofs, operators.slices, strict=True)
        return np.concatenate([u[:0], *(s.without_rounding(u[span], dofs) for s, dofs, span in parts)])

    @cached_property
    def d(self) -> Float:
        """Compute the jumps d = -B K+ Q (owned rows, v) of the torn cell.  Collective."""
        return self.operator.jump(self._torn_displacement)

    @cached_property
    def torn_stiffness(self) -> Float:
        """Compute the stiffness sum_s |Omega_s| L_s - Q^T K+ Q (v, v) of the torn cell.  Collective."""
        local = self.condensed.stiffness + self.condensed.boundary.T @ self._torn_displacement
        return np.asarray(self.comm.allreduce(local))

    def stress_integral(self, solution: DualSolution) -> Float:
        """Compute the stress integral torn_stiffness E + d^T lam (v,) of a solution.  Collective.

        With tractions on the sides, the entries -int u* (x) n ds (m,) come after the stress integral.
        """
        local = self.d.T @ solution.lam
        if self.is_pulled and (alpha := self.completed(solution).alpha) is not None:
            local = local + self._pushes.T @ alpha[self.natural.owned_modes]
        return np.asarray(self.torn_stiffness @ solution.strain + self.comm.allreduce(local))

    def set_state(self, active: Float, compliance: Float) -> None:
        """Set the active rows and the spring compliance.  Collective.

        `active` (owned rows,) is 1 on rows that carry multipliers, else 0; C = `compliance` (owned rows,) is at least
        the intact compliance.  No subdomain is factored anew.  Raises like `preconditioner.soften` and `.activate`.
        """
        changes = np.array([(active != self.jumps.active).any(), (compliance != self.operator.compliance).any()])
        self.comm.Allreduce(MPI.IN_PLACE, changes, MPI.LOR)
        rows_change, springs_change = changes
        if springs_change:
            self.preconditioner.soften(compliance - self.intact_compliance)
            self.operator.compliance = compliance
        if rows_change:
            self.jumps.active = active
            self.natural.activate(active)
        if rows_change or springs_change:
            self.preconditioner.activate(active)
            self._units = []

    @cached_property
    def _pushes(self) -> Float:
        """Compute the work R^T Q (owned modes, v + m) of tractions on kernels; 0 for the v unit loads."""
        pushes: Float = np.concatenate([self.condensed.boundary[:0], *(s.R.T @ s.Q for s in self.subdomains)])
        pushes[:, : len(self.problem.loads)] = 0.0
        return pushes

    @property
    def is_pulled(self) -> bool:
        """Return whether tractions act on the sides, and subdomains have rigid-body motions."""
        return self.natural.kernel_dimension > 0 and self.condensed.boundary.shape[1] > len(self.problem.loads)

    @property
    def closure(self) -> Float:
        """Return the v unit loads as columns: I (v, v), or (v + m, v) with tractions Sigma on the sides below I.

        Sigma makes unit strains mean strains; raises NotCarriedError if tractions pull at a free body.  Collective.
        """
        v, n = len(self.problem.loads), self.condensed.boundary.shape[1]
        if n > v and not self._units:
            free = self.natural.unconstrained_modes[self.natural.owned_modes].T @ self._pushes
            largest = self.comm.allreduce(np.abs(self._pushes).max(initial=0.0), MPI.MAX)
            if np.abs(self.comm.allreduce(free)).max(initial=0.0) > np.sqrt(np.finfo(float).eps) * largest:
                raise NotCarriedError('[cell] boundary = "traction": it pulls at bodies that have no bonds')
            self._units = self.solve_many(np.eye(n), np.zeros((self.rows, n)))
            kept = np.stack([self.stress_integral(unit)[v:] for unit in self._units], axis=1)
            self._closure = np.vstack([np.eye(v), np.linalg.solve(kept[:, v:], -kept[:, :v])])
        return self._closure

    def solve(self, strain: Float, start: Float) -> DualSolution:
        """Solve the dual problem for a load `strain` (v,) from `start` (owned rows,) by `solve_many`.  Collective."""
        return self.solve_many(strain[None], start[:, None])[0]

    def solve_many(self, strains: Float, starts: Float) -> list[DualSolution]:
        """Solve the dual problems for k loads together.  Collective.

        One Krylov method iterates on all loads, scaled to unit jumps; `DualSolution.reason` reports convergence.
        For loads (k, v) and tractions on the sides, the solutions that gave `closure` are superposed; raises like
        `closure`.  With influence columns, raises like `InfluenceSolutions.record`.

        Args:
            strains: (k, v) loads E, or (k, v + m) loads with given Sigma.
            starts: (owned rows, k) initial multipliers; ignored if `preconditioner.is_exact`.
        """
        k, columns = len(strains), (None if self.is_pulled else self._by_columns)
        if strains.shape[1] == len(self.problem.loads):
            strains = strains @ self.closure.T
            if self._units:
                return [self.jumps.superposed(self._units, loads, self.d) for loads in strains]
        self.solves += k
        if columns is not None and (solutions := columns.solutions(strains, self.d)) is not None:
            return solutions
        krylov = self._krylov_for(k)
        torn_jump, balance = self.d @ strains.T, np.zeros((self.rows, k))
        if self.is_pulled:
            balance = self.natural.balancing(-self._pushes @ strains.T)
            torn_jump -= self.operator.apply(balance)
        right = self.jumps.projected(torn_jump)
        jump = self.jumps.norms(right)
        # A load without a jump on the active rows has no multipliers.
        rounding = self.jumps.rounding(self._torn_displacement, strains.T, jump, self.jumps.norms(torn_jump))
        has_jump = jump > rounding
        scale = np.where(has_jump, jump, 1.0)
        right = np.where(has_jump, right, 0.0) / scale
        if columns is None:
            closing = self.preconditioner.closing_forces(right)
        else:
            closing = columns.closing(self.d, np.where(has_jump, strains.T, 0.0) / scale, has_jump / scale)
        closing = self.natural.project(closing)
        krylov.test.jump_scale = float(np.sqrt(has_jump.sum()))
        krylov.test.force_scale = float(np.linalg.norm(self.jumps.norms(closing)))
        starts = np.where(has_jump, self.natural.project(self.jumps.restrict(starts)), 0.0) / scale
        lam = closing if self.preconditioner.is_exact else starts
        applied, iterations, reason = np.zeros_like(lam), 0, int(PETSc.KSP.ConvergedReason.CONVERGED_ATOL)
        if has_jump.any():
            lam, applied, iterations, reason = krylov.solve(lam, right)
            extremes = krylov.extreme_values if iterations else None
            if extremes is not None:
                self.condition = max(self.condition, extremes[1] / extremes[0])
            if self._view:
                PETSc.Sys.Print(krylov.describe(iterations), comm=self.comm)
        lam, jumps = lam * scale + balance, torn_jump - applied * scale
        solutions = self.jumps.solutions(strains, lam, jumps, iterations, reason, np.maximum(jump, rounding))
        if columns is not None:
            columns.record(solutions if has_jump.all() else [], self.d)
        return solutions

    def completed(self, solution: DualSolution) -> DualSolution:
        """Return the solution with alpha; a solution that lacks alpha must belong to the present state.  Collective."""
        return solution if solution.alpha is not None else self.jumps.completed(solution, self.d)

    def boundary_displacement(self, solution: DualSolution) -> Float:
        """Complete a solution, and compute the boundary displacements u* (boundary dofs,), Eq. (34).  Collective."""
        solution = self.completed(solution)
        assert solution.alpha is not None
        u = self._torn_displacement @ solution.strain - self.operator.displacement(solution.lam)
        return np.asarray(u + self.natural.R @ solution.alpha[self.natural.owned_modes])

    def displacement(self, solution: DualSolution) -> Float:
        """Complete a solution, and compute u* (local dofs,), Eq. (34); may factor interiors.  Collective."""
        u = self.boundary_displacement(solution)
        return np.concatenate([u[:0], *(self.extended(i, u, solution.strain) for i in range(len(self.subdomains)))])

    def extended(self, place: int, u: Float, loads: Float, keep: bool = True) -> Float:
        """Extend u (boundary dofs, k) to subdomain `place`; other arguments are as in `InterfaceOperators.extend`."""
        operators = self.interface_operators
        return operators.extend(place, u[operators.slices[place]], loads, keep)

    def destroy(self) -> None:
        """Free the Krylov methods and the coarse factors after the last solve.  Collective.

        Without this call, a rank frees its Krylov methods when the last reference to the solver disappears.
        """
        self._destroy_krylov()
        self.natural.destroy()
        if self.adaptive is not None:
            self.adaptive.destroy()

    def _krylov_for(self, columns: int) -> Krylov:
        """Return the Krylov method for `columns` load cases; the first call sets it up and is collective."""
        if columns not in self._krylov:
            vector, restarts = self.jump_operator.vector, self.adaptive is not None
            self._krylov[columns] = Krylov(vector, self.preconditioner, self.jumps, columns, restarts)
            self._shells.callback(self._krylov[columns].destroy)
        return self._krylov[columns]
