"""Parts of what rank 0 has, one for each rank, parts that it gets from them, and parts that all have for all."""

from __future__ import annotations

from typing import TypeVar

from mpi4py import MPI
from mpi4py.util import pkl5

T = TypeVar("T")


def deal(comm: MPI.Intracomm, parts: list[T]) -> T:
    """Part r of rank 0's list on rank r; the list is empty afterwards.  Collective.

    Arrays are sent from where they are, of any size: a scatter would pickle all parts at once, its own too, and fails
    from 2 GiB on.
    """
    large = pkl5.Intracomm(comm)
    if comm.rank:
        received: T = large.recv(source=0)
        return received
    while len(parts) > 1:
        large.send(parts.pop(), dest=len(parts))
    return parts.pop()


def collect(comm: MPI.Intracomm, part: T) -> list[T]:
    """The parts of all ranks, by rank, on rank 0, and none on others; of any size, as `deal`.  Collective."""
    large = pkl5.Intracomm(comm)
    if comm.rank:
        large.send(part, dest=0)
        return []
    return [part, *(large.recv(source=r) for r in range(1, comm.size))]


def swap(comm: MPI.Intracomm, parts: list[T]) -> list[T]:
    """Part r on rank r, of the parts of each rank; those of all ranks in their order.  Collective; of any size."""
    large = pkl5.Intracomm(comm)
    received = list(parts)
    for step in range(1, comm.size):
        to, source = (comm.rank + step) % comm.size, (comm.rank - step) % comm.size
        request = large.isend(parts[to], dest=to)
        received[source] = large.recv(source=source)
        request.wait()
    return received
