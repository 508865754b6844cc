"""The answer and columns that follow softening, breaking and closing bonds, and others by them, in dense cells."""

from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from feti_homog.feti.exact.followed_response import FollowedResponse
from feti_homog.feti.exact.reference_changes import ReferenceChanges

N, NO_ROWS = 12, np.zeros(0, np.int64)


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
    """Make more changes than wait; springs stiffen, too, and rows soften while they are not active."""
    rng, F, d = cell(3, scale, coupling)
    active, more = np.ones(N), np.zeros(N)
    active[[2, 5]], more[[0, 7]] = 0.0, 0.5 * scale
    U, Gamma = response(F, d, active, more)
    followed = FollowedResponse(MPI.COMM_SELF, 0, 1.0 / F.diagonal(), U, N)
    followed.add(np.arange(N), Gamma)
    for _ in range(30):
        active_after, more_after = changed(rng, active, more, scale)
        # Damaged bonds that are pressed stiffen.
        more_after[rng.choice(N)] *= 0.3
        turned, gained = active - active_after, more_after * active_after - more * active
        rows = np.flatnonzero((turned != 0.0) | (gained != 0.0))
        assert followed.follow(rows, turned[rows], gained[rows])
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


@pytest.mark.parametrize(("left", "refused"), [(1e-4, True), (1e-1, False)])
def test_what_cannot_be_followed_is_refused(left, refused):
    """A block is nearly singular: its rows hold a body."""
    _, F, d = cell(4)
    motion = np.zeros(N)
    motion[:3] = 1.0
    P = np.eye(N) - (1.0 - left) * np.outer(motion, motion) / 3.0
    Gamma = P @ np.linalg.inv(F) @ P
    followed = FollowedResponse(MPI.COMM_SELF, 0, 1.0 / F.diagonal(), Gamma @ d, N)
    rows, one = np.arange(3), np.ones(3)
    followed.add(np.arange(N), Gamma)
    assert followed.follow(rows, one, 0.0 * one) != refused
    assert not refused or followed.follow(rows[:2], one[:2], 0.0 * one[:2])


def floating(F, d, G, active, more):
    """(N, v) multipliers of active rows with `more` compliance, in equilibrium on bodies with the motions G."""
    a = np.flatnonzero(active)
    K = np.block([[F[np.ix_(a, a)] + np.diag(more[a]), G[a]], [G[a].T, np.zeros((G.shape[1], G.shape[1]))]])
    lam = np.zeros(d.shape)
    lam[a] = np.linalg.lstsq(K, np.vstack([d[a], np.zeros((G.shape[1], d.shape[1]))]), rcond=1e-12)[0][: len(a)]
    return lam


def test_answers_follow_bodies_that_come_free_and_are_caught(scale=1e-3):
    """Two bodies with two motions each are held by half of the rows; rows leave one by one, come, soften, leave."""
    rng, F, d = cell(5, scale)
    G = np.zeros((N, 4))
    G[: N // 2, :2], G[N // 2 :, 2:] = rng.normal(size=(N // 2, 2)), rng.normal(size=(N // 2, 2))
    P = np.eye(N) - G @ np.linalg.pinv(G)
    basis = np.linalg.svd(P)[0][:, : N - 4]
    Gamma = basis @ np.linalg.inv(basis.T @ F @ basis) @ basis.T
    active, more = np.ones(N), np.zeros(N)
    followed = FollowedResponse(MPI.COMM_SELF, 0, 1.0 / F.diagonal(), Gamma @ d, N)
    followed.add(np.arange(N), Gamma)
    free = []
    for number in range(60):
        active_after, more_after = active.copy(), more.copy()
        turned = rng.choice(N, 1 + number % 3, replace=False)
        active_after[turned] = rng.random(len(turned)) < 0.2
        more_after[rng.choice(N, 2)] += scale * rng.random()
        gained, turns = more_after * active_after - more * active, active - active_after
        rows = np.flatnonzero((turns != 0.0) | (gained != 0.0))
        assert followed.follow(rows, turns[rows], gained[rows])
        active, more = active_after, more_after
        expected = floating(F, d, G, active, more)
        np.testing.assert_allclose(active[:, None] * followed.answer, expected, atol=1e-9 * np.abs(Gamma @ d).max())
        jump = (1.0 - active)[:, None] * followed.answer
        # What is left on inactive rows is what the multipliers leave, but for motions of the bodies.
        left = d - (F + np.diag(more * active)) @ expected - jump
        np.testing.assert_allclose(left - G @ np.linalg.lstsq(G, left, rcond=None)[0], 0.0, atol=1e-8)
        free.append(4 - np.linalg.matrix_rank(G[active > 0.0]))
        assert len(followed.pins) == free[-1]
    assert len(set(free)) > 3 and (np.diff(free) < 0).sum() > 3


def test_columns_that_make_room_are_those_unused_longest():
    _, F, d = cell(5)
    U, Gamma = response(F, d, np.ones(N), np.zeros(N))
    followed = FollowedResponse(MPI.COMM_SELF, 0, 1.0 / F.diagonal(), U, 8)
    followed.add(np.arange(8), Gamma[:, :8])
    followed.make_room(0, NO_ROWS, np.ones(N, bool))
    assert len(followed.lacking(np.arange(8))) == 0
    for row in (0, 3, 5):
        followed.soften(np.array([row]), np.array([0.1]))
    useful = np.arange(N) != 5
    # Six stay: the wanted one, and useful ones before others. Row 5 was used, 7 and the rest never.
    followed.make_room(2, np.array([1]), useful)
    assert followed.lacking(np.arange(8)).tolist() == [5, 7]
    followed.add(np.array([8, 9]), Gamma[:, 8:10])
    followed.make_room(4, np.array([1, 8, 9]), np.ones(N, bool))
    assert followed.lacking(np.arange(10)).tolist() == [0, 2, 4, 5, 6, 7]
    # What is needed stays, though there was no room for more.
    columns = followed.columns(np.array([1, 3, 8, 9]))
    followed.make_room(10, np.array([1, 3, 8, 9]), useful)
    followed.add(np.array([0, 2, 4, 5, 6, 7, 10, 11]), Gamma[:, [0, 2, 4, 5, 6, 7, 10, 11]])
    np.testing.assert_array_equal(followed.columns(np.array([1, 3, 8, 9])), columns)


def of_reference(seed, scale, off=0.0):
    """Change a cell three times since its reference; followed columns are `off` by a share.

    Return the changes, active rows among the others, U and Gamma of the reference and of the cell, and active rows.
    """
    rng, F, d = cell(seed, scale)
    before, more = np.ones(N), np.zeros(N)
    before[[2, 5]] = 0.0
    U_before, Gamma_before = response(F, d, before, more)
    active = before
    for _ in range(3):
        active, more = changed(rng, active, more, scale)
    U, Gamma = response(F, d, active, more)
    reference = SimpleNamespace(active=before, respond=lambda x: Gamma_before @ x)
    kinds = np.stack([before - active, more * active], axis=1)
    rows = np.flatnonzero(kinds.any(axis=1))
    followed = FollowedResponse(MPI.COMM_SELF, 0, 1.0 / F.diagonal(), U, N)
    followed.add(rows[::-1], (Gamma * (1.0 + off * rng.uniform(-1.0, 1.0, Gamma.shape)))[:, rows[::-1]])
    changes = ReferenceChanges(MPI.COMM_SELF, 0, reference, followed, rows, kinds[rows])
    assert set(kinds[:, 0]) == {-1.0, 0.0, 1.0} and (kinds[kinds[:, 0] == 0.0, 1] > 0.0).any()
    assert (kinds[kinds[:, 0] < 0.0, 1] > 0.0).any() and len(rows) < N
    return changes, np.setdiff1d(np.flatnonzero(active), rows), (U_before, U), (Gamma_before, Gamma), active


@pytest.mark.parametrize("scale", [1.0, 1e-10])
@pytest.mark.parametrize("seed", [0, 1])
def test_columns_and_answers_are_those_of_the_changed_cell(seed, scale):
    changes, others, (U_before, U), (Gamma_before, Gamma), active = of_reference(seed, scale)
    # Multipliers and jumps by their own units.
    unit = np.where(active > 0.0, scale, 1.0)[:, None]
    found, expected = changes.present(Gamma_before[:, others]), Gamma[:, others]
    np.testing.assert_allclose(unit * found, unit * expected, atol=1e-11 * np.abs(unit * expected).max())
    for answer in (changes.present(U_before), changes.refined(U_before)):
        np.testing.assert_allclose(unit * answer, unit * U, atol=1e-11 * np.abs(unit * U).max())


@pytest.mark.parametrize("seed", [0, 1])
def test_refinement_and_the_check_see_what_is_wrong_in_followed_columns(seed):
    changes, others, (U_before, U), (Gamma_before, Gamma), _ = of_reference(seed, 1.0, off=1e-7)
    size = np.abs(U).max()
    rough, refined = changes.present(U_before), changes.refined(U_before)
    assert 1e-9 * size < np.abs(rough - U).max() and np.abs(refined - U).max() < 1e-11 * size
    columns, stiffness = changes.present(Gamma_before[:, others]), np.ones(N)
    assert 1e-9 < changes.error(others, columns, stiffness) < 1e-5
    right, *_ = of_reference(seed, 1.0)
    assert right.error(others, Gamma[:, others], stiffness) < 1e-12
