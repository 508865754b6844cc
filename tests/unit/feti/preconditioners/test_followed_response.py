"""The answer that follows softening bonds, against the formula on a dense response."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from feti_homog.feti.preconditioners.followed_response import FollowedResponse


def test_answers_follow_bonds_that_soften():
    """U = (F + C)^-1 d after more compliance on three rows."""
    rng, more = np.random.default_rng(3), np.array([0.4, 0.1, 2.0])
    A = rng.normal(size=(9, 9))
    F, d = A @ A.T + np.eye(9), rng.normal(size=(9, 3))
    rows, softer = np.array([1, 4, 7]), np.diag(np.bincount([1, 4, 7], more, 9))
    followed = FollowedResponse(MPI.COMM_SELF, 0, 9, np.linalg.solve(F, d))
    followed.add(rows, np.linalg.inv(F)[:, rows])
    followed.soften(rows, more)
    expected = np.linalg.solve(F + softer, d)
    np.testing.assert_allclose(followed.answer, expected, rtol=1e-12, atol=1e-12)
