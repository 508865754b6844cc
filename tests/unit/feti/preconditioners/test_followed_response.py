"""Answers and columns that follow bonds which soften, against inverses made anew."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from feti_homog.feti.preconditioners.followed_response import FollowedResponse
from feti_homog.feti.thresholds import FOLLOWED_COLUMNS, WAITING_COLUMNS


def test_answers_follow_springs_that_soften():
    rng = np.random.default_rng(0)
    half, d, C = rng.standard_normal((12, 12)), rng.standard_normal((12, 3)), np.zeros(12)
    F = half @ half.T + np.eye(12)
    found = FollowedResponse(MPI.COMM_SELF, 0, 12, np.linalg.solve(F, d))
    for step in range(2 * WAITING_COLUMNS):
        rows, more = rng.permutation(12)[: 1 + step % 3], 10.0 ** rng.uniform(-3.0, 2.0, 1 + step % 3)
        lacking = found.lacking(rows)
        found.add(lacking, np.linalg.inv(F + np.diag(C))[:, lacking])
        found.soften(rows, more)
        C[rows] += more
        expected = np.linalg.solve(F + np.diag(C), d)
        np.testing.assert_allclose(found.answer, expected, rtol=1e-9, atol=1e-12 * np.abs(expected).max())
    assert not len(found.lacking(np.arange(12)))


def test_columns_that_are_too_many_go():
    n = FOLLOWED_COLUMNS + 1
    found = FollowedResponse(MPI.COMM_SELF, 0, n, np.zeros((n, 1)))
    for rows in np.split(np.arange(n), [FOLLOWED_COLUMNS]):
        found.add(rows, np.eye(n)[:, rows])
    np.testing.assert_array_equal(found.lacking(np.arange(n)), np.arange(FOLLOWED_COLUMNS))
