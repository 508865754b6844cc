"""Least squares on closed models: estimates, intervals, and what the data do not determine."""

from math import factorial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from feti_homog.case.sections import Unknown
from feti_homog.studies import estimation
from feti_homog.studies.estimation import estimate, names_of, summarize, with_ranges
from feti_homog.studies.fit import DIFFERENCE, Evaluations
from feti_homog.studies.predictions import Datum
from feti_homog.studies.study import Evaluator

TIMES = np.linspace(0.0, 3.0, 12)
TRUTH = np.array([2.0, 0.7])
BOUNDS = (np.array([0.1, 0.05]), np.array([20.0, 5.0]))


def decay(x):
    return x[0] * np.exp(-x[1] * TIMES)


def slopes(x):
    fall = np.exp(-x[1] * TIMES)
    return np.stack([fall, -x[0] * TIMES * fall], axis=1)


def fitted(y, std=0.01, start=(1.5, 1.0), model=decay, jacobian=slopes, bounds=BOUNDS):
    return estimate(model, jacobian, (y, np.full(len(y), std)), np.array(start), bounds)


def test_noise_free_values_return_the_truth_and_estimates_at_a_bound_are_marked():
    found = fitted(decay(TRUTH))
    assert found.x == pytest.approx(TRUTH, rel=1e-9) and found.converged and found.evaluations <= 8
    assert found.at_bound.tolist() == [0, 0] and found.rank == 2 and found.undetermined == []
    found = fitted(decay(TRUTH), bounds=(BOUNDS[0], np.array([1.5, 5.0])))
    assert found.at_bound.tolist() == [1, 0] and found.x[0] == pytest.approx(1.5)


@pytest.mark.slow
def test_intervals_cover_the_truth_as_often_as_they_claim():
    """Cover 95 +- 1.5 % of 2000 samples with noise for each unknown; residuals have the claimed distribution."""
    noise = np.random.default_rng(7).normal(0.0, 0.01, (2000, len(TIMES)))
    hits, chances = np.zeros(2), []
    for row in noise:
        found = fitted(decay(TRUTH) + row, start=TRUTH)
        hits += np.abs(found.x - TRUTH) < found.half_width
        chances.append(found.chance)
    assert hits / len(noise) == pytest.approx([0.95, 0.95], abs=0.015)
    assert np.mean(np.array(chances) < 0.1) == pytest.approx(0.1, abs=0.02)


def test_a_line_through_noisy_points_of_unlike_deviations_is_that_of_the_normal_equations():
    """Estimates, standard deviations, correlation, shares and the chance of the residuals, by weights 1 / s^2."""
    rng = np.random.default_rng(3)
    std = np.geomspace(0.05, 2.0, len(TIMES))[rng.permutation(len(TIMES))]
    A = np.stack([np.ones(len(TIMES)), TIMES], axis=1)
    y = A @ TRUTH + std * rng.standard_normal(len(TIMES))
    found = fitted(y, std, model=lambda x: A @ x, jacobian=lambda x: A)
    covariance = np.linalg.inv(A.T @ (A / std[:, None] ** 2))
    x = covariance @ A.T @ (y / std**2)
    np.testing.assert_allclose(found.x, x, rtol=1e-7)
    np.testing.assert_allclose(found.covariance, covariance, rtol=1e-7)
    deviations = np.sqrt(covariance.diagonal())
    np.testing.assert_allclose(found.half_width, 1.959964 * deviations, rtol=1e-6)
    np.testing.assert_allclose(found.correlation[0, 1], covariance[0, 1] / deviations.prod(), rtol=1e-7)
    np.testing.assert_allclose(found.shares.T, (covariance @ A.T / std).T ** 2 / deviations**2, rtol=1e-6)
    squares = ((A @ x - y) ** 2 / std**2).sum()
    freedom = len(y) - 2  # even, so that the tail of chi^2 is a sum of Poisson's
    terms = [(squares / 2) ** k / factorial(k) for k in range(freedom // 2)]
    assert found.chance == pytest.approx(np.exp(-squares / 2) * sum(terms))


def test_directions_without_data_are_named_and_not_followed():
    """Fit x0 + x1 beside an idle x2: only the sum is known, the start's difference stays, no interval is claimed."""
    A = np.outer(TIMES + 1.0, [1.0, 1.0, 0.0])
    bounds = (np.full(3, -10.0), np.full(3, 10.0))
    found = fitted(
        A @ [1.0, 2.0, 0.0], start=(2.0, 2.0, 4.0), model=lambda x: A @ x, jacobian=lambda x: A, bounds=bounds
    )
    assert found.x[:2] == pytest.approx([1.5, 1.5], rel=1e-5)
    assert found.x[2] == 4.0 and found.rank == 1
    assert np.isinf(found.std).all() and np.isfinite(found.shares).all()
    assert sorted(names_of(found.undetermined, ["a", "b", "c"])) == [
        "[unknown] a, b: the measured values do not determine them together",
        "[unknown] c: no measured value depends on it",
    ]


def test_an_unknown_beside_a_weaker_one_is_undetermined():
    """Fit x0 + x1 / 200: x0 moves by 0.5 % where x1, which no other value determines, doubles."""
    A = np.outer(TIMES + 1.0, [1.0, 0.005])
    found = fitted(A @ [1.0, 2.0], std=1e-4, start=(1.2, 3.0), model=lambda x: A @ x, jacobian=lambda x: A)
    assert found.rank == 1 and np.isinf(found.std).all()
    words = "[unknown] strength, stiffness: the measured values do not determine them together"
    assert names_of(found.undetermined, ["strength", "stiffness"]) == [words]


def test_units_do_not_decide_where_the_search_ends():
    """The first unknown in 1e-9 of its unit, beside one of order 1."""
    unit = np.array([1e9, 1.0])
    bounds = tuple(bound * unit for bound in BOUNDS)
    found = fitted(
        decay(TRUTH),
        start=np.array([1.5, 1.0]) * unit,
        model=lambda x: decay(x / unit),
        jacobian=lambda x: slopes(x / unit) / unit,
        bounds=bounds,
    )
    other = fitted(decay(TRUTH))
    singular_values = np.linalg.svd(slopes(TRUTH) * TRUTH / 0.01, compute_uv=False)
    np.testing.assert_allclose(found.singular_values, singular_values, rtol=1e-6)
    assert found.x == pytest.approx(TRUTH * unit, rel=1e-9) and found.evaluations == other.evaluations


WITHOUT_DERIVATIVES = {"case": {"analysis": {"type": "stiffness"}}}
DATA = [Datum(0, "first", 1.0, 0.1), Datum(0, "second", 2.0, 0.2)]


class Closed(Evaluations):
    """Cases whose data are functions of the unknowns."""

    def _run(self, name, wanted):
        self.asked = [point for _, point in wanted]
        return [(WITHOUT_DERIVATIVES, self.fit.function(*point)) for _, point in wanted]


def closed(function, **unknowns):
    """Return the evaluations of a fit of DATA; `unknowns` are (start, lower, upper)."""
    rows = {name: Unknown(start=s, lower=low, upper=high) for name, (s, low, high) in unknowns.items()}
    fit = SimpleNamespace(
        unknowns=rows,
        paths=[(name,) for name in rows],
        data=DATA,
        tests=[{}],
        function=function,
        data_of=lambda test: DATA,
        rows_of=lambda test: slice(2),
    )
    return Closed(fit, Evaluator(Path(), MPI.COMM_SELF, 1, False, True))


def test_two_values_of_one_unknown_weigh_by_their_own_deviations():
    """1 +- 0.1 and 2 +- 0.2: (1 / 0.01 + 2 / 0.04) / (1 / 0.01 + 1 / 0.04) = 1.2 +- 1 / sqrt(125)."""
    found = closed(lambda a: np.array([a, a]), a=(1.5, 0.0, 9.0)).estimate()
    assert found.x == pytest.approx([1.2]) and found.std == pytest.approx([0.0894427])
    assert found.residuals == pytest.approx([2.0, -4.0]) and found.shares[0] == pytest.approx([0.8, 0.2])


@pytest.mark.parametrize("x", [3.0, 2.0, 3.01, 5.0, 4.99, 0.0], ids=str)
def test_differences_are_divided_by_the_way_between_their_cases(x):
    """Straight lines have their slopes anywhere: inside, at each bound and near it, and at zero."""
    lower = -1.0 if x == 0.0 else 2.0
    cases = closed(lambda a, b: np.array([7.0 * a - b, 2.0 * a + 3.0 * b]), a=(x, lower, 5.0), b=(1.0, 0.5, 1.0))
    np.testing.assert_allclose(cases.jacobian(np.array([x, 1.0])), [[7.0, -1.0], [2.0, 3.0]], rtol=1e-7)
    ends = [point[0] for point in cases.asked[:2]]
    step = DIFFERENCE * (x or 6.0)
    assert ends == pytest.approx([max(lower, x - step), min(5.0, x + step)])
    assert [point[1] for point in cases.asked[2:]] == pytest.approx([1.0 - DIFFERENCE, 1.0])


@pytest.mark.parametrize("start", [42.0, 30.0, 9.0])
def test_data_that_change_in_steps_are_fitted_by_wider_differences(start):
    """Both data are met from 20 to 24; a difference of 1 % sees no step of 4."""
    cases = closed(lambda a: np.floor(a / 4.0) / 5.0 * np.array([1.0, 2.0]), a=(start, 4.0, 100.0))
    found = cases.estimate()
    assert found.computed == pytest.approx([1.0, 2.0]) and 20.0 <= found.x[0] < 24.0
    assert 0.0 < found.std[0] < 8.0 and len(cases.answers) < 40


def test_the_result_is_the_best_point_of_all_that_were_computed():
    """A well within a widened step of the start lies beside a plateau."""
    well = closed(lambda a: np.array([1.0, 2.0]) * (1.0 if 59.0 < a < 61.0 else 1.01), a=(50.0, 0.0, 100.0))
    found = well.estimate()
    assert 59.0 < found.x[0] < 61.0 and found.computed == pytest.approx([1.0, 2.0])


@pytest.mark.parametrize("x", [21.0, 22.0, 23.9])
def test_the_interval_of_data_that_jump_is_the_range_in_which_they_stay(x):
    """Steps of 4 from 20 to 24, of straight lines between bounds, and of constants."""
    y, std, low, high = np.array([1.0, 2.0]), np.array([0.01, 0.02]), np.zeros(1), np.full(1, 100.0)
    models = {
        "steps": lambda a: np.floor(a[0] / 4.0) / 5.0 * y,
        "line": lambda a: y * (1.0 + (a[0] - x) / 100.0),
        "constant": lambda a: y,
    }
    for kind, slope in (("steps", 0.0), ("steps", 7.0), ("line", 0.01), ("constant", 0.0)):
        found = estimation.summarize(np.array([x]), y, (y, std), slope * y[:, None], (low, high))
        ranged = estimation.with_ranges(found, lambda a, f=models[kind]: (f(a) - y) / std, (y, std), (low, high))
        (width,) = ranged.half_width
        if kind == "steps":
            longer = max(x - 20.0, 24.0 - x)
            assert 0.75 * longer < width < 1.5 * longer
        else:
            assert width == (pytest.approx(1.959964 / 2**0.5) if kind == "line" else np.inf)


def test_a_value_far_from_the_model_at_a_bound_is_a_misfit():
    """One value leaves no freedom beside one unknown, but an unknown at its bound takes none."""
    edges = np.array([0.5]), np.array([1.5])
    found = fitted(np.array([9.0]), model=lambda a: a, jacobian=np.atleast_2d, start=(1.0,), bounds=edges)
    assert found.at_bound.tolist() == [1] and found.misfits
    found = fitted(np.array([1.2]), model=lambda a: a, jacobian=np.atleast_2d, start=(1.0,), bounds=edges)
    assert found.chance is None and not found.misfits


def test_an_unknown_that_no_step_moves_has_neither_interval_nor_noise():
    """Rounding errors of the values are no derivatives."""
    cases = closed(lambda a: np.array([1.0, 2.0]) * (1.0 + 1e-13 * np.sin(1e6 * a)), a=(30.0, 10.0, 70.0))
    found = cases.estimate()
    assert found.std[0] == np.inf and {(24.0,), (36.0,)} <= cases.answers.keys()
    line = "[unknown] a: no measured value depends on it"
    assert estimation.fit_document(cases.fit.unknowns, DATA, found)["faults"] == [line]


def test_a_range_reaches_over_a_step_of_the_curve_to_its_farther_part():
    """Within the limit from 50 to 54, and again from 58 to 62; the derivative predicts 52 +- 0.2."""

    def residuals(x):
        return np.array([0.0 if 50.0 <= x[0] <= 54.0 else 1.0 if 58.0 <= x[0] <= 62.0 else 9.0 + x[0]])

    measured, bounds = (np.zeros(1), np.ones(1)), (np.array([1.0]), np.array([200.0]))
    estimates = summarize(np.array([52.0]), np.zeros(1), measured, np.array([[10.0]]), bounds)
    assert estimates.half_width == pytest.approx([0.196], rel=1e-3)
    assert 10.0 <= with_ranges(estimates, residuals, measured, bounds).half_width[0] <= 10.0 / 0.9
    # The end of a range that is one piece has an error of at most a tenth, on the safe side.
    near = with_ranges(estimates, lambda x: residuals(np.minimum(x, 57.0)), measured, bounds)
    assert 2.0 <= near.half_width[0] <= 2.0 / 0.9
