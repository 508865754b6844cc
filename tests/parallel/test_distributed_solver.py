"""Solves with sums over ranks of sparse parts."""

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc
from scipy.sparse import coo_matrix, csr_matrix, kronsum, spdiags

from feti_homog.errors import CaseError
from feti_homog.feti.linalg import sparse_matrices
from feti_homog.feti.linalg.sparse_matrices import DistributedSolver
from feti_homog.feti.thresholds import REPLICATED_UNKNOWNS
from feti_homog.system.petsc.c_functions import option_was_used
from feti_homog.system.petsc.options_database import case_options

pytestmark = pytest.mark.parallel


# The largest matrix that every rank factors whole: any, or none.
most_whole = pytest.mark.parametrize("most_whole", [REPLICATED_UNKNOWNS, 0], ids=["replicated", "together"])


KINDS = {
    "factor": {},
    "mumps": {"feti_coarse_pc_factor_mat_solver_type": "mumps"},
    "cg": {"feti_coarse_ksp_type": "cg", "feti_coarse_pc_type": "jacobi", "feti_coarse_ksp_rtol": 1e-13},
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


def made(comm, total, unknowns, part, most_whole=0):
    """Return the solver that the options ask for."""
    solver = DistributedSolver(comm, total, "feti_coarse_", most_whole)
    solver.factor(unknowns, part)
    return solver


def by_blocks(comm, n):
    """Each rank has a block of the unknowns first."""
    return np.arange(n) * comm.size // n


@pytest.mark.parametrize("columns", [(), (1,), (2,), (7,)])
@pytest.mark.parametrize("kind", KINDS)
@most_whole
def test_the_sum_of_the_parts_is_solved(comm, most_whole, kind, columns):
    A = grid(8)
    unknowns, part = share(comm, A, by_blocks(comm, A.shape[0]))
    x = np.random.default_rng(3).standard_normal((A.shape[0], *columns))
    with case_options(KINDS[kind]):
        solver = made(comm, A.shape[0], unknowns, part, most_whole)
    assert solver.iterations == 1 or kind == "cg"
    # The parts of the right-hand side sum to A x.
    found = solver.solve(part @ x[unknowns])
    solver.destroy()
    np.testing.assert_allclose(found, x[unknowns], atol=1e-12)


@pytest.mark.parametrize("holder", ["first", "last", "every second", "scattered"])
def test_ranks_may_have_few_unknowns_of_their_own_or_none(comm, holder):
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
    solver = made(comm, A.shape[0], unknowns, part)
    np.testing.assert_allclose(solver.solve(part @ x[unknowns]), x[unknowns], atol=1e-13)
    solver.destroy()


def test_an_unknown_that_every_rank_has(comm):
    """And no others."""
    part = csr_matrix(np.array([[2.0, 1.0], [1.0, 3.0]]))
    solver = made(comm, 2, np.arange(2), part)
    np.testing.assert_allclose(solver.solve(np.array([4.0, 7.0])), [1.0, 2.0], rtol=1e-14)


def test_digits_are_those_of_a_factor_of_the_whole(comm):
    """Stiffnesses that differ by 1e8, as of fibres and their matrix, scaled to a unit diagonal."""
    side = 12
    stiff = np.where(np.arange(side * side) // 3 % 2, 1.0, 1e8)
    A = grid(side).toarray() * np.sqrt(np.minimum.outer(stiff, stiff))
    A[np.diag_indices_from(A)] = -(A.sum(axis=1) - A.diagonal()) + 1e-6 * stiff
    weight = 1.0 / np.sqrt(A.diagonal())
    A = csr_matrix(A * np.outer(weight, weight))
    unknowns, part = share(comm, A, by_blocks(comm, A.shape[0]))
    b = np.random.default_rng(5).standard_normal(A.shape[0])
    solver = made(comm, A.shape[0], unknowns, part)
    own = b[unknowns] / np.bincount(np.concatenate(comm.allgather(unknowns)))[unknowns]
    x = np.zeros(A.shape[0])
    x[unknowns] = solver.solve(own)
    residual = np.zeros(A.shape[0])
    residual[unknowns] = part @ x[unknowns] - own
    comm.Allreduce(MPI.IN_PLACE, residual)
    assert np.abs(residual).max() < 1e-12 * np.abs(x).max()


@pytest.mark.parametrize("kind", ["factor", "mumps"])
def test_a_matrix_that_is_not_definite_is_reported_on_every_rank(comm, kind):
    """Try unknowns that all ranks have, and unknowns that the last rank alone has."""
    shared = np.arange(2), csr_matrix(np.ones((2, 2)) / comm.size)
    u = 2 if comm.rank == comm.size - 1 else 0
    own = [(np.arange(u), csr_matrix(wrong[:u, :u])) for wrong in (np.ones((2, 2)), np.array([[1.0, 2.0], [2.0, 1.0]]))]
    for unknowns, part in (shared, *own):
        with case_options(KINDS[kind]), pytest.raises(np.linalg.LinAlgError):
            made(comm, 2, unknowns, part)


def test_a_fault_of_one_rank_is_reported_on_every_rank(comm, monkeypatch):
    """The first rank alone finds the matrix singular, as rounding may cause."""
    A = grid(6)
    unknowns, part = share(comm, A, by_blocks(comm, A.shape[0]))
    factored = sparse_matrices.factored

    def singular_on_the_first(*arguments):
        factor = factored(*arguments)
        if comm.rank == 0:
            raise np.linalg.LinAlgError("zero pivot")
        return factor

    monkeypatch.setattr(sparse_matrices, "factored", singular_on_the_first)
    with pytest.raises(np.linalg.LinAlgError, match="zero pivot" if comm.rank == 0 else "on another rank"):
        made(comm, A.shape[0], unknowns, part)


def test_a_matrix_may_change(comm):
    """Each factor takes the place of the one before; nothing is left after `destroy`."""
    A = grid(6)
    unknowns, part = share(comm, A, by_blocks(comm, A.shape[0]))
    solver, x = made(comm, A.shape[0], unknowns, part), np.cos(np.arange(A.shape[0]))
    for factor in (2.0, 0.5):
        solver.factor(unknowns, factor * part)
        np.testing.assert_allclose(solver.solve(part @ x[unknowns]), x[unknowns] / factor, atol=1e-12)
    solver.destroy()
    with pytest.raises(AssertionError, match="no matrix is factored"):
        solver.solve(part @ x[unknowns])


LIBRARY = "feti_coarse_pc_factor_mat_solver_type"


@pytest.mark.parametrize("library", ["mumps", "cholmod", None])
@most_whole
def test_the_library_is_an_option(comm, most_whole, library):
    """CHOLMOD is the default of a rank alone, MUMPS of several together; CHOLMOD factors no distributed matrix."""
    default = "cholmod" if comm.size == 1 or most_whole else "mumps"
    unknowns, part = np.arange(2) + 2 * comm.rank, csr_matrix(np.array([[2.0, 1.0], [1.0, 3.0]]))
    if library == "cholmod" and default == "mumps":
        pytest.skip("see the next test")
    with case_options({LIBRARY: library} if library else {}):
        solver = made(comm, 2 * comm.size, unknowns, part, most_whole)
        assert option_was_used(LIBRARY) or not library
    assert solver._ksp.getPC().getFactorSolverType() == (library or default)
    np.testing.assert_allclose(solver.solve(part @ [1.0, 2.0]), [1.0, 2.0], rtol=1e-12)
    solver.destroy()


def test_cholmod_factors_no_distributed_matrix(comm):
    arguments = comm, 2, np.arange(2), csr_matrix(np.eye(2))
    with case_options({LIBRARY: "cholmod"}):
        if comm.size == 1:
            made(*arguments).destroy()
            return
        with pytest.raises(CaseError) as caught:
            made(*arguments)
    assert caught.value.faults == (
        f"-{LIBRARY} cholmod: no cholesky factorization of a matrix on {comm.size} ranks; expected mumps",
    )


@pytest.mark.parametrize("rank", [0, -1])
def test_a_library_that_petsc_does_not_have_is_refused_on_every_rank(comm, rank):
    """Though only one rank has unknowns of its own."""
    unknowns = np.arange(2 if comm.rank == rank % comm.size else 0)
    PETSc.Options()[LIBRARY] = "cholmud"  # options of a case are refused before
    try:
        with pytest.raises(CaseError, match="cholmud: no cholesky factorization"):
            made(comm, 2, unknowns, csr_matrix(np.eye(len(unknowns))))
    finally:
        PETSc.Options().delValue(LIBRARY)
