"""Collective calls are counted by name, on every rank, and only within the block."""

from __future__ import annotations

import numpy as np
import pytest
from collective_calls import collective_calls
from mpi4py import MPI

pytestmark = pytest.mark.parallel


def test_calls_are_counted():
    comm = MPI.COMM_WORLD
    comm.Barrier()
    with collective_calls() as calls:
        comm.allreduce(1)
        for _ in range(3):
            comm.Allreduce(MPI.IN_PLACE, np.zeros(2))
        MPI.COMM_SELF.bcast(None)
    comm.Barrier()
    assert calls == {"allreduce": 1, "Allreduce": 3, "bcast": 1}
