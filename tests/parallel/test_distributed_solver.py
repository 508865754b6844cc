"""Solves with sums over ranks of sparse parts, by elimination and by PETSc's solvers."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI
from scipy.sparse import coo_matrix, csr_matrix, kronsum, spdiags

from feti_homog.errors import CaseError
from feti_homog.feti.linalg import own_unknowns
from feti_homog.feti.linalg.distributed_solver import DistributedSolver, RenewedSolver
from feti_homog.feti.linalg.rank_tree import RankTree
from feti_homog.feti.linalg.tree_elimination import TreeElimination
from feti_homog.petsc.c_functions import option_was_used
from feti_homog.petsc.options import case_options

pytestmark = pytest.mark.parallel

KINDS = {
    "elimination": {},
    "own library": {"test_pc_factor_mat_solver_type": "mumps"},
    "one factor": {"test_pc_type": "cholesky"},
    "cg": {"test_ksp_type": "cg", "test_pc_type": "jacobi", "test_ksp_rtol": 1e-13},
}


def grid(side: int) -> csr_matrix:
    """Five-point stiffness of a torus of side^2 unknowns, definite."""
    ones = np.ones(side)
    line = spdiags([-ones, -ones, 2.1 * ones, -ones, -ones], [1 - side, -1, 0, 1, side - 1], side, side)
    return csr_matrix(kronsum(line, line))


def share(comm, matrix, holder):
    """Unknowns and part of this rank: the entries between unknowns of which it is the first `holder` (n,)."""
    C = coo_matrix(matrix)
    mine = np.minimum(holder[C.row], holder[C.col]) == comm.rank
    unknowns = np.unique(np.concatenate([C.row[mine], C.col[mine]])).astype(np.int64)
    at = (np.searchsorted(unknowns, i[mine]) for i in (C.row, C.col))
    return unknowns, csr_matrix((C.data[mine], tuple(at)), (len(unknowns),) * 2)


def made(comm, total, unknowns, part):
    """Return the solver that the options ask for."""
    solver = RenewedSolver(comm, total, unknowns, "test_")
    solver.factor(unknowns, part)
    return solver


def eliminated(comm, total, unknowns, part, block):
    """Elimination with blocks of so many columns."""
    return TreeElimination(RankTree(comm, total, unknowns), total, unknowns, part, "test_", block)


# Fronts are shared from two blocks a rank on: all, some or none of these.
some_blocks = pytest.mark.parametrize("block", [1, 3, 1000])


def by_blocks(comm, n):
    """Each rank has a block of the unknowns first."""
    return np.arange(n) * comm.size // n


@pytest.mark.parametrize("columns", [(), (1,), (2,), (7,)])
@pytest.mark.parametrize("kind", KINDS)
def test_the_sum_of_the_parts_is_solved(comm, kind, columns):
    A = grid(8)
    unknowns, part = share(comm, A, by_blocks(comm, A.shape[0]))
    x = np.random.default_rng(3).standard_normal((A.shape[0], *columns))
    with case_options(KINDS[kind]):
        solver = made(comm, A.shape[0], unknowns, part)
    assert isinstance(solver.current, DistributedSolver if kind in ("one factor", "cg") else TreeElimination)
    # The parts of the right-hand side sum to A x.
    found = solver.solve(part @ x[unknowns])
    solver.destroy()
    np.testing.assert_allclose(found, x[unknowns], atol=1e-12)


@some_blocks
@pytest.mark.parametrize("holder", ["first", "last", "every second", "scattered"])
def test_ranks_may_have_few_unknowns_of_their_own_or_none(comm, holder, block):
    A = grid(5)
    number = np.arange(A.shape[0])
    holders = {
        "first": 0 * number,
        "last": 0 * number + comm.size - 1,
        "every second": number % 2 % comm.size,
        "scattered": number * 7 % comm.size,
    }
    unknowns, part = share(comm, A, holders[holder])
    x = np.random.default_rng(4).standard_normal((A.shape[0], 3))
    solver = eliminated(comm, A.shape[0], unknowns, part, block)
    np.testing.assert_allclose(solver.solve(part @ x[unknowns]), x[unknowns], atol=1e-13)
    solver.destroy()


@some_blocks
def test_an_unknown_that_every_rank_has(comm, block):
    """And no others: nothing is eliminated before the last ranks meet."""
    part = csr_matrix(np.array([[2.0, 1.0], [1.0, 3.0]]))
    solver = eliminated(comm, 2, np.arange(2), part, block)
    np.testing.assert_allclose(solver.solve(np.array([4.0, 7.0])), [1.0, 2.0], rtol=1e-14)


@some_blocks
def test_digits_are_those_of_a_factor_of_the_whole(comm, block):
    """Stiffnesses that differ by 1e8, as of fibres and their matrix, scaled to a unit diagonal."""
    side = 12
    stiff = np.where(np.arange(side * side) // 3 % 2, 1.0, 1e8)
    A = grid(side).toarray() * np.sqrt(np.minimum.outer(stiff, stiff))
    A[np.diag_indices_from(A)] = -(A.sum(axis=1) - A.diagonal()) + 1e-6 * stiff
    weight = 1.0 / np.sqrt(A.diagonal())
    A = csr_matrix(A * np.outer(weight, weight))
    unknowns, part = share(comm, A, by_blocks(comm, A.shape[0]))
    b = np.random.default_rng(5).standard_normal(A.shape[0])
    solver = eliminated(comm, A.shape[0], unknowns, part, block)
    own = b[unknowns] / np.bincount(np.concatenate(comm.allgather(unknowns)))[unknowns]
    x = np.zeros(A.shape[0])
    x[unknowns] = solver.solve(own)
    residual = np.zeros(A.shape[0])
    residual[unknowns] = part @ x[unknowns] - own
    comm.Allreduce(MPI.IN_PLACE, residual)
    assert np.abs(residual).max() < 1e-12 * np.abs(x).max()


@pytest.mark.parametrize("kind", ["elimination", "one factor"])
def test_a_matrix_that_is_not_definite_is_told_on_every_rank(comm, kind):
    """Of unknowns that all ranks have, and of those that the last has for itself."""
    shared = np.arange(2), csr_matrix(np.ones((2, 2)) / comm.size)
    u = 2 if comm.rank == comm.size - 1 else 0
    own = [(np.arange(u), csr_matrix(wrong[:u, :u])) for wrong in (np.ones((2, 2)), np.array([[1.0, 2.0], [2.0, 1.0]]))]
    for unknowns, part in (shared, *own):
        with case_options(KINDS[kind]), pytest.raises(np.linalg.LinAlgError):
            made(comm, 2, unknowns, part)


def test_a_fault_of_one_rank_is_told_on_every_rank(comm, monkeypatch):
    """As rounding may be: the first rank alone finds its own unknowns singular."""
    A = grid(6)
    unknowns, part = share(comm, A, by_blocks(comm, A.shape[0]))
    if comm.rank == 0:
        solver = own_unknowns.DirectSolver
        monkeypatch.setattr(own_unknowns, "DirectSolver", lambda A, *options: solver(0.0 * A, *options))
    with pytest.raises(np.linalg.LinAlgError):
        made(comm, A.shape[0], unknowns, part)


@some_blocks
def test_a_front_that_is_not_definite_is_told_on_every_rank(comm, block):
    """Where the first two ranks meet, and, of unknowns that every rank has, the last front."""
    wrong = grid(8).toarray()
    first = -(-len(wrong) // comm.size) % len(wrong)
    wrong[first, first] = -1.0
    everywhere = np.arange(len(wrong)), csr_matrix(wrong / comm.size)
    for unknowns, part in (share(comm, wrong, by_blocks(comm, len(wrong))), everywhere):
        with pytest.raises(np.linalg.LinAlgError):
            eliminated(comm, len(wrong), unknowns, part, block)


LIBRARY = "test_pc_factor_mat_solver_type"


@pytest.mark.parametrize("library", ["mumps", "cholmod"])
def test_the_library_of_the_own_factor_is_an_option(comm, library):
    unknowns, part = np.arange(2) + 2 * comm.rank, csr_matrix(np.array([[2.0, 1.0], [1.0, 3.0]]))
    with case_options({LIBRARY: library}):
        solver = made(comm, 2 * comm.size, unknowns, part)
        assert option_was_used(LIBRARY)
    assert solver.current._own.solver._ksp.getPC().getFactorSolverType() == library
    np.testing.assert_allclose(solver.solve(part @ [1.0, 2.0]), [1.0, 2.0], rtol=1e-12)
    solver.destroy()


def test_cholmod_factors_no_distributed_matrix(comm):
    arguments = comm, 2, np.arange(2), csr_matrix(np.eye(2))
    with case_options({LIBRARY: "cholmod", "test_pc_type": "cholesky"}):
        if comm.size == 1:
            made(*arguments).destroy()
            return
        with pytest.raises(CaseError) as caught:
            made(*arguments)
    assert caught.value.faults == (
        f"-{LIBRARY} cholmod: it has no cholesky factorization of a matrix on {comm.size} ranks; mumps has",
    )


@pytest.mark.parametrize("rank", [0, -1])
def test_a_library_that_petsc_does_not_have_is_refused_on_every_rank(comm, rank):
    """Though only one rank has unknowns of its own."""
    unknowns = np.arange(2 if comm.rank == rank % comm.size else 0)
    with (
        case_options({LIBRARY: "cholmud"}),
        pytest.raises(CaseError, match="cholmud: it has no cholesky factorization"),
    ):
        made(comm, 2, unknowns, csr_matrix(np.eye(len(unknowns))))
