"""Evaluations of a fit of closed forms: weights of the data, and differences of cases within the bounds."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from feti_homog.case.sections import Unknown
from feti_homog.studies import estimation
from feti_homog.studies.fit import DIFFERENCE, Evaluations
from feti_homog.studies.predictions import Datum
from feti_homog.studies.study import Evaluator

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


def test_an_unknown_that_no_step_moves_has_neither_interval_nor_noise():
    """Rounding errors of the values are no derivatives."""
    cases = closed(lambda a: np.array([1.0, 2.0]) * (1.0 + 1e-13 * np.sin(1e6 * a)), a=(30.0, 10.0, 70.0))
    found = cases.estimate()
    assert found.std[0] == np.inf and {(24.0,), (36.0,)} <= cases.answers.keys()
    line = "[unknown] a: no measured value depends on it"
    assert estimation.fit_document(cases.fit.unknowns, DATA, found)["faults"] == [line]
