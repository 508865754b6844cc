"""Dual solutions by influence columns, which products F lambda confirm from time to time."""

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
    """A solver by influence columns that computes F lambda only from time to time.

    A solve with F lambda confirms n solves without F lambda; the next min(2 n + 1, MOST_UNCONFIRMED) solves omit it.
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
        self._granted = self._left = 0
        # Unconfirmed multipliers and jumps on inactive rows, both (owned rows, k), and the sums of the absolute
        # multipliers under single strains.
        self._expected: tuple[Float, Float, Float] | None = None
        self._residual, self._rounding, self._squares = 0.0, 0.0, np.zeros((2, 0, 0))

    def solutions(self, strains: Float, d: Float) -> list[DualSolution] | None:
        """Solve by influence columns for loads (k, v), or return None if F lambda is due.  Collective.

        F lambda is always due if the jump of a load on the active rows may be rounding, and if the columns and the
        coarse space disagree about the number of free motions.  The argument d (owned rows, v) is the jumps of the torn
        cell under the unit loads.
        """
        self._expected = None
        if not self._granted:
            return None
        seen, torn = np.einsum("ki,nij,kj->nk", strains, self._squares, strains)
        if not (seen > thresholds.LEAST_FOLLOWED**2 * torn).all():
            return None
        free = self._natural.unconstrained_modes.shape[1]
        answer = self._inverse.answer(d, strains.T, free)
        if answer is None:
            return None
        lam, jumps = answer
        if not self._left:
            unit_answer = self._inverse.answer(d, np.eye(d.shape[1]), free)
            assert unit_answer is not None
            self._expected = lam, jumps, np.abs(unit_answer[0]) @ np.abs(strains.T)
            return None
        self._left -= 1
        reason, C = int(PETSc.KSP.ConvergedReason.CONVERGED_RTOL), self._operator.compliance
        rows = zip(strains, lam.T.copy(), jumps.T.copy(), strict=True)
        return [DualSolution(E, x, jump, None, 0, reason, self._residual, C) for E, x, jump in rows]

    def closing(self, d: Float, E: Float, weights: Float) -> Float:
        """Compute the multipliers H d E for loads E (v, k), which F lambda will confirm.  Collective.

        Unconfirmed multipliers of `solutions`, times `weights` (k,), need no new columns.
        """
        return self._inverse.multipliers(d, E) if self._expected is None else self._expected[0] * weights

    def record(self, solutions: list[DualSolution], d: Float) -> None:
        """Record solutions by F lambda, and grant new solves without F lambda if no solution needed iterations.

        `solutions` is empty if a load causes no jump on the active rows.  The method renews expected multipliers whose
        error exceeds rounding.  Collective.

        Raises:
            ConvergenceError: the multipliers by columns have a larger error than the checks of a run allow.
        """
        if solutions and self._expected is not None:
            lam, opening = (np.stack(x, axis=1) for x in zip(*((s.lam, s.jump) for s in solutions), strict=True))
            # The error of a confirmed multiplier is at least its residual.
            lam_error, drift = self._errors(lam, opening, np.array([solution.residual for solution in solutions]))
            if not lam_error <= thresholds.MOST_UNCONFIRMED_ERROR:
                raise ConvergenceError(
                    f"influence columns: multipliers of the last {self._granted} solves: {lam_error:.1e} off"
                )
            error, most = float(np.max([lam_error, drift])), thresholds.MOST_FOLLOWED_ERROR
            if not error <= max(most, 2.0 * self._rounding):
                # If renewed multipliers stay the same, the error is rounding of F lambda.
                self._inverse.renew_answer(d)
                strains = np.stack([solution.strain for solution in solutions], axis=1)
                again = self._inverse.answer(d, strains, self._natural.unconstrained_modes.shape[1])
                is_same = again is not None and float(np.max(self._errors(*again))) <= most
                self._rounding = min(error, thresholds.MOST_ROUNDING) if is_same else 0.0
        confirmed = bool(solutions) and all(solution.iterations == 0 and solution.reason > 0 for solution in solutions)
        self._granted = min(2 * self._granted + 1, thresholds.MOST_UNCONFIRMED) if confirmed else 0
        self._left, self._residual = self._granted, max((solution.residual for solution in solutions), default=0.0)
        if confirmed:
            seen = self._jumps.projected(d)
            self._squares = distributed_arrays.allreduce_sum(self._comm, np.stack([seen.T @ seen, d.T @ d]))

    def _errors(self, lam: Float, opening: Float, residuals: Float | float = 0.0) -> tuple[float, float]:
        """Compute the errors of the expected multipliers and jumps against `lam` and `opening` (owned rows, k).

        Both errors are relative to the largest entry of a load.  Jumps count only if no body is free to move.
        Multipliers of a load may cancel, for example where bonds are pressed: then a fraction of the multipliers under
        single strains is the scale.  The `residuals` (k,) are relative errors of lam.  Collective.
        """
        assert self._expected is not None
        expected, jumps, terms = self._expected
        is_open = (jumps != 0.0) * (self._natural.unconstrained_modes.shape[1] == 0)
        sizes = np.maximum(np.abs(lam), thresholds.LEAST_FOLLOWED * terms)
        errors = np.maximum(np.abs(expected - lam), residuals * np.abs(lam))
        parts = np.abs([errors, sizes, is_open * (jumps - opening), opening]).max(axis=1, initial=0.0)
        parts = np.max(self._comm.allgather(parts), axis=0)  # keeps NaN, which MPI.MAX may lose
        lam_error, drift = (parts[::2] / np.where(parts[1::2] > 0.0, parts[1::2], 1.0)).max(axis=1)
        return float(lam_error), float(drift)
