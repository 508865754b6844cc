"""The answer and the columns that follow softening, breaking and closing bonds, against a dense cell."""

from __future__ import annotations

import numpy as np
import pytest
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


def cell(seed, scale=1.0, coupling=1.0):
    """Draw F and d, and return what draws; the `coupling` of two halves is that of bonds far from each other."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(N, N))
    F, half = A @ A.T + np.eye(N), np.arange(N) < N // 2
    return rng, scale * np.where(half == half[:, None], 1.0, coupling) * F, rng.normal(size=(N, 3))


def changed(rng, active, more, scale):
    """Other states: rows turn, those that come have any compliance, and some that hold soften."""
    active, more = active.copy(), more.copy()
    turned = rng.choice(N, 3, replace=False)
    active[turned] = 1.0 - active[turned]
    more[turned] = np.where(active[turned] > 0.0, scale * rng.uniform(0.0, 1.0, 3), more[turned])
    more[rng.choice(N, 2)] += 1.5 * scale
    return active, more


@pytest.mark.parametrize(("scale", "coupling"), [(1.0, 1.0), (1e-10, 1.0), (1e-10, 1e-7)])
def test_answers_and_columns_follow_all_changes(scale, coupling):
    """Make more changes than wait; rows that soften again while they are not active do so when they come."""
    rng, F, d = cell(3, scale, coupling)
    active, more = np.ones(N), np.zeros(N)
    active[[2, 5]], more[[0, 7]] = 0.0, 0.5 * scale
    U, Gamma = response(F, d, active, more)
    followed = FollowedResponse(MPI.COMM_SELF, 0, N, U)
    followed.add(np.arange(N), Gamma)
    for _ in range(30):
        active_after, more_after = changed(rng, active, more, scale)
        turned, gained = active - active_after, more_after * active_after - more * active
        rows = np.flatnonzero((turned != 0.0) | (gained != 0.0))
        assert followed.follow(rows, turned[rows], gained[rows], 1.0 / F.diagonal()[rows])
        active, more = active_after, more_after
        U, Gamma = response(F, d, active, more)
        # Multipliers and jumps by their own units.
        unit = np.where(active > 0.0, scale, 1.0)[:, None]
        np.testing.assert_allclose(unit * followed.answer, unit * U, atol=1e-12 * np.abs(unit * U).max())
        units = unit @ unit.T / scale
        blocks, of_units = (
            M.reshape(N // 2, 2, N // 2, 2)[np.arange(N // 2), :, np.arange(N // 2)] for M in (Gamma, units)
        )
        atol, found = 1e-12 * np.abs(units * Gamma).max(), followed.blocks(np.arange(N).reshape(-1, 2))
        np.testing.assert_allclose(of_units * found, of_units * blocks, atol=atol)
        np.testing.assert_allclose(units * followed._present(np.arange(N))[0], units * Gamma, atol=atol)


@pytest.mark.parametrize(("left", "refused"), [(0.0, True), (1e-4, True), (1e-1, False)])
def test_what_cannot_be_followed_is_refused(left, refused):
    """Rows without columns, springs that stiffen, and a block that is singular but for left^2: its rows hold a body."""
    _, F, d = cell(4)
    motion = np.zeros(N)
    motion[:3] = 1.0
    P = np.eye(N) - (1.0 - left) * np.outer(motion, motion) / 3.0
    Gamma = P @ np.linalg.inv(F) @ P
    followed = FollowedResponse(MPI.COMM_SELF, 0, N, Gamma @ d)
    rows, one = np.arange(3), np.ones(3)
    assert not followed.follow(rows, one, 0.0 * one, 1.0 / F.diagonal()[:3])
    followed.add(np.arange(N), Gamma)
    assert not followed.follow(rows, 0.0 * one, -0.1 * one, 1.0 / F.diagonal()[:3])
    assert followed.follow(rows, one, 0.0 * one, 1.0 / F.diagonal()[:3]) != refused
    assert not refused or followed.follow(rows[:2], one[:2], 0.0 * one[:2], 1.0 / F.diagonal()[:2])
