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
from numpy.typing import NDArray
from petsc4py import PETSc

from feti_homog.cell.refine import Lattice
from feti_homog.errors import CaseError
from feti_homog.feti.coarse import CoarseProblem
from feti_homog.feti.constraints import Constraints
from feti_homog.feti.contexts import ActiveRows, PrimalTest, ProjectedOperator, ProjectedPreconditioner
from feti_homog.feti.explicit import DenseBlocks, ExplicitDualOperator
from feti_homog.feti.local import LocalSolver
from feti_homog.feti.operator import DualOperator
from feti_homog.feti.preconditioner import (
    Dirichlet,
    Identity,
    Lumped,
    Preconditioner,
    Scaled,
    boundary_stiffness,
)
from feti_homog.feti.shared import Shared
from feti_homog.feti.subdomain import Subdomain

Int = NDArray[np.int64]
Float = NDArray[np.float64]

PRECONDITIONERS = ("none", "lumped", "dirichlet")
DUAL_OPERATORS = ("auto", "implicit", "explicit")
# Boundary dofs of a subdomain up to which a dense operator (8 n^2 bytes) is ever chosen by itself.
LARGEST_DENSE = 6000
# Applications from which on it is taken to pay; three bonded load cases make fewer.
PAYS = 60
RTOL = 1e-8
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
        shared: Shared,
        subdomains: Sequence[Subdomain],
        lattice: Lattice,
        applications: int,
    ) -> None:
        """Set up; `applications` is how many times the dual operator is expected to be applied."""
        self.comm, self.subdomains = comm, subdomains
        self.constraints = Constraints(comm, shared, subdomains, lattice)
        self.boundary = self._boundary_dofs()
        # A single subdomain has no boundary: any of its nodes can be fixed.
        candidates = [
            np.unique(dofs // 2) if len(dofs) else np.arange(s.mesh.n_classes)
            for s, dofs in zip(subdomains, self.boundary, strict=True)
        ]
        matrices = [s.regularised(nodes) for s, nodes in zip(subdomains, candidates, strict=True)]
        self.local = LocalSolver(matrices, "feti_sub_")
        self.operator = self._dual_operator(applications)
        self.coarse = CoarseProblem(comm, self.constraints, subdomains)
        self.preconditioner = self._preconditioner()
        self.active = ActiveRows(self.rows)
        self._projected = ProjectedPreconditioner(self.preconditioner, self.coarse)
        self._test = PrimalTest(self._projected)
        self._rhs, self._w = self.constraints.vector.duplicate(), self.constraints.vector.duplicate()
        self.ksp = self._krylov()
        # Left to PETSc's finalization, the shells would call a Python that is gone.
        self._release = weakref.finalize(self, _free, self.ksp)
        self.solves = 0

    @property
    def rows(self) -> int:
        """Number of multipliers that this rank owns."""
        return self.constraints.owned[1] - self.constraints.owned[0]

    @property
    def rtol(self) -> float:
        """Relative tolerance of the primal residuals."""
        return float(self.ksp.getTolerances()[0])

    @cached_property
    def Q(self) -> Float:
        """(local dofs, 3) loads of the unit strains, f = -Q E."""
        return np.concatenate([s.Q for s in self.subdomains] or [np.zeros((0, 3))])

    @cached_property
    def _torn(self) -> Float:
        """(local dofs, 3) K+ (-Q), the torn cell under the unit strains."""
        nothing = np.zeros(self.rows)
        columns = [self.operator.displacement(-q, nothing) for q in self.Q.T]
        return np.stack(columns, axis=1)

    @cached_property
    def d(self) -> Float:
        """(owned rows, 3) jumps -B K+ Q of the torn cell under the unit strains."""
        return np.stack([self.operator.jump(u) for u in self._torn.T], axis=1)

    @cached_property
    def torn_stiffness(self) -> Float:
        """(3, 3) sum |Omega_s| L_s - Q^T K+ Q: the stress integral of the torn cell under the unit strains."""
        local = sum((s.area * s.L for s in self.subdomains), self.Q.T @ self._torn)
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
        lam, torn = start * self.active.mask, self.d @ strain
        self.coarse.project(lam)
        free = self.active.mask * torn
        self.coarse.project(free)
        closing = self.preconditioner.apply(free)
        self.coarse.project(closing)
        self.solves += 1
        jump, least = self._norm(free), ROUNDING * self._norm(torn)
        self._test.start(max(jump, least), self._norm(closing))
        iterations, reason = 0, int(PETSc.KSP.ConvergedReason.CONVERGED_ATOL)
        if jump <= least:
            lam[:] = 0.0
        else:
            self._w.zeroEntries()
            residual = free - self.active.mask * self.operator.apply(lam)
            self.coarse.project(residual)
            if self._norm(residual) > jump:
                # No help: nothing is a better beginning.
                lam[:], residual = 0.0, free
            self._rhs.setArray(residual)
            self.ksp.solve(self._rhs, self._w)
            iterations, reason = self.ksp.getIterationNumber(), int(self.ksp.getConvergedReason())
            lam += self._w.getArray(readonly=True)
        return self._recover(strain, lam, torn, iterations, reason)

    def destroy(self) -> None:
        """Free PETSc's shell objects; collective.  Otherwise it is done when the solver, or Python, ends."""
        self._release()

    def displacement(self, solution: DualSolution) -> Float:
        """(local dofs,) u* of a solution, Eq. (34)."""
        u = self.operator.displacement(-self.Q @ solution.strain, solution.lam)
        return u + self.coarse.motion(solution.alpha)

    def _recover(self, strain: Float, lam: Float, torn: Float, iterations: int, reason: int) -> DualSolution:
        jump = torn - self.operator.apply(lam)
        alpha = np.zeros(self.coarse.dimension)
        if self.coarse.dimension:
            alpha -= self.coarse.amplitudes(self.active.mask * jump)
            jump += self.coarse.G @ alpha
        residual = self._norm(self.active.mask * jump) / (self._test.jump or 1.0)
        return DualSolution(strain, lam, jump, alpha, iterations, reason, residual)

    def _norm(self, x: Float) -> float:
        return float(np.sqrt(self.comm.allreduce(x @ x)))

    def _preconditioner(self) -> Preconditioner:
        name = PETSc.Options("feti_").getString("pc_type", "dirichlet")
        if name not in PRECONDITIONERS:
            raise CaseError(f"-feti_pc_type {name}: expected one of {', '.join(PRECONDITIONERS)}")
        if name == "none":
            return Identity()
        K = [s.K for s in self.subdomains]
        S: Lumped | Dirichlet | DenseBlocks
        if isinstance(self.operator, ExplicitDualOperator) and name == "dirichlet":
            S = self.operator.schur
        else:
            S = boundary_stiffness(K, self.boundary, name == "dirichlet")
        return Scaled(self.comm, self.constraints, K, S, self.boundary)

    def _boundary_dofs(self) -> list[Int]:
        """Local numbers of the dofs of each subdomain that constraints act on, both directions of a node."""
        touched = self.constraints.B.getnnz(axis=0).reshape(-1, 2).any(axis=1)
        nodes = np.split(touched, np.cumsum([s.mesh.n_classes for s in self.subdomains]))[:-1]
        return [(2 * np.flatnonzero(n)[:, None] + np.arange(2)).ravel() for n in nodes]

    def _dual_operator(self, applications: int) -> DualOperator:
        """Explicit where it pays: where the dense matrices are small and the operator is applied often enough."""
        kind = PETSc.Options("feti_").getString("dual_operator", "auto")
        if kind not in DUAL_OPERATORS:
            raise CaseError(f"-feti_dual_operator {kind}: expected one of {', '.join(DUAL_OPERATORS)}")
        largest = self.comm.allreduce(max((len(dofs) for dofs in self.boundary), default=0), MPI.MAX)
        pays = applications >= PAYS and largest <= LARGEST_DENSE and PETSc.Sys.hasExternalPackage("mumps")
        if kind == "explicit" or (kind == "auto" and pays):
            return ExplicitDualOperator(self.constraints, self.local, self.subdomains, self.boundary)
        return DualOperator(self.constraints, self.local)

    def _krylov(self) -> PETSc.KSP:
        vector = self.constraints.vector
        sizes = (vector.getSizes(), vector.getSizes())
        A = PETSc.Mat().createPython(
            sizes, ProjectedOperator(self.operator, self.coarse, self.active), comm=self.comm
        )
        A.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        A.setUp()
        ksp = PETSc.KSP().create(self.comm)
        ksp.setOptionsPrefix("feti_")
        ksp.setOperators(A)
        ksp.setType(PETSc.KSP.Type.CG)
        ksp.setNormType(PETSc.KSP.NormType.PRECONDITIONED)
        ksp.setTolerances(rtol=RTOL, atol=0.0, max_it=2000)
        ksp.setConvergenceTest(self._test)
        pc = ksp.getPC()
        pc.setType(PETSc.PC.Type.PYTHON)
        pc.setOptionsPrefix("feti_projected_")
        pc.setPythonContext(self._projected)
        ksp.setFromOptions()
        return ksp


def _free(ksp: PETSc.KSP) -> None:
    ksp.getOperators()[0].destroy()
    ksp.destroy()
