"""Saddle-point systems whose matrices are sums over ranks: solved by all ranks together, and each column by one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from feti_homog.common.petsc_ctypes import option_was_used
from feti_homog.common.petsc_options import case_options
from feti_homog.errors import CaseError
from feti_homog.feti.linalg.replicated_saddle_point import ReplicatedSaddlePoint
from feti_homog.feti.linalg.saddle_point import SaddlePoint

pytestmark = pytest.mark.parallel

KINDS = [SaddlePoint, ReplicatedSaddlePoint]
N, M = 40, 7


@pytest.fixture
def system():
    """E and K, the last row of which is the sum of the first two, and the motion that is free for it."""
    rng = np.random.default_rng(1)
    root = rng.standard_normal((N, N))
    K = rng.standard_normal((M, N))
    K[-1] = K[0] + K[1]
    null = np.eye(M)[[0, 1, -1]].T @ [1.0, 1.0, -1.0] / np.sqrt(3)
    return root @ root.T + np.eye(N), K, np.outer(null, null)


def parts(comm, matrix):
    """This rank's part of a matrix: no two ranks have the same, and their sum is the matrix."""
    weights = np.arange(comm.size) + 1.0
    return csr_matrix(matrix * weights[comm.rank] / weights.sum())


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("columns", [(), (1,), (2,), (3,), (5,)])
def test_solve_returns_the_unknowns_that_made_the_right_hand_side_on_every_rank(comm, system, kind, columns):
    E, K, free = system
    rng = np.random.default_rng(2)
    c, a = rng.standard_normal((N, *columns)), rng.standard_normal((M, *columns))
    saddle = kind(comm, parts(comm, E), parts(comm, K), csr_matrix(free), "test_")
    found, work = saddle.solve(E @ c + K.T @ a, K @ c)
    assert found.shape == c.shape and work.shape == a.shape
    np.testing.assert_allclose(found, c, atol=1e-10)
    np.testing.assert_allclose(K.T @ work, K.T @ a, atol=1e-8)
    for x in (found, work):
        assert (comm.bcast(x) == x).all()
    saddle.destroy()


@pytest.mark.parametrize("kind", KINDS)
def test_singular_systems_are_told_on_every_rank(comm, kind):
    E, K, free = (csr_matrix(np.full(shape, value)) for shape, value in (((3, 3), 1.0), ((1, 3), 0.0), ((1, 1), 0.0)))
    with pytest.raises(np.linalg.LinAlgError, match="singular"):
        kind(comm, E, K, free, "test_")


def test_a_fault_of_one_rank_is_told_on_every_rank(comm):
    """An indefinite factor, since no accuracy is enough; its matrix is singular on the last rank alone."""
    null_projector = csr_matrix([[0.0 if comm.rank == comm.size - 1 else 1.0]])
    E, K = parts(comm, np.eye(3)), csr_matrix((1, 3))
    with pytest.raises(np.linalg.LinAlgError, match="singular"):
        ReplicatedSaddlePoint(comm, E, K, null_projector, "test_", accuracy=-1.0)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("accuracy", "expected"), [(1e-11, True), (0.0, False)])
def test_well_conditioned_where_few_solves_are_enough(comm, system, kind, accuracy, expected):
    E, K, free = system
    # One rank that wants more is enough.
    own = accuracy if comm.rank == 0 or kind is SaddlePoint else 1e-11
    saddle = kind(comm, parts(comm, E), parts(comm, K), csr_matrix(free), "test_", own)
    assert saddle.well_conditioned == expected
    saddle.destroy()


@pytest.mark.parametrize("kind", KINDS)
def test_without_constraints_only_the_definite_block_is_solved(comm, system, kind):
    E, _, _ = system
    c = np.random.default_rng(3).standard_normal((N, 2))
    saddle = kind(comm, parts(comm, E), csr_matrix((0, N)), csr_matrix((0, 0)), "test_")
    found, work = saddle.solve(E @ c, np.zeros((0, 2)))
    np.testing.assert_allclose(found, c, atol=1e-10)
    assert work.shape == (0, 2)
    saddle.destroy()


LIBRARY = "test_pc_factor_mat_solver_type"


@pytest.mark.parametrize(
    ("kind", "library"), [*((kind, "mumps") for kind in KINDS), (ReplicatedSaddlePoint, "cholmod")]
)
def test_the_library_of_the_factor_is_an_option(comm, system, kind, library):
    E, K, free = system
    with case_options({LIBRARY: library}):
        saddle = kind(comm, parts(comm, E), parts(comm, K), csr_matrix(free), "test_", 1e-11)
        assert option_was_used(LIBRARY)
    inner = saddle.local if kind is ReplicatedSaddlePoint else saddle
    assert inner._inner.solver._ksp.getPC().getFactorSolverType() == library
    c = np.arange(N) + 1.0
    np.testing.assert_allclose(saddle.solve(E @ c, K @ c)[0], c, rtol=1e-9)
    saddle.destroy()


def test_cholmod_factors_no_distributed_matrix(comm, system):
    E, K, free = system
    arguments = comm, parts(comm, E), parts(comm, K), csr_matrix(free), "test_", 1e-11
    with case_options({LIBRARY: "cholmod"}):
        if comm.size == 1:
            SaddlePoint(*arguments).destroy()
            return
        with pytest.raises(CaseError) as caught:
            SaddlePoint(*arguments)
    assert caught.value.faults == (
        f"-{LIBRARY} cholmod: it has no cholesky factorization of a matrix on {comm.size} ranks; mumps has",
    )


def test_a_library_that_petsc_does_not_have_is_refused(comm, system):
    E, K, free = system
    with (
        case_options({LIBRARY: "cholmud"}),
        pytest.raises(CaseError, match="cholmud: it has no cholesky factorization"),
    ):
        SaddlePoint(comm, parts(comm, E), parts(comm, K), csr_matrix(free), "test_")
