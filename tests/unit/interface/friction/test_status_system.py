"""Responses that are kept up from statuses to statuses, against systems that are factored for each of them."""

import numpy as np
import pytest

from feti_homog.interface.friction.status_system import (
    BACKWARD,
    FORWARD,
    OPEN_FACE,
    STICK,
    FollowedStatuses,
    StatusSystem,
    free_rows,
)


def scaled(rng, m):
    B = rng.normal(size=(m + 4, m))
    S = B.T @ B
    return S / np.sqrt(np.outer(S.diagonal(), S.diagonal()))


def assert_solves(followed, S, friction, status, by_stress, rng):
    free, slope = free_rows(status, friction, by_stress)
    assert followed.turn(free, slope)
    system = StatusSystem(S, free, slope)
    for start, given in ((np.where(free, 0.0, rng.normal(size=len(S))), rng.normal(size=len(S))), (0.0 * S[0], S[0])):
        x, y = followed.solve(start, np.where(free, given, 0.0), lambda x: np.abs(S) @ np.abs(x))
        expected, _ = system.solve(start, np.where(free, given, 0.0))
        np.testing.assert_allclose(x, expected, atol=1e-10 * max(1.0, np.abs(expected).max()))
        np.testing.assert_allclose(y, S @ x, atol=1e-13 * np.abs(x).max() * len(S))
    assert followed.sign == system.sign


def test_statuses_are_followed_and_nodes_come_in_any_order_and_on_other_springs():
    """Springs of two nodes change at each growth, and with them the units of their entries."""
    rng = np.random.default_rng(1)
    n, kinds = 30, np.array([STICK, FORWARD, OPEN_FACE, BACKWARD], np.int8)
    S, by_stress = scaled(rng, 2 * n + 3), np.array([False, True, False])
    friction, arrival = rng.uniform(0.0, 0.4, n), rng.permutation(n)
    own, followed = np.zeros(0, np.int64), None
    for count in (2, 3, 7, 8, 20, n):
        nodes, before = np.sort(arrival[:count]), own
        own = np.concatenate([(2 * nodes[:, None] + np.arange(2)).ravel(), 2 * n + np.arange(3)])
        changed = np.flatnonzero(np.isin(own, 2 * nodes[:2, None] + np.arange(2)) & np.isin(own, before))
        S[own[changed], own[changed]] += rng.uniform(-0.3, 3.0)
        units = np.ones(2 * n + 3)
        units[own[changed]] = np.repeat(rng.uniform(0.3, 3.0, len(changed) // 2), 2)
        S *= np.outer(units, units)
        part = S[own[:, None], own]
        if followed is None:
            followed = FollowedStatuses(part)
        else:
            assert followed.grow(part, np.searchsorted(own, before), changed, units[before])
        status = rng.choice(kinds, count)
        for _ in range(8):
            assert_solves(followed, part, friction[nodes], status, by_stress, rng)
            status = status.copy()
            status[rng.integers(0, count, 2)] = rng.choice(kinds, 2)


def test_free_motions_are_refused_and_left_again():
    """A node whose slip has no stiffness."""
    S = np.diag([1.0, 0.0, 1.0, 1.0, 1.0])
    S[0, 4] = S[4, 0] = 0.5
    followed, friction, by_strain = FollowedStatuses(S), np.full(2, 0.1), np.zeros(1, bool)
    assert not followed.turn(*free_rows(np.array([OPEN_FACE, STICK], np.int8), friction, by_strain))
    status = np.array([STICK, FORWARD], np.int8)
    assert_solves(followed, S, friction, status, by_strain, np.random.default_rng(0))


def test_what_nothing_determines_stays_as_it_was():
    """Three rigid motions of open nodes, which forces do not determine."""
    rng = np.random.default_rng(4)
    motions = np.linalg.qr(rng.normal(size=(12, 3)))[0]
    P = np.eye(12) - motions @ motions.T
    S = np.zeros((13, 13))
    S[:12, :12], S[12, 12] = P @ scaled(rng, 12) @ P, 1.0
    S[:12, 12] = S[12, :12] = 0.1 * P[0]
    free, slope = free_rows(np.full(6, OPEN_FACE, np.int8), np.full(6, 0.3), np.zeros(1, bool))
    start = rng.normal(size=13)
    x, balanced = StatusSystem(S, free, slope).solve(start, np.zeros(13))
    assert balanced
    np.testing.assert_allclose((S @ x)[:12], 0.0, atol=1e-12)
    np.testing.assert_allclose(motions.T @ x[:12], motions.T @ start[:12], atol=1e-5)


@pytest.mark.parametrize("stiffness", [1e-6, 1e-8, 1e-9])
def test_soft_motions_are_not_held(stiffness):
    """Two nodes of opposite slips whose sum hardly anything resists."""
    S = np.eye(5)
    S[1, 3] = S[3, 1] = -1.0 + stiffness
    free, slope = free_rows(np.array([FORWARD, BACKWARD], np.int8), np.zeros(2), np.zeros(1, bool))
    given = np.array([0.0, stiffness, 0.0, stiffness, 0.0])
    x, balanced = StatusSystem(S, free, slope).solve(np.zeros(5), given)
    assert balanced
    np.testing.assert_allclose(x[[1, 3]], 1.0, rtol=1e-4)
