"""Direct solvers of one rank, and what they leave behind."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from scipy.sparse import diags, kronsum

from feti_homog.feti.linalg.distributed_matrix import assemble_owned_rows
from feti_homog.feti.linalg.distributed_solver import DistributedSolver
from feti_homog.feti.linalg.sparse_direct import DirectSolver
from feti_homog.feti.linalg.sparse_matrices import DenseBlockSum
from feti_homog.runtime import process_memory

PAGE, MEGABYTE = 4096, 2**20


def laplacian(n=60):
    line = diags([-1, 2.1, -1], [-1, 0, 1], (n, n))
    return kronsum(line, line).tocsr()


def resident():
    process_memory.trim()
    return int(Path("/proc/self/statm").read_text().split()[1]) * PAGE


@pytest.mark.parametrize("columns", [(), (1,), (3,), (40,)])
def test_solvers_return_the_unknowns_that_made_the_right_hand_side(columns):
    A = laplacian(12)
    x = np.random.default_rng(0).standard_normal((A.shape[0], *columns))
    np.testing.assert_allclose(DirectSolver(A, "test_").solve(A @ x), x, atol=1e-10)


def solved_with_a_near_kernel(A, numbers):
    """By the solver of all ranks."""
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
    A = laplacian()
    for _ in range(5):
        make(A)
    before = resident()
    for _ in range(100):
        make(A)
    # A hundred matrices alone would be 20 MB.
    assert resident() - before < 8 * MEGABYTE


def test_a_factor_can_be_freed_before_its_owner():
    before, kept = resident(), []
    for _ in range(60):
        kept.append(DirectSolver(laplacian(), "test_"))
        kept[-1].destroy()
        kept[-1].destroy()
    assert resident() - before < 8 * MEGABYTE


def test_sum_of_blocks_does_not_depend_on_the_buffer():
    rng = np.random.default_rng(2)
    for entries in (1, 50, 10**6):
        blocks, expected = DenseBlockSum((20, 15), max_buffered_entries=entries), np.zeros((20, 15))
        for _ in range(30):
            rows, columns = rng.choice(20, 4, replace=False), rng.choice(15, 3, replace=False)
            values = rng.standard_normal((4, 3))
            blocks.add(rows, columns, values)
            expected[np.ix_(rows, columns)] += values
        np.testing.assert_allclose(blocks.matrix().toarray(), expected, atol=1e-12)
