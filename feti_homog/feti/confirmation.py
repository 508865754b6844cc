"""Solve the dual problem by influence columns (`exact`), and test some solutions by products F lambda."""

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from feti_homog.errors import ConvergenceError
from feti_homog.feti import thresholds
from feti_homog.feti.coarse.natural import NaturalCoarseSpace
from feti_homog.feti.dual_solution import ActiveJumps, DualSolution
from feti_homog.feti.exact.exact_inverse import ExactInverse
from feti_homog.feti.operators.interface_operators import DualOperator
from feti_homog.system.parallel import distributed_arrays
from feti_homog.typing import Float


class InfluenceSolutions:
    """A dual solver by influence columns, the columns of an exact inverse H; F lambda tests only some solutions.

    F is the dual operator.  If a solve with F lambda confirms the n solves before it, the next min(2 n + 1,
    MOST_UNCONFIRMED) solves skip F lambda: this number is the quota.
    """

    def __init__(
        self,
        comm: MPI.Intracomm,
        inverse: ExactInverse,
        operator: DualOperator,
        natural: NaturalCoarseSpace,
        jumps: ActiveJumps,
    ) -> None:
        self._comm, self._inverse, self._operator, self._natural, self._jumps = comm, inverse, operator, natural, jumps
        self._quota = self._unused = 0
        # A prediction that F lambda will confirm: multipliers, jumps on inactive rows, and sums of the absolute
        # multipliers under single strains, all (owned rows, k).
        self._prediction: tuple[Float, Float, Float] | None = None
        self._residual = self._rounding = 0.0
        # (2, v, v) Gram matrices of the unit jumps: projected on the active rows, and on all rows.
        self._squares = np.zeros((2, 0, 0))

    def solutions(self, strains: Float, d: Float) -> list[DualSolution] | None:
        """Solve for loads `strains` (k, v) by influence columns; return None if F lambda must solve.  Collective.

        F lambda must solve if the quota is used up, if the jump of a load on the active rows is at most LEAST_FOLLOWED
        times its jump on all rows, or if influence columns and coarse space disagree about the number of free motions.
        `d` (owned rows, v) holds the jumps of the torn cell under the unit loads.  Solutions lack alpha.
        """
        self._prediction = None
        if not self._quota:
            return None
        active, torn = np.einsum("ki,nij,kj->nk", strains, self._squares, strains)
        if not (active > thresholds.LEAST_FOLLOWED**2 * torn).all():
            return None
        free = self._natural.unconstrained_modes.shape[1]
        answer = self._inverse.answer(d, strains.T, free)
        if answer is None:
            return None
        lam, jumps = answer
        if not self._unused:
            unit_answer = self._inverse.answer(d, np.eye(d.shape[1]), free)
            assert unit_answer is not None
            self._prediction = lam, jumps, np.abs(unit_answer[0]) @ np.abs(strains.T)
            return None
        self._unused -= 1
        reason, C = int(PETSc.KSP.ConvergedReason.CONVERGED_RTOL), self._operator.compliance
        rows = zip(strains, lam.T.copy(), jumps.T.copy(), strict=True)
        return [DualSolution(E, x, jump, None, 0, reason, self._residual, C) for E, x, jump in rows]

    def closing(self, d: Float, E: Float, weights: Float) -> Float:
        """Compute multipliers H d E (owned rows, k) that close the jumps d E, for loads E (v, k).  Collective.

        Column j of E is `weights[j]` times load j of the last `solutions`; multipliers predicted there are reused.
        """
        return self._inverse.multipliers(d, E) if self._prediction is None else self._prediction[0] * weights

    def record(self, solutions: list[DualSolution], d: Float) -> None:
        """Compare solutions by F lambda with the last prediction, and set the quota.  Collective.

        `d` is as in `solutions`.  The quota drops to 0 if a solution iterated or did not converge, or if `solutions` is
        empty: a load has no jump on active rows.  Errors above MOST_FOLLOWED_ERROR and twice F's rounding renew H d.

        Raises:
            ConvergenceError: predicted multipliers have a relative error above MOST_UNCONFIRMED_ERROR.
        """
        if solutions and self._prediction is not None:
            lam = np.stack([solution.lam for solution in solutions], axis=1)
            opening = np.stack([solution.jump for solution in solutions], axis=1)
            # The error of a confirmed multiplier is at least its residual.
            lam_error, drift = self._errors(lam, opening, np.array([solution.residual for solution in solutions]))
            if not lam_error <= thresholds.MOST_UNCONFIRMED_ERROR:
                raise ConvergenceError(
                    f"influence columns: relative error {lam_error:.1e} of the multipliers in the last {self._quota} "
                    f"solves; expected at most {thresholds.MOST_UNCONFIRMED_ERROR:.0e}"
                )
            error, limit = float(np.max([lam_error, drift])), thresholds.MOST_FOLLOWED_ERROR
            if not error <= max(limit, 2.0 * self._rounding):
                # If multipliers computed anew stay the same, the error is rounding in F lambda.
                self._inverse.renew_answer(d)
                strains = np.stack([solution.strain for solution in solutions], axis=1)
                repetition = self._inverse.answer(d, strains, self._natural.unconstrained_modes.shape[1])
                is_same = repetition is not None and float(np.max(self._errors(*repetition))) <= limit
                self._rounding = min(error, thresholds.MOST_ROUNDING) if is_same else 0.0
        confirmed = bool(solutions) and all(solution.iterations == 0 and solution.reason > 0 for solution in solutions)
        self._quota = min(2 * self._quota + 1, thresholds.MOST_UNCONFIRMED) if confirmed else 0
        self._unused, self._residual = self._quota, max((solution.residual for solution in solutions), default=0.0)
        if confirmed:
            active = self._jumps.projected(d)
            self._squares = distributed_arrays.allreduce_sum(self._comm, np.stack([active.T @ active, d.T @ d]))

    def _errors(self, lam: Float, opening: Float, residuals: Float | float = 0.0) -> tuple[float, float]:
        """Compute the largest relative errors of predicted multipliers, and of predicted jumps.  Collective.

        Errors of a load are relative to the largest entry in `lam`, or in `opening`, both (owned rows, k).  Jumps count
        only without free bodies.  Multipliers may cancel, as in pressed bonds, so their scale is at least
        LEAST_FOLLOWED times the sum of magnitudes under single strains.  `residuals` (k,) are relative errors in `lam`.
        """
        assert self._prediction is not None
        predicted, jumps, terms = self._prediction
        is_open = (jumps != 0.0) & (self._natural.unconstrained_modes.shape[1] == 0)
        sizes = np.maximum(np.abs(lam), thresholds.LEAST_FOLLOWED * terms)
        errors = np.maximum(np.abs(predicted - lam), residuals * np.abs(lam))
        parts = np.abs([errors, is_open * (jumps - opening), sizes, opening]).max(axis=1, initial=0.0)
        parts = np.max(self._comm.allgather(parts), axis=0)  # keeps NaN, which MPI.MAX may lose
        lam_error, drift = (parts[:2] / np.where(parts[2:] > 0.0, parts[2:], 1.0)).max(axis=1)
        return float(lam_error), float(drift)
