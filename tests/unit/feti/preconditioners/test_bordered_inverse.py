"""The inverse of a block, for rows that come and go, against inverses made anew."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from feti_homog.feti.exact.bordered_inverse import BorderedInverse

# Below all diagonals.
SMALL = 1e-3
# Rows that come, rows that go, and the sign of those that come.
STEPS = [([0, 3], [], 1), ([9], [], -1), ([1, 2, 7], [3], 1), ([8, 11], [9, 1], -1), ([3], [0, 8], 1)]


def quasi_definite(n, negative, rank, seed=0):
    """(n, n) symmetric, positive semi-definite of this rank on the first rows, negative definite on the last ones."""
    rng = np.random.default_rng(seed)
    half = rng.standard_normal((n - negative, rank))
    M = np.zeros((n, n))
    M[: n - negative, : n - negative] = half @ half.T
    other = rng.standard_normal((negative, negative))
    M[n - negative :, n - negative :] = -(other @ other.T + np.eye(negative))
    M[: n - negative, n - negative :] = half @ rng.standard_normal((rank, negative))
    M[n - negative :, : n - negative] = M[: n - negative, n - negative :].T
    return M


def test_rows_come_and_go():
    M, found = quasi_definite(12, 4, 8), BorderedInverse(MPI.COMM_SELF)
    for new, gone, sign in STEPS:
        found.remove(np.array(gone, int))
        found.append(M, SMALL * np.ones(12), np.array(new, int), sign)
        expected = np.linalg.inv(M[np.ix_(found.members, found.members)])
        np.testing.assert_allclose(found.N, expected, rtol=1e-9, atol=1e-12 * np.abs(expected).max())
    assert sorted(found.members) == [2, 3, 7, 11]


def test_rows_stiffen_and_soften():
    M, found, D = quasi_definite(12, 4, 8), BorderedInverse(MPI.COMM_SELF), np.zeros(12)
    D[[0, 3, 7]] = 2.0, 0.5, 30.0
    found.append(M, SMALL * np.ones(12), np.array([0, 1, 3, 7]), 1, D)
    found.append(M, SMALL * np.ones(12), np.array([9]), -1, D)
    for at, added in (([0], [0.1]), ([2, 3], [0.4, 4.0])):
        found.change(np.array(at), np.array(added))
        D[found.members[at]] = added
        expected = np.linalg.inv((M + np.diag(D))[np.ix_(found.members, found.members)])
        np.testing.assert_allclose(found.N, expected, rtol=1e-9, atol=1e-12 * np.abs(expected).max())
    found.remove(np.array([3]))
    expected = np.linalg.inv((M + np.diag(D))[np.ix_(found.members, found.members)])
    np.testing.assert_allclose(found.N, expected, rtol=1e-9, atol=1e-12 * np.abs(expected).max())
    assert found.holds()


@pytest.mark.parametrize("at_once", [1, 2, 6], ids=["one by one", "in pairs", "all together"])
def test_rows_that_depend_on_others_are_left_out(at_once):
    M, found = quasi_definite(6, 0, 4), BorderedInverse(MPI.COMM_SELF)
    for first in range(0, 6, at_once):
        found.append(M, SMALL * np.ones(6), np.arange(first, first + at_once), 1)
    assert len(found.members) == 4
    # What the others would add is in the range of those that were kept.
    x = M @ np.arange(6.0)
    np.testing.assert_allclose(M[:, found.members] @ found.N @ x[found.members], x, rtol=1e-8)


def test_a_row_of_nothing_is_left_out_though_it_comes_first():
    found = BorderedInverse(MPI.COMM_SELF)
    M, size = np.diag([1e-14, 1e-14]), np.array([1.0, 1e-13])
    found.append(M, size, np.array([0]), 1)
    assert len(found.members) == 0
    found.append(M, size, np.array([0, 1]), 1)
    assert found.members.tolist() == [1]


@pytest.mark.parametrize("seed", range(4))
def test_rows_of_any_sizes_are_taken_alike(seed):
    """With D M D in place of M the same rows are members, the inverse is D^-1 N D^-1, and as good."""
    rng = np.random.default_rng(seed)
    M, plain, found = quasi_definite(12, 4, 5, seed), BorderedInverse(MPI.COMM_SELF), BorderedInverse(MPI.COMM_SELF)
    D = 2.0 ** rng.integers(-40, 40, 12)
    size = np.maximum(np.abs(M.diagonal()), SMALL)
    for new, gone, sign in STEPS:
        for inverse, d in ((plain, np.ones(12)), (found, D)):
            inverse.remove(np.array(gone, int))
            inverse.append(M * np.outer(d, d), size * d**2, np.array(new, int), sign)
        assert found.members.tolist() == plain.members.tolist()
        own = D[found.members]
        expected = plain.N / np.outer(own, own)
        root = np.sqrt(np.abs(expected.diagonal()))
        np.testing.assert_allclose(found.N / np.outer(root, root), expected / np.outer(root, root), atol=1e-9)
        assert found.holds() and plain.holds()
    assert len(found.members) == 4


def test_borders_that_pass_by_a_singular_block_are_noticed():
    """One row is positive semi-definite only with the negative one beside it."""
    M = np.array([[1.0, 1.0, 0.5], [1.0, 1.0, 0.2], [0.5, 0.2, -1.0]])
    found = BorderedInverse(MPI.COMM_SELF)
    found.append(M, np.ones(3), np.array([2]), -1)
    found.append(M, np.ones(3), np.array([0, 1]), 1)
    assert len(found.members) == 3 and found.holds()
    found.remove(np.array([2]))
    assert not found.holds()
    anew = BorderedInverse(MPI.COMM_SELF)
    anew.append(M, np.ones(3), np.array([0, 1]), 1)
    assert len(anew.members) == 1 and anew.holds()
