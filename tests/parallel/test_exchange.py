"""Rows and objects that all ranks send to all, and multipliers that neighbours exchange."""

import numpy as np
import pytest

from feti_homog.feti.thresholds import KEPT_EXCHANGES
from feti_homog.system.parallel.distributed_arrays import alltoall, exchange

pytestmark = [pytest.mark.parallel, pytest.mark.quick]


def test_rows_go_where_they_should_in_order(comm):
    """Row i of rank r is (r, i), and goes to rank (r + i) mod p."""
    rows = np.column_stack([np.full(7, comm.rank), np.arange(7)])
    found, values, flags = exchange(comm, rows.sum(axis=1) % comm.size, rows, rows[:, 1] / 3.0, rows[:, 1] > 3)
    expected = [(r, i) for r in range(comm.size) for i in range(7) if (r + i) % comm.size == comm.rank]
    assert [tuple(row) for row in found.tolist()] == expected
    assert np.array_equal(values, found[:, 1] / 3.0) and np.array_equal(flags, found[:, 1] > 3)


def test_no_rows_and_rows_of_matrices(comm):
    none, matrices = np.zeros(0, np.int64), np.full((2, 2, 3), float(comm.rank))
    (found,) = exchange(comm, none, np.zeros((0, 2, 3)))
    assert found.shape == (0, 2, 3)
    (found,) = exchange(comm, np.zeros(2, np.int64), matrices)
    assert np.array_equal(found[:, 0, 0], np.repeat(np.arange(comm.size), 2) if comm.rank == 0 else none)


def test_parts_are_swapped(comm):
    parts = [{"from": comm.rank, "to": r, "array": np.arange(r)} for r in range(comm.size)]
    for source, part in enumerate(alltoall(comm, parts)):
        assert (part["from"], part["to"], len(part["array"])) == (source, comm.rank, comm.rank)


def test_vectors_of_few_counts_of_columns_are_kept(comm, torn):
    """The columns of influence come in batches of any size; those that were used last stay."""
    jump = torn(geometry="square", mesh_size=0.3).solver.jump_operator
    copies = np.bincount(np.concatenate(comm.allgather(jump.rows)), minlength=jump.global_rows)
    own = np.arange(*jump.owned)
    first = jump._exchange(own)
    for columns in (1, 3, 7, 2, 3, 5, 9, 3):
        wave = np.arange(1.0, columns + 1)
        local = jump.gather(np.cos(np.outer(own, wave)))
        assert np.array_equal(local, np.cos(np.outer(jump.rows, wave)))
        np.testing.assert_allclose(jump.sum(local), copies[own, None] * np.cos(np.outer(own, wave)), atol=1e-13)
        assert len(jump._exchanges) <= KEPT_EXCHANGES
    assert 1 not in jump._exchanges and 3 in jump._exchanges
    assert comm.size == 1 or not (first._owned or first._local or first._scatter)
