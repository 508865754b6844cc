"""The FETI solver: set up once for a mesh, then one projected Krylov solve a load and a set of active rows.

With f = -Q E for the macroscopic strain E, Eqs. (34), (36), (37) read on the active rows

    F lam - G alpha = d E,  G^T lam = 0,  u* = K+ (-Q E - B^T lam) + R alpha,  d = -B K+ Q.
"""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from feti_homog.cell.refinement import ReferenceLattice
from feti_homog.common import process_memory
from feti_homog.feti import factory, view
from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.feti.decomposition.shared_entities import SharedEntities
from feti_homog.feti.decomposition.subdomain import Subdomain
from feti_homog.feti.krylov import ActiveRows, Krylov
from feti_homog.feti.operators.dual_operator import DualOperator
from feti_homog.feti.thresholds import DEFAULTS, Thresholds
from feti_homog.typing import Float

# What a coarse space that is accurate to too few digits can end in, and how often to go on from there with it.
BROKEN = (
    PETSc.KSP.ConvergedReason.DIVERGED_INDEFINITE_PC,
    PETSc.KSP.ConvergedReason.DIVERGED_INDEFINITE_MAT,
    PETSc.KSP.ConvergedReason.DIVERGED_BREAKDOWN,
)
RESTARTS = 2
# A jump that the active rows see of the torn cell's is none if it is as small as this.
ROUNDING = 1e-13


@dataclass(frozen=True)
class DualSolution:
    """The multipliers under one macroscopic strain and what follows from them on the interface.

    Attributes:
        strain: (3,) E.
        lam: (owned rows,) multipliers, nodal forces between the faces; 0 on inactive rows.
        jump: (owned rows,) B u*, 0 up to tolerance on active rows, gap and slip on the others.
        alpha: (dimension,) rigid-body amplitudes.
        iterations, reason: of the Krylov method (PETSc's KSPConvergedReason).
        residual: |B u*| on the active rows, relative to the jump of the torn cell.
    """

    strain: Float
    lam: Float
    jump: Float
    alpha: Float
    iterations: int
    reason: int
    residual: float


class FetiSolver:
    """Set-up of the dual problem; all factorizations of subdomains are made here, once.

    Options have the prefix `feti_`.
    """

    def __init__(
        self,
        comm: MPI.Intracomm,
        shared: SharedEntities,
        subdomains: Sequence[Subdomain],
        lattice: ReferenceLattice,
        applications: int,
        thresholds: Thresholds = DEFAULTS,
    ) -> None:
        """Set up; `applications` is how many times the dual operator is expected to be applied."""
        self.comm, self.subdomains = comm, subdomains
        self.jump_operator = JumpOperator(comm, shared, subdomains, lattice)
        self.boundary, self.preconditioner, self.coarse = factory.parts(
            comm, self.jump_operator, subdomains, applications, thresholds
        )
        self.operator = DualOperator(self.jump_operator, self.boundary)
        process_memory.trim()
        self.active = ActiveRows(self.rows)
        self._view = PETSc.Options("feti_").getBool("view", False)
        self._krylov: dict[int, Krylov] = {}
        # Left to PETSc's finalization, the shells would call a Python that is gone.
        self._release = weakref.finalize(self, _free, self._krylov)
        self._solver_for(1)
        self.solves = 0
        if self._view:
            PETSc.Sys.Print(view.setup(comm, self.boundary, self.preconditioner, self.coarse), comm=comm)

    @property
    def rows(self) -> int:
        """Number of multipliers that this rank owns."""
        return self.jump_operator.owned[1] - self.jump_operator.owned[0]

    @property
    def ksp(self) -> PETSc.KSP:
        """The Krylov method for one load case."""
        return self._solver_for(1).ksp

    @property
    def rtol(self) -> float:
        """Relative tolerance of the Krylov method."""
        return float(self.ksp.getTolerances()[0])

    @property
    def Q(self) -> Float:
        """(local dofs, 3) loads of the unit strains, f = -Q E."""
        return np.concatenate([np.zeros((0, 3)), *(s.Q for s in self.subdomains)])

    @cached_property
    def loads(self) -> Float:
        """(boundary dofs, 3) Q there; inside the uniform bodies it vanishes."""
        return self.Q[self.boundary.local_dofs]

    @cached_property
    def _torn(self) -> Float:
        """(boundary dofs, 3) K+ (-Q), the torn cell under the unit strains."""
        return self.boundary.apply_flexibility(-self.loads)

    @cached_property
    def d(self) -> Float:
        """(owned rows, 3) jumps -B K+ Q of the torn cell under the unit strains."""
        return self.operator.jump(self._torn)

    @cached_property
    def torn_stiffness(self) -> Float:
        """(3, 3) sum |Omega_s| L_s - Q^T K+ Q: the stress integral of the torn cell under the unit strains."""
        local = sum((s.area * s.L for s in self.subdomains), self.loads.T @ self._torn)
        return np.asarray(self.comm.allreduce(local))

    def stress_integral(self, solution: DualSolution) -> Float:
        """(3,) |UC| Sigma = int sigma, from the multipliers alone: the torn cell's plus d^T lam."""
        forces = self.comm.allreduce(self.d.T @ solution.lam)
        return np.asarray(self.torn_stiffness @ solution.strain + forces)

    def activate(self, active: Float) -> None:
        """Let only the owned rows where `active` is 1 carry multipliers; refactors the coarse problem alone."""
        if self.comm.allreduce(bool((active != self.active.mask).any()), MPI.LOR):
            self.active.mask = active
            self.coarse.activate(active)
            self.preconditioner.activate(active)

    def solve(self, strain: Float, start: Float) -> DualSolution:
        """Solve for the strain (3,), beginning with the multipliers `start` (owned rows,).

        Not to converge is no error here: the solution says so in its `reason`.
        """
        return self.solve_together(strain[None], start[:, None])[0]

    def solve_together(self, strains: Float, starts: Float) -> list[DualSolution]:
        """Solve for k strains (k, 3) at once, beginning with the multipliers `starts` (owned rows, k).

        One Krylov method works on all of them side by side, each scaled by the jump of its torn cell.
        """
        k = len(strains)
        krylov = self._solver_for(k)
        torn = self.d @ strains.T
        free = self.coarse.projected(self.active.restrict(torn))
        jump, least = self._norms(free), ROUNDING * self._norms(torn)
        # A load that the active rows do not see has no multipliers.
        seen = jump > least
        scale = np.where(seen, jump, 1.0)
        free = np.where(seen, free, 0.0) / scale
        self.solves += k
        closing = self.coarse.projected(self.preconditioner.apply(free))
        krylov.test.start(float(np.sqrt(seen.sum())), float(np.linalg.norm(self._norms(closing))))
        starts = np.where(seen, self.coarse.projected(self.active.restrict(starts)), 0.0) / scale
        lam = self.preconditioner.first(starts, closing)
        iterations, reason = 0, int(PETSc.KSP.ConvergedReason.CONVERGED_ATOL)
        if seen.any():
            lam, iterations, reason = self._converged(krylov, lam, free)
            if self._view:
                PETSc.Sys.Print(view.solve(krylov.ksp, k), comm=self.comm)
        return self._recover(strains, lam * scale, torn, iterations, reason, np.maximum(jump, least))

    def _converged(self, krylov: Krylov, lam: Float, free: Float) -> tuple[Float, int, int]:
        """Multipliers, iterations, and why they ended.

        Of coarse vectors that depend on each other, rounding makes the preconditioner indefinite or the iteration
        stagnate.  A fresh start takes away what the coarse space can; if that is not enough, rigid-body motions are.
        """
        iterations = 0
        for restart in range(RESTARTS + 2):
            if restart > RESTARTS and not self.coarse.simplify():
                break
            lam, more, reason = self._improved(krylov, lam, free)
            iterations += more
            if reason not in BROKEN:
                break
        return lam, iterations, reason

    def _improved(self, krylov: Krylov, lam: Float, free: Float) -> tuple[Float, int, int]:
        """The same by one Krylov solve."""
        lam, residual = self._begin(lam, free)
        lam = lam + krylov.solve(residual)
        return lam, krylov.ksp.getIterationNumber(), int(krylov.ksp.getConvergedReason())

    def destroy(self) -> None:
        """Free PETSc's shell objects and the coarse factor; collective.  The shells go with the solver anyway."""
        self._release()
        self.coarse.destroy()

    def boundary_displacement(self, solution: DualSolution) -> Float:
        """(boundary dofs,) u* of a solution, Eq. (34)."""
        u = self._torn @ solution.strain - self.operator.displacement(solution.lam)
        return np.asarray(u + self.coarse.motion(solution.alpha))

    def displacement(self, solution: DualSolution) -> Float:
        """(local dofs,) u* of a solution; factors the interiors when first called."""
        return self.boundary.extend(self.boundary_displacement(solution))

    def _begin(self, lam: Float, free: Float) -> tuple[Float, Float]:
        """First multipliers, improved by the coarse space, and the residual that they leave."""
        residual = free
        if self._norms(lam).any():
            residual = self.coarse.projected(free - self.active.restrict(self.operator.apply(lam)))
        # Where they are no help, nothing is a better beginning.
        worse = self._norms(residual) > self._norms(free)
        lam, residual = np.where(worse, 0.0, lam), np.where(worse, free, residual)
        return self.coarse.improved(lam, residual, lambda z: self.active.restrict(self.operator.apply(z)))

    def _recover(
        self, strains: Float, lam: Float, torn: Float, iterations: int, reason: int, scale: Float
    ) -> list[DualSolution]:
        jump = torn - self.operator.apply(lam)
        alpha = np.zeros((self.coarse.dimension, len(strains)))
        if self.coarse.dimension:
            alpha -= self.coarse.amplitudes(self.active.restrict(jump))
            jump = jump + self.coarse.G @ alpha
        residual = self._norms(self.active.restrict(jump)) / np.where(scale > 0, scale, 1.0)
        return [
            DualSolution(
                strain, lam[:, k].copy(), jump[:, k].copy(), alpha[:, k].copy(), iterations, reason, float(residual[k])
            )
            for k, strain in enumerate(strains)
        ]

    def _norms(self, x: Float) -> Float:
        """Norms of the columns of x (owned rows, k)."""
        return np.sqrt(self.coarse.everywhere(np.einsum("ik,ik->k", x, x)))

    def _solver_for(self, columns: int) -> Krylov:
        if columns not in self._krylov:
            vector, parts = self.jump_operator.vector, (self.operator, self.preconditioner, self.coarse, self.active)
            self._krylov[columns] = Krylov(vector, *parts, columns)
            if self._view:
                self._krylov[columns].ksp.setComputeSingularValues(True)
        return self._krylov[columns]


def _free(krylov: dict[int, Krylov]) -> None:
    for solver in krylov.values():
        solver.destroy()
    krylov.clear()
