"""Solves by one factor of all ranks, for one and for many right-hand sides."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_matrix, diags, kronsum

from feti_homog.common.petsc_ctypes import option_was_used
from feti_homog.common.petsc_options import case_options
from feti_homog.errors import CaseError
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
@pytest.mark.parametrize("ksp", ["preonly", "cg"])
@pytest.mark.parametrize("columns", [(), (1,), (2,), (7,)])
def test_columns_are_solved_for_as_each_alone(comm, kind, ksp, columns):
    line = diags([-1.0, 2.1, -1.0], [-1, 0, 1], (9, 9))
    A = kronsum(line, line).tocsr()
    x = np.random.default_rng(3).standard_normal((A.shape[0], *columns))
    with case_options({"test_ksp_type": ksp, "test_ksp_rtol": 1e-13}):
        solver = kind(comm, parts(comm, A), "test_")
        found = solver.solve(A @ x)
        solver.destroy()
    assert found.shape == x.shape
    np.testing.assert_allclose(found, x, atol=1e-12)
    assert (comm.bcast(found) == found).all()


def test_a_rank_may_have_no_rows(comm):
    solver = DistributedDirectSolver(comm, parts(comm, np.array([[4.0]])), "test_")
    np.testing.assert_allclose(solver.solve(np.array([[2.0, 6.0]])), [[0.5, 1.5]])
    solver.destroy()


@pytest.mark.parametrize("replicate", [True, False])
def test_a_singular_matrix_is_told_on_every_rank(comm, replicate):
    with pytest.raises(np.linalg.LinAlgError, match="singular"):
        direct_solver(comm, parts(comm, np.ones((2, 2))), "test_", replicate=replicate)


def test_a_fault_of_one_rank_is_told_on_every_rank(comm, monkeypatch):
    """As rounding may be where processors differ: the last rank alone finds its copy of the matrix singular."""
    if comm.rank == comm.size - 1:
        solver = distributed_direct.DirectSolver
        monkeypatch.setattr(distributed_direct, "DirectSolver", lambda A, *options: solver(0.0 * A, *options))
    with pytest.raises(np.linalg.LinAlgError, match="singular"):
        direct_solver(comm, parts(comm, np.eye(2)), "test_", replicate=True)


LIBRARY = "test_pc_factor_mat_solver_type"


@pytest.mark.parametrize(("replicate", "library"), [(False, "mumps"), (True, "mumps"), (True, "cholmod")])
def test_the_library_of_the_factor_is_an_option(comm, replicate, library):
    A = np.array([[2.0, 1.0], [1.0, 3.0]])
    with case_options({LIBRARY: library}):
        solver = direct_solver(comm, parts(comm, A), "test_", replicate)
        assert option_was_used(LIBRARY)
    own = solver.local if isinstance(solver, ReplicatedDirectSolver) else solver
    assert own._ksp.getPC().getFactorSolverType() == library
    np.testing.assert_allclose(solver.solve(A @ [1.0, 2.0]), [1.0, 2.0], rtol=1e-12)
    solver.destroy()


def test_cholmod_factors_no_distributed_matrix(comm):
    arguments = comm, parts(comm, np.eye(2)), "test_", False
    with case_options({LIBRARY: "cholmod"}):
        if comm.size == 1:
            direct_solver(*arguments).destroy()
            return
        with pytest.raises(CaseError) as caught:
            direct_solver(*arguments)
    assert caught.value.faults == (
        f"-{LIBRARY} cholmod: it has no cholesky factorization of a matrix on {comm.size} ranks; mumps has",
    )


def test_a_library_that_petsc_does_not_have_is_refused(comm):
    with (
        case_options({LIBRARY: "cholmud"}),
        pytest.raises(CaseError, match="cholmud: it has no cholesky factorization"),
    ):
        direct_solver(comm, parts(comm, np.eye(2)), "test_", False)
