"""Saddle-point systems whose matrices are sums over ranks: solved by all ranks together, and each column by one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from feti_homog.common.petsc_ctypes import option_was_used
from feti_homog.common.petsc_options import case_options
from feti_homog.errors import CaseError
from feti_homog.feti.linalg.distributed_direct import ReplicatedDirectSolver
from feti_homog.feti.linalg.saddle_point import SaddlePoint
from feti_homog.feti.thresholds import INDEFINITE_COARSE_SOLVES

pytestmark = pytest.mark.parallel

KINDS = pytest.mark.parametrize("replicate", [False, True])
FEW = [(2, 1e-11)]
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


@KINDS
@pytest.mark.parametrize("columns", [(), (1,), (2,), (3,), (5,)])
def test_solve_returns_the_unknowns_that_made_the_right_hand_side_on_every_rank(comm, system, replicate, columns):
    E, K, free = system
    rng = np.random.default_rng(2)
    c, a = rng.standard_normal((N, *columns)), rng.standard_normal((M, *columns))
    saddle = SaddlePoint(comm, parts(comm, E), parts(comm, K), csr_matrix(free), "test_", replicate)
    found, work = saddle.solve(E @ c + K.T @ a, K @ c)
    assert found.shape == c.shape and work.shape == a.shape
    np.testing.assert_allclose(found, c, atol=1e-10)
    np.testing.assert_allclose(K.T @ work, K.T @ a, atol=1e-8)
    for x in (found, work):
        assert (comm.bcast(x) == x).all()
    saddle.destroy()


@KINDS
def test_singular_systems_are_told_on_every_rank(comm, replicate):
    E, K, free = (csr_matrix(np.full(shape, value)) for shape, value in (((3, 3), 1.0), ((1, 3), 0.0), ((1, 1), 0.0)))
    with pytest.raises(np.linalg.LinAlgError, match="singular"):
        SaddlePoint(comm, E, K, free, "test_", replicate)


@KINDS
@pytest.mark.parametrize(
    ("enough", "solves", "expected"),
    [
        ([(2, 1e-11), (3, 1e-14)], 2, True),
        ([(2, -1.0), (3, 1e-11)], 3, True),
        ([(2, -1.0), (4, 1e-11)], 4, False),
        ([(3, -1.0)], INDEFINITE_COARSE_SOLVES, False),
    ],
)
def test_well_conditioned_where_few_solves_are_enough(comm, system, replicate, enough, solves, expected):
    E, K, free = system
    saddle = SaddlePoint(comm, parts(comm, E), parts(comm, K), csr_matrix(free), "test_", replicate, enough)
    assert (saddle._solves, saddle.well_conditioned) == (solves, expected)
    saddle.destroy()


@KINDS
def test_without_constraints_only_the_definite_block_is_solved(comm, system, replicate):
    E, _, _ = system
    c = np.random.default_rng(3).standard_normal((N, 2))
    saddle = SaddlePoint(comm, parts(comm, E), csr_matrix((0, N)), csr_matrix((0, 0)), "test_", replicate)
    found, work = saddle.solve(E @ c, np.zeros((0, 2)))
    np.testing.assert_allclose(found, c, atol=1e-10)
    assert work.shape == (0, 2)
    saddle.destroy()


LIBRARY = "test_pc_factor_mat_solver_type"


@pytest.mark.parametrize(("replicate", "library"), [(False, "mumps"), (True, "mumps"), (True, "cholmod")])
def test_the_library_of_the_factor_is_an_option(comm, system, replicate, library):
    E, K, free = system
    with case_options({LIBRARY: library}):
        saddle = SaddlePoint(comm, parts(comm, E), parts(comm, K), csr_matrix(free), "test_", replicate, FEW)
        assert option_was_used(LIBRARY)
    solver = saddle._inner.solver
    own = solver.local if isinstance(solver, ReplicatedDirectSolver) else solver
    assert own._ksp.getPC().getFactorSolverType() == library
    c = np.arange(N) + 1.0
    np.testing.assert_allclose(saddle.solve(E @ c, K @ c)[0], c, rtol=1e-9)
    saddle.destroy()


def test_cholmod_factors_no_distributed_matrix(comm, system):
    E, K, free = system
    arguments = comm, parts(comm, E), parts(comm, K), csr_matrix(free), "test_", False, FEW
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
        SaddlePoint(comm, parts(comm, E), parts(comm, K), csr_matrix(free), "test_", False)
