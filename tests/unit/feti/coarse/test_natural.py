"""The natural coarse space: memory of a thousand fibres that nothing holds, and entries of G^T A G."""

import tracemalloc
from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI
from scipy.sparse import csr_matrix, diags, hstack, identity

from feti_homog.feti.coarse.natural import GramMatrix, NaturalCoarseSpace
from feti_homog.interface.contact.floating_bodies import FloatingBodies

FIBRES, NODES = 1000, 8
ROWS = 2 * NODES * FIBRES
MEGABYTES = 2**20
# Dense, the motions (3 * FIBRES)^2 and their gaps (NODES * FIBRES, 3 * FIBRES) would take 72 and 192 MB.
MOST = 30 * MEGABYTES


def around(nodes=NODES):
    """(nodes, 2) normals of a round fibre of radius 1."""
    angle = 2 * np.pi * (np.arange(nodes) + 0.5) / nodes
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def fibre_modes(length, nodes=NODES):
    """(2 nodes, 3) orthonormal rigid motions of an ellipse's nodes, in the directions of rows (n, t)."""
    n = around(nodes)
    t = np.stack([-n[:, 1], n[:, 0]], axis=1)
    points = n * [length, 1.0]
    turn = np.stack([-points[:, 1], points[:, 0]], axis=1)
    motions = [np.tile(e, (nodes, 1)) for e in np.eye(2)] + [turn]
    rows = np.stack([[(m * n).sum(axis=1), (m * t).sum(axis=1)] for m in motions])
    return np.linalg.qr(rows.transpose(2, 1, 0).reshape(2 * nodes, 3))[0]


def loose_fibres(weights=1.0):
    """Fibres in a matrix that is pinned, with pairs of rows (n, t) at each node, which have weights."""
    bodies = [
        SimpleNamespace(
            R=-fibre_modes(1.0 + k / FIBRES), submesh=SimpleNamespace(body=k + 1), held=(), is_supported=False
        )
        for k in range(FIBRES)
    ]
    bodies.append(SimpleNamespace(R=np.zeros((0, 0)), submesh=SimpleNamespace(body=0), held=(0,), is_supported=False))
    dofs = [np.arange(len(body.R)) for body in bodies]
    return coarse_space(bodies, dofs, diags(weights * np.ones(ROWS)))


def coarse_space(bodies, dofs, B):
    """Natural coarse space of these bodies on one rank."""
    operators, n = SimpleNamespace(subdomains=bodies, dofs=dofs, B=B.tocsr()), B.shape[0]
    operators.comm, operators.jump_operator = MPI.COMM_SELF, SimpleNamespace(owned=(0, n), rows=np.arange(n))
    return NaturalCoarseSpace(operators)


@pytest.fixture(scope="module")
def coarse():
    space = loose_fibres()
    yield space
    space.destroy()


@contextmanager
def at_most(limit):
    """Provide a block that allocates no more at a time than so many bytes."""
    tracemalloc.start()
    yield
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < limit


def test_motions_of_many_fibres_that_nothing_holds(coarse):
    active = np.ones(ROWS)
    free = np.arange(FIBRES) % 10 > 0
    active[np.repeat(free, 2 * NODES)] = 0.0
    with at_most(MOST):
        coarse.activate(active)
    Z = coarse.unconstrained_modes
    assert Z.shape == (3 * FIBRES, 3 * free.sum())
    assert abs(Z.T @ Z - identity(Z.shape[1])).max() < 1e-12
    assert abs(coarse.G_active @ Z).max() < 1e-12
    assert np.array_equal(np.flatnonzero(abs(Z).sum(axis=1)), np.flatnonzero(np.repeat(free, 3)))
    x = active * np.cos(np.arange(len(active)))
    assert np.abs(coarse.G_active.T @ coarse.project(x)).max() < 1e-12


def test_the_resistance_to_a_motion_is_compared_with_that_of_its_own_body():
    """A large body's rows are small beside those of others."""
    small, active = np.ones(ROWS), np.ones(ROWS)
    small[: 2 * NODES] = 1e-6
    coarse = loose_fibres(small)
    active[3 : 2 * NODES] = 0.0
    assert coarse.free_motions(active).shape[1] == 0
    active[0] = 0.0
    assert coarse.free_motions(active).shape[1] == 1
    coarse.destroy()


def test_one_of_many_loose_fibres_that_overlaps_is_moved(coarse):
    """The fibre moves by the overlap, for it has room on the other side; the others stay."""
    coarse.activate(np.zeros(ROWS))
    row, moved = 2 * np.arange(NODES * FIBRES), 7
    amplitudes = np.zeros(3 * FIBRES)
    amplitudes[3 * moved : 3 * moved + 3] = [0.3, -0.2, 0.1]
    jump = coarse.G @ amplitudes + np.where(np.arange(2 * len(row)) % 2 == 0, 0.01, 0.0)
    bodies = np.stack([np.zeros(len(row), np.int64), 1 + np.repeat(np.arange(FIBRES), NODES)], axis=1)
    nodes, solution = SimpleNamespace(row=row, bodies=bodies), SimpleNamespace(jump=jump)
    with at_most(MOST):
        alpha, pressed = FloatingBodies(MPI.COMM_SELF, coarse, nodes, np.ones(len(row), bool), 1e-9).place(solution)
    assert jump[row].min() < 0.0 and not pressed.any()
    placed = (jump + coarse.G @ alpha)[row].reshape(FIBRES, NODES)
    assert placed.min() > 0.01 - 1e-9 and np.abs(np.delete(placed, moved, axis=0) - 0.01).max() < 1e-12


def test_gaps_within_what_turns_as_one_move_nothing():
    """A coating and its fibre, bonded at one node, turn as one: their own gaps and slips are rounding of that."""
    n = 2 * NODES
    outer, inner = np.split(np.linalg.qr(np.vstack([fibre_modes(1.0), 0.9 * fibre_modes(1.0)]))[0], 2)
    kernels = np.zeros((2 * n, 0)), np.vstack([-outer, inner]), np.vstack([0 * outer, -inner])
    bodies = [
        SimpleNamespace(R=R, submesh=SimpleNamespace(body=k), held=(0,) * (k == 0), is_supported=False)
        for k, R in enumerate(kernels)
    ]
    space = coarse_space(bodies, [np.arange(2 * n)] * 3, hstack([identity(2 * n)] * 3))
    active, is_open = np.zeros(2 * n), np.zeros(n, bool)
    active[::2], active[n + 1], is_open[-3:] = 1.0, 1.0, True
    active[2 * np.flatnonzero(is_open)] = 0.0
    space.activate(active)
    assert space.unconstrained_modes.shape[1] == 1
    nodes = SimpleNamespace(row=2 * np.arange(n), bodies=np.repeat([[0, 1], [1, 2]], NODES, axis=0))
    jump = np.where(np.arange(2 * n) % 2, 0.0, -0.01)
    bodies = FloatingBodies(MPI.COMM_SELF, space, nodes, is_open, 1e-9)
    alpha, pressed = bodies.place(SimpleNamespace(jump=jump))
    assert not alpha.any() and not pressed.any()
    space.destroy()


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
