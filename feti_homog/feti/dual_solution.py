"""Solutions of the dual problem, and projected jumps on the active rows."""

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from scipy.sparse.linalg import splu

from feti_homog.feti.coarse.natural import NaturalCoarseSpace
from feti_homog.feti.linalg.sparse_matrices import allreduce_sparse
from feti_homog.feti.operators.interface_operators import DualOperator
from feti_homog.feti.thresholds import ROUNDING_MARGIN, ZERO_JUMP
from feti_homog.system.parallel import distributed_arrays
from feti_homog.typing import Float


@dataclass(frozen=True)
class DualSolution:
    """The multipliers under one load, with the resulting jumps.

    Attributes:
        strain: (v,) load E, the macroscopic strain first, then the other loads of the problem.
        lam: (owned rows,) multipliers, nodal forces between the faces; 0 on inactive rows.
        jump: (owned rows,) B u* - C lam, 0 up to tolerance on active rows, gap and slip on inactive rows.
        alpha: (kernel dimension,) rigid-body amplitudes; None if F lambda did not confirm the multipliers.
        iterations, reason: iterations of the Krylov method, and PETSc's KSPConvergedReason.
        residual: |B u* - C lam| on the active rows, relative to the jump of the torn cell; without alpha, the residual
            of the last confirmed solution.
        compliance: (owned rows,) C of the springs in this state.
    """

    strain: Float
    lam: Float
    jump: Float
    alpha: Float | None
    iterations: int
    reason: int
    residual: float
    compliance: Float

    @property
    def opening(self) -> Float:
        """Return B u* (owned rows,): spring elongations on active rows, jumps on inactive rows."""
        return self.jump + self.compliance * self.lam


class ActiveRows:
    """The owned rows that carry multipliers: `mask` (owned rows,) is 1 on active rows, else 0."""

    def __init__(self, rows: int) -> None:
        self.mask = np.ones(rows)

    def restrict(self, x: Float) -> Float:
        """Set x (rows,) or (rows, k) to 0 on the inactive rows."""
        return distributed_arrays.scale_rows(self.mask, x)


class ActiveJumps:
    """The projection of jumps on the active rows, and norms over all ranks.  All calls are collective."""

    def __init__(
        self, comm: MPI.Intracomm, operator: DualOperator, natural: NaturalCoarseSpace, active: ActiveRows
    ) -> None:
        self.comm, self.operator, self.natural, self.active = comm, operator, natural, active
        self._rounding: Float | None = None

    def norms(self, x: Float) -> Float:
        """Compute the Euclidean norms (k,) of the columns of x (owned rows, k)."""
        norms: Float = np.sqrt(distributed_arrays.allreduce_sum(self.comm, np.einsum("ik,ik->k", x, x)))
        return norms

    def projected(self, x: Float) -> Float:
        """Project the jumps x (owned rows, k) on the active rows.

        A single projection leaves rounding of rigid-body motions, on which a Krylov method stalls.
        """
        return self.natural.project(self.natural.project(self.active.restrict(x)))

    def rounding(self, displacement: Float, loads: Float, seen: Float, torn: Float) -> Float:
        """Bound the rounding (k,) in the torn cell's active jumps under loads (v, k).

        Only a jump that may be rounding needs the estimate of `jump_rounding`.

        Args:
            displacement: (boundary dofs, v) displacements of the torn cell under the unit loads, equal at every call.
            seen: (k,) norms of the projected jumps on the active rows.
            torn: (k,) norms of the jumps on all rows.
        """
        rounding = ZERO_JUMP * torn
        if ((seen > rounding) & (seen < np.sqrt(np.finfo(float).eps) * torn)).any():
            if self._rounding is None:
                self._rounding = jump_rounding(self.operator, displacement)
            projected = self.natural.project(self.active.restrict(self._rounding @ loads))
            rounding = np.maximum(rounding, ROUNDING_MARGIN * self.norms(projected))
        return rounding

    def solutions(
        self, strains: Float, lam: Float, jump: Float, iterations: int, reason: int, scale: Float
    ) -> list[DualSolution]:
        """Complete the multipliers `lam` (owned rows, k) to solutions with amplitudes, jumps and residuals.

        `jump` (owned rows, k) is d E - F lam, without rigid-body motions; residuals are relative to `scale` (k,).
        """
        alpha = np.zeros((self.natural.kernel_dimension, len(strains)))
        if self.natural.kernel_dimension:
            alpha -= self.natural.amplitudes(self.active.restrict(jump))
            jump = jump + self.natural.G @ alpha
        # A free body takes the position of the least jump, so that cuts do not change the result.
        if (Z := self.natural.unconstrained_modes).shape[1]:
            M = self.natural.G @ Z
            squares = allreduce_sparse(self.comm, (M.T @ M).tocsr())
            sums = distributed_arrays.allreduce_sum(self.comm, M.T @ jump)
            least = Z @ splu(squares.tocsc()).solve(sums)
            alpha, jump = alpha - least, jump - self.natural.G @ least
        residual = self.norms(self.active.restrict(jump)) / np.where(scale > 0, scale, 1.0)
        C, parts = self.operator.compliance, (strains, lam.T.copy(), jump.T.copy(), alpha.T.copy(), residual)
        rows = zip(*parts, strict=True)
        return [DualSolution(E, x, g, a, iterations, reason, float(size), C) for E, x, g, a, size in rows]

    def completed(self, solution: DualSolution, d: Float) -> DualSolution:
        """Complete a solution of the present state by the product F lambda.

        The argument d (owned rows, v) is the jumps of the torn cell under the unit loads.
        """
        torn = (d @ solution.strain)[:, None]
        jump = torn - self.operator.apply(solution.lam[:, None])
        scale = self.norms(self.projected(torn))
        parts = solution.iterations, solution.reason, scale
        return self.solutions(solution.strain[None], solution.lam[:, None], jump, *parts)[0]


def jump_rounding(operator: DualOperator, displacement: Float) -> Float:
    """Estimate the rounding (owned rows, v) in jumps B u of displacements u (boundary dofs, v).  Collective.

    For u = K+ f, the estimate is B K+ (eps diag(K) |u|) with random signs: the jumps under forces as large as the
    rounding of K u.  Every subdomain has a scale, and a soft subdomain beside stiff subdomains moves far.
    """
    signs = np.random.default_rng(0).choice([-1.0, 1.0], displacement.shape)
    forces = operator.boundary.body_diagonal[:, None] * np.abs(displacement) * signs
    return operator.jump(operator.boundary.apply_flexibility(np.finfo(float).eps * forces))
