"""The answer and the columns that follow softening, breaking and closing bonds, against a dense cell."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from feti_homog.feti.preconditioners.followed_response import FollowedResponse

N = 12


def response(F, d, active, more):
    """U and Gamma of a cell with the dual operator F and jumps d, whose active rows have `more` compliance."""
    a, r = np.flatnonzero(active), np.flatnonzero(active == 0)
    F = F + np.diag(more * active)
    H, across = np.linalg.inv(F[np.ix_(a, a)]), F[np.ix_(r, a)]
    U, Gamma = np.zeros(d.shape), np.zeros(F.shape)
    U[a], U[r] = H @ d[a], d[r] - across @ H @ d[a]
    Gamma[np.ix_(a, a)], Gamma[np.ix_(r, r)] = H, across @ H @ across.T - F[np.ix_(r, r)]
    Gamma[np.ix_(r, a)], Gamma[np.ix_(a, r)] = -across @ H, -(across @ H).T
    return U, Gamma


def cell(seed):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(N, N))
    return rng, A @ A.T + np.eye(N), rng.normal(size=(N, 3))


def changed(rng, active, more):
    """Other states: rows turn, those that come have any compliance, and some that hold soften."""
    active, more = active.copy(), more.copy()
    turned = rng.choice(N, 3, replace=False)
    active[turned] = 1.0 - active[turned]
    more[turned] = np.where(active[turned] > 0.0, rng.uniform(0.0, 1.0, 3), more[turned])
    more[rng.choice(N, 2)] += 1.5
    return active, more


def test_answers_and_columns_follow_all_changes():
    """As many changes as wait, and more; rows that soften again when they are not active do so when they come."""
    rng, F, d = cell(3)
    active, more = np.ones(N), np.zeros(N)
    active[[2, 5]], more[[0, 7]] = 0.0, 0.5
    U, Gamma = response(F, d, active, more)
    followed = FollowedResponse(MPI.COMM_SELF, 0, N, U)
    followed.add(np.arange(N), Gamma)
    for _ in range(30):
        active_after, more_after = changed(rng, active, more)
        turned, gained = active - active_after, more_after * active_after - more * active
        rows = np.flatnonzero((turned != 0.0) | (gained != 0.0))
        assert followed.follow(rows, turned[rows], gained[rows], 1.0 / F.diagonal()[rows])
        active, more = active_after, more_after
        U, Gamma = response(F, d, active, more)
        np.testing.assert_allclose(followed.answer, U, atol=1e-12 * np.abs(U).max())
        blocks = Gamma.reshape(N // 2, 2, N // 2, 2)[np.arange(N // 2), :, np.arange(N // 2)]
        found = followed.blocks(np.arange(N).reshape(-1, 2))
        np.testing.assert_allclose(found, blocks, atol=1e-12 * np.abs(Gamma).max())
        np.testing.assert_allclose(followed._present(np.arange(N))[0], Gamma, atol=1e-12 * np.abs(Gamma).max())


def test_what_cannot_be_followed_is_refused():
    """Rows without columns, springs that stiffen, and a block that is singular: its rows alone hold a body."""
    _, F, d = cell(4)
    motion = np.zeros(N)
    motion[:3] = 1.0
    P = np.eye(N) - np.outer(motion, motion) / 3.0
    Gamma = P @ np.linalg.inv(F) @ P
    followed = FollowedResponse(MPI.COMM_SELF, 0, N, Gamma @ d)
    rows, one = np.arange(3), np.ones(3)
    assert not followed.follow(rows, one, 0.0 * one, 1.0 / F.diagonal()[:3])
    followed.add(np.arange(N), Gamma)
    assert not followed.follow(rows, 0.0 * one, -0.1 * one, 1.0 / F.diagonal()[:3])
    assert not followed.follow(rows, one, 0.0 * one, 1.0 / F.diagonal()[:3])
    assert followed.follow(rows[:2], one[:2], 0.0 * one[:2], 1.0 / F.diagonal()[:2])
