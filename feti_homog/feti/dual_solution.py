"""The solution of the dual problem under one load, and the jumps on active rows; symbols as in `solver`."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

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
    """The solution of the dual problem, Eqs. (36) and (37), under one load.

    Attributes:
        strain: (v,) load E: the macroscopic strain, then the other loads of the problem; with tractions on the sides
            (v + m,), followed by the m components of their stress Sigma.
        lam: (owned rows,) multipliers, nodal forces between the faces; 0 on inactive rows.
        jump: (owned rows,) B u* - C lam, 0 up to tolerance on active rows, gap and slip on inactive rows.
        alpha: (kernel dimension,) rigid-body amplitudes; None if F lambda was not computed for these multipliers.
        iterations, reason: iterations of the Krylov method, and PETSc's KSPConvergedReason.
        residual: |B u* - C lam| on the active rows, relative to the jump of the torn cell there; without alpha, the
            largest residual of the last solutions with alpha.
        compliance: (owned rows,) compliance C of the springs, length per nodal force.
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
        """Return the jumps B u* (owned rows,): spring elongations on active rows, gap and slip on inactive rows."""
        return self.jump + self.compliance * self.lam


class ActiveJumps:
    """Projections, norms and rounding bounds of jumps on the active rows, which carry multipliers.

    `active` (owned rows,) is 1 on active rows, else 0.  All methods but `restrict` are collective.
    """

    def __init__(self, comm: MPI.Intracomm, operator: DualOperator, natural: NaturalCoarseSpace) -> None:
        self.comm, self.operator, self.natural = comm, operator, natural
        self.active = np.ones(len(operator.compliance))
        self._rounding: Float | None = None

    def restrict(self, x: Float) -> Float:
        """Return a copy of x (owned rows,) or (owned rows, k) with 0 on the inactive rows."""
        return distributed_arrays.scale_rows(self.active, x)

    def norms(self, x: Float) -> Float:
        """Compute the Euclidean norms (k,) of the columns of x (owned rows, k)."""
        return np.asarray(np.sqrt(distributed_arrays.allreduce_sum(self.comm, np.einsum("ik,ik->k", x, x))))

    def projected(self, x: Float) -> Float:
        """Compute P x for jumps or multipliers x (owned rows, k), restricted to the active rows.

        P is applied twice: rounding of a single product contains rigid-body motions, which stall a Krylov method.
        """
        return self.natural.project(self.natural.project(self.restrict(x)))

    def rounding(self, displacement: Float, loads: Float, active: Float, torn: Float) -> Float:
        """Bound the rounding (k,) in jumps of the torn cell on active rows, under loads (v, k).

        The bound is ZERO_JUMP times `torn`.  If an `active` norm lies between this bound and sqrt(eps) times `torn`,
        with the machine precision eps, all bounds are at least ROUNDING_MARGIN times the estimate by `jump_rounding`.

        Args:
            displacement: (boundary dofs, v) displacements of the torn cell under unit loads, the same at every call.
            active: (k,) norms of the projected jumps on the active rows.
            torn: (k,) norms of the jumps on all rows.
        """
        rounding = ZERO_JUMP * torn
        if ((active > rounding) & (active < np.sqrt(np.finfo(float).eps) * torn)).any():
            if self._rounding is None:
                self._rounding = jump_rounding(self.operator, displacement)
            projected = self.natural.project(self.restrict(self._rounding @ loads))
            rounding = np.maximum(rounding, ROUNDING_MARGIN * self.norms(projected))
        return rounding

    def solutions(
        self, strains: Float, lam: Float, jump: Float, iterations: int, reason: int, scale: Float
    ) -> list[DualSolution]:
        """Make the solutions for multipliers `lam` (owned rows, k), with amplitudes alpha, jumps and residuals.

        `strains` (k, v) are the loads E; `jump` (owned rows, k) is d E - (F + C) lam, without rigid-body motions; the
        residuals are relative to `scale` (k,).  `iterations` and `reason` are stored in the solutions.
        """
        alpha = np.zeros((self.natural.kernel_dimension, len(strains)))
        if self.natural.kernel_dimension:
            alpha -= self.natural.amplitudes(self.restrict(jump))
            jump = jump + self.natural.G @ alpha
        # The position of a free body minimizes the jumps, so that cuts do not change the result.
        Z = self.natural.unconstrained_modes
        if Z.shape[1]:
            M = self.natural.G @ Z
            squares = allreduce_sparse(self.comm, (M.T @ M).tocsr())
            sums = distributed_arrays.allreduce_sum(self.comm, M.T @ jump)
            least = Z @ splu(squares.tocsc()).solve(sums)
            alpha, jump = alpha - least, jump - self.natural.G @ least
        residual = self.norms(self.restrict(jump)) / np.where(scale > 0, scale, 1.0)
        C = self.operator.compliance
        rows = zip(strains, lam.T.copy(), jump.T.copy(), alpha.T.copy(), residual, strict=True)
        return [DualSolution(E, x, g, a, iterations, reason, float(size), C) for E, x, g, a, size in rows]

    def superposed(self, solutions: Sequence[DualSolution], factors: Float, d: Float) -> DualSolution:
        """Sum k solutions with equal active rows, weighted by `factors` (k,); `d` is as in `completed`.

        If all solutions have alpha, the sum has alpha, the most iterations, the least reason and a new residual; else
        alpha is None, and the other numbers are from the first solution.
        """
        triples = zip(*((solution.strain, solution.lam, solution.jump) for solution in solutions), strict=True)
        strain, lam, jump = (np.stack(arrays, axis=1) @ factors for arrays in triples)
        total = replace(solutions[0], strain=strain, lam=lam, jump=jump, alpha=None)
        amplitudes = [solution.alpha for solution in solutions if solution.alpha is not None]
        if len(amplitudes) < len(solutions):
            return total
        alpha = np.stack(amplitudes, axis=1) @ factors
        torn = self.natural.project(self.restrict(d @ strain))
        pairs = np.stack([torn, self.restrict(jump)])
        scale, residual = np.sqrt(distributed_arrays.allreduce_sum(self.comm, np.einsum("ij,ij->i", pairs, pairs)))
        iterations, reason = max(s.iterations for s in solutions), min(s.reason for s in solutions)
        residual = float(residual / (scale or 1.0))
        return replace(total, alpha=alpha, iterations=iterations, reason=reason, residual=residual)

    def balanced(self, solution: DualSolution) -> DualSolution:
        """Return P lam for a solution, without alpha: influence columns leave up to 1e-8 of lam as forces on bodies."""
        return replace(solution, lam=self.projected(solution.lam[:, None])[:, 0], alpha=None)

    def completed(self, solution: DualSolution, d: Float) -> DualSolution:
        """Return a solution of the present state, completed by alpha, jumps and residual from F lambda.

        `d` (owned rows, v) holds the jumps of the torn cell under the unit loads.
        """
        torn, lam = (d @ solution.strain)[:, None], solution.lam[:, None]
        jump, scale = torn - self.operator.apply(lam), self.norms(self.projected(torn))
        return self.solutions(solution.strain[None], lam, jump, solution.iterations, solution.reason, scale)[0]


def jump_rounding(operator: DualOperator, displacement: Float) -> Float:
    """Estimate the rounding (owned rows, v) of jumps B u.  Collective.

    For `displacement` u = K+ f (boundary dofs, v) and machine precision eps, the estimate is B K+ (eps diag(K) |u|)
    with random signs: jumps under forces as large as the rounding of K u.  Such forces may move soft subdomains far.
    """
    signs = np.random.default_rng(0).choice([-1.0, 1.0], displacement.shape)
    forces = operator.boundary.body_diagonal[:, None] * np.abs(displacement) * signs
    return operator.jump(operator.boundary.apply_flexibility(np.finfo(float).eps * forces))
