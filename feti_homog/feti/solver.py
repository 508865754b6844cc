"""The FETI solver: set up once for a mesh, then one projected Krylov solve a load and a set of active rows.

With f = -Q E for the v unit loads E, the macroscopic strain first, Eqs. (34), (36), (37) read on the active rows

    (F + C) lam - G alpha = d E,  G^T lam = 0,  u* = K+ (-Q E - B^T lam) + R alpha,  d = -B K+ Q.

C is the compliance of elastic bonds, 0 of glue; then the faces part by B u* = C lam.
"""

import weakref
from collections.abc import Sequence
from contextlib import ExitStack
from functools import cached_property

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from feti_homog.fem import PLANE, Problem
from feti_homog.feti import factory
from feti_homog.feti.decomposition.jump_operator import GLUE, InterfaceSprings, JumpOperator
from feti_homog.feti.decomposition.shared_entities import SharedEntities
from feti_homog.feti.decomposition.subdomain import Subdomain
from feti_homog.feti.dual_solution import ActiveJumps, ActiveRows, DualSolution
from feti_homog.feti.krylov import Krylov
from feti_homog.feti.operators.interface_operators import DualOperator
from feti_homog.feti.operators.one_subdomain import CondensedLoads
from feti_homog.feti.thresholds import DEFAULTS, MOST_DOFS_UNTRIMMED, Thresholds
from feti_homog.mesh import ReferenceLattice
from feti_homog.system.runtime import process_memory
from feti_homog.typing import Float


class FetiSolver:
    """The dual problem of a torn cell: set up once, solved for many loads and states.

    The set-up factors every subdomain; `displacement` may factor interiors.  Options have the prefix `feti_`.

    Attributes:
        problem: the displacements and the unit loads.
        jump_operator: B and the layout of the multipliers.
        interface_operators: S and S+ of this rank's subdomains.
        intact_compliance: (owned rows,) C of the springs before any has softened.
        operator: F + C.
        preconditioner: M^-1, or H_0 with the adaptive coarse space.
        exact_inverse: the preconditioner, if it is the inverse of the dual operator; else None.
        natural: the rigid-body motions, G and P.
        adaptive: the coarse space of the preconditioner, if it has one.
        coarse_dimension: number of coarse displacements, or of rigid-body motions without `adaptive`.
        active: the rows that carry multipliers.
        solves: number of dual problems so far, one for each load.
        condition: largest condition number of P H P F so far, estimated by the iterations; 0 without any.
        method: the preconditioner and the coarse space in words.
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
        """Set up; `applications` is the expected number of applications of F, `recovers` as in `factory.build`.

        Collective.

        Raises:
            CaseError: an option has no such value, or two exclude each other.
        """
        self.comm, self.subdomains, self.problem = comm, subdomains, problem
        self.jump_operator = JumpOperator(comm, shared, subdomains, lattice, problem)
        self.intact_compliance = compliance = springs.compliance(self.jump_operator)
        options = applications, compliance, springs.soften, thresholds, recovers
        parts = factory.build(comm, self.jump_operator, subdomains, *options)
        self.interface_operators, self.preconditioner = parts.operators, parts.preconditioner
        self.exact_inverse, self.method = parts.exact_inverse, parts.method
        self.natural, self.adaptive, self.coarse_dimension = parts.natural, parts.adaptive, parts.coarse_dimension
        self.operator = DualOperator(self.interface_operators, compliance)
        if sum(s.n_dofs for s in subdomains) > MOST_DOFS_UNTRIMMED:
            process_memory.trim()
        self.active = ActiveRows(self.rows)
        self._jumps = ActiveJumps(comm, self.operator, self.natural, self.active)
        self._by_columns = None
        if self.exact_inverse is not None:
            from feti_homog.feti.confirmation import InfluenceSolutions  # with the modules of the exact inverse

            self._by_columns = InfluenceSolutions(comm, self.exact_inverse, self.operator, self.natural, self._jumps)
        self._view = PETSc.Options("feti_").getBool("view", False)
        # The shells call Python, so they are destroyed with the solver: PETSc's own finalization comes when the
        # interpreter has already shut down.
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
        """Number of multipliers that this rank owns."""
        return self.jump_operator.owned[1] - self.jump_operator.owned[0]

    @property
    def ksp(self) -> PETSc.KSP:
        """The Krylov method for one load case."""
        return self._krylov_for(1).ksp

    @property
    def rtol(self) -> float:
        """Relative tolerance of the Krylov method."""
        return float(self.ksp.getTolerances()[0])

    @property
    def condensed(self) -> CondensedLoads:
        """The unit loads condensed to the boundaries."""
        return self.interface_operators.condensed

    @cached_property
    def _torn_displacement(self) -> Float:
        """Displacements -K+ Q (boundary dofs, v) of the torn cell under the unit loads."""
        operators, u = self.interface_operators, self.interface_operators.apply_flexibility(-self.condensed.boundary)
        parts = zip(self.subdomains, operators.dofs, operators.slices, strict=True)
        return np.concatenate([u[:0], *(s.without_rounding(u[span], dofs) for s, dofs, span in parts)])

    @cached_property
    def d(self) -> Float:
        """Jumps d = -B K+ Q (owned rows, v) of the torn cell under the unit loads."""
        return self.operator.jump(self._torn_displacement)

    @cached_property
    def torn_stiffness(self) -> Float:
        """Stress integral (v, v) of the torn cell under the unit loads: sum |Omega_s| L_s - Q^T K+ Q."""
        local = self.condensed.stiffness + self.condensed.boundary.T @ self._torn_displacement
        return np.asarray(self.comm.allreduce(local))

    def stress_integral(self, solution: DualSolution) -> Float:
        """Compute |UC| Sigma = int sigma (v,): the stress integral of the torn cell plus d^T lam.  Collective."""
        forces = self.comm.allreduce(self.d.T @ solution.lam)
        return np.asarray(self.torn_stiffness @ solution.strain + forces)

    def set_state(self, active: Float, compliance: Float) -> None:
        """Set the rows that carry multipliers, where `active` is 1, and the compliance C (owned rows,).  Collective.

        C must not fall below its first value.  Only the coarse problem is factored anew.  Raises as
        `Preconditioner.soften`.
        """
        changed = bool((active != self.active.mask).any()) + 2 * bool((compliance != self.operator.compliance).any())
        change = self.comm.allreduce(changed, MPI.BOR)
        if change >= 2:
            self.preconditioner.soften(compliance - self.intact_compliance)
            self.operator.compliance = compliance
        if change % 2:
            self.active.mask = active
            self.natural.activate(active)
        if change:
            self.preconditioner.activate(active)

    def solve(self, strain: Float, start: Float) -> DualSolution:
        """Solve for one load (v,), beginning with the multipliers `start` (owned rows,).  Collective."""
        return self.solve_many(strain[None], start[:, None])[0]

    def solve_many(self, strains: Float, starts: Float) -> list[DualSolution]:
        """Solve for k loads (k, v) together, beginning with the multipliers `starts` (owned rows, k).  Collective.

        One Krylov method solves for all loads, each scaled by the jump that it makes in the torn cell.
        """
        k = len(strains)
        self.solves += k
        if (
            self._by_columns is not None
            and (solutions_by_columns := self._by_columns.solutions(strains, self.d)) is not None
        ):
            return solutions_by_columns
        krylov = self._krylov_for(k)
        torn_jump = self.d @ strains.T
        torn = self._jumps.norms(torn_jump)
        right = self._jumps.projected(torn_jump)
        jump = self._jumps.norms(right)
        # A load that the active rows do not see has no multipliers.
        rounding = self._jumps.rounding(self._torn_displacement, strains.T, jump, torn)
        is_seen = jump > rounding
        scale = np.where(is_seen, jump, 1.0)
        right = np.where(is_seen, right, 0.0) / scale
        E, columns = np.where(is_seen, strains.T, 0.0) / scale, self._by_columns
        forces = self.preconditioner.closing_forces
        closing = forces(right) if columns is None else columns.closing(self.d, E, is_seen / scale)
        closing = self.natural.project(closing)
        krylov.test.jump_scale = float(np.sqrt(is_seen.sum()))
        krylov.test.force_scale = float(np.linalg.norm(self._jumps.norms(closing)))
        starts = np.where(is_seen, self.natural.project(self.active.restrict(starts)), 0.0) / scale
        lam = closing if self.preconditioner.is_exact else starts
        applied, iterations, reason = np.zeros_like(lam), 0, int(PETSc.KSP.ConvergedReason.CONVERGED_ATOL)
        if is_seen.any():
            lam, applied, iterations, reason = krylov.solve(lam, right)
            smallest, largest = krylov.extreme_values or (1.0, self.condition)
            self.condition = max(self.condition, largest / smallest)
            if self._view:
                PETSc.Sys.Print(krylov.describe(iterations), comm=self.comm)
        parts = lam * scale, torn_jump - applied * scale, iterations, reason, np.maximum(jump, rounding)
        solutions = self._jumps.solutions(strains, *parts)
        if self._by_columns is not None:
            self._by_columns.record(solutions if is_seen.all() else [], self.d)
        return solutions

    def completed(self, solution: DualSolution) -> DualSolution:
        """Complete a solution of the present state by F lambda, if F lambda did not confirm it.  Collective."""
        return solution if solution.alpha is not None else self._jumps.completed(solution, self.d)

    def boundary_displacement(self, solution: DualSolution) -> Float:
        """Compute u* (boundary dofs,), Eq. (34), of a complete or a present solution.  Collective."""
        solution = self.completed(solution)
        assert solution.alpha is not None
        u = self._torn_displacement @ solution.strain - self.operator.displacement(solution.lam)
        return np.asarray(u + self.natural.rigid_body_motion(solution.alpha))

    def displacement(self, solution: DualSolution) -> Float:
        """Compute u* (local dofs,) of a solution; the first call may factor interiors.  Collective."""
        u, places = self.boundary_displacement(solution), range(len(self.subdomains))
        return np.concatenate([np.zeros(0), *(self.extended(place, u, solution.strain) for place in places)])

    def extended(self, place: int, u: Float, loads: Float, keep: bool = True) -> Float:
        """Extend u (boundary dofs, k) to one subdomain: (dofs, k); see `InterfaceOperators.extend`."""
        operators = self.interface_operators
        return operators.extend(place, u[operators.slices[place]], loads, keep)

    def destroy(self) -> None:
        """Free the Krylov methods and the coarse factor, after the last solve; collective.

        Otherwise each rank frees its Krylov methods with the last reference to the solver.
        """
        self._destroy_krylov()
        self.natural.destroy()
        if self.adaptive is not None:
            self.adaptive.destroy()

    def _krylov_for(self, columns: int) -> Krylov:
        """Return the Krylov method for this number of load cases, set up at the first call."""
        if columns not in self._krylov:
            parts = self.jump_operator.vector, self.preconditioner, self._jumps, columns
            self._krylov[columns] = Krylov(*parts, restarts=self.adaptive is not None)
            self._shells.callback(self._krylov[columns].destroy)
        return self._krylov[columns]
