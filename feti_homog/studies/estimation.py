"""Weighted least squares: estimates, their covariance, and unknowns that the data do not determine.

Data y have independent errors with standard deviations s, so that residuals are r_i = (f_i(x) - y_i) / s_i.  With
J = dr/dx the estimate is the minimum of r^T r within bounds, and its covariance (J^T J)^-1.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import chi2, norm

from feti_homog.typing import Array, Float

CONFIDENCE = 0.95
# No datum sees directions with smaller singular values / the largest; smaller entries of a direction are rounding.
RANK_TOLERANCE, ENTRY = 1e-6, 1e-2
STEP, MOST_EVALUATIONS = 1e-8, 60
Model = Callable[[Float], Float]


@dataclass(frozen=True, kw_only=True)
class ParameterEstimates:
    """Estimates for n unknowns from m data.

    Attributes:
        x: (n,) estimates.
        computed, residuals: (m,) f(x) and (f(x) - y) / s.
        jacobian: (m, n) of the residuals.
        at_bound: (n,) -1 at the lower bound, 1 at the upper one, else 0.
        singular_values: of the Jacobian for unknowns relative to their estimates.
        directions: (n, n) its right singular vectors in rows.
        evaluations: how often f was evaluated.
        converged: whether the minimum is found.
    """

    x: Float
    computed: Float
    residuals: Float
    jacobian: Float
    at_bound: Array
    singular_values: Float
    directions: Float
    evaluations: int
    converged: bool

    @property
    def rank(self) -> int:
        """Number of directions that the data determine."""
        return int(np.count_nonzero(self.singular_values > RANK_TOLERANCE * self.singular_values.max(initial=0.0)))

    @property
    def undetermined(self) -> list[list[int]]:
        """The unknowns in each direction that the data do not determine."""
        return [[int(k) for k in np.flatnonzero(np.abs(row) > ENTRY)] for row in self.directions[self.rank :]]

    @property
    def influence(self) -> Float:
        """(n, m) change in each estimate per standard deviation in each datum."""
        size, V = _sizes(self.x), self.directions[: self.rank]
        pseudo = V.T @ ((V @ (self.jacobian * size).T) / self.singular_values[: self.rank, None] ** 2)
        return np.asarray(size[:, None] * pseudo)

    @property
    def covariance(self) -> Float:
        """(n, n); infinite variances of unknowns that the data do not determine."""
        covariance = self.influence @ self.influence.T
        for row in self.undetermined:
            covariance[row, row] = np.inf
        return np.asarray(covariance)

    @property
    def std(self) -> Float:
        """(n,) standard deviations of the estimates."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def half_width(self) -> Float:
        """(n,) of the confidence intervals."""
        return np.asarray(norm.ppf((1 + CONFIDENCE) / 2) * self.std)

    @property
    def correlation(self) -> Float:
        """(n, n); NaN of unknowns that the data do not determine."""
        with np.errstate(invalid="ignore"):
            return np.asarray(self.covariance / np.outer(self.std, self.std))

    @property
    def shares(self) -> Float:
        """(n, m) share of each datum in each estimate's variance."""
        squares = self.influence**2
        total = squares.sum(axis=1, keepdims=True)
        return np.asarray(np.divide(squares, total, out=np.zeros_like(squares), where=total > 0))

    @property
    def chance(self) -> float | None:
        """Probability that a right model has residuals as large; None without a degree of freedom."""
        freedom = len(self.residuals) - self.rank
        return float(chi2.sf(self.residuals @ self.residuals, freedom)) if freedom else None


def estimate(
    model: Model, jacobian: Model, measured: tuple[Float, Float], start: Float, bounds: tuple[Float, Float]
) -> ParameterEstimates:
    """Return the estimates from the values (m,) that `model` gives for unknowns (n,), and their derivatives (m, n).

    `measured` are the data and their standard deviations.  The search is a dogleg in the box of the bounds; where no
    datum sees a direction, by a trust region, whose steps do not go along it.
    """
    y, std = measured
    size = _sizes(start)
    singular = np.linalg.svd(jacobian(start) / std[:, None] * size, compute_uv=False)
    is_full = len(y) >= len(start) and singular.min() > RANK_TOLERANCE * singular.max()
    # Every unknown relative to its start, so that no unit decides where the search ends.
    minimum = least_squares(
        lambda z: (model(z * size) - y) / std,
        start / size,
        lambda z: jacobian(z * size) * size / std[:, None],
        bounds=(bounds[0] / size, bounds[1] / size),
        method="dogbox" if is_full else "trf",
        xtol=STEP,
        max_nfev=MOST_EVALUATIONS,
    )
    x, derivatives = minimum.x * size, minimum.jac * std[:, None] / size
    return summarize(x, minimum.fun * std + y, measured, derivatives, bounds,
                     evaluations=minimum.nfev, converged=bool(minimum.success))  # fmt: skip


def summarize(
    x: Float,
    computed: Float,
    measured: tuple[Float, Float],
    derivatives: Float,
    bounds: tuple[Float, Float],
    evaluations: int = 0,
    converged: bool = True,
) -> ParameterEstimates:
    """Return the estimates x (n,) with the computed values (m,) and their derivatives (m, n) there."""
    y, std = measured
    J = derivatives / std[:, None]
    _, s, V = np.linalg.svd(J * _sizes(x), full_matrices=True)
    lower, upper = bounds
    margin = STEP * (upper - lower)
    at_bound = np.where(x >= upper - margin, 1, np.where(x <= lower + margin, -1, 0))
    s = np.pad(s, (0, len(x) - len(s)))
    return ParameterEstimates(x=x, computed=computed, residuals=(computed - y) / std, jacobian=J, at_bound=at_bound,
                     singular_values=s, directions=V, evaluations=evaluations, converged=converged)  # fmt: skip


def names_of(rows: Sequence[Sequence[int]], names: Sequence[str]) -> list[str]:
    """Return a line for each direction that the data do not determine, with its unknowns."""
    reasons = {True: "no measured value depends on it", False: "the measured values do not determine them together"}
    return [f"[unknown] {', '.join(names[k] for k in row)}: {reasons[len(row) == 1]}" for row in rows]


def _sizes(x: Float) -> Float:
    """(n,) magnitudes of unknowns; 1 for zeros."""
    return np.where(x == 0.0, 1.0, np.abs(x))
