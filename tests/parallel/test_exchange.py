"""Rows and objects that all ranks send to all."""

from __future__ import annotations

import numpy as np
import pytest

from feti_homog.common.dealing import swap
from feti_homog.common.exchange import exchange

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
    for source, part in enumerate(swap(comm, parts)):
        assert (part["from"], part["to"], len(part["array"])) == (source, comm.rank, comm.rank)
