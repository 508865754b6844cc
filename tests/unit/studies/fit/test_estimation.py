"""Least squares on closed models: estimates, intervals, and what the data do not determine."""

from math import factorial

import numpy as np
import pytest

from feti_homog.studies.estimation import estimate, names_of

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
