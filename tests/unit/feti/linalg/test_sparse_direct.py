"""Direct solvers of one rank, and what they leave behind."""

import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from scipy.sparse import csr_matrix, diags, kronsum

from feti_homog.feti.linalg.dense_matrices import check_lapack, cholesky, invert_upper, schur_complement
from feti_homog.feti.linalg.sparse_direct import DirectSolver, power_of_two
from feti_homog.feti.linalg.sparse_matrices import DistributedSolver, assemble_owned_rows, sum_of_blocks
from feti_homog.system.petsc.options_database import case_options
from feti_homog.system.runtime import process

PAGE, MEGABYTE = 4096, 2**20


def grid(n=60):
    """(n^2, n^2) a definite matrix."""
    line = diags([-1.0, 2.1, -1.0], [-1, 0, 1], (n, n))
    return csr_matrix(kronsum(line, line))


def resident():
    process.trim_memory()
    return int(Path("/proc/self/statm").read_text().split()[1]) * PAGE


@pytest.mark.parametrize("columns", [(), (1,), (3,), (40,)])
def test_solvers_return_the_unknowns_that_made_the_right_hand_side(columns):
    A = grid(12)
    x = np.random.default_rng(0).standard_normal((A.shape[0], *columns))
    np.testing.assert_allclose(DirectSolver(A, "test_").solve(A @ x), x, atol=1e-10)


def solved_with_a_near_kernel(A, numbers):
    """Solve by the solver of all ranks."""
    solver = DistributedSolver(MPI.COMM_WORLD, len(numbers), "test_")
    solver.factor(numbers, A, np.ones((len(numbers), 3)))
    solver.solve(np.ones((len(numbers), 20)))
    solver.destroy()


@pytest.mark.slow
@pytest.mark.parametrize(
    "make",
    [
        lambda A: DirectSolver(A, "test_").solve(np.ones((A.shape[0], 20))),
        lambda A: solved_with_a_near_kernel(A, np.arange(A.shape[0])),
        lambda A: assemble_owned_rows(MPI.COMM_WORLD, A, np.arange(A.shape[0]), np.arange(A.shape[0]), A.shape),
    ],
    ids=["factored", "with a near-kernel", "assembled"],
)
def test_nothing_is_left_of_a_factor(make):
    """A path makes one at every event."""
    A = grid()
    for _ in range(5):
        make(A)
    before = resident()
    for _ in range(100):
        make(A)
    # A hundred matrices alone would be 20 MB.
    assert resident() - before < 8 * MEGABYTE


def test_a_factor_does_not_keep_its_matrix():
    """A dense matrix is twice as large as its factor."""
    A = csr_matrix(np.eye(400) + np.ones((400, 400)))
    tracemalloc.start()
    solver = DirectSolver(A, "test_")
    kept = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert kept < 0.1 * A.data.nbytes
    np.testing.assert_allclose(solver.solve(A @ np.ones((400, 40))), 1.0, rtol=1e-10)


def test_a_factor_can_be_freed_before_its_owner():
    before, kept = resident(), []
    for _ in range(60):
        kept.append(DirectSolver(grid(), "test_"))
        kept[-1].destroy()
        kept[-1].destroy()
    assert resident() - before < 8 * MEGABYTE


def test_sum_of_blocks_does_not_depend_on_the_buffer():
    rng = np.random.default_rng(2)
    for entries in (1, 50, 10**6):
        blocks, expected = [], np.zeros((20, 15))
        for _ in range(30):
            rows, columns = rng.choice(20, 4, replace=False), rng.choice(15, 3, replace=False)
            values = rng.standard_normal((4, 3))
            blocks.append((rows, columns, values))
            expected[np.ix_(rows, columns)] += values
        np.testing.assert_allclose(sum_of_blocks((20, 15), blocks, entries).toarray(), expected, atol=1e-12)


SMALL, LARGE = 3, 40  # rows of grids of which CHOLMOD makes simplicial and supernodal factors
LIBRARIES = ["cholmod", "mumps", "petsc"]
# The first is a power of four, of which also the root has the same digits.
SCALES = [2.0**-300, 2.0**-301, 2.0**301]


def spoilt(n, value):
    """Return a matrix with another diagonal entry in the middle."""
    A = grid(n).tolil()
    A[n * n // 2, n * n // 2] = value
    return csr_matrix(A)


def with_zero_row(value):
    """Return a grid with an entry of its own."""
    A = grid(SMALL).tolil()
    A[4], A[:, 4] = 0.0, 0.0
    A[4, 4] = value
    return csr_matrix(A)


WRONG = {
    "indefinite": csr_matrix([[1.0, 2.0], [2.0, 1.0]]),
    "negative": csr_matrix(-np.eye(3)),
    "small grid": spoilt(SMALL, -1.0),
    "large grid": spoilt(LARGE, -1.0),
    "singular": csr_matrix(np.ones((2, 2))),
    "no number": spoilt(SMALL, np.nan),
    "infinite": spoilt(SMALL, np.inf),
}


def options(library, prefix="feti_sub_"):
    return case_options({f"{prefix}pc_factor_mat_solver_type": library})


def of_all_ranks(matrix, right):
    """Solved by the solver of all ranks, on one."""
    solver = DistributedSolver(MPI.COMM_SELF, len(right), "feti_natural_")
    solver.factor(np.arange(len(right)), matrix)
    return solver.solve(right)


@pytest.mark.parametrize("library", LIBRARIES)
@pytest.mark.parametrize("name", WRONG)
def test_every_library_refuses_a_matrix_that_is_not_definite(library, name):
    with options(library), pytest.raises(np.linalg.LinAlgError):
        DirectSolver(WRONG[name].copy(), "feti_sub_")


@pytest.mark.parametrize("library", ["mumps", "petsc"])
def test_triangular_factors_of_other_kinds_may_exchange_pivots(library):
    """LU needs no definite matrix."""
    A = np.random.default_rng(1).standard_normal((200, 200))
    A, x = csr_matrix(A + A.T), np.cos(np.arange(200.0))
    with options(library), case_options({"feti_sub_pc_type": "lu"}):
        np.testing.assert_allclose(DirectSolver(A, "feti_sub_").solve(A @ x), x, atol=1e-9)


@pytest.mark.parametrize("library", LIBRARIES)
@pytest.mark.parametrize("name", WRONG)
def test_the_solver_of_all_ranks_refuses_it(library, name):
    A = WRONG[name]
    with options(library, "feti_natural_"), pytest.raises(np.linalg.LinAlgError):
        DistributedSolver(MPI.COMM_SELF, A.shape[0], "feti_natural_").factor(np.arange(A.shape[0]), A)


def test_pivots_that_mumps_would_replace_are_refused():
    """Where it condenses it replaces pivots below about 1e-16, and only counts them."""
    rows = np.array([0, 8])
    with pytest.raises(np.linalg.LinAlgError, match=r"nearly singular \(MUMPS: INFOG\(25\) = 1 "):
        schur_complement(with_zero_row(1e-18), rows)
    schur_complement(with_zero_row(1e-12), rows)


@pytest.mark.parametrize(("value", "words"), [(-1.0, "not positive definite"), (np.nan, "not finite")])
def test_no_schur_complement_of_an_interior_that_is_not_definite(value, words):
    A = spoilt(SMALL, value)
    before = A.data.copy()
    with pytest.raises(np.linalg.LinAlgError, match=words):
        schur_complement(A, np.array([0, 8]))
    assert np.array_equal(A.data, before, equal_nan=True)


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("n", [SMALL, LARGE])
def test_a_power_of_two_changes_no_digit(scale, n):
    A, b = grid(n), np.cos(np.arange(n * n))
    rows, B = np.arange(0, n * n, n), np.stack([b, b[::-1], b**2], axis=1)
    assert (schur_complement(scale * A, rows) == scale * schur_complement(A, rows)).all()
    for right in (b, B):
        assert (
            DirectSolver(scale * A, "feti_sub_").solve(right) == DirectSolver(A, "feti_sub_").solve(right) / scale
        ).all()
        for library in LIBRARIES:
            with options(library, "feti_natural_"):
                assert (of_all_ranks(scale * A, right) == of_all_ranks(A, right) / scale).all()


def test_scales_are_powers_of_two():
    for size in (1.0, 1.5, 3.0, 1e-200, 1e200, 5e-324):
        scale = power_of_two(np.array([-9.0, 0.0, size]))
        assert np.frexp(scale)[0] == 0.5 and (1.0 <= size * scale < 2.0 or size < 1e-300)
    assert power_of_two(np.zeros(2)) == power_of_two(np.zeros(0)) == 1.0


@pytest.mark.parametrize("place", [(0, 0), (4, 4), (4, 0)])
def test_lapack_refuses_what_is_no_number(place):
    """Its own info is 0."""
    A = np.asfortranarray(np.eye(5))
    A[place] = A[place[::-1]] = np.nan
    for refused in (lambda: cholesky(A.copy("F")), lambda: invert_upper(A.copy("F"))):
        with pytest.raises(np.linalg.LinAlgError):
            refused()


def test_info_of_lapack_is_read():
    check_lapack("dpotrf", 0)
    with pytest.raises(np.linalg.LinAlgError, match="dpotrf: LAPACK info 3"):
        check_lapack("dpotrf", 3)
    with pytest.raises(ValueError, match="argument 2 is illegal"):
        check_lapack("dtrtri", -2)
    with pytest.raises(np.linalg.LinAlgError, match="LAPACK info 2"):
        cholesky(np.array([[1.0, 2.0], [2.0, 1.0]], order="F"))
