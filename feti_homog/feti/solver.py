"""The FETI solver: set up once for a mesh, then one projected Krylov solve a load, Eqs. (34), (36), (37)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from feti_homog.cell.refine import Lattice
from feti_homog.errors import CaseError
from feti_homog.feti.coarse import CoarseProblem
from feti_homog.feti.constraints import Constraints
from feti_homog.feti.local import LocalSolver
from feti_homog.feti.operator import DualOperator
from feti_homog.feti.preconditioner import Identity, Scaled, boundary_stiffness
from feti_homog.feti.shared import Shared
from feti_homog.feti.subdomain import Subdomain

Float = NDArray[np.float64]

PRECONDITIONERS = ("none", "lumped", "dirichlet")
RTOL = 1e-8


@dataclass(frozen=True)
class Solution:
    """The response to one load, this rank's share.

    Attributes:
        u: (local dofs,) fluctuating displacement u*, the subdomains one after the other.
        lam: multipliers, nodal forces between the faces.
        jump: (owned rows,) B u.
        iterations, reason: of the Krylov method (PETSc's KSPConvergedReason).
        jump_norm: |B u| relative to the jump of the torn cell under this load.
        residuals: history of the jump, one an iteration.
    """

    u: Float
    lam: PETSc.Vec
    jump: Float
    iterations: int
    reason: int
    jump_norm: float
    residuals: tuple[float, ...]


class FetiSolver:
    """K u = f - B^T lam on every subdomain, B u = 0 between them.

    All factorizations and the coarse problem are made here, once.  Options have the prefix `feti_`.
    """

    def __init__(self, comm: MPI.Comm, shared: Shared, subdomains: Sequence[Subdomain], lattice: Lattice) -> None:
        self.comm, self.subdomains = comm, subdomains
        self.constraints = Constraints(comm, shared, subdomains, lattice)
        self.local = LocalSolver([s.regularised() for s in subdomains], "feti_sub_")
        self.operator = DualOperator(self.constraints, self.local)
        self.coarse = CoarseProblem(comm, self.constraints, [s.R for s in subdomains])
        self.preconditioner = self._preconditioner()
        self._lam0, self._rhs, self._w = (self.constraints.vector.duplicate() for _ in range(3))
        self._monitor = _PrimalTest()
        self.ksp = self._krylov()

    def solve(self, f: Float) -> Solution:
        """Solve for the local loads f (local dofs,).

        Not to converge is no error here: the solution says so in its `reason`.
        """
        lam, rhs, w = self._lam0, self._rhs, self._w
        self.coarse.balance(f, lam)
        self.operator.jump(self.operator.displacement(f, lam), rhs)
        self.coarse.apply(rhs)
        self._monitor.start(rhs.norm())
        w.zeroEntries()
        if rhs.getSize() and self._monitor.reference > 0:
            self.ksp.solve(rhs, w)
        lam.axpy(1.0, w)
        return self._recover(f, lam)

    @property
    def rtol(self) -> float:
        """Relative tolerance of the primal residuals."""
        return float(self.ksp.getTolerances()[0])

    def _recover(self, f: Float, lam: PETSc.Vec) -> Solution:
        """u = K+ (f - B^T lam) + R alpha, Eq. (34), with alpha from the jump of the first term."""
        u = self.operator.displacement(f, lam)
        jump = self.constraints.vector.duplicate()
        self.operator.jump(u, jump)
        u -= self.coarse.rigid_motion(jump)
        self.operator.jump(u, jump)
        iterations, reason = self.ksp.getIterationNumber(), int(self.ksp.getConvergedReason())
        norm = jump.norm() / (self._monitor.reference or 1.0)
        return Solution(
            u, lam.copy(), jump.getArray().copy(), iterations, reason, norm, tuple(self._monitor.jumps)
        )

    def _preconditioner(self) -> Identity | Scaled:
        name = PETSc.Options("feti_").getString("pc_type", "dirichlet")
        if name not in PRECONDITIONERS:
            raise CaseError(f"-feti_pc_type {name}: expected one of {', '.join(PRECONDITIONERS)}")
        if name == "none":
            return Identity()
        K = [s.K for s in self.subdomains]
        boundary = self.constraints.B.getnnz(axis=0) > 0
        S = boundary_stiffness(K, boundary, name == "dirichlet")
        return Scaled(self.comm, self.constraints, K, S, boundary)

    def _krylov(self) -> PETSc.KSP:
        vector = self.constraints.vector
        sizes = (vector.getSizes(), vector.getSizes())
        A = PETSc.Mat().createPython(sizes, _ProjectedOperator(self.operator, self.coarse), comm=self.comm)
        A.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        A.setUp()
        ksp = PETSc.KSP().create(self.comm)
        ksp.setOptionsPrefix("feti_")
        ksp.setOperators(A)
        ksp.setType(PETSc.KSP.Type.CG)
        ksp.setTolerances(rtol=RTOL, atol=0.0, max_it=2000)
        ksp.setConvergenceTest(self._monitor.test)
        pc = ksp.getPC()
        pc.setType(PETSc.PC.Type.PYTHON)
        pc.setOptionsPrefix("feti_projected_")
        pc.setPythonContext(_ProjectedPreconditioner(self.preconditioner, self.coarse, self._monitor))
        ksp.setFromOptions()
        return ksp


class _ProjectedOperator:
    """y = P F x; x is in the range of P."""

    def __init__(self, operator: DualOperator, coarse: CoarseProblem) -> None:
        self.operator, self.coarse = operator, coarse

    def mult(self, mat: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        self.operator.mult(x, y)
        self.coarse.apply(y)


class _ProjectedPreconditioner:
    """z = P M^-1 r; notes |r|, which is the interface jump |B u| of the iterate."""

    def __init__(self, preconditioner: Identity | Scaled, coarse: CoarseProblem, monitor: _PrimalTest) -> None:
        self.preconditioner, self.coarse, self.monitor = preconditioner, coarse, monitor

    def apply(self, pc: PETSc.PC, r: PETSc.Vec, z: PETSc.Vec) -> None:
        self.monitor.jumps.append(r.norm())
        self.preconditioner.apply(r, z)
        self.coarse.apply(z)


class _PrimalTest:
    """Converged when both primal residuals are below rtol: the jump, and the forces it takes to close it.

    The jump is |P r| relative to that of the torn cell; the forces are the Krylov method's preconditioned
    residual relative to its first.  A small dual residual alone can hide a large one of these.
    """

    def __init__(self) -> None:
        self.reference, self.forces = 0.0, 0.0
        self.jumps: list[float] = []

    def start(self, reference: float) -> None:
        self.reference, self.jumps = reference, []

    def test(self, ksp: PETSc.KSP, iteration: int, residual: float) -> PETSc.KSP.ConvergedReason:
        rtol, atol, divtol, _ = ksp.getTolerances()
        if not np.isfinite(residual):
            return PETSc.KSP.ConvergedReason.DIVERGED_NANORINF
        if iteration == 0:
            self.forces = residual
        if residual > divtol * self.forces:
            return PETSc.KSP.ConvergedReason.DIVERGED_DTOL
        if residual <= atol:
            return PETSc.KSP.ConvergedReason.CONVERGED_ATOL
        if residual <= rtol * self.forces and self.jumps[-1] <= rtol * self.reference:
            return PETSc.KSP.ConvergedReason.CONVERGED_RTOL
        return PETSc.KSP.ConvergedReason.ITERATING
