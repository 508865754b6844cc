"""Collective calls are counted by name, on every rank and only within the block, and refused in guarded sections."""

import h5py
import numpy as np
import pytest
from collective_calls import CommunicationError, collective_calls, no_communication
from mpi4py import MPI
from petsc4py import PETSc

from feti_homog.system.parallel.mpi_errors import agree

pytestmark = pytest.mark.parallel

# What communicates, with a vector and a file that all ranks have.
COMMUNICATING = {
    "allreduce": lambda comm, *_: comm.allreduce(1),
    "begin of a barrier": lambda comm, *_: comm.Ibarrier(),
    "communicator of PETSc": lambda _, vector, __: vector.comm.tompi4py().bcast(1),
    "norm": lambda _, vector, __: vector.norm(),
    "new vector": lambda comm, *_: PETSc.Vec().createMPI(4, comm=comm),
    "new table": lambda *things: things[-1].create_dataset("table", (3,)),
    "attribute": lambda *things: things[-1].attrs.__setitem__("key", 1),
    "flush": lambda *things: things[-1].flush(),
}


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


@pytest.fixture
def things(comm, shared_path):
    """All ranks, and a vector and an HDF5 file that they share."""
    with h5py.File(shared_path / "shared.h5", "w", driver="mpio", comm=comm) as file:
        yield comm, PETSc.Vec().createMPI(4, comm=comm), file


@pytest.mark.parametrize("name", COMMUNICATING)
def test_agreement_refuses_what_communicates(things, name):
    comm = things[0]
    if comm.size == 1:
        COMMUNICATING[name](*things)
    else:
        with pytest.raises(CommunicationError, match="in a guarded section"):
            agree(comm, COMMUNICATING[name], *things)


def test_what_one_rank_does_for_itself_may_be_guarded(things, tmp_path):
    comm, vector, _ = things
    with no_communication():
        assert comm.size == vector.comm.size
        assert vector.getArray().sum() == PETSc.Vec().createMPI(4, comm=PETSc.COMM_SELF).norm() == 0.0
        assert MPI.COMM_SELF.allreduce(1) == 1
        with h5py.File(tmp_path / "own.h5", "w") as file:
            file["x"] = 1
