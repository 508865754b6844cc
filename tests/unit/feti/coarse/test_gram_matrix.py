"""G^T A G by its entries, against products of matrices."""

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_matrix

from feti_homog.feti.coarse.natural import GramMatrix


def coupled(rows=40, bodies=5, modes=3, seed=1):
    """(rows, bodies * modes) G whose rows couple body 0 with one of the others each."""
    rng = np.random.default_rng(seed)
    G = np.zeros((rows, bodies * modes))
    for row, body in enumerate(rng.integers(1, bodies, rows)):
        for b in (0, body):
            G[row, modes * b : modes * (b + 1)] = rng.standard_normal(modes)
    return G


def whole(gram, modes, active):
    """(m, m) G^T A G by its entries."""
    return np.append(gram.entries(active), 0.0)[gram.places(np.arange(modes)[None])[0]]


def test_the_entries_are_linear_in_the_active_rows():
    G = coupled()
    gram = GramMatrix(MPI.COMM_SELF, csr_matrix(G), np.arange(15))
    for seed in range(3):
        active = np.random.default_rng(seed).integers(0, 2, len(G)).astype(float)
        found = whole(gram, G.shape[1], active)
        np.testing.assert_allclose(found, G.T @ np.diag(active) @ G, atol=1e-13)


def test_groups_are_what_is_coupled_without_the_others():
    G = coupled()
    gram = GramMatrix(MPI.COMM_SELF, csr_matrix(G), np.arange(15))
    (groups,) = gram.groups(np.arange(3, 15))
    assert sorted(map(tuple, np.sort(groups, axis=1))) == [tuple(range(3 * b, 3 * b + 3)) for b in range(1, 5)]
    dense = np.append(gram.entries(np.ones(len(G))), 0.0)[gram.places(groups)]
    for block, members in zip(dense, groups, strict=True):
        np.testing.assert_allclose(block, (G.T @ G)[np.ix_(members, members)], atol=1e-13)
    (whole,) = gram.groups(np.arange(15))
    assert whole.shape == (1, 15)


def test_a_mode_that_no_row_sees_has_a_diagonal_entry():
    gram = GramMatrix(MPI.COMM_SELF, csr_matrix((4, 2)), np.arange(2))
    np.testing.assert_array_equal(whole(gram, 2, np.ones(4)), np.zeros((2, 2)))
    assert [g.tolist() for g in gram.groups(np.arange(2))] == [[[0], [1]]]
