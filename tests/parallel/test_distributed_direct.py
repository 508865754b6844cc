"""Solves by one factor of all ranks, for one and for many right-hand sides."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_matrix, diags, kronsum

from feti_homog.common.petsc_options import case_options
from feti_homog.feti.linalg import distributed_direct
from feti_homog.feti.linalg.distributed_direct import (
    DistributedDirectSolver,
    ReplicatedDirectSolver,
    direct_solver,
)

pytestmark = pytest.mark.parallel


def parts(comm, matrix):
    """This rank's part of a matrix: no two ranks have the same, and their sum is the matrix."""
    weights = np.arange(comm.size) + 1.0
    return csr_matrix(matrix * weights[comm.rank] / weights.sum())


@pytest.mark.parametrize("kind", [DistributedDirectSolver, ReplicatedDirectSolver])
@pytest.mark.parametrize("definite", [True, False])
@pytest.mark.parametrize("ksp", ["preonly", "cg"])
@pytest.mark.parametrize("columns", [(), (1,), (2,), (7,)])
def test_columns_are_solved_for_as_each_alone(comm, kind, definite, ksp, columns):
    line = diags([-1.0, 2.1, -1.0], [-1, 0, 1], (9, 9))
    A = kronsum(line, line).tocsr()
    x = np.random.default_rng(3).standard_normal((A.shape[0], *columns))
    with case_options({"test_ksp_type": ksp, "test_ksp_rtol": 1e-13}):
        solver = kind(comm, parts(comm, A), "test_", definite)
        found = solver.solve(A @ x)
        solver.destroy()
    assert found.shape == x.shape
    np.testing.assert_allclose(found, x, atol=1e-12)
    assert (comm.bcast(found) == found).all()


def test_a_rank_may_have_no_rows(comm):
    solver = DistributedDirectSolver(comm, parts(comm, np.array([[4.0]])), "test_", definite=True)
    np.testing.assert_allclose(solver.solve(np.array([[2.0, 6.0]])), [[0.5, 1.5]])
    solver.destroy()


@pytest.mark.parametrize("replicate", [True, False])
def test_a_singular_matrix_is_told_on_every_rank(comm, replicate):
    with pytest.raises(np.linalg.LinAlgError, match="singular"):
        direct_solver(comm, parts(comm, np.ones((2, 2))), "test_", definite=True, replicate=replicate)


def test_a_fault_of_one_rank_is_told_on_every_rank(comm, monkeypatch):
    """As rounding may be where processors differ: the last rank alone finds its copy of the matrix singular."""
    if comm.rank == comm.size - 1:
        solver = distributed_direct.DirectSolver
        monkeypatch.setattr(distributed_direct, "DirectSolver", lambda A, prefix: solver(0.0 * A, prefix))
    with pytest.raises(np.linalg.LinAlgError, match="singular"):
        direct_solver(comm, parts(comm, np.eye(2)), "test_", definite=True, replicate=True)
