"""Estimate unknowns by weighted least squares, with covariances and undetermined directions; fill fit.json.

Data y have independent errors with standard deviations s; the model computes f(x) at the unknowns x.  With residuals
r_i = (f_i(x) - y_i) / s_i and J = dr/dx the estimate minimizes r^T r within bounds, and its covariance is (J^T J)^-1.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import least_squares, minimize
from scipy.stats import chi2, norm

from feti_homog.case import sections
from feti_homog.studies.predictions import Datum
from feti_homog.typing import Array, Float

HEAD = ("test", "name", "strain", "value", "std", "computed", "residual")
CONFIDENCE = 0.95
QUANTILE = float(norm.ppf((1 + CONFIDENCE) / 2))
LEAST_CHANCE = 1e-3  # probability of such or larger residuals, below which the model is refused
# Directions with a smaller relative singular value are undetermined; smaller entries of a direction are rounding.
RANK_TOLERANCE, ENTRY = 1e-6, 1e-4
STEP, MOST_EVALUATIONS = 1e-5, 60  # the relative step that ends the search is far below 1 % differences and std
Model = Callable[[Float], Float]


@dataclass(frozen=True, kw_only=True)
class ParameterEstimates:
    """The estimates of n unknowns from m data.

    Attributes:
        x: (n,) estimates.
        computed, residuals: (m,) f(x) and (f(x) - y) / s.
        jacobian: (m, n) derivatives of the residuals.
        at_bound: (n,) -1 at the lower bound, 1 at the upper one, else 0.
        singular_values: (n,) of the Jacobian with respect to relative unknowns, x / estimate.
        directions: (n, n) right singular vectors of the same Jacobian, in rows.
        evaluations: number of evaluations of f.
        converged: whether the search reached a minimum.
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
        """The number of directions in the space of unknowns that the data determine."""
        return int(np.count_nonzero(self.singular_values > RANK_TOLERANCE * self.singular_values.max(initial=0.0)))

    @property
    def undetermined(self) -> list[list[int]]:
        """A list of unknowns, by index, for each direction that the data do not determine."""
        return [[int(k) for k in np.flatnonzero(np.abs(row) > ENTRY)] for row in self.directions[self.rank :]]

    @property
    def influence(self) -> Float:
        """The change (n, m) of each estimate per standard deviation of each datum."""
        size, V = _sizes(self.x), self.directions[: self.rank]
        pseudo = V.T @ ((V @ (self.jacobian * size).T) / self.singular_values[: self.rank, None] ** 2)
        return np.asarray(size[:, None] * pseudo)

    @property
    def covariance(self) -> Float:
        """The covariance (n, n) of the estimates; undetermined unknowns have infinite variances."""
        covariance = self.influence @ self.influence.T
        for row in self.undetermined:
            covariance[row, row] = np.inf
        return np.asarray(covariance)

    @property
    def std(self) -> Float:
        """The standard deviations (n,) of the estimates."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def half_width(self) -> Float:
        """The half widths (n,) of the confidence intervals (level CONFIDENCE); inf for undetermined unknowns."""
        return np.asarray(QUANTILE * self.std)

    @property
    def correlation(self) -> Float:
        """The correlations (n, n) of the estimates; of an undetermined unknown NaN with itself, 0 with others."""
        with np.errstate(invalid="ignore"):
            return np.asarray(self.covariance / np.outer(self.std, self.std))

    @property
    def shares(self) -> Float:
        """The fraction (n, m) of each estimate's variance that each datum contributes; 0 for zero variance."""
        squares = self.influence**2
        total = squares.sum(axis=1, keepdims=True)
        return np.asarray(np.divide(squares, total, out=np.zeros_like(squares), where=total > 0))

    @property
    def chance(self) -> float | None:
        """The probability of such or larger residuals if the model is correct; None without degrees of freedom.

        An unknown at a bound takes no degree of freedom from the residuals.
        """
        freedom = len(self.residuals) - max(self.rank - int(np.count_nonzero(self.at_bound)), 0)
        return float(chi2.sf(self.residuals @ self.residuals, freedom)) if freedom else None

    @property
    def is_poor(self) -> bool:
        """Whether `chance` is at most 1 - CONFIDENCE, so that other starts may fit better."""
        return self.chance is not None and self.chance <= 1.0 - CONFIDENCE

    @property
    def misfits(self) -> bool:
        """Whether the residuals are too large for a correct model: `chance` is below LEAST_CHANCE."""
        return self.chance is not None and self.chance < LEAST_CHANCE


def estimate(
    model: Model, jacobian: Model, measured: tuple[Float, Float], start: Float, bounds: tuple[Float, Float]
) -> ParameterEstimates:
    """Estimate unknowns within bounds from measured data.

    The search takes dogleg steps in the box of the bounds.  If the data do not determine all directions at the start, a
    trust-region method searches instead: its steps have no component along an undetermined direction.

    Args:
        model: computes the values (m,) at unknowns (n,).
        jacobian: computes the derivatives (m, n) of the values.
        measured: data (m,) and their standard deviations (m,).
        start: (n,) unknowns at the start.
        bounds: lower and upper bounds (n,).
    """
    y, std = measured
    size = _sizes(start)
    singular = np.linalg.svd(jacobian(start) / std[:, None] * size, compute_uv=False)
    is_full = len(y) >= len(start) and singular.min() > RANK_TOLERANCE * singular.max()
    # Unknowns are relative to their starts, so that the search does not depend on units.
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
    estimates = summarize(x, minimum.fun * std + y, measured, derivatives, bounds)
    return replace(estimates, evaluations=minimum.nfev, converged=bool(minimum.success))


def with_ranges(
    estimates: ParameterEstimates, residuals: Model, measured: tuple[Float, Float], bounds: tuple[Float, Float]
) -> ParameterEstimates:
    """Replace derivatives that mispredict values in the range of an unknown by secants; see `estimate`.

    In the range, between bounds, r^T r is at most its minimum plus the square of the quantile of CONFIDENCE, while the
    other unknowns stay; the longer side counts.  Where values jump, derivatives know nothing about the range, and parts
    of the range may lie apart.  `residuals` is inf without values.
    """
    x, J, tiny = estimates.x, estimates.jacobian.copy(), float(np.finfo(float).tiny)
    limit = estimates.residuals @ estimates.residuals + QUANTILE**2

    def moved(k: int, step: float) -> Float:
        return residuals(np.where(np.arange(len(x)) == k, x + step, x))

    def is_within(k: int, step: float) -> bool:
        return bool(np.square(moved(k, step)).sum() <= limit)

    def end(k: int, side: int, step: float, ratio: float) -> tuple[float, float]:
        """Return a step within the range and one beyond, at most 1 / `ratio` times as long; the same at a bound."""
        most = bounds[1][k] - x[k] if side > 0 else x[k] - bounds[0][k]
        inside, outside = 0.0, min(step, most)
        while inside < most and is_within(k, side * outside):
            inside, outside = outside, min(2.0 * outside, most)
        for farther in outside * np.sqrt(2.0) ** np.arange(1, 9) if ratio > 0.5 else ():
            if farther < most and is_within(k, side * farther):
                inside, outside = farther, min(2.0 * farther, most)
        while inside < ratio * outside and outside > STEP * _sizes(x)[k]:
            middle = (inside + outside) / 2
            inside, outside = (middle, outside) if is_within(k, side * middle) else (inside, middle)
        return side * inside, side * outside

    for k in range(len(x)):
        step = QUANTILE / max(float(np.linalg.norm(J[:, k])), tiny)
        for ratio in (0.5, 0.9)[estimates.is_poor :]:
            ends = [end(k, side, step / np.sqrt(2.0), ratio) for side in (-1, 1)]
            ranges = [pair for pair in ends if pair[0] != pair[1]]
            inside, width = np.abs(max(ranges, key=lambda pair: abs(pair[1]), default=(0.0, np.inf)))
            low, high = (next(way for way in pair[::-1] if np.isfinite(moved(k, way)).all()) for pair in ends)
            secant = moved(k, high) - moved(k, low)
            size = max(float(np.linalg.norm(secant)), tiny)
            if inside <= step <= width < np.inf and np.linalg.norm(secant - J[:, k] * (high - low)) < 0.25 * size:
                break
        else:
            J[:, k] = secant / size * QUANTILE / width  # 0 without an end
    ranged = summarize(x, estimates.computed, measured, J * measured[1][:, None], bounds)
    return replace(ranged, evaluations=estimates.evaluations, converged=estimates.converged)


def descend(squares: Callable[[Float], float], start: Float, bounds: tuple[Float, Float]) -> None:
    """Call `squares` along a search for its minimum from `start` (n,) within bounds, by Nelder and Mead's simplex."""
    size = _sizes(start)
    box = np.transpose(bounds) / size[:, None]
    options = {"maxfev": MOST_EVALUATIONS, "xatol": LEAST_CHANCE, "fatol": 1.0}
    minimize(lambda z: squares(z * size), start / size, method="Nelder-Mead", bounds=box, options=options)


def summarize(
    x: Float, computed: Float, measured: tuple[Float, Float], derivatives: Float, bounds: tuple[Float, Float]
) -> ParameterEstimates:
    """Derive statistics from estimates x (n,), values (m,) and derivatives (m, n) at x; see `estimate` for the rest."""
    y, std = measured
    J = derivatives / std[:, None]
    _, s, V = np.linalg.svd(J * _sizes(x), full_matrices=True)
    lower, upper = bounds
    margin = STEP * (upper - lower)
    at_bound = np.where(x >= upper - margin, 1, np.where(x <= lower + margin, -1, 0))
    s = np.pad(s, (0, len(x) - len(s)))
    return ParameterEstimates(x=x, computed=computed, residuals=(computed - y) / std, jacobian=J, at_bound=at_bound,
                     singular_values=s, directions=V, evaluations=0, converged=True)  # fmt: skip


def names_of(rows: Sequence[Sequence[int]], names: Sequence[str]) -> list[str]:
    """Return a message for each undetermined direction, which is a row with the indices of unknowns in `names`."""
    alone, together = "no measured value depends on it", "the measured values do not determine them together"
    return [f"[unknown] {', '.join(names[k] for k in row)}: {alone if len(row) == 1 else together}" for row in rows]


def _sizes(x: Float) -> Float:
    """Return the magnitudes (n,) of unknowns; 1 for an unknown that is 0."""
    return np.where(x == 0.0, 1.0, np.abs(x))


def fit_document(
    unknowns: Mapping[str, sections.Unknown], data: Sequence[Datum], estimates: ParameterEstimates, steps: str = ""
) -> dict[str, Any]:
    """Return the content of fit.json except for its `name`, digest and warnings.  Infinities and NaN become None.

    `steps` quotes the key that sets the teeth of a softening law, such as "teeth = 8"; empty without one.
    """
    faults = [] if estimates.converged else [f"no minimum after {estimates.evaluations} evaluations"]
    misfits = estimates.misfits
    if misfits and estimates.undetermined:
        place = ", ".join(f"{name} = {value:.6g}" for name, value in zip(unknowns, estimates.x, strict=True))
        faults.append(f"the search stalled at {place}, where the values change in jumps or not at all: start elsewhere")
    elif misfits:
        words = "the model does not describe the measurements, or other starts fit better"
        faults.append(f"{words} (chance {estimates.chance:.2g}): intervals fail")
        ratio = np.median(
            [abs(datum.value) / max(abs(f), 1e-300) for datum, f in zip(data, estimates.computed, strict=True)]
        )
        if not 1 / 30 < ratio < 30:
            faults[-1] += f"; measured values are about {ratio:.0e} times the computed ones: check their unit"
    else:
        faults += names_of(estimates.undetermined, [*unknowns])
    cure = f"; {steps} makes the curve a staircase: more teeth (softening_tolerance) make it smooth" if steps else ""
    faults = [f"{fault}{cure}" for fault in faults]
    faults += [
        f"[unknown] {name}: the measured values hardly determine it: its standard deviation {std:.3g} is more than the "
        f"width {unknown.upper - unknown.lower:.3g} of its bounds"
        for (name, unknown), std in zip(unknowns.items(), estimates.std, strict=True)
        if np.isfinite(std) and std > unknown.upper - unknown.lower
    ]
    return {
        "status": "not converged" if faults else "done",
        "faults": faults,
        "confidence": CONFIDENCE,
        "evaluations": estimates.evaluations,
        "unknowns": {
            name: {
                "estimate": float(estimates.x[k]),
                "std": _or_none(estimates.std[k]),
                "interval": [_or_none(estimates.x[k] + sign * estimates.half_width[k]) for sign in (-1, 1)],
                "at_bound": {-1: "lower", 0: None, 1: "upper"}[int(estimates.at_bound[k])],
                "start": unknown.start, "lower": unknown.lower, "upper": unknown.upper,
                "shares": [float(share) for share in estimates.shares[k]],
            }
            for k, (name, unknown) in enumerate(unknowns.items())
        },
        "correlation": [[_or_none(value) for value in row] for row in estimates.correlation],
        "singular_values": estimates.singular_values.tolist(),
        "directions": estimates.directions.tolist(),
        "sum_of_squares": _or_none(float(estimates.residuals @ estimates.residuals)),
        "chance": estimates.chance,
        "measured": [
            {"test": datum.test + 1, "name": datum.name, "strain": datum.strain,
             "strain_name": datum.strain_name or None, "value": datum.value, "std": datum.std,
             "computed": float(f), "residual": float(r)}
            for datum, f, r in zip(data, estimates.computed, estimates.residuals, strict=True)
        ],
    }  # fmt: skip


def _or_none(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
